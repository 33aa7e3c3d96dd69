//! The paper's physical experiments: one training each, judged by its trajectory test.

use super::{Experiment, Picture, Reported, Run};
use crate::lagrangian::configure;
use crate::presets::Preset;

/// Everything an evaluation draws.
const ALL: &[Picture] = &[Picture::Evaluation(&[""])];

/// The paper's training of a system.
fn system(name: &str, reported: Reported) -> Vec<Run> {
    let configured = configure(name, &[]).unwrap_or_else(|e| unreachable!("{e}"));
    let config = Preset::Paper.config(&configured).unwrap_or_else(|| unreachable!("a system of the paper"));
    vec![Run {
        name: name.to_string(),
        label: configured.system.title.to_string(),
        abscissa: None,
        group: String::new(),
        config,
        reported,
    }]
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
pub(super) const TRIPLE: Reported =
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
