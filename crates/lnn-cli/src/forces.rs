//! External forces as arguments: constants, formulas of the time, and recorded columns.

use crate::number::{choice, finite};
use crate::recording_args::unit;
use crate::states::{column_names, parse_table};
use crate::{CliError, output, states};
use lnn::lagrangian::NamedFormula;
use lnn::names::unknown;
use lnn::network::file::Header;
use lnn::pipeline::usual_force;
use lnn::recording::{TIME, factor};
use lnn::rollout::{Between, Force, SampledForce};
use lnn::storage::read_regular;
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
    /// Forces of the CSV between its rows; those of an identified system as `lnn identify` says that it took them [default: linear].
    #[arg(long, value_parser = choice(&Between::ALL, Between::name, Between::about), value_name = "WAY", requires = "force")]
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
    /// Some of the components, in order.
    pub fn components(&self, of: Range<usize>) -> Self {
        let own = self.formulas.iter().filter(|(i, _)| of.contains(i));
        let formulas = own.map(|(i, formula)| (i - of.start, formula.clone())).collect();
        Self { sampled: self.sampled.components(of), formulas }
    }

    /// `true` if all are 0 at all times.
    pub fn is_zero(&self) -> bool {
        self.formulas.is_empty() && self.sampled.is_zero()
    }

    /// The components at a time.
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

/// A formula of the time and of nothing else.
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
        from: f64,
        to: f64,
    ) -> Result<Option<KnownForce>, CliError> {
        let inputs = &known[coordinates.len()..];
        if self.force.is_empty() {
            return match inputs.first() {
                None => Ok(None),
                Some(name) => Err(missing(name)),
            };
        }
        let mut constants: Vec<Option<f64>> = vec![None; known.len()];
        let mut formulas: Vec<(usize, NamedFormula)> = Vec::new();
        let mut file: Option<PathBuf> = None;
        for given in &self.force {
            match given.split_once('=') {
                Some((name, value)) if !Path::new(given).exists() => {
                    let name = name.trim();
                    let usual = |i: &usize| {
                        known[*i] == name || coordinates.get(*i).is_some_and(|own| usual_force(own) == name)
                    };
                    let Some(i) = (0..known.len()).find(usual) else {
                        let problem = unknown("force", name, known.iter().map(String::as_str));
                        return Err(CliError::usage(format_args!("--force: {problem}")));
                    };
                    let value = match finite(value) {
                        Ok(value) => value,
                        Err(problem) => {
                            let wrong = |fault| format!("--force {name}: {problem} or a formula of t: {fault}");
                            formulas.push((i, of_time(value).map_err(|fault| CliError::usage(wrong(fault)))?));
                            0.0
                        }
                    };
                    if constants[i].replace(value).is_some() {
                        return Err(CliError::usage(format_args!("--force: {name} is given twice")));
                    }
                }
                _ => {
                    if let Some(first) = file.replace(PathBuf::from(given)) {
                        let both = format!("found {} and {given}", first.display());
                        return Err(CliError::usage(format_args!("--force: expected one file at most, {both}")));
                    }
                }
            }
        }
        let sampled = match file {
            Some(path) => self.with_columns(&path, (coordinates, known), &constants, (from, to)),
            None if self.force_time.is_some() || !self.force_units.is_empty() || self.between.is_some() => {
                Err(CliError::usage("--force-time, --force-units and --between need a CSV of forces"))
            }
            None => {
                if let Some(k) = (0..inputs.len()).find(|k| constants[coordinates.len() + k].is_none()) {
                    return Err(missing(&inputs[k]));
                }
                let values = constants.iter().map(|force| force.unwrap_or(0.0)).collect();
                SampledForce::constant(values).map_err(CliError::data)
            }
        };
        Ok(Some(KnownForce { sampled: sampled?, formulas }))
    }

    /// The columns of a file, together with constants.
    fn with_columns(
        &self,
        path: &Path,
        (coordinates, known): (&[String], &[String]),
        constants: &[Option<f64>],
        (from, to): (f64, f64),
    ) -> Result<SampledForce<f64>, CliError> {
        let bytes = read_regular(path, states::MAX_BYTES).map_err(|e| CliError::file(path, e))?;
        let header = column_names(&bytes).map_err(|e| CliError::file(path, e))?;
        let there = |name: &String| header.contains(name);
        let time = match &self.force_time {
            Some(name) if there(name) => name.clone(),
            Some(name) => {
                let problem = unknown("column", name, header.iter().map(String::as_str));
                return Err(CliError::file(path, format_args!("--force-time: {problem}")));
            }
            None => {
                let named =
                    header.iter().find(|name| ["t", "time"].iter().any(|usual| name.eq_ignore_ascii_case(usual)));
                let none = "no column called t or time; --force-time names another";
                named.cloned().ok_or_else(|| CliError::file(path, none))?
            }
        };
        // The column of every coordinate's force, if the file has one.
        let mut columns = vec![time];
        let mut places: Vec<Option<usize>> = Vec::with_capacity(known.len());
        for (i, (name, constant)) in known.iter().zip(constants).enumerate() {
            let usual = coordinates.get(i).map(|coordinate| usual_force(coordinate));
            let column = [name.clone()].into_iter().chain(usual).find(there);
            if let (Some(column), Some(_)) = (&column, constant) {
                let problem = format!("--force: {column} is a constant and a column of {}", path.display());
                return Err(CliError::usage(problem));
            }
            places.push(column.as_ref().map(|_| columns.len()));
            columns.extend(column);
        }
        let lacks = |i: &usize| places[*i].is_none() && constants[*i].is_none();
        if let Some(i) = (coordinates.len()..known.len()).find(lacks) {
            return Err(missing(&known[i]));
        }
        if columns.len() == 1 {
            let problem = format!("no column of forces, expected {}", known.join(", "));
            return Err(CliError::file(path, problem));
        }
        if let Some((name, _)) = self.force_units.iter().find(|(name, _)| !columns.contains(name)) {
            let problem = unknown("column", name, columns.iter().map(String::as_str));
            return Err(CliError::usage(format_args!("--force-units: {problem}")));
        }
        let mut factors = Vec::with_capacity(columns.len());
        for column in &columns {
            let unit = self.force_units.iter().find(|(name, _)| name == column).map_or("1", |(_, unit)| unit.as_str());
            let problem = |problem| CliError::usage(format_args!("--force-units: {column}: {problem}"));
            factors.push(factor(unit).map_err(problem)?);
        }
        let table = parse_table::<f64>(&bytes, &columns).map_err(|e| CliError::file(path, e))?;
        let (mut times, mut values) = (Vec::with_capacity(table.rows.len()), Vec::new());
        for (row, &line) in table.values.chunks_exact(columns.len()).zip(&table.rows) {
            let t = row[0] * factors[0];
            if let Some(&before) = times.last()
                && t <= before
            {
                let column = &columns[0];
                let problem = format!("row {line}, column {column}: expected a time after {before}, found {t}");
                return Err(CliError::file(path, problem));
            }
            times.push(t);
            for (place, constant) in places.iter().zip(constants) {
                values.push(place.map_or(constant.unwrap_or(0.0), |at| row[at] * factors[at]));
            }
        }
        let force = SampledForce::new(known.len(), times, values).map_err(|e| CliError::file(path, e))?;
        let force = force.between(self.between.unwrap_or_default());
        let ((first, last), slack) = (force.span(), 1e-9 * (to - from).abs());
        if from.min(to) < first - slack || from.max(to) > last + slack {
            let problem = format!(
                "forces are known from t = {first} to {last} and the motion runs from {from} to {to}; see --t-start and \
                 --t-end"
            );
            return Err(CliError::file(path, problem));
        }
        let forces = 0..coordinates.len();
        let only_inputs = known.len() > forces.len() && forces.clone().all(|i| lacks(&i));
        for i in forces.filter(|i| lacks(i) && !only_inputs) {
            output::note(&format!("{} has no column {}: this force is 0", path.display(), known[i]));
        }
        Ok(force)
    }
}
