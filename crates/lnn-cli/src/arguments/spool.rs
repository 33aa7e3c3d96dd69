//! Copies recorded motion from standard input to a temporary file, because arrays are read in several passes.

use crate::arguments::input;
use crate::thresholds::SPOOL_ATTEMPTS;
use lnn::recording::{DataError, LoadedRecording, Problem};
use std::fs::{self, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

/// A temporary file, removed at the end.
struct Spool(PathBuf);

impl Spool {
    /// Copies standard input to its end.
    fn of_standard_input() -> io::Result<Self> {
        for attempt in 0..SPOOL_ATTEMPTS {
            let path = std::env::temp_dir().join(format!("lnn-{}-{attempt}.spool", std::process::id()));
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
                Ok(mut file) => {
                    let spool = Self(path);
                    io::copy(&mut io::stdin().lock(), &mut file)?;
                    return Ok(spool);
                }
            }
        }
        Err(io::ErrorKind::AlreadyExists.into())
    }
}

impl Drop for Spool {
    fn drop(&mut self) {
        // A temporary file left behind does no harm.
        let _ = fs::remove_file(&self.0);
    }
}

/// Reads files, one of which may be `-`, standard input; results use that name.
pub fn read_spooled(
    files: &[PathBuf],
    read: impl FnOnce(&[PathBuf]) -> Result<LoadedRecording, DataError>,
) -> Result<LoadedRecording, DataError> {
    let standard = input::name(Path::new("-"));
    let (mut found, mut spool) = (Vec::with_capacity(files.len()), None);
    for file in files {
        if !input::is_standard(file) {
            found.push(file.clone());
            continue;
        }
        if spool.is_none() {
            let failed = |error: io::Error| DataError::File { file: standard.clone(), problem: Problem::from(error) };
            spool = Some(Spool::of_standard_input().map_err(failed)?);
        }
        found.extend(spool.as_ref().map(|spool| spool.0.clone()));
    }
    let Some(spool) = spool else { return read(&found) };
    let path = spool.0.display().to_string();
    let named = |name: &str| name.replace(&path, &standard);
    match read(&found) {
        Ok(mut reading) => {
            reading.recording.tracks.iter_mut().for_each(|track| track.name = named(&track.name));
            reading.cuts.iter_mut().for_each(|cut| cut.file = named(&cut.file));
            reading.dropped.iter_mut().for_each(|part| part.file = named(&part.file));
            reading.formats.iter_mut().for_each(|facts| facts.file = named(&facts.file));
            Ok(reading)
        }
        Err(DataError::File { file, problem }) => Err(DataError::File { file: named(&file), problem }),
        Err(error) => Err(error),
    }
}
