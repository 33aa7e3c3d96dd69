//! The learned double pendulum: read from a file, or trained for a few epochs and kept in the output directory.

use super::options::Options;
use lnn::configuration::{Config, Precision};
use lnn::lagrangian::SystemInstance;
use lnn::network::{Header, ModelFile, NetworkLagrangian, StoredPrecision};
use lnn::presets::Preset;
use lnn::training::{Hooks, run};
use std::path::Path;

/// The network of `--model`, or of a short training.
///
/// # Errors
/// What cannot be read, trained or written, in words.
pub fn double_pendulum(options: &Options) -> Result<NetworkLagrangian<f64>, String> {
    let (epochs, states) = options.choose((2, 4000), (10, 20_000), (20, 60_000));
    let cached = options.out.join(format!("double-pendulum-{epochs}x{states}.safetensors"));
    let path = options.model.as_deref().unwrap_or(&cached);
    if options.model.is_none() && !cached.exists() {
        train(epochs, states, &cached)?;
    }
    let says = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let file = ModelFile::<f64>::load(path).map_err(|e| says(&e))?;
    if file.header.system != "double-pendulum" {
        return Err(says(&format!("expected a model of the double pendulum, found {}", file.header.system)));
    }
    NetworkLagrangian::new(file.header.architecture, file.weights).map_err(|e| says(&e))
}

/// The quick preset with fewer epochs and states.
fn train(epochs: usize, states: usize, path: &Path) -> Result<(), String> {
    let system = SystemInstance::<f64>::named("double-pendulum", &[]).map_err(|e| e.to_string())?;
    let mut config: Config = Preset::Quick.config(&system).ok_or("the quick preset has no double pendulum")?;
    config.data.training = states;
    for phase in &mut config.phases {
        (phase.epochs, phase.t_max) = (epochs, epochs as f64);
    }
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let outcome = run::<f32>(&config, threads, &Hooks::default()).map_err(|e| e.to_string())?;
    let symbols = system.system.parameters.iter().map(|p| p.symbol.to_string());
    let header = Header {
        format: Header::FORMAT,
        crate_version: env!("CARGO_PKG_VERSION").to_string(),
        architecture: outcome.model.architecture().clone(),
        system: config.system.clone(),
        parameters: symbols.zip(system.parameters.iter().copied()).collect(),
        columns: system.system.columns(system.coordinates),
        forces: Vec::new(),
        constraints: [].into(),
        description: None,
        precision: match config.precision {
            Precision::F32 => StoredPrecision::F32,
            Precision::F64 => StoredPrecision::F64,
        },
        position: config.phases[0].position.clone(),
        velocity: config.phases[0].velocity.clone(),
        seed: config.seed,
        validation_loss: outcome.trained.validation_loss,
    };
    let file = ModelFile { header, weights: outcome.model.weights().to_vec() };
    file.save(path).map_err(|e| format!("{}: {e}", path.display()))
}
