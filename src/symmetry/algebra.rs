//! The Lie algebra of vector fields: structure constants and Killing form.

use super::basis::{Basis, Values};
use super::classify;
use super::killing::{killing_form, signature};
use super::sample::Sample;
use super::{Field, SymmetryError};
use crate::linalg::{Workspace, solve};
use serde::Serialize;

/// Structure of a Lie algebra of fields `X_1, .., X_m`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Algebra {
    /// `c[a][b][c]` of `[X_a, X_b] = sum_c c[a][b][c] X_c`.
    pub structure_constants: Vec<Vec<Vec<f64>>>,
    /// Root mean square of what of the commutators is no combination of the fields, relative to the fields: 0 for an algebra.
    pub closure: f64,
    /// Numbers of negative, positive and zero eigenvalues of the Killing form `K_ab = c_ac^d c_bd^c`; a compact algebra has
    /// negative ones.
    pub killing_form_signature: [usize; 3],
    /// Name, such as `so(3)+R`, if it is one that is known here.
    pub name: Option<String>,
}

impl Algebra {
    /// The algebra of fields whose coefficients have this relative noise.
    pub(crate) fn new(sample: &Sample, basis: &Basis, fields: &[Field], noise: f64) -> Result<Self, SymmetryError> {
        let (n, m) = (sample.n, fields.len());
        let pairs: Vec<(usize, usize)> = (0..m).flat_map(|a| (a + 1..m).map(move |b| (a, b))).collect();
        let (mut gram, mut sides) = (vec![0.0; m * m], vec![vec![0.0; m]; pairs.len()]);
        let (mut squares, mut at) = (vec![0.0; pairs.len()], Values::default());
        // Points far out, where fields grow, count no more than the others.
        for (k, q) in sample.q.chunks_exact(n).enumerate() {
            basis.evaluate(q, &mut at);
            let vectors: Vec<Vec<f64>> = fields.iter().map(|field| field.vector(&at, n)).collect();
            let slopes: Vec<Vec<f64>> = fields.iter().map(|field| field.derivative(&at, n)).collect();
            let frame = &sample.frame[k * n * n..(k + 1) * n * n];
            let product = |a: &[f64], b: &[f64]| -> f64 {
                frame
                    .chunks_exact(n)
                    .zip(a)
                    .map(|(row, a)| a * row.iter().zip(b).map(|(m, b)| m * b).sum::<f64>())
                    .sum()
            };
            let size: f64 = vectors.iter().map(|x| product(x, x)).sum::<f64>().max(f64::MIN_POSITIVE);
            for a in 0..m {
                for b in 0..m {
                    gram[a * m + b] += product(&vectors[a], &vectors[b]) / size;
                }
            }
            for (pair, &(a, b)) in pairs.iter().enumerate() {
                let along = |x: &[f64], slope: &[f64]| -> Vec<f64> {
                    slope.chunks_exact(n).map(|row| row.iter().zip(x).map(|(d, x)| d * x).sum()).collect()
                };
                let (there, back) = (along(&vectors[a], &slopes[b]), along(&vectors[b], &slopes[a]));
                let bracket: Vec<f64> = there.iter().zip(&back).map(|(x, y)| x - y).collect();
                (0..m).for_each(|c| sides[pair][c] += product(&vectors[c], &bracket) / size);
                squares[pair] += product(&bracket, &bracket) / size;
            }
        }
        let mut constants = vec![vec![vec![0.0; m]; m]; m];
        let (mut rest, mut workspace) = (0.0, Workspace::new());
        for ((&(a, b), side), square) in pairs.iter().zip(&sides).zip(&squares) {
            let mut x = vec![0.0; m];
            solve(m, &gram, side, &mut x, &mut workspace)
                .map_err(|_| SymmetryError::NotFinite { what: "a commutator of fields" })?;
            rest += (square - x.iter().zip(side).map(|(x, s)| x * s).sum::<f64>()).max(0.0);
            let largest = x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            for c in 0..m {
                let value = if x[c].abs() <= (10.0 * noise).max(1e-7) * largest.max(1.0) { 0.0 } else { x[c] };
                constants[a][b][c] = value;
                constants[b][a][c] = -value;
            }
        }
        let states = sample.len() as f64;
        // A difference of squares has only half of the digits.
        let rest = if rest > 1e-12 * squares.iter().sum::<f64>() { rest } else { 0.0 };
        let tolerance = (30.0 * noise).clamp(1e-6, 0.1);
        let signature = signature(&killing_form(&constants), tolerance)?;
        Ok(Self {
            closure: (rest / states).sqrt(),
            killing_form_signature: signature,
            name: classify::name(&constants, tolerance),
            structure_constants: constants,
        })
    }
}
