//! The textbook's double pendulum with six constants, fitted to measured motion through its roll-outs.
//!
//! Two rigid arms of any shape, angles from the downward vertical, over the moment of inertia that the first arm and the
//! second's mass have about the pivot:
//!
//! ```text
//! theta1'' + a cos(d) theta2'' = -a sin(d) theta2'^2 - g1 sin(theta1) - f1 theta1' + f2 (theta2' - theta1')
//! a cos(d) theta1'' + b theta2'' = a sin(d) theta1'^2 - g2 sin(theta2) - f2 (theta2' - theta1'),    d = theta1 - theta2
//! ```

use lnn::analysis::Window;
use lnn::data::RecordingSplit;
use lnn::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use nalgebra::{SMatrix, SVector};

/// `a`, `b`, `g1`, `g2` in s^-2, `f1`, `f2` in s^-1.
pub type Constants = SVector<f64, 6>;

/// Its motion.
#[derive(Clone, Copy, Debug)]
pub struct Textbook(pub Constants);

/// Seconds of motion predicted from every start of the fit.
const SPAN: f64 = 0.25;
/// Largest number of Gauss-Newton steps.
const STEPS: usize = 40;
/// Steps of the integrator between frames.
const FINE: usize = 1;

impl Textbook {
    fn acceleration(&self, [q1, q2, v1, v2]: [f64; 4]) -> [f64; 2] {
        let [a, b, g1, g2, f1, f2] = self.0.into();
        let (sine, cosine) = (q1 - q2).sin_cos();
        let joint = f2 * (v2 - v1);
        let r1 = -a * sine * v2 * v2 - g1 * q1.sin() - f1 * v1 + joint;
        let r2 = a * sine * v1 * v1 - g2 * q2.sin() - joint;
        let determinant = b - (a * cosine).powi(2);
        [(b * r1 - a * cosine * r2) / determinant, (r2 - a * cosine * r1) / determinant]
    }

    /// Angles at the times of a window, by Runge and Kutta's method of order 4.
    fn predict(&self, window: &Window) -> Vec<f64> {
        let slope = |x: [f64; 4]| {
            let [a1, a2] = self.acceleration(x);
            [x[2], x[3], a1, a2]
        };
        let add = |x: [f64; 4], h: f64, k: [f64; 4]| [0, 1, 2, 3].map(|i| x[i] + h * k[i]);
        let (mut x, mut now) = ([window.q[0], window.q[1], window.v[0], window.v[1]], 0.0);
        let mut angles = Vec::with_capacity(window.measured.len());
        for &time in &window.times {
            let h = (time - now) / FINE as f64;
            for _ in 0..FINE {
                let k1 = slope(x);
                let k2 = slope(add(x, h / 2.0, k1));
                let k3 = slope(add(x, h / 2.0, k2));
                let k4 = slope(add(x, h, k3));
                x = [0, 1, 2, 3].map(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
            }
            now = time;
            angles.extend([x[0], x[1]]);
        }
        angles
    }

    /// Fits the constants to the training part of a recording.
    ///
    /// The start is linear: the equations are linear in the constants, with smoothed states and accelerations in them.
    /// Then Gauss and Newton's method, damped as Levenberg and Marquardt do, on the predictions of the measured angles
    /// from smoothed states a quarter of a second apart, weighted so that the few chaotic stretches do not decide.
    pub fn fit(measured: &RecordingSplit) -> Self {
        let (mut best, windows) = (Self(linear(measured)), windows(measured));
        let mut residuals = best.residuals(&windows);
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let scale = median(&residuals);
            let weights: Vec<f64> = residuals.iter().map(|r| 1.0 / (1.0 + (r / (3.0 * scale)).powi(2))).collect();
            let cost =
                |residuals: &[f64]| residuals.iter().map(|r| (1.0 + (r / (3.0 * scale)).powi(2)).ln()).sum::<f64>();
            let mut columns = Vec::with_capacity(6);
            for i in 0..6 {
                let mut shifted = best;
                let h = 1e-6 * shifted.0[i].abs().max(1e-3);
                shifted.0[i] += h;
                let moved = shifted.residuals(&windows);
                columns.push(moved.iter().zip(&residuals).map(|(m, r)| (m - r) / h).collect::<Vec<f64>>());
            }
            let weighted =
                |x: &[f64], y: &[f64]| x.iter().zip(y).zip(&weights).map(|((x, y), w)| w * x * y).sum::<f64>();
            let normal = SMatrix::<f64, 6, 6>::from_fn(|i, j| weighted(&columns[i], &columns[j]));
            let gradient = Constants::from_fn(|i, _| weighted(&columns[i], &residuals));
            let before = cost(&residuals);
            let mut gain = 0.0;
            while damping < 1e9 {
                let mut matrix = normal;
                (0..6).for_each(|i| matrix[(i, i)] *= 1.0 + damping);
                let step = matrix.lu().solve(&gradient).unwrap_or_else(Constants::zeros);
                let candidate = Self(best.0 - step);
                let moved = candidate.residuals(&windows);
                let after = cost(&moved);
                if after < before {
                    (gain, best, residuals, damping) = (before - after, candidate, moved, damping * 0.1);
                    break;
                }
                damping *= 10.0;
            }
            if gain <= 1e-9 * before {
                break;
            }
        }
        best
    }

    fn residuals(&self, windows: &[Window]) -> Vec<f64> {
        let of = |window: &Window| {
            let pairs = self.predict(window).into_iter().zip(window.measured.clone());
            // A motion that is lost is as wrong as can be.
            pairs.map(|(x, y)| if x.is_finite() { x - y } else { 1e3 }).collect::<Vec<_>>()
        };
        windows.iter().flat_map(of).collect()
    }
}

/// Stretches of the training part, each [`SPAN`] long.
fn windows(measured: &RecordingSplit) -> Vec<Window> {
    let estimated = measured.training.estimated();
    let pairs = estimated.iter().zip(&measured.training.states);
    pairs.flat_map(|(e, s)| Window::cut(*e, s.interior(), 2, SPAN)).collect()
}

fn median(residuals: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied().unwrap_or(1.0).max(1e-12)
}

/// Least squares of both equations, the first written for its acceleration.
fn linear(measured: &RecordingSplit) -> Constants {
    let (mut normal, mut right) = (SMatrix::<f64, 6, 6>::identity() * 1e-9, Constants::zeros());
    for (estimated, states) in measured.training.estimated().iter().zip(&measured.training.states) {
        for k in states.interior() {
            let [q1, q2, v1, v2] =
                [estimated.q[2 * k], estimated.q[2 * k + 1], estimated.v[2 * k], estimated.v[2 * k + 1]];
            let [a1, a2] = [states.a[2 * k], states.a[2 * k + 1]];
            let (sine, cosine) = (q1 - q2).sin_cos();
            let first = [-cosine * a2 - sine * v2 * v2, 0.0, -q1.sin(), 0.0, -v1, v2 - v1];
            let second = [cosine * a1 - sine * v1 * v1, a2, 0.0, q2.sin(), 0.0, v2 - v1];
            for (row, target) in [(first, a1), (second, 0.0)] {
                let row = Constants::from(row);
                normal += row * row.transpose();
                right += row * target;
            }
        }
    }
    normal.lu().solve(&right).unwrap_or_else(Constants::zeros)
}

/// Only so that the same integrator moves it: it has an acceleration and nothing else.
impl EulerLagrange<f64> for Textbook {
    fn coordinates(&self) -> usize {
        2
    }

    fn terms(&self, q: &[f64], v: &[f64], _: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        terms.clear();
        for (q, v) in q.chunks_exact(2).zip(v.chunks_exact(2)) {
            terms.acceleration.extend(self.acceleration([q[0], q[1], v[0], v[1]]));
        }
        Ok(())
    }
}
