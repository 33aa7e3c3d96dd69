//! Builds trajectories row by row.

use super::Problem;
use super::select::Selection;
use super::thresholds::MOST_TRAJECTORIES;
use crate::recording::reading::Rows;
use crate::recording::{Columns, RecordedTrajectory};
use std::collections::HashMap;
use std::f64::consts::TAU;

/// A trajectory that is being read row by row.
pub struct TrackBuilder {
    /// Value of the column that distinguishes trajectories.
    pub label: Option<String>,
    /// Rows of its samples.
    pub rows: Rows,
    /// The measured track, its name empty.
    pub track: RecordedTrajectory,
    /// Standard deviations of its positions, `(samples, n)`; empty if there are none.
    pub error: Vec<f64>,
    /// Inputs, `(samples, inputs)`; empty if there are none.
    pub input: Vec<f64>,
    /// Which readings of positions are missing, `(samples, n)`; empty if none is.
    pub missing: Vec<bool>,
    /// The previous row, unprocessed.
    last: Vec<f64>,
    last_row: u64,
}

/// Trajectories of one file.
pub struct Builder<'a> {
    columns: &'a Columns,
    selection: Selection,
    periodic: Vec<bool>,
    current: usize,
    labels: HashMap<String, usize>,
    /// Number of rows to come, if it is known and they form a single trajectory.
    expected: usize,
    /// The trajectories so far.
    pub tracks: Vec<TrackBuilder>,
    /// Rows left out because they repeat the row before.
    pub duplicates: usize,
    /// Number of rows that are left out because a reading is missing, and the first one, with the column.
    pub incomplete: (usize, Option<(u64, String)>),
}

impl<'a> Builder<'a> {
    /// Creates a builder without rows.
    pub fn new(columns: &'a Columns, selection: Selection) -> Self {
        let periodic = columns.periodic();
        let (tracks, labels) = (Vec::new(), HashMap::new());
        Self {
            columns,
            selection,
            periodic,
            current: 0,
            labels,
            expected: 0,
            tracks,
            duplicates: 0,
            incomplete: (0, None),
        }
    }

    /// Which columns are used.
    pub fn selection(&self) -> &Selection {
        &self.selection
    }

    /// Announces the number of rows, so that memory is reserved once.
    pub fn expect(&mut self, rows: usize) {
        self.expected = if self.selection.trajectory.is_none() { rows } else { 0 };
    }

    /// The columns by the names that the file uses.
    pub fn columns_in_file(&self) -> Columns {
        self.selection.called(self.columns)
    }

    /// Adds a row: the unprocessed values of the used columns in the order of the selection, and the value that distinguishes trajectories
    /// if there is such a column.
    pub fn push(&mut self, row: u64, values: &[f64], label: Option<&str>) -> Result<(), Problem> {
        if self.is_incomplete(row, values) {
            return Ok(());
        }
        self.select_trajectory(row, label)?;
        if self.is_duplicate(row, values, label)? {
            self.duplicates += 1;
            return Ok(());
        }
        let Self { columns, selection, periodic, .. } = self;
        let Some(open) = self.tracks.get_mut(self.current) else { return Ok(()) };
        open.last.clear();
        open.last.extend_from_slice(values);
        open.last_row = row;
        open.append(row, values, (columns, selection, periodic))
    }

    /// `true` if a row repeats the row before in its trajectory.
    ///
    /// # Errors
    /// [`Problem::Order`] for a row that is not later than the row before.
    fn is_duplicate(&self, row: u64, values: &[f64], label: Option<&str>) -> Result<bool, Problem> {
        let Some(open) = self.tracks.get(self.current) else { return Ok(false) };
        // A negative factor of time turns its order around.
        let sign = self.selection.values[0].factor.signum();
        if !self.selection.timed || open.last.is_empty() || values[0] * sign > open.last[0] * sign {
            return Ok(false);
        }
        if values == open.last {
            return Ok(true);
        }
        if self.columns.whole && values[0] == open.last[0] {
            return Ok(false);
        }
        let hint = match (values[0] == open.last[0], label.is_none()) {
            (true, _) => " with other values",
            (false, true) => " (another trajectory? give it a file or a column of its own)",
            (false, false) => "",
        };
        let column = self.selection.values[0].name.clone();
        let (before_row, before) = (open.last_row, open.last[0]);
        Err(Problem::Order { row, column, before_row, before, found: values[0], hint })
    }

    /// Counts and skips a row if a reading is missing. A trajectory that stays whole keeps rows that have at least one position.
    fn is_incomplete(&mut self, row: u64, values: &[f64]) -> bool {
        let lacking = |x: &&f64| x.is_nan();
        let Some(first) = values.iter().position(|x| x.is_nan()) else { return false };
        let (start, n) = (usize::from(self.selection.timed), self.columns.coords.len());
        let positions = values[start..start + n].iter().filter(lacking).count();
        if self.columns.whole && positions < n && values.iter().filter(lacking).count() == positions {
            return false;
        }
        let column = || self.selection.values[first].name.clone();
        let (count, known) = &mut self.incomplete;
        *count += 1;
        known.get_or_insert_with(|| (row, column()));
        true
    }

    /// Finds or begins the trajectory of a label.
    fn select_trajectory(&mut self, row: u64, label: Option<&str>) -> Result<(), Problem> {
        if self.tracks.get(self.current).is_some_and(|open| open.label.as_deref() == label) {
            return Ok(());
        }
        if let Some(known) = label.and_then(|label| self.labels.get(label)) {
            self.current = *known;
            return Ok(());
        }
        if self.tracks.len() == MOST_TRAJECTORIES {
            let column = self.columns.trajectory.clone().unwrap_or_default();
            return Err(Problem::Trajectories { row, column, most: MOST_TRAJECTORIES });
        }
        self.current = self.tracks.len();
        if let Some(label) = label {
            self.labels.insert(label.to_string(), self.current);
        }
        let label = label.map(ToString::to_string);
        let room = |columns: usize| Vec::with_capacity(self.expected * columns);
        let Columns { coords, velocity, acceleration, force, .. } = self.columns;
        let track = RecordedTrajectory {
            times: room(1),
            q: room(coords.len()),
            v: room(velocity.len()),
            a: room(acceleration.len()),
            force: room(force.len()),
            ..empty()
        };
        let (rows, error, input, last) = (Rows::default(), Vec::new(), Vec::new(), Vec::new());
        self.tracks.push(TrackBuilder { label, rows, track, error, input, missing: Vec::new(), last, last_row: 0 });
        Ok(())
    }
}

impl TrackBuilder {
    /// Appends the values of a row in SI, angles unwrapped.
    fn append(
        &mut self,
        row: u64,
        values: &[f64],
        (columns, selection, periodic): (&Columns, &Selection, &[bool]),
    ) -> Result<(), Problem> {
        let (sample, track, n) = (self.track.times.len(), &mut self.track, columns.coords.len());
        self.rows.note(sample, row);
        let mut scaled = values.iter().zip(&selection.values).map(|(x, used)| {
            let y = x * used.factor;
            if y.is_finite() || x.is_nan() {
                Ok(y)
            } else {
                Err(Problem::Field { row, column: used.name.clone(), found: format!("{x} times {:e}", used.factor) })
            }
        });
        if selection.timed {
            for time in scaled.by_ref().take(1) {
                track.times.push(time?);
            }
        } else {
            track.times.push(sample as f64 / columns.rate.unwrap_or(1.0));
        }
        for (i, q) in scaled.by_ref().take(n).enumerate() {
            let q = q?;
            // An angle continues from its last reading.
            let last = || track.q.iter().skip(i).step_by(n).rev().find(|q| !q.is_nan());
            let turns = match periodic[i] && !q.is_nan() {
                true => last().map_or(0.0, |last| ((last - q) / TAU).round()),
                false => 0.0,
            };
            track.q.push(if turns == 0.0 { q } else { q + TAU * turns });
        }
        for (names, quantity) in [
            (&columns.velocity, &mut track.v),
            (&columns.acceleration, &mut track.a),
            (&columns.force, &mut track.force),
        ] {
            for value in scaled.by_ref().take(names.len()) {
                quantity.push(value?);
            }
        }
        for (name, error) in columns.error.iter().zip(scaled.by_ref()) {
            let error = error?;
            if error <= 0.0 {
                return Err(Problem::Error { row, column: name.clone(), found: error });
            }
            self.error.push(error);
        }
        for value in scaled {
            self.input.push(value?);
        }
        Ok(())
    }
}

/// No samples.
pub fn empty() -> RecordedTrajectory {
    let none = Vec::new;
    RecordedTrajectory { name: String::new(), times: none(), q: none(), v: none(), a: none(), force: none() }
}
