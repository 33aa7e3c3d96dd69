//! Known forces by formulas of the time and of other columns, such as `=0.3*cos(1.2*t)` or `=K*current` with a number for `K`.

use crate::lagrangian::NamedFormula;
use crate::recording::columns::{TIME, formula_in};
use crate::recording::reading::LoadedRecording;
use crate::recording::{Columns, ColumnsError};

/// The forces on the coordinates; some of them are formulas.
pub struct ForceFormulas {
    /// A formula for each coordinate; for a column, its name.
    formulas: Vec<ForceSource>,
    /// Inputs that are read only for the formulas, after the requested ones.
    for_formulas: Vec<String>,
    requested: usize,
}

/// Where a force comes from.
enum ForceSource {
    Column(String),
    Formula(String, NamedFormula),
}

impl ForceFormulas {
    /// The formulas of a description of columns, and the description of the columns to read for them; none if every force is a column.
    ///
    /// # Errors
    /// [`ColumnsError`]: a mistake in a formula, or another number of forces than of coordinates.
    pub fn of(columns: &Columns) -> Result<Option<(Self, Columns)>, ColumnsError> {
        if !columns.force.iter().any(|text| formula_in(text).is_some()) {
            return Ok(None);
        }
        columns.count_faults()?;
        let given = |text: &String| match formula_in(text) {
            None => Ok(ForceSource::Column(text.clone())),
            Some(formula) => match formula.parse() {
                Ok(parsed) => Ok(ForceSource::Formula(text.clone(), parsed)),
                Err(error) => Err(ColumnsError(vec![format!("force: {text}: {error}")])),
            },
        };
        let formulas = columns.force.iter().map(given).collect::<Result<Vec<_>, _>>()?;
        let (mut plain, mut for_formulas) = (Columns { force: Vec::new(), ..columns.clone() }, Vec::new());
        for name in formulas.iter().flat_map(ForceSource::names).filter(|name| name.as_str() != TIME) {
            if !plain.input.contains(name) {
                plain.input.push(name.clone());
                for_formulas.push(name.clone());
            }
        }
        let requested = plain.input.len() - for_formulas.len();
        Ok(Some((Self { formulas, for_formulas, requested }, plain)))
    }

    /// Evaluates the forces at the samples of a recording, which has the inputs of its description and then those of the formulas.
    ///
    /// # Errors
    /// [`ColumnsError`] for a force that is not finite.
    pub fn apply(&self, columns: &Columns, reading: &mut LoadedRecording) -> Result<(), ColumnsError> {
        let count = self.requested + self.for_formulas.len();
        let names = || columns.input[..self.requested].iter().chain(&self.for_formulas);
        let place = |name: &String| names().position(|own| own == name);
        for (k, track) in reading.recording.tracks.iter_mut().enumerate() {
            for (sample, t) in track.times.iter().enumerate() {
                let inputs = reading.inputs.get(k).map_or(&[][..], |all| &all[sample * count..(sample + 1) * count]);
                let value = |name: &String| place(name).map_or(*t, |at| inputs[at]);
                for given in &self.formulas {
                    let (text, force) = match given {
                        ForceSource::Column(name) => (name, value(name)),
                        ForceSource::Formula(text, formula) => {
                            let values: Vec<f64> = formula.names.iter().map(value).collect();
                            (text, formula.value(&values))
                        }
                    };
                    if !force.is_finite() {
                        let problem = format!("force: {text}: expected a finite number, found {force} at t = {t}");
                        return Err(ColumnsError(vec![problem]));
                    }
                    track.force.push(force);
                }
            }
        }
        for inputs in &mut reading.inputs {
            *inputs = inputs.chunks_exact(count).flat_map(|row| &row[..self.requested]).copied().collect();
        }
        if self.requested == 0 {
            reading.inputs.clear();
        }
        reading.columns.input.truncate(self.requested);
        reading.columns.force.clone_from(&columns.force);
        Ok(())
    }
}

impl ForceSource {
    /// Names that a formula uses: columns and the time.
    fn names(&self) -> &[String] {
        match self {
            Self::Column(name) => std::slice::from_ref(name),
            Self::Formula(_, formula) => &formula.names,
        }
    }
}
