//! ZIP archives, and a limit for the size of unpacked data.

use super::Problem;
use super::shared::Shared;
use super::thresholds::{MOST_EXPANSION, UNPACKED_ANYWAY};
use zip::ZipArchive;
use zip::result::ZipError;

/// First bytes of an archive, and of one without a single entry.
pub const MAGIC: [&[u8]; 2] = [b"PK\x03\x04", b"PK\x05\x06"];

/// Largest number of bytes that `packed` bytes may unpack to.
pub fn most_unpacked(packed: u64) -> u64 {
    UNPACKED_ANYWAY.max(packed.saturating_mul(MOST_EXPANSION))
}

/// An archive that cannot be read.
pub fn broken(error: ZipError) -> Problem {
    match error {
        ZipError::Io(error) => Problem::Io(error),
        ZipError::UnsupportedArchive(what) => Problem::Array(format!("an unsupported archive: {what}")),
        _ => Problem::Array("an incomplete or damaged archive".to_string()),
    }
}

/// Opens an archive.
pub fn open(file: Shared) -> Result<ZipArchive<Shared>, Problem> {
    ZipArchive::new(file).map_err(broken)
}

/// Names of the entries.
pub fn names(archive: &ZipArchive<Shared>) -> Result<Vec<String>, Problem> {
    archive.file_names().map(|name| name.map(|name| name.to_string()).map_err(broken)).collect()
}

/// Rejects entries that unpack to far more bytes than their packed size allows.
pub fn bounded(archive: &mut ZipArchive<Shared>, used: impl IntoIterator<Item = usize>) -> Result<(), Problem> {
    let (mut size, mut compressed) = (0u64, 0u64);
    for index in used {
        let entry = archive.by_index_raw(index).map_err(broken)?;
        size = size.saturating_add(entry.size());
        compressed = compressed.saturating_add(entry.compressed_size());
    }
    if size > most_unpacked(compressed) {
        return Err(Problem::Array(format!(
            "the archive says that {compressed} bytes unpack to {size}, more than {MOST_EXPANSION} times as many: save it \
             without compression"
        )));
    }
    Ok(())
}
