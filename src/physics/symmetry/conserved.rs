//! Conserved quantities that are quadratic in the momenta: Carter's constant, the vector of Runge and Lenz.

use super::basis::{Basis, Values};
use super::field::{join, sum};
use super::find::{FunctionColumns, check_size};
use super::null_space::{Separation, check, dot, norm, orthonormal, reduce};
use super::sample::Sample;
use super::thresholds::{ENTRY_NOISE, ENTRY_NOISES, INDEPENDENT_COLUMN, INDEPENDENT_FUNCTION, NEW_PART};
use super::{Field, SymmetryError, null_space};
use crate::lagrangian::EulerLagrange;
use crate::linalg::singular;

/// Factor of a function of the coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Monomial {
    /// Nothing: the function itself.
    One,
    /// A momentum.
    Linear(usize),
    /// Two momenta.
    Quadratic(usize, usize),
    /// The energy.
    Energy,
}

impl Monomial {
    /// Value at state `k`, and its rate along the motion: `dp/dt = dL/dq + Q`, `dE/dt = v.Q`, with the forces `Q` that are not in `L`.
    fn at(self, sample: &Sample, k: usize) -> [f64; 2] {
        let p = |i: usize| sample.p[k * sample.n + i];
        let g = |i: usize| sample.g[k * sample.n + i] + sample.force(k, i);
        let power = || (0..sample.n).map(|i| sample.v[k * sample.n + i] * sample.force(k, i)).sum();
        match self {
            Self::One => [1.0, 0.0],
            Self::Linear(i) => [p(i), g(i)],
            Self::Quadratic(i, j) => [p(i) * p(j), g(i) * p(j) + p(i) * g(j)],
            Self::Energy => [sample.energy[k], power()],
        }
    }

    fn text(self, names: &[String]) -> String {
        match self {
            Self::One => String::new(),
            Self::Linear(i) => format!("p_{}", names[i]),
            Self::Quadratic(i, j) if i == j => format!("p_{}^2", names[i]),
            Self::Quadratic(i, j) => format!("p_{}*p_{}", names[i], names[j]),
            Self::Energy => "E".to_string(),
        }
    }
}

/// A conserved quantity `sum of coefficients * function(q) * monomial(p, E)`.
#[derive(Clone, Debug)]
pub struct Conserved {
    /// Coefficients, functions and monomials; zero terms are left out.
    terms: Vec<(f64, usize, Monomial)>,
    basis: Basis,
}

impl Conserved {
    /// Value at a state of momentum `p` and energy `energy`.
    pub fn value(&self, q: &[f64], p: &[f64], energy: f64) -> f64 {
        let mut at = Values::default();
        self.basis.evaluate(q, &mut at);
        let monomial = |monomial: Monomial| match monomial {
            Monomial::One => 1.0,
            Monomial::Linear(i) => p[i],
            Monomial::Quadratic(i, j) => p[i] * p[j],
            Monomial::Energy => energy,
        };
        self.terms.iter().map(|&(c, f, m)| c * at.value[f] * monomial(m)).sum()
    }

    /// The quantity as a formula, `E` the energy and `p_x` the momentum of `x`.
    pub fn text(&self) -> String {
        let names = self.basis.names();
        sum(self.terms.iter().map(|&(c, f, m)| {
            let function = self.basis.text(f);
            let monomial = m.text(names);
            let text = match function.strip_prefix("1/") {
                Some(below) if !monomial.is_empty() => format!("{monomial}/{below}"),
                _ => join(&function, &monomial, "*"),
            };
            (c, text)
        }))
    }
}

/// Result of a search for conserved quantities of second degree in the momenta.
#[derive(Clone, Debug)]
pub struct Quadratic {
    /// Ascending; of quantities of unit size the mean rate along the motion, relative to the rates of momenta.
    pub singular_values: Vec<f64>,
    /// Number of all conserved quantities that were found, including known ones, and the gap after them.
    pub separation: Separation,
    /// Quantities that are not combinations of the energy, the charges of the point symmetries and their products, in reduced echelon form;
    /// empty if there is no gap.
    pub conserved: Vec<Conserved>,
}

impl Quadratic {
    /// Finds conserved quantities `k^ij p_i p_j + h E + k^i p_i + k` whose factors are functions of a basis.
    ///
    /// Along the motion `dq/dt = v`, and `dp/dt` is `dL/dq` plus forces that are not in `L`, so that `dK/dt = 0` is linear in the unknown
    /// functions; it is imposed at the states `(q, v)`, `(states, n)`. The function `h` times the energy `E` reaches quantities whose part
    /// without momenta is the potential times a function, or whose tensor has a part along the inverse metric, whatever formulas these have;
    /// the Kepler problem and Kerr's metric need it. For a Lagrangian that is even in the velocities, only even quantities are sought, because
    /// the odd ones are the charges of point symmetries. The functions do not depend on coordinates that `L` does not depend on, except through
    /// the first harmonics of one such angle at a time.
    ///
    /// `fields` are the point symmetries, of the same basis; products of their charges are not new. For `tolerance` see
    /// [`Symmetries::find`](super::Symmetries::find).
    ///
    /// # Errors
    /// [`SymmetryError`].
    pub fn find(
        model: &dyn EulerLagrange<f64>,
        basis: &Basis,
        fields: &[Field],
        (q, v): (&[f64], &[f64]),
        tolerance: Option<f64>,
    ) -> Result<Self, SymmetryError> {
        let n = model.coordinates();
        check(tolerance)?;
        if basis.names().len() != n {
            return Err(SymmetryError::Basis { expected: n, found: basis.names().len() });
        }
        // 1, the energy, its square, charges, their products with the energy and with each other.
        let products = 3 + 2 * fields.len() + fields.len() * (fields.len() + 1) / 2;
        check_size(n, products, q.len() / n.max(1))?;
        let sample = Sample::new(model, q, v)?;
        let known = known(&sample, basis, fields);
        let cyclic = sample.cyclic();
        let mut all: Option<Quadratic> = None;
        for angle in std::iter::once(None).chain(basis.circles().filter(|i| cyclic[*i]).map(Some)) {
            let part = search(&sample, &basis.without(&cyclic, angle), &known, tolerance)?;
            all = Some(match all {
                None => part,
                Some(all) => all.with(part),
            });
        }
        Ok(all.unwrap_or_else(|| unreachable!("there is a search without an angle")))
    }
}

/// Number of unknown coefficients in the largest search of [`Quadratic::find`] over a basis of `functions` functions.
pub fn quadratic_unknowns(n: usize, functions: usize) -> usize {
    (n * (n + 1) / 2 + n + 2) * functions
}

impl Quadratic {
    /// The quantities of two searches.
    fn with(mut self, other: Self) -> Self {
        self.singular_values.extend(other.singular_values);
        self.singular_values.sort_by(f64::total_cmp);
        let gap = [self.separation.gap, other.separation.gap].into_iter().flatten().reduce(f64::min);
        let count = self.separation.count.zip(other.separation.count).map(|(a, b)| a + b);
        self.separation = Separation { count, gap };
        self.conserved.extend(other.conserved);
        self
    }
}

/// Orthonormal columns of all quantities known to be conserved: 1, the energy, the charges and their products.
fn known(sample: &Sample, basis: &Basis, fields: &[Field]) -> Vec<Vec<f64>> {
    let n = sample.n;
    let mut at = Values::default();
    let mut charges = vec![Vec::with_capacity(sample.len()); fields.len()];
    for (q, p) in sample.q.chunks_exact(n).zip(sample.p.chunks_exact(n)) {
        basis.evaluate(q, &mut at);
        fields.iter().zip(&mut charges).for_each(|(field, charge)| charge.push(field.charge(&at, p)));
    }
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<f64>>();
    let mut columns = vec![vec![1.0; sample.len()], sample.energy.clone()];
    columns.push(product(&sample.energy, &sample.energy));
    for (k, a) in charges.iter().enumerate() {
        columns.extend([a.clone(), product(a, &sample.energy)]);
        columns.extend(charges[k..].iter().map(|b| product(a, b)));
    }
    orthonormal(&columns, INDEPENDENT_COLUMN).columns
}

fn search(
    sample: &Sample,
    basis: &Basis,
    known: &[Vec<f64>],
    tolerance: Option<f64>,
) -> Result<Quadratic, SymmetryError> {
    let (n, states) = (sample.n, sample.len());
    let mut monomials: Vec<Monomial> = (0..n).flat_map(|i| (i..n).map(move |j| Monomial::Quadratic(i, j))).collect();
    monomials.push(Monomial::Energy);
    if !sample.even {
        monomials.extend((0..n).map(Monomial::Linear));
    }
    if !sample.homogeneous {
        monomials.push(Monomial::One);
    }
    check_size(n, monomials.len() * basis.len(), states)?;
    let functions = FunctionColumns::new(basis, sample)?;
    let (mut places, mut values, mut rates) = (Vec::new(), Vec::new(), Vec::new());
    for f in 0..basis.len() {
        for &monomial in &monomials {
            let (mut value, mut rate) = (Vec::with_capacity(states), Vec::with_capacity(states));
            for k in 0..states {
                let ([m, dm], x, dx) = (monomial.at(sample, k), functions.values[f][k], functions.rates[f][k]);
                value.push(x * m);
                rate.push((dx * m + x * dm) * sample.pace[k]);
            }
            // A constant is always conserved.
            if !(monomial == Monomial::One && basis.text(f).is_empty()) {
                places.push((f, monomial));
                values.push(value);
                rates.push(rate);
            }
        }
    }
    let plain = orthonormal(&values, INDEPENDENT_FUNCTION);
    if states < plain.columns.len() {
        return Err(SymmetryError::TooFew { unknowns: plain.columns.len(), states });
    }
    let found = singular(&plain.mixed(&rates)).ok_or(SymmetryError::NotFinite { what: "the rate of a quantity" })?;
    let separation = Separation::new(&found.values, tolerance);
    let zero = &found.vectors[..separation.count.unwrap_or(0)];
    // The part of every conserved quantity that is not a combination of known ones.
    let mix = |share: &[f64], columns: &[Vec<f64>]| {
        let mut total = vec![0.0; columns.first().map_or(0, Vec::len)];
        share.iter().zip(columns).for_each(|(x, column)| super::null_space::add(&mut total, column, *x));
        total
    };
    let rests: Vec<Vec<f64>> = zero
        .iter()
        .map(|vector| {
            let mut rest = mix(vector, &plain.columns);
            for _ in 0..2 {
                for column in known {
                    let along = dot(column, &rest);
                    super::null_space::add(&mut rest, column, -along);
                }
            }
            rest
        })
        .collect();
    let decomposed = singular(&rests).ok_or(SymmetryError::NotFinite { what: "a conserved quantity" })?;
    let noise = found.values[..zero.len()]
        .last()
        .map_or(0.0, |last| (ENTRY_NOISE * last).clamp(ENTRY_NOISES.0, ENTRY_NOISES.1));
    let old = decomposed.values.iter().take_while(|value| **value < NEW_PART.max(noise)).count();
    let mut rows: Vec<Vec<f64>> =
        decomposed.vectors.iter().map(|vector| plain.given(&mix(vector, zero), values.len())).collect();
    let sizes: Vec<f64> = values.iter().map(|value| norm(value)).collect();
    reduce(&mut rows, &sizes, noise, old);
    let last = zero.len().checked_sub(1).map_or(0.0, |last| found.values[last]).max(f64::EPSILON);
    let conserved = rows.split_off(old).into_iter().map(|mut row| {
        null_space::refine(&mut row, &|k| rates[k].clone(), &sizes, last);
        let terms = row.iter().zip(&places).filter(|(c, _)| **c != 0.0).map(|(c, (f, m))| (*c, *f, *m));
        Conserved { terms: terms.collect(), basis: basis.clone() }
    });
    Ok(Quadratic { singular_values: found.values, separation, conserved: conserved.collect() })
}
