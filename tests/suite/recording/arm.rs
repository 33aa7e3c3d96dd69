//! Runs of a two-link arm of very different pace, one of them whirling: no run chooses the windows of the others.

use lnn::recording::{RecordedTrajectory, Recording, SmoothOptions, Smoothing};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

const SIGMA: f64 = 5e-3;
const STEP: f64 = 0.01;
const SAMPLES: usize = 201;
const RUNS: usize = 40;
/// The run that whirls, by the speed of its elbow in rad/s.
const WHIRLING: (usize, f64) = (3, 60.0);

/// Torques of one run: sums of three sines, `(joint, sine)` of amplitude, frequency and phase.
type Torques = [[[f64; 3]; 3]; 2];

/// `(v, a)` of an arm with point masses of 1.5 and 0.4 kg at the ends of links of 0.5 and 0.3 m, and some friction.
fn derivative(torques: &Torques, t: f64, [_, q2, v1, v2]: [f64; 4]) -> [f64; 4] {
    let (a, b, c) = (1.9 * 0.25, 0.4 * 0.09, 0.4 * 0.15);
    let torque = |joint: usize| -> f64 {
        torques[joint].iter().map(|[size, f, phase]| size * (TAU * f * t + phase).sin()).sum()
    };
    let (m11, m12, m22) = (a + b + 2.0 * c * q2.cos(), b + c * q2.cos(), b);
    let coupling = c * q2.sin();
    let r1: f64 = torque(0) + coupling * (2.0 * v1 * v2 + v2 * v2) - 0.05 * v1;
    let r2: f64 = torque(1) - coupling * v1 * v1 - 0.005 * v2;
    let determinant = m11 * m22 - m12 * m12;
    [v1, v2, (m22 * r1 - m12 * r2) / determinant, (m11 * r2 - m12 * r1) / determinant]
}

/// Noisy positions and exact accelerations of the runs, `(samples, 2)` each.
fn runs() -> Vec<(RecordedTrajectory, Vec<f64>)> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut run = |number: usize| {
        let pace = rng.random_range(0.5..4.0);
        let torques: Torques = [2.0, 0.25].map(|size| {
            std::array::from_fn(|_| {
                let [size, f] = [size * pace * pace * rng.random_range(0.3..1.0), pace * rng.random_range(0.3..1.5)];
                [size, f, rng.random_range(0.0..TAU)]
            })
        });
        let mut y = [1.0, 1.0, pace, pace].map(|scale| scale * rng.random_range(-1.0..1.0));
        if number == WHIRLING.0 {
            y[3] = WHIRLING.1;
        }
        let (mut q, mut a) = (Vec::new(), Vec::new());
        let times: Vec<f64> = (0..SAMPLES).map(|k| k as f64 * STEP).collect();
        for t in &times {
            q.extend(y[..2].iter().map(|x| x + SIGMA * Distribution::<f64>::sample(&StandardNormal, &mut rng)));
            a.extend_from_slice(&derivative(&torques, *t, y)[2..]);
            for part in 0..5 {
                let (h, t) = (STEP / 5.0, t + f64::from(part) * STEP / 5.0);
                let moved = |by: [f64; 4], h: f64| std::array::from_fn(|k| y[k] + h * by[k]);
                let k1 = derivative(&torques, t, y);
                let k2 = derivative(&torques, t + h / 2.0, moved(k1, h / 2.0));
                let k3 = derivative(&torques, t + h / 2.0, moved(k2, h / 2.0));
                let k4 = derivative(&torques, t + h, moved(k3, h));
                y = std::array::from_fn(|k| y[k] + h / 6.0 * (k1[k] + 2.0 * (k2[k] + k3[k]) + k4[k]));
            }
        }
        (RecordedTrajectory { name: format!("run {number}"), times, q, v: vec![], a: vec![], force: vec![] }, a)
    };
    (0..RUNS).map(&mut run).collect()
}

fn recording<'a>(tracks: impl IntoIterator<Item = &'a RecordedTrajectory>) -> Recording {
    let coordinates = ["shoulder", "elbow"].map(String::from).to_vec();
    Recording { coordinates, periodic: vec![false; 2], tracks: tracks.into_iter().cloned().collect() }
}

/// Root mean square of every other number from `i` on.
fn size(values: impl Iterator<Item = f64>, i: usize) -> f64 {
    let column: Vec<f64> = values.skip(i).step_by(2).collect();
    (column.iter().map(|x| x * x).sum::<f64>() / column.len() as f64).sqrt()
}

/// Errors of the accelerations of coordinate `i` on a run, away from its ends.
fn error(smoothing: &Smoothing, (track, exact): &(RecordedTrajectory, Vec<f64>), i: usize) -> f64 {
    let found = smoothing.apply(track).unwrap().a;
    size((40..2 * SAMPLES - 40).map(|k| found[k] - exact[k]), i)
}

#[test]
fn a_whirling_run_does_not_choose_for_the_others() {
    let all = runs();
    let parts = [&all[..10], &all[..25], &all[..]];
    let chosen = parts.map(|part| {
        let recording = recording(part.iter().map(|(track, _)| track));
        Smoothing::choose(&recording, &SmoothOptions::default()).unwrap()
    });
    for i in 0..2 {
        for (smoothing, part) in chosen.iter().zip(parts) {
            let quality = smoothing.coordinates[i].quality;
            let exact = size(part.iter().flat_map(|(_, a)| a.iter().copied()), i);
            println!("{i}: {} runs, window {}, rms a {} of {exact}", part.len(), quality.window, quality.acceleration);
            let share = quality.acceleration / exact;
            assert!((0.9..1.1).contains(&share), "rms a {} of {exact}", quality.acceleration);
        }
        let windows = chosen.each_ref().map(|smoothing| smoothing.coordinates[i].quality.window as f64);
        let [least, most] = [f64::min, f64::max].map(|of| windows.into_iter().reduce(of).unwrap());
        assert!(most < 1.5 * least, "windows of coordinate {i}: {windows:?}");
        // No other run is known much worse than by the one window that suits it best.
        let constant: Vec<Smoothing> = (7..60)
            .step_by(4)
            .map(|window| {
                let options = SmoothOptions { window: Some(window), ..SmoothOptions::default() };
                Smoothing::choose(&recording(all.iter().map(|(track, _)| track)), &options).unwrap()
            })
            .collect();
        for (_, run) in all.iter().enumerate().filter(|(number, _)| *number != WHIRLING.0) {
            let best = constant.iter().map(|smoothing| error(smoothing, run, i)).fold(f64::INFINITY, f64::min);
            let found = error(&chosen[2], run, i);
            println!("{i} {}: {:.2} of the best", run.0.name, found / best);
            assert!(found < 2.2 * best, "{} coordinate {i}: {found}, {best} by the best window", run.0.name);
        }
    }
}
