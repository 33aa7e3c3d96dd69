//! Holes learned from free fall, and read.

use super::experiments::{Experiment, Picture};
use lnn::configuration::Config;
use lnn::experiments::{Reported, Run, slug};
use lnn::lagrangian::SystemInstance;
use lnn::network::Structure;
use lnn::presets::Preset;
use std::collections::BTreeMap;

/// Holes in coordinates that pass through the horizon.
const HOLES: [&str; 2] = ["schwarzschild-cartesian", "kerr-cartesian"];

fn hole(name: &str) -> SystemInstance<f64> {
    SystemInstance::named(name, &[]).unwrap_or_else(|e| unreachable!("{e}"))
}

fn run(name: &str, label: String, config: Config) -> Run {
    Run { name: name.into(), label, abscissa: None, group: String::new(), config, reported: Reported::NOTHING }
}

/// A hole by a preset.
fn learned(preset: Preset, name: &str, hole: &SystemInstance<f64>) -> Run {
    let system = &hole.system.name;
    let config = preset.config(hole).unwrap_or_else(|| unreachable!("a preset of every system"));
    run(&slug(&format!("{name}-{system}")), format!("{name}, {system}"), config)
}

/// A hole with these parameters, the others being the system's, by both presets.
pub(super) fn runs_of(hole: &SystemInstance<f64>, parameters: &BTreeMap<String, f64>) -> Vec<Run> {
    let suffix: String = parameters.iter().map(|(symbol, value)| format!(", {symbol} = {value}")).collect();
    let of = |(preset, name)| {
        let run = learned(preset, name, hole);
        let (name, label) = (slug(&format!("{}{suffix}", run.name)), format!("{}{suffix}", run.label));
        Run { name, label, config: Config { parameters: parameters.clone(), ..run.config }, ..run }
    };
    [(Preset::Quick, "quick"), (Preset::Best, "best")].map(of).to_vec()
}

pub(super) const BLACK_HOLES: Experiment = Experiment {
    name: "black-holes",
    title: "Black holes from free fall",
    paper: "-",
    finding: "Schwarzschild is hard to train, above all near the horizon.",
    pictures: &[Picture::BlackHole],
    reductions: &[],
    runs: || {
        let structured = |name: &str, structure| {
            let config = Preset::Quick.config_of(&hole(name), structure);
            config.unwrap_or_else(|| unreachable!("a preset of every system"))
        };
        let black_box = structured(HOLES[0], Structure::BlackBox);
        let (optimizer, phase) = (black_box.optimizer.clone(), black_box.phases[0].clone());
        let mut spherical = structured("schwarzschild-geodesic", Structure::Metric);
        spherical.network.cyclic = vec!["t".to_string()];
        // The same budget.
        spherical.optimizer = optimizer;
        (spherical.phases[0].epochs, spherical.phases[0].t_max) = (phase.epochs, phase.t_max);
        let beside = [
            run("black-box", format!("black box, {}", HOLES[0]), black_box),
            run("spherical", "spherical coordinates, schwarzschild-geodesic".to_string(), spherical),
        ];
        let of = |preset, name| HOLES.into_iter().map(move |system| learned(preset, name, &hole(system)));
        of(Preset::Quick, "quick").chain(of(Preset::Best, "best")).chain(beside).collect()
    },
};
