//! Threads are started only where a number of threads is an argument.
#![cfg(target_os = "linux")]

use crate::alone;
use lnn::configuration::Penalty;
use lnn::data::Dataset;
use lnn::data::{Noise, StateEstimate};
use lnn::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use lnn::network::{Architecture, Layout, ModelFile, NetworkLagrangian};
use lnn::optimizers::{Method, Moments, Update};
use lnn::recording::RecordedTrajectory;
use lnn::rollout::{Between, RolloutOptions, rollout, rollout_many};
use lnn::shooting::{Shooting, Task, fit};
use lnn::training::{Hooks, Objective};
use std::path::Path;
use std::time::{Duration, Instant};

/// Threads of this process.
fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").unwrap().count()
}

/// Weights after an epoch of multiple shooting by SOAP.
fn shot(architecture: &Architecture, weights: &[f64], threads: usize) -> Vec<f64> {
    let times: Vec<f64> = (0..40).map(|k| 0.02 * f64::from(k)).collect();
    let q: Vec<f64> = times.iter().flat_map(|t| [0.5 * (3.0 * t).sin(), 0.4 * (4.0 * t).cos()]).collect();
    let v: Vec<f64> = times.iter().flat_map(|t| [1.5 * (3.0 * t).cos(), -1.6 * (4.0 * t).sin()]).collect();
    let track = RecordedTrajectory { name: String::new(), times, q: q.clone(), v: vec![], a: vec![], force: vec![] };
    let tracks = [StateEstimate { track: &track, q: &q, v: &v, between: Between::Linear }];
    let noise = Noise { q: vec![0.1; 2], v: vec![] };
    let task = Task {
        architecture,
        penalty: Penalty::None,
        weights: weights.to_vec(),
        training: &tracks,
        validation: &tracks,
        noise: &noise,
        constraints: None,
        seed: 0,
    };
    let settings = Shooting { method: Method::Soap, samples_per_segment: 20, epochs: 1, ..Shooting::default() };
    fit(&settings, task, threads, &Hooks::default()).unwrap().weights
}

#[test]
fn threads_are_the_callers_choice() {
    if !alone("threads::threads_are_the_callers_choice") {
        return;
    }
    let before = threads();
    let file = ModelFile::<f64>::load(
        &Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("examples/data/double_pendulum.safetensors"),
    )
    .unwrap();
    let architecture = file.header.architecture.clone();
    let learned = NetworkLagrangian::new(file.header.architecture, file.weights.clone()).unwrap();
    let written = SystemInstance::<f64>::named("double-pendulum", &[]).unwrap().build().unwrap();
    let q: Vec<f64> = (0..400).map(|k| (0.7 * f64::from(k)).sin()).collect();
    let v: Vec<f64> = (0..400).map(|k| (0.3 * f64::from(k)).cos()).collect();
    let mut terms = Terms::default();
    for model in [&learned as &dyn EulerLagrange<f64>, &*written] {
        model.terms(&q, &v, Request::ALL, &mut terms).unwrap();
        assert!(rollout(model, &q[..2], &v[..2], &RolloutOptions::new(0.1, 0.05)).is_complete());
        let starts = vec![(q[..2].to_vec(), v[..2].to_vec()); 4];
        assert_eq!(rollout_many(model, &starts, &RolloutOptions::new(0.1, 0.05), 1).len(), 4);
    }
    assert_eq!(threads(), before, "evaluation and roll-outs start no thread");

    let data = Dataset::new(2, q, v, terms.acceleration).unwrap();
    let rows: Vec<u32> = (0..200).collect();
    let mut gradients = Vec::new();
    for count in [1, 3] {
        let mut objective = Objective::new(&architecture, Penalty::Eigenvalue { lambda: 1.0 }, count).unwrap();
        let mut gradient = vec![0.0; file.weights.len()];
        assert!(objective.step(&file.weights, &data, &rows, &mut gradient).loss.is_finite());
        gradients.push(gradient);
        let now = threads();
        assert!(now <= before + count, "{count} threads were asked for, {} started", now - before);
        assert!(count == 1 || now > before, "the count sees threads");
        drop(objective);
        let limit = Instant::now() + Duration::from_secs(20);
        while threads() > before {
            assert!(Instant::now() < limit, "threads outlive the objective");
            std::thread::sleep(Duration::from_millis(2));
        }
    }
    assert!(gradients[0] == gradients[1], "the number of threads changes nothing");
    assert!(shot(&architecture, &file.weights, 1) == shot(&architecture, &file.weights, 3));
    let mut moments = Moments::for_method(Method::Soap, file.weights.len(), Layout::new(&architecture).matrices());
    let update = Update { method: Method::Soap, rate: 1e-3, weight_decay: 0.0, decaying: usize::MAX, clip: 1.0 };
    assert!(moments.update(&mut file.weights.clone(), &mut gradients[0], &update) > 0.0);
    // Rayon's global pool can be built once in the life of a process: nobody has done so.
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the global pool belongs to the application");
}
