//! Reasons why a roll-out ends early.

use crate::lagrangian::MechanicsError;

/// Why steps became too small to continue, although the model did not fail for another reason.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UnderflowCause {
    /// The error estimate requires smaller and smaller steps: the motion diverges or is not smooth, or the tolerance is below the rounding
    /// errors of the model.
    #[error("error test failed, largest |acceleration| {largest_acceleration:.3e}")]
    ErrorTest {
        /// Largest absolute acceleration at the last accepted state.
        largest_acceleration: f64,
    },
    /// The model failed at every state beyond the last step.
    #[error("{0}")]
    Model(MechanicsError),
}

/// The reason why a roll-out ended before `t_end`. Times are in the unit of the options, states are `(q, v)` in physical units.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RolloutError {
    /// An argument is invalid.
    #[error("{what}: {problem}")]
    Invalid {
        /// The argument.
        what: &'static str,
        /// The problem in words.
        problem: String,
    },
    /// The trajectory leaves its domain.
    #[error(
        "left the domain at t = {t}: component {component} reached {value:.6e}, allowed is [{lower:.6e}, {upper:.6e}]"
    )]
    LeftDomain {
        /// Last time inside.
        t: f64,
        /// State `(q, v)` at `t`.
        state: Vec<f64>,
        /// Index into `(q, v)`: coordinates `0..n`, velocities `n..2n`.
        component: usize,
        /// The invalid value beyond `t`.
        value: f64,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// The mass matrix is singular.
    #[error("singular mass matrix at t = {t} (condition number {condition:.3e})")]
    SingularMass {
        /// Last time at which it was regular.
        t: f64,
        /// State `(q, v)` at `t`.
        state: Vec<f64>,
        /// Condition number beyond `t`.
        condition: f64,
    },
    /// The constraints do not allow the initial state.
    #[error("{distance:.3e} away from the constraints, which `{constraint}` misses most")]
    OffConstraints {
        /// The most violated constraint.
        constraint: String,
        /// Distance of the initial state from the constraint, in units of coordinates or of velocities.
        distance: f64,
        /// The nearest allowed state `(q, v)`; empty if none was found.
        nearest: Vec<f64>,
    },
    /// A constraint depends on the others, so that the forces of constraint are not unique.
    #[error("constraint {constraint} depends on the others just after t = {t}")]
    DependentConstraint {
        /// Last time at which it was independent.
        t: f64,
        /// State `(q, v)` at `t`.
        state: Vec<f64>,
        /// Index of the constraint, from 0.
        constraint: usize,
    },
    /// Along the motion, a constraint vanishes together with its gradient, or becomes dependent on the others: a second branch of solutions
    /// begins there, and the equations do not determine which one the motion follows.
    #[error(
        "constraint {constraint} has a second branch at t = {at}, where its gradient vanishes or follows from those of the others"
    )]
    SecondBranch {
        /// Last time before it.
        t: f64,
        /// State `(q, v)` at `t`.
        state: Vec<f64>,
        /// Index of the constraint, from 0.
        constraint: usize,
        /// Time at which the branch is reached.
        at: f64,
    },
    /// The trajectory leaves the states at which the mass matrix is certified.
    #[error("the mass matrix is not certified just after t = {t}")]
    Uncertified {
        /// Last time at which it was certified.
        t: f64,
        /// State `(q, v)` at `t`.
        state: Vec<f64>,
    },
    /// A state or an acceleration is not finite.
    #[error("{what} is not finite just after t = {t}")]
    NotFinite {
        /// Last time at which everything was finite.
        t: f64,
        /// State `(q, v)` at `t`.
        state: Vec<f64>,
        /// Which quantity.
        what: &'static str,
    },
    /// Steps became smaller than the resolution of the time.
    #[error("step size underflow at t = {t} (last step {step:.3e}): {cause}")]
    StepUnderflow {
        /// Time of the last accepted step.
        t: f64,
        /// State `(q, v)` at `t`.
        state: Vec<f64>,
        /// Size of the last accepted step, 0 if there was none.
        step: f64,
        /// Why steps became small.
        cause: UnderflowCause,
    },
    /// The implicit equations of a fixed step could not be solved, because the step is too long for the motion.
    #[error("step from t = {t} did not converge in {iterations} iterations (residual {residual:.3e})")]
    NotConverged {
        /// Time of the last step taken.
        t: f64,
        /// State `(q, v)` at `t`.
        state: Vec<f64>,
        /// Number of iterations.
        iterations: usize,
        /// Remaining residual, relative to the largest momentum.
        residual: f64,
    },
    /// The largest allowed number of steps is reached.
    #[error("{steps} steps were not enough, stopped at t = {t}")]
    TooManySteps {
        /// Time reached so far.
        t: f64,
        /// Number of attempted steps.
        steps: usize,
    },
    /// The impact of an event is not determined, or impacts accumulate.
    #[error("event `{event}` at t = {t}: {problem}")]
    Event {
        /// Its time.
        t: f64,
        /// State `(q, v)` at `t`.
        state: Vec<f64>,
        /// Its name.
        event: String,
        /// The problem in words.
        problem: String,
    },
    /// The receiver accepts no more samples, or a flag ended the model.
    #[error("stopped at t = {t}")]
    Stopped {
        /// Time of the last step taken.
        t: f64,
    },
}

impl RolloutError {
    /// Returns the time at which the motion stopped, if it had started.
    pub fn time(&self) -> Option<f64> {
        match self {
            Self::Invalid { .. } | Self::OffConstraints { .. } => None,
            Self::LeftDomain { t, .. }
            | Self::SingularMass { t, .. }
            | Self::DependentConstraint { t, .. }
            | Self::SecondBranch { at: t, .. }
            | Self::Uncertified { t, .. }
            | Self::NotFinite { t, .. }
            | Self::StepUnderflow { t, .. }
            | Self::NotConverged { t, .. }
            | Self::TooManySteps { t, .. }
            | Self::Event { t, .. }
            | Self::Stopped { t } => Some(*t),
        }
    }
}
