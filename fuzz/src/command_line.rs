//! Any arguments: understood, or refused with a usage error of one line. Zero bytes separate them; nothing is run.

use lnn_cli::{Kind, check_arguments};
use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;

/// Reads the bytes.
pub fn run(bytes: &[u8]) {
    let arguments = bytes.split(|&b| b == 0).map(|argument| OsString::from_vec(argument.to_vec()));
    if let Err(error) = check_arguments(std::iter::once("lnn".into()).chain(arguments)) {
        assert_eq!(error.kind(), Kind::Usage);
        assert_eq!(error.to_string().lines().count(), 1, "{error}");
    }
}
