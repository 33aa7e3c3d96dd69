//! Recorded motion, estimates of its derivatives, and a survey of its quality.
//!
//! ```
//! use lnn::recording::{Columns, LoadedRecording, SmoothOptions, Smoothing};
//!
//! // Angles of a double pendulum every 10 ms, several runs in one file.
//! let angles = ["theta1", "theta2"].map(String::from).to_vec();
//! let columns = Columns { periodic: angles.clone(), coords: angles, trajectory: Some("run".into()), ..Columns::default() };
//! let recording = LoadedRecording::read(&["examples/data/pendulum.csv"], &columns)?.recording;
//! assert_eq!((recording.n(), recording.tracks[0].times[1]), (2, 0.01));
//!
//! let smoothing = Smoothing::choose(&recording, &SmoothOptions::default())?;
//! let motion = smoothing.apply(&recording.tracks[0])?; // positions, velocities, accelerations and their errors
//! assert_eq!(motion.a.len(), recording.tracks[0].q.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod clock;
mod columns;
mod guess;
mod heading;
mod held;
mod hermite;
mod hold_out;
pub(crate) mod read;
mod reading;
pub(crate) mod smooth;
mod statistics;
pub(crate) mod survey;
mod thresholds;
mod track;
mod units;

pub use columns::{Columns, ColumnsError};
pub use guess::{ColumnGuess, Guess};
pub(crate) use held::{Filled, filled, marks};
pub(crate) use hermite::hermite;
pub(crate) use hold_out::HeldOut;
pub use hold_out::HoldOutError;
pub use read::{DataError, Problem};
pub use reading::{Bridged, Cut, Dropped, LoadedRecording, Rows, Targets};
pub use smooth::{SmoothError, SmoothOptions, Smoothed, Smoothing};
pub(crate) use statistics::{deviation, quantile, rms, robust_deviation};
pub(crate) use thresholds::{INERTIAL_SHARE, LARGE_ACCELERATION_ERROR};
pub use track::{RecordedTrajectory, Recording, TrajectoryError};
pub use units::factor;

// Used by the other packages of this repository.
#[doc(hidden)]
pub use {
    clock::Clock,
    columns::{TIME, formula_in},
    read::{NumberTable, NumberTableError},
    survey::{FirstOrder, Survey, SurveyOptions, survey},
};
