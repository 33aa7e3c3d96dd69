//! Measured quantities of a description: formulas of sensor readings.

use super::scope::{Scope, compiled};
use super::{CoordinateDescription, Description, DescriptionError};
use crate::lagrangian::expression::{Compiler, Meaning};
use crate::lagrangian::formula_readings::FormulaReading;
use alloc::string::String;
use alloc::vec::Vec;
#[cfg(feature = "serde")]
use serde::Serialize;

/// Columns of roll-outs that are not part of a state.
const TAKEN: [&str; 3] = ["t", "tau", "energy"];

/// A measured quantity: a formula, or a table with further keys.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize))]
pub struct MeasuredDescription {
    /// Formula of the reading in terms of coordinates, velocities, accelerations `NAME_ddot`, the time `t`, inputs, parameters and
    /// definitions.
    pub(super) formula: String,
    /// Unit of the readings.
    pub(super) unit: String,
    /// Column of the readings; by default the name of the quantity.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub(super) column: Option<String>,
    /// Column of their standard deviations; if it is missing, they are estimated.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub(super) error: Option<String>,
    /// `true` for an angle in radians: readings that differ by full turns are equal.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "super::is_false"))]
    pub(super) periodic: bool,
}

impl Description {
    /// Compiles the measured quantities.
    pub(super) fn compiled_readings(
        &self,
        compiler: &mut Compiler,
        scope: &Scope,
    ) -> Result<Vec<FormulaReading>, DescriptionError> {
        if self.measured.is_empty() {
            return Ok(Vec::new());
        }
        self.check_errors()?;
        let (n, behind) = (self.coordinates.len(), self.coordinates.len() + 1 + self.inputs.len());
        let scope = &self.with_accelerations(scope)?;
        let mut readings = Vec::with_capacity(self.measured.len());
        for (name, own) in &self.measured {
            let key = |part: &str| format!("measured.{name}.{part}");
            self.check_reading(name, own)?;
            let value = compiled(compiler, scope, (&key("formula"), &own.formula), false)?;
            let moves = |place: usize| place < n || place >= behind;
            if compiler.velocities(value).is_empty() && !compiler.positions(value).into_iter().any(moves) {
                let problem = "expected a coordinate, a velocity or an acceleration in it";
                return Err(DescriptionError::new(key("formula"), problem));
            }
            let coordinate = self.coordinates.iter().position(|known| known.name == own.formula.trim());
            readings.push(FormulaReading {
                name: name.clone(),
                unit: own.unit.clone(),
                column: own.column.clone().unwrap_or_else(|| name.clone()),
                error: own.error.clone(),
                periodic: own.periodic || coordinate.is_some_and(|i| self.coordinates[i].periodic),
                coordinate,
                accelerated: compiler.positions(value).into_iter().any(|place| place >= behind),
                formula: compiler.formula(value),
            });
        }
        Ok(readings)
    }

    /// Extends the names by inputs, then accelerations.
    fn with_accelerations(&self, scope: &Scope) -> Result<Scope, DescriptionError> {
        let mut scope = self.with_inputs(scope)?;
        for (i, CoordinateDescription { name, .. }) in self.coordinates.iter().enumerate() {
            let meaning = Meaning::Position(self.coordinates.len() + 1 + self.inputs.len() + i);
            if scope.insert(format!("{name}_ddot"), meaning).is_some() {
                let problem = format!("the name `{name}_ddot` is that of an acceleration in [measured]");
                return Err(DescriptionError::new("measured", problem));
            }
        }
        Ok(scope)
    }

    /// Checks that either all readings or none have a column of standard deviations.
    fn check_errors(&self) -> Result<(), DescriptionError> {
        let without = self.measured.iter().find(|(_, own)| own.error.is_none());
        match without.filter(|_| self.measured.values().any(|own| own.error.is_some())) {
            Some((name, _)) => {
                let problem = "expected a column of standard deviations, because other entries have one";
                Err(DescriptionError::new(format!("measured.{name}.error"), problem))
            }
            None => Ok(()),
        }
    }

    /// Checks names and columns: they must be short, on one line, and different from columns of states with other contents.
    fn check_reading(&self, name: &str, own: &MeasuredDescription) -> Result<(), DescriptionError> {
        let short =
            |text: &str| !text.trim().is_empty() && text.chars().count() <= 100 && !text.chars().any(char::is_control);
        if !short(name) {
            return Err(DescriptionError::new("measured", "expected names of 1 to 100 characters on one line"));
        }
        for (part, text) in [("column", &own.column), ("error", &own.error)] {
            if text.as_ref().is_some_and(|text| !short(text)) {
                let problem = "expected 1 to 100 characters on one line";
                return Err(DescriptionError::new(format!("measured.{name}.{part}"), problem));
            }
        }
        let of_state = |known: &CoordinateDescription| {
            name == known.name || name.strip_suffix("_dot").is_some_and(|name| name == known.name)
        };
        let is_taken = TAKEN.contains(&name) || self.coordinates.iter().any(of_state);
        match own.formula.trim() != name && is_taken {
            true => {
                let problem =
                    format!("roll-outs have a column `{name}`: expected the formula \"{name}\", or another name");
                Err(DescriptionError::new(format!("measured.{name}.formula"), problem))
            }
            false => Ok(()),
        }
    }
}
