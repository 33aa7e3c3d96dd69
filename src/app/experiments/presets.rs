//! The presets of our own against the paper's figures, and how soon each gets where.

use super::physical::TRIPLE;
use super::{Experiment, Picture, Reported, Run};
use crate::configuration::Config;
use crate::lagrangian::configure;
use crate::optimizers::Method;
use crate::presets::Preset;

/// The paper's systems with what it reports of them.
const SYSTEMS: [(&str, Reported); 5] = [
    ("double-pendulum", Reported { loss: Some(0.001523), ..Reported::NOTHING }),
    ("triple-pendulum", TRIPLE),
    ("spring-pendulum", Reported { energy: Some(0.036), ..Reported::NOTHING }),
    ("sphere-geodesic", Reported::NOTHING),
    ("ads4-geodesic", Reported::NOTHING),
];

fn config(preset: Preset, system: &str) -> Config {
    let configured = configure(system, &[]).unwrap_or_else(|e| unreachable!("{e}"));
    preset.config(&configured).unwrap_or_else(|| unreachable!("a system of the paper"))
}

fn run(name: &str, label: &str, config: Config, reported: Reported) -> Run {
    Run { name: name.to_string(), label: label.to_string(), abscissa: None, group: String::new(), config, reported }
}

fn all(preset: Preset) -> Vec<Run> {
    SYSTEMS.iter().map(|&(system, reported)| run(system, system, config(preset, system), reported)).collect()
}

pub(super) const QUICK: Experiment = Experiment {
    name: "quick",
    title: "Preset quick on the five systems",
    paper: "-",
    finding: "After up to 700 epochs: double pendulum 0.001523, triple pendulum 0.0197, energy error of the spring \
              pendulum 3.6 %.",
    pictures: &[],
    reductions: &[],
    runs: || all(Preset::Quick),
};

pub(super) const BEST: Experiment =
    Experiment { name: "best", title: "Preset best on the five systems", runs: || all(Preset::Best), ..QUICK };

pub(super) const TIME_TO_ACCURACY: Experiment = Experiment {
    name: "time-to-accuracy",
    title: "Validation loss of the double pendulum against time",
    paper: "-",
    finding: "0.00686 after 300 epochs, 0.001523 after 700.",
    pictures: &[Picture::Clock],
    reductions: &[],
    runs: || {
        let of = |preset| config(preset, "double-pendulum");
        let reported = |loss| Reported { loss: Some(loss), ..Reported::NOTHING };
        let mut radam = of(Preset::Quick);
        radam.optimizer.method = Method::Radam;
        for phase in &mut radam.phases {
            (phase.epochs, phase.t_max, phase.rate) = (2 * phase.epochs, 2.0 * phase.t_max, 3e-3);
        }
        vec![
            run("quick", "preset quick", of(Preset::Quick), reported(0.006859)),
            run("quick-radam", "quick by RAdam, 80 epochs", radam, reported(0.006859)),
            run("best", "preset best", of(Preset::Best), reported(0.001523)),
        ]
    },
};
