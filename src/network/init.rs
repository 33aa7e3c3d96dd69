//! Initial weights.

use crate::network::{Architecture, Initialization, Layout};
use crate::scalar::{Real, Scalar};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// Draws the flat parameters of a network; the same generator state gives the same weights in every precision.
///
/// Linear gain 1 for the output layer under [`Initialization::VariancePreserving`].
pub fn initial_weights<S: Scalar>(architecture: &Architecture, kind: Initialization, rng: &mut impl Rng) -> Vec<S> {
    let layout = Layout::new(architecture);
    let mut weights = vec![<S as Real>::zero(); layout.parameters];
    let last = layout.layers.len() - 1;
    for (k, layer) in layout.layers.iter().enumerate() {
        let fan_in = layer.inputs as f64;
        let deviation = match kind {
            Initialization::Default => {
                let bound = fan_in.sqrt().recip();
                for w in layer.weight_range().chain(layer.bias_range()) {
                    weights[w] = S::of_f64(rng.random_range(-bound..=bound));
                }
                continue;
            }
            Initialization::VariancePreserving if k == last => fan_in.sqrt().recip(),
            Initialization::VariancePreserving => architecture.activation.variance_gain() / fan_in.sqrt(),
            Initialization::Cranmer if k == last => fan_in.sqrt(),
            Initialization::Cranmer if k == 0 => 2.2 / fan_in.sqrt(),
            Initialization::Cranmer => 0.58 * k as f64 / fan_in.sqrt(),
        };
        for w in layer.weight_range() {
            let normal: f64 = StandardNormal.sample(rng);
            weights[w] = S::of_f64(deviation * normal);
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::Activation;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn deviations(kind: Initialization) -> Vec<(f64, f64)> {
        let architecture = Architecture {
            coordinates: 2,
            hidden: vec![300, 200],
            activation: Activation::Softplus,
            alpha: 0.0,
            scale: vec![1.0; 2],
            periodic: vec![false; 2],
            embed_periodic: false,
        };
        let weights: Vec<f64> = initial_weights(&architecture, kind, &mut ChaCha8Rng::seed_from_u64(1));
        let deviation = |range: std::ops::Range<usize>| {
            let count = range.len().max(1) as f64;
            (weights[range].iter().map(|w| w * w).sum::<f64>() / count).sqrt()
        };
        let layout = Layout::new(&architecture);
        layout.layers.iter().map(|l| (deviation(l.weight_range()), deviation(l.bias_range()))).collect()
    }

    /// Within four standard errors of a sample deviation over `count` weights.
    fn near(found: f64, expected: f64, count: usize) {
        assert!((found / expected - 1.0).abs() < 4.0 / (2.0 * count as f64).sqrt(), "{found} for {expected}");
    }

    #[test]
    fn default_weights_are_uniform_within_the_inverse_root_of_the_fan_in() {
        let found = deviations(Initialization::Default);
        for ((weights, biases), (fan_in, fan_out)) in found.into_iter().zip([(4, 300), (300, 200)]) {
            near(weights, (3.0 * fan_in as f64).sqrt().recip(), fan_in * fan_out);
            near(biases, (3.0 * fan_in as f64).sqrt().recip(), fan_out);
        }
    }

    #[test]
    fn normal_schemes_follow_their_formulas_and_leave_biases_zero() {
        let gain = Activation::Softplus.variance_gain();
        let cases = [
            (Initialization::VariancePreserving, [gain / 2.0, gain / 300.0_f64.sqrt(), 200.0_f64.sqrt().recip()]),
            (Initialization::Cranmer, [1.1, 0.58 / 300.0_f64.sqrt(), 200.0_f64.sqrt()]),
        ];
        for (kind, expected) in cases {
            let found = deviations(kind);
            for ((&(weights, biases), expected), count) in found.iter().zip(expected).zip([1200, 60_000, 200]) {
                near(weights, expected, count);
                assert_eq!(biases, 0.0);
            }
        }
    }
}
