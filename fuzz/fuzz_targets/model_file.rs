//! Any bytes as a model file: refused with an error, or read and written back the same.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lnn::network::file::ModelFile;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(model) = ModelFile::<f64>::from_bytes(bytes) {
        let written = model.to_bytes().expect("a model that was read can be written");
        assert_eq!(ModelFile::<f64>::from_bytes(&written).expect("and read again"), model);
    }
});
