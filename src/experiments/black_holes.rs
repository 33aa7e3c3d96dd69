//! Holes learned from free fall, and read.

use super::{Experiment, Picture, Reported, Run};
use crate::configuration::{Config, Regularizer};
use crate::lagrangian::configure;
use crate::network::Structure;
use crate::presets::Preset;

/// Holes in coordinates that pass through the horizon.
const HOLES: [&str; 2] = ["schwarzschild-cartesian", "kerr-cartesian"];

fn config(preset: Preset, system: &str) -> Config {
    let configured = configure(system, &[]).unwrap_or_else(|e| unreachable!("{e}"));
    preset.config(&configured).unwrap_or_else(|| unreachable!("a preset of every system"))
}

fn run(name: &str, label: String, config: Config) -> Run {
    Run { name: name.into(), label, abscissa: None, group: String::new(), config, reported: Reported::NOTHING }
}

/// Both holes by a preset.
fn holes(preset: Preset, name: &str) -> impl Iterator<Item = Run> {
    HOLES.into_iter().map(move |hole| run(&format!("{name}-{hole}"), format!("{name}, {hole}"), config(preset, hole)))
}

pub(super) const BLACK_HOLES: Experiment = Experiment {
    name: "black-holes",
    title: "Black holes from free fall",
    paper: "-",
    finding: "Schwarzschild is hard to train, above all near the horizon.",
    pictures: &[Picture::BlackHole],
    reductions: &[],
    runs: || {
        let time = || "t".to_string();
        let mut black_box = config(Preset::Quick, HOLES[0]);
        black_box.take_structure(Structure::BlackBox);
        black_box.penalty = Regularizer::LorentzianSylvester { lambda: 100.0, time: time() };
        let mut spherical = config(Preset::Quick, "schwarzschild-geodesic");
        spherical.take_structure(Structure::Metric);
        spherical.network.cyclic = vec![time()];
        let beside = [
            run("black-box", format!("black box, {}", HOLES[0]), black_box),
            run("spherical", "spherical coordinates, schwarzschild-geodesic".to_string(), spherical),
        ];
        holes(Preset::Quick, "quick").chain(holes(Preset::Best, "best")).chain(beside).collect()
    },
};
