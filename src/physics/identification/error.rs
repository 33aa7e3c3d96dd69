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
    /// The search was ended from outside.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Arrays that do not form a trajectory.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// Motion that cannot be smoothed.
    #[error(transparent)]
    Smooth(#[from] SmoothError),
    /// A Lagrangian that cannot be recorded.
    #[error(transparent)]
    Lagrangian(#[from] TapeError),
    /// A system whose Lagrangian is not known.
    #[error("{system}: expected a system of the catalogue or of a file")]
    Unknown {
        /// The system.
        system: String,
    },
    /// Recorded positions that a constraint does not allow.
    #[error(
        "the positions miss the constraint `{constraint}` by {}, root mean square, at a noise of {}: expected positions on it; check its constants, or let them be identified",
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
    /// Constants that move constraints, of which forces tell nothing.
    #[error(
        "constants: the constraints depend on {}, of which forces tell nothing: expected other constants, or --targets motion",
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
    /// The readings of a recording are not those of the system's file.
    #[error("expected the readings of [measured]: {}; found {}", expected.join(", "), found.join(", "))]
    Readings {
        /// Names in the file, in their order.
        expected: Vec<String>,
        /// Those of the recording.
        found: Vec<String>,
    },
    /// Known forces beside readings.
    #[error("known forces beside [measured]: write them as formulas of [inputs] in [forces]")]
    ForcesBesideReadings,
    /// Constraints beside readings.
    #[error(
        "constraints beside [measured]: measure the coordinates, or describe the system by as many coordinates as move freely"
    )]
    ConstrainedReadings,
    /// Constants of sensors beside readings.
    #[error("{what}: a system with [measured] has the constants of its sensors in the formulas there")]
    SensorsBesideReadings {
        /// Which constants.
        what: &'static str,
    },
    /// A symbol that the system does not have.
    #[error("constants: {}", unknown("constant", symbol, known.iter().map(String::as_str)))]
    Constant {
        /// The symbol.
        symbol: String,
        /// Symbols there are.
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
        /// Coordinates there are.
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
    /// A constant with a value for each trajectory that does not fit the recording.
    #[error(transparent)]
    Description(#[from] crate::lagrangian::DescriptionError),
    /// A value of such a constant that its range does not allow.
    #[error(transparent)]
    System(#[from] crate::lagrangian::SystemError),
    /// Marks of missing readings that are not one for each position.
    #[error("missing readings of {track}: expected {expected} marks, one for each position, found {found}")]
    Missing {
        /// The trajectory.
        track: String,
        /// Its positions.
        expected: usize,
        /// Marks found.
        found: usize,
    },
    /// An input that is not a finite number, or the wrong number of inputs.
    #[error("inputs of {track}: expected {expected} finite numbers, found {found}")]
    Inputs {
        /// The trajectory.
        track: String,
        /// Its inputs, those of a sample one behind the other.
        expected: usize,
        /// What was found.
        found: String,
    },
    /// A standard deviation of a position that is not a finite number above 0, or the wrong number of standard deviations.
    #[error("errors of {track}: expected a finite number above 0 for each of {expected} positions, found {found}")]
    Errors {
        /// The trajectory.
        track: String,
        /// Its positions.
        expected: usize,
        /// What was found.
        found: String,
    },
    /// Too few samples.
    #[error("expected at least {needed} samples in trajectories of three or more, found {found}")]
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
    /// The model cannot follow the motion.
    #[error(
        "the model follows no part of the recorded motion with the constants found so far: check that the columns are those of the coordinates"
    )]
    Lost,
}
