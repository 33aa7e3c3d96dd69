//! A seven-joint arm learned from one log of 20 s: by its torques, and by its accelerations beside; and identified by them, its rows of
//! Denavit and Hartenberg being known.

use super::arm::{Faults, JOINTS, Motion, RATE, constants, log, mass_matrix, names, torques};
use lnn::identification::{IdentifyOptions, identify};
use lnn::lagrangian::{EulerLagrange, InverseDynamics, Request, SystemInstance, Terms};
use lnn::linalg::{Workspace, eigenvalues};
use lnn::network::Structure;
use lnn::pipeline::Fit;
use lnn::pipeline::parse_system;
use lnn::recording::{Columns, LoadedRecording, Targets};
use lnn::scalar::Scalar;
use std::borrow::Cow;
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
fn errors(network: &dyn EulerLagrange<f64>, [q, v, a, torque]: &[Vec<f64>; 4]) -> Vec<f64> {
    let found = InverseDynamics::of(network, q, v, a).expect("a finite model").external;
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
fn inertia(network: &dyn EulerLagrange<f64>, [q, v, ..]: &[Vec<f64>; 4]) -> (Vec<f64>, f64) {
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

/// Forces of known states and accelerations that one core gives in a second.
fn rate<S: Scalar>(model: &dyn EulerLagrange<S>, states: usize) -> f64 {
    let wave =
        |phase: f64| -> Vec<S> { (0..states * JOINTS).map(|k| S::of_f64((0.37 * k as f64 + phase).sin())).collect() };
    let [q, v, a] = [0.0, 1.0, 2.0].map(wave);
    let time = |_| {
        let start = Instant::now();
        InverseDynamics::of(model, &q, &v, &a).expect("a finite model");
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
            let fit = Fit::new(&file).options(|options| options.targets = Some(targets)).threads(threads).columns(
                |columns| {
                    columns.coords = joints.clone();
                    (columns.periodic, columns.force, columns.time) = (joints, torques, Some("t".to_string()));
                },
            );
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
                println!(
                    "  {:.0} inverse dynamics a second and core, single precision",
                    rate(&network.cast::<f32>(), states)
                );
            }
            let joints = errors.iter().zip(&inertia).enumerate();
            rows.extend(joints.map(|(i, (e, m))| format!("{seed},{name},{},{e:.5},{m:.4}", i + 1)));
        }
    }
    rows
}

/// Identifies the arm by its rows from the first 16 s of 20; prints what the held-out motion says of it, and returns rows
/// `seed,joint,nmse,inertia`.
pub fn links(seeds: std::ops::Range<u64>, seconds: f64, folder: &Path, states: usize) -> Vec<String> {
    let truth = constants();
    let mut rows = Vec::new();
    for seed in seeds {
        let file = folder.join(format!("links{seed}.csv"));
        let text = log(seconds, Faults::USUAL, seed);
        let before: Vec<&str> = text
            .lines()
            .filter(|line| line.split(',').next().and_then(|t| t.parse().ok()).is_none_or(|t: f64| t < 0.8 * seconds))
            .collect();
        std::fs::write(&file, before.join("\n")).expect("room for a log");
        let [coords, force] = ["q", "tau"].map(names);
        let columns = Columns { coords, force, time: Some("t".to_string()), ..Columns::default() };
        let reading = LoadedRecording::read(&[file], &columns).expect("a log");
        let system = parse_system(include_str!("../../../examples/systems/seven_joints.toml")).expect("a system");
        let arm = SystemInstance::<f64>::new(Cow::Owned(system.clone()), &[]).expect("defaults");
        let start = Instant::now();
        let found = identify(&arm, &reading.recording, &IdentifyOptions::default()).expect("forces");
        let seconds_taken = start.elapsed().as_secs_f64();
        let values: Vec<(String, String)> =
            found.constants.iter().map(|c| (c.symbol.clone(), c.value.to_string())).collect();
        let model =
            SystemInstance::<f64>::new(Cow::Owned(system.clone()), &values).expect("values").build().expect("a model");
        let unseen = held_out(seed, seconds);
        let (errors, (inertia, least)) = (errors(model.as_ref(), &unseen), inertia(model.as_ref(), &unseen));
        let exact = |name: &str| truth.iter().find(|(known, _)| known == name).map_or(f64::NAN, |(_, x)| *x);
        let mut off: Vec<f64> = found
            .combinations
            .iter()
            .map(|sum| {
                let exact: f64 = sum.terms.iter().map(|(name, factor)| factor * exact(name)).sum();
                (sum.value - exact).abs() / sum.standard_error
            })
            .collect();
        off.sort_by(f64::total_cmp);
        let within = off.iter().filter(|x| **x < 2.0).count();
        let shown: Vec<String> = errors.iter().map(|e| format!("{:8.3}", 100.0 * e)).collect();
        println!("seed {seed}, links: torques {} %, {seconds_taken:.1} s", shown.join(""));
        let shown: Vec<String> = inertia.iter().map(|m| format!("{m:7.3}")).collect();
        println!("  M_ii over the exact one {}, least eigenvalue of M {least:.1e}", shown.join(""));
        println!(
            "  {} sums of constants, {within} within two standard errors of the truth, the farthest {:.1}",
            off.len(),
            off.last().copied().unwrap_or(0.0)
        );
        let single = SystemInstance::<f32>::new(Cow::Owned(system), &values).expect("values").build().expect("a model");
        println!(
            "  {:.0} inverse dynamics a second and core, {:.0} in single precision",
            rate(model.as_ref(), states),
            rate(single.as_ref(), states)
        );
        let joints = errors.iter().zip(&inertia).enumerate();
        rows.extend(joints.map(|(i, (e, m))| format!("{seed},{},{e:.6},{m:.4}", i + 1)));
    }
    rows
}
