//! Penalties against exact mass matrices.

use lnn::configuration::{Config, Penalty};
use lnn::data::Datasets;
use lnn::lagrangian::{Request, Terms};
use lnn::linalg::{SignatureBuffers, has_signature};
use std::collections::BTreeMap;

/// Asserts that every penalty of these configurations, taken once per system, allows the exact mass matrices of its training states; how many
/// there are.
pub fn allow_the_truth(configs: impl Iterator<Item = Config>) -> usize {
    let chosen = configs.map(|config| (format!("{}, {:?}", config.system, config.penalty().unwrap()), config));
    let chosen: BTreeMap<String, Config> = chosen.filter(|(_, config)| config.penalty.lambda() > 0.0).collect();
    for (name, config) in &chosen {
        let system = config.system().unwrap();
        let time = match config.penalty().unwrap() {
            Penalty::Sylvester { time, .. } => time,
            _ => None,
        };
        let (data, _) = Datasets::<f64>::sample(config, &system).unwrap();
        let (mut terms, mut buffers, n) = (Terms::default(), SignatureBuffers::default(), system.coordinates);
        for set in &data.training {
            system.build().unwrap().terms(set.q(), set.v(), Request::MASS_MATRIX, &mut terms).unwrap();
            let wrong = |mass: &&[f64]| !has_signature(n, mass, time, &mut buffers);
            assert_eq!(terms.mass_matrix.chunks(n * n).filter(wrong).count(), 0, "{name}");
        }
    }
    chosen.len()
}
