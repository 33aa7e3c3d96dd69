//! Failures of the terms of a batch: their kinds, and how they are found, merged and reported.

use super::{Request, Terms};
use crate::lagrangian::thresholds::LEAST_VECTOR_NUMBERS;
use crate::linalg::{Failure, Workspace};
use crate::scalar::{Scalar, vectorized};
use alloc::vec::Vec;

/// The reason why terms could not be computed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum MechanicsError {
    /// A slice has the wrong length.
    Shape {
        /// Which argument.
        what: &'static str,
        /// Numbers expected.
        expected: usize,
        /// Numbers found.
        found: usize,
    },
    /// The equations with the mass matrix of a state cannot be solved.
    Singular {
        /// Row of the batch.
        row: usize,
        /// Estimated 2-norm condition number (infinite if exactly singular).
        condition: f64,
    },
    /// A constraint depends on the others at this state, although not elsewhere, so the forces of constraint are not unique.
    Dependent {
        /// Row of the batch.
        row: usize,
        /// Which constraint, from 0.
        constraint: usize,
    },
    /// The constraints do not allow a given acceleration.
    OffConstraints {
        /// Row of the batch.
        row: usize,
        /// Index of the most violated constraint, from 0.
        constraint: usize,
        /// Distance to the nearest acceleration that they allow.
        distance: f64,
    },
    /// There are fewer drives than degrees of freedom, or a drive is given twice.
    Drives {
        /// Degrees of freedom.
        expected: usize,
        /// Number of different drives.
        found: usize,
    },
    /// The state can move while the drives are at rest.
    Undriven {
        /// Row of the batch.
        row: usize,
    },
    /// A term is not finite.
    NotFinite {
        /// Row of the batch.
        row: usize,
        /// Which term.
        what: &'static str,
    },
    /// The model requires a certificate, but its mass matrix is not certified at this state.
    Uncertified {
        /// Row of the batch.
        row: usize,
    },
    /// A flag has ended the evaluation.
    Interrupted,
    /// The system depends on the time, which a state does not contain.
    Timed,
    /// The model does not have the required derivatives.
    Derivatives {
        /// The term whose derivatives are missing.
        what: &'static str,
    },
}

impl core::fmt::Display for MechanicsError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Shape { what, expected, found } => write!(f, "{what}: expected {expected} numbers, found {found}"),
            Self::Singular { row, condition } => {
                write!(f, "mass matrix of state {row} is singular (condition number {condition:.3e})")
            }
            Self::Dependent { row, constraint } => {
                write!(f, "constraint {constraint} depends on the others at state {row}")
            }
            Self::OffConstraints { row, constraint, distance } => write!(
                f,
                "the acceleration of state {row} is {distance:.3e} away from what the constraints allow, most by constraint {constraint}"
            ),
            Self::Drives { expected, found } => write!(
                f,
                "drives: expected at least {expected} different coordinates, as many as degrees of freedom, found {found}"
            ),
            Self::Undriven { row } => {
                write!(
                    f,
                    "state {row} can move while the drives stand still: their forces do not give its acceleration"
                )
            }
            Self::NotFinite { row, what } => write!(f, "{what} of state {row} is not finite"),
            Self::Uncertified { row } => write!(f, "mass matrix of state {row} is not certified"),
            Self::Interrupted => f.write_str("interrupted"),
            Self::Timed => f.write_str("this system depends on the time t: every state needs its time"),
            Self::Derivatives { what } => write!(f, "{what}: this model has no such derivatives"),
        }
    }
}

impl core::error::Error for MechanicsError {}

impl MechanicsError {
    /// Returns the row of the state that failed; `None` if the error does not concern one state.
    pub fn row(&self) -> Option<usize> {
        match *self {
            Self::Singular { row, .. }
            | Self::Dependent { row, .. }
            | Self::OffConstraints { row, .. }
            | Self::Undriven { row }
            | Self::NotFinite { row, .. }
            | Self::Uncertified { row } => Some(row),
            Self::Shape { .. } | Self::Drives { .. } | Self::Interrupted | Self::Timed | Self::Derivatives { .. } => {
                None
            }
        }
    }

    /// Says what is wrong at one state, with the constraints by their names, and without its row in a batch.
    #[cfg(feature = "std")]
    #[must_use]
    pub fn problem(&self, constraints: &[String]) -> String {
        let name = |constraint: usize| constraints.get(constraint).map_or("?", String::as_str);
        match *self {
            Self::Singular { condition, .. } => {
                format!("the mass matrix is singular (condition number {condition:.3e})")
            }
            Self::Dependent { constraint, .. } => {
                format!("the constraint `{}` depends on the others", name(constraint))
            }
            Self::OffConstraints { constraint, distance, .. } => format!(
                "the acceleration is {distance:.3e} away from what the constraints allow, most by `{}`",
                name(constraint)
            ),
            Self::Undriven { .. } => "it can move while the drives stand still".to_string(),
            Self::NotFinite { what, .. } => format!("{what} is not finite"),
            Self::Uncertified { .. } => "the mass matrix is not certified".to_string(),
            _ => self.to_string(),
        }
    }

    /// Returns the same failure for another row.
    pub(crate) fn at_row(mut self, to: usize) -> Self {
        if let Self::Singular { row, .. }
        | Self::Dependent { row, .. }
        | Self::OffConstraints { row, .. }
        | Self::Undriven { row }
        | Self::NotFinite { row, .. }
        | Self::Uncertified { row } = &mut self
        {
            *row = to;
        }
        self
    }

    /// Returns the error for a state whose acceleration could not be solved for.
    pub fn unsolved(row: usize, failure: Failure) -> Self {
        match failure {
            Failure::Singular { condition } => Self::Singular { row, condition },
            Failure::NotFinite => Self::NotFinite { row, what: "acceleration" },
        }
    }
}

impl<S: Scalar> Terms<S> {
    /// Merges failures into the existing ones and keeps one for each row, preferably from `found`.
    pub fn prepend_failures(&mut self, mut found: Vec<MechanicsError>) {
        if found.is_empty() {
            return;
        }
        found.append(&mut self.failures);
        // Sorting is stable, so that the first failure of a row stays first.
        found.sort_by_key(MechanicsError::row);
        found.dedup_by_key(|error| error.row());
        self.failures = found;
    }

    /// Returns the first failure as the outcome of the batch.
    ///
    /// # Errors
    /// The first failure.
    pub fn outcome(&self) -> Result<(), MechanicsError> {
        self.failures.first().map_or(Ok(()), |&error| Err(error))
    }

    /// Returns `true` if [`Terms::failures`] lists all failures, so that the other rows can be used. After a success it clears the list,
    /// even if the model does not touch it.
    pub fn record_failures(&mut self, outcome: &Result<(), MechanicsError>) -> bool {
        if outcome.is_ok() {
            self.failures.clear();
        }
        let first = self.failures.first().and_then(MechanicsError::row);
        outcome.as_ref().err().is_none_or(|error| error.row().is_some() && error.row() == first)
    }

    /// Removes and returns the failures of the wrapped model.
    ///
    /// # Errors
    /// `outcome`, if it does not concern single rows.
    pub fn drain_failures(
        &mut self,
        outcome: Result<(), MechanicsError>,
    ) -> Result<Vec<MechanicsError>, MechanicsError> {
        if self.record_failures(&outcome) {
            Ok(core::mem::take(&mut self.failures))
        } else {
            outcome.map(|()| Vec::new())
        }
    }

    /// Does the same as [`Terms::complete`] for a wrapper that has drained the failures of the inner model before.
    ///
    /// # Errors
    /// The first failure of the wrapper or the inner model.
    pub(crate) fn complete_beside(
        &mut self,
        failures: Vec<MechanicsError>,
        n: usize,
        v: &[S],
        request: Request,
    ) -> Result<(), MechanicsError> {
        if let Err(error @ MechanicsError::Shape { .. }) = self.complete(n, v, request, &mut Workspace::new()) {
            return Err(error);
        }
        self.prepend_failures(failures);
        self.outcome()
    }
}

/// Adds a failure for each row of a field `(batch, width)` that is not finite.
#[inline]
pub(super) fn not_finite<S: Scalar>(what: &'static str, field: &[S], width: usize, found: &mut Vec<MechanicsError>) {
    if !all_finite(field) {
        rows_not_finite(what, field, width, found);
    }
}

#[cold]
fn rows_not_finite<S: Scalar>(what: &'static str, field: &[S], width: usize, found: &mut Vec<MechanicsError>) {
    let rows = field.chunks(width.max(1)).enumerate().filter(|(_, row)| !all_finite(row));
    found.extend(rows.map(|(row, _)| MechanicsError::NotFinite { row, what }));
}

/// Returns `true` if all numbers are finite; it branches only at the end.
#[inline(always)]
fn all_finite<S: Scalar>(numbers: &[S]) -> bool {
    if numbers.len() < LEAST_VECTOR_NUMBERS {
        finite(numbers)
    } else {
        vectorized(
            #[inline(always)]
            || finite(numbers),
        )
    }
}

#[inline(always)]
fn finite<S: Scalar>(numbers: &[S]) -> bool {
    let mut all = true;
    for x in numbers {
        all &= x.is_finite();
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_found_once_with_its_first_reason() {
        let mut field = vec![0.0; 300];
        field[131] = f64::NAN;
        field[129] = f64::INFINITY;
        field[299] = f64::NAN;
        let mut found = Vec::new();
        not_finite("momentum", &field, 3, &mut found);
        let bad = |row| MechanicsError::NotFinite { row, what: "momentum" };
        assert_eq!(found, [bad(43), bad(99)]);
        not_finite("momentum", &field[..129], 3, &mut found);
        assert_eq!(found.len(), 2);
        let mut terms = Terms::<f64>::default();
        terms.prepend_failures(vec![MechanicsError::Uncertified { row: 99 }, MechanicsError::Uncertified { row: 7 }]);
        terms.prepend_failures(found);
        assert_eq!(terms.failures, [MechanicsError::Uncertified { row: 7 }, bad(43), bad(99)]);
        assert_eq!(terms.outcome(), Err(MechanicsError::Uncertified { row: 7 }));
    }

    #[test]
    fn an_error_about_no_row_is_passed_on() {
        let mut terms = Terms::<f64> { failures: vec![MechanicsError::Uncertified { row: 2 }], ..Terms::default() };
        let other = Err(MechanicsError::Derivatives { what: "mass matrix" });
        assert_eq!(terms.drain_failures(other), Err(MechanicsError::Derivatives { what: "mass matrix" }));
        let failed = terms.drain_failures(Err(MechanicsError::Uncertified { row: 2 }));
        assert_eq!(failed, Ok(vec![MechanicsError::Uncertified { row: 2 }]));
        assert_eq!(terms.outcome(), Ok(()));
        // Failures of an earlier batch are ignored.
        terms.failures.push(MechanicsError::Uncertified { row: 2 });
        assert_eq!(terms.drain_failures(Ok(())), Ok(Vec::new()));
        assert_eq!(terms.outcome(), Ok(()));
    }
}
