use super::*;
use crate::recording::{RecordedTrajectory, Recording};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// `0.5 sin 4t` at 100 Hz with noise, with velocities times a factor.
fn swing(sigma: f64, rate: f64, velocity_factor: Option<f64>) -> Recording {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut noisy = |x: f64| x + sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng);
    let times: Vec<f64> = (0..2000).map(|k| f64::from(k) / rate).collect();
    let q = times.iter().map(|t| noisy(0.5 * (4.0 * t).sin())).collect();
    let v = |factor: f64| times.iter().map(|t| factor * 2.0 * (4.0 * t).cos()).collect();
    let v = velocity_factor.map(v).unwrap_or_default();
    let track = RecordedTrajectory { name: "swing".into(), times, q, v, a: vec![], force: vec![] };
    Recording { coordinates: vec!["x".into()], periodic: vec![true], tracks: vec![track] }
}

fn look(recording: Recording) -> Survey {
    survey(&LoadedRecording::from(recording), &SurveyOptions::default()).unwrap()
}

#[test]
fn a_swing_is_described() {
    let found = look(swing(1e-3, 100.0, None));
    let c = &found.coordinates[0];
    assert!((c.noise / 1e-3 - 1.0).abs() < 0.1 && c.noise_resolved);
    assert!((c.velocity / 2.0 * 2f64.sqrt() - 1.0).abs() < 0.02, "{}", c.velocity);
    assert!((c.acceleration / 8.0 * 2f64.sqrt() - 1.0).abs() < 0.02, "{}", c.acceleration);
    // The period of the sine, pi/2 s, sampled 157 times.
    assert!((c.samples_per_period - 157.0).abs() < 4.0, "{}", c.samples_per_period);
    assert_eq!((found.targets, found.warnings.len(), found.suspicious_count), (Targets::Smoothed, 0, 0));
    assert!(found.held_out_text.contains("last 400 samples"));
    let json: serde_json::Value = serde_json::to_value(&found).unwrap();
    assert_eq!((&json["targets"], &json["tracks"][0]["samples"]), (&"smoothed".into(), &2000.into()));
}

/// A drift in addition to the oscillation affects the velocity, not the period.
#[test]
fn a_drifting_swing_has_the_root_mean_square_of_all_its_velocity() {
    let mut recording = swing(1e-4, 100.0, None);
    let track = &mut recording.tracks[0];
    track.q.iter_mut().zip(&track.times).for_each(|(q, t)| *q += 1.5 * t);
    recording.periodic[0] = false;
    let c = &look(recording).coordinates[0];
    assert!((c.velocity / (1.5_f64.powi(2) + 2.0).sqrt() - 1.0).abs() < 0.02, "{}", c.velocity);
    assert!((c.velocity_deviation / 2f64.sqrt() - 1.0).abs() < 0.02, "{}", c.velocity_deviation);
    assert!((c.samples_per_period - 157.0).abs() < 4.0, "{}", c.samples_per_period);
}

#[test]
fn loud_noise_calls_for_shooting() {
    let found = look(swing(0.3, 100.0, None));
    assert!(found.coordinates[0].acceleration_error_relative > 0.1, "{:?}", found.coordinates[0]);
    assert_eq!(found.targets, Targets::Motion);
}

#[test]
fn noisy_forces_are_learned_from_and_exact_ones_are_not() {
    let driven = |sigma: f64, force: fn(usize) -> f64| {
        let mut recording = swing(sigma, 100.0, None);
        let track = &mut recording.tracks[0];
        track.force = (0..track.q.len()).map(force).collect();
        look(recording).targets
    };
    let smooth = |k: usize| (0.01 * k as f64).sin();
    let noisy = |k: usize| (0.01 * k as f64).sin() + 0.3 * (1e4 * (k as f64).sin()).sin();
    assert_eq!(driven(1e-3, noisy), Targets::Forces);
    assert_eq!(driven(1e-3, smooth), Targets::Smoothed);
    assert_eq!(driven(0.3, smooth), Targets::Motion);
    // A force that never changes could as well be part of L.
    assert_eq!(driven(1e-3, |_| 1.0), Targets::Smoothed);
}

#[test]
fn coarse_sampling_is_told() {
    let found = look(swing(1e-4, 8.0, None));
    assert!(found.warnings.iter().any(|w| w.contains("samples per period")), "{:?}", found.warnings);
}

#[test]
fn wrong_units_are_noticed() {
    assert_eq!(look(swing(1e-4, 100.0, Some(1.0))).warnings, [""; 0]);
    for (factor, hint) in
        [(180.0 / std::f64::consts::PI, "degrees"), (-1.0, "sign"), (0.01, "per sample"), (1.3, "is 1.30")]
    {
        let warnings = look(swing(1e-4, 100.0, Some(factor))).warnings;
        assert!(warnings.len() == 1 && warnings[0].contains(hint), "{factor}: {warnings:?}");
    }
}

#[test]
fn fast_turns_are_guesses() {
    let mut recording = swing(1e-4, 100.0, None);
    for (k, q) in recording.tracks[0].q.iter_mut().enumerate() {
        *q += if k >= 1000 { 2.5 } else { 0.0 };
    }
    let found = look(recording);
    assert_eq!(found.coordinates[0].first_ambiguous, Some(("swing".to_string(), 1001)));
    assert!(found.suspicious.iter().any(|s| s.kind == Kind::Jump && s.row == 1001), "{:?}", found.suspicious);
}
