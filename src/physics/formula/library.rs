//! Terms that a Lagrangian may have: functions of the coordinates times velocities.

use super::error::FormulaError;
use super::extent::{Drive, Extent};
use super::families::own_function;
use super::function::{Factor, Function, Notation, Taylor};
use super::quotient::Quotient;
use super::thresholds::{MOST_COORDINATES, MOST_LIBRARY_TERMS};
use crate::lagrangian::{EquationPart, Equations, Lagrangian};
use crate::linalg::{self, dot};
use crate::names::latex_name;
use crate::random::RngStream;
use crate::scalar::Real;
use crate::tape::TapeError;
use rand::Rng;
use std::f64::consts::TAU;

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

/// Functions of the coordinates and the terms that they make.
#[derive(Clone, Debug)]
pub(super) struct Library {
    /// Names of the coordinates.
    pub names: Vec<String>,
    /// Functions of the coordinates, and of the phase `om t` of the drive that follows them.
    pub functions: Vec<Function>,
    pub terms: Vec<Term>,
    pub drive: Option<Drive>,
    /// Terms up to this one are searched; later ones may replace several terms at the end.
    pub searched: usize,
}

/// Values and derivatives of the functions of a library at a state.
pub(super) type Values = Vec<Taylor>;

impl Library {
    /// The library of coordinates, where those marked `periodic` are angles, with the user's own formulas.
    ///
    /// # Errors
    /// Too many coordinates or terms, or an invalid formula.
    pub fn new(names: &[String], periodic: &[bool], extent: Extent, own: &[String]) -> Result<Self, FormulaError> {
        let n = names.len();
        if n == 0 || n > MOST_COORDINATES {
            return Err(FormulaError::Coordinates { found: n, most: MOST_COORDINATES });
        }
        let Extent { families, gyroscopic, friction, drive } = extent;
        let angles: Vec<usize> = (0..n).filter(|&i| periodic[i]).collect();
        let mut functions = families.functions(periodic);
        for text in own {
            functions.push(own_function(names, text)?);
        }
        if functions.len() > MOST_LIBRARY_TERMS {
            return Err(FormulaError::Terms { found: functions.len(), most: MOST_LIBRARY_TERMS });
        }
        let mut library = Self { names: names.to_vec(), functions, terms: Vec::new(), drive, searched: 0 };
        for function in 0..library.functions.len() {
            let pairs = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
            library.terms.extend(pairs.map(|(i, j)| Term { kind: Kind::Kinetic(i, j), function }));
            if gyroscopic {
                library.terms.extend((0..n).map(|i| Term { kind: Kind::Gyroscopic(i), function }));
            }
            library.terms.push(Term { kind: Kind::Potential, function });
        }
        library.add_friction(friction);
        library.add_drive();
        library.searched = library.terms.len();
        if library.terms.len() > MOST_LIBRARY_TERMS {
            return Err(FormulaError::Terms { found: library.terms.len(), most: MOST_LIBRARY_TERMS });
        }
        library.add_products(&angles);
        Ok(library)
    }

    /// Adds products of sines and cosines of single angles, each of which is a sum of searched functions.
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

    /// Number of known functions of the time: 1 with a drive.
    fn known(&self) -> usize {
        usize::from(self.drive.is_some())
    }

    /// `true` for a term of the drive.
    pub fn is_driven(&self, k: usize) -> bool {
        self.drive.is_some() && self.functions[self.terms[k].function].has_phase(self.n())
    }

    /// Values and derivatives of some functions at positions and a time; the others keep their previous ones.
    pub fn evaluate(&self, which: &[usize], (q, t): (&[f64], f64), values: &mut Values) {
        let mut place = [0.0; MOST_COORDINATES + 1];
        place[..q.len()].copy_from_slice(q);
        place[q.len()] = self.drive.as_ref().map_or(0.0, |drive| drive.frequency * t);
        let place = &place[..q.len() + self.known()];
        if values.len() < self.functions.len() {
            values.resize(self.functions.len(), Taylor::default());
        }
        for &k in which {
            values[k] = self.functions[k].taylor(place, q.len());
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

    /// The equations of motion of some terms with `count` parameters: first the coefficients, last the frequency of the drive if there is
    /// one. They have derivatives by the chosen parameters and then by the coefficients of the wanted terms.
    ///
    /// # Errors
    /// A formula that branches on its data.
    pub fn equations(
        &self,
        terms: &[usize],
        count: usize,
        (chosen, wanted): (&[usize], &[usize]),
    ) -> Result<Equations, TapeError> {
        let record = |terms: Vec<(usize, Option<usize>)>, friction: bool| {
            EquationPart::record(&Sum { library: self, terms }, count, friction)
        };
        let own = |friction: bool| {
            let own = terms.iter().enumerate().filter(|(_, k)| self.is_dissipation(**k) == friction);
            record(own.map(|(at, &k)| (k, Some(at))).collect(), friction)
        };
        let single = wanted.iter().map(|&k| record(vec![(k, None)], self.is_dissipation(k)));
        let single = single.collect::<Result<Vec<_>, _>>()?;
        Equations::of(self.n(), count, &[own(false)?, own(true)?], (chosen, &single))
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
    /// their Euler-Lagrange equations at random states are independent. Positions are drawn from `bounds`, phases of the drive from the circle.
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
            let t = self.drive.as_ref().map_or(0.0, |drive| draw(0.0, TAU) / drive.frequency);
            self.evaluate(&all, (&q, t), &mut values);
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
        let phase = self.drive.iter().map(|Drive { name, .. }| match notation {
            Notation::System => format!("{name}*t"),
            Notation::Latex => "\\omega t".to_string(),
            Notation::Rust => format!("{name} * q[{}]", self.n()),
        });
        let names: Vec<String> = (0..self.n()).map(name).chain(phase).collect();
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

/// Partitions `n` coordinates into groups, given lists of coupled coordinates.
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
    /// Time is the last variable if the system is driven.
    fn coordinates(&self) -> usize {
        self.library.n() + self.library.known()
    }

    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let mut place = q.to_vec();
        if let (1, [.., t], Some(frequency)) = (self.library.known(), &mut place[..], parameters.last()) {
            *t *= *frequency;
        }
        let of = |&(k, at): &(usize, Option<usize>)| {
            let value = self.library.value(k, &place, v);
            at.map_or(value, |at| parameters[at] * value)
        };
        self.terms.iter().fold(R::zero(), |sum, term| sum + of(term))
    }
}

#[cfg(test)]
mod tests {
    use super::super::extent::Friction;
    use super::super::families::Families;
    use super::*;

    fn library(periodic: &[bool], gyroscopic: bool) -> Library {
        let names: Vec<String> = (1..=periodic.len()).map(|i| format!("q{i}")).collect();
        let extent = Extent { families: Families::default(), gyroscopic, friction: Friction::None, drive: None };
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
        // If the sum of two terms is a total derivative, one of them remains.
        let pair = ["q1_dot*q2*cos(q1)", "q2_dot*sin(q1)"].map(find);
        assert_eq!(pair.iter().filter(|k| kept.contains(k)).count(), 1);
        // sin^2 over cos 2x.
        let square = quotient.over_kept[find("sin(q1)^2")].as_ref().unwrap();
        let place = kept.iter().position(|&k| k == find("cos(2*q1)")).unwrap();
        assert!((square[place] + 0.5).abs() < 1e-9 && quotient.removed > 4, "{square:?}");
    }
}
