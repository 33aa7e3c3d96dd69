//! Any bytes as a checkpoint: refused with an error, or read and written back in the same bytes from then on.

use super::sealed::sealed;
use lnn::scalar::Scalar;
use lnn::training::Snapshot;

/// Reads the bytes as they are, and with a checksum that fits.
pub fn run(bytes: &[u8]) {
    let sealed = sealed(bytes, "lnn-checkpoint");
    for bytes in std::iter::once(bytes).chain(sealed.as_deref()) {
        read::<f32>(bytes);
        read::<f64>(bytes);
    }
}

fn read<S: Scalar>(bytes: &[u8]) {
    let (identity, snapshot) = match Snapshot::<S>::from_bytes(bytes) {
        Ok(found) => found,
        Err(error) => return assert_eq!(error.to_string().lines().count(), 1, "{error:?}"),
    };
    let written = snapshot.to_bytes(&identity).expect("a checkpoint that was read can be written");
    let (same, again) = Snapshot::<S>::from_bytes(&written).expect("and read again");
    assert_eq!((same, again.steps(), again.epochs()), (identity.clone(), snapshot.steps(), snapshot.epochs()));
    assert_eq!(again.to_bytes(&identity).expect("and written again"), written);
}
