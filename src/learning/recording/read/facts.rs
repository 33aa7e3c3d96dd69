//! The format that was recognised in a file that does not state it.

use super::encoding::Encoding;
use super::text::Separator;
use serde::Serialize;
use std::collections::BTreeMap;

/// Format of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FileKind {
    /// Text of numbers.
    #[default]
    Text,
    /// An array of NumPy.
    Npy,
    /// Arrays of NumPy.
    Npz,
    /// A workbook of Excel, its first sheet.
    Xlsx,
}

/// How a file was read: the properties that it does not state and that were recognised.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FileFacts {
    /// The file.
    pub file: String,
    /// Its format.
    pub kind: FileKind,
    /// `true` if gzip has packed it.
    pub gzip: bool,
    /// Encoding of a text.
    pub encoding: Option<Encoding>,
    /// Separator of the fields of a text.
    pub separator: Option<Separator>,
    /// `true` if its decimals have a comma.
    pub decimal_comma: bool,
    /// Units that headers give, by used column; the numbers were converted from them.
    pub units: BTreeMap<String, String>,
}
