//! The paper's physical experiments, one training each, judged by its trajectory test; this crate's presets against them,
//! and how soon each gets where.

use super::experiments::{Experiment, Picture};
use lnn::configuration::Config;
use lnn::experiments::{Reported, Run};
use lnn::lagrangian::{System, SystemInstance};
use lnn::optimizers::Method;
use lnn::presets::Preset;

/// Everything an evaluation draws.
const ALL: &[Picture] = &[Picture::Evaluation(&[""])];

/// The paper's training of a system.
fn system(name: &str, reported: Reported) -> Vec<Run> {
    let title = System::named(name).map_or(name, |system| system.title.as_ref());
    vec![run(name, title, config_of(Preset::Paper, name), reported)]
}

pub(super) const DOUBLE_PENDULUM: Experiment = Experiment {
    name: "double-pendulum",
    title: "Double pendulum",
    paper: "Figs. double_pendulum_coord_error, _energy, _lagrangian, _hessian, _trace",
    finding: "L1 loss 0.01523 in rad/s^2 after three phases, 700 epochs; Lagrangian and Hessian equal the analytical ones \
              up to a factor.",
    pictures: ALL,
    reductions: &[],
    runs: || system("double-pendulum", Reported { loss: Some(0.001523), ..Reported::NOTHING }),
};

pub(super) const SPRING_PENDULUM: Experiment = Experiment {
    name: "spring-pendulum",
    title: "Spring pendulum",
    paper: "Figs. spring_pendulum_energy_error, _trace",
    finding: "Mean energy error 3.6 % after 50 s over four starts.",
    pictures: ALL,
    reductions: &[],
    runs: || system("spring-pendulum", Reported { energy: Some(0.036), ..Reported::NOTHING }),
};

/// Of the triple pendulum: a regular and a chaotic motion.
const TRIPLE: Reported =
    Reported { loss: Some(0.019724), regular_energy: Some(0.0058), chaotic_energy: Some(0.19), ..Reported::NOTHING };

pub(super) const TRIPLE_PENDULUM: Experiment = Experiment {
    name: "triple-pendulum",
    title: "Triple pendulum",
    paper: "Figs. triple_pendulum_training, _coord_error_(non)chaotic, _energy_(non)chaotic",
    finding: "Validation loss from 1.38 in the first epoch to 0.0197; three of four starts chaotic, energy error 0.58 % \
              on the regular one and 19 % on a chaotic one.",
    pictures: ALL,
    reductions: &[],
    runs: || system("triple-pendulum", TRIPLE),
};

pub(super) const SPHERE_GEODESIC: Experiment = Experiment {
    name: "sphere-geodesic",
    title: "Geodesic on a sphere",
    paper: "Figs. sphere_geodesic_analytical_coords, _lnn_coords, _energy_error",
    finding: "Learned quickly, with negligible error of energy and position.",
    pictures: ALL,
    reductions: &[],
    runs: || system("sphere-geodesic", Reported::NOTHING),
};

pub(super) const ADS4_GEODESIC: Experiment = Experiment {
    name: "ads4-geodesic",
    title: "Geodesic of AdS4",
    paper: "Figs. ads4_coord_error, ads4_tdot, ads4_zdot",
    finding: "All motions over a proper time of 0.5 closely follow the exact ones, dt/dtau and dz/dtau too.",
    pictures: ALL,
    reductions: &[],
    runs: || system("ads4-geodesic", Reported::NOTHING),
};

/// The paper's systems with what it reports of them.
const SYSTEMS: [(&str, Reported); 5] = [
    ("double-pendulum", Reported { loss: Some(0.001523), ..Reported::NOTHING }),
    ("triple-pendulum", TRIPLE),
    ("spring-pendulum", Reported { energy: Some(0.036), ..Reported::NOTHING }),
    ("sphere-geodesic", Reported::NOTHING),
    ("ads4-geodesic", Reported::NOTHING),
];

/// The configuration of a preset for a system of the paper.
pub(super) fn config_of(preset: Preset, system: &str) -> Config {
    let configured = SystemInstance::named(system, &[]).unwrap_or_else(|e| unreachable!("{e}"));
    preset.config(&configured).unwrap_or_else(|| unreachable!("a system of the paper"))
}

fn run(name: &str, label: &str, config: Config, reported: Reported) -> Run {
    Run { name: name.to_string(), label: label.to_string(), abscissa: None, group: String::new(), config, reported }
}

fn all(preset: Preset) -> Vec<Run> {
    SYSTEMS.iter().map(|&(system, reported)| run(system, system, config_of(preset, system), reported)).collect()
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
        let of = |preset| config_of(preset, "double-pendulum");
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
