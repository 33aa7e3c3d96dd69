//! Measured quantities given as formulas of state, accelerations, time and parameters in a system file.

use super::SystemInstance;
use super::expression::Formula;
use crate::scalar::{Real, Scalar};
use alloc::string::String;
use alloc::vec::Vec;

/// A measured quantity. In its formula, coordinates are followed by the time, then inputs, then accelerations.
#[derive(Clone, Debug)]
pub struct FormulaReading {
    /// Its name in the file.
    pub name: String,
    /// Unit of the readings.
    pub unit: String,
    /// Column of the readings.
    pub column: String,
    /// Column of their standard deviations.
    pub error: Option<String>,
    /// `true` for an angle in radians.
    pub periodic: bool,
    /// The index of the coordinate, if the formula is a single coordinate.
    pub coordinate: Option<usize>,
    /// `true` if the formula contains accelerations.
    pub accelerated: bool,
    pub(super) formula: Formula,
}

impl FormulaReading {
    /// Evaluates the quantity at positions `q`, velocities `v` and accelerations `a`, `(n)` each; `known` contains the time, then inputs.
    pub fn value<R: Real>(&self, parameters: &[R], (q, v, a): (&[R], &[R], &[R]), known: &[R]) -> R {
        self.formula.evaluate(parameters, &[q, known, a].concat(), v)
    }
}

impl<S: Scalar> SystemInstance<S> {
    /// Returns the measured quantities of the system file, sorted by name; empty without a table `[measured]`.
    pub fn readings(&self) -> &[FormulaReading] {
        self.system.described.as_ref().map_or(&[], |described| &described.readings)
    }

    /// Returns the names of the measured quantities of the system file, in the order of [`measure`](Self::measure).
    pub fn measured(&self) -> impl Iterator<Item = &str> {
        self.readings().iter().map(|reading| reading.name.as_str())
    }

    /// Computes the sensor readings at a state: the formulas of `[measured]` in the system file at positions `q`, velocities `v` and
    /// accelerations `a`, `(n)` each; `known` contains the time, then inputs. Readings have the units in the file.
    pub fn measure(&self, (q, v, a): (&[S], &[S], &[S]), known: &[S]) -> Vec<S> {
        self.readings().iter().map(|reading| reading.value(&self.parameters, (q, v, a), known)).collect()
    }
}
