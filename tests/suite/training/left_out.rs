//! Where states or segments are left out, the gradient is that of the loss that is stated.

use crate::common::accuracy::cast;
use crate::common::properties;
use lnn::configuration::Penalty;
use lnn::data::Dataset;
use lnn::data::{Noise, StateEstimate};
use lnn::network::{ActivationChoice, Architecture, Form, Initialization, InputLayer, Layout};
use lnn::recording::RecordedTrajectory;
use lnn::rollout::Between;
use lnn::scalar::{Dd, Scalar};
use lnn::shooting::{Segments, ShootingObjective};
use lnn::training::Objective;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn architecture(n: usize, alpha: f64) -> Architecture {
    Architecture {
        coordinates: n,
        hidden: vec![6, 5],
        activation: ActivationChoice::Softplus,
        alpha,
        time_like: None,
        scale: (0..n).map(|i| 2.0 + i as f64).collect(),
        periodic: vec![false; n],
        embed_periodic: false,
        input_layer: InputLayer::None,
        dissipation: None,
        form: Form::default(),
    }
}

/// Central difference of `value` along `direction`, with errors far below the last bit of `f64`.
fn slope(value: impl Fn(&[Dd]) -> Dd, at: &[f64], direction: &[f64]) -> f64 {
    let step = Dd::of_f64(2f64.powi(-40));
    let moved =
        |by: Dd| -> Vec<Dd> { at.iter().zip(direction).map(|(&x, &d)| Dd::of_f64(x) + by * Dd::of_f64(d)).collect() };
    ((value(&moved(step)) - value(&moved(-step))) / (step + step)).to_f64()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

proptest! {
    #![proptest_config(properties(24))]
    #[test]
    fn the_gradient_is_that_of_the_mean_over_the_states_that_count(
        n in 1_usize..4,
        states in 2_usize..90,
        every in 2_usize..6,
        lambda in prop::sample::select(vec![0.0, 3.0]),
        weighted in any::<bool>(),
        seed in any::<u64>(),
    ) {
        let architecture = architecture(n, 0.0);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |count: usize, size: f64| -> Vec<f64> { (0..count).map(|_| rng.random_range(-size..size)).collect() };
        let (mut q, v, a) = (draw(states * n, 2.0), draw(states * n, 3.0), draw(states * n, 2.0));
        let weight: Vec<f64> = draw(states, 0.9).iter().map(|x| 1.0 + x).collect();
        // Far from 0 a softplus is linear to the last bit: there, and only there, the mass matrix vanishes.
        let far = (0..states).filter(|k| k % every == 1).collect::<Vec<_>>();
        far.iter().for_each(|k| q[k * n..(k + 1) * n].fill(-1e9));
        let data = Dataset::new(n, q, v, a).unwrap();
        let data = if weighted { data.with_weights(weight).unwrap() } else { data };
        let weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut rng);
        let direction: Vec<f64> = weights.iter().map(|_| rng.random_range(-1.0..1.0)).collect();
        let rows: Vec<u32> = (0..states as u32).collect();
        let penalty = if lambda > 0.0 { Penalty::Eigenvalue { lambda } } else { Penalty::None };

        let mut gradient = vec![f64::NAN; weights.len()];
        let report = Objective::new(&architecture, penalty, 2).unwrap().step(&weights, &data, &rows, &mut gradient);
        prop_assert_eq!(report.left_out, far.len());
        let exact = data.cast::<Dd>();
        let value = |weights: &[Dd]| {
            let mut buffer = vec![Dd::of_f64(0.0); weights.len()];
            let report = Objective::new(&architecture, penalty, 1).unwrap().step(weights, &exact, &rows, &mut buffer);
            assert_eq!(report.left_out, far.len());
            report.loss + report.penalty
        };
        let expected = slope(value, &weights, &direction);
        let size = dot(&gradient, &gradient).sqrt() * dot(&direction, &direction).sqrt();
        let error = (dot(&gradient, &direction) - expected).abs();
        // Singular matrices are near in some cases; a wrong denominator is off by a tenth and more.
        prop_assert!(error <= 1e-7 * size, "{} for {expected}, of {size}", dot(&gradient, &direction));
    }
}

/// A wave and a half in 15 samples, two coordinates.
fn track(name: &str) -> RecordedTrajectory {
    let times: Vec<f64> = (0..15).map(|k| 0.1 * f64::from(k)).collect();
    let q = times.iter().flat_map(|t| [(2.0 * t).sin(), 0.5 * (3.0 * t).cos()]).collect();
    let v = times.iter().flat_map(|t| [2.0 * (2.0 * t).cos(), -1.5 * (3.0 * t).sin()]).collect();
    RecordedTrajectory { name: name.to_string(), times, q, v, a: vec![], force: vec![] }
}

/// Weights and starts together, gaps included.
#[test]
fn the_gradient_of_shooting_is_that_of_the_mean_over_the_segments_that_count() {
    let architecture = architecture(2, 0.75);
    let tracks = [track("one"), track("two")];
    let estimated: Vec<StateEstimate<'_>> = tracks
        .iter()
        .map(|track| StateEstimate { track, q: &track.q, v: &track.v, between: Between::Linear })
        .collect();
    let noise = Noise { q: vec![0.05; 2], v: vec![0.1; 2] };
    let double = Segments::<f64>::new(&architecture, &estimated, &noise, 5, 4);
    let exact = Segments::<Dd>::new(&architecture, &estimated, &noise, 5, 4);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut rng);
    let mut starts = double.starts().to_vec();
    // The first of three segments is too fast for any sensible range.
    starts[2] = 1e9;
    let (rows, parameters) = ([0, 1, 2, 4], Layout::new(&architecture).parameters);
    let (mut by_weights, mut by_starts) = (vec![0.0; parameters], vec![0.0; starts.len()]);
    let continuity = 0.5;
    let mut shots = ShootingObjective::<f64>::new(&architecture, Penalty::None, (continuity, 2.0), 2).unwrap();
    let report = shots.step(&weights, &double, &starts, &rows, (&mut by_weights, &mut by_starts));
    assert_eq!((double.len(), report.left_out), (6, 1));
    // Five samples, two coordinates, positions and velocities; three segments count.
    assert_eq!(report.residuals, 3 * 5 * 2 * 2);
    let found = [by_weights, by_starts].concat();

    let at = [weights, starts].concat();
    // Segments 1 and 4 are followed by another: two gaps of four components.
    let gaps = Dd::of_f64(continuity * 2.0 * 4.0 / report.residuals as f64);
    let value = |x: &[Dd]| {
        let (weights, starts) = x.split_at(parameters);
        let mut shots = ShootingObjective::<Dd>::new(&architecture, Penalty::None, (continuity, 2.0), 1).unwrap();
        let report = shots.loss(weights, &exact, starts, &rows);
        assert_eq!(report.left_out, 1);
        report.loss + report.gap * gaps
    };
    let own = value(&cast::<f64, Dd>(&at)).to_f64();
    let stated = report.loss + report.gap * gaps.to_f64();
    assert!((own - stated).abs() <= 1e-12 * own, "{own} {stated}");
    for _ in 0..6 {
        let direction: Vec<f64> = at.iter().map(|_| rng.random_range(-1.0..1.0)).collect();
        let expected = slope(value, &at, &direction);
        let size = dot(&found, &found).sqrt() * dot(&direction, &direction).sqrt();
        let error = (dot(&found, &direction) - expected).abs();
        assert!(error <= 1e-12 * size, "{} for {expected}", dot(&found, &direction));
    }
}
