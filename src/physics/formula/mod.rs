//! A Lagrangian as a formula, from recorded motion or from a learned model.
//!
//! The Euler-Lagrange equations are linear in the coefficients of a library of terms: products of velocities with functions of the coordinates.
//! Terms that are total derivatives, or that follow from others by identities such as `sin^2 + cos^2 = 1`, are removed by the rank
//! of the stacked equations at random states. For recorded motion, [`FoundFormula::of_motion`] uses the weak form of the equations along smoothed
//! positions, removes terms one after the other with refits, and then fits the surviving terms to the motion itself: multiple shooting with
//! Gauss and Newton's method, in which every term of the library is tried again, and which noise in the positions does not bias. Held-out
//! trajectories show whether the residuals are noise. For models, [`FoundFormula::of_model`] uses the equations at sampled states.
//!
//! ```
//! use lnn::formula::{FormulaOptions, FoundFormula, Verdict};
//! use lnn::prelude::*;
//! use lnn::recording::{RecordedTrajectory, Recording};
//!
//! // Swings of a pendulum with g / l = 4, as angles alone.
//! let model = lnn::lagrangian::ExpressionLagrangian::new(&["a"], &[], "a_dot^2/2 + 4*cos(a)")?;
//! let model = lnn::lagrangian::Mechanics::new(model, vec![]);
//! let tracks = (0..8).map(|k| {
//!     let motion = model.rollout(&[0.5 + 0.3 * k as f64], &[0.0], 5.0, 0.05).unwrap();
//!     RecordedTrajectory { name: format!("{k}"), times: motion.t, q: motion.q, v: vec![], a: vec![], force: vec![] }
//! });
//! let recording = Recording { coordinates: vec!["a".into()], periodic: vec![true], tracks: tracks.collect() };
//! let found = FoundFormula::of_motion(&recording, &FormulaOptions::default())?;
//! assert_eq!(found.verdict, Verdict::Found);
//! let terms: Vec<&str> = found.terms.iter().map(|t| t.term.as_str()).collect();
//! assert_eq!(terms, ["a_dot^2", "cos(a)"]);
//! assert!((found.terms[1].coefficient - 4.0).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod constants;
mod drive;
mod drive_doubts;
mod error;
mod exchange;
mod extent;
mod families;
mod find;
mod found;
mod function;
mod held_out_test;
mod ladder;
mod library;
mod motion;
mod obstacles;
mod prepared;
mod quotient;
mod regress;
mod regular;
mod report;
mod search;
mod select;
mod thresholds;
mod units;
mod wald;
mod weak;
mod written;

pub use error::FormulaError;
pub use families::Families;
pub use find::FormulaOptions;
pub use found::{FoundDrive, FoundFormula, FoundTerm, NearFraction, RangeResidual, Rival, Verdict};
// For the packages of this repository.
#[doc(hidden)]
pub use thresholds::{MODEL_STATES, MOST_BOOTSTRAPS};
pub use written::FormulaSummary;
