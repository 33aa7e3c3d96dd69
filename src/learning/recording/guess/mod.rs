//! Guesses the meaning of the columns of recorded motion: time, trajectories, coordinates, angles, velocities, accelerations and forces.
//!
//! Names decide first, then the numbers: a time increases, a velocity is the derivative of a position, an angle jumps by a turn.

mod angles;
mod names;
mod roles;
mod thresholds;
mod time;

use crate::recording::read::RawTable;
use crate::recording::{Columns, ColumnsError, DataError, LoadedRecording};
use serde::Serialize;
use std::path::Path;

/// The guessed meaning of a column.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ColumnGuess {
    /// Its name, `c` and its number in a file without a header.
    pub column: String,
    /// Its meaning in a word or two, such as `time` or `velocity of x`; `left out` of a column that is not used.
    pub meaning: String,
    /// The reason.
    pub because: String,
}

/// The guessed meaning of the columns of a file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Guess {
    /// The columns as they will be read; columns of numbers without another role are inputs.
    #[serde(skip)]
    pub columns: Columns,
    /// One entry for every column, in the order of the file.
    pub table: Vec<ColumnGuess>,
}

impl Guess {
    /// Reads files according to the guess. Inputs were not requested, so if a file lacks one, all are left out.
    ///
    /// # Errors
    /// Those of [`LoadedRecording::read`].
    pub fn read<P: AsRef<Path>>(&mut self, files: &[P]) -> Result<LoadedRecording, DataError> {
        LoadedRecording::read(files, &self.columns).or_else(|_| {
            self.columns.input.clear();
            LoadedRecording::read(files, &self.columns)
        })
    }

    /// Guesses the meaning of the columns in the first of some files, where `given` does not state it.
    ///
    /// A given time, rate, trajectory, force, velocity or acceleration is kept; given angles and units are added to the guessed ones.
    ///
    /// # Errors
    /// [`DataError`] for a file that cannot be read as a table, or in which no column can be a coordinate or the time.
    pub fn of<P: AsRef<Path>>(files: &[P], given: &Columns) -> Result<Self, DataError> {
        if given.wide {
            return Err(
                ColumnsError(vec!["coords: expected the columns of the coordinates beside wide".to_string()]).into()
            );
        }
        let Some(file) = files.first().map(AsRef::as_ref) else { return Err(DataError::NoFiles) };
        let mut table = RawTable::read(file, given.names.as_deref())?;
        let mut given = given.clone();
        if table.is_unnamed() {
            // Formulas cannot contain numbers as names.
            table.names.iter_mut().for_each(|name| name.insert(0, 'c'));
            given.names = Some(table.names.clone());
        }
        roles::guess(file, &table, &given)
    }
}

#[cfg(test)]
mod tests;
