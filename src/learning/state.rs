//! Serializes the state of a computation to bytes, with exact numbers, for any type that serde supports.

use crate::names::one_line;
use crate::scalar::Scalar;
use crate::storage::container::{ContainerError, StoredPrecision};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Serializes a state; equal states give equal bytes.
///
/// # Errors
/// [`ContainerError::Header`] for types that serde cannot write.
pub fn to_bytes(state: &impl Serialize) -> Result<Vec<u8>, ContainerError> {
    postcard::to_allocvec(state).map_err(refused)
}

/// Deserializes the output of [`to_bytes`]; never panics, and allocates no more than a small multiple of the input.
///
/// # Errors
/// [`ContainerError::Header`] for anything else, including additional bytes.
pub fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, ContainerError> {
    match postcard::take_from_bytes(bytes).map_err(refused)? {
        (state, []) => Ok(state),
        (_, rest) => Err(ContainerError::Header(format!("state: {} bytes too many", rest.len()))),
    }
}

fn refused(error: postcard::Error) -> ContainerError {
    ContainerError::Header(format!("state: {}", one_line(&error.to_string())))
}

/// Numbers with the precision in which they were written.
#[derive(Serialize, Deserialize)]
enum Stored {
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// How serde writes and reads the numbers of a state: `#[serde(with = "numbers")]`. They are read in any precision.
pub mod numbers {
    use super::*;

    pub fn serialize<S: Scalar, W: Serializer>(numbers: &[S], serializer: W) -> Result<W::Ok, W::Error> {
        let stored = match StoredPrecision::of::<S>() {
            Some(StoredPrecision::F32) => Stored::F32(numbers.iter().map(|x| x.to_f64() as f32).collect()),
            Some(StoredPrecision::F64) => Stored::F64(numbers.iter().map(|x| x.to_f64()).collect()),
            None => return Err(serde::ser::Error::custom(format_args!("no file can hold {} numbers", S::NAME))),
        };
        stored.serialize(serializer)
    }

    pub fn deserialize<'de, S: Scalar, R: Deserializer<'de>>(deserializer: R) -> Result<Vec<S>, R::Error> {
        Ok(match Stored::deserialize(deserializer)? {
            Stored::F32(numbers) => numbers.into_iter().map(|x| S::of_f64(x.into())).collect(),
            Stored::F64(numbers) => numbers.into_iter().map(S::of_f64).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dd;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(bound = "S: Scalar")]
    struct State<S> {
        #[serde(with = "numbers")]
        numbers: Vec<S>,
        loss: f64,
    }

    #[test]
    fn numbers_come_back_to_the_last_bit_and_in_any_precision() {
        let state = State { numbers: vec![0.1_f32, f32::INFINITY, -0.0, 1e-45], loss: f64::NEG_INFINITY };
        let bytes = to_bytes(&state).unwrap();
        let back: State<f32> = from_bytes(&bytes).unwrap();
        let bits = |state: &State<f32>| state.numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!((bits(&back), back.loss), (bits(&state), state.loss));
        assert_eq!(from_bytes::<State<f64>>(&bytes).unwrap().numbers[0], f64::from(0.1_f32));
        for length in 0..bytes.len() {
            assert!(from_bytes::<State<f32>>(&bytes[..length]).is_err(), "cut at {length}");
        }
        assert!(from_bytes::<State<f32>>(&[&bytes[..], &[0]].concat()).is_err());
        assert!(to_bytes(&State { numbers: vec![Dd::from(1.0)], loss: 0.0 }).is_err());
    }

    /// A claimed length allocates no memory.
    #[test]
    fn claims_are_not_believed() {
        assert!(from_bytes::<Vec<f64>>(&[0xff, 0xff, 0xff, 0xff, 0xff, 0x7f]).is_err());
    }
}
