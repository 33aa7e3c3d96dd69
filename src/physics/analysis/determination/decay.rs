//! Decay of the motion of one coordinate: the part of its acceleration that changes its sign with the velocity.
//!
//! Every motion of one coordinate has a Lagrangian, damped motion too, so a model cannot separate friction from the forces of `L`. A mechanical
//! Lagrangian, `M(q) v^2/2 - V(q)`, is symmetric under time reversal: `a = f(q) + h(q) v^2`, plus a known force over `M`. Friction adds `-r v`.

use super::changes::{Functions, Values};
use super::observed::Observed;
use super::posterior::{Sums, groups, jackknife};
use super::ranges;
use crate::analysis::thresholds::{
    DECAY_DEGREE, DECAY_TRUST, FRICTION_SIGNIFICANCE, LEAST_DECAY, LEAST_GROUP_STATES, MOST_DECAY_RESIDUAL,
};
use serde::{Deserialize, Serialize};

/// Decay of the motion of one coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decay {
    /// `r` in 1/s: friction over mass.
    pub rate: f64,
    /// Its standard error.
    pub error: f64,
    /// Root mean square of the acceleration that `f + h v^2 - r v` leaves, beyond its expected error and over its size.
    pub left: f64,
    /// `r v` over the acceleration, root mean squares.
    pub share: f64,
}

impl Decay {
    /// `true` if the motion is damped by more than chance and by enough to matter, and agrees with this model.
    pub fn is_certain(&self) -> bool {
        self.rate > FRICTION_SIGNIFICANCE * self.error && self.share > LEAST_DECAY && self.left < MOST_DECAY_RESIDUAL
    }
}

/// Decay of the motion of a single coordinate; `None` for several coordinates or too few states.
pub fn decay(periodic: &[bool], observed: &Observed) -> Option<Decay> {
    let [angle] = *periodic else { return None };
    let functions = Functions::new(&[angle], &ranges(1, &observed.q), DECAY_DEGREE);
    let states = observed.q.len();
    let groups = groups(states, LEAST_GROUP_STATES)?;
    let rms = |values: &[f64]| (values.iter().map(|x| x * x).sum::<f64>() / values.len().max(1) as f64).sqrt();
    let (speed, size, force) = (rms(&observed.v), rms(&observed.a), rms(&observed.force));
    if !(speed > 0.0 && size > 0.0) {
        return None;
    }
    let mut values = Values::default();
    let parts: Vec<Sums> = groups
        .into_iter()
        .map(|group| {
            let (mut rows, mut accelerations) = (Vec::new(), Vec::new());
            for k in group {
                let v = observed.v[k] / speed;
                functions.evaluate(&observed.q[k..=k], &mut values);
                rows.push(-v);
                rows.extend(values.value.iter().flat_map(|f| [*f, f * v * v]));
                if force > 0.0 {
                    rows.extend(values.value.iter().map(|f| f * observed.force[k] / force));
                }
                accelerations.push(observed.a[k] / size);
            }
            Sums::new(&rows, &accelerations)
        })
        .collect();
    let sums = Sums::of(&parts);
    let factors = sums.solve(DECAY_TRUST)?;
    let without = sums.without(&parts, DECAY_TRUST)?;
    let left: f64 =
        parts.iter().zip(&without).map(|(part, factors)| part.residual_square(factors)).sum::<f64>() / states as f64;
    let error = observed.error.first().map_or(0.0, |error| error / size);
    let variance = jackknife(factors[0], without.iter().map(|factors| factors[0]));
    let decay = Decay {
        rate: factors[0] * size / speed,
        error: variance.sqrt() * size / speed,
        left: (left - error * error).max(0.0).sqrt(),
        share: factors[0].abs(),
    };
    [decay.rate, decay.error, decay.left].iter().all(|x| x.is_finite()).then_some(decay)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RngStream;
    use rand::Rng;
    use rand_distr::StandardNormal;

    /// States of a pendulum with friction `rate` and an error of the acceleration of `noise`.
    fn swings(rate: f64, noise: f64) -> Observed {
        let mut rng = RngStream::Test.generator(1);
        let mut observed = Observed { error: vec![noise], ..Observed::default() };
        let (h, mut q, mut v) = (0.01, 2.0, 0.0);
        for _ in 0..3000 {
            let force = |q: f64, v: f64| -9.81 * f64::sin(q) - rate * v;
            let middle = (q + 0.5 * h * v, v + 0.5 * h * force(q, v));
            (q, v) = (q + h * middle.1, v + h * force(middle.0, middle.1));
            observed.q.push(q);
            observed.v.push(v);
            observed.a.push(force(q, v) + noise * rng.sample::<f64, _>(StandardNormal));
        }
        observed
    }

    #[test]
    fn friction_of_one_coordinate_is_seen_in_the_motion() {
        let found = decay(&[true], &swings(0.3, 0.2)).unwrap();
        assert!(found.is_certain() && (found.rate - 0.3).abs() < 4.0 * found.error && found.error < 0.03, "{found:?}");
        let found = decay(&[true], &swings(0.0, 0.2)).unwrap();
        assert!(!found.is_certain() && found.rate.abs() < 4.0 * found.error, "{found:?}");
        assert_eq!(decay(&[true, true], &Observed::default()), None);
    }

    #[test]
    fn motion_of_another_kind_is_not_called_damped() {
        // Accelerations that are mostly a function of time.
        let mut observed = swings(0.3, 0.2);
        let mut rng = RngStream::Test.generator(2);
        observed.a.iter_mut().for_each(|a| *a += 10.0 * rng.random_range(-1.0..1.0));
        let found = decay(&[true], &observed).unwrap();
        assert!(!found.is_certain() && found.left > MOST_DECAY_RESIDUAL, "{found:?}");
    }
}
