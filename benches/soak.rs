//! Memory over a long run: training and roll-outs back to back in one process, the resident memory after each round.
//!
//! `cargo bench --bench soak -- --minutes 30` prints a line per minute and at the end the slope of a straight line through
//! all rounds after the first tenth, in kB per hour and per round. Linux only (`/proc/self/status`).

use clap::Parser;
use lnn::configuration::Config;
use lnn::lagrangian::SystemInstance;
use lnn::presets::Preset;
use lnn::rollout::{Integrator, RolloutOptions, rollout_many, rollout_together};
use lnn::training::{Hooks, run};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// A small training of every kind of step: penalty, L-BFGS, validation.
fn config(seed: u64) -> Config {
    let system = SystemInstance::<f64>::named("double-pendulum", &[]).expect("the defaults are valid");
    let mut config = Preset::Quick.config(&system).expect("every system has a quick preset");
    config.seed = seed;
    (config.data.training, config.data.validation, config.data.test) = (4000, 500, 500);
    config.network.hidden = vec![64; 2];
    config.phases[0].epochs = 3;
    config.lbfgs = Some(lnn::configuration::Lbfgs { iterations: 3, memory: 5 });
    config
}

/// Trains a network and lets it move by every method.
fn round(seed: u64) {
    let outcome = run::<f64>(&config(seed), 2, &Hooks::default()).expect("a training");
    let starts: Vec<_> = (0..8).map(|k| (vec![0.1 * k as f64, 0.2], vec![0.0, 0.1])).collect();
    for method in Integrator::ALL {
        let options = RolloutOptions::new(1.0, 0.1).method(method).step(0.02).max_steps(2000);
        black_box(rollout_many(&outcome.model, &starts, &options, 2));
        black_box(rollout_together(&outcome.model, &starts, &options, 2));
    }
}

/// Resident memory in kB.
fn resident() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Slope of the line of least squares.
fn slope(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let mean = |f: fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let above: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    above / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

#[derive(clap::Parser)]
struct Arguments {
    /// How long
    #[arg(long, default_value_t = 30.0)]
    minutes: f64,
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() {
    soak(Arguments::parse().minutes);
}

/// Rounds for so many minutes, and what became of the memory.
pub fn soak(minutes: f64) {
    let (start, mut said, mut points) = (Instant::now(), Instant::now(), Vec::new());
    while points.len() < 4 || start.elapsed() < Duration::from_secs_f64(60.0 * minutes) {
        round(points.len() as u64);
        let Some(memory) = resident() else { return println!("this system does not tell its resident memory") };
        points.push((start.elapsed().as_secs_f64() / 3600.0, memory));
        if said.elapsed() > Duration::from_secs(60) {
            said = Instant::now();
            println!("{:.0} min, {} rounds: {memory:.0} kB", start.elapsed().as_secs_f64() / 60.0, points.len());
        }
    }
    let settled = &points[points.len() / 10..];
    let (hourly, last) = (slope(settled), points.len() - 1);
    let rounds: Vec<_> = settled.iter().enumerate().map(|(k, p)| (k as f64, p.1)).collect();
    println!("{} rounds in {:.1} min, {:.0} kB at the end", points.len(), points[last].0 * 60.0, points[last].1);
    println!("slope {hourly:.1} kB per hour, {:.3} kB per round", slope(&rounds));
}
