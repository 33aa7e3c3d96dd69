//! Every preset of every system: it trains, and to the same bits on any number of threads.

use lnn::lagrangian::{configure, systems};
use lnn::training::{Config, Hooks, Preset, run};

/// The preset with few states, few epochs and narrow layers, everything else as it ships.
fn shrunk(mut config: Config) -> Config {
    config.data.training = 600;
    config.data.validation = 100;
    config.data.test = 10;
    // Half of the batches are cut into as many parts as there ever are.
    config.optimizer.batch = 500;
    config.network.hidden.iter_mut().for_each(|width| *width = 10);
    config.phases.iter_mut().for_each(|phase| phase.epochs = 1);
    config
}

#[test]
fn every_preset_trains_to_the_same_bits_on_any_number_of_threads() {
    let mut presets = 0;
    for system in systems() {
        let configured = configure::<f64>(system.name, &[]).unwrap();
        for preset in [Preset::Quick, Preset::Best, Preset::Paper] {
            let Some(config) = preset.config(&configured) else { continue };
            let config = shrunk(config);
            let bits = |threads| {
                let outcome = run::<f32>(&config, threads, &Hooks::default()).unwrap();
                assert!(outcome.trained.validation_loss.is_finite(), "{}, {preset:?}", system.name);
                outcome.trained.weights.iter().map(|w| w.to_bits()).collect::<Vec<_>>()
            };
            let one = bits(1);
            for threads in [2, 3] {
                assert_eq!(bits(threads), one, "{}, {preset:?}, {threads} threads", system.name);
            }
            presets += 1;
        }
    }
    assert!(presets >= 19, "{presets} presets");
}
