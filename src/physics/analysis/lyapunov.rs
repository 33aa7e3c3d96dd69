//! Finite-time Lyapunov exponent, so that divergence by chaos is not mistaken for an error of the model.

use super::thresholds::{REGULAR, REGULAR_TIME, WIDEST_SEPARATION};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{Workspace, dot, eigh, inertia, inverse};
use crate::rollout::{Domain, Integrable, RolloutError, RolloutOptions, rollout};
use serde::{Deserialize, Serialize};

/// Rate at which neighbouring motions separate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lyapunov {
    /// Largest finite-time exponent, per unit of time; near 0 or below for regular motion.
    pub exponent: f64,
    /// Time span over which it was estimated.
    pub time: f64,
}

impl Lyapunov {
    /// `1 / exponent`: infinite unless the exponent is positive.
    pub(crate) fn lyapunov_time(&self) -> f64 {
        if self.exponent > 0.0 { 1.0 / self.exponent } else { f64::INFINITY }
    }

    /// `true` if neighbouring motions separate faster than for regular motion.
    pub fn is_chaotic(&self) -> bool {
        self.exponent * self.time >= REGULAR + (self.time / REGULAR_TIME).ln().max(0.0)
    }

    /// Largest finite-time Lyapunov exponent of the motion from `(q, v)` by two nearby trajectories.
    ///
    /// The neighbour starts at the relative distance `sqrt(eps)` and is pulled back to it after every `options.dt` (Benettin et al. 1980); the
    /// exponent is the mean of the logarithms of the growth per time. The separation is measured geometrically, independently of the chart: for
    /// a neighbour at `dq` its square is `|dq|^2 + |Dv|^2` in the mass matrix, with `Dv = dv + G(v, dq)` the covariant change of the velocity,
    /// so that a great circle is as regular in angles as in any other coordinates. A mass matrix that is not positive definite is replaced by
    /// the lengths for an observer of velocity `v`, or else by the magnitudes of its eigenvalues. Regular motion gives about `ln(t) / t`, not
    /// 0.
    ///
    /// # Errors
    /// The error of the roll-out that fails first.
    pub fn of<S: Integrable>(
        model: &dyn EulerLagrange<S>,
        q: &[S],
        v: &[S],
        options: &RolloutOptions<S>,
    ) -> Result<Self, RolloutError> {
        let main = rollout(model, q, v, &options.clone().energy(false)).complete()?;
        let n = main.coordinates;
        let size = |state: &[f64]| state.iter().map(|x| x * x).sum::<f64>().sqrt();
        let flat = |k: usize| -> Vec<f64> {
            let (q, v) = main.state(k);
            q.iter().chain(v).map(|x| x.to_f64()).collect()
        };
        let distance = S::epsilon().to_f64().sqrt() * size(&flat(0)).max(1.0);
        // A fixed direction without symmetry.
        let mut offset: Vec<f64> = (0..2 * n).map(|i| 1.0 / (1.0 + i as f64).sqrt()).collect();
        let norm = size(&offset);
        offset.iter_mut().for_each(|x| *x *= distance / norm);

        let mut growth = 0.0;
        // Separations keep this size, unless their coordinates would become too large where lengths change fast with the chart.
        let unit = Separation::new(model, &flat(0)).size(&offset);
        let mut before = unit;
        for k in 0..main.len().saturating_sub(1) {
            let shifted: Vec<S> = flat(k).iter().zip(&offset).map(|(x, d)| S::of_f64(x + d)).collect();
            let (t, t_end) = (main.t[k], main.t[k + 1]);
            let leap = options.clone().t0(t).t_end(t_end).dt(t_end - t).energy(false).domain(None::<Domain<S>>);
            // Both restart at each sample, so that earlier errors do not count as growth.
            let ends: Vec<Vec<f64>> = [flat(k).iter().map(|&x| S::of_f64(x)).collect::<Vec<S>>(), shifted]
                .into_iter()
                .map(|start| {
                    let end = rollout(model, &start[..n], &start[n..], &leap).complete()?;
                    let (q, v) = end.state(end.len() - 1);
                    Ok(q.iter().chain(v).map(|x| x.to_f64()).collect())
                })
                .collect::<Result<_, RolloutError>>()?;
            let separation = Separation::new(model, &ends[0]);
            offset = ends[1].iter().zip(&ends[0]).map(|(a, b)| a - b).collect();
            let now = separation.size(&offset);
            if now > 0.0 && now.is_finite() && before > 0.0 {
                growth += (now / before).ln();
                let shrink = (now / unit).max(size(&offset) / (WIDEST_SEPARATION * distance));
                offset.iter_mut().for_each(|x| *x /= shrink);
                before = now / shrink;
            } else {
                offset = vec![distance / (2.0 * n as f64).sqrt(); 2 * n];
                before = separation.size(&offset);
            }
        }
        let time = (options.t_end - options.t0).abs().to_f64();
        Ok(Lyapunov { exponent: if time > 0.0 { growth / time } else { 0.0 }, time })
    }
}

/// Measures separations of neighbours of one state.
struct Separation {
    n: usize,
    /// A positive definite matrix of squares of lengths.
    metric: Vec<f64>,
    /// `G^k_ij v^i`, rows `k`, columns `j`.
    transport: Vec<f64>,
}

impl Separation {
    /// At a state of coordinates and velocities, `(2 n)`. Where the terms of the model are not finite, lengths are those of the
    /// coordinates.
    fn new<S: Integrable>(model: &dyn EulerLagrange<S>, state: &[f64]) -> Self {
        let (n, v) = (state.len() / 2, &state[state.len() / 2..]);
        let unit: Vec<f64> = (0..n * n).map(|at| f64::from(u8::from(at % (n + 1) == 0))).collect();
        let masses = nearby_masses(model, state);
        let (mass, slopes) = masses.split_at(n * n);
        let mut inverted = vec![0.0; n * n];
        let known = masses.iter().all(|m| m.is_finite());
        if !known || inverse(n, mass, &mut inverted, &mut Workspace::new()).is_err() {
            return Self { n, metric: unit, transport: vec![0.0; n * n] };
        }
        // Lowered: (v^i d_i M_kj + d_j M_ki v^i - d_k M_ij v^i) / 2.
        let slope = |along: usize, i: usize, j: usize| slopes[(along * n + i) * n + j];
        let with = |term: &dyn Fn(usize) -> f64| (0..n).map(|i| v[i] * term(i)).sum::<f64>();
        let lowered: Vec<f64> = (0..n * n)
            .map(|at| (at / n, at % n))
            .map(|(k, j)| 0.5 * with(&|i| slope(i, k, j) + slope(j, k, i) - slope(k, i, j)))
            .collect();
        let transport = (0..n * n).map(|at| (0..n).map(|l| inverted[at / n * n + l] * lowered[l * n + at % n]).sum());
        Self { n, metric: lengths(n, mass, v).unwrap_or(unit), transport: transport.collect() }
    }

    /// Length of an offset of coordinates and velocities, `(2 n)`.
    fn size(&self, offset: &[f64]) -> f64 {
        let (dq, dv) = offset.split_at(self.n);
        let rows = self.transport.chunks_exact(self.n.max(1));
        let covariant: Vec<f64> = dv.iter().zip(rows).map(|(dv, row)| dv + dot(row, dq)).collect();
        let square =
            |x: &[f64]| self.metric.chunks_exact(self.n.max(1)).zip(x).map(|(row, x_i)| x_i * dot(row, x)).sum::<f64>();
        (square(dq) + square(&covariant)).sqrt()
    }
}

/// The mass matrix at a state, and its derivatives by every coordinate by central differences, each `(n, n)`; `NaN` where there is none.
fn nearby_masses<S: Integrable>(model: &dyn EulerLagrange<S>, state: &[f64]) -> Vec<f64> {
    let n = state.len() / 2;
    let (q, v) = state.split_at(n);
    let step = S::epsilon().to_f64().cbrt();
    let (mut places, mut steps) = (q.to_vec(), Vec::with_capacity(n));
    for i in 0..n {
        let h = step * q[i].abs().max(1.0);
        steps.push(h);
        for side in [h, -h] {
            let at = places.len();
            places.extend_from_slice(q);
            places[at + i] += side;
        }
    }
    let of = |x: &[f64]| x.iter().map(|&x| S::of_f64(x)).collect::<Vec<S>>();
    let mut terms = Terms::default();
    // Failures are not finite.
    let _ = model.terms(&of(&places), &of(&v.repeat(2 * n + 1)), Request::MASS_MATRIX, &mut terms);
    let mut all: Vec<f64> = terms.mass_matrix.iter().map(|m| m.to_f64()).collect();
    all.resize((2 * n + 1) * n * n, f64::NAN);
    let slopes: Vec<f64> = all[n * n..]
        .chunks_exact(2 * n * n)
        .zip(steps)
        .flat_map(|(pair, h)| (0..n * n).map(move |at| (pair[at] - pair[n * n + at]) / (2.0 * h)))
        .collect();
    all.truncate(n * n);
    all.extend(slopes);
    all
}

/// A positive definite matrix of lengths: the mass matrix; if only the direction of `v` has another sign, the lengths for an observer of
/// velocity `v`, `+-(M - 2 p p^T/(p.v))` with `p = M v`; otherwise the magnitudes of its eigenvalues.
fn lengths(n: usize, mass: &[f64], v: &[f64]) -> Option<Vec<f64>> {
    let p: Vec<f64> = mass.chunks_exact(n).map(|row| dot(row, v)).collect();
    let square = dot(&p, v);
    let turned = |sign: f64, part: f64| -> Vec<f64> {
        (0..n * n).map(|at| sign * (mass[at] - part * p[at / n] * p[at % n])).collect()
    };
    let mut scratch = vec![0.0; n * n];
    let candidates = [turned(1.0, 0.0), turned(1.0, 2.0 / square), turned(-1.0, 2.0 / square), turned(-1.0, 0.0)];
    let positive = candidates.into_iter().find(|m| inertia(n, m, &mut scratch).is_ok_and(|signs| signs.positive == n));
    positive.or_else(|| {
        let (mut values, mut vectors) = (vec![0.0; n], vec![0.0; n * n]);
        eigh(n, mass, &mut values, &mut vectors, &mut Workspace::new()).ok()?;
        let entry =
            |at: usize| values.iter().zip(vectors.chunks_exact(n)).map(|(w, u)| w.abs() * u[at / n] * u[at % n]).sum();
        Some((0..n * n).map(entry).collect())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{MechanicsError, SystemInstance};
    use crate::models::OSCILLATOR;
    use crate::random::RngStream;
    use rand::Rng;

    /// `q'' = q`: nearby motions part as `e^t`.
    struct Hill;

    impl EulerLagrange<f64> for Hill {
        fn coordinates(&self) -> usize {
            1
        }
        fn terms(&self, q: &[f64], _: &[f64], _: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
            terms.acceleration = q.to_vec();
            terms.energy = vec![0.0; q.len()];
            Ok(())
        }
    }

    #[test]
    fn exponents_of_linear_motions() {
        let options = RolloutOptions::reference(10.0, 0.5);
        let hill = Lyapunov::of(&Hill, &[0.0], &[0.0], &options).unwrap();
        assert!((hill.exponent - 1.0).abs() < 0.05, "{hill:?}");
        assert!((hill.lyapunov_time() - 1.0).abs() < 0.05);
        let calm = Lyapunov::of(&OSCILLATOR, &[1.0], &[0.0], &RolloutOptions::<f64>::reference(20.0, 0.5)).unwrap();
        assert!(calm.exponent.abs() < 1e-3, "{calm:?}");
        assert!(hill.is_chaotic() && !calm.is_chaotic());
        // In proportion to time, over a long span.
        let linear = |time: f64| Lyapunov { exponent: time.ln() / time, time };
        assert!([10.0, 100.0, 1e4].iter().all(|&time| !linear(time).is_chaotic()));
    }
    /// Great circles of all inclinations, including those near the poles of the chart, and geodesics of the plane in polar coordinates.
    #[test]
    fn a_great_circle_is_regular_in_any_chart() {
        let sphere = SystemInstance::<f64>::named("sphere-geodesic", &[]).unwrap().build().unwrap();
        let mut rng = RngStream::Test.generator(8);
        for k in 0..6 {
            let turn = [0.005, 0.02, 1.0][k % 3];
            let (polar, rate) = (rng.random_range(0.6..2.5), rng.random_range(0.5..1.5));
            let state = ([polar, 0.3], [rate, turn * rng.random_range(0.5..1.0)]);
            let found = Lyapunov::of(&*sphere, &state.0, &state.1, &RolloutOptions::reference(60.0, 0.5)).unwrap();
            assert!(!found.is_chaotic() && found.exponent < 0.09, "{state:?} {found:?}");
        }
    }

    /// The exponent of a chaotic motion does not depend on the coordinates; neighbours in the plane separate as before.
    #[test]
    fn a_thrown_double_pendulum_is_chaotic() {
        let pendulum = SystemInstance::<f64>::named("double-pendulum", &[]).unwrap().build().unwrap();
        let found = Lyapunov::of(&*pendulum, &[2.0, 2.5], &[0.0, 0.0], &RolloutOptions::reference(40.0, 0.25)).unwrap();
        assert!(found.is_chaotic(), "{found:?}");
    }
}
