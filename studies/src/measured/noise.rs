//! Fifty made trajectories of a double pendulum, 5 s at 100 Hz, positions with 1 % of noise: what is learned from exact
//! accelerations, from smoothed ones and through the motion.

use super::{Scale, learned};
use lnn::analysis::acceleration_errors;
use lnn::data::{PrepareOptions, RecordingSplit};
use lnn::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use lnn::random::{RandomGenerator, RngStream};
use lnn::recording::{RecordedTrajectory, Recording, Targets};
use lnn::rollout::{RolloutOptions, Trajectory, rollout};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::time::Instant;

/// Noise over the standard deviation of each coordinate.
const NOISE: f64 = 0.01;

/// Motion from a random start at moderate energy.
fn motion(exact: &dyn EulerLagrange<f64>, rng: &mut RandomGenerator) -> Trajectory<f64> {
    let mut draw = |size: f64| [0, 1].map(|_| rng.random_range(-size..size));
    let (q, v) = (draw(1.5), draw(1.0));
    let options = RolloutOptions::reference(4.99, 0.01).energy(false);
    rollout(exact, &q, &v, &options).complete().expect("a double pendulum moves on")
}

fn accelerations(exact: &dyn EulerLagrange<f64>, q: &[f64], v: &[f64]) -> Vec<f64> {
    let mut terms = Terms::default();
    exact.terms(q, v, Request::ACCELERATION, &mut terms).expect("its mass matrix is regular");
    terms.acceleration
}

/// Exact states with their accelerations, and positions alone with noise.
fn recordings(exact: &dyn EulerLagrange<f64>, count: usize, seed: u64) -> [Recording; 2] {
    let rng = &mut RngStream::Training(0).generator(seed);
    let motions: Vec<_> = (0..count).map(|_| motion(exact, rng)).collect();
    let sigma = [0, 1].map(|i| {
        let all = || motions.iter().flat_map(|m| m.q.iter().skip(i).step_by(2));
        let size = all().count() as f64;
        let mean = all().sum::<f64>() / size;
        NOISE * (all().map(|q| (q - mean).powi(2)).sum::<f64>() / size).sqrt()
    });
    let track = |k: usize, m: &Trajectory<f64>| RecordedTrajectory {
        name: format!("run {k}"),
        times: m.t.clone(),
        q: m.q.clone(),
        v: m.v.clone(),
        a: accelerations(exact, &m.q, &m.v),
        force: vec![],
    };
    let clean: Vec<RecordedTrajectory> = motions.iter().enumerate().map(|(k, m)| track(k, m)).collect();
    let noisy = clean.iter().map(|track| {
        let moved = |(k, q): (usize, &f64)| q + sigma[k % 2] * Distribution::<f64>::sample(&StandardNormal, rng);
        let q = track.q.iter().enumerate().map(moved).collect();
        RecordedTrajectory { q, v: vec![], a: vec![], ..track.clone() }
    });
    let noisy = noisy.collect();
    let coordinates = ["theta1", "theta2"].map(String::from).to_vec();
    [clean, noisy].map(|tracks| Recording { coordinates: coordinates.clone(), periodic: vec![true; 2], tracks })
}

/// Prints and returns rows `seed,learned from,error,seconds`: the mean of `|a - exact|` over that of `|exact|`, on the states
/// of trajectories that nobody has seen.
pub fn compare(count: usize, seeds: std::ops::Range<u64>, scale: Scale) -> Vec<String> {
    let system: SystemInstance<f64> = SystemInstance::named("double-pendulum", &[]).expect("the defaults are valid");
    let exact = system.build().expect("the defaults are valid");
    let mut rows = Vec::new();
    for seed in seeds {
        let [clean, noisy] = recordings(exact.as_ref(), count, seed);
        let rng = &mut RngStream::Test.generator(seed);
        let fresh: Vec<_> = (0..count.div_ceil(5)).map(|_| motion(exact.as_ref(), rng)).collect();
        let q: Vec<f64> = fresh.iter().flat_map(|m| m.q.iter().copied()).collect();
        let v: Vec<f64> = fresh.iter().flat_map(|m| m.v.iter().copied()).collect();
        let size = accelerations(exact.as_ref(), &q, &v).iter().map(|a| a.abs()).sum::<f64>() / q.len() as f64;
        let mut try_one = |name: &str, recording: &Recording, targets: Targets| {
            let start = Instant::now();
            let preparation = PrepareOptions { seed, ..PrepareOptions::default() };
            let measured = RecordingSplit::new(recording, &preparation).expect("long trajectories");
            let model = learned(&measured, false, targets, scale);
            let errors = acceleration_errors(exact.as_ref(), &model, &q, &v);
            let mean = errors.iter().map(|e| e.mean).sum::<f64>() / errors.len() as f64;
            let (error, seconds) = (mean / size, start.elapsed().as_secs_f64());
            println!("  seed {seed}: {name:40} {:6.2} % of the accelerations, {seconds:.0} s", 100.0 * error);
            rows.push(format!("{seed},{name},{error},{seconds:.1}"));
        };
        try_one("exact accelerations", &clean, Targets::Measured);
        try_one("accelerations smoothed from noise", &noisy, Targets::Smoothed);
        try_one("noisy motion", &noisy, Targets::Motion);
    }
    rows
}
