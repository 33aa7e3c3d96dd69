//! A seven-joint arm learned from one log of 20 s: by its torques, and by its accelerations beside.

use super::arm::{Faults, JOINTS, Motion, RATE, log, mass_matrix, names, torques};
use lnn::lagrangian::{EulerLagrange, Request, Terms, inverse_dynamics};
use lnn::linalg::{Workspace, eigenvalues};
use lnn::network::{NetworkLagrangian, Structure};
use lnn::pipeline::Fit;
use lnn::recording::Targets;
use std::path::Path;
use std::time::Instant;

/// States of which forces are asked at once, and how often.
const STATES: (usize, usize) = (20_000, 5);

/// The motion that was held out, without noise: positions, velocities, accelerations, torques.
fn held_out(seed: u64, seconds: f64) -> [Vec<f64>; 4] {
    let motion = Motion::new(seed);
    let mut all: [Vec<f64>; 4] = Default::default();
    for k in (0.8 * seconds * RATE) as usize..(seconds * RATE) as usize {
        let [q, v, a] = motion.at(k as f64 / RATE);
        let columns = [q, v, a, torques(&q, &v, &a)];
        all.iter_mut().zip(columns).for_each(|(all, column)| all.extend(column));
    }
    all
}

/// Squared error of the torque of every joint over its variance.
fn errors(network: &NetworkLagrangian<f64>, [q, v, a, torque]: &[Vec<f64>; 4]) -> Vec<f64> {
    let found = inverse_dynamics(network, q, v, a).expect("a finite model").external;
    let of = |i: usize| {
        let column = || torque.iter().skip(i).step_by(JOINTS);
        let count = column().count() as f64;
        let mean = column().sum::<f64>() / count;
        let variance = column().map(|x| (x - mean).powi(2)).sum::<f64>();
        let square = found.iter().skip(i).step_by(JOINTS).zip(column()).map(|(f, x)| (f - x).powi(2)).sum::<f64>();
        square / variance
    };
    (0..JOINTS).map(of).collect()
}

/// Mean of every `M_ii` over the exact one, and the least eigenvalue of `M`, over the held-out states.
fn inertia(network: &NetworkLagrangian<f64>, [q, v, ..]: &[Vec<f64>; 4]) -> (Vec<f64>, f64) {
    let mut terms = Terms::default();
    network.terms(q, v, Request::MASS_MATRIX, &mut terms).expect("a finite model");
    let mut sums = [[0.0; 2]; JOINTS];
    for (mass, q) in terms.mass_matrix.chunks_exact(JOINTS * JOINTS).zip(q.chunks_exact(JOINTS)) {
        let exact = mass_matrix(q.try_into().expect("seven joints"));
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum = [sum[0] + mass[i * JOINTS + i], sum[1] + exact[i][i]];
        }
    }
    let mut values = vec![0.0; terms.mass_matrix.len() / JOINTS];
    eigenvalues(JOINTS, &terms.mass_matrix, &mut values, &mut Workspace::new()).expect("finite matrices");
    let least = values.into_iter().fold(f64::INFINITY, f64::min);
    (sums.map(|[found, exact]| found / exact).to_vec(), least)
}

/// Forces of known states and accelerations that one core gives in a second, in single precision.
fn rate(network: &NetworkLagrangian<f64>, states: usize) -> f64 {
    let network = network.cast::<f32>();
    let wave =
        |phase: f64| -> Vec<f32> { (0..states * JOINTS).map(|k| (0.37 * k as f64 + phase).sin() as f32).collect() };
    let [q, v, a] = [0.0, 1.0, 2.0].map(wave);
    let time = |_| {
        let start = Instant::now();
        inverse_dynamics(&network, &q, &v, &a).expect("a finite model");
        start.elapsed().as_secs_f64()
    };
    states as f64 / (0..STATES.1).map(time).fold(f64::INFINITY, f64::min)
}

/// Prints and returns rows `seed,learned from,joint,nmse,inertia`; `work` is the number of epochs, if not the usual one, and of threads.
pub fn compare(
    seeds: std::ops::Range<u64>,
    seconds: f64,
    folder: &Path,
    (epochs, threads): (Option<usize>, usize),
) -> Vec<String> {
    let mut rows = Vec::new();
    for seed in seeds {
        let file = folder.join(format!("arm{seed}.csv"));
        std::fs::write(&file, log(seconds, Faults::USUAL, seed)).expect("room for a log");
        let truth = held_out(seed, seconds);
        for targets in [Targets::Forces, Targets::Smoothed] {
            let [joints, torques] = ["q", "tau"].map(names);
            let fit = Fit::new(&file).targets(targets).threads(threads).columns(|columns| {
                columns.coords = joints.clone();
                (columns.periodic, columns.force, columns.time) = (joints, torques, Some("t".to_string()));
            });
            let fit = match targets {
                Targets::Forces => fit,
                _ => fit.structure(Structure::Mechanical).friction(true),
            };
            let start = Instant::now();
            let fitted = fit.configure(move |config| {
                if let Some(epochs) = epochs {
                    config.training.network.hidden = vec![8];
                    (config.training.phases[0].epochs, config.training.phases[0].t_max) = (epochs, epochs as f64);
                }
            });
            let report = fitted.run().expect("a fit");
            let seconds = start.elapsed().as_secs_f64();
            let (network, name) =
                (&report.network, if targets == Targets::Forces { "forces" } else { "accelerations" });
            let (errors, (inertia, least)) = (errors(network, &truth), inertia(network, &truth));
            let shown: Vec<String> = errors.iter().map(|e| format!("{:6.1}", 100.0 * e)).collect();
            println!(
                "seed {seed}, {name:13}: torques {} %, least eigenvalue of M {least:.1e}, {seconds:.0} s",
                shown.join("")
            );
            let shown: Vec<String> = inertia.iter().map(|m| format!("{m:6.2}")).collect();
            println!("  M_ii over the exact one {}", shown.join(""));
            if targets == Targets::Forces {
                let states = if epochs.is_some() { STATES.0 / 100 } else { STATES.0 };
                println!("  {:.0} inverse dynamics a second and core", rate(network, states));
            }
            let joints = errors.iter().zip(&inertia).enumerate();
            rows.extend(joints.map(|(i, (e, m))| format!("{seed},{name},{},{e:.5},{m:.4}", i + 1)));
        }
    }
    rows
}
