//! External forces as arguments: constants, formulas of the time, and recorded columns.

use crate::CliError;
use crate::arguments::number::{choice, finite, index_of};
use crate::arguments::recording_args::unit;
use crate::terminal::output;
use crate::thresholds::{MAX_STATES_BYTES, ROUNDING_OF_TIMES};
use lnn::lagrangian::NamedFormula;
use lnn::names::unknown;
use lnn::network::file::Header;
use lnn::pipeline::usual_force;
use lnn::recording::{NumberTable, TIME, factor};
use lnn::rollout::{Between, Force, SampledForce};
use lnn::storage::read_regular;
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct ForceArgs {
    /// External generalized forces that drive the motion: NAME=VALUE, a constant (N, N m) or a formula of the time t such as
    /// 0.3*cos(1.2*t), or a CSV with a column of time and columns of forces, joined as --between says; may be repeated, one CSV at most.
    /// NAME is the column of the data that the model was fitted to, or COORDINATE_force. Forces that are not named are 0. Inputs of a system
    /// file are given in the same way, by their names, all of them.
    #[arg(long, value_name = "FILE.csv|NAME=VALUE", allow_hyphen_values = true)]
    force: Vec<String>,
    /// Column of time of the forces' CSV; if not given, the one called t or time.
    #[arg(long, value_name = "COLUMN", requires = "force")]
    force_time: Option<String>,
    /// Units of columns of the forces' CSV that are not SI, or factors to SI, such as t=ms,tau1=mN.
    #[arg(long, value_name = "COLUMN=UNIT", value_delimiter = ',', value_parser = unit, requires = "force")]
    force_units: Vec<(String, String)>,
    /// Interpolation of the forces between the rows of the CSV; for an identified system, the one that `lnn identify` reports [default:
    /// linear].
    #[arg(long, value_parser = choice(&Between::ALL, Between::name, Between::about), value_name = "NAME", requires = "force")]
    between: Option<Between>,
}

/// External forces and inputs, from all sources.
#[derive(Clone)]
pub struct KnownForce {
    /// Recorded and constant forces; 0 where there is a formula.
    sampled: SampledForce<f64>,
    /// Formulas of the time, by component.
    formulas: Vec<(usize, NamedFormula)>,
}

impl KnownForce {
    /// Selects some of the components, in order.
    pub fn components(&self, of: Range<usize>) -> Self {
        let own = self.formulas.iter().filter(|(i, _)| of.contains(i));
        let formulas = own.map(|(i, formula)| (i - of.start, formula.clone())).collect();
        Self { sampled: self.sampled.components(of), formulas }
    }

    /// `true` if all components are always 0.
    pub fn is_zero(&self) -> bool {
        self.formulas.is_empty() && self.sampled.is_zero()
    }

    /// Evaluates the components at a time.
    pub fn at(&self, t: f64, force: &mut [f64]) {
        self.sampled.at(t, force);
        for (i, formula) in &self.formulas {
            force[*i] = formula.value(&[t][..formula.names.len()]);
        }
    }
}

impl Force<f64> for KnownForce {
    fn force(&self, t: f64, _: &[f64], _: &[f64], force: &mut [f64]) {
        self.at(t, force);
    }

    fn breaks(&self) -> &[f64] {
        self.sampled.breaks()
    }
}

/// Parses a formula that depends on the time only.
fn of_time(text: &str) -> Result<NamedFormula, String> {
    let formula: NamedFormula = text.parse().map_err(|error| format!("{error}"))?;
    match formula.names.iter().find(|name| *name != TIME) {
        Some(name) => Err(unknown("name", name, [TIME])),
        None => Ok(formula),
    }
}

/// Names of a model's forces, one per coordinate: those of its data, or `COORDINATE_force`.
pub fn names(header: &Header) -> Vec<String> {
    let coordinates = &header.columns[..header.columns.len() / 2];
    if header.forces.is_empty() {
        coordinates.iter().map(|name| usual_force(name)).collect()
    } else {
        header.forces.clone()
    }
}

/// The error for a missing input.
fn missing(input: &str) -> CliError {
    CliError::usage(format_args!("--force: expected the input {input}, as {input}=VALUE or a column of a CSV"))
}

impl ForceArgs {
    /// Arguments that are files.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.force.iter().map(Path::new).filter(|path| path.exists())
    }

    /// The force on a motion from one time to another, its components `known` by name, one per coordinate and then the inputs; none if none
    /// was requested.
    ///
    /// # Errors
    /// A usage error for invalid names and numbers, a data error for a file that is invalid or does not cover the motion.
    pub fn force(
        &self,
        coordinates: &[String],
        known: &[String],
        span: (f64, f64),
    ) -> Result<Option<KnownForce>, CliError> {
        if self.force.is_empty() {
            return known.get(coordinates.len()).map_or(Ok(None), |name| Err(missing(name)));
        }
        let components = Components { coordinates, known };
        let Given { constants, formulas, file } = self.given(components)?;
        let sampled = match file {
            Some(path) => self.recorded(&path, components, &constants, span),
            None if self.force_time.is_some() || !self.force_units.is_empty() || self.between.is_some() => {
                Err(CliError::usage("--force-time, --force-units and --between need a CSV of forces"))
            }
            None => {
                components.require_inputs(|i| constants[i].is_some())?;
                let values = constants.iter().map(|force| force.unwrap_or(0.0)).collect();
                SampledForce::constant(values).map_err(CliError::data)
            }
        };
        Ok(Some(KnownForce { sampled: sampled?, formulas }))
    }

    /// Sorts the arguments of `--force` into constants, formulas and a file.
    fn given(&self, components: Components<'_>) -> Result<Given, CliError> {
        let mut all = Given { constants: vec![None; components.known.len()], formulas: Vec::new(), file: None };
        for given in &self.force {
            let (name, value) = match given.split_once('=') {
                Some((name, value)) if !Path::new(given).exists() => (name.trim(), value),
                _ => {
                    if let Some(first) = all.file.replace(PathBuf::from(given)) {
                        let both = format!("found {} and {given}", first.display());
                        return Err(CliError::usage(format_args!("--force: expected one file at most, {both}")));
                    }
                    continue;
                }
            };
            let i = components.index(name)?;
            let value = match finite(value) {
                Ok(value) => value,
                Err(problem) => {
                    let wrong = |fault| format!("--force {name}: {problem} or a formula of t: {fault}");
                    all.formulas.push((i, of_time(value).map_err(|fault| CliError::usage(wrong(fault)))?));
                    0.0
                }
            };
            if all.constants[i].replace(value).is_some() {
                return Err(CliError::usage(format_args!("--force: {name} is given twice")));
            }
        }
        Ok(all)
    }

    /// Combines the columns of a file with constants.
    fn recorded(
        &self,
        path: &Path,
        components: Components<'_>,
        constants: &[Option<f64>],
        span: (f64, f64),
    ) -> Result<SampledForce<f64>, CliError> {
        let refused = |problem: &dyn fmt::Display| CliError::file(path, problem);
        let bytes = read_regular(path, MAX_STATES_BYTES).map_err(|e| refused(&e))?;
        let header = NumberTable::<f64>::names(&bytes).map_err(|e| refused(&e))?;
        let mut columns = vec![self.time_column(&header).map_err(|problem| refused(&problem))?];
        let places = components.places(&header, &mut columns);
        if let Some(i) = (0..places.len()).find(|&i| places[i].is_some() && constants[i].is_some()) {
            let column = &columns[places[i].unwrap_or_default()];
            let problem = format!("--force: {column} is a constant and a column of {}", path.display());
            return Err(CliError::usage(problem));
        }
        let is_known = |i: usize| places[i].is_some() || constants[i].is_some();
        components.require_inputs(is_known)?;
        if columns.len() == 1 {
            return Err(refused(&format_args!("no column of forces, expected {}", components.known.join(", "))));
        }
        let factors = self.factors(&columns)?;
        let table = NumberTable::<f64>::read(&bytes, &columns).map_err(|e| refused(&e))?;
        let (mut times, mut values) = (Vec::with_capacity(table.rows.len()), Vec::new());
        for (row, &line) in table.values.chunks_exact(columns.len()).zip(&table.rows) {
            let t = row[0] * factors[0];
            if let Some(before) = times.last().filter(|before| t <= **before) {
                let problem = format_args!("expected a time after {before}, found {t}");
                return Err(refused(&format_args!("row {line}, column {}: {problem}", columns[0])));
            }
            times.push(t);
            let of = |(place, constant): (&Option<usize>, &Option<f64>)| {
                place.map_or(constant.unwrap_or(0.0), |at| row[at] * factors[at])
            };
            values.extend(places.iter().zip(constants).map(of));
        }
        let force = SampledForce::new(places.len(), times, values).map_err(|e| refused(&e))?;
        require_span(&force, span).map_err(|problem| refused(&problem))?;
        let (forces, inputs) = (0..components.coordinates.len(), components.inputs());
        let only_inputs = !inputs.is_empty() && !forces.clone().any(is_known);
        for i in forces.filter(|i| !is_known(*i) && !only_inputs) {
            output::note(&format!("{} has no column {}: this force is 0", path.display(), components.known[i]));
        }
        Ok(force.between(self.between.unwrap_or_default()))
    }

    /// Finds the column of time in a file.
    fn time_column(&self, header: &[String]) -> Result<String, String> {
        let is_time = |name: &&String| match &self.force_time {
            Some(time) => *name == time,
            None => ["t", "time"].iter().any(|usual| name.eq_ignore_ascii_case(usual)),
        };
        let problem = || match &self.force_time {
            Some(time) => format!("--force-time: {}", unknown("column", time, header.iter().map(String::as_str))),
            None => "no column called t or time; --force-time names another".to_string(),
        };
        header.iter().find(is_time).cloned().ok_or_else(problem)
    }

    /// Factors that convert columns to SI units.
    fn factors(&self, columns: &[String]) -> Result<Vec<f64>, CliError> {
        for (name, _) in &self.force_units {
            index_of("--force-units", "column", name, columns)?;
        }
        let of = |column: &String| {
            let unit = self.force_units.iter().find(|(name, _)| name == column).map_or("1", |(_, unit)| unit.as_str());
            factor(unit).map_err(|problem| CliError::usage(format_args!("--force-units: {column}: {problem}")))
        };
        columns.iter().map(of).collect()
    }
}

/// The parsed arguments of `--force`.
struct Given {
    /// Constants by component; 0 where there is a formula.
    constants: Vec<Option<f64>>,
    /// Formulas with the index of their component.
    formulas: Vec<(usize, NamedFormula)>,
    file: Option<PathBuf>,
}

/// Names of forces, one per coordinate, and then of inputs.
#[derive(Clone, Copy)]
struct Components<'a> {
    coordinates: &'a [String],
    known: &'a [String],
}

impl Components<'_> {
    /// Index of a component, given its own name or `COORDINATE_force`.
    fn index(self, name: &str) -> Result<usize, CliError> {
        let usual = self.coordinates.iter().position(|own| usual_force(own) == name);
        let own = self.known.iter().position(|known| known == name);
        own.into_iter().chain(usual).min().map_or_else(|| index_of("--force", "force", name, self.known), Ok)
    }

    /// For every component, the index of its column if the file has one; adds those columns to the list of columns to read.
    fn places(self, header: &[String], columns: &mut Vec<String>) -> Vec<Option<usize>> {
        let place = |(i, name): (usize, &String)| {
            let usual = self.coordinates.get(i).map(|coordinate| usual_force(coordinate));
            let column = [name.clone()].into_iter().chain(usual).find(|name| header.contains(name))?;
            columns.push(column);
            Some(columns.len() - 1)
        };
        self.known.iter().enumerate().map(place).collect()
    }

    /// Range of the components that are inputs.
    fn inputs(self) -> Range<usize> {
        self.coordinates.len()..self.known.len()
    }

    /// Rejects inputs without values.
    fn require_inputs(self, is_known: impl Fn(usize) -> bool) -> Result<(), CliError> {
        self.inputs().find(|&i| !is_known(i)).map_or(Ok(()), |i| Err(missing(&self.known[i])))
    }
}

/// Rejects recorded forces that do not cover the whole motion.
fn require_span(force: &SampledForce<f64>, (from, to): (f64, f64)) -> Result<(), String> {
    let ((first, last), slack) = (force.span(), ROUNDING_OF_TIMES * (to - from).abs());
    if from.min(to) >= first - slack && from.max(to) <= last + slack {
        return Ok(());
    }
    Err(format!(
        "forces are known from t = {first} to {last} and the motion runs from {from} to {to}; see --t-start and --t-end"
    ))
}
