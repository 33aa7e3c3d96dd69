//! What a training is said to take against what it takes.

use crate::alone;
use crate::counting::peak;
use lnn::configuration::{Config, Lbfgs, Precision, Regularizer};
use lnn::data::Datasets;
use lnn::lagrangian::SystemInstance;
use lnn::presets::Preset;
use lnn::storage::Disk;
use lnn::training::{
    CheckpointInterval, CheckpointManager, Fingerprint, Hooks, ResumeOptions, resume, training_memory,
};
use std::sync::Arc;

fn config(system: &str, hidden: &[usize], states: usize) -> Config {
    let mut config = Preset::Quick.config(&SystemInstance::named(system, &[]).unwrap()).unwrap();
    (config.data.training, config.data.validation, config.data.test) = (states, states / 4, states / 4);
    config.network.hidden = hidden.to_vec();
    config.optimizer.batch = 1024;
    config.phases[0].epochs = 2;
    config.phases.push(config.phases[0].clone());
    config
}

/// Most bytes that a training with checkpoints takes beyond what was there before it.
fn measured(config: &Config) -> u64 {
    let directory = tempfile::tempdir().unwrap();
    let system = config.system().unwrap();
    let taken = peak(|| {
        let (data, scale) = Datasets::<f32>::sample(config, &system).unwrap();
        let architecture = config.architecture(&system, scale).unwrap();
        let identity = Fingerprint { config: String::new(), data: data.checksums() };
        let keeper =
            Arc::new(CheckpointManager::new(Arc::new(Disk), directory.path(), CheckpointInterval::Epochs(1), identity));
        let resumed = ResumeOptions { checkpoints: Some(keeper), start: None };
        let penalty = config.penalty().unwrap();
        resume(config, &architecture, penalty, data, 2, &Hooks::default(), resumed).unwrap();
    });
    assert_eq!(config.precision, Precision::F32);
    taken as u64
}

#[test]
fn a_training_takes_what_was_said() {
    if !alone("memory::a_training_takes_what_was_said") {
        return;
    }
    let wide = config("double-pendulum", &[400, 400], 2048);
    let many = config("harmonic-oscillator", &[4], 200_000);
    let mut penalised = config("triple-pendulum", &[64, 64], 4096);
    penalised.penalty = Regularizer::Eigenvalue { lambda: 1.0 };
    let mut polished = config("double-pendulum", &[100, 100], 4096);
    polished.lbfgs = Some(Lbfgs { iterations: 12, memory: 10 });
    for (name, config) in [("wide", wide), ("many", many), ("penalised", penalised), ("polished", polished)] {
        let system = config.system().unwrap();
        let said =
            training_memory(&config, &config.architecture(&system, vec![1.0; system.coordinates]).unwrap()).unwrap();
        let taken = measured(&config);
        println!("{name}: said {said}, taken {taken}, ratio {:.2}", said as f64 / taken as f64);
        assert!(taken <= said && said <= 4 * taken, "{name}: said {said}, taken {taken}");
    }
}
