//! Every preset of every system: it trains, to the same bits on any number of threads, on states that its motions go through.

use crate::common::penalties::allow_the_truth;
use lnn::configuration::Config;
use lnn::lagrangian::{System, SystemInstance};
use lnn::presets::Preset;
use lnn::random::RngStream;
use lnn::rollout::{RolloutOptions, rollout};
use lnn::training::{Hooks, run};
use rand::Rng;

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
    for system in System::unconstrained() {
        let configured = SystemInstance::<f64>::named(&system.name, &[]).unwrap();
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

#[test]
fn exact_motions_of_the_ads_test_stay_among_the_training_states() {
    for name in ["ads2-geodesic", "ads3-geodesic", "ads4-geodesic"] {
        let system = SystemInstance::<f64>::named(name, &[]).unwrap();
        let (n, test) = (system.coordinates, system.system.trajectory(system.coordinates));
        let config = Preset::Quick.config(&system).unwrap();
        let exact = system.build().unwrap();
        let mut random = RngStream::Trajectories.generator(3);
        let mut draw = |bounds: &[(f64, f64)]| -> Vec<f64> {
            bounds.iter().map(|(low, high)| low + (high - low) * random.random::<f64>()).collect()
        };
        for _ in 0..50 {
            let (q, mut v) = (draw(&test.start.positions), draw(&test.start.velocities));
            system.impose_constraint(&q, &mut v).unwrap();
            // z'' = z + 2 z'^2 / z whatever the other velocities: at most z' = 2.36, from z = 3 and z' = 0.25.
            let run = rollout(exact.as_ref(), &q, &v, &RolloutOptions::reference(test.t_end, test.dt));
            assert!(run.stop.is_none());
            for k in 0..run.trajectory.len() {
                let (q, v) = run.trajectory.state(k);
                let inside = |x: f64, [low, high]: [f64; 2]| (low..=high).contains(&x);
                let phase = &config.phases[0];
                assert!((0..n).all(|i| inside(q[i], phase.position[i])), "{name}: {q:?}");
                // The velocity of t follows from the others.
                assert!((1..n).all(|i| inside(v[i], phase.velocity[i])), "{name}: {v:?}");
            }
        }
    }
}

/// Every penalty of the presets, once per system, against the exact mass matrices of its training states.
#[test]
fn no_penalty_forbids_the_truth() {
    let built_in =
        System::unconstrained().iter().map(|system| SystemInstance::<f64>::named(&system.name, &[]).unwrap());
    let presets = built_in.flat_map(|system| [Preset::Quick, Preset::Paper].map(|preset| preset.config(&system)));
    let configs = presets.flatten().map(shrunk);
    assert!(allow_the_truth(configs) > 20);
}
