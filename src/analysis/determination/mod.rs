//! Ranges in which motion determines what was learned from it: mass matrix, friction and energy.
//!
//! Two Lagrangians may move alike on all that was recorded and differ in `M`: where a momentum is conserved, `L` may be
//! changed by any function of it. What the data leave open is therefore read off the curvature of the likelihood around the
//! learned model, in all directions that a Lagrangian has. The equations of motion are linear in `L` and in the dissipation
//! `D`: a change `dL + dD` changes the acceleration of a state by
//!
//! ```text
//! da = -M^-1 (d/dt d(dL)/dv - d(dL)/dq + d(dD)/dv),
//! ```
//!
//! so that changes `sum_k x_k phi_k` with normal `x_k` of standard deviation 1 before the data (the changes are scaled to
//! the model's own size) have a normal distribution after them, `C = (1 + A^T W A)^-1`, `x = C A^T W e`, with `A` the
//! changes of the accelerations and `e` what they miss of the data. `W` has the inverse mean square of `e`, and as many
//! samples as are independent: neighbours have a common error. Every quantity that is linear in `L` and `D` follows, its
//! standard deviation being that of the distribution and the distance of its middle from the learned one together.
//!
//! Without known forces `L` has no unit: quantities are then over the mean `M` of the first coordinate.
//!
//! Source of the method: MacKay, Neural Computation 4 (1992) 448 (Laplace approximation around trained weights), here for
//! functions that are linear in the equations instead of weights.

mod changes;
mod functions;
mod observed;

pub use observed::{Observed, places};

use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{MatMut, MatRef, Workspace, gemm, inverse, solve};
use changes::{Changes, Row, Usual};
use serde::{Deserialize, Serialize};

/// A learned number and where the data allow it to be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The model's value.
    pub value: f64,
    /// Standard deviation of what the data allow.
    pub deviation: f64,
}

/// Standard deviations on either side that a range has: it holds the truth in 19 cases of 20.
pub const RANGE: f64 = 2.0;

impl Estimate {
    /// Lower and upper end of the range.
    pub fn range(&self) -> [f64; 2] {
        [self.value - RANGE * self.deviation, self.value + RANGE * self.deviation]
    }
    /// `true` if a number lies in the range.
    pub fn allows(&self, x: f64) -> bool {
        (x - self.value).abs() <= RANGE * self.deviation
    }
}

/// Ranges in which the data leave a model's inner quantities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Determination {
    /// `true` if known forces fix the unit of `L`; if not, everything is over the mean of `M` of the first coordinate.
    pub absolute: bool,
    /// Mean over the states of the upper triangle of `M`, row after row.
    pub mass_matrix: Vec<Estimate>,
    /// Friction coefficient of every coordinate, `sum of v_i dD/dv_i` over `sum of v_i^2`; empty for a model without.
    pub friction: Vec<Estimate>,
    /// Root mean square of the energy about its mean over the states, and of its error.
    pub energy: Estimate,
}

/// States whose changes are multiplied at once.
const CHUNK: usize = 128;

/// Ranges in which `observed` leaves `model`, for the states `at`, `(q, v)`, over which means are taken.
///
/// `None` where there is nothing to say: too many coordinates, too few states, or a model that is not finite on them.
pub fn determination(
    model: &dyn EulerLagrange<f64>,
    periodic: &[bool],
    observed: &Observed,
    at: (&[f64], &[f64]),
) -> Option<Determination> {
    let n = model.coordinates();
    let data = Data::new(model, observed)?;
    let usual = data.usual(n)?;
    let changes = Changes::new(periodic, &ranges(n, &data.q), &usual, !model.conserves_energy())?;
    let posterior = data.posterior(n, &changes, observed)?;
    let wanted = Wanted::new(model, &changes, at)?;
    let absolute = !observed.force.is_empty();
    let unit = if absolute { None } else { wanted.mass.first().cloned() };
    let estimate = |linear: &Linear| posterior.estimate(&linear.over(unit.as_ref()));
    let energy = posterior.energy(&wanted, unit.as_ref());
    let result = Determination {
        absolute,
        mass_matrix: wanted.mass.iter().map(estimate).collect(),
        friction: wanted.friction.iter().map(estimate).collect(),
        energy,
    };
    let all = result.mass_matrix.iter().chain(&result.friction).chain([&result.energy]);
    let finite = all.into_iter().all(|e| e.value.is_finite() && e.deviation.is_finite());
    finite.then_some(result)
}

/// A number of the model and its change by every change.
#[derive(Clone, Debug)]
struct Linear {
    value: f64,
    slopes: Vec<f64>,
}

impl Linear {
    fn zero(changes: usize) -> Self {
        Self { value: 0.0, slopes: vec![0.0; changes] }
    }
    fn add(&mut self, value: f64, slopes: &[f64], factor: f64) {
        self.value += factor * value;
        self.slopes.iter_mut().zip(slopes).for_each(|(sum, s)| *sum += factor * s);
    }
    /// The number over another one, to first order.
    fn over(&self, unit: Option<&Self>) -> Self {
        let Some(unit) = unit else { return self.clone() };
        let value = self.value / unit.value;
        let slopes = self.slopes.iter().zip(&unit.slopes).map(|(s, u)| (s - value * u) / unit.value).collect();
        Self { value, slopes }
    }
}

/// States on which the model is finite, with its own accelerations and what they miss.
struct Data {
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    missed: Vec<f64>,
    inverse: Vec<f64>,
    mass: Vec<f64>,
}

impl Data {
    fn new(model: &dyn EulerLagrange<f64>, observed: &Observed) -> Option<Self> {
        let n = model.coordinates();
        let mut data = Self { q: vec![], v: vec![], a: vec![], missed: vec![], inverse: vec![], mass: vec![] };
        let mut terms = Terms::default();
        let mut workspace = Workspace::new();
        for (k, (q, v)) in observed.q.chunks_exact(n).zip(observed.v.chunks_exact(n)).enumerate() {
            if model.terms(q, v, Request::ACCELERATION, &mut terms).is_err() {
                continue;
            }
            let mut inverted = vec![0.0; n * n];
            if inverse(n, &terms.mass_matrix, &mut inverted, &mut workspace).is_err() {
                continue;
            }
            let mut a = terms.acceleration.clone();
            if let Some(force) = observed.force.get(k * n..(k + 1) * n) {
                for (a, row) in a.iter_mut().zip(inverted.chunks_exact(n)) {
                    *a += row.iter().zip(force).map(|(m, f)| m * f).sum::<f64>();
                }
            }
            let missed: Vec<f64> = observed.a[k * n..(k + 1) * n].iter().zip(&a).map(|(a, b)| a - b).collect();
            if missed.iter().chain(&inverted).all(|x| x.is_finite()) {
                data.q.extend_from_slice(q);
                data.v.extend_from_slice(v);
                data.a.extend(a);
                data.missed.extend(missed);
                data.inverse.extend(inverted);
                data.mass.extend_from_slice(&terms.mass_matrix);
            }
        }
        (data.q.len() > n).then_some(data)
    }

    fn usual(&self, n: usize) -> Option<Usual> {
        let states = (self.q.len() / n) as f64;
        let rms =
            |values: &[f64], i: usize| (values.iter().skip(i).step_by(n).map(|x| x * x).sum::<f64>() / states).sqrt();
        let all = |values: &[f64]| (0..n).map(|i| rms(values, i)).collect::<Vec<_>>();
        let mass =
            (0..n).map(|i| self.mass.iter().skip(i * n + i).step_by(n * n).map(|m| m.abs()).sum::<f64>() / states);
        let usual = Usual { mass: mass.collect(), velocity: all(&self.v), acceleration: all(&self.a) };
        let positive = |values: &[f64]| values.iter().all(|x| x.is_finite() && *x > 0.0);
        (positive(&usual.mass) && positive(&usual.velocity)).then_some(usual)
    }

    fn posterior(&self, n: usize, changes: &Changes, observed: &Observed) -> Option<Posterior> {
        let (count, states) = (changes.len(), self.q.len() / n);
        let weights: Vec<f64> = (0..n)
            .map(|i| {
                let square = self.missed.iter().skip(i).step_by(n).map(|e| e * e).sum::<f64>() / states as f64;
                let size = self.a.iter().skip(i).step_by(n).map(|a| a * a).sum::<f64>() / states as f64;
                // Nothing is known better than numbers have digits.
                let square = square.max(1e-20 * size).max(f64::MIN_POSITIVE.sqrt());
                (observed.independent.get(i).copied().unwrap_or(1.0) / (square * states as f64)).sqrt()
            })
            .collect();
        let mut precision = vec![0.0; count * count];
        (0..count).for_each(|k| precision[k * count + k] = 1.0);
        let mut pull = vec![0.0; count];
        let (mut row, mut rows, mut missed) = (Row::default(), Vec::new(), Vec::new());
        for state in 0..states {
            let at = state * n..(state + 1) * n;
            changes.evaluate(&self.q[at.clone()], &self.v[at.clone()], &self.a[at.clone()], &mut row);
            let inverse = &self.inverse[state * n * n..(state + 1) * n * n];
            for i in 0..n {
                let start = rows.len();
                rows.resize(start + count, 0.0);
                for j in 0..n {
                    let factor = -weights[i] * inverse[i * n + j];
                    let equation = &row.equation[j * count..(j + 1) * count];
                    rows[start..].iter_mut().zip(equation).for_each(|(sum, x)| *sum += factor * x);
                }
                missed.push(weights[i] * self.missed[state * n + i]);
            }
            if missed.len() >= CHUNK || state + 1 == states {
                let a = MatRef::new(&rows, missed.len(), count);
                gemm(MatMut::new(&mut precision, count, count), true, 1.0, a.t(), a);
                let e = MatRef::new(&missed, missed.len(), 1);
                gemm(MatMut::new(&mut pull, count, 1), true, 1.0, a.t(), e);
                rows.clear();
                missed.clear();
            }
        }
        let mut covariance = vec![0.0; count * count];
        let mut workspace = Workspace::new();
        inverse(count, &precision, &mut covariance, &mut workspace).ok()?;
        let mut mean = vec![0.0; count];
        solve(count, &precision, &pull, &mut mean, &mut workspace).ok()?;
        Some(Posterior { covariance, mean })
    }
}

/// Distribution of the sizes of the changes after the data.
struct Posterior {
    covariance: Vec<f64>,
    mean: Vec<f64>,
}

impl Posterior {
    /// Mean square of a linear function of the sizes.
    fn square(&self, slopes: &[f64]) -> f64 {
        let count = slopes.len();
        let shift: f64 = slopes.iter().zip(&self.mean).map(|(s, m)| s * m).sum();
        let rows = self.covariance.chunks_exact(count).zip(slopes);
        let variance: f64 = rows.map(|(row, s)| s * row.iter().zip(slopes).map(|(c, s)| c * s).sum::<f64>()).sum();
        variance.max(0.0) + shift * shift
    }

    fn estimate(&self, linear: &Linear) -> Estimate {
        Estimate { value: linear.value, deviation: self.square(&linear.slopes).sqrt() }
    }

    /// Energy about its mean.
    fn energy(&self, wanted: &Wanted, unit: Option<&Linear>) -> Estimate {
        let mean = wanted.mean_energy();
        let (mut value, mut square) = (0.0, 0.0);
        for energy in &wanted.energy {
            let mut about = energy.clone();
            about.add(mean.value, &mean.slopes, -1.0);
            let about = about.over(unit);
            value += about.value * about.value;
            square += self.square(&about.slopes);
        }
        let states = wanted.energy.len() as f64;
        Estimate { value: (value / states).sqrt(), deviation: (square / states).sqrt() }
    }
}

/// States at which the energy is looked at, at most.
const ENERGIES: usize = 256;

/// Numbers of the model that are asked for.
struct Wanted {
    mass: Vec<Linear>,
    friction: Vec<Linear>,
    energy: Vec<Linear>,
}

impl Wanted {
    fn new(model: &dyn EulerLagrange<f64>, changes: &Changes, (q, v): (&[f64], &[f64])) -> Option<Self> {
        let (n, count) = (model.coordinates(), changes.len());
        let request = Request::MASS_MATRIX | Request::ENERGY | Request::FORCE;
        let mut terms = Terms::default();
        let mut row = Row::default();
        let mut wanted = Self {
            mass: vec![Linear::zero(count); n * (n + 1) / 2],
            friction: vec![Linear::zero(count); if model.conserves_energy() { 0 } else { n }],
            energy: Vec::new(),
        };
        let states = q.len() / n;
        let stride = states.div_ceil(ENERGIES).max(1);
        let mut squares = vec![0.0; n];
        let none = vec![0.0; n];
        let mut used = 0.0;
        for (k, (q, v)) in q.chunks_exact(n).zip(v.chunks_exact(n)).enumerate() {
            if model.terms(q, v, request, &mut terms).is_err() || terms.mass_matrix.iter().any(|m| !m.is_finite()) {
                continue;
            }
            used += 1.0;
            changes.evaluate(q, v, &none, &mut row);
            let pairs = (0..n).flat_map(|i| (i..n).map(move |j| i * n + j));
            for (sum, at) in wanted.mass.iter_mut().zip(pairs) {
                sum.add(terms.mass_matrix[at], &row.mass[at * count..(at + 1) * count], 1.0);
            }
            for (i, sum) in wanted.friction.iter_mut().enumerate() {
                let force = terms.force.get(i).map_or(0.0, |force| -force);
                sum.add(force, &row.friction[i * count..(i + 1) * count], v[i]);
            }
            squares.iter_mut().zip(v).for_each(|(sum, v)| *sum += v * v);
            if k % stride == 0 {
                wanted.energy.push(Linear { value: terms.energy[0], slopes: row.energy.clone() });
            }
        }
        let scale = |linear: &mut Linear, by: f64| {
            linear.value *= by;
            linear.slopes.iter_mut().for_each(|s| *s *= by);
        };
        wanted.mass.iter_mut().for_each(|mass| scale(mass, 1.0 / used));
        wanted.friction.iter_mut().zip(&squares).for_each(|(friction, square)| scale(friction, 1.0 / square));
        (used > 0.0 && !wanted.energy.is_empty()).then_some(wanted)
    }

    fn mean_energy(&self) -> Linear {
        let mut mean = Linear::zero(self.energy[0].slopes.len());
        self.energy.iter().for_each(|e| mean.add(e.value, &e.slopes, 1.0 / self.energy.len() as f64));
        mean
    }
}

/// Least and largest value of every coordinate.
fn ranges(n: usize, q: &[f64]) -> Vec<[f64; 2]> {
    let range = |i: usize| {
        let values = q.iter().skip(i).step_by(n);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &x| [low.min(x), high.max(x)])
    };
    (0..n).map(range).collect()
}
