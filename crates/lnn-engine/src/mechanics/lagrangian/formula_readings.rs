//! Measured quantities as formulas of state, accelerations, time and parameters, as a system file states them.

use super::SystemInstance;
use super::expression::Formula;
use crate::scalar::{Real, Scalar};
use alloc::string::String;
use alloc::vec::Vec;

/// A measured quantity. Its formula has the time, then inputs, then accelerations as coordinates after those of the system.
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
    /// The coordinate, if the formula is just that.
    pub coordinate: Option<usize>,
    /// `true` if the formula has accelerations.
    pub accelerated: bool,
    pub(super) formula: Formula,
}

impl FormulaReading {
    /// The quantity at positions `q`, velocities `v` and accelerations `a`, `(n)` each; `known` holds the time, then inputs.
    pub fn value<R: Real>(&self, parameters: &[R], (q, v, a): (&[R], &[R], &[R]), known: &[R]) -> R {
        self.formula.evaluate(parameters, &[q, known, a].concat(), v)
    }
}

impl<S: Scalar> SystemInstance<S> {
    /// The measured quantities of the system's file, in the order of their names; none if it has no table `[measured]`.
    pub fn readings(&self) -> &[FormulaReading] {
        self.system.described.as_ref().map_or(&[], |described| &described.readings)
    }

    /// Names of the measured quantities of the system's file, in the order of [`measure`](Self::measure).
    pub fn measured(&self) -> impl Iterator<Item = &str> {
        self.readings().iter().map(|reading| reading.name.as_str())
    }

    /// The readings of the sensors in the system's file at a state: the formulas of `[measured]` at positions `q`, velocities `v` and
    /// accelerations `a`, `(n)` each; `known` holds the time, then inputs. Readings have the units in the file.
    pub fn measure(&self, (q, v, a): (&[S], &[S], &[S]), known: &[S]) -> Vec<S> {
        self.readings().iter().map(|reading| reading.value(&self.parameters, (q, v, a), known)).collect()
    }
}
