//! Writes the samples of a roll-out to a CSV: records them, adds further columns, and writes them as they arrive.

use super::readings::ReadingColumns;
use crate::CliError;
use crate::arguments::input;
use crate::arguments::motion_source::MotionSource;
use crate::directories::files::cannot_write;
use crate::terminal::output;
use lnn::analysis::MotionTube;
use lnn::report::MotionRecord;
use lnn::rollout::{Trajectory, quoted};
use lnn::scalar::Scalar;
use lnn::storage::{AtomicWriter, Disk, remove_leftovers};
use std::path::Path;

/// Columns that follow state and energy.
pub struct MoreColumns<'a> {
    /// The limits of a tube around the coordinates.
    pub tube: Option<MotionTube>,
    /// Measured quantities of a system.
    pub readings: Option<ReadingColumns<'a>>,
}

/// The samples of a motion.
pub struct Samples<'a> {
    /// The file, which is renamed to its final name when it is complete; `None` for standard output.
    file: Option<(&'a Path, AtomicWriter<'a>)>,
    /// Further columns.
    pub more: MoreColumns<'a>,
    /// Record of the motion.
    pub watch: MotionRecord,
    /// All states, if they are needed at the end.
    pub kept: Option<Trajectory<f64>>,
}

impl<'a> Samples<'a> {
    /// Begins to write, with the header; keeps the states if `keep` says so.
    ///
    /// # Errors
    /// A file that cannot be written, a closed pipe.
    pub fn create(out: &'a Path, source: &MotionSource, more: MoreColumns<'a>, keep: bool) -> Result<Self, CliError> {
        let file = if input::is_standard(out) { None } else { Some((out, begin(out)?)) };
        let empty = Trajectory::<f64>::empty(source.columns.len() / 2);
        let header = Trajectory { energy: Some(vec![]), ..empty.clone() };
        let mut header = header.csv_header(&source.columns).map_err(CliError::data)?.trim_end().to_string();
        let tube = more.tube.iter().flat_map(MotionTube::names);
        for name in tube.chain(more.readings.iter().flat_map(ReadingColumns::names)) {
            header += &format!(",{}", quoted(&name));
        }
        let watch = MotionRecord::new(source.range(), &source.columns);
        let mut samples = Self { file, more, watch, kept: keep.then_some(empty) };
        samples.append(&(header + "\n"))?;
        Ok(samples)
    }

    /// Processes the next samples.
    ///
    /// # Errors
    /// A closed pipe, a full disk.
    pub fn take(&mut self, piece: &Trajectory<f64>) -> Result<(), CliError> {
        self.watch.add(piece);
        if let Some(kept) = &mut self.kept {
            kept.t.extend(&piece.t);
            kept.q.extend(&piece.q);
            kept.v.extend(&piece.v);
        }
        let mut text = String::new();
        for (k, line) in piece.csv_rows().lines().enumerate() {
            let (t, state) = (piece.t[k], piece.state(k));
            text += line;
            let tube = self.more.tube.iter().flat_map(|tube| tube.ends(t, state.0)).flatten();
            for x in tube {
                text += &format!(",{}", x.to_text());
            }
            for x in self.more.readings.iter().flat_map(|readings| readings.at(t, state)) {
                text += &format!(",{}", if x.is_finite() { x.to_text() } else { String::new() });
            }
            text.push('\n');
        }
        self.append(&text)
    }

    fn append(&mut self, text: &str) -> Result<(), CliError> {
        match &mut self.file {
            None => output::print(text),
            Some((path, growing)) => growing.append(text.as_bytes()).map_err(|e| cannot_write(path, e)),
        }
    }

    /// Renames the file to its final name, and returns the recorded data.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(self) -> Result<Recorded, CliError> {
        if let Some((path, growing)) = self.file {
            growing.finish().map_err(|e| cannot_write(path, e))?;
        }
        Ok((self.watch, self.more.tube, self.kept))
    }
}

/// The record of a motion, its tube, and the motion itself if pictures need it.
type Recorded = (MotionRecord, Option<MotionTube>, Option<Trajectory<f64>>);

/// Creates a file, after removing temporary files of killed processes from its directory.
fn begin(path: &Path) -> Result<AtomicWriter<'_>, CliError> {
    if let Some(folder) = path.parent() {
        remove_leftovers(&Disk, if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
    }
    AtomicWriter::create(&Disk, path).map_err(|e| cannot_write(path, e))
}
