//! What the paper's training of the double pendulum starts from, for a peer: scaled states, weights, settings.

use super::{Outcome, write};
use lnn::data::{Dataset, Datasets};
use lnn::lagrangian::SystemInstance;
use lnn::presets::Preset;
use lnn::random::RngStream;
use std::path::Path;

/// Writes states `NAME.x`, `.w`, `.a` (positions, velocities, accelerations in units of the scales), `weights` and
/// `recipe.json`; at most `states` training states.
pub fn write_all(directory: &Path, states: usize) -> Outcome<()> {
    let system = SystemInstance::<f64>::named("double-pendulum", &[])?;
    let mut config = Preset::Paper.config(&system).ok_or("the paper has a double pendulum")?;
    config.data.training = config.data.training.min(states);
    let (data, scale) = Datasets::<f64>::sample(&config, &system)?;
    let architecture = config.architecture(&system, scale.clone())?;
    let scaled = |x: &[f64]| -> Vec<f64> {
        x.chunks(scale.len()).flat_map(|row| row.iter().zip(&scale).map(|(x, s)| x / s)).collect()
    };
    let set = |name: &str, data: &Dataset<f64>| -> Outcome<()> {
        for (part, numbers) in [("x", data.q()), ("w", data.v()), ("a", data.a())] {
            write(directory, &format!("{name}.{part}"), &scaled(numbers))?;
        }
        Ok(())
    };
    for (k, training) in data.training.iter().enumerate() {
        set(&format!("training{k}"), training)?;
    }
    set("validation", &data.validation)?;
    let mut rng = RngStream::Weights.generator(config.seed);
    write(directory, "weights", &architecture.initial_weights::<f64>(config.network.initialization, &mut rng))?;
    let phase = |p: &lnn::configuration::Phase| serde_json::json!({ "epochs": p.epochs, "rate": p.rate, "eta_min": p.eta_min, "t_max": p.t_max });
    let recipe = serde_json::json!({
        "n": architecture.coordinates,
        "width": architecture.hidden[0],
        "alpha": architecture.alpha,
        "lambda": config.penalty.lambda(),
        "batch": config.optimizer.batch,
        "weight_decay": config.optimizer.weight_decay,
        "clip": config.optimizer.clip,
        "phases": config.phases.iter().map(phase).collect::<Vec<_>>(),
    });
    std::fs::write(directory.join("recipe.json"), recipe.to_string())?;
    Ok(())
}
