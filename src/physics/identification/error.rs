//! Errors of identification.

use crate::cancellation::Cancelled;
use crate::names::{rounded, unknown};
use crate::recording::TrajectoryError;
use crate::recording::smooth::SmoothError;
use crate::tape::TapeError;

/// Why constants could not be identified.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IdentifyError {
    /// The search was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Arrays that do not form a trajectory.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// Motion that cannot be smoothed.
    #[error(transparent)]
    Smooth(#[from] SmoothError),
    /// A Lagrangian that cannot be recorded as a program.
    #[error(transparent)]
    Lagrangian(#[from] TapeError),
    /// A system without a formula for its Lagrangian.
    #[error("{system}: expected a system of the catalogue or of a file")]
    Unknown {
        /// The system.
        system: String,
    },
    /// Recorded positions off a constraint.
    #[error(
        "the positions are {} (root mean square) off the constraint `{constraint}`, more than their noise of {} explains: check its constants, or identify them",
        rounded(*distance, 3),
        rounded(*noise, 3)
    )]
    OffConstraint {
        /// The constraint.
        constraint: String,
        /// Root mean square distance.
        distance: f64,
        /// Noise of the positions across the constraint.
        noise: f64,
    },
    /// Unknown constants in constraints, which forces do not determine.
    #[error(
        "constants: the constraints depend on {}, which forces do not determine: choose other constants, or --targets motion",
        symbols.join(", ")
    )]
    MovesConstraints {
        /// Their symbols.
        symbols: Vec<String>,
    },
    /// The number of coordinates differs from that of the system.
    #[error("expected {expected} coordinates, found {found}")]
    Coordinates {
        /// Coordinates of the system.
        expected: usize,
        /// Those of the recording.
        found: usize,
    },
    /// The columns of a recording are not the measured quantities of the system file.
    #[error("expected the readings of [measured]: {}; found {}", expected.join(", "), found.join(", "))]
    Readings {
        /// Names in the file, in their order.
        expected: Vec<String>,
        /// Those of the recording.
        found: Vec<String>,
    },
    /// Known forces for a system with measured quantities.
    #[error(
        "a system with [measured] takes no columns of known forces: declare them as [inputs] and use these in [forces]"
    )]
    ForcesBesideReadings,
    /// Constraints in a system with measured quantities.
    #[error(
        "a system with [measured] cannot have constraints: measure its coordinates, or describe it by independent coordinates"
    )]
    ConstrainedReadings,
    /// Sensor constants for a system with measured quantities.
    #[error("{what}: a system with [measured] declares the constants of its sensors in these formulas")]
    SensorsBesideReadings {
        /// Which constants.
        what: &'static str,
    },
    /// A symbol that the system does not have.
    #[error("constants: {}", unknown("constant", symbol, known.iter().map(String::as_str)))]
    Constant {
        /// The symbol.
        symbol: String,
        /// The symbols of the system.
        known: Vec<String>,
    },
    /// A symbol or coordinate that is given twice.
    #[error("{what}: {name} is given twice")]
    Repeated {
        /// Which option.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A coordinate that the recording does not have.
    #[error("{what}: {}", unknown("coordinate", name, known.iter().map(String::as_str)))]
    Sensor {
        /// Which constants.
        what: &'static str,
        /// The name.
        name: String,
        /// The coordinates of the recording.
        known: Vec<String>,
    },
    /// The system has no constants.
    #[error("{system} has no constants to identify")]
    Nothing {
        /// The system.
        system: String,
    },
    /// A number that is out of range.
    #[error("{what}: expected {expected}, found {found}")]
    Option {
        /// Which option.
        what: &'static str,
        /// What is allowed.
        expected: String,
        /// What was given.
        found: String,
    },
    /// A parameter with a value for each trajectory that does not match the recording.
    #[error(transparent)]
    Description(#[from] crate::lagrangian::DescriptionError),
    /// A value of such a parameter outside its range.
    #[error(transparent)]
    System(#[from] crate::lagrangian::SystemError),
    /// The wrong number of marks of missing readings.
    #[error("missing readings of {track}: expected {expected} marks, one for each position, found {found}")]
    Missing {
        /// The trajectory.
        track: String,
        /// Number of its positions.
        expected: usize,
        /// Marks found.
        found: usize,
    },
    /// An input that is not a finite number, or the wrong number of inputs.
    #[error("inputs of {track}: expected {expected} finite numbers, found {found}")]
    Inputs {
        /// The trajectory.
        track: String,
        /// Number of its inputs at all samples.
        expected: usize,
        /// What was found.
        found: String,
    },
    /// A standard deviation of a position that is not a finite number above 0, or the wrong number of standard deviations.
    #[error("errors of {track}: expected a finite number above 0 for each of {expected} positions, found {found}")]
    Errors {
        /// The trajectory.
        track: String,
        /// Number of its positions.
        expected: usize,
        /// What was found.
        found: String,
    },
    /// Too few samples.
    #[error("expected at least {needed} samples in trajectories of at least three, found {found}")]
    Short {
        /// Samples of the trajectories that have three or more.
        found: usize,
        /// Samples needed.
        needed: usize,
    },
    /// The equations of motion cannot be solved at the starting values.
    #[error(
        "the equations of motion cannot be solved at any recorded state with the given constants: the mass matrix is singular, or a term is not finite"
    )]
    Singular,
    /// The model cannot be integrated along the motion.
    #[error(
        "no part of the recorded motion can be integrated with the constants found so far: check that the columns are those of the coordinates"
    )]
    Lost,
}

impl IdentifyError {
    /// The option with a value that cannot be used: a field of [`IdentifyOptions`](super::IdentifyOptions), such as `offsets`; `system` if its
    /// constants cannot be identified; `None` if the recording is at fault.
    pub fn option(&self) -> Option<&'static str> {
        match self {
            Self::Option { what: "per", .. } => Some("system"),
            Self::Constant { .. } => Some("constants"),
            Self::Repeated { what, .. }
            | Self::Sensor { what, .. }
            | Self::SensorsBesideReadings { what }
            | Self::Option { what, .. } => Some(what),
            Self::Smooth(SmoothError::Option { what: "noise", .. }) => Some("noise"),
            Self::Description(_)
            | Self::System(_)
            | Self::Unknown { .. }
            | Self::MovesConstraints { .. }
            | Self::Nothing { .. } => Some("system"),
            _ => None,
        }
    }
}
