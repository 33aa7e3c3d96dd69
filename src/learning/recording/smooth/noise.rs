//! Estimates the noise of a measured signal from the signal alone.

use super::thresholds::{
    CONTRAST_ORDERS, LEAST_LOCAL_NOISE, LOCAL_CONTRASTS, MOST_CONTRASTS, ORDER_AGREEMENT, OUTLYING_CONTRAST,
    ROUNDING_NOISE, SAME_NOISE, STILL_FALLING,
};
use crate::recording::statistics::{rms, robust_deviation};
use serde::Serialize;

/// Estimated measurement noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Noise {
    /// Standard deviation, in the unit of the signal.
    pub sigma: f64,
    /// Order of the differences that determined it.
    pub order: usize,
    /// `true` if higher differences agree. If not, the motion is sampled too coarsely to be distinguished from noise, and `sigma`
    /// is an upper bound.
    pub resolved: bool,
}

/// Noise of column `i` of `(samples, n)` values at their times, pooled over the trajectories.
///
/// A contrast of order `k` is the divided difference of `k + 1` neighbours, scaled to the variance of one sample: it
/// annihilates polynomials below degree `k` and leaves the noise (Gasser, Sroka, Jennen-Steinmetz, Biometrika 73 (1986)
/// 625, at order 2). The standard deviation is robust: from the median magnitude, refined by the root mean square of the
/// contrasts within four of it. Of the orders up to 10 the lowest is taken that agrees with the smallest result within
/// the scatter of such estimates. Never below the rounding of the numbers themselves.
pub fn noise<'a>(signals: impl Iterator<Item = (&'a [f64], &'a [f64])> + Clone, n: usize, i: usize) -> Noise {
    let total: usize = signals.clone().map(|(times, _)| times.len()).sum();
    let stride = (total / MOST_CONTRASTS).max(1);
    let largest =
        signals.clone().flat_map(|(_, x)| x.iter().skip(i).step_by(n * stride)).fold(0.0, |m: f64, x| m.max(x.abs()));
    let mut found: Vec<(usize, f64, f64)> = Vec::with_capacity(CONTRAST_ORDERS.len());
    let (mut contrasts, mut weights) = (Vec::new(), [0.0; CONTRAST_ORDERS[CONTRAST_ORDERS.len() - 1] + 1]);
    for order in CONTRAST_ORDERS {
        contrasts.clear();
        for (times, x) in signals.clone().filter(|(times, _)| times.len() > order) {
            let starts = (0..times.len() - order).step_by(stride);
            contrasts.extend(starts.map(|start| {
                contrast_weights(&times[start..=start + order], &mut weights[..=order]);
                let relative = |j: usize| x[(start + j) * n + i] - x[start * n + i];
                weights[..=order].iter().enumerate().map(|(j, weight)| weight * relative(j)).sum::<f64>()
            }));
        }
        if contrasts.is_empty() {
            break;
        }
        let middle = robust_deviation(&mut contrasts);
        let near = contrasts.iter().copied().filter(|c| *c <= OUTLYING_CONTRAST * middle);
        let sigma = if middle > 0.0 { rms(near) } else { rms(contrasts.iter().copied()) };
        // Neighbouring contrasts are correlated: about sqrt(pi k / 2) of them count as one.
        let scatter = ((1.0 + (1.6 * order as f64).sqrt()) / (2.0 * contrasts.len() as f64)).sqrt();
        found.push((order, sigma, scatter));
    }
    let floor = f64::EPSILON * largest;
    let least = found.iter().map(|(_, sigma, _)| *sigma).fold(f64::INFINITY, f64::min);
    match found.iter().find(|(_, sigma, scatter)| *sigma <= least * (1.0 + ORDER_AGREEMENT * scatter)) {
        Some(&(order, sigma, _)) => {
            // If the estimate still decreases at the last order, it may contain motion.
            let resolved = match found.as_slice() {
                [.., (_, before, _), (_, last, _)] => {
                    order < found[found.len() - 1].0 || *last > STILL_FALLING * before
                }
                _ => false,
            };
            Noise { sigma: sigma.max(floor), order, resolved: resolved || sigma <= ROUNDING_NOISE * floor }
        }
        None => Noise { sigma: floor, order: 0, resolved: false },
    }
}

/// Noise at every sample of column `i` of a trajectory: estimated from nearby contrasts if these clearly differ from the noise of the
/// recording.
///
/// Contrasts beyond four standard deviations count as four: a bad sample is not noise.
pub(super) fn along((times, x): (&[f64], &[f64]), regular: bool, (n, i): (usize, usize), noise: Noise) -> Vec<f64> {
    let Noise { sigma, order, resolved } = noise;
    let count = times.len().saturating_sub(order);
    if order == 0 || !resolved || count < LOCAL_CONTRASTS || sigma <= 0.0 {
        return vec![sigma; times.len()];
    }
    let mut weights = [0.0; CONTRAST_ORDERS[CONTRAST_ORDERS.len() - 1] + 1];
    // Cumulative sums of squares of the contrasts, in units of the noise of the recording.
    let mut sums = vec![0.0; count + 1];
    for start in 0..count {
        if !(regular && start > 0) {
            contrast_weights(&times[start..=start + order], &mut weights[..=order]);
        }
        let relative = |j: usize| (x[(start + j) * n + i] - x[start * n + i]) / sigma;
        let contrast = weights[..=order].iter().enumerate().map(|(j, weight)| weight * relative(j)).sum::<f64>();
        sums[start + 1] = sums[start] + contrast.abs().min(OUTLYING_CONTRAST).powi(2);
    }
    let at = |sample: usize| {
        let middle = sample.saturating_sub(order / 2);
        let (first, end) = (
            middle.saturating_sub(LOCAL_CONTRASTS).min(count - LOCAL_CONTRASTS),
            (middle + LOCAL_CONTRASTS + 1).min(count),
        );
        let ratio = ((sums[end] - sums[first]) / (end - first) as f64).sqrt();
        if ratio * SAME_NOISE < 1.0 || ratio > SAME_NOISE { sigma * ratio.max(LEAST_LOCAL_NOISE) } else { sigma }
    };
    (0..times.len()).map(at).collect()
}

/// Weights of the divided difference of all samples at these times, scaled to square sum 1.
pub(crate) fn contrast_weights(times: &[f64], weights: &mut [f64]) {
    let [first, .., last] = times else { return };
    let scale = (last - first) / 4.0;
    let mut square = 0.0;
    for (j, t) in times.iter().enumerate() {
        let others = times.iter().enumerate().filter(|(k, _)| *k != j);
        weights[j] = 1.0 / others.map(|(_, other)| (t - other) / scale).product::<f64>();
        square += weights[j] * weights[j];
    }
    for weight in weights {
        *weight /= square.sqrt();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn noise_is_found_below_motion() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        // Regular and uneven steps; fast and slow motion; small and large noise; one sample in a hundred spoilt.
        for (jitter, omega, sigma) in
            [(0.0, 1.0, 1e-3), (0.0, 20.0, 1e-2), (0.3, 5.0, 1e-3), (0.3, 20.0, 1e-1), (0.0, 5.0, 1e-6)]
        {
            let times: Vec<f64> = (0..4000).map(|k| 0.01 * (k as f64 + jitter * (2.3 * f64::from(k)).sin())).collect();
            let x: Vec<f64> = times
                .iter()
                .enumerate()
                .flat_map(|(k, t)| {
                    let spoilt = if k % 100 == 7 { 1.0 } else { 0.0 };
                    [9.0, (omega * t).sin() + 0.3 * (0.7 * omega * t).cos() + sigma * normal() + spoilt]
                })
                .collect();
            let found = noise([(times.as_slice(), x.as_slice())].into_iter(), 2, 1);
            assert!((found.sigma / sigma - 1.0).abs() < 0.1, "{jitter} {omega} {sigma}: {found:?}");
            assert!(found.resolved, "{jitter} {omega} {sigma}: {found:?}");
            let constant = noise([(times.as_slice(), x.as_slice())].into_iter(), 2, 0);
            assert_eq!(constant.sigma, 9.0 * f64::EPSILON);
        }
    }

    #[test]
    fn noise_that_varies_is_followed() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let times: Vec<f64> = (0..3000).map(|k| 0.01 * f64::from(k)).collect();
        let sigma = |k: usize, varies: bool| if varies && k < 600 { 1e-3 } else { 1e-2 };
        for varies in [true, false] {
            let x: Vec<f64> =
                times.iter().enumerate().map(|(k, t)| (5.0 * t).sin() + sigma(k, varies) * normal()).collect();
            let signal = (times.as_slice(), x.as_slice());
            let found = noise([signal].into_iter(), 1, 0);
            let local = along(signal, true, (1, 0), found);
            for k in (0..500).chain(700..3000) {
                let ratio = local[k] / sigma(k, varies);
                assert!((0.5..2.0).contains(&ratio), "{varies} {k}: {ratio}");
                assert!(varies || local[k] == found.sigma, "{k}: even noise is that of the recording");
            }
            let given = Noise { sigma: 0.5, order: 0, resolved: true };
            assert!(along(signal, true, (1, 0), given).iter().all(|s| *s == 0.5));
        }
    }

    #[test]
    fn coarse_sampling_is_told() {
        // Five samples a period: differences of any order are mostly motion.
        let times: Vec<f64> = (0..1000).map(f64::from).collect();
        let x: Vec<f64> = times.iter().map(|t| (1.2 * t).sin()).collect();
        let found = noise([(times.as_slice(), x.as_slice())].into_iter(), 1, 0);
        assert!(!found.resolved && found.sigma > 1e-3, "{found:?}");
        let none = noise([(&[0.0, 1.0][..], &[1.0, 2.0][..])].into_iter(), 1, 0);
        assert_eq!((none.order, none.resolved), (0, false));
    }
}
