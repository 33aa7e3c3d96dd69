//! Tests of the search: it converges or reports that it does not, from distant starts, across gaps, with repeated and weighted measurements.

use super::tests::{described, noise, recorded};
use super::*;
use crate::lagrangian::SystemInstance;
use crate::recording::{RecordedTrajectory, Recording};
use crate::rollout::{Driven, RolloutOptions};

/// A damped oscillator whose stiffness and friction are positive, from starting values.
fn damped(k: f64, c: f64) -> SystemInstance<f64> {
    let text = r#"{"name": "spring", "lagrangian": "m*x_dot^2/2 - k*x^2/2", "dissipation": "c*x_dot^2/2",
        "coordinates": [{"name": "x", "bounds": [-2, 2], "velocity_bounds": [-3, 3]}], "parameters": {"m": 1,
        "k": {"default": 2, "learn": true, "range": "positive"}, "c": {"default": 1, "learn": true, "range": "positive"}}}"#;
    described(text, &[("k", k), ("c", c)])
}

/// Errors of the constants in standard errors.
fn off(found: &Identified, truth: &[(&str, f64)]) -> Vec<f64> {
    let of = |(name, truth): &(&str, f64)| {
        let constant = found.constants.iter().find(|c| c.symbol == *name).unwrap();
        (constant.value - truth) / constant.standard_error.unwrap_or(f64::NAN)
    };
    truth.iter().map(of).collect()
}

fn pendulum(pairs: &[(&str, f64)]) -> SystemInstance<f64> {
    let text = r#"{"name": "swing", "lagrangian": "a_dot^2/2 + w*cos(a)",
        "coordinates": [{"name": "a", "periodic": true, "velocity_bounds": [-3, 3]}], "parameters": {"w": 9}}"#;
    described(text, pairs)
}

/// A charged particle in the field of a wiggler.
fn wiggler(field: f64, wave_number: f64) -> SystemInstance<f64> {
    let text = r#"{"name": "wiggler", "lagrangian": "(x_dot^2 + z_dot^2)/2 - (B/k)*sin(k*z)*x_dot",
        "coordinates": [{"name": "x", "bounds": [-2, 2], "velocity_bounds": [-2, 2]},
            {"name": "z", "bounds": [0, 30], "velocity_bounds": [0, 3]}],
        "parameters": {"B": 1.2, "k": {"default": 2, "learn": true, "range": "positive"}}}"#;
    described(text, &[("B", field), ("k", wave_number)])
}

#[test]
fn a_wave_number_is_found_although_smoothing_leaves_out_the_ends() {
    // The noise of z requires wide smoothing windows, which leave little time for the derivative by k to grow.
    for (seed, wave_number) in [(0, 1.7), (1, 2.3), (2, 1.8), (3, 2.4)] {
        let recording = recorded(&wiggler(1.2, 2.0), &[&[0.1, 0.0, 0.0, 1.0]], (25.0, 0.05), &[2e-3, 6.5e-2], seed);
        let options = IdentifyOptions::new().constants(["B", "k"]);
        let found = identify(&wiggler(1.4, wave_number), &recording, &options).unwrap();
        let off = off(&found, &[("B", 1.2), ("k", 2.0)]);
        assert!(found.converged && off.iter().all(|off| off.abs() < 4.5), "{seed}: {found:?}");
        // A wave number outside the searched range is not found, and the motion is not explained.
        let far = identify(&wiggler(1.4, 0.7), &recording, &options).unwrap();
        assert!(!far.explained, "{seed}: {far:?}");
    }
}

#[test]
fn a_strong_friction_is_found_from_a_weak_one() {
    let mut squares = Vec::new();
    for seed in 0..12 {
        let recording = recorded(&damped(2.0, 8.0), &[&[1.3, 0.2]], (10.0, 0.02), &[1e-3], seed);
        let found = identify(&damped(2.0, 0.05), &recording, &IdentifyOptions::default()).unwrap();
        assert!(found.converged && found.decrement < 1e-3, "{seed}: {found:?}");
        squares.extend(off(&found, &[("k", 2.0), ("c", 8.0)]).iter().map(|off| off * off));
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!(mean < 2.5 && squares.iter().all(|square| *square < 20.0), "{squares:?}");
}

#[test]
fn positive_constants_come_back_from_almost_nothing() {
    for (k, c) in [(2.0, 1e-9), (1e-9, 0.5), (1e-9, 1e-9), (1e4, 1e3)] {
        let recording = recorded(&damped(3.0, 0.4), &[&[1.3, 0.2]], (6.0, 0.02), &[1e-3], 3);
        let found = identify(&damped(k, c), &recording, &IdentifyOptions::default()).unwrap();
        let off = off(&found, &[("k", 3.0), ("c", 0.4)]);
        assert!(found.converged && off.iter().all(|off| off.abs() < 4.5), "{k} {c}: {found:?}");
    }
}

#[test]
fn a_constant_at_its_bound_is_called_that() {
    let mut bound = 0;
    for seed in 0..8 {
        let recording = recorded(&damped(3.0, 1e-9), &[&[0.5, 0.2]], (6.0, 0.05), &[2e-2], seed);
        let found = identify(&damped(2.0, 0.5), &recording, &IdentifyOptions::default()).unwrap();
        let (c, k) = (&found.constants[0], &found.constants[1]);
        assert!(found.converged && (k.value - 3.0).abs() < 4.5 * k.standard_error.unwrap(), "{found:?}");
        assert_eq!(c.at_bound, c.standard_error.is_none(), "{found:?}");
        assert!(c.value < if c.at_bound { 1e-9 } else { 4.5 * c.standard_error.unwrap() }, "{found:?}");
        bound += usize::from(c.at_bound);
    }
    assert!((1..8).contains(&bound), "{bound}");
}

#[test]
fn a_search_that_is_cut_short_does_not_report_convergence() {
    let form = damped(40.0, 0.05);
    let recording = recorded(&damped(2.0, 8.0), &[&[1.3, 0.2]], (4.0, 0.02), &[1e-3], 1);
    let equations = crate::lagrangian::Equations::record(&form, &[1, 2], &[]).unwrap().unwrap();
    let driven = DrivenEquations {
        recording: &recording,
        equations: &equations,
        chosen: 2,
        between: Between::Linear,
        inputs: Vec::new(),
        step: 0.02,
        substeps: 4,
    };
    let problem = Problem {
        driven,
        values: form.parameters.clone(),
        chosen: vec![1, 2],
        ranges: form.system.parameters.iter().map(|parameter| parameter.range).collect(),
        sensors: Vec::new(),
        measured: None,
        sigma: vec![1e-3],
        sigma_of: Vec::new(),
        errors: &[],
        missing: &[],
        gaps: Vec::new(),
        spread: vec![1.0],
        robust: false,
        disturbances: Disturbances::default(),
        threads: 1,
        cancellation: Default::default(),
    };
    let start: Vec<f64> = problem.chosen.iter().map(|&k| problem.values[k]).collect();
    let segments = || vec![Segment { track: 0, first: 0, samples: 201, start: vec![1.3, 0.2] }];
    let short = problem.fit(&mut start.clone(), &mut segments(), 2);
    assert!(!short.converged && short.decrement > 1.0, "{short:?}");
    let whole = problem.fit(&mut start.clone(), &mut segments(), 100);
    assert!(whole.converged && whole.decrement < 1e-6, "{whole:?}");
    // From a point that an earlier step had reached by mistake, a search converges or reports that it does not.
    let mut x = vec![1e-12; 2];
    let back = problem.fit(&mut x, &mut segments(), 100);
    assert!(!back.converged || (back.square / whole.square - 1.0).abs() < 1e-6, "{x:?} {back:?}");
}

/// The given samples of a trajectory.
fn sampled(track: &RecordedTrajectory, n: usize, kept: &[usize]) -> RecordedTrajectory {
    let q = kept.iter().flat_map(|&k| track.q[k * n..(k + 1) * n].to_vec()).collect();
    RecordedTrajectory { times: kept.iter().map(|&k| track.times[k]).collect(), q, ..track.clone() }
}

fn orbit(mu: f64) -> SystemInstance<f64> {
    let text = r#"{"name": "orbit", "lagrangian": "(x_dot^2 + y_dot^2)/2 + mu/sqrt(x^2 + y^2)",
        "coordinates": [{"name": "x", "bounds": [-6, 6], "velocity_bounds": [-12, 12]},
            {"name": "y", "bounds": [-6, 6], "velocity_bounds": [-12, 12]}],
        "parameters": {"mu": {"default": 30, "learn": true, "range": "positive"}}}"#;
    described(text, &[("mu", mu)])
}

#[test]
fn motion_is_followed_across_gaps_of_any_length() {
    for seed in 0..3 {
        // Six periods of fourteen nights each, with some days between the nights.
        let mut recording = recorded(&orbit(39.478), &[&[-4.6, -0.4, 1.2, -2.3]], (6.0, 0.005), &[5e-3; 2], seed);
        let night = |k: usize| (k / 14) * 200 + (k % 14) * 5 + k % 3;
        let kept: Vec<usize> = (0..84).map(night).collect();
        recording.tracks[0] = sampled(&recording.tracks[0], 2, &kept);
        let found = identify(&orbit(30.0), &recording, &IdentifyOptions::default()).unwrap();
        let mu = &found.constants[0];
        assert!(found.converged && found.samples == 84, "{found:?}");
        assert!(mu.standard_error.unwrap() < 0.05 && off(&found, &[("mu", 39.478)])[0].abs() < 4.5, "{found:?}");
    }
}

#[test]
fn angles_turn_within_gaps() {
    // Rotation with a gap of several turns.
    let mut recording = recorded(&pendulum(&[("w", 8.0)]), &[&[0.3, 9.0]], (8.0, 0.02), &[1e-3], 2);
    let kept: Vec<usize> = (0..401).filter(|k| k % 200 < 60).collect();
    let mut track = sampled(&recording.tracks[0], 1, &kept);
    track.q.iter_mut().skip(60).for_each(|q| *q -= 6.0 * std::f64::consts::TAU);
    recording.tracks[0] = track;
    let options = IdentifyOptions::new().segment(8.0);
    let found = identify(&pendulum(&[]), &recording, &options).unwrap();
    assert!(found.converged && off(&found, &[("w", 8.0)])[0].abs() < 4.5, "{found:?}");
    assert!((found.over_noise - 1.0).abs() < 0.2 && found.segments == 1, "{found:?}");
}

#[test]
fn few_samples_of_many_trajectories_suffice() {
    let starts: Vec<Vec<f64>> = (0..30).map(|k| vec![0.1 * f64::from(k) - 1.5, 0.4 * f64::from(k % 7) - 1.0]).collect();
    let starts: Vec<&[f64]> = starts.iter().map(Vec::as_slice).collect();
    let recording = recorded(&pendulum(&[("w", 8.0)]), &starts, (0.9, 0.3), &[1e-3], 5);
    assert!(recording.tracks.iter().all(|track| track.len() == 4));
    let found = identify(&pendulum(&[]), &recording, &IdentifyOptions::default()).unwrap();
    assert!(found.converged && off(&found, &[("w", 8.0)])[0].abs() < 4.5, "{found:?}");
    assert!(found.constants[0].standard_error.unwrap() < 0.02, "{found:?}");
}

#[test]
fn repeated_times_are_repeated_measurements() {
    let truth = pendulum(&[("w", 8.0)]);
    let once = recorded(&truth, &[&[1.5, 0.0]], (6.0, 0.05), &[0.0], 1);
    let thrice: Vec<usize> = (0..3 * once.tracks[0].len()).map(|k| k / 3).collect();
    let mut recording = Recording { tracks: vec![sampled(&once.tracks[0], 1, &thrice)], ..once.clone() };
    noise(&mut recording, &[1e-2], 4);
    let found = identify(&pendulum(&[]), &recording, &IdentifyOptions::default()).unwrap();
    assert!(found.converged && found.samples == 363 && off(&found, &[("w", 8.0)])[0].abs() < 4.5, "{found:?}");
    let mut single = once;
    noise(&mut single, &[1e-2], 5);
    let single = identify(&pendulum(&[]), &single, &IdentifyOptions::default()).unwrap();
    let ratio = single.constants[0].standard_error.unwrap() / found.constants[0].standard_error.unwrap();
    assert!((1.4..2.2).contains(&ratio), "{ratio}");
}

#[test]
fn errors_of_rows_weigh_them() {
    let mut recording = recorded(&pendulum(&[("w", 8.0)]), &[&[1.5, 0.0]], (6.0, 0.02), &[0.0], 1);
    let errors: Vec<f64> = (0..recording.tracks[0].len()).map(|k| if k % 3 == 0 { 1e-3 } else { 3e-2 }).collect();
    let mut drawn = Recording {
        tracks: vec![sampled(&recording.tracks[0], 1, &(0..errors.len()).collect::<Vec<_>>())],
        ..recording.clone()
    };
    noise(&mut drawn, &[1.0], 9);
    for ((q, drawn), error) in recording.tracks[0].q.iter_mut().zip(&drawn.tracks[0].q).zip(&errors) {
        *q += (drawn - *q) * error;
    }
    let weighed = IdentifyOptions::new().errors(vec![errors.clone()]);
    let found = identify(&pendulum(&[]), &recording, &weighed).unwrap();
    let plain = identify(&pendulum(&[]), &recording, &IdentifyOptions::default()).unwrap();
    let error = |found: &Identified| found.constants[0].standard_error.unwrap();
    assert!(found.converged && error(&found) < error(&plain) / 5.0, "{found:?} {plain:?}");
    assert!(off(&found, &[("w", 8.0)])[0].abs() < 4.5 && (found.over_noise - 1.0).abs() < 0.15, "{found:?}");
    for wrong in [vec![vec![1e-3; 3]], vec![errors.iter().map(|x| -x).collect()], vec![vec![f64::NAN; errors.len()]]] {
        let refused = identify(&pendulum(&[]), &recording, &IdentifyOptions::new().errors(wrong));
        assert!(matches!(refused, Err(IdentifyError::Errors { .. })));
    }
}

#[test]
fn every_trajectory_has_its_own_noise() {
    let truth = pendulum(&[("w", 8.0)]);
    let (mut squares, mut errors) = (Vec::new(), [0.0; 2]);
    for seed in 0..6 {
        let mut recording = recorded(&truth, &[&[1.5, 0.0], &[-1.0, 1.0]], (6.0, 0.02), &[1e-3], seed);
        let calm = Recording { tracks: recording.tracks[..1].to_vec(), ..recording.clone() };
        let mut loud = Recording { tracks: recording.tracks.split_off(1), ..recording.clone() };
        noise(&mut loud, &[3e-2], seed + 50);
        recording.tracks.extend(loud.tracks);
        let both = identify(&pendulum(&[]), &recording, &IdentifyOptions::default()).unwrap();
        let alone = identify(&pendulum(&[]), &calm, &IdentifyOptions::default()).unwrap();
        squares.push(off(&both, &[("w", 8.0)])[0].powi(2));
        errors[0] += both.constants[0].standard_error.unwrap();
        errors[1] += alone.constants[0].standard_error.unwrap();
    }
    assert!(errors[0] < 1.15 * errors[1], "{errors:?}");
    assert!(squares.iter().all(|square| *square < 16.0), "{squares:?}");
}

#[test]
fn motion_that_stands_still_explains_nothing() {
    for sigma in [0.0, 1e-3] {
        let mut recording = recorded(&damped(2.0, 0.5), &[&[0.0, 0.0]], (4.0, 0.02), &[0.0], 0);
        recording.tracks[0].q.iter_mut().for_each(|q| *q = 0.3);
        noise(&mut recording, &[sigma], 3);
        let found = identify(&damped(2.0, 0.5), &recording, &IdentifyOptions::default()).unwrap();
        assert!(!found.explained && found.obstacles.len() == 1 && found.obstacles[0].starts_with('x'), "{found:?}");
    }
}

#[test]
fn a_delay_beside_a_force_is_found() {
    let form = |pairs: &[(&str, f64)]| {
        let text = r#"{"name": "swing", "lagrangian": "m*x_dot^2/2 - k*x^2/2", "dissipation": "c*x_dot^2/2",
            "coordinates": [{"name": "x", "bounds": [-2, 2], "velocity_bounds": [-2, 2]}],
            "parameters": {"m": 1.2, "k": 15, "c": 0.3}}"#;
        described(text, pairs)
    };
    let model = form(&[("m", 1.0), ("k", 20.0), ("c", 0.4)]).build().unwrap();
    let push = |t: f64| 2.0 * (3.1 * t).sin() + 1.5 * (5.3 * t + 1.0).cos();
    let force = |t: f64, _: &[f64], _: &[f64], force: &mut [f64]| force[0] = push(t);
    let motion = Driven::new(&*model, &force)
        .rollout(&[0.4], &[0.0], &RolloutOptions::reference(10.0, 0.01))
        .complete()
        .unwrap();
    for (seed, late) in [(0, 2), (1, 2), (2, 5), (3, 0)] {
        // Every second sample, read `late` steps later.
        let at: Vec<usize> = (late..motion.t.len()).step_by(2).collect();
        let times: Vec<f64> = at.iter().map(|&k| motion.t[k]).collect();
        let q = at.iter().map(|&k| motion.q[k - late]).collect();
        let force = times.iter().map(|t| push(*t)).collect();
        let track = RecordedTrajectory { name: "run".into(), times, q, v: vec![], a: vec![], force };
        let mut recording = Recording { coordinates: vec!["x".into()], periodic: vec![false], tracks: vec![track] };
        noise(&mut recording, &[1e-3], seed);
        let options = IdentifyOptions::new().delays(["x"]).between(Between::Cubic);
        let found = identify(&form(&[]), &recording, &options).unwrap();
        // A force that is held lags by half a sample, which is equivalent to a delay.
        let any = identify(&form(&[]), &recording, &IdentifyOptions { between: None, ..options }).unwrap();
        for (found, most) in [(found, 1e-3), (any, 0.02)] {
            let delay = &found.sensors[0];
            let z = (delay.value - 0.01 * late as f64) / delay.standard_error.unwrap();
            assert!(found.converged && z.abs() < 4.5 && delay.standard_error.unwrap() < most, "{late}: {found:?}");
            let off = off(&found, &[("m", 1.0), ("k", 20.0), ("c", 0.4)]);
            assert!(off.iter().all(|off| off.abs() < 4.5), "{late}: {found:?}");
        }
    }
}
