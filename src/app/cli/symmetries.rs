//! `lnn symmetries`: what a Lagrangian conserves.

use crate::cli::format::TableOrJson;
use crate::cli::probe::{Bound, Probe, bound, tolerance};
use crate::cli::source::SystemOrModel;
use crate::cli::{CliError, number, output};
use crate::names::{WIDTH, number as digits, pluralize, wrap_text};
use crate::report::text_table;
use crate::symmetry::{
    Degrees, EXACT, Invariant, MOST_FIELDS, MOST_UNKNOWNS, Quadratic, Symmetries, quadratic, quadratic_unknowns,
    unknowns,
};
use serde::Serialize;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    subject: SystemOrModel,
    /// Functions that fields are made of, by family and total degree: polynomial, trigonometric, hyperbolic; chosen by the
    /// coordinates if not given.
    #[arg(long, value_name = "FAMILY:DEGREE,..", value_parser = degrees)]
    basis: Option<Degrees>,
    /// Bounds of the states that are looked at, such as r=4:12 or r_dot=-0.3:0.3; those of the system, or the middle of
    /// those the model was trained on, if not given.
    #[arg(long, value_name = "NAME=LOW:HIGH,..", value_delimiter = ',', value_parser = bound)]
    region: Vec<Bound>,
    /// States that are looked at; two for every unknown coefficient, at least 400 for a system
    /// and 1000 for a model, if not given.
    #[arg(long, value_name = "N", value_parser = number::count)]
    points: Option<usize>,
    /// Seed of the states.
    #[arg(long, value_name = "N", default_value = "0", value_parser = number::seed)]
    seed: u64,
    /// Singular values up to this one count as zero, 0.1 at most; 1e-8 for a system, the largest gap for a model, if not given.
    #[arg(long, value_name = "T", value_parser = tolerance)]
    tolerance: Option<f64>,
    /// Look for conserved quantities of second degree in the momenta as well.
    #[arg(long)]
    quadratic: bool,
    /// Text, or one JSON object.
    #[arg(long, value_enum, value_name = "FORMAT", default_value = "table")]
    format: TableOrJson,
    /// The same as --format json.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

/// Degrees of families of functions.
///
/// # Errors
/// The form that was expected.
pub fn degrees(text: &str) -> Result<Degrees, String> {
    text.parse()
}

/// Findings, as JSON.
#[derive(Debug, Serialize)]
struct Found {
    system: String,
    /// Point symmetries; null if there is no gap between singular values.
    count: Option<usize>,
    /// First singular value that is not zero over the last that is.
    gap: Option<f64>,
    /// Name of the algebra.
    name: Option<String>,
    fields: Vec<String>,
    /// Function `F` of every field whose flow changes `L` by `dF/dt`.
    gauge_functions: Vec<String>,
    /// None of fields that are no algebra.
    structure_constants: Vec<Vec<Vec<f64>>>,
    killing_form_signature: Option<[usize; 3]>,
    /// Rest of the commutators beside combinations of the fields, relative; null where it was not looked at.
    closure: Option<f64>,
    /// Whether that is nothing but noise, so that the fields are an algebra.
    closes: Option<bool>,
    /// States at which the mass matrix is singular.
    singular_states: usize,
    /// The symmetry of the parameter of the motion, which is not counted, and what it conserves.
    time_translation: bool,
    invariant: Invariant,
    /// Of every field, whether its charge is conserved: friction may change it.
    conserved: Vec<bool>,
    singular_values: Vec<f64>,
    basis: Families,
    /// Functions of the basis.
    functions: usize,
    points: usize,
    seed: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    quadratic: Option<SecondOrder>,
}

#[derive(Debug, Serialize)]
struct Families {
    polynomial: usize,
    trigonometric: usize,
    hyperbolic: usize,
}

#[derive(Debug, Serialize)]
struct SecondOrder {
    /// New conserved quantities; null if there is no gap.
    count: Option<usize>,
    /// All of these functions, known ones included.
    with_known: Option<usize>,
    gap: Option<f64>,
    conserved: Vec<String>,
    singular_values: Vec<f64>,
}

impl From<Quadratic> for SecondOrder {
    fn from(found: Quadratic) -> Self {
        let with_known = found.separation.count;
        Self {
            count: with_known.map(|_| found.conserved.len()),
            with_known,
            gap: found.separation.gap,
            conserved: found.conserved.iter().map(|quantity| quantity.text()).collect(),
            singular_values: found.singular_values,
        }
    }
}

/// Finds symmetries and prints them.
///
/// # Errors
/// A usage error for a wrong system or region, a data error for a bad model or terms that are not finite.
pub fn run(args: &Args) -> Result<(), CliError> {
    let mut probe = args.subject.read(Probe::model, Probe::system)?;
    probe.narrow(&args.region)?;
    let (basis, _) = probe.basis(args.basis)?;
    let n = probe.model.coordinates();
    let own = unknowns(n, basis.len());
    // Of quadratic quantities cyclic coordinates leave fewer functions than this.
    let second = |most: usize| if args.quadratic { own.max(quadratic_unknowns(n, basis.len()).min(most)) } else { own };
    let points = probe.points(args.points, probe.enough(second(MOST)), second(MOST_UNKNOWNS))?;
    announce(own, points, args.quadratic);
    let (q, v) = probe.states(points, args.seed)?;
    let tolerance = args.tolerance.or(probe.exact.then_some(EXACT));
    let model = probe.model.as_ref();
    let (found, families) = probe.symmetries(args.basis, (&q, &v), args.tolerance)?;
    let second = match args.quadratic {
        true => {
            Some(quadratic(model, &found.basis, &found.fields, (&q, &v), tolerance).map_err(CliError::data)?.into())
        }
        false => None,
    };
    let Symmetries {
        basis,
        singular_values,
        separation,
        fields,
        algebra,
        states,
        singular_states,
        invariant,
        conserved,
    } = found;
    let closes = algebra.as_ref().map(|algebra| algebra.closes);
    let closed = algebra.as_ref().filter(|algebra| algebra.closes);
    let found = Found {
        system: probe.name.clone(),
        count: separation.count,
        gap: separation.gap,
        name: closed.and_then(|algebra| algebra.name.clone()),
        fields: fields.iter().map(|field| field.text(&basis)).collect(),
        gauge_functions: fields.iter().map(|field| field.gauge_text(&basis)).collect(),
        killing_form_signature: closed.map(|algebra| algebra.killing_form_signature),
        closure: algebra.as_ref().map(|algebra| algebra.closure),
        closes,
        singular_states,
        structure_constants: closed.map_or(Vec::new(), |algebra| algebra.structure_constants.clone()),
        time_translation: invariant != Invariant::Nothing,
        invariant,
        conserved,
        singular_values,
        basis: Families {
            polynomial: families.polynomial,
            trigonometric: families.trigonometric,
            hyperbolic: families.hyperbolic,
        },
        functions: basis.len(),
        points: states,
        seed: args.seed,
        quadratic: second,
    };
    if args.json || args.format == TableOrJson::Json {
        return output::print(&(serde_json::to_string(&found).map_err(CliError::data)? + "\n"));
    }
    output::print(&found.text())
}

/// Unknown coefficients of quadratic quantities for which states are drawn, at most.
const MOST: usize = 1300;
/// Singular values that are shown beyond the gap.
const BEYOND: usize = 5;

/// Unknown coefficients squared times states from which a search takes some seconds.
const LONG: f64 = 3e9;

/// Says so before a long search, which is silent.
fn announce(unknowns: usize, points: usize, quadratic: bool) {
    if (unknowns as f64).powi(2) * points as f64 > LONG {
        let more = if quadratic { ", and more for quadratic quantities" } else { "" };
        output::note(&format!(
            "{unknowns} unknown coefficients at {points} states{more}: this takes a while; a smaller --basis is faster"
        ));
    }
}

impl Found {
    /// What the fields are, in words.
    fn algebra(&self) -> String {
        match (self.closes, self.closure, self.name.as_deref()) {
            (Some(true), _, Some(name)) => format!("algebra {name}"),
            (Some(true), ..) => "an algebra without a name".to_string(),
            (_, Some(closure), _) => format!("which do not form an algebra (closure {})", digits(closure)),
            _ => format!("too many for an algebra (at most {MOST_FIELDS})"),
        }
    }

    fn text(&self) -> String {
        let time = match self.invariant {
            Invariant::Energy => "time translation (the energy is conserved)",
            Invariant::Square => "translation of the parameter (g(v, v) is conserved along geodesics)",
            Invariant::Legendre => "translation of the parameter (p.v - L is conserved)",
            Invariant::Nothing => "no time translation (friction removes energy)",
        };
        let mut text = match self.count {
            None => format!(
                "{}: no gap between singular values, so that the number of symmetries is unknown; {time}\n",
                self.system
            ),
            Some(0) => format!("{}: no point symmetry in space; {time}\n", self.system),
            Some(count) => {
                let count = pluralize(count, "point symmetry", "point symmetries");
                format!("{}: {count}, {}; {time}\n", self.system, self.algebra())
            }
        };
        if self.singular_states > 0 {
            text += &wrap_text(
                &format!(
                    "L is degenerate: its mass matrix is singular at {} of {} states and determines no motion there; a null \
                     direction of it times any function may be a symmetry, so that the number depends on the functions\n",
                    self.singular_states, self.points
                ),
                WIDTH,
            );
        }
        let last = self.count.unwrap_or(0) + BEYOND;
        let shown: Vec<String> = self.singular_values.iter().take(last.min(20)).map(|x| digits(*x)).collect();
        let more = if self.singular_values.len() > shown.len() { ", .." } else { "" };
        text += &wrap_text(&format!("singular values {}{more}\n", shown.join(", ")), WIDTH);
        if let Some(gap) = self.gap {
            text += &format!("gap {}", digits(gap));
        }
        let Families { polynomial, trigonometric, hyperbolic } = self.basis;
        text += &format!(
            "{}{} functions ({}), {} states\n",
            if self.gap.is_some() { "; " } else { "" },
            self.functions,
            Degrees { polynomial, trigonometric, hyperbolic },
            self.points
        );
        if !self.fields.is_empty() {
            let gauged = self.gauge_functions.iter().any(|gauge| gauge != "0");
            let dissipates = self.invariant == Invariant::Nothing;
            let rows = self.fields.iter().zip(&self.gauge_functions).enumerate().map(|(k, (field, gauge))| {
                let gauge = gauged.then(|| gauge.clone());
                let kept = if self.conserved[k] { "yes" } else { "no, by friction" };
                let kept = dissipates.then(|| kept.to_string());
                [format!("X{}", k + 1), field.clone()].into_iter().chain(gauge).chain(kept).collect()
            });
            let more = [("gauge function", gauged), ("charge conserved", dissipates)];
            let more = more.into_iter().filter(|(_, shown)| *shown).map(|(name, _)| name);
            let headers: Vec<&str> = ["field", "components"].into_iter().chain(more).collect();
            text += &format!("\n{}", text_table(&headers, &rows.collect::<Vec<Vec<String>>>()));
            text += &self.commutators();
            if let Some([negative, positive, zero]) = self.killing_form_signature {
                text += &format!("Killing form: {negative} negative, {positive} positive, {zero} zero\n");
            }
        }
        if let Some(second) = &self.quadratic {
            text += &second.text();
        }
        text
    }

    /// Commutators that do not vanish, each a line.
    fn commutators(&self) -> String {
        let c = &self.structure_constants;
        let mut text = String::new();
        for a in 0..c.len() {
            for b in a + 1..c.len() {
                let terms = c[a][b].iter().enumerate().filter(|(_, x)| **x != 0.0);
                let terms: Vec<String> = terms.map(|(k, x)| format!("{} X{}", factor(*x), k + 1)).collect();
                if !terms.is_empty() {
                    let sum = terms.join(" ");
                    text += &format!(
                        "[X{}, X{}] = {}\n",
                        a + 1,
                        b + 1,
                        sum.strip_prefix("+ ").map_or_else(|| sum.replacen("- ", "-", 1), String::from)
                    );
                }
            }
        }
        text
    }
}

/// A factor with its sign, 1 left out.
fn factor(x: f64) -> String {
    let sign = if x < 0.0 { "-" } else { "+" };
    let size = x.abs();
    if (size - 1.0).abs() < 1e-6 { sign.to_string() } else { format!("{sign} {}", digits(size)) }
}

impl SecondOrder {
    fn text(&self) -> String {
        match self.count {
            None => "\nquantities quadratic in the momenta: no gap, so that their number is unknown\n".to_string(),
            Some(0) => {
                "\nno conserved quantity quadratic in the momenta beyond the energy and products of charges\n".into()
            }
            Some(count) => {
                let count = pluralize(count, "conserved quantity", "conserved quantities");
                let list: String = self.conserved.iter().map(|quantity| format!("  {quantity}\n")).collect();
                let text =
                    format!("\n{count} quadratic in the momenta beyond the energy and products of charges:\n{list}");
                wrap_text(&text, WIDTH)
            }
        }
    }
}
