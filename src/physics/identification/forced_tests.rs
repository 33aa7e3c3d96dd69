//! Tests on simulated motion under known forces: their interpolation between samples, and their noise.

use super::tests::described;
use super::*;
use crate::lagrangian::SystemInstance;
use crate::random::RngStream;
use crate::recording::{RecordedTrajectory, Recording};
use crate::rollout::{Driven, RolloutOptions, SampledForce};
use rand_distr::{Distribution, StandardNormal};

/// An oscillator under a force that is held between the samples, eight of them per turn of its own.
#[test]
fn a_driven_oscillator_is_known_from_coarse_samples_and_the_hold_is_seen() {
    let oscillator = |pairs: &[(&str, f64)]| {
        let text = r#"{"name": "duffing", "lagrangian": "m*x_dot^2/2 - k*x^2/2 - b*x^4/4", "dissipation": "c*x_dot^2/2",
            "coordinates": [{"name": "x", "bounds": [-2, 2], "velocity_bounds": [-2, 2]}],
            "parameters": {"m": 1.5, "k": 1, "b": 0.1, "c": 0.3}}"#;
        described(text, pairs)
    };
    let truth = [("m", 1.0), ("k", 1.2), ("b", 0.4), ("c", 0.2)];
    let instance = oscillator(&truth);
    let model = instance.build().unwrap();
    let (step, samples) = (0.7, 1200);
    let mut rng = RngStream::Trajectories.generator(7);
    let force: Vec<f64> = (0..samples).map(|_| StandardNormal.sample(&mut rng)).collect();
    let (mut q, mut state) = (Vec::new(), (0.0, 0.0));
    for f in &force {
        let draw: f64 = StandardNormal.sample(&mut rng);
        q.push(state.0 + 0.01 * draw);
        let held = SampledForce::constant(vec![*f]).unwrap();
        let motion = Driven::new(&*model, &held).rollout(&[state.0], &[state.1], &RolloutOptions::new(step, step));
        let motion = motion.complete().unwrap();
        state = (motion.q[1], motion.v[1]);
    }
    let times = (0..samples).map(|k| k as f64 * step).collect();
    let track = RecordedTrajectory { name: "circuit".into(), times, q, v: vec![], a: vec![], force };
    let recording = Recording { coordinates: vec!["x".into()], periodic: vec![false], tracks: vec![track] };
    let found = identify(&oscillator(&[]), &recording, &IdentifyOptions::default()).unwrap();
    assert_eq!(found.between, Some(Between::Held));
    assert!(found.undetermined.is_empty(), "{found:?}");
    for constant in &found.constants {
        let truth = truth.iter().find(|(name, _)| *name == constant.symbol).unwrap().1;
        let error = constant.standard_error.unwrap();
        assert!((constant.value - truth).abs() < 4.0 * error && error < 0.01, "{constant:?}");
    }
}

/// An oscillator under a force with eight samples per period: a smooth interpolation leaves smaller residuals than straight lines.
#[test]
fn a_smooth_force_is_seen_between_coarse_samples() {
    let oscillator = |pairs: &[(&str, f64)]| {
        let text = r#"{"name": "swing", "lagrangian": "m*x_dot^2/2 - k*x^2/2",
            "coordinates": [{"name": "x", "bounds": [-2, 2], "velocity_bounds": [-2, 2]}],
            "parameters": {"m": 1.5, "k": 1}}"#;
        described(text, pairs)
    };
    let model = oscillator(&[("m", 1.0), ("k", 1.2)]).build().unwrap();
    let push = |t: f64| (0.8 * t).sin() + 0.5 * (0.37 * t).cos();
    let force = |t: f64, _: &[f64], _: &[f64], force: &mut [f64]| force[0] = push(t);
    let motion = Driven::new(&*model, &force).rollout(&[0.4], &[0.0], &RolloutOptions::reference(400.0, 0.9));
    let motion = motion.complete().unwrap();
    let mut rng = RngStream::Trajectories.generator(3);
    let noisy = |q: &f64| {
        let draw: f64 = StandardNormal.sample(&mut rng);
        q + 1e-4 * draw
    };
    let (q, force) = (motion.q.iter().map(noisy).collect(), motion.t.iter().map(|t| push(*t)).collect());
    let track = RecordedTrajectory { name: "run".into(), times: motion.t, q, v: vec![], a: vec![], force };
    let recording = Recording { coordinates: vec!["x".into()], periodic: vec![false], tracks: vec![track] };
    let off = |between: Option<Between>| {
        let options = IdentifyOptions::new().between(between);
        let found = identify(&oscillator(&[]), &recording, &options).unwrap();
        let truth = |symbol: &str| if symbol == "m" { 1.0 } else { 1.2 };
        let off = found.constants.iter().map(|c| (c.value - truth(&c.symbol)).abs()).sum::<f64>();
        (found.between.unwrap(), off)
    };
    let (lines, curves) = (off(Some(Between::Linear)).1, off(Some(Between::Cubic)).1);
    assert!(curves < lines / 5.0, "{curves} {lines}");
    assert_ne!(off(None).0, Between::Held);
    // Through two samples the curve is a line, through one it is constant.
    let mut found = [0.0];
    for (samples, expected) in [(2, 0.25), (1, 0.0)] {
        let force: Vec<f64> = (0..samples).map(f64::from).collect();
        let track = RecordedTrajectory { times: force.clone(), force, ..recording.tracks[0].clone() };
        driven::forces(&track, Between::Cubic, ((samples - 1) as usize, 0.25), &mut found);
        assert_eq!(found, [expected]);
    }
}

/// A driven oscillator whose force is measured with noise, at 20 Hz for 40 s.
fn pushed(noise_of_force: f64, seed: u64) -> (SystemInstance<f64>, Recording) {
    let text = r#"{"name": "cart", "lagrangian": "m*x_dot^2/2 - k*x^2/2", "dissipation": "c*x_dot^2/2",
        "coordinates": [{"name": "x", "bounds": [-2, 2], "velocity_bounds": [-2, 2]}],
        "parameters": {"m": 1.5, "k": 1, "c": 0.3}}"#;
    let model = described(text, &[("m", 1.0), ("k", 1.3), ("c", 0.2)]).build().unwrap();
    let push = |t: f64| (0.8 * t).sin() + 0.7 * (2.1 * t).cos();
    let force = |t: f64, _: &[f64], _: &[f64], force: &mut [f64]| force[0] = push(t);
    let motion = Driven::new(&*model, &force).rollout(&[0.2], &[0.0], &RolloutOptions::reference(40.0, 0.05));
    let motion = motion.complete().unwrap();
    let mut rng = RngStream::Trajectories.generator(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let q = motion.q.iter().map(|q| q + 1e-3 * normal()).collect();
    let force = motion.t.iter().map(|t| push(*t) + noise_of_force * normal()).collect();
    let track = RecordedTrajectory { name: "run".into(), times: motion.t, q, v: vec![], a: vec![], force };
    (described(text, &[]), Recording { coordinates: vec!["x".into()], periodic: vec![false], tracks: vec![track] })
}

#[test]
fn noise_of_a_known_force_is_seen_in_the_motion() {
    let truth = |symbol: &str| [("m", 1.0), ("k", 1.3), ("c", 0.2)].iter().find(|(name, _)| *name == symbol).unwrap().1;
    let mut squares = Vec::new();
    for seed in 0..4 {
        let (form, recording) = pushed(0.1, seed);
        let found = identify(&form, &recording, &IdentifyOptions::default()).unwrap();
        assert!((found.force_noise[0] / 0.1 - 1.0).abs() < 0.5, "{:?}", found.force_noise);
        squares
            .extend(found.constants.iter().map(|c| ((c.value - truth(&c.symbol)) / c.standard_error.unwrap()).powi(2)));
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!((0.2..2.5).contains(&mean) && squares.iter().all(|z| *z < 16.0), "{squares:?}");
    let (form, recording) = pushed(0.0, 9);
    let exact = identify(&form, &recording, &IdentifyOptions::default()).unwrap();
    assert!(exact.force_noise.is_empty() && exact.explained, "{exact:?}");
}
