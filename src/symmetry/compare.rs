//! Common ground of two Lagrangians of the same coordinates: the motion, and more than that.

use super::basis::{Basis, Values};
use super::orthonormal::{add, dot, norm, orthonormal};
use super::sample::Sample;
use super::{SymmetryError, field};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{Workspace, eigh};
use serde::Serialize;

/// Differences of two Lagrangians `A` and `B`, after the best `A = f(B) + dF/dt + constant` has been taken out. Every
/// distance is relative, 0 for equal ones.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Coefficients of `f`, from the first power of `B`: a factor, or for geodesics of a metric a polynomial.
    pub factors: Vec<f64>,
    /// Coefficients of the gauge function `F`, one for every function of the basis.
    pub gauge: Vec<f64>,
    /// `F` as a formula.
    pub gauge_formula: String,
    /// The constant, in the unit of `A`.
    pub constant: f64,
    /// Rest of the momenta and of the values of `A` beside `f(B) + dF/dt + constant`, root mean square over that of `A`.
    pub lagrangian: f64,
    /// Difference of the accelerations, root mean square in the frame of `|M|` of `B` over that of the larger ones.
    pub motion: f64,
    /// Rest of the mass matrix of `A` beside that of `f(B)`, root mean square over that of `A`, in the same frame.
    pub mass_matrix: f64,
    /// Rest of the energy of `A` beside the best polynomial of that of `B`, of first degree unless `f` has a higher one, root
    /// mean square over that of the energy of `A` about its mean.
    pub energy: f64,
}

/// Highest power of `B` in `f`, for geodesics.
const POWERS: usize = 3;
/// Part of a column that must be left beside the others.
const DEPENDENT: f64 = 1e-9;

/// Compares two Lagrangians at states `(q, v)`, `(states, n)`: what they have in common beyond the freedom that `L` has.
///
/// The motion determines `L` at best up to a factor and a total derivative, `L -> s L + dF(q)/dt`, up to a constant besides; that of
/// geodesics, along which `L` is the energy, up to a function `f(L)`. The best `s` (or `f`, a polynomial of degree 3) and `F`,
/// over the functions of a basis, follow by linear least squares from the momenta and the values of both. They are taken
/// out, and what is left is stated by quantity. Where `L` is the same on all states, as on a mass shell, `f` is a factor.
///
/// # Errors
/// [`SymmetryError`].
pub fn compare(
    a: &dyn EulerLagrange<f64>,
    b: &dyn EulerLagrange<f64>,
    basis: &Basis,
    (q, v): (&[f64], &[f64]),
) -> Result<Comparison, SymmetryError> {
    if a.coordinates() != b.coordinates() || basis.names().len() != b.coordinates() {
        let found = if a.coordinates() == b.coordinates() { basis.names().len() } else { a.coordinates() };
        return Err(SymmetryError::Basis { expected: b.coordinates(), found });
    }
    // States at which both are finite.
    let of_a = Sample::new(a, q, v)?;
    let of_b = Sample::new(b, &of_a.q, &of_a.v)?;
    let of_a = Sample::new(a, &of_b.q, &of_b.v)?;
    let fit = Fit::new(&of_a, &of_b, basis)?;
    let (mass_matrix, motion) = fit.mechanics(a, b, &of_b)?;
    let energy = fit.energy(&of_a, &of_b);
    Ok(Comparison {
        gauge_formula: field::sum(fit.gauge.iter().enumerate().map(|(f, c)| (*c, basis.text(f)))),
        factors: fit.factors,
        gauge: fit.gauge,
        constant: fit.constant,
        lagrangian: fit.rest,
        motion,
        mass_matrix,
        energy,
    })
}

/// The best `f` and `F`.
struct Fit {
    factors: Vec<f64>,
    gauge: Vec<f64>,
    constant: f64,
    rest: f64,
}

/// Values `L = p.v - E`.
fn lagrangians(sample: &Sample) -> Vec<f64> {
    let pairs = sample.p.chunks_exact(sample.n).zip(sample.v.chunks_exact(sample.n));
    pairs.zip(&sample.energy).map(|((p, v), e)| dot(p, v) - e).collect()
}

impl Fit {
    fn new(a: &Sample, b: &Sample, basis: &Basis) -> Result<Self, SymmetryError> {
        let (n, states, functions) = (b.n, b.len(), basis.len());
        let (values, own) = (lagrangians(a), lagrangians(b));
        let powers = if a.homogeneous && b.homogeneous { POWERS } else { 1 };
        // Per state n momenta in the frame of B, then the value; both of size 1.
        let rows = n + 1;
        let frames = Frames::new(b)?;
        let scale: Vec<f64> =
            (0..states).map(|k| 1.0 / norm(&frames.down(k, &b.p[k * n..(k + 1) * n])).max(1e-300)).collect();
        let spread = |x: &[f64]| {
            let mean = x.iter().sum::<f64>() / states as f64;
            (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / states as f64).sqrt()
        };
        let motion = b.p.iter().zip(&b.v).map(|(p, v)| (p * v).abs()).sum::<f64>() / states as f64;
        let unit = 1.0 / spread(&own).max(motion).max(1e-300);
        let column = |momentum: &dyn Fn(usize) -> Vec<f64>, value: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..states)
                .flat_map(|k| {
                    let mut part: Vec<f64> = frames.down(k, &momentum(k)).iter().map(|x| x * scale[k]).collect();
                    part.push(value(k) * unit);
                    part
                })
                .collect()
        };
        let p = |sample: &Sample, k: usize, factor: f64| -> Vec<f64> {
            sample.p[k * n..(k + 1) * n].iter().map(|p| p * factor).collect()
        };
        let mut columns = Vec::new();
        for power in 1..=powers {
            let slope = |k: usize| power as f64 * (own[k] * unit).powi(power as i32 - 1);
            let value = |k: usize| (own[k] * unit).powi(power as i32) / unit;
            columns.push(column(&|k| p(b, k, slope(k)), &value));
        }
        let mut at = vec![Values::default(); states];
        at.iter_mut().zip(b.q.chunks_exact(n)).for_each(|(at, q)| basis.evaluate(q, at));
        for f in 0..functions {
            let gradient = |k: usize| at[k].gradient[f * n..(f + 1) * n].to_vec();
            columns.push(column(&gradient, &|k| dot(&gradient(k), &b.v[k * n..(k + 1) * n])));
        }
        columns.push(column(&|_| vec![0.0; n], &|_| 1.0));
        if states * rows < columns.len() {
            return Err(SymmetryError::TooFew { unknowns: columns.len(), states });
        }
        let target = column(&|k| p(a, k, 1.0), &|k| values[k]);
        // Of geodesics the higher powers come last: on a mass shell they say nothing that the first does not.
        let higher = columns.drain(1..powers).collect::<Vec<_>>();
        columns.extend(higher);
        let plain = orthonormal(&columns, DEPENDENT);
        let mut solution = plain.given(&plain.along(&target), columns.len());
        let mut rest = target.clone();
        plain.remove(&mut rest);
        // The constant of the value is no part of what there is to explain.
        let mut size = target;
        let constant = orthonormal(&columns[functions + 1..functions + 2], DEPENDENT);
        constant.remove(&mut size);
        let whole = norm(&size);
        // Roundings are no terms.
        for (k, (c, column)) in solution.iter_mut().zip(&columns).enumerate() {
            if k > 0 && k != functions + 1 && (*c * norm(column)).abs() <= 1e-9 * whole {
                *c = 0.0;
            }
        }
        let higher = solution.split_off(functions + 2);
        let gauge = solution[1..=functions].to_vec();
        let factors = std::iter::once(solution[0]).chain(higher).enumerate();
        let factors: Vec<f64> = factors.map(|(k, c)| c * unit.powi(k as i32)).collect();
        let kept = 1 + factors.iter().skip(1).rposition(|c| *c != 0.0).map_or(0, |last| last + 1);
        Ok(Self {
            factors: factors[..kept].to_vec(),
            gauge,
            constant: solution[functions + 1],
            rest: if whole > 0.0 { norm(&rest) / whole } else { 0.0 },
        })
    }

    /// `f'` and `f''` at a value of `B`.
    fn slopes(&self, value: f64) -> [f64; 2] {
        let powers = self.factors.iter().enumerate().map(|(k, c)| (k as i32 + 1, *c));
        powers.fold([0.0, 0.0], |[first, second], (k, c)| {
            let k_ = f64::from(k);
            let curve = if k > 1 { c * k_ * (k_ - 1.0) * value.powi(k - 2) } else { 0.0 };
            [first + c * k_ * value.powi(k - 1), second + curve]
        })
    }

    /// Distances of mass matrices and of accelerations.
    fn mechanics(
        &self,
        a: &dyn EulerLagrange<f64>,
        b: &dyn EulerLagrange<f64>,
        sample: &Sample,
    ) -> Result<(f64, f64), SymmetryError> {
        let (n, frames) = (sample.n, Frames::new(sample)?);
        let own = lagrangians(sample);
        let [mut first, mut second] = [Terms::default(), Terms::default()];
        for (model, terms) in [(a, &mut first), (b, &mut second)] {
            // A state whose mass matrix is singular has no acceleration to compare.
            let _ = model.terms(&sample.q, &sample.v, Request::ACCELERATION, terms);
        }
        let (mut left, mut whole, mut apart, mut size) = (0.0, 0.0, 0.0, 0.0);
        for k in 0..sample.len() {
            let (matrix, one) = (k * n * n..(k + 1) * n * n, k * n..(k + 1) * n);
            let [slope, curve] = self.slopes(own[k]);
            let p = &sample.p[one.clone()];
            let (m, mut rest) = (&first.mass_matrix[matrix.clone()], vec![0.0; n * n]);
            for (e, rest) in rest.iter_mut().enumerate() {
                *rest = m[e] - slope * second.mass_matrix[matrix.start + e] - curve * p[e / n] * p[e % n];
            }
            left += frames.square(k, &rest);
            whole += frames.square(k, m);
            let [x, y] = [&first, &second].map(|terms| &terms.acceleration[one.clone()]);
            let difference: Vec<f64> = x.iter().zip(y).map(|(x, y)| x - y).collect();
            let [d, x, y] = [&difference[..], x, y].map(|a| norm(&frames.up(k, a)));
            if d.is_finite() {
                apart += d * d;
                size += x.max(y).powi(2);
            }
        }
        let ratio = |part: f64, whole: f64| if part == 0.0 { 0.0 } else { (part / whole).sqrt() };
        Ok((ratio(left, whole), ratio(apart, size)))
    }

    /// Distance of the energies.
    fn energy(&self, a: &Sample, b: &Sample) -> f64 {
        let largest = b.energy.iter().fold(f64::MIN_POSITIVE, |m: f64, e| m.max(e.abs()));
        let power = |k: usize| b.energy.iter().map(|e| (e / largest).powi(k as i32)).collect::<Vec<f64>>();
        let known = orthonormal(&(0..=self.factors.len()).map(power).collect::<Vec<_>>(), DEPENDENT);
        let mut rest = a.energy.clone();
        known.remove(&mut rest);
        let mut about = a.energy.clone();
        orthonormal(&[vec![1.0; a.len()]], DEPENDENT).remove(&mut about);
        // On a mass shell the energy is the same everywhere, and there is nothing to compare but roundings.
        if norm(&about) <= 1e-9 * norm(&a.energy) { 0.0 } else { norm(&rest) / norm(&about) }
    }
}

/// Roots of `|M|` at every state.
struct Frames {
    n: usize,
    values: Vec<f64>,
    vectors: Vec<f64>,
}

impl Frames {
    fn new(sample: &Sample) -> Result<Self, SymmetryError> {
        let (n, states) = (sample.n, sample.len());
        let (mut values, mut vectors) = (vec![0.0; states * n], vec![0.0; states * n * n]);
        eigh(n, &sample.frame, &mut values, &mut vectors, &mut Workspace::new())
            .map_err(|_| SymmetryError::NotFinite { what: "the mass matrix" })?;
        values.iter_mut().for_each(|w| *w = w.max(f64::MIN_POSITIVE).sqrt());
        Ok(Self { n, values, vectors })
    }

    fn at(&self, k: usize) -> impl Iterator<Item = (f64, &[f64])> {
        let n = self.n;
        let values = self.values[k * n..(k + 1) * n].iter().copied();
        values.zip(self.vectors[k * n * n..(k + 1) * n * n].chunks_exact(n))
    }

    /// A velocity or an acceleration in the frame.
    fn up(&self, k: usize, x: &[f64]) -> Vec<f64> {
        self.at(k).map(|(w, u)| w * dot(u, x)).collect()
    }

    /// A momentum in the frame.
    fn down(&self, k: usize, x: &[f64]) -> Vec<f64> {
        self.at(k).map(|(w, u)| dot(u, x) / w).collect()
    }

    /// Square of a symmetric matrix in the frame.
    fn square(&self, k: usize, matrix: &[f64]) -> f64 {
        let columns = self.at(k).map(|(w, u)| {
            let mut image = vec![0.0; self.n];
            matrix.chunks_exact(self.n).zip(u).for_each(|(row, u)| add(&mut image, row, u / w));
            self.down(k, &image)
        });
        columns.map(|column| dot(&column, &column)).sum()
    }
}
