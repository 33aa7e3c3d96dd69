//! The Lie algebra of vector fields: structure constants and Killing form.

use super::basis::{Basis, Values};
use super::orthonormal::{add, dot};
use super::sample::Sample;
use super::{Field, SymmetryError, classify};
use crate::linalg::{MatMut, MatRef, Workspace, eigenvalues, gemm, inverse};
use serde::Serialize;

/// Structure of a Lie algebra of fields `X_1, .., X_m`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Algebra {
    /// `c[a][b][c]` of `[X_a, X_b] = sum_c c[a][b][c] X_c`, the nearest such combination where there is none.
    pub structure_constants: Vec<Vec<Vec<f64>>>,
    /// Root mean square of what of the commutators of fields of unit length is no combination of the fields, every coordinate in units
    /// of its spread over the states: 0 for an algebra.
    pub closure: f64,
    /// `true` if the commutators are combinations of the fields up to the noise of the fields; if not, the fields are no
    /// algebra, and neither constants nor signature mean anything.
    pub closes: bool,
    /// Numbers of negative, positive and zero eigenvalues of the Killing form `K_ab = c_ac^d c_bd^c`; a compact algebra has
    /// negative ones.
    pub killing_form_signature: [usize; 3],
    /// Name, such as `so(3)+R`, if it is one that is known here. Fields that do not close have none; nor have those of a
    /// degenerate Lagrangian, which are as many as its functions allow.
    pub name: Option<String>,
}

/// Fields whose algebra is looked at, at most: beyond, their commutators take minutes.
pub(crate) const MOST_FIELDS: usize = 200;
/// States at which commutators are looked at, at most, and products of numbers that are worth it: seconds.
const STATES: (usize, usize) = (400, 10_000_000_000);

impl Algebra {
    /// The algebra of fields whose coefficients have this relative noise.
    pub(crate) fn new(sample: &Sample, basis: &Basis, fields: &[Field], noise: f64) -> Result<Self, SymmetryError> {
        let (n, m) = (sample.n, fields.len());
        let pairs: Vec<(usize, usize)> = (0..m).flat_map(|a| (a + 1..m).map(move |b| (a, b))).collect();
        // Each state has n equations for m unknown coefficients of every commutator.
        let (few, worth) = (4 * m / n + 1, STATES.1 / (pairs.len() * n * m).max(1));
        let at_states = vectors(sample, basis, fields, few.max(worth.min(STATES.0)));
        let states = at_states.len();
        let mean = |a: usize| at_states.iter().map(|at| dot(&at.vectors[a], &at.vectors[a])).sum::<f64>();
        let lengths: Vec<f64> =
            (0..m).map(|a| (mean(a) / states as f64).sqrt().max(f64::MIN_POSITIVE.sqrt())).collect();
        let (mut gram, mut sides) = (vec![0.0; m * m], vec![0.0; pairs.len() * m]);
        let (mut squares, mut brackets) = (vec![0.0; pairs.len()], Vec::with_capacity(pairs.len() * n));
        for at in &at_states {
            // Points far out, where fields grow, count no more than the others.
            let unit = at.vectors.iter().zip(&lengths).flat_map(|(x, length)| x.iter().map(move |x| x / length));
            let unit: Vec<f64> = unit.collect();
            let size = dot(&unit, &unit).max(f64::MIN_POSITIVE);
            brackets.clear();
            for (&(a, b), square) in pairs.iter().zip(&mut squares) {
                let scale = 1.0 / (lengths[a] * lengths[b]);
                let rows = at.slopes[b].chunks_exact(n).zip(at.slopes[a].chunks_exact(n));
                let (x, y) = (&at.vectors[a], &at.vectors[b]);
                brackets.extend(rows.map(|(there, back)| scale * (dot(there, x) - dot(back, y))));
                let bracket = &brackets[brackets.len() - n..];
                *square += dot(bracket, bracket) / size;
            }
            let fields = MatRef::new(&unit, m, n);
            gemm(MatMut::new(&mut gram, m, m), true, 1.0 / size, fields, fields.t());
            let brackets = MatRef::new(&brackets, pairs.len(), n);
            gemm(MatMut::new(&mut sides, pairs.len(), m), true, 1.0 / size, brackets, fields.t());
        }
        let mut inverted = vec![0.0; m * m];
        inverse(m, &gram, &mut inverted, &mut Workspace::new())
            .map_err(|_| SymmetryError::NotFinite { what: "a commutator of fields" })?;
        let mut constants = vec![vec![vec![0.0; m]; m]; m];
        let mut rest = 0.0;
        for ((&(a, b), side), square) in pairs.iter().zip(sides.chunks_exact(m)).zip(&squares) {
            let by = |matrix: &[f64], x: &[f64]| matrix.chunks_exact(m).map(|row| dot(row, x)).collect::<Vec<f64>>();
            let mut x = by(&inverted, side);
            // Once more: fields may nearly depend on each other.
            let left: Vec<f64> = side.iter().zip(by(&gram, &x)).map(|(side, found)| side - found).collect();
            add(&mut x, &by(&inverted, &left), 1.0);
            rest += (square - 2.0 * dot(&x, side) + dot(&x, &by(&gram, &x))).max(0.0);
            let scale = |c: usize| lengths[a] * lengths[b] / lengths[c];
            let x: Vec<f64> = x.iter().enumerate().map(|(c, x)| x * scale(c)).collect();
            let largest = x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            for c in 0..m {
                let value = if x[c].abs() <= (10.0 * noise).max(1e-7) * largest.max(1.0) { 0.0 } else { x[c] };
                constants[a][b][c] = value;
                constants[b][a][c] = -value;
            }
        }
        // A difference of squares has only half of the digits.
        let rest = if rest > 1e-12 * squares.iter().sum::<f64>() { rest } else { 0.0 };
        let closure = (rest / states as f64).sqrt();
        let tolerance = (30.0 * noise).clamp(1e-6, 0.1);
        let closes = closure <= tolerance;
        Ok(Self {
            closure,
            closes,
            killing_form_signature: signature(&killing_form(&constants), tolerance)?,
            name: if closes && sample.singular == 0 { classify::name(&constants, tolerance) } else { None },
            structure_constants: constants,
        })
    }
}

/// Fields at a state, every coordinate in units of its spread.
struct At {
    /// The fields, `(n)` each.
    vectors: Vec<Vec<f64>>,
    /// Their derivatives, `(n, n)` each.
    slopes: Vec<Vec<f64>>,
}

/// Fields at about so many states that are spread over the sample.
fn vectors(sample: &Sample, basis: &Basis, fields: &[Field], states: usize) -> Vec<At> {
    let (n, spread) = (sample.n, sample.spread());
    let step = (sample.len() / states).max(1);
    let mut at = Values::default();
    let vector = |field: &Field, at: &Values| -> Vec<f64> {
        field.vector(at, n).iter().zip(&spread).map(|(x, unit)| x / unit).collect()
    };
    let slopes = |field: &Field, at: &Values| -> Vec<f64> {
        field.derivative(at, n).iter().enumerate().map(|(e, x)| x * spread[e % n] / spread[e / n]).collect()
    };
    let states = sample.q.chunks_exact(n).step_by(step);
    states
        .map(|q| {
            basis.evaluate(q, &mut at);
            At {
                vectors: fields.iter().map(|field| vector(field, &at)).collect(),
                slopes: fields.iter().map(|field| slopes(field, &at)).collect(),
            }
        })
        .collect()
}

/// `K_ab = sum of c[a][c][d] c[b][d][c]`, rows of a symmetric matrix.
pub(crate) fn killing_form(c: &[Vec<Vec<f64>>]) -> Vec<f64> {
    let m = c.len();
    let entry = |a: usize, b: usize| (0..m).map(|i| (0..m).map(|j| c[a][i][j] * c[b][j][i]).sum::<f64>()).sum();
    (0..m).flat_map(|a| (0..m).map(move |b| (a, b))).map(|(a, b)| entry(a, b)).collect()
}

/// Numbers of negative, positive and zero eigenvalues of a symmetric matrix.
pub(crate) fn signature(matrix: &[f64], tolerance: f64) -> Result<[usize; 3], SymmetryError> {
    let m = matrix.len().isqrt();
    let mut values = vec![0.0; m];
    eigenvalues(m, matrix, &mut values, &mut Workspace::new())
        .map_err(|_| SymmetryError::NotFinite { what: "the Killing form" })?;
    let largest = values.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let floor = tolerance * largest.max(tolerance);
    let count = |test: &dyn Fn(f64) -> bool| values.iter().filter(|x| test(**x)).count();
    Ok([count(&|x| x < -floor), count(&|x| x > floor), count(&|x| x.abs() <= floor)])
}
