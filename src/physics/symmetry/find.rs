//! Point symmetries of a Lagrangian: vector fields along which it changes by a total derivative at most.

use super::basis::{Basis, Values, most_states, unknowns};
use super::null_space::{Orthonormal, Separation, check, dot, norm, orthonormal, reduce};
use super::sample::{Invariant, Sample};
use super::thresholds::{
    ENTRY_NOISE, ENTRY_NOISES, INDEPENDENT_FUNCTION, LEAST_FIELD_SIZE, MOST_FIELDS, MOST_SIMPLIFIED, MOST_UNKNOWNS,
    SIMPLER_NOISE,
};
use super::{Algebra, Field, SymmetryError, null_space};
use crate::lagrangian::EulerLagrange;
use crate::linalg::{Workspace, eigh, singular};

/// Result of a search for symmetries.
#[derive(Clone, Debug)]
pub struct Symmetries {
    /// Functions that the fields are made of.
    pub basis: Basis,
    /// Ascending; of fields of unit size the mean change of `L` along them, relative to the size of its terms.
    pub singular_values: Vec<f64>,
    /// Number of symmetries and the gap after them.
    pub separation: Separation,
    /// The symmetries, in reduced echelon form; empty if there is no gap.
    pub fields: Vec<Field>,
    /// The Lie algebra that they form; `None` without symmetries, or for more than 200.
    pub algebra: Option<Algebra>,
    /// States that were examined, and those of them at which the mass matrix is singular to working precision. There `L` is degenerate: it
    /// determines no motion, and any function times a null direction may be a symmetry.
    pub states: usize,
    /// See `states`.
    pub singular_states: usize,
    /// The quantity that is conserved because `L` does not depend on the parameter of the motion.
    pub invariant: Invariant,
    /// For every field, whether its charge is conserved: whether forces that are not in `L`, such as friction, do no work along the field.
    pub conserved: Vec<bool>,
}

/// Values of functions, and their derivatives along the velocity, at all states: one column per function.
pub(crate) struct FunctionColumns {
    pub values: Vec<Vec<f64>>,
    pub rates: Vec<Vec<f64>>,
}

impl FunctionColumns {
    /// # Errors
    /// [`SymmetryError::NotFinite`] for functions that overflow.
    pub fn new(basis: &Basis, sample: &Sample) -> Result<Self, SymmetryError> {
        let (n, states) = (sample.n, sample.len());
        let mut columns =
            Self { values: vec![vec![0.0; states]; basis.len()], rates: vec![vec![0.0; states]; basis.len()] };
        let mut at = Values::default();
        for (k, (q, v)) in sample.q.chunks_exact(n).zip(sample.v.chunks_exact(n)).enumerate() {
            basis.evaluate(q, &mut at);
            for (f, (value, gradient)) in at.value.iter().zip(at.gradient.chunks_exact(n)).enumerate() {
                columns.values[f][k] = *value;
                columns.rates[f][k] = gradient.iter().zip(v).map(|(d, v)| d * v).sum();
            }
        }
        if !columns.values.iter().chain(&columns.rates).all(|column| norm(column).is_finite()) {
            return Err(SymmetryError::NotFinite { what: "a function of the coordinates" });
        }
        Ok(columns)
    }
}

impl Symmetries {
    /// Finds the point symmetries of a Lagrangian whose fields are made of a basis.
    ///
    /// A field `xi(q)` is a symmetry if `xi.dL/dq + (D xi v).dL/dv = dF/dt` for a gauge function `F(q)`: its flow changes `L` by a total
    /// derivative, and `p.xi - F` is conserved (Noether 1918). Of `L = g_ij v^i v^j / 2` these are the Killing fields. The equation is linear
    /// in the coefficients of `xi` and `F`; it is imposed at the states `(q, v)`, `(states, n)`, each relative to the size of the terms of `L`
    /// there, `F` is projected out, and `xi` is measured by its length `|xi|_M` in an orthonormal frame of the mass matrix, averaged over the
    /// states. The singular values then do not depend on how the fields are written, and the zero ones are the symmetries. If `L` does not
    /// depend on time, it also has the symmetry of time, which is not counted.
    ///
    /// `tolerance` is the noise of the terms, [`EXACT`](Self::EXACT) for a Lagrangian written down; without one, for a learned model, the largest
    /// gap decides (see [`Separation`]). States should be drawn from an open set, several times as many as there are unknown
    /// coefficients.
    ///
    /// # Errors
    /// [`SymmetryError`].
    pub fn find(
        model: &dyn EulerLagrange<f64>,
        basis: &Basis,
        (q, v): (&[f64], &[f64]),
        tolerance: Option<f64>,
    ) -> Result<Self, SymmetryError> {
        let n = model.coordinates();
        check(tolerance)?;
        if basis.names().len() != n {
            return Err(SymmetryError::Basis { expected: n, found: basis.names().len() });
        }
        check_size(n, unknowns(n, basis.len()), q.len() / n.max(1))?;
        search(&Sample::new(model, q, v)?, basis, tolerance)
    }
}

/// Refuses a search that would take too much memory or time.
///
/// # Errors
/// [`SymmetryError::TooMany`], [`SymmetryError::TooManyStates`].
pub(super) fn check_size(n: usize, unknowns: usize, states: usize) -> Result<(), SymmetryError> {
    if unknowns > MOST_UNKNOWNS {
        return Err(SymmetryError::TooMany { unknowns, most: MOST_UNKNOWNS });
    }
    match most_states(n, unknowns) {
        most if states > most => Err(SymmetryError::TooManyStates { states, unknowns, most }),
        _ => Ok(()),
    }
}

/// [`Symmetries::find`] of a Lagrangian whose terms are given.
pub(crate) fn search(sample: &Sample, basis: &Basis, tolerance: Option<f64>) -> Result<Symmetries, SymmetryError> {
    let (n, states, functions) = (sample.n, sample.len(), basis.len());
    let columns = FunctionColumns::new(basis, sample)?;
    let plain = orthonormal(&columns.values, INDEPENDENT_FUNCTION);
    let (values, rates) = (&plain.columns, plain.mixed(&columns.rates));
    if states < unknowns(n, values.len()) {
        return Err(SymmetryError::TooFew { unknowns: unknowns(n, values.len()), states });
    }
    let weight: Vec<f64> = sample.size.iter().map(|size| 1.0 / size).collect();
    let equation = |i: usize, f: usize| -> Vec<f64> {
        (0..states)
            .map(|k| weight[k] * (sample.g[k * n + i] * values[f][k] + sample.p[k * n + i] * rates[f][k]))
            .collect()
    };
    let mut equations: Vec<Vec<f64>> =
        (0..n).flat_map(|i| (0..values.len()).map(move |f| (i, f))).map(|(i, f)| equation(i, f)).collect();
    let gauge = gauge(sample, &rates, &weight);
    let free = equations.clone();
    equations.iter_mut().for_each(|column| gauge.remove(column));
    let unit = unit_fields(sample, values)?;
    let mixed = combined(&unit, &equations);
    let found = singular(&mixed).ok_or(SymmetryError::NotFinite { what: "the equation of a symmetry" })?;
    let separation = Separation::new(&found.values, tolerance);
    let zero = separation.count.unwrap_or(0);
    let null = combined(&found.vectors[..zero], &unit);
    let changes = combined(&null, &free);
    let mut rows: Vec<Vec<f64>> = null
        .iter()
        .zip(&changes)
        .map(|(field, change)| {
            let change = gauge.given(&gauge.along(change), rates.len());
            let parts = field.chunks_exact(values.len()).chain([change.as_slice()]);
            parts.flat_map(|part| plain.given(part, functions)).collect()
        })
        .collect();
    let sizes = sizes(sample, &columns.values);
    let last = found.values[..zero].last().copied();
    let noise = last.map_or(0.0, |last| (ENTRY_NOISE * last).clamp(ENTRY_NOISES.0, ENTRY_NOISES.1));
    let pivots = reduce(&mut rows, &sizes, noise, 0);
    if let Some(last) = last.filter(|_| pivots.len() == zero) {
        let unknowns = Unknowns { sample, columns: &columns, plain: &plain, gauge: &gauge, weight: &weight };
        match tolerance {
            Some(_) => unknowns.refine(&mut rows, &pivots, &sizes, last.max(f64::EPSILON)),
            // For a model the fields hold only nearly: choose fields of few functions among all that are equally good.
            None => unknowns.simplify(&mut rows, &pivots, &sizes, last),
        }
    }
    let fields: Vec<Field> = rows
        .into_iter()
        .map(|mut row| {
            let gauge = row.split_off(n * functions);
            let mut field = Field { coefficients: row, gauge };
            field.clean_gauge(sample, &columns.values, noise);
            field.normalise_sign();
            field
        })
        .collect();
    let algebra = match fields.len() {
        1..=MOST_FIELDS => Some(Algebra::new(sample, basis, &fields, noise)?),
        _ => None,
    };
    Ok(Symmetries {
        conserved: fields.iter().map(|field| field.is_workless(sample, basis)).collect(),
        basis: basis.clone(),
        singular_values: found.values,
        separation,
        fields,
        algebra,
        states,
        singular_states: sample.singular,
        invariant: sample.invariant(),
    })
}

/// The equation of a symmetry in the coefficients of the original functions.
struct Unknowns<'a> {
    sample: &'a Sample,
    columns: &'a FunctionColumns,
    plain: &'a Orthonormal,
    gauge: &'a Orthonormal,
    weight: &'a [f64],
}

impl Unknowns<'_> {
    /// Change of `L` along the field `function d_i` at all states, and its part that is not a gauge.
    fn change(&self, i: usize, f: usize) -> Vec<f64> {
        let n = self.sample.n;
        let rows = self.columns.values[f].iter().zip(&self.columns.rates[f]).zip(self.weight).enumerate();
        rows.map(|(k, ((x, dx), w))| w * (self.sample.g[k * n + i] * x + self.sample.p[k * n + i] * dx)).collect()
    }

    /// Removes the noise of nearly dependent functions from rows of coefficients.
    fn refine(&self, rows: &mut [Vec<f64>], pivots: &[usize], sizes: &[f64], noise: f64) {
        let (n, functions) = (self.sample.n, self.columns.values.len());
        let column = |place: usize| match (place / functions, place % functions) {
            (i, f) if i < n => self.change(i, f),
            (_, f) => self.columns.rates[f].iter().zip(self.weight).map(|(rate, w)| -rate * w).collect(),
        };
        // F is subtracted from p.xi.
        let sample = self.sample;
        let momentum: Vec<f64> = sample.pace.iter().zip(&sample.size).map(|(pace, size)| pace * size).collect();
        let momentum = norm(&momentum).max(f64::MIN_POSITIVE.sqrt());
        let sizes: Vec<f64> =
            sizes.iter().copied().chain(self.columns.values.iter().map(|value| norm(value) / momentum)).collect();
        for (row, pivot) in rows.iter_mut().zip(pivots) {
            null_space::refine(row, &column, &sizes, noise);
            let unit = row[*pivot];
            if unit != 0.0 {
                row.iter_mut().for_each(|x| *x /= unit);
            }
        }
    }

    /// Length of a field in the frame, over all states.
    fn size(&self, places: &[usize], coefficients: &[f64]) -> f64 {
        let (n, functions) = (self.sample.n, self.columns.values.len());
        let square = |k: usize| -> f64 {
            let mut xi = vec![0.0; n];
            for (at, c) in places.iter().zip(coefficients).filter(|(_, c)| **c != 0.0) {
                xi[at / functions] += c * self.columns.values[at % functions][k];
            }
            let frame = self.sample.frame[k * n * n..(k + 1) * n * n].chunks_exact(n);
            frame.zip(&xi).map(|(row, x)| x * dot(row, &xi)).sum()
        };
        (0..self.sample.len()).map(square).sum::<f64>().sqrt()
    }

    /// Replaces rows of coefficients by rows with few entries, as long as their equations hold equally well to `noise`.
    fn simplify(&self, rows: &mut [Vec<f64>], pivots: &[usize], sizes: &[f64], noise: f64) {
        let functions = self.columns.values.len();
        let places: Vec<usize> =
            (0..self.sample.n).flat_map(|i| self.plain.kept.iter().map(move |f| i * functions + f)).collect();
        let free: Vec<Vec<f64>> = places.iter().map(|at| self.change(at / functions, at % functions)).collect();
        let mut fixed = free.clone();
        fixed.iter_mut().for_each(|column| self.gauge.remove(column));
        let gram = null_space::gram(&fixed);
        let weights: Vec<f64> = places.iter().map(|at| sizes[*at]).collect();
        if rows.len() as f64 * (places.len() as f64).powi(3) > MOST_SIMPLIFIED {
            return;
        }
        for (row, pivot) in rows.iter_mut().zip(pivots) {
            let taken: Vec<bool> = places.iter().map(|at| pivots.contains(at) && at != pivot).collect();
            let Some(own) = places.iter().position(|at| at == pivot) else { continue };
            let start: Vec<f64> = places.iter().map(|at| row[*at]).collect();
            let Some(found) = null_space::sparsest(&gram, &start, &weights, own, &taken, noise) else { continue };
            // Large terms that cancel may leave a small field, which changes L by more than its size allows.
            let part = combined(std::slice::from_ref(&found), &fixed).remove(0);
            if norm(&part) > SIMPLER_NOISE * noise * self.size(&places, &found) {
                continue;
            }
            let change = combined(std::slice::from_ref(&found), &free).remove(0);
            let change = self.gauge.given(&self.gauge.along(&change), self.plain.kept.len());
            row.fill(0.0);
            places.iter().zip(found).for_each(|(at, x)| row[*at] = x);
            let split = self.sample.n * functions;
            row[split..].copy_from_slice(&self.plain.given(&change, functions));
        }
    }
}

/// Orthonormal columns of `dF/dt` for all functions `F`; the constant has none. If `L` is even in the velocity, so is its change, and
/// `dF/dt` cannot be part of it.
fn gauge(sample: &Sample, rates: &[Vec<f64>], weight: &[f64]) -> Orthonormal {
    if sample.even {
        return orthonormal(&[], INDEPENDENT_FUNCTION);
    }
    let weighed = |rate: &Vec<f64>| rate.iter().zip(weight).map(|(r, w)| r * w).collect();
    orthonormal(&rates.iter().map(weighed).collect::<Vec<Vec<f64>>>(), INDEPENDENT_FUNCTION)
}

/// Combinations of the fields `values[f] d_i` that are orthonormal in the frame, on average over the states, as rows `(fields, n *
/// functions)`.
fn unit_fields(sample: &Sample, values: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, SymmetryError> {
    let (n, functions) = (sample.n, values.len());
    let count = n * functions;
    let mut gram = vec![0.0; count * count];
    for i in 0..n {
        for j in i..n {
            let part: Vec<f64> = (0..sample.len()).map(|k| sample.frame[k * n * n + i * n + j]).collect();
            for a in 0..functions {
                let weighed: Vec<f64> = values[a].iter().zip(&part).map(|(x, m)| x * m).collect();
                for b in 0..functions {
                    let product = super::null_space::dot(&weighed, &values[b]);
                    gram[(i * functions + a) * count + j * functions + b] = product;
                    gram[(j * functions + b) * count + i * functions + a] = product;
                }
            }
        }
    }
    let (mut sizes, mut vectors) = (vec![0.0; count], vec![0.0; count * count]);
    eigh(count, &gram, &mut sizes, &mut vectors, &mut Workspace::new())
        .map_err(|_| SymmetryError::NotFinite { what: "the size of a field" })?;
    let largest = sizes.iter().fold(0.0, |m: f64, s| m.max(*s));
    let rows = sizes.iter().zip(vectors.chunks_exact(count));
    Ok(rows
        .filter(|(size, _)| **size > LEAST_FIELD_SIZE * largest)
        .map(|(size, row)| row.iter().map(|x| x / size.sqrt()).collect())
        .collect())
}

/// Combinations of columns, one for every row of coefficients.
fn combined(rows: &[Vec<f64>], columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
    use crate::linalg::{MatMut, MatRef, gemm};
    let (count, states) = (columns.len(), columns.first().map_or(0, Vec::len));
    let (left, right) = (rows.concat(), columns.concat());
    let mut product = vec![0.0; rows.len() * states];
    gemm(
        MatMut::new(&mut product, rows.len(), states),
        false,
        1.0,
        MatRef::new(&left, rows.len(), count),
        MatRef::new(&right, count, states),
    );
    product.chunks_exact(states.max(1)).map(<[f64]>::to_vec).collect()
}

/// Root mean squares of the fields `function d_i` in the frame.
fn sizes(sample: &Sample, values: &[Vec<f64>]) -> Vec<f64> {
    let (n, states) = (sample.n, sample.len() as f64);
    let field = |i: usize, value: &Vec<f64>| {
        let square = value.iter().enumerate().map(|(k, x)| x * x * sample.frame[k * n * n + i * (n + 1)]);
        (square.sum::<f64>() / states).sqrt()
    };
    let field = &field;
    (0..n).flat_map(|i| values.iter().map(move |value| field(i, value))).collect()
}
