//! Reports of symmetries and of comparisons.

use super::thresholds::{MOST_SHOWN, OTHER_LAGRANGIAN, SAME_MOTION, SHOWN_BEYOND_GAP, UNIT_FACTOR};
use super::{Charge, Comparison, Degrees, Invariant, MOST_FIELDS, Quadratic, Symmetries};
use crate::findings::Findings;
use crate::names::{number as digits, pluralize, rounded};
use serde::{Serialize, Serializer};

/// Symmetries in formulas, as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SymmetrySummary {
    /// Name of the system.
    pub system: String,
    /// Point symmetries; null if there is no gap between singular values.
    pub count: Option<usize>,
    /// Ratio of the first singular value that is not zero to the last that is.
    pub gap: Option<f64>,
    /// Name of the algebra.
    pub name: Option<String>,
    /// Components of every field.
    pub fields: Vec<String>,
    /// Function `F` of every field whose flow changes `L` by `dF/dt`.
    pub gauge_functions: Vec<String>,
    /// Empty for fields that form no algebra.
    pub structure_constants: Vec<Vec<Vec<f64>>>,
    /// Negative, positive and zero eigenvalues of the Killing form.
    pub killing_form_signature: Option<[usize; 3]>,
    /// Relative remainder of the commutators beyond combinations of the fields; null if not computed.
    pub closure: Option<f64>,
    /// Whether that remainder is only noise, so that the fields form an algebra.
    pub closes: Option<bool>,
    /// States at which the mass matrix is singular.
    pub singular_states: usize,
    /// The symmetry of the parameter of the motion, which is not counted, and what it conserves.
    pub time_translation: bool,
    /// The quantity that it conserves.
    pub invariant: Invariant,
    /// For every field, whether its charge is conserved: friction may change it.
    pub conserved: Vec<bool>,
    /// Singular values in ascending order.
    pub singular_values: Vec<f64>,
    /// Degrees of the functions in the fields, in the text form of [`Degrees`].
    #[serde(serialize_with = "as_text")]
    pub basis: Degrees,
    /// Functions of the basis.
    pub functions: usize,
    /// States that were examined.
    pub points: usize,
    /// Seed of the states.
    pub seed: u64,
    /// Quantities of second degree in the momenta, if they were sought.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quadratic: Option<QuadraticSummary>,
}

/// A charge along a motion, and the parts of its drift.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChargeDrift {
    /// `energy`, or `g(v, v)/2` along geodesics of a metric with a time, or the field whose charge it is.
    pub symmetry: String,
    /// Charge at the start.
    pub start: f64,
    /// Charge at the end.
    pub end: f64,
    /// Charge at the end less that at the start, the sum of the next two.
    pub drift: f64,
    /// Drift because the model breaks the symmetry.
    pub by_model: f64,
    /// Remaining drift, caused by the integrator.
    pub by_integrator: f64,
    /// Largest distance from the charge at the start.
    pub largest: f64,
}

impl ChargeDrift {
    /// Headers of a table of charges.
    pub const HEADERS: [&'static str; 6] =
        ["charge of", "start", "drift", "by the model", "by the integrator", "largest"];

    /// Its row of the table.
    pub fn row(&self) -> Vec<String> {
        let numbers = [self.drift, self.by_model, self.by_integrator, self.largest].map(|x| rounded(x, 3));
        [vec![self.symmetry.clone(), rounded(self.start, 10)], numbers.to_vec()].concat()
    }
}

impl Symmetries {
    /// The drifts of the energy and of the charges of all fields along a motion: `charges` are those of [`Charge::of`].
    pub fn drifts(&self, charges: &[Charge]) -> Vec<ChargeDrift> {
        let fields = self.fields.iter().map(|field| field.text(&self.basis));
        let names = std::iter::once(self.invariant.charge().to_string()).chain(fields);
        let drift = |(symmetry, charge): (String, &Charge)| {
            let [start, end] = [charge.values.first(), charge.values.last()].map(|x| x.copied().unwrap_or(f64::NAN));
            ChargeDrift {
                symmetry,
                start,
                end,
                drift: charge.drift,
                by_model: charge.by_model,
                by_integrator: charge.by_integrator,
                largest: charge.values.iter().fold(0.0, |most, x| most.max((x - start).abs())),
            }
        };
        names.zip(charges).map(drift).collect()
    }
}

fn as_text<S: Serializer>(basis: &Degrees, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(basis)
}

/// Conserved quantities of second degree in the momenta, in formulas.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct QuadraticSummary {
    /// New conserved quantities; null if there is no gap.
    pub count: Option<usize>,
    /// All of these functions, known ones included.
    pub with_known: Option<usize>,
    /// Ratio of the first singular value that is not zero to the last that is.
    pub gap: Option<f64>,
    /// The new ones.
    pub conserved: Vec<String>,
    /// Singular values in ascending order.
    pub singular_values: Vec<f64>,
}

impl From<Quadratic> for QuadraticSummary {
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

impl Symmetries {
    /// The symmetries of a system in formulas, fields being made of functions up to these degrees, states drawn by a seed.
    pub fn summary(&self, system: &str, basis: Degrees, seed: u64, quadratic: Option<Quadratic>) -> SymmetrySummary {
        let closed = self.algebra.as_ref().filter(|algebra| algebra.closes);
        SymmetrySummary {
            system: system.to_string(),
            count: self.separation.count,
            gap: self.separation.gap,
            name: closed.and_then(|algebra| algebra.name.clone()),
            fields: self.fields.iter().map(|field| field.text(&self.basis)).collect(),
            gauge_functions: self.fields.iter().map(|field| field.gauge_text(&self.basis)).collect(),
            structure_constants: closed.map_or(Vec::new(), |algebra| algebra.structure_constants.clone()),
            killing_form_signature: closed.map(|algebra| algebra.killing_form_signature),
            closure: self.algebra.as_ref().map(|algebra| algebra.closure),
            closes: self.algebra.as_ref().map(|algebra| algebra.closes),
            singular_states: self.singular_states,
            time_translation: self.invariant != Invariant::Nothing,
            invariant: self.invariant,
            conserved: self.conserved.clone(),
            singular_values: self.singular_values.clone(),
            basis,
            functions: self.basis.len(),
            points: self.states,
            seed,
            quadratic: quadratic.map(QuadraticSummary::from),
        }
    }
}

impl SymmetrySummary {
    /// The number of symmetries, the fields, their algebra, and the search that found them.
    pub fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        self.say_count(&mut findings);
        self.say_search(&mut findings);
        if !self.fields.is_empty() {
            self.say_fields(&mut findings);
            findings.lines(self.commutators());
            if let Some([negative, positive, zero]) = self.killing_form_signature {
                findings.line(format!("Killing form: {negative} negative, {positive} positive, {zero} zero"));
            }
        }
        if let Some(second) = &self.quadratic {
            second.say(&mut findings);
        }
        findings
    }

    fn say_count(&self, findings: &mut Findings) {
        let time = match self.invariant {
            Invariant::Energy => "time translation (the energy is conserved)",
            Invariant::Square => "translation of the parameter (g(v, v) is conserved along geodesics)",
            Invariant::Legendre => "translation of the parameter (p.v - L is conserved)",
            Invariant::Nothing => "no time translation (friction removes energy)",
        };
        let count = match self.count {
            None => "the singular values have no gap, so that the number of symmetries is unknown".to_string(),
            Some(0) => "no point symmetry in space".to_string(),
            Some(count) => {
                format!("{}, {}", pluralize(count, "point symmetry", "point symmetries"), self.algebra())
            }
        };
        findings.line(format!("{}: {count}; {time}", self.system));
        if self.singular_states > 0 {
            let (singular, points) = (self.singular_states, self.points);
            let text = format!(
                "L is degenerate: its mass matrix is singular at {singular} of {points} states and does not determine the motion there; a null \
                 direction times any function may be a symmetry, so that the number of symmetries depends on the basis"
            );
            findings.line(text);
        }
    }

    fn say_search(&self, findings: &mut Findings) {
        let last = (self.count.unwrap_or(0) + SHOWN_BEYOND_GAP).min(MOST_SHOWN);
        let shown: Vec<String> = self.singular_values.iter().take(last).map(|x| digits(*x)).collect();
        let more = if self.singular_values.len() > shown.len() { ", .." } else { "" };
        findings.line(format!("singular values {}{more}", shown.join(", ")));
        let gap = self.gap.map_or(String::new(), |gap| format!("gap {}; ", digits(gap)));
        findings.line(format!("{gap}{} functions ({}), {} states", self.functions, self.basis, self.points));
    }

    /// Describes the fields in words.
    fn algebra(&self) -> String {
        match (self.closes, self.closure, self.name.as_deref()) {
            (Some(true), _, Some(name)) => format!("algebra {name}"),
            (Some(true), ..) => "an algebra that was not recognized".to_string(),
            (_, Some(closure), _) => format!("which do not form an algebra (closure {})", digits(closure)),
            _ => format!("too many for an algebra (at most {MOST_FIELDS})"),
        }
    }

    fn say_fields(&self, findings: &mut Findings) {
        let gauged = self.gauge_functions.iter().any(|gauge| gauge != "0");
        let dissipates = self.invariant == Invariant::Nothing;
        let rows = self.fields.iter().zip(&self.gauge_functions).enumerate().map(|(k, (field, gauge))| {
            let gauge = gauged.then(|| gauge.clone());
            let kept = if self.conserved[k] { "yes" } else { "no, by friction" };
            let kept = dissipates.then(|| kept.to_string());
            [format!("X{}", k + 1), field.clone()].into_iter().chain(gauge).chain(kept).collect::<Vec<_>>()
        });
        let more = [("gauge function", gauged), ("charge conserved", dissipates)];
        let more = more.into_iter().filter(|(_, shown)| *shown).map(|(name, _)| name);
        let headers: Vec<&str> = ["field", "components"].into_iter().chain(more).collect();
        findings.gap().table(&headers, rows);
    }

    /// Commutators that do not vanish, each a line.
    fn commutators(&self) -> Vec<String> {
        let c = &self.structure_constants;
        let pairs = (0..c.len()).flat_map(|a| (a + 1..c.len()).map(move |b| (a, b)));
        let line = |(a, b): (usize, usize)| {
            let terms = c[a][b].iter().enumerate().filter(|(_, x)| **x != 0.0);
            let terms: Vec<String> = terms.map(|(k, x)| format!("{} X{}", factor(*x), k + 1)).collect();
            let sum = terms.join(" ");
            let sum = sum.strip_prefix("+ ").map_or_else(|| sum.replacen("- ", "-", 1), String::from);
            (!terms.is_empty()).then(|| format!("[X{}, X{}] = {sum}", a + 1, b + 1))
        };
        pairs.filter_map(line).collect()
    }
}

/// A factor with its sign; 1 is left out.
fn factor(x: f64) -> String {
    let sign = if x < 0.0 { "-" } else { "+" };
    let size = x.abs();
    if (size - 1.0).abs() < UNIT_FACTOR { sign.to_string() } else { format!("{sign} {}", digits(size)) }
}

impl QuadraticSummary {
    fn say(&self, findings: &mut Findings) {
        findings.gap();
        match self.count {
            None => findings.line("quantities quadratic in the momenta: no gap, so that their number is unknown"),
            Some(0) => findings
                .line("no conserved quantity quadratic in the momenta beyond the energy and products of charges"),
            Some(count) => {
                let count = pluralize(count, "conserved quantity", "conserved quantities");
                findings
                    .line(format!("{count} quadratic in the momenta beyond the energy and products of charges:"))
                    .lines(self.conserved.iter().map(|quantity| format!("  {quantity}")))
            }
        };
    }
}

/// A comparison of two Lagrangians by name, at states drawn by a seed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparisonSummary {
    /// Name of `A`.
    pub first: String,
    /// Name of `B`.
    pub second: String,
    /// Differences of the two Lagrangians.
    #[serde(flatten)]
    pub comparison: Comparison,
    /// States that were examined.
    pub points: usize,
    /// Seed of the states.
    pub seed: u64,
}

impl ComparisonSummary {
    /// The best fit of `A` by `B`, and the distances that it leaves.
    pub fn findings(&self) -> Findings {
        let found = &self.comparison;
        let mut findings = Findings::default();
        findings.lines(self.fit());
        let rows = [
            ("Lagrangian, after the fit", found.lagrangian),
            ("motion, accelerations", found.motion),
            ("mass matrix, after the fit", found.mass_matrix),
            ("energy, after the fit", found.energy),
        ];
        let distance = |x: f64| if x.is_nan() { "unknown".to_string() } else { digits(x) };
        findings
            .table(&["quantity", "relative distance"], rows.iter().map(|(name, x)| [name.to_string(), distance(*x)]));
        if found.motion < SAME_MOTION && found.lagrangian > OTHER_LAGRANGIAN {
            findings.line(
                "The motions agree, but the Lagrangians do not: F may be a function that the basis lacks (--basis).",
            );
        }
        findings
    }

    /// The fit and its undetermined parts, one sentence each.
    fn fit(&self) -> Vec<String> {
        let found = &self.comparison;
        let powers = found.factors.iter().enumerate().map(|(k, factor)| {
            let power = if k == 0 { "B".to_string() } else { format!("B^{}", k + 1) };
            format!("{} {power}", rounded(*factor, 6))
        });
        let (gauge, function) = match found.gauge_formula.as_str() {
            "0" => ("", String::new()),
            formula => (" + dF/dt", format!(", F = {formula}")),
        };
        let sign = if found.constant < 0.0 { "-" } else { "+" };
        let mut lines = vec![format!(
            "A = {}{gauge} {sign} {}{function}, the best fit at {} states",
            powers.collect::<Vec<_>>().join(" + "),
            rounded(found.constant.abs(), 6),
            self.points
        )];
        if found.on_shell {
            let shell =
                "B is the same at all states: f is determined at this one value, mass matrices up to a part h p p^T";
            lines.push(shell.to_string());
        }
        if !found.group_factors.is_empty() {
            let factors = found.group_factors.iter().map(|factor| rounded(*factor, 6)).collect::<Vec<_>>().join(", ");
            lines.push(format!(
                "decoupled coordinates have factors of their own, which no motion determines: B was first multiplied by {factors}"
            ));
        }
        if found.motionless_states > 0 {
            lines.push(format!(
                "one of the two is degenerate: at {} states its mass matrix is singular and does not determine the accelerations",
                found.motionless_states
            ));
        }
        lines
    }
}
