//! Constants of known forms from made motion, of which the truth is known, and from real motion.
//!
//! `lnn-studies identify --part coverage` records double pendula with noise and counts how often the stated 90 % ranges hold the
//! truth, seeds 0 to 99; `--part duffing` identifies an oscillator from eight samples a period under a force that is held between the samples;
//! `--part arms` identifies recorded pendula of two and three arms (DynamicsLab, University of Washington) and predicts runs that were not
//! identified from, if `--arms DIRECTORY` or `../shared/data/multi-arm-pendulum` has their files.

#[allow(dead_code)]
#[path = "../../examples/arms.rs"]
mod arms;

use crate::setups::configured;
use crate::{ARMS, Outcome, ROOT};
use lnn::identification::{Between, Identified, IdentifyOptions, identify};
use lnn::lagrangian::SystemInstance;
use lnn::prelude::*;
use lnn::random::RngStream;
use lnn::recording::{RecordedTrajectory, Recording};
use lnn::rollout::{Driven, Motion, RolloutOptions, SampledForce};
use rand_distr::{Distribution, StandardNormal};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A system of the folder `examples/systems` with values of its parameters.
fn system(file: &str, given: &[(&str, f64)]) -> Outcome<SystemInstance<f64>> {
    configured(&std::fs::read_to_string(Path::new(ROOT).join("examples/systems").join(file))?, given)
}

fn options(constants: &[&str]) -> IdentifyOptions {
    IdentifyOptions::new().constants(constants.iter().copied()).threads(2)
}

fn normal(rng: &mut impl rand::Rng) -> f64 {
    StandardNormal.sample(rng)
}

const PENDULUM: [(&str, f64); 3] = [("m2", 0.6), ("l1", 0.8), ("l2", 1.3)];

/// Four runs of 3 s at 50 Hz, noise of 2 and 3 mrad: the constants with their errors.
fn pendulum(seed: u64) -> Outcome<Identified> {
    let given: Vec<(String, String)> = PENDULUM.iter().map(|(name, x)| (name.to_string(), x.to_string())).collect();
    let model = SystemInstance::<f64>::named("double-pendulum", &given)?.build()?;
    let mut rng = RngStream::Trajectories.generator(seed);
    let mut tracks = Vec::new();
    for start in [[1.2, 1.9, 0.0, 0.0], [-0.8, 0.4, 1.0, -2.0], [2.0, -0.5, 0.0, 1.0], [0.3, -1.4, -2.0, 0.0]] {
        let motion = model.rollout(&start[..2], &start[2..], 3.0, 0.02)?;
        let noisy = |(k, q): (usize, &f64)| q + [2e-3, 3e-3][k % 2] * normal(&mut rng);
        let q = motion.q.iter().enumerate().map(noisy).collect();
        tracks.push(RecordedTrajectory { name: "run".into(), times: motion.t, q, v: vec![], a: vec![], force: vec![] });
    }
    let coordinates = vec!["theta1".into(), "theta2".into()];
    let recording = Recording { coordinates, periodic: vec![true; 2], tracks };
    let form = SystemInstance::<f64>::named("double-pendulum", &[])?;
    Ok(identify(&form, &recording, &options(&PENDULUM.map(|(name, _)| name)))?)
}

/// How many of the stated 90 % ranges hold the truth.
fn coverage(seeds: u64) -> Outcome<()> {
    let (mut held, mut explained, started) = ([0; 3], 0, Instant::now());
    for seed in 0..seeds {
        let found = pendulum(seed)?;
        explained += usize::from(found.explained);
        for (held, (constant, (_, truth))) in held.iter_mut().zip(found.constants.iter().zip(PENDULUM)) {
            let error = constant.standard_error.unwrap_or(0.0);
            *held += usize::from((constant.value - truth).abs() < 1.645 * error);
        }
    }
    for (held, (name, _)) in held.iter().zip(PENDULUM) {
        println!("{name}: {held} of {seeds} ranges of 90 % hold the truth");
    }
    println!("{explained} of {seeds} explained, {:.1} s in all", started.elapsed().as_secs_f64());
    Ok(())
}

const DUFFING: [(&str, f64); 4] = [("m", 1.0), ("k", 1.2), ("b", 0.4), ("c", 0.2)];

/// Motion from rest under forces that are held between the samples, with noise of 1 % of the rms; exact positions too.
fn driven(instance: &SystemInstance<f64>, samples: usize, seed: u64) -> Outcome<(Recording, Vec<f64>)> {
    let (model, mut rng) = (instance.build()?, RngStream::Trajectories.generator(seed));
    // Eight samples in a period of the linear oscillator.
    let step = std::f64::consts::TAU / 1.2_f64.sqrt() / 8.0;
    let force: Vec<f64> = (0..samples).map(|_| normal(&mut rng)).collect();
    let exact = simulated(&*model, &force, step)?;
    let rms = (exact.iter().map(|q| q * q).sum::<f64>() / samples as f64).sqrt();
    let q = exact.iter().map(|q| q + 0.01 * rms * normal(&mut rng)).collect();
    let times = (0..samples).map(|k| k as f64 * step).collect();
    let track = RecordedTrajectory { name: "circuit".into(), times, q, v: vec![], a: vec![], force };
    Ok((Recording { coordinates: vec!["x".into()], periodic: vec![false], tracks: vec![track] }, exact))
}

/// Positions from rest under held forces.
fn simulated(model: &dyn EulerLagrange<f64>, force: &[f64], step: f64) -> Outcome<Vec<f64>> {
    let (mut q, mut state) = (Vec::with_capacity(force.len()), (0.0, 0.0));
    for f in force {
        q.push(state.0);
        let held = SampledForce::constant(vec![*f])?;
        let motion =
            Driven::new(model, &held).rollout(&[state.0], &[state.1], &RolloutOptions::new(step, step)).complete()?;
        state = (motion.q[1], motion.v[1]);
    }
    Ok(q)
}

fn duffing(samples: usize) -> Outcome<()> {
    let (recording, exact) = driven(&system("duffing.toml", &DUFFING)?, samples, 0)?;
    let learned = samples * 4 / 5;
    let mut part = recording.clone();
    let track = &mut part.tracks[0];
    for column in [&mut track.times, &mut track.q, &mut track.force] {
        column.truncate(learned);
    }
    for between in [None, Some(Between::Held), Some(Between::Linear), Some(Between::Cubic), Some(Between::BandLimited)]
    {
        let started = Instant::now();
        let found = identify(&system("duffing.toml", &[])?, &part, &options(&[]).between(between))?;
        let seconds = started.elapsed().as_secs_f64();
        let values: Vec<(&str, f64)> = found.constants.iter().map(|c| (c.symbol.as_str(), c.value)).collect();
        let model = system("duffing.toml", &values)?.build()?;
        let track = &recording.tracks[0];
        let again = simulated(&*model, &track.force, track.times[1])?;
        let sum = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
        let error = sum(&mut again[learned..].iter().zip(&exact[learned..]).map(|(a, b)| a - b));
        let error = 100.0 * error / sum(&mut exact[learned..].iter().copied());
        println!("{between:?}, taken {:?}: {error:.3} % of rms held out, {seconds:.1} s", found.between);
        for constant in &found.constants {
            let truth = DUFFING.iter().find(|(name, _)| *name == constant.symbol).map_or(0.0, |(_, x)| *x);
            println!("  {} {:.5} +- {:.5?} (truth {truth})", constant.symbol, constant.value, constant.standard_error);
        }
    }
    Ok(())
}

/// Constants of the textbook's form by the authors of the triple arm, from their masses, lengths and inertias.
const PUBLISHED: [(&str, f64); 10] = [
    ("A1", 0.0185941),
    ("A2", 0.0180197),
    ("A3", 0.0041712),
    ("D2", 0.0838141),
    ("D3", 0.0217868),
    ("l1", 0.1728),
    ("l2", 0.2287),
    ("c1", 0.001477),
    ("c2", 0.000260),
    ("c3", 0.00001),
];

fn recorded_arms(folder: &Path) -> Outcome<()> {
    for (name, n) in [("double", 2), ("triple", 3)] {
        let path = folder.join(format!("{name}.csv"));
        if !path.exists() {
            println!("{}: not there", path.display());
            continue;
        }
        let (recording, held) = arms::read(&path)?;
        let started = Instant::now();
        let found = arms::identified(&recording)?;
        println!(
            "{name}: {:.1} s, {} samples, {} segments of {:.3} s",
            started.elapsed().as_secs_f64(),
            found.samples,
            found.segments,
            found.segment_seconds
        );
        for constant in &found.constants {
            let published = PUBLISHED.iter().find(|(symbol, _)| n == 3 && *symbol == constant.symbol);
            let beside = published.map_or_else(String::new, |(_, x)| {
                format!(", published {x}, {:+.2} %", 100.0 * (constant.value / x - 1.0))
            });
            println!("  {} {:.6} +- {:.6?}{beside}", constant.symbol, constant.value, constant.standard_error);
        }
        let offsets: Vec<f64> = found.sensors.iter().map(|sensor| sensor.value).collect();
        println!("  offsets {offsets:.5?} rad");
        println!("  residual over noise {:.2}, explained {}", found.over_noise, found.explained);
        let values: Vec<(&str, f64)> = found.constants.iter().map(|c| (c.symbol.as_str(), c.value)).collect();
        let mut models = vec![("identified", values, offsets)];
        if n == 3 {
            let published = PUBLISHED.iter().copied().chain(["d1", "d2", "d3"].map(|name| (name, 0.0)));
            models.push(("published", published.collect(), vec![0.0; n]));
        }
        for (whose, values, offsets) in models {
            let model = arms::textbook(n, &values)?.build()?;
            let errors = arms::line(arms::ahead(&*model, &held, &offsets)?);
            println!("  {whose} constants, {:?} s ahead: {errors}", arms::AHEAD);
        }
    }
    Ok(())
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Part {
    Coverage,
    Duffing,
    Arms,
}

/// Arguments.
#[derive(clap::Args)]
pub struct Args {
    #[arg(long, default_value = "coverage")]
    part: Part,
    /// Recordings of `coverage`, of seeds from 0 on
    #[arg(long, default_value_t = 100)]
    seeds: u64,
    /// Folder of the recorded pendula
    #[arg(long, default_value = ARMS)]
    arms: PathBuf,
}

/// Measures the part that is asked for.
pub fn run(arguments: Args) -> Outcome<()> {
    match arguments.part {
        Part::Coverage => coverage(arguments.seeds),
        Part::Duffing => duffing(40_000),
        Part::Arms => recorded_arms(&arguments.arms),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The smallest of everything.
    #[test]
    fn everything_runs() {
        coverage(1).expect("a pendulum is identified");
        duffing(400).expect("an oscillator is identified");
    }
}
