//! The Lie algebra of vector fields: structure constants and Killing form.

use super::basis::{Basis, Values};
use super::classify;
use super::killing::{killing_form, signature};
use super::orthonormal::dot;
use super::sample::Sample;
use super::{Field, SymmetryError};
use crate::linalg::{Workspace, inverse};
use serde::Serialize;

/// Structure of a Lie algebra of fields `X_1, .., X_m`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Algebra {
    /// `c[a][b][c]` of `[X_a, X_b] = sum_c c[a][b][c] X_c`, the nearest such combination where there is none.
    pub structure_constants: Vec<Vec<Vec<f64>>>,
    /// Root mean square of what of the commutators of fields of unit length is no combination of the fields, times the length over which the
    /// coordinates spread: 0 for an algebra.
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
/// States at which commutators are looked at, at the least.
const STATES: usize = 400;

impl Algebra {
    /// The algebra of fields whose coefficients have this relative noise.
    pub(crate) fn new(sample: &Sample, basis: &Basis, fields: &[Field], noise: f64) -> Result<Self, SymmetryError> {
        let (n, m) = (sample.n, fields.len());
        let at_states = vectors(sample, basis, fields);
        let states = at_states.len();
        // Fields of unit length: which ones are how long depends on units.
        let mean = |a: usize| at_states.iter().map(|at| dot(&at.vectors[a], &at.lowered[a])).sum::<f64>();
        let lengths: Vec<f64> =
            (0..m).map(|a| (mean(a) / states as f64).sqrt().max(f64::MIN_POSITIVE.sqrt())).collect();
        let pairs: Vec<(usize, usize)> = (0..m).flat_map(|a| (a + 1..m).map(move |b| (a, b))).collect();
        let (mut gram, mut sides) = (vec![0.0; m * m], vec![vec![0.0; m]; pairs.len()]);
        let mut squares = vec![0.0; pairs.len()];
        for at in &at_states {
            let unit: Vec<Vec<f64>> =
                at.lowered.iter().zip(&lengths).map(|(x, length)| x.iter().map(|x| x / length).collect()).collect();
            let along = |c: usize, x: &[f64]| dot(&unit[c], x);
            // Points far out, where fields grow, count no more than the others.
            let size: f64 = (0..m).map(|a| along(a, &at.vectors[a]) / lengths[a]).sum::<f64>().max(f64::MIN_POSITIVE);
            for a in 0..m {
                for b in 0..m {
                    gram[a * m + b] += along(a, &at.vectors[b]) / (lengths[b] * size);
                }
            }
            for (pair, &(a, b)) in pairs.iter().enumerate() {
                let slope =
                    |x: &[f64], slopes: &[f64]| -> Vec<f64> { slopes.chunks_exact(n).map(|row| dot(row, x)).collect() };
                let (there, back) = (slope(&at.vectors[a], &at.slopes[b]), slope(&at.vectors[b], &at.slopes[a]));
                let scale = 1.0 / (lengths[a] * lengths[b]);
                let bracket: Vec<f64> = there.iter().zip(&back).map(|(x, y)| scale * (x - y)).collect();
                (0..m).for_each(|c| sides[pair][c] += along(c, &bracket) / size);
                squares[pair] += dot(&bracket, &lowered(at.frame, &bracket)) / size;
            }
        }
        let mut inverted = vec![0.0; m * m];
        inverse(m, &gram, &mut inverted, &mut Workspace::new())
            .map_err(|_| SymmetryError::NotFinite { what: "a commutator of fields" })?;
        let mut constants = vec![vec![vec![0.0; m]; m]; m];
        let mut rest = 0.0;
        for ((&(a, b), side), square) in pairs.iter().zip(&sides).zip(&squares) {
            let x: Vec<f64> = inverted.chunks_exact(m).map(|row| dot(row, side)).collect();
            rest += (square - dot(&x, side)).max(0.0);
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
        let closure = sample.length * (rest / states as f64).sqrt();
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

/// Fields at a state.
struct At<'a> {
    /// `|M|`, `(n, n)`.
    frame: &'a [f64],
    /// The fields, `(n)` each.
    vectors: Vec<Vec<f64>>,
    /// `|M|` times the fields.
    lowered: Vec<Vec<f64>>,
    /// Their derivatives, `(n, n)` each.
    slopes: Vec<Vec<f64>>,
}

/// Fields at states that are spread over the sample: a few times as many equations as fields are enough.
fn vectors<'a>(sample: &'a Sample, basis: &Basis, fields: &[Field]) -> Vec<At<'a>> {
    let n = sample.n;
    let step = (sample.len() / STATES.max(4 * fields.len())).max(1);
    let mut at = Values::default();
    let states = sample.q.chunks_exact(n).zip(sample.frame.chunks_exact(n * n)).step_by(step);
    states
        .map(|(q, frame)| {
            basis.evaluate(q, &mut at);
            let vectors: Vec<Vec<f64>> = fields.iter().map(|field| field.vector(&at, n)).collect();
            let slopes = fields.iter().map(|field| field.derivative(&at, n)).collect();
            At { frame, lowered: vectors.iter().map(|x| lowered(frame, x)).collect(), vectors, slopes }
        })
        .collect()
}

/// A matrix `(n, n)` times a vector.
fn lowered(frame: &[f64], vector: &[f64]) -> Vec<f64> {
    frame.chunks_exact(vector.len()).map(|row| dot(row, vector)).collect()
}
