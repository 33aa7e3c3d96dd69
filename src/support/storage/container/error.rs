//! Why a model file, or another file of the same make, could not be written or read.

use crate::storage::ReadError;
use thiserror::Error;

/// Why a model file, or another file of the same make, could not be written or read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ContainerError {
    /// Missing, not a regular file, too large, or refused by the system.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file could not be written; what stood there before still does.
    #[error("cannot write: {0}")]
    Write(std::io::Error),
    /// Not a safetensors file, or one that is cut off or damaged in its structure.
    #[error("not a whole safetensors file: {0}")]
    NotSafetensors(String),
    /// A safetensors file of another program or purpose.
    #[error("a safetensors file, but not of an lnn {kind} (no {key:?} metadata)")]
    Foreign {
        /// Expected kind, such as a model.
        kind: &'static str,
        /// Its metadata key.
        key: &'static str,
    },
    /// Written by a later version.
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
    /// Bytes changed since the file was written.
    #[error("damaged: checksum {found:08x}, expected {expected:08x}")]
    Checksum {
        /// Checksum in the file.
        expected: u32,
        /// Checksum of its bytes.
        found: u32,
    },
    /// The description makes no sense.
    #[error("description: {0}")]
    Header(String),
    /// A tensor that the architecture asks for is not there.
    #[error("tensor {0} is missing")]
    MissingTensor(String),
    /// A tensor that the architecture does not know.
    #[error("tensor {0} does not belong to this architecture")]
    ExtraTensor(String),
    /// A tensor has another number type than the description says.
    #[error("tensor {name}: expected {expected}, found {found}")]
    WrongType {
        /// Name of the tensor.
        name: String,
        /// Type by the description.
        expected: &'static str,
        /// Type in the file.
        found: String,
    },
    /// A tensor has another shape than the architecture says.
    #[error("tensor {name}: expected shape {expected:?}, found {found:?}")]
    WrongShape {
        /// Name of the tensor.
        name: String,
        /// Shape by the architecture.
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
    /// The number of weights is not that of the architecture.
    #[error("expected {expected} weights, found {found}")]
    WrongLength {
        /// By the architecture.
        expected: usize,
        /// Given.
        found: usize,
    },
}
