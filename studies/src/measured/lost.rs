//! Lost samples: a cart with a pendulum under a known force at 50 Hz, with 1 % of noise, a clock that jitters and rows that are missing,
//! learned by a fit with the defaults; its mass matrix beside the true one.

use super::determination::CASES;
use super::{Scale, THREADS};
use lnn::lagrangian::EulerLagrange;
use lnn::pipeline::Fit;
use lnn::random::{RandomGenerator, RngStream};
use lnn::recording::{RecordedTrajectory, Recording};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::time::Instant;

/// Time between the steps of the exact motion, and how many of them are between two samples.
const FINE: f64 = 0.002;
const STEPS: usize = 10;
/// Standard deviation of the clock, in steps: a tenth of the time between two samples.
const JITTER: f64 = 1.0;
/// Share of the rows that are missing.
const LOST: f64 = 0.03;
/// Noise over the spread of each coordinate.
const NOISE: f64 = 0.01;

/// What is left of exact motion of fine steps when it is sampled so.
fn sampled(exact: &Recording, seed: u64) -> Recording {
    let rng = &mut RngStream::Trajectories.generator(seed);
    let n = exact.n();
    let all = || exact.tracks.iter().flat_map(|track| track.q.iter());
    let spread = |i: usize| {
        let own = || all().skip(i).step_by(n);
        let count = own().count() as f64;
        let mean = own().sum::<f64>() / count;
        (own().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()
    };
    let sigma: Vec<f64> = (0..n).map(|i| NOISE * spread(i)).collect();
    let draw = |rng: &mut RandomGenerator| -> f64 { StandardNormal.sample(rng) };
    let track = |track: &RecordedTrajectory| {
        let mut kept = RecordedTrajectory { times: vec![], q: vec![], force: vec![], ..track.clone() };
        let mut last = None;
        for k in (0..track.len()).step_by(STEPS) {
            let at = (k as f64 + JITTER * draw(rng)).round().clamp(0.0, (track.len() - 1) as f64) as usize;
            if rng.random::<f64>() < LOST || last.is_some_and(|last| at <= last) {
                continue;
            }
            last = Some(at);
            kept.times.push(track.times[at]);
            kept.q.extend((0..n).map(|i| track.q[at * n + i] + sigma[i] * draw(rng)));
            kept.force.extend_from_slice(&track.force[at * n..(at + 1) * n]);
        }
        kept
    };
    Recording { tracks: exact.tracks.iter().map(track).collect(), ..exact.clone() }
}

/// Prints and returns rows `seed,entry,error,seconds`: the mean mass matrix over the exact states, entry by entry, beside the true one.
pub fn compare(seeds: std::ops::Range<u64>, (runs, seconds): (usize, f64), scale: Option<Scale>) -> Vec<String> {
    let case = CASES.iter().find(|case| case.name == "cart-pendulum with a known force").expect("a case of this name");
    let mut rows = Vec::new();
    for seed in seeds {
        let exact = case.without_noise(FINE).recording(runs, seconds, seed);
        let recording = sampled(&exact, seed);
        let started = Instant::now();
        let mut fit = Fit::recording(recording).friction(true).seed(seed).threads(THREADS);
        if let Some(scale) = scale {
            fit = fit.configure(move |config| {
                config.training.network.hidden = scale.hidden.to_vec();
                for phase in &mut config.training.phases {
                    phase.epochs = scale.epochs.unwrap_or(phase.epochs);
                    phase.t_max = phase.epochs as f64;
                }
                if let Some(shooting) = &mut config.shooting {
                    shooting.epochs = scale.shooting_epochs;
                }
            });
        }
        let report = fit.run().expect("a recording that can be learned from");
        let took = started.elapsed().as_secs_f64();
        let states: Vec<f64> =
            exact.tracks.iter().flat_map(|track| track.q.chunks_exact(2).step_by(50)).flatten().copied().collect();
        let rest = vec![0.0; states.len()];
        let learned = report.network.mass_matrix(&states, &rest).expect("a mass matrix");
        let truth = case.exact().mass_matrix(&states, &rest).expect("a mass matrix");
        let mut line = format!("seed {seed}: {took:.0} s");
        for (name, e) in [("M11", 0), ("M12", 1), ("M22", 3)] {
            // Relative to the root of the two masses, for M12 passes 0.
            let squares = learned.chunks_exact(4).zip(truth.chunks_exact(4));
            let squares = squares.map(|(learned, truth)| {
                let [first, second] = [truth[if e == 3 { 3 } else { 0 }], truth[if e == 0 { 0 } else { 3 }]];
                (learned[e] - truth[e]).powi(2) / (first * second)
            });
            let error = (squares.sum::<f64>() / (states.len() / 2) as f64).sqrt();
            line += &format!(", {name} off by {:.1} %", 100.0 * error);
            rows.push(format!("{seed},{name},{error},{took:.1}"));
        }
        println!("{line}");
    }
    rows
}
