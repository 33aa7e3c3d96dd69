//! A header and tensors in a safetensors file with a checksum: the format of model files and checkpoints.
//!
//! The metadata have one key, whose value is a JSON object with the fields of the header and `checksum`: eight hexadecimal digits, the
//! CRC-32 (IEEE) of that JSON text up to the comma before `"checksum"`, followed by the bytes of the tensors in the order of the file. The
//! same content always gives the same bytes, and a file with a changed bit is rejected.

use crate::names::one_line;
use crate::scalar::Scalar;
use crate::storage::ReadError;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::de::{DeserializeOwned, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, HashSet};
use std::fmt;
use thiserror::Error;

/// Size of the largest header that is read, in bytes.
pub(crate) const MAX_HEADER: u64 = 1 << 20;

/// Identification of one kind of file.
#[derive(Clone, Copy, Debug)]
pub struct FileKind {
    /// Name in messages, such as model or checkpoint.
    pub name: &'static str,
    /// The only metadata key; with two keys, the order of bytes would vary from run to run.
    pub key: &'static str,
    /// Format that this version writes and reads, the field `format` of the header.
    pub format: u32,
}

/// A tensor to be written to a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    name: String,
    shape: Vec<usize>,
    dtype: Dtype,
    bytes: Vec<u8>,
}

impl Tensor {
    /// Creates a tensor from numbers of this shape, rounded to the precision (exactly, if they were read with that precision).
    pub fn new<S: Scalar>(name: String, shape: Vec<usize>, numbers: &[S], precision: StoredPrecision) -> Self {
        let bytes = match precision {
            StoredPrecision::F32 => numbers.iter().flat_map(|x| x.cast::<f32>().to_le_bytes()).collect(),
            StoredPrecision::F64 => numbers.iter().flat_map(|x| x.to_f64().to_le_bytes()).collect(),
        };
        Self { name, shape, dtype: stored_dtype(precision), bytes }
    }

    /// Creates a tensor of raw bytes.
    pub fn bytes(name: String, bytes: Vec<u8>) -> Self {
        Self { name, shape: vec![bytes.len()], dtype: Dtype::U8, bytes }
    }
}

fn stored_dtype(precision: StoredPrecision) -> Dtype {
    match precision {
        StoredPrecision::F32 => Dtype::F32,
        StoredPrecision::F64 => Dtype::F64,
    }
}

pub(crate) fn checksum_field(checksum: u32) -> String {
    format!(",\"checksum\":\"{checksum:08x}\"}}")
}

/// Computes the CRC-32 (IEEE) of the numbers, rounded to the precision, as little-endian bytes.
pub fn checksum<'a, S: Scalar>(numbers: impl IntoIterator<Item = &'a S>, precision: StoredPrecision) -> u32 {
    let mut checksum = crc32fast::Hasher::new();
    for x in numbers {
        match precision {
            StoredPrecision::F32 => checksum.update(&x.cast::<f32>().to_le_bytes()),
            StoredPrecision::F64 => checksum.update(&x.to_f64().to_le_bytes()),
        }
    }
    checksum.finalize()
}

/// Computes the CRC-32 (IEEE) of a text as eight hexadecimal digits.
pub fn text_checksum(text: &str) -> String {
    format!("{:08x}", crc32fast::hash(text.as_bytes()))
}

/// Returns the bytes of a file; the header must have the fields `format` and `crate_version`.
///
/// # Errors
/// [`ContainerError::Header`] or [`ContainerError::NotSafetensors`] for contents that cannot be written.
pub fn pack(kind: &FileKind, header: &impl Serialize, mut tensors: Vec<Tensor>) -> Result<Vec<u8>, ContainerError> {
    // Sort the payload in the order that safetensors uses.
    tensors.sort_by(|a, b| b.dtype.cmp(&a.dtype).then_with(|| a.name.cmp(&b.name)));
    let text = serde_json::to_string(header).map_err(|e| ContainerError::Header(e.to_string()))?;
    let body = text.strip_suffix('}').unwrap_or(&text);
    let mut checksum = crc32fast::Hasher::new();
    checksum.update(body.as_bytes());
    tensors.iter().for_each(|tensor| checksum.update(&tensor.bytes));
    let text = format!("{body}{}", checksum_field(checksum.finalize()));
    let views = tensors
        .iter()
        .map(|tensor| Ok((&tensor.name, TensorView::new(tensor.dtype, tensor.shape.clone(), &tensor.bytes)?)))
        .collect::<Result<Vec<_>, _>>()
        .map_err(damaged)?;
    safetensors::serialize(views, Some(HashMap::from([(kind.key.to_string(), text)]))).map_err(damaged)
}

/// Parses the header and the tensors of a file; never panics and allocates at most a small multiple of its bytes.
///
/// # Errors
/// [`ContainerError`] for anything except an undamaged file of this kind and format.
pub fn unpack<'a, H: DeserializeOwned>(kind: &FileKind, bytes: &'a [u8]) -> Result<(H, Tensors<'a>), ContainerError> {
    check_container(bytes)?;
    let (start, metadata) = SafeTensors::read_metadata(bytes).map_err(damaged)?;
    let foreign = || ContainerError::Foreign { kind: kind.name, key: kind.key };
    let map = metadata.metadata().as_ref().ok_or_else(foreign)?;
    let header = read_header(kind, map.get(kind.key).ok_or_else(foreign)?, &bytes[8 + start..])?;
    if map.len() != 1 {
        return Err(ContainerError::Header(format!("expected {:?} as the only metadata key", kind.key)));
    }
    Ok((header, Tensors(SafeTensors::deserialize(bytes).map_err(damaged)?)))
}

/// The tensors of a file.
#[derive(Debug)]
pub struct Tensors<'a>(SafeTensors<'a>);

impl Tensors<'_> {
    /// Rejects unknown tensors.
    ///
    /// # Errors
    /// [`ContainerError::ExtraTensor`] with the first unknown name in alphabetical order.
    pub fn check_names(&self, known: impl Fn(&str) -> bool) -> Result<(), ContainerError> {
        let mut names = self.0.names();
        names.sort_unstable();
        match names.iter().find(|name| !known(name)) {
            Some(extra) => Err(ContainerError::ExtraTensor(extra.escape_debug().take(60).collect())),
            None => Ok(()),
        }
    }

    /// Returns a tensor of this shape and precision, converted to `S`: widening is exact, narrowing rounds to nearest.
    ///
    /// # Errors
    /// The tensor is missing, or has another type or shape.
    pub fn numbers<S: Scalar>(
        &self,
        name: &str,
        shape: &[usize],
        precision: StoredPrecision,
    ) -> Result<Vec<S>, ContainerError> {
        let data = self.data(name, shape, stored_dtype(precision), precision.name())?;
        Ok(match precision {
            StoredPrecision::F32 => {
                data.as_chunks().0.iter().map(|b| S::of_f64(f64::from(f32::from_le_bytes(*b)))).collect()
            }
            StoredPrecision::F64 => data.as_chunks().0.iter().map(|b| S::of_f64(f64::from_le_bytes(*b))).collect(),
        })
    }

    /// Returns a tensor of raw bytes.
    ///
    /// # Errors
    /// The tensor is missing, or has another type.
    pub fn bytes(&self, name: &str) -> Result<&[u8], ContainerError> {
        let length = self.0.tensor(name).map_or(0, |tensor| tensor.data().len());
        self.data(name, &[length], Dtype::U8, "u8")
    }

    fn data(&self, name: &str, shape: &[usize], dtype: Dtype, expected: &'static str) -> Result<&[u8], ContainerError> {
        let tensor = self.0.tensor(name).map_err(|_| ContainerError::MissingTensor(name.to_string()))?;
        let name = name.to_string();
        if tensor.dtype() != dtype {
            let found = format!("{:?}", tensor.dtype()).to_lowercase();
            return Err(ContainerError::WrongType { name, expected, found });
        }
        if tensor.shape() != shape {
            return Err(ContainerError::WrongShape { name, expected: shape.to_vec(), found: tensor.shape().to_vec() });
        }
        Ok(tensor.data())
    }
}

fn damaged(error: safetensors::SafeTensorError) -> ContainerError {
    ContainerError::NotSafetensors(one_line(&error.to_string()))
}

/// Rejects formats that this version cannot read.
pub(crate) fn check_version(supported: u32, found: u32, writer: &str) -> Result<(), ContainerError> {
    if found == supported {
        return Ok(());
    }
    let (reader, writer) = (env!("CARGO_PKG_VERSION"), writer.escape_debug().take(40).collect());
    Err(ContainerError::Version { writer, found, reader, supported })
}

/// Limits the size of the header before it is parsed, and rejects ambiguous ones.
fn check_container(bytes: &[u8]) -> Result<(), ContainerError> {
    let refuse = |text: &str| Err(ContainerError::NotSafetensors(text.to_string()));
    let Some(length) = bytes.first_chunk::<8>().map(|b| u64::from_le_bytes(*b)) else {
        return refuse("shorter than 8 bytes");
    };
    if length > MAX_HEADER {
        return refuse("the description is longer than 1 MiB");
    }
    match bytes[8..].get(..length as usize) {
        None => refuse("cut off"),
        Some(text) => check_unambiguous(text).map_err(|e| ContainerError::NotSafetensors(one_line(&e.to_string()))),
    }
}

/// Parses the header after checking its version and checksum.
fn read_header<H: DeserializeOwned>(kind: &FileKind, text: &str, payload: &[u8]) -> Result<H, ContainerError> {
    /// The fields that every version of the format has.
    #[derive(Deserialize)]
    struct Version {
        format: u32,
        crate_version: String,
    }
    let malformed = |e: serde_json::Error| ContainerError::Header(one_line(&e.to_string()));
    let version: Version = serde_json::from_str(text).map_err(malformed)?;
    check_version(kind.format, version.format, &version.crate_version)?;

    let missing = || ContainerError::Header("no checksum".to_string());
    let cut = text.len().checked_sub(checksum_field(0).len()).ok_or_else(missing)?;
    let (body, field) = text.split_at_checked(cut).ok_or_else(missing)?;
    let digits =
        field.strip_prefix(",\"checksum\":\"").and_then(|rest| rest.strip_suffix("\"}")).ok_or_else(missing)?;
    let expected = u32::from_str_radix(digits, 16).map_err(|_| missing())?;
    let mut checksum = crc32fast::Hasher::new();
    checksum.update(body.as_bytes());
    checksum.update(payload);
    let found = checksum.finalize();
    // Comparing the text as well rejects the same digits in another notation.
    if found != expected || field != checksum_field(expected) {
        return Err(ContainerError::Checksum { expected, found });
    }
    let body = format!("{body}}}");
    check_unambiguous(body.as_bytes()).map_err(malformed)?;
    serde_json::from_str(&body).map_err(malformed)
}

/// The reason why a model file, or another file of the same format, could not be written or read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ContainerError {
    /// The file is missing, not a regular file, too large, or the system reported an error.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file could not be written; its previous content is unchanged.
    #[error("cannot write: {0}")]
    Write(std::io::Error),
    /// The file is not a safetensors file, or it is truncated or its structure is damaged.
    #[error("not a whole safetensors file: {0}")]
    NotSafetensors(String),
    /// The safetensors file belongs to another program or purpose.
    #[error("a safetensors file, but not of an lnn {kind} (no {key:?} metadata)")]
    Foreign {
        /// Expected kind, such as a model.
        kind: &'static str,
        /// Its metadata key.
        key: &'static str,
    },
    /// A later version wrote the file.
    #[error("written by lnn {writer} in format {found}; lnn {reader} reads format {supported}")]
    Version {
        /// Version of the crate that wrote the file.
        writer: String,
        /// Format of the file.
        found: u32,
        /// Version of this crate.
        reader: &'static str,
        /// Format that this crate reads.
        supported: u32,
    },
    /// Bytes have changed since the file was written.
    #[error("damaged: checksum {found:08x}, expected {expected:08x}")]
    Checksum {
        /// Checksum in the file.
        expected: u32,
        /// Checksum computed from its bytes.
        found: u32,
    },
    /// The header is inconsistent.
    #[error("description: {0}")]
    Header(String),
    /// A tensor of the architecture is missing.
    #[error("tensor {0} is missing")]
    MissingTensor(String),
    /// The architecture does not contain this tensor.
    #[error("tensor {0} does not belong to this architecture")]
    ExtraTensor(String),
    /// The number type of a tensor differs from the header.
    #[error("tensor {name}: expected {expected}, found {found}")]
    WrongType {
        /// Name of the tensor.
        name: String,
        /// Type in the header.
        expected: &'static str,
        /// Type in the file.
        found: String,
    },
    /// The shape of a tensor differs from the architecture.
    #[error("tensor {name}: expected shape {expected:?}, found {found:?}")]
    WrongShape {
        /// Name of the tensor.
        name: String,
        /// Shape in the architecture.
        expected: Vec<usize>,
        /// Shape in the file.
        found: Vec<usize>,
    },
    /// A weight is infinite or not a number.
    #[error("tensor {name}: number {index} is not finite")]
    NotFinite {
        /// Name of the tensor.
        name: String,
        /// Index in the tensor, row-major from 0.
        index: usize,
    },
    /// The number of weights differs from the architecture.
    #[error("expected {expected} weights, found {found}")]
    WrongLength {
        /// Number of weights in the architecture.
        expected: usize,
        /// Number of given weights.
        found: usize,
    },
}

/// Any JSON value in which no object contains a key twice.
struct Unambiguous;

/// Checks that no object in `text` names a key twice, at any depth.
fn check_unambiguous(text: &[u8]) -> Result<(), serde_json::Error> {
    serde_json::from_slice::<Unambiguous>(text).map(|_| ())
}

impl<'de> Deserialize<'de> for Unambiguous {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Unambiguous)
    }
}

impl<'de> Visitor<'de> for Unambiguous {
    type Value = Self;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self, A::Error> {
        let mut seen = HashSet::new();
        while let Some(key) = map.next_key::<String>()? {
            if seen.contains(&key) {
                return Err(serde::de::Error::custom(format_args!("duplicate key {key:?}")));
            }
            map.next_value::<Unambiguous>()?;
            seen.insert(key);
        }
        Ok(self)
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self, A::Error> {
        while seq.next_element::<Unambiguous>()?.is_some() {}
        Ok(self)
    }
    fn visit_bool<E>(self, _: bool) -> Result<Self, E> {
        Ok(self)
    }
    fn visit_i64<E>(self, _: i64) -> Result<Self, E> {
        Ok(self)
    }
    fn visit_u64<E>(self, _: u64) -> Result<Self, E> {
        Ok(self)
    }
    fn visit_f64<E>(self, _: f64) -> Result<Self, E> {
        Ok(self)
    }
    fn visit_str<E>(self, _: &str) -> Result<Self, E> {
        Ok(self)
    }
    fn visit_unit<E>(self) -> Result<Self, E> {
        Ok(self)
    }
}

/// Number type in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StoredPrecision {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

impl StoredPrecision {
    /// Returns the precision of a number type, if files support it.
    pub fn of<S: Scalar>() -> Option<Self> {
        [Self::F32, Self::F64].into_iter().find(|precision| precision.name() == S::NAME)
    }
    /// Returns `"f32"` or `"f64"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::check_unambiguous;

    #[test]
    fn duplicates_are_found_at_any_depth() {
        assert!(check_unambiguous(br#"{"a": [1, -2.5, null, true, "x", {"b": {}}], "b": 1}"#).is_ok());
        assert!(check_unambiguous(br#"{"a": 1, "a": 2}"#).is_err());
        assert!(check_unambiguous(br#"{"c": [{"a": 1, "\u0061": 2}]}"#).is_err());
        assert!(check_unambiguous("[".repeat(100_000).as_bytes()).is_err());
    }
}
