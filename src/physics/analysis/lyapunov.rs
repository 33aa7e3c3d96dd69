//! Finite-time Lyapunov exponent, so that divergence by chaos is not mistaken for an error of the model.

use crate::lagrangian::EulerLagrange;
use crate::rollout::{Integrable, Options, RolloutError, rollout};
use serde::{Deserialize, Serialize};

/// Logarithm of the factor by which neighbours part, below which a motion of at most 50 units of time is regular: its
/// Lyapunov time is then above a fifth of the time span. Those of regular motions part in proportion to time, by a factor of
/// some 50 in 50 s.
pub const REGULAR: f64 = 5.0;
/// Time beyond which that factor counts relative to what it is there.
const LONG: f64 = 50.0;

/// Rate at which neighbouring motions part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lyapunov {
    /// Finite-time largest exponent, per unit of time; near 0 or below for regular motion.
    pub exponent: f64,
    /// Time over which it was taken.
    pub time: f64,
}

impl Lyapunov {
    /// `1 / exponent`: infinite unless the exponent is positive.
    pub(crate) fn lyapunov_time(&self) -> f64 {
        if self.exponent > 0.0 { 1.0 / self.exponent } else { f64::INFINITY }
    }

    /// `true` if neighbouring motions part faster than those of regular motion do.
    pub(crate) fn is_chaotic(&self) -> bool {
        self.exponent * self.time >= REGULAR + (self.time / LONG).ln().max(0.0)
    }
}

/// Largest finite-time Lyapunov exponent of the motion from `(q, v)` by two nearby trajectories.
///
/// The neighbour starts at the relative distance `sqrt(eps)` and is pulled back to it after every `options.dt`
/// (Benettin et al. 1980); the exponent is the mean of the logarithms of the growth per time. Distances are Euclidean in
/// `(q, v)`. Regular motion gives about `ln(t) / t`, not 0.
///
/// # Errors
/// The error of the roll-out that fails first.
pub fn lyapunov<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
    options: &Options<S>,
) -> Result<Lyapunov, RolloutError> {
    let main = rollout(model, q, v, &Options { energy: false, ..options.clone() }).complete()?;
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
    for k in 0..main.len().saturating_sub(1) {
        let shifted: Vec<S> = flat(k).iter().zip(&offset).map(|(x, d)| S::of_f64(x + d)).collect();
        let (t, t_end) = (main.t[k], main.t[k + 1]);
        let leap = Options { t0: t, t_end, dt: t_end - t, energy: false, domain: None, ..options.clone() };
        // Both start afresh for each leap: errors of earlier leaps do not count as growth.
        let ends: Vec<Vec<f64>> = [flat(k).iter().map(|&x| S::of_f64(x)).collect::<Vec<S>>(), shifted]
            .into_iter()
            .map(|start| {
                let end = rollout(model, &start[..n], &start[n..], &leap).complete()?;
                let (q, v) = end.state(end.len() - 1);
                Ok(q.iter().chain(v).map(|x| x.to_f64()).collect())
            })
            .collect::<Result<_, RolloutError>>()?;
        offset = ends[1].iter().zip(&ends[0]).map(|(a, b)| a - b).collect();
        let grown = size(&offset);
        if grown > 0.0 {
            growth += (grown / distance).ln();
            offset.iter_mut().for_each(|x| *x *= distance / grown);
        } else {
            offset = vec![distance / (2.0 * n as f64).sqrt(); 2 * n];
        }
    }
    let time = (options.t_end - options.t0).abs().to_f64();
    Ok(Lyapunov { exponent: if time > 0.0 { growth / time } else { 0.0 }, time })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{MechanicsError, Request, Terms};
    use crate::rollout::models::OSCILLATOR;

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
        let options = Options::reference(10.0, 0.5);
        let hill = lyapunov(&Hill, &[0.0], &[0.0], &options).unwrap();
        assert!((hill.exponent - 1.0).abs() < 0.05, "{hill:?}");
        assert!((hill.lyapunov_time() - 1.0).abs() < 0.05);
        let calm = lyapunov(&OSCILLATOR, &[1.0], &[0.0], &Options::<f64>::reference(20.0, 0.5)).unwrap();
        assert!(calm.exponent.abs() < 1e-3, "{calm:?}");
        assert!(hill.is_chaotic() && !calm.is_chaotic());
        // In proportion to time, over a long one.
        let linear = |time: f64| Lyapunov { exponent: time.ln() / time, time };
        assert!([10.0, 100.0, 1e4].iter().all(|&time| !linear(time).is_chaotic()));
    }
}
