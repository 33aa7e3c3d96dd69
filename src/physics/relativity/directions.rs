//! Directions and distances around a centre.

/// Golden angle, and the ratio of the additive recurrence that goes with it: both fill evenly.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
const RATIO: f64 = 0.754_877_666_246_692_8;

/// Distances, uniform in their logarithm, with the directions of a Fibonacci sphere.
pub(super) fn directions(points: usize, (low, high): (f64, f64)) -> impl Iterator<Item = (f64, [f64; 3])> {
    (0..points).map(move |k| {
        let (z, angle) = (1.0 - (2.0 * k as f64 + 1.0) / points as f64, GOLDEN_ANGLE * k as f64);
        let across = (1.0 - z * z).sqrt();
        (low * (high / low).powf((k as f64 * RATIO).fract()), [across * angle.cos(), across * angle.sin(), z])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_distances_fill_a_shell_evenly() {
        type Place = (f64, [f64; 3]);
        let all: Vec<Place> = directions(1000, (1.0, 100.0)).collect();
        let mean = |of: &dyn Fn(&Place) -> f64| all.iter().map(of).sum::<f64>() / 1000.0;
        assert!((mean(&|(r, _)| r.ln()) - 10.0_f64.ln()).abs() < 0.01);
        for i in 0..3 {
            assert!(mean(&|(_, d)| d[i]).abs() < 5e-3);
            assert!((mean(&|(_, d)| d[i] * d[i]) - 1.0 / 3.0).abs() < 5e-3);
        }
    }
}
