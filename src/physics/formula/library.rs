//! Terms that a Lagrangian may have: functions of the coordinates times velocities.

use super::error::FormulaError;
use super::function::{Factor, Function, MOST_COORDINATES, Notation, Taylor};
use crate::lagrangian::{EquationPart, Equations, Lagrangian};
use crate::linalg::{self, dot};
use crate::names::latex_name;
use crate::random::RngStream;
use crate::scalar::Real;
use crate::tape::TapeError;
use rand::Rng;

/// Largest number of functions and terms.
pub(super) const MOST_TERMS: usize = 400;
/// Highest degree of a family.
const MOST_DEGREE: usize = 6;

/// Which functions of the coordinates a library is made of, by family and total degree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Families {
    /// Powers of coordinates that are not angles.
    pub polynomial: usize,
    /// Sines and cosines of sums and differences of multiples of the angles.
    pub trigonometric: usize,
    /// Positive and negative powers of the distance from the origin in the coordinates that are not angles.
    pub radial: usize,
    /// Reciprocals of powers of every coordinate that is not an angle.
    pub reciprocal: usize,
}

impl Default for Families {
    fn default() -> Self {
        Self { polynomial: 2, trigonometric: 2, radial: 0, reciprocal: 0 }
    }
}

impl Families {
    /// `true` without powers of distances and reciprocals.
    pub(super) fn is_polynomial(&self) -> bool {
        self.radial == 0 && self.reciprocal == 0
    }
}

impl std::fmt::Display for Families {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { polynomial, trigonometric, radial, reciprocal } = *self;
        let all = [
            ("polynomial", polynomial),
            ("trigonometric", trigonometric),
            ("radial", radial),
            ("reciprocal", reciprocal),
        ];
        let parts = all.iter().filter(|(_, degree)| *degree > 0).map(|(family, degree)| format!("{family}:{degree}"));
        f.write_str(&parts.collect::<Vec<_>>().join(","))
    }
}

impl std::str::FromStr for Families {
    type Err = String;

    /// `family:degree,..`; a family that is missing has degree 0.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut families = Self { polynomial: 0, trigonometric: 0, radial: 0, reciprocal: 0 };
        for part in text.split(',') {
            let (family, degree) = part.split_once(':').ok_or("expected FAMILY:DEGREE, such as polynomial:3")?;
            let place = match family.trim() {
                "polynomial" => &mut families.polynomial,
                "trigonometric" => &mut families.trigonometric,
                "radial" => &mut families.radial,
                "reciprocal" => &mut families.reciprocal,
                family => {
                    let known = ["polynomial", "trigonometric", "radial", "reciprocal"];
                    return Err(crate::names::unknown("family", family, known));
                }
            };
            let degree = degree.trim().parse().ok().filter(|degree| *degree <= MOST_DEGREE);
            *place = degree.ok_or_else(|| format!("{family}: expected a degree from 0 to {MOST_DEGREE}"))?;
        }
        Ok(families)
    }
}

/// Kind of a term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// `v_i v_j f(q)` in `L`, `i <= j`.
    Kinetic(usize, usize),
    /// `v_i f(q)` in `L`.
    Gyroscopic(usize),
    /// `f(q)` in `L`.
    Potential,
    /// `v_i v_j f(q)` in Rayleigh's dissipation function, `i <= j`.
    Dissipation(usize, usize),
}

/// A term: velocities by kind, times a function by its index in the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Term {
    pub kind: Kind,
    pub function: usize,
}

/// Kinds of terms in a library, besides `v_i v_j f(q)` and `f(q)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Extent {
    pub families: Families,
    pub gyroscopic: bool,
    pub friction: bool,
}

/// Functions of the coordinates and the terms that they make.
#[derive(Clone, Debug)]
pub(super) struct Library {
    /// Names of the coordinates.
    pub names: Vec<String>,
    pub functions: Vec<Function>,
    pub terms: Vec<Term>,
    /// Terms up to this one are searched; later ones may replace several terms at the end.
    pub searched: usize,
}

/// Functions of a state, at the functions of a library.
pub(super) type Values = Vec<Taylor>;

impl Library {
    /// The library of coordinates, of which `periodic` are angles, with the user's own formulas.
    ///
    /// # Errors
    /// Too many coordinates or terms, or an invalid formula.
    pub fn new(names: &[String], periodic: &[bool], extent: Extent, own: &[String]) -> Result<Self, FormulaError> {
        let n = names.len();
        if n == 0 || n > MOST_COORDINATES {
            return Err(FormulaError::Coordinates { found: n, most: MOST_COORDINATES });
        }
        let Extent { families, gyroscopic, friction } = extent;
        let lines: Vec<usize> = (0..n).filter(|&i| !periodic[i]).collect();
        let angles: Vec<usize> = (0..n).filter(|&i| periodic[i]).collect();
        let mut of_lines: Vec<(usize, Vec<Factor>)> = Vec::new();
        for powers in exponents(lines.len(), families.polynomial) {
            let factors = lines.iter().zip(&powers).filter(|(_, p)| **p > 0);
            of_lines.push((powers.iter().sum(), factors.map(|(&i, &p)| Factor::Power(i, p as i32)).collect()));
        }
        if lines.len() > 1 {
            for k in (1..=families.radial as i32).flat_map(|k| [-k, k]).filter(|k| *k < 0 || k % 2 != 0) {
                of_lines.push((k.unsigned_abs() as usize, vec![Factor::Radius(lines.clone(), k)]));
            }
        }
        for k in 1..=families.reciprocal as i32 {
            of_lines.extend(lines.iter().map(|&i| (k as usize, vec![Factor::Power(i, -k)])));
        }
        let mut waves: Vec<(usize, Option<Factor>)> = vec![(0, None)];
        for harmonics in harmonics(angles.len(), families.trigonometric as i32) {
            let mut all = vec![0; n];
            angles.iter().zip(&harmonics).for_each(|(&i, &m)| all[i] = m);
            let degree = harmonics.iter().map(|m| m.unsigned_abs() as usize).sum();
            waves.push((degree, Some(Factor::Cosine(all.clone()))));
            waves.push((degree, Some(Factor::Sine(all))));
        }
        let most = families.polynomial.max(families.trigonometric).max(families.reciprocal);
        let mut functions = Vec::new();
        for (power, factors) in &of_lines {
            for (degree, wave) in &waves {
                if *degree == 0 || power + degree <= most {
                    functions.push(Function::Product(factors.iter().cloned().chain(wave.clone()).collect()));
                }
            }
        }
        for text in own {
            functions.push(own_function(names, text)?);
        }
        if functions.len() > MOST_TERMS {
            return Err(FormulaError::Terms { found: functions.len(), most: MOST_TERMS });
        }
        let mut library = Self { names: names.to_vec(), functions, terms: Vec::new(), searched: 0 };
        for function in 0..library.functions.len() {
            let pairs = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
            library.terms.extend(pairs.map(|(i, j)| Term { kind: Kind::Kinetic(i, j), function }));
            if gyroscopic {
                library.terms.extend((0..n).map(|i| Term { kind: Kind::Gyroscopic(i), function }));
            }
            library.terms.push(Term { kind: Kind::Potential, function });
        }
        if friction {
            let pairs = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
            let one = library.functions.iter().position(Function::is_one).unwrap_or(0);
            library.terms.extend(pairs.map(|(i, j)| Term { kind: Kind::Dissipation(i, j), function: one }));
        }
        library.searched = library.terms.len();
        if library.terms.len() > MOST_TERMS {
            return Err(FormulaError::Terms { found: library.terms.len(), most: MOST_TERMS });
        }
        library.add_products(&angles);
        Ok(library)
    }

    /// Adds products of sines and cosines of single angles, each of which is a sum of the functions that are searched.
    fn add_products(&mut self, angles: &[usize]) {
        let n = self.names.len();
        let unit = |i: usize| (0..n).map(|k| i32::from(k == i)).collect::<Vec<_>>();
        let single: Vec<Function> = angles
            .iter()
            .flat_map(|&i| [Factor::Cosine(unit(i)), Factor::Sine(unit(i))])
            .map(|factor| Function::Product(vec![factor]))
            .collect();
        let kinds: Vec<Kind> = {
            let mut kinds = Vec::new();
            for term in &self.terms {
                if !kinds.contains(&term.kind) && !matches!(term.kind, Kind::Dissipation(..)) {
                    kinds.push(term.kind);
                }
            }
            kinds
        };
        for (k, a) in single.iter().enumerate() {
            for b in &single[k..] {
                if let Some(product) = a.product(b) {
                    let function = self.functions.len();
                    self.functions.push(product);
                    self.terms.extend(kinds.iter().map(|&kind| Term { kind, function }));
                }
            }
        }
    }

    /// Number of coordinates.
    pub fn n(&self) -> usize {
        self.names.len()
    }

    /// Values and derivatives of some functions at `q`; the others keep their previous ones.
    pub fn evaluate(&self, which: &[usize], q: &[f64], values: &mut Values) {
        if values.len() < self.functions.len() {
            values.resize(self.functions.len(), Taylor::default());
        }
        for &k in which {
            values[k] = self.functions[k].taylor(q);
        }
    }

    /// The functions of some terms, each once.
    pub fn functions_of(&self, terms: &[usize]) -> Vec<usize> {
        let mut functions: Vec<usize> = terms.iter().map(|&k| self.terms[k].function).collect();
        functions.sort_unstable();
        functions.dedup();
        functions
    }

    /// Coordinates that a term couples: those of its velocities and of its function.
    pub fn coordinates(&self, k: usize) -> Vec<usize> {
        let Term { kind, function } = self.terms[k];
        let mut joined = self.functions[function].coordinates(self.n());
        match kind {
            Kind::Kinetic(i, j) | Kind::Dissipation(i, j) => joined.extend([i, j]),
            Kind::Gyroscopic(i) => joined.push(i),
            Kind::Potential => {}
        }
        joined
    }

    /// Groups of coordinates that some terms leave decoupled.
    pub fn blocks(&self, terms: &[usize]) -> Vec<Vec<usize>> {
        let joined: Vec<Vec<usize>> = terms.iter().map(|&k| self.coordinates(k)).collect();
        blocks(self.n(), joined.iter().map(Vec::as_slice))
    }

    /// A term as a function of positions and velocities.
    fn value<R: Real>(&self, k: usize, q: &[R], v: &[R]) -> R {
        let Term { kind, function } = self.terms[k];
        let function = self.functions[function].value(q);
        match kind {
            Kind::Kinetic(i, j) | Kind::Dissipation(i, j) => v[i] * v[j] * function,
            Kind::Gyroscopic(i) => v[i] * function,
            Kind::Potential => function,
        }
    }

    /// The equations of motion of some terms, whose coefficients are the first of `count` parameters, with derivatives by the coefficients of
    /// the wanted terms.
    ///
    /// # Errors
    /// A formula that branches on its data.
    pub fn equations(&self, terms: &[usize], count: usize, wanted: &[usize]) -> Result<Equations, TapeError> {
        let record = |terms: Vec<(usize, Option<usize>)>, friction: bool| {
            EquationPart::record(&Sum { library: self, terms }, count, friction)
        };
        let own = |friction: bool| {
            let own = terms.iter().enumerate().filter(|(_, k)| self.is_dissipation(**k) == friction);
            record(own.map(|(at, &k)| (k, Some(at))).collect(), friction)
        };
        let single = wanted.iter().map(|&k| record(vec![(k, None)], self.is_dissipation(k)));
        let single = single.collect::<Result<Vec<_>, _>>()?;
        Equations::of(self.n(), count, &[own(false)?, own(true)?], (&[], &single))
    }

    /// Adds `factor` times `d/dt dL/dv - dL/dq + dD/dv` of a term at a state with an acceleration.
    pub fn add_equation(&self, k: usize, factor: f64, at: &Values, (v, a): (&[f64], &[f64]), into: &mut [f64]) {
        let Term { kind, function } = self.terms[k];
        let f = &at[function];
        match kind {
            Kind::Kinetic(i, j) => {
                let rate = dot(&f.gradient, v);
                into[i] += factor * (f.value * a[j] + rate * v[j]);
                into[j] += factor * (f.value * a[i] + rate * v[i]);
                let square = factor * v[i] * v[j];
                into.iter_mut().zip(&f.gradient).for_each(|(x, g)| *x -= square * g);
            }
            Kind::Gyroscopic(i) => {
                into[i] += factor * dot(&f.gradient, v);
                let speed = factor * v[i];
                into.iter_mut().zip(&f.gradient).for_each(|(x, g)| *x -= speed * g);
            }
            Kind::Potential => into.iter_mut().zip(&f.gradient).for_each(|(x, g)| *x -= factor * g),
            Kind::Dissipation(i, j) => {
                into[i] += factor * f.value * v[j];
                into[j] += factor * f.value * v[i];
            }
        }
    }

    /// Complexity of a term: of equally good terms the simplest is kept.
    pub fn complexity(&self, k: usize) -> f64 {
        let Term { kind, function } = self.terms[k];
        let own = match kind {
            Kind::Kinetic(i, j) | Kind::Dissipation(i, j) => {
                if i == j {
                    0.0
                } else {
                    0.4
                }
            }
            Kind::Gyroscopic(_) => 1.0,
            Kind::Potential => 0.0,
        };
        own + self.functions[function].complexity()
    }

    /// The searched terms without those that are linear combinations of others up to a total derivative or an identity, keeping simple ones:
    /// their Euler-Lagrange equations at random states are independent. Positions are drawn from `bounds`.
    pub fn independent(&self, bounds: &[[f64; 2]], seed: u64) -> (Vec<usize>, Quotient) {
        let (n, count) = (self.n(), self.terms.len());
        let mut rng = RngStream::Region.generator(seed);
        let states = 2 * self.searched / n + 60;
        let all: Vec<usize> = (0..self.functions.len()).collect();
        let mut values = Values::new();
        let mut columns = vec![vec![0.0; states * n]; count];
        let mut draw = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        for s in 0..states {
            let q: Vec<f64> = bounds.iter().map(|b| draw(b[0], b[1])).collect();
            let v: Vec<f64> = (0..n).map(|_| draw(-1.0, 1.0)).collect();
            let a: Vec<f64> = (0..n).map(|_| draw(-1.0, 1.0)).collect();
            self.evaluate(&all, &q, &mut values);
            for (k, column) in columns.iter_mut().enumerate() {
                self.add_equation(k, 1.0, &values, (&v, &a), &mut column[s * n..(s + 1) * n]);
            }
        }
        Quotient::new(self, &columns)
    }

    /// A term of L or of D.
    pub fn written(&self, k: usize, notation: Notation) -> String {
        let name = |i: usize| match notation {
            Notation::System => self.names[i].clone(),
            Notation::Latex => latex_name(&self.names[i]),
            Notation::Rust => format!("q[{i}]"),
        };
        let velocity = |i: usize, k: i32| {
            let velocity = match notation {
                Notation::System => format!("{}_dot", self.names[i]),
                Notation::Latex => format!("\\dot{{{}}}", name(i)),
                Notation::Rust => format!("v[{i}]"),
            };
            notation.power(&velocity, k)
        };
        let mut factors = match self.terms[k].kind {
            Kind::Kinetic(i, j) | Kind::Dissipation(i, j) if i == j => vec![velocity(i, 2)],
            Kind::Kinetic(i, j) | Kind::Dissipation(i, j) => vec![velocity(i, 1), velocity(j, 1)],
            Kind::Gyroscopic(i) => vec![velocity(i, 1)],
            Kind::Potential => vec![],
        };
        let names: Vec<String> = (0..self.n()).map(name).collect();
        factors.extend(self.functions[self.terms[k].function].written(&names, notation));
        if factors.is_empty() { "1".to_string() } else { notation.product(&factors) }
    }

    /// `true` if the term belongs to the dissipation function.
    pub fn is_dissipation(&self, k: usize) -> bool {
        matches!(self.terms[k].kind, Kind::Dissipation(..))
    }

    /// The mass matrix `(n, n)` that terms with these coefficients have where their functions have these values.
    pub fn mass_matrix(&self, terms: &[usize], coefficients: &[f64], values: &Values, mass: &mut [f64]) {
        let n = self.n();
        mass.fill(0.0);
        for (&k, &c) in terms.iter().zip(coefficients) {
            if let Some((i, j)) = self.kinetic(k) {
                let value = c * values[self.terms[k].function].value;
                mass[i * n + j] += value;
                mass[j * n + i] += value;
            }
        }
    }

    /// The contribution of a term to the mass matrix: `(i, j)` of an element and its mirror image.
    pub fn kinetic(&self, k: usize) -> Option<(usize, usize)> {
        match self.terms[k].kind {
            Kind::Kinetic(i, j) => Some((i, j)),
            _ => None,
        }
    }
}

/// Groups of `n` coordinates, by lists of those that are coupled.
pub(super) fn blocks<'a>(n: usize, joined: impl IntoIterator<Item = &'a [usize]>) -> Vec<Vec<usize>> {
    let pairs = joined.into_iter().flat_map(|list| list.windows(2).map(|pair| (pair[0], pair[1])));
    linalg::components(n, pairs)
}

/// A sum of terms, each times the parameter at an index if it has one.
struct Sum<'a> {
    library: &'a Library,
    terms: Vec<(usize, Option<usize>)>,
}

impl Lagrangian for Sum<'_> {
    fn coordinates(&self) -> usize {
        self.library.n()
    }

    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let of = |&(k, at): &(usize, Option<usize>)| {
            let value = self.library.value(k, q, v);
            at.map_or(value, |at| parameters[at] * value)
        };
        self.terms.iter().fold(R::zero(), |sum, term| sum + of(term))
    }
}

/// A user's function, which must not depend on velocities.
fn own_function(names: &[String], text: &str) -> Result<Function, FormulaError> {
    let wrong = |problem: String| FormulaError::Function { text: text.to_string(), problem };
    let function = Function::formula(names, text).map_err(|error| wrong(error.to_string()))?;
    if function.moves() {
        return Err(wrong("expected coordinates alone, found a velocity".to_string()));
    }
    Ok(function)
}

/// How removed terms are combined from the kept ones.
#[derive(Clone, Debug)]
pub(super) struct Quotient {
    /// Kept terms, in the order of the library.
    pub kept: Vec<usize>,
    /// For every term of the library: its coefficients over the kept terms; none if it is not a combination of them.
    pub over_kept: Vec<Option<Vec<f64>>>,
    /// Total derivatives and identities among the terms that are searched.
    pub removed: usize,
}

impl Quotient {
    /// Relative remainder below which a term is a combination of others.
    const REST: f64 = 1e-7;

    fn new(library: &Library, columns: &[Vec<f64>]) -> (Vec<usize>, Self) {
        let mut order: Vec<usize> = (0..library.searched).collect();
        order.sort_by(|&a, &b| library.complexity(a).total_cmp(&library.complexity(b)));
        // Orthonormal directions, and each as a combination of the kept terms.
        let mut directions: Vec<Vec<f64>> = Vec::new();
        let mut kept: Vec<usize> = Vec::new();
        let mut combinations: Vec<Vec<f64>> = Vec::new();
        let reduce = |column: &[f64], directions: &[Vec<f64>], combinations: &[Vec<f64>]| {
            let length = dot(column, column).sqrt();
            let mut rest = column.to_vec();
            let mut over = vec![0.0; directions.len()];
            for _ in 0..2 {
                for (direction, combination) in directions.iter().zip(combinations) {
                    let part = dot(direction, &rest);
                    rest.iter_mut().zip(direction).for_each(|(r, d)| *r -= part * d);
                    over.iter_mut().zip(combination).for_each(|(o, c)| *o += part * c);
                }
            }
            let left = dot(&rest, &rest).sqrt();
            (rest, over, length, left)
        };
        for k in order {
            let (mut rest, over, length, left) = reduce(&columns[k], &directions, &combinations);
            if length > 1e-12 && left > Self::REST * length {
                rest.iter_mut().for_each(|r| *r /= left);
                let mut combination: Vec<f64> = over.iter().map(|o| -o / left).collect();
                combination.push(1.0 / left);
                directions.push(rest);
                combinations.push(combination);
                kept.push(k);
            }
        }
        let mut sorted: Vec<(usize, usize)> = kept.iter().copied().enumerate().map(|(at, k)| (k, at)).collect();
        sorted.sort_unstable();
        let over_kept = columns.iter().map(|column| {
            let (_, over, length, left) = reduce(column, &directions, &combinations);
            let full = |at: usize| over.get(at).copied().unwrap_or(0.0);
            (left <= 1e-6 * length).then(|| sorted.iter().map(|&(_, at)| full(at)).collect())
        });
        let over_kept = over_kept.collect();
        let kept: Vec<usize> = sorted.into_iter().map(|(k, _)| k).collect();
        let removed = library.searched - kept.len();
        (kept.clone(), Self { kept, over_kept, removed })
    }
}

/// Exponents of so many coordinates with a sum of at most `degree`, lower sums first.
fn exponents(count: usize, degree: usize) -> Vec<Vec<usize>> {
    let mut all = vec![vec![]];
    for _ in 0..count {
        all = all
            .into_iter()
            .flat_map(|start: Vec<usize>| {
                let left = degree - start.iter().sum::<usize>();
                (0..=left).map(move |k| [start.clone(), vec![k]].concat())
            })
            .collect();
    }
    all.sort_by_key(|powers| powers.iter().sum::<usize>());
    all
}

/// Multiples of so many angles with a sum of magnitudes from 1 to `degree`, one of each pair `m`, `-m`.
fn harmonics(count: usize, degree: i32) -> Vec<Vec<i32>> {
    let mut all: Vec<Vec<i32>> = vec![vec![]];
    for _ in 0..count {
        all = all
            .into_iter()
            .flat_map(|start| {
                let left = degree - start.iter().map(|m| m.abs()).sum::<i32>();
                (-left..=left).map(move |m| [start.clone(), vec![m]].concat())
            })
            .collect();
    }
    all.retain(|m| m.iter().find(|m| **m != 0).is_some_and(|first| *first > 0));
    all.sort_by_key(|m| m.iter().map(|m| m.abs()).sum::<i32>());
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn library(periodic: &[bool], gyroscopic: bool) -> Library {
        let names: Vec<String> = (1..=periodic.len()).map(|i| format!("q{i}")).collect();
        let extent = Extent { families: Families::default(), gyroscopic, friction: false };
        Library::new(&names, periodic, extent, &[]).unwrap()
    }

    #[test]
    fn total_derivatives_and_identities_are_made_up_of_what_is_kept() {
        let library = library(&[true, false], true);
        let bounds = [[-3.0, 3.0], [-1.0, 2.0]];
        let (kept, quotient) = library.independent(&bounds, 0);
        let find =
            |text: &str| (0..library.terms.len()).find(|&k| library.written(k, Notation::System) == text).unwrap();
        // The constant, and q1_dot as the derivative of q1, have no effect.
        for nothing in ["1", "q1_dot", "q1_dot*cos(q1)"] {
            assert!(!kept.contains(&find(nothing)), "{nothing}");
            assert!(quotient.over_kept[find(nothing)].as_ref().unwrap().iter().all(|x| x.abs() < 1e-9));
        }
        // Of two terms whose sum is a total derivative one remains.
        let pair = ["q1_dot*q2*cos(q1)", "q2_dot*sin(q1)"].map(find);
        assert_eq!(pair.iter().filter(|k| kept.contains(k)).count(), 1);
        // sin^2 over cos 2x.
        let square = quotient.over_kept[find("sin(q1)^2")].as_ref().unwrap();
        let place = kept.iter().position(|&k| k == find("cos(2*q1)")).unwrap();
        assert!((square[place] + 0.5).abs() < 1e-9 && quotient.removed > 4, "{square:?}");
    }

    #[test]
    fn families_are_read_or_refused() {
        let read = |text: &str| text.parse::<Families>();
        assert_eq!(read("radial:3").unwrap(), Families { polynomial: 0, trigonometric: 0, radial: 3, reciprocal: 0 });
        assert!(read("polynomial").is_err() && read("polynom:1").is_err() && read("polynomial:99").is_err());
    }
}
