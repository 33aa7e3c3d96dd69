//! A model file in five lines: its mass matrix at a state. `cargo run --example load_model -- FILE` takes another file.
//!
//! `lnn train double-pendulum --config examples/data/double_pendulum.toml --out DIR` made the file in `examples/data`.

use lnn::lagrangian::{EulerLagrange, Request, Terms};
use lnn::network::{ModelFile, NetworkLagrangian};
use std::path::Path;

pub const SHIPPED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/data/double_pendulum.safetensors");

fn main() -> Result<(), Box<dyn std::error::Error>> {
    show(&std::env::args().nth(1).unwrap_or(SHIPPED.to_string()))
}

pub fn show(path: &str) -> Result<(), Box<dyn std::error::Error>> {
    let ModelFile { header, weights } = ModelFile::<f64>::load(Path::new(path))?;
    let (n, columns) = (header.architecture.coordinates, header.columns);
    let (model, mut terms) = (NetworkLagrangian::new(header.architecture, weights)?, Terms::default());
    model.terms(&vec![0.5; n], &vec![0.1; n], Request::MASS_MATRIX | Request::ACCELERATION, &mut terms)?;
    println!("{}: M = {:.4?}, a = {:.4?}", columns.join(","), terms.mass_matrix, terms.acceleration);

    let symmetric = (0..n * n).all(|k| terms.mass_matrix[k] == terms.mass_matrix[k % n * n + k / n]);
    assert!(symmetric && terms.acceleration.iter().all(|a| a.is_finite()));
    if path == SHIPPED {
        // L is learned up to a factor, and so is M: ratios of its elements are those of the double pendulum,
        // M11 : M12 : M22 = 2 : cos(q1 - q2) : 1, as far as a network of 32 neurons has learned it.
        let [m11, m12, _, m22] = *terms.mass_matrix else { return Err("not a double pendulum".into()) };
        println!("M11/M22 = {:.3} (2 exactly), M12/M22 = {:.3} (1 exactly)", m11 / m22, m12 / m22);
        assert!((m11 / m22 - 2.0).abs() < 0.1 && (m12 / m22 - 1.0).abs() < 0.1);
    }
    Ok(())
}
