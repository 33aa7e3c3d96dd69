//! Any bytes as a model file: refused with an error, or read and written back as the same model, in the same bytes
//! from then on. A model that was read can be evaluated.

use super::sealed::sealed;
use lnn::lagrangian::{EulerLagrange, Request, Terms};
use lnn::network::{ModelFile, NetworkLagrangian};

/// Weights up to which a model is evaluated too.
const SMALL: usize = 1 << 12;

/// Reads the bytes as they are, and with a checksum that fits.
pub fn run(bytes: &[u8]) {
    read(bytes);
    if let Some(bytes) = sealed(bytes, "lnn") {
        read(&bytes);
    }
}

fn read(bytes: &[u8]) {
    let model = match ModelFile::<f64>::from_bytes(bytes) {
        Ok(model) => model,
        Err(error) => return assert_eq!(error.to_string().lines().count(), 1, "{error:?}"),
    };
    let written = model.to_bytes().expect("a model that was read can be written");
    let again = ModelFile::<f64>::from_bytes(&written).expect("and read again");
    assert_eq!(again, model);
    assert_eq!(again.to_bytes().expect("and written again"), written);

    let ModelFile { header, weights } = model;
    let n = header.architecture.coordinates;
    if weights.len() > SMALL || header.architecture.hidden.iter().any(|width| *width > SMALL) || n > 8 {
        return;
    }
    let network = NetworkLagrangian::new(header.architecture, weights).expect("the reader has tested the shapes");
    let mut terms = Terms::default();
    // Numbers may overflow, which is an error like any other.
    let _ = network.terms(&vec![0.5; n], &vec![-0.25; n], Request::ALL, &mut terms);
    assert_eq!(terms.mass_matrix.len(), n * n);
}
