//! Samples of a motion as they are kept, and failures as they are reported.

use super::error::{RolloutError, UnderflowCause};
use crate::lagrangian::MechanicsError;
use crate::scalar::Scalar;

/// Why the derivative of a state, or a step, cannot be had.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum StepFailure {
    Domain {
        component: usize,
        value: f64,
        lower: f64,
        upper: f64,
    },
    State,
    Model(MechanicsError),
    NotConverged {
        iterations: usize,
        residual: f64,
    },
    /// No state of the constraints is near.
    OffConstraints,
}

impl StepFailure {
    /// A state `(q, v)` that must be finite and inside the domain.
    pub(super) fn check<S: Scalar>(domain: Option<&super::Domain<S>>, state: &[S]) -> Result<(), Self> {
        if state.iter().any(|x| !x.is_finite()) {
            return Err(Self::State);
        }
        match domain.and_then(|domain| domain.violation(state)) {
            None => Ok(()),
            Some((component, lower, upper)) => {
                let (value, lower, upper) = (state[component].to_f64(), lower.to_f64(), upper.to_f64());
                Err(Self::Domain { component, value, lower, upper })
            }
        }
    }
}

/// Receives the time, coordinates and velocities of every sample in order, and says whether to go on.
pub(super) type Keep<'a, S> = dyn FnMut(S, &[S], &[S]) -> bool + 'a;

/// The error of a motion that a step ended.
pub(super) fn into_error(failure: StepFailure, t: f64, state: Vec<f64>, step: f64) -> RolloutError {
    match failure {
        StepFailure::Domain { component, value, lower, upper } => {
            RolloutError::LeftDomain { t, state, component, value, lower, upper }
        }
        StepFailure::State => RolloutError::NotFinite { t, state, what: "state" },
        StepFailure::Model(MechanicsError::Singular { condition, .. }) => {
            RolloutError::SingularMass { t, state, condition }
        }
        StepFailure::Model(MechanicsError::Dependent { constraint, .. }) => {
            RolloutError::DependentConstraint { t, state, constraint }
        }
        StepFailure::OffConstraints => RolloutError::NotFinite { t, state, what: "way back to the constraints" },
        StepFailure::Model(MechanicsError::Interrupted) => RolloutError::Stopped { t },
        StepFailure::Model(MechanicsError::Uncertified { .. }) => RolloutError::Uncertified { t, state },
        StepFailure::Model(MechanicsError::NotFinite { what, .. }) => RolloutError::NotFinite { t, state, what },
        StepFailure::NotConverged { iterations, residual } => {
            RolloutError::NotConverged { t, state, iterations, residual }
        }
        StepFailure::Model(error) => {
            RolloutError::StepUnderflow { t, state, step, cause: UnderflowCause::Model(error) }
        }
    }
}
