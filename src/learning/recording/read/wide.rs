//! Trajectories side by side in the rows of a text.

use super::Problem;
use super::builder::Builder;
use super::error::Faults;
use super::number::Numbers;

/// One of the trajectories side by side, or all trajectories of a file that has none side by side.
pub struct Lane<'a> {
    /// Builds the trajectory.
    pub builder: Builder<'a>,
    /// Used numbers of the current row.
    pub values: Vec<f64>,
    /// First row without numbers after the start of the trajectory.
    empty: Option<u64>,
}

impl<'a> Lane<'a> {
    /// Creates a lane without rows.
    pub fn new(builder: Builder<'a>) -> Self {
        let values = vec![0.0; builder.selection().values.len()];
        Self { builder, values, empty: None }
    }

    /// Reads its numbers from the fields of a row; a row in which all its fields except the time are empty is skipped.
    pub fn take(
        &mut self,
        fields: &[&[u8]],
        row: u64,
        numbers: &mut Numbers,
        faults: &mut Faults,
    ) -> Result<(), Problem> {
        let selection = self.builder.selection();
        let own = &selection.values[usize::from(selection.timed)..];
        if own.iter().all(|used| matches!(fields[used.position].trim_ascii(), b"" | b"\"\"")) {
            if !self.builder.tracks.is_empty() {
                self.empty.get_or_insert(row);
            }
            return Ok(());
        }
        if let (Some(row), false) = (self.empty, selection.timed) {
            // Without times the length of such a gap is unknown.
            let column = own.first().map(|used| used.name.clone()).unwrap_or_default();
            return Err(Problem::Field { row, column, found: String::new() });
        }
        for (value, used) in self.values.iter_mut().zip(&selection.values) {
            let field = fields[used.position];
            match numbers.parse(field, row) {
                Some(x) => *value = x,
                None => faults.add(numbers.refusal(field, row, &used.name)),
            }
        }
        if !faults.is_empty() {
            return Ok(());
        }
        let number = selection.number.clone();
        self.builder.push(row, &self.values, number.as_deref())
    }
}
