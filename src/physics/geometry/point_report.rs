//! The geometry at a point by the names of the coordinates: a table for people, LaTeX for papers, and every number for files.

use super::{Geometry, GeometryError};
use crate::digits::{number, object, quoted, tensor};
use crate::findings::Findings;
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{Inertia, inertia};
use crate::names::{latex_name, latex_number, rounded, trimmed};
use crate::scalar::{Real, Scalar};

/// Significant digits for people.
const DIGITS: usize = 7;
/// A component below this many roundings of the largest one, in directions of unit length, counts as zero.
const ROUNDINGS: f64 = 64.0;

/// Report on the geometry at a point.
pub struct PointReport<'a, S> {
    /// Names of the coordinates.
    names: &'a [String],
    /// The coordinates in words: `t = 0, r = 4`.
    pub place: String,
    /// Quantities in the order in which they are reported.
    quantities: Vec<Quantity<S>>,
    /// Lengths of the coordinate directions, `sqrt(max_j |g_ij|)`, `(n)`: components are compared after division by them.
    lengths: Vec<f64>,
    /// Reason why the geometry is undefined, if it is.
    pub problem: Option<String>,
}

/// A tensor or a number at a point.
struct Quantity<S> {
    /// Name in files; empty if it is for people alone.
    key: &'static str,
    /// Name for people, with the indices; empty if it is for files alone.
    title: &'static str,
    /// Symbol in LaTeX, of a number or of a tensor without indices.
    symbol: &'static str,
    /// Number of upper indices, which come first.
    upper: usize,
    /// Indices of the components that the others follow from.
    independent: fn(&[usize]) -> bool,
    /// The value.
    value: Value<S>,
}

/// The value of a quantity.
enum Value<S> {
    /// The point does not have it.
    Missing,
    /// A number.
    Number(S),
    /// Numbers of negative and positive eigenvalues.
    Signature(Inertia),
    /// Components of a tensor, `(n, .., n)`, and its rank.
    Tensor(Vec<S>, usize),
}

/// Every component is independent.
fn each(_: &[usize]) -> bool {
    true
}

/// Symmetric in the last two indices.
fn symmetric(at: &[usize]) -> bool {
    at.iter().rev().nth(1) <= at.last()
}

/// Antisymmetric in the first and in the last two indices, symmetric in the pairs.
fn two_pairs(at: &[usize]) -> bool {
    at[0] < at[1] && at[2] < at[3] && at[..2] <= at[2..]
}

/// Index signs for a tensor that vanishes.
const LETTERS: [&str; 4] = ["\\mu", "\\nu", "\\rho", "\\sigma"];

/// `true` if the mass matrix of a point is another one at another velocity, beyond rounding.
pub fn depends_on_velocity<S: Scalar>(model: &dyn EulerLagrange<S>, q: &[S], v: &[S]) -> bool {
    let n = q.len();
    let moved = v.iter().enumerate().map(|(i, &v)| v + S::of_f64(0.25 / (i + 1) as f64));
    let both: Vec<S> = v.iter().copied().chain(moved).collect();
    let mut terms = Terms::default();
    if model.terms(&q.repeat(2), &both, Request::MASS_MATRIX, &mut terms).is_err() {
        return false;
    }
    let (first, second) = terms.mass_matrix.split_at(n * n);
    let most = first.iter().map(|x| x.abs().to_f64()).fold(0.0, f64::max);
    let tolerance = most * S::epsilon().to_f64() * 1e4;
    first.iter().zip(second).any(|(&a, &b)| (a - b).abs().to_f64() > tolerance)
}

impl<'a, S: Scalar> PointReport<'a, S> {
    /// The reports of points, `(points, n)`, as [`Geometry::of`] finds them; a point without geometry has at most its metric.
    ///
    /// # Errors
    /// Those of [`Geometry::of`].
    pub fn of(
        model: &dyn EulerLagrange<S>,
        names: &'a [String],
        points: &[S],
        velocity: &[S],
    ) -> Result<Vec<Self>, GeometryError> {
        let found = Geometry::of(model, points, velocity)?;
        let points = points.chunks_exact(names.len());
        Ok(found.into_iter().zip(points).map(|(found, q)| Self::new(names, found, model, q, velocity)).collect())
    }

    fn new(
        names: &'a [String],
        found: Result<Geometry<S>, GeometryError>,
        model: &dyn EulerLagrange<S>,
        q: &[S],
        velocity: &[S],
    ) -> Self {
        let problem = found.as_ref().err().map(GeometryError::to_string);
        let found = found.ok();
        let metric = match &found {
            Some(found) => found.metric.components.clone(),
            None => {
                let mut terms = Terms::default();
                // It is filled where it is not finite too.
                let _ = model.terms(q, velocity, Request::MASS_MATRIX, &mut terms);
                terms.mass_matrix
            }
        };
        let length = |row: &[S]| match row.iter().map(|g| g.abs().to_f64()).fold(0.0, f64::max) {
            largest if largest > 0.0 => largest.sqrt(),
            _ => 1.0,
        };
        let lengths = metric.chunks_exact(names.len()).map(length).collect();
        let parts = names.iter().zip(q).map(|(name, x)| format!("{name} = {}", trimmed(x.to_f64(), DIGITS)));
        let place = parts.collect::<Vec<_>>().join(", ");
        Self { names, place, quantities: quantities(&metric, found.as_ref()), lengths, problem }
    }

    /// Components beyond rounding that the others follow from, with their indices.
    fn components(&self, quantity: &Quantity<S>) -> Vec<(Vec<usize>, f64)> {
        let Value::Tensor(values, rank) = &quantity.value else { return Vec::new() };
        let n = self.names.len();
        let indices = |place: usize| (0..*rank as u32).rev().map(|k| place / n.pow(k) % n).collect::<Vec<_>>();
        let in_lengths = |at: &[usize], x: f64| {
            let (up, down) = at.split_at(quantity.upper);
            let up = up.iter().map(|&i| self.lengths[i]);
            up.chain(down.iter().map(|&i| self.lengths[i].recip())).fold(x.abs(), |x, length| x * length)
        };
        let all = || values.iter().enumerate().map(|(place, x)| (indices(place), x.to_f64()));
        // Ricci's and Einstein's tensors are sums of Riemann's components and inherit their rounding.
        let largest = all().map(|(at, x)| in_lengths(&at, x)).fold(self.curvature_of(quantity), f64::max);
        let least = ROUNDINGS * S::epsilon().to_f64() * largest;
        all().filter(|(at, x)| in_lengths(at, *x) > least && (quantity.independent)(at)).collect()
    }

    /// Largest component of Riemann's tensor in directions of unit length, for quantities derived from it; 0 for all others.
    fn curvature_of(&self, quantity: &Quantity<S>) -> f64 {
        if !["ricci", "ricci_scalar", "einstein", "weyl"].contains(&quantity.key) {
            return 0.0;
        }
        let riemann = self.quantities.iter().find(|other| other.title == RIEMANN);
        let unit = |(at, x): (Vec<usize>, f64)| at.iter().fold(x.abs(), |x, &i| x / self.lengths[i]);
        riemann.map_or(0.0, |riemann| self.components(riemann).into_iter().map(unit).fold(0.0, f64::max))
    }

    /// A number, zero if it is rounding.
    fn number(&self, quantity: &Quantity<S>, x: S) -> f64 {
        let least = ROUNDINGS * S::epsilon().to_f64() * self.curvature_of(quantity);
        if x.abs().to_f64() > least { x.to_f64() } else { 0.0 }
    }

    /// A table of the components beyond rounding, without those that follow by symmetry, below a heading.
    pub fn findings(&self, heading: &str) -> Findings {
        let mut rows: Vec<[String; 3]> = Vec::new();
        for quantity in self.quantities.iter().filter(|quantity| !quantity.title.is_empty()) {
            let mut row = |at: String, value: String| {
                let again = rows.iter().any(|row| row[0] == quantity.title);
                rows.push([if again { String::new() } else { quantity.title.to_string() }, at, value]);
            };
            match &quantity.value {
                Value::Missing => {}
                Value::Number(x) => row(String::new(), rounded(self.number(quantity, *x), DIGITS)),
                Value::Signature(signs) => {
                    let signs = [("-", signs.negative), ("0", signs.zero), ("+", signs.positive)];
                    row(String::new(), signs.map(|(sign, count)| sign.repeat(count)).concat());
                }
                Value::Tensor(..) => {
                    let components = self.components(quantity);
                    if components.is_empty() {
                        row(String::new(), "0".to_string());
                    }
                    for (at, x) in components {
                        let at: Vec<&str> = at.iter().map(|&i| self.names[i].as_str()).collect();
                        row(at.join(","), rounded(x, DIGITS));
                    }
                }
            }
        }
        let mut findings = Findings::default();
        findings.line(heading).table(&["quantity", "component", "value"], rows);
        if let Some(problem) = &self.problem {
            findings.line(problem);
        }
        findings
    }

    /// Every component with all digits, as an object on one line of JSON.
    pub fn json(&self) -> String {
        let quantities = self.quantities.iter().filter(|quantity| !quantity.key.is_empty());
        let fields = quantities.map(|quantity| {
            let value = match &quantity.value {
                Value::Missing => "null".to_string(),
                Value::Number(x) => number(*x),
                Value::Signature(signs) => format!("[{},{}]", signs.negative, signs.positive),
                Value::Tensor(values, rank) => tensor(values, self.names.len(), *rank),
            };
            (quantity.key, value)
        });
        object(fields.chain(self.problem.as_deref().map(|problem| ("error", quoted(problem)))))
    }

    /// The report as an `align*` environment, with the heading as a comment.
    pub fn latex(&self, heading: &str) -> String {
        let mut lines: Vec<String> = Vec::new();
        for quantity in self.quantities.iter().filter(|quantity| !quantity.symbol.is_empty()) {
            match &quantity.value {
                Value::Missing | Value::Signature(_) => {}
                Value::Number(x) => {
                    lines.push(format!("{} &= {}", quantity.symbol, latex_number(self.number(quantity, *x), DIGITS)));
                }
                Value::Tensor(_, rank) => {
                    let components = self.components(quantity);
                    if components.is_empty() {
                        lines.push(format!("{} &= 0", quantity.indexed(&LETTERS.map(String::from)[..*rank])));
                    }
                    for (at, x) in components {
                        let at: Vec<String> = at.iter().map(|&i| latex_name(&self.names[i])).collect();
                        lines.push(format!("{} &= {}", quantity.indexed(&at), latex_number(x, DIGITS)));
                    }
                }
            }
        }
        let problem = self.problem.iter().map(|problem| format!("% {problem}\n")).collect::<String>();
        if lines.is_empty() {
            return format!("% {heading}\n{problem}");
        }
        format!("% {heading}\n{problem}\\begin{{align*}}\n  {}\n\\end{{align*}}\n", lines.join(" \\\\\n  "))
    }
}

impl<S> Quantity<S> {
    /// The symbol with its indices in LaTeX: `\Gamma^{r}{}_{tt}`.
    fn indexed(&self, at: &[String]) -> String {
        let (up, down) = at.split_at(self.upper);
        let joined = |names: &[String]| {
            names.iter().fold(String::new(), |mut all, name| {
                // A command ends where no letter follows.
                let open = all.rsplit_once('\\').is_some_and(|(_, word)| word.chars().all(char::is_alphabetic));
                if open && name.starts_with(char::is_alphabetic) {
                    all.push(' ');
                }
                all + name
            })
        };
        match (up, down) {
            ([], down) => format!("{}_{{{}}}", self.symbol, joined(down)),
            (up, []) => format!("{}^{{{}}}", self.symbol, joined(up)),
            (up, down) => format!("{}^{{{}}}{{}}_{{{}}}", self.symbol, joined(up), joined(down)),
        }
    }
}

/// Title of Riemann's tensor with all indices down.
const RIEMANN: &str = "Riemann R_abcd";

/// All quantities of a point with a metric, `(n, n)`, whether or not its geometry was found.
fn quantities<S: Scalar>(metric: &[S], found: Option<&Geometry<S>>) -> Vec<Quantity<S>> {
    let n = metric.len().isqrt();
    let own = || inertia(n, metric, &mut vec![S::nan(); n * n]).ok();
    let signature = found.map(|f| f.metric.signature).or_else(own);
    let singular = signature.filter(|signature| signature.zero > 0).map(|_| <S as Real>::zero());
    let determinant = found.map(|f| f.metric.determinant).or(singular);
    let finite = metric.iter().all(|x| x.is_finite()).then_some(metric);
    let number = |value: Option<S>| value.map_or(Value::Missing, Value::Number);
    let tensor = |values: Option<&[S]>, rank| values.map_or(Value::Missing, |x| Value::Tensor(x.to_vec(), rank));
    let of = |part: fn(&Geometry<S>) -> &[S]| found.map(part);
    let make =
        |key, title, symbol, upper, independent, value| Quantity { key, title, symbol, upper, independent, value };
    let signs = signature.map_or(Value::Missing, Value::Signature);
    vec![
        make("metric", "metric g_ab", "g", 0, symmetric, tensor(finite, 2)),
        make("inverse_metric", "inverse g^ab", "g", 2, symmetric, tensor(of(|f| &f.metric.inverse), 2)),
        make("determinant", "determinant det g", "\\det g", 0, each, number(determinant)),
        make("signature", "signature", "", 0, each, signs),
        make("christoffel", "Christoffel G^a_bc", "\\Gamma", 1, symmetric, tensor(of(|f| &f.connection.symbols), 3)),
        make("riemann", "", "", 1, each, tensor(of(|f| &f.curvature.riemann), 4)),
        make("", RIEMANN, "R", 0, two_pairs, tensor(of(|f| &f.curvature.lowered), 4)),
        make("ricci", "Ricci R_ab", "R", 0, symmetric, tensor(of(|f| &f.curvature.ricci), 2)),
        make("ricci_scalar", "curvature scalar R", "R", 0, each, number(found.map(|f| f.curvature.scalar))),
        make("einstein", "Einstein G_ab", "G", 0, symmetric, tensor(of(|f| &f.curvature.einstein), 2)),
        make("weyl", "Weyl C_abcd", "C", 0, two_pairs, tensor(of(|f| &f.curvature.weyl), 4)),
        make(
            "kretschmann",
            "Kretschmann R_abcd R^abcd",
            "R_{\\mu\\nu\\rho\\sigma} R^{\\mu\\nu\\rho\\sigma}",
            0,
            each,
            number(found.map(|f| f.curvature.kretschmann)),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::SystemInstance;

    fn report(name: &str, names: [&str; 4], q: [f64; 4]) -> [String; 2] {
        let (model, names) =
            (SystemInstance::<f64>::named(name, &[]).unwrap().build().unwrap(), names.map(String::from));
        let report = PointReport::of(&*model, &names, &q, &[0.0; 4]).unwrap().remove(0);
        [report.findings("here").to_string(), report.latex("here")]
    }

    /// Far from a hole Riemann's components differ by the fourth power of the distance, and all are kept.
    #[test]
    fn every_component_beyond_rounding_is_reported_once() {
        for r in [3.0, 3e4] {
            let q = [1.0, r, core::f64::consts::FRAC_PI_2, 0.0];
            let [text, latex] = report("schwarzschild-geodesic", ["t", "r", "theta", "phi"], q);
            let lines = |key: &str| latex.lines().filter(|line| line.trim_start().starts_with(key)).count();
            assert_eq!([lines("g_"), lines("g^"), lines("\\Gamma"), lines("C_")], [4, 4, 7, 6], "{latex}");
            // Six of Riemann, Ricci's zero, the scalar's zero.
            assert_eq!([lines("R_{"), lines("R &"), lines("G_")], [6 + 1 + 1, 1, 1], "{latex}");
            assert!(latex.contains("R_{\\mu\\nu} &= 0") && latex.contains("R &= 0"), "{latex}");
            let shown = text.lines().filter(|line| line.contains(',')).count();
            assert_eq!(shown, 4 + 4 + 7 + 6 + 6, "{text}");
            assert!(text.starts_with("here\n") && text.contains("-+++"));
        }
    }

    #[test]
    fn latex_has_its_signs() {
        let q = [0.0, 3.0, core::f64::consts::FRAC_PI_2, 0.0];
        let [_, latex] = report("schwarzschild-geodesic", ["t", "r", "theta", "phi"], q);
        for line in ["g_{tt} &= -0.3333333 \\\\", "\\Gamma^{t}{}_{tr} &= 0.3333333", "g_{\\theta\\theta} &= 9 \\\\"] {
            assert!(latex.contains(line), "{line} {latex}");
        }
        assert!(latex.contains("R_{trtr} &= -7.407407 \\times 10^{-2}") || latex.contains("R_{trtr} &= -0.07407407"));
        assert!(latex.contains("\\Gamma^{\\theta}{}_{r\\theta}") && latex.contains("R_{\\theta\\phi\\theta\\phi}"));
        assert!(latex.starts_with("% here\n\\begin{align*}\n") && latex.ends_with("\n\\end{align*}\n"));
        assert_eq!(latex.matches("\\\\\n").count() + 1, latex.lines().count() - 3);
        let symbol = Quantity { upper: 1, ..quantities::<f64>(&[1.0], None).remove(0) };
        let at = |names: &[&str]| symbol.indexed(&names.iter().map(|name| latex_name(name)).collect::<Vec<_>>());
        assert_eq!(at(&["r", "theta", "r"]), "g^{r}{}_{\\theta r}");
        assert_eq!(at(&["r", "q1", "theta"]), "g^{r}{}_{q_{1}\\theta}");
    }

    #[test]
    fn a_point_without_geometry_says_why() {
        let [text, latex] = report("schwarzschild-geodesic", ["t", "r", "theta", "phi"], [0.0, 2.0, 1.0, 0.0]);
        assert!(text.contains("not finite") && latex == "% here\n% the metric is not finite\n", "{text}{latex}");
        let [text, latex] = report("schwarzschild-geodesic", ["t", "r", "theta", "phi"], [0.0, 3.0, 0.0, 0.0]);
        assert!(text.contains("degenerate") && text.contains("determinant") && latex.contains("g_{rr} &= 3"), "{text}");
    }
}
