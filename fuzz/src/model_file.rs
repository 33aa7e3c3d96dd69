//! Any bytes as a model file: refused with an error, or read and written back as the same model, in the same bytes
//! from then on.

use lnn::network::file::ModelFile;

/// Reads the bytes.
pub fn run(bytes: &[u8]) {
    let Ok(model) = ModelFile::<f64>::from_bytes(bytes) else { return };
    let written = model.to_bytes().expect("a model that was read can be written");
    let again = ModelFile::<f64>::from_bytes(&written).expect("and read again");
    assert_eq!(again, model);
    assert_eq!(again.to_bytes().expect("and written again"), written);
}
