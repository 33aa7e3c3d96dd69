//! Weights of states by the size of their accelerations: few large ones do not outweigh the others.

use crate::data::dataset::{Dataset, DatasetError};
use crate::scalar::Scalar;

/// States that are about as far from the centre.
const ALIKE: usize = 200;

/// Sizes with which accelerations are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Weighting<'a> {
    /// Part of the usual size below which accelerations count alike,
    /// [`Data::acceleration_weighting`](crate::configuration::Data::acceleration_weighting).
    pub floor: f64,
    /// Scales of the coordinates.
    pub scale: &'a [f64],
    /// Standard errors of the accelerations, `(states, n)`; empty for exact ones.
    pub errors: &'a [f64],
}

impl Weighting<'_> {
    /// Mean size of every state's numbers, scaled.
    fn sizes<'a, S: Scalar>(&'a self, values: &'a [S]) -> impl Iterator<Item = f64> + 'a {
        let size = |a: &[S]| a.iter().zip(self.scale).map(|(a, s)| (a.to_f64() / s).abs()).sum::<f64>();
        values.chunks_exact(self.scale.len()).map(move |a| size(a) / self.scale.len() as f64)
    }

    /// Mean size of every state's acceleration, and the same with its error.
    fn of<S: Scalar>(&self, set: &Dataset<S>) -> (Vec<f64>, Vec<f64>) {
        let sizes: Vec<f64> = self.sizes(set.a()).collect();
        let mut uncertain = sizes.clone();
        uncertain.iter_mut().zip(self.sizes(self.errors)).for_each(|(size, error)| *size += error);
        (sizes, uncertain)
    }

    /// The states with the weights `f m/(f m + |a| + e)`, `m` the mean of `|a|` and `e` the error.
    pub fn relative<S: Scalar>(&self, set: Dataset<S>) -> Result<Dataset<S>, DatasetError> {
        let (sizes, uncertain) = self.of(&set);
        let floor = self.floor * sizes.iter().sum::<f64>() / sizes.len() as f64;
        // Without any acceleration every state counts the same.
        let weight = |size: f64| S::of_f64(if floor > 0.0 { floor / (floor + size) } else { 1.0 });
        set.with_weights(uncertain.into_iter().map(weight).collect())
    }

    /// The states with the weights `1/(|a| + f m + e)`, `m` the median of `|a|` among [`ALIKE`] states about as far from the centre of
    /// these coordinates.
    pub fn by_distance<S: Scalar>(&self, set: Dataset<S>, around: &[usize]) -> Result<Dataset<S>, DatasetError> {
        let n = self.scale.len();
        let (sizes, uncertain) = self.of(&set);
        let distance = |k: usize| around.iter().map(|&i| set.q()[k * n + i].to_f64().powi(2)).sum::<f64>();
        let mut order: Vec<usize> = (0..set.len()).collect();
        order.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        let mut weights = vec![S::of_f64(1.0); set.len()];
        for group in order.chunks(ALIKE) {
            let mut alike: Vec<f64> = group.iter().map(|&k| sizes[k]).collect();
            alike.sort_by(f64::total_cmp);
            let floor = self.floor * alike[alike.len() / 2];
            // Where nothing is accelerated every state counts the same.
            let weight = |size: f64| S::of_f64(if floor > 0.0 { (size + floor).recip() } else { 1.0 });
            group.iter().for_each(|&k| weights[k] = weight(uncertain[k]));
        }
        set.with_weights(weights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 400 states whose accelerations fall with the square of the distance.
    fn falling() -> Dataset<f64> {
        let q: Vec<f64> = (0..400).flat_map(|k| [0.02 * f64::from(k) + 1.0, 7.0]).collect();
        let a = q.chunks(2).flat_map(|q| [q[0].powi(-2), 0.0]).collect();
        Dataset::new(2, q.clone(), vec![0.0; q.len()], a).unwrap()
    }

    #[test]
    fn near_and_far_count_alike_and_uncertain_ones_less() {
        let set = falling();
        let size = |k: usize| 0.5 * set.a()[2 * k];
        let plain = Weighting { floor: 1.0, scale: &[1.0; 2], errors: &[] };
        let even = plain.by_distance(set.clone(), &[0]).unwrap();
        // Beside the median of each half, by distance.
        let usual = |k: usize| size(if k < 200 { 99 } else { 299 });
        assert!((0..400).all(|k| (even.weight(k) * (size(k) + usual(k)) - 1.0).abs() < 1e-14));
        for half in [0..200, 200..400] {
            let share = half.map(|k| even.weight(k) * size(k)).sum::<f64>() / 200.0;
            assert!((share - 0.5).abs() < 0.05, "{share}");
        }
        let relative = plain.relative(set.clone()).unwrap();
        let mean = (0..400).map(size).sum::<f64>() / 400.0;
        assert!((relative.weight(7) - mean / (mean + size(7))).abs() < 1e-15);
        // An error as large as acceleration and floor together halves the weight.
        let mut errors = vec![0.0; 800];
        errors[2 * 7 + 1] = 2.0 / even.weight(7);
        let uncertain = Weighting { errors: &errors, ..plain }.by_distance(set.clone(), &[0]).unwrap();
        assert!((uncertain.weight(7) - 0.5 * even.weight(7)).abs() < 1e-12);
        assert_eq!(uncertain.weight(8), even.weight(8));
        errors[2 * 7 + 1] = 2.0 * (mean + size(7));
        let uncertain = Weighting { errors: &errors, ..plain }.relative(set).unwrap();
        assert!((uncertain.weight(7) - 0.5 * relative.weight(7)).abs() < 1e-12);
    }

    #[test]
    fn states_at_rest_count_the_same() {
        let still = Dataset::new(1, vec![1.0, 2.0], vec![0.0; 2], vec![0.0; 2]).unwrap();
        let weighting = Weighting { floor: 1.0, scale: &[1.0], errors: &[] };
        for set in [weighting.relative(still.clone()).unwrap(), weighting.by_distance(still, &[0]).unwrap()] {
            assert_eq!((set.weight(0), set.weight(1)), (1.0, 1.0));
        }
    }
}
