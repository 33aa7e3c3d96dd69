//! Errors of the forces that a learned model computes for held-out motion.

use crate::data::{Dataset, force_spreads};
use crate::lagrangian::{InverseDynamics, MechanicsError};
use crate::names::{number, percentage};
use crate::network::NetworkLagrangian;
use crate::pipeline::thresholds::{FAILED_FORCE, WELL_LEARNED_FORCE};
use serde::Serialize;

/// Error of the force of one coordinate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ForceError {
    /// Name of the coordinate.
    pub name: String,
    /// Root mean square error in SI units.
    pub rms: f64,
    /// Standard deviation of the recorded force in SI units.
    pub spread: f64,
    /// Mean squared error over the variance of the recorded force.
    pub nmse: f64,
}

impl ForceError {
    /// Header of a table of errors.
    pub(crate) const HEADERS: [&'static str; 4] =
        ["force of", "rms error [SI]", "spread [SI]", "squared error over variance [%]"];

    /// Row of the table.
    pub(crate) fn row(&self) -> Vec<String> {
        vec![self.name.clone(), number(self.rms), number(self.spread), percentage(self.nmse)]
    }

    /// `true` if the model does not reproduce the force.
    pub(crate) fn is_lost(&self) -> bool {
        self.nmse.is_nan() || self.nmse > FAILED_FORCE
    }
}

/// Compares the forces of held-out states with the model's forces for their accelerations.
///
/// # Errors
/// [`MechanicsError`] of a model that is not finite.
pub(crate) fn force_errors(
    network: &NetworkLagrangian<f64>,
    held_out: &Dataset<f64>,
    names: &[String],
) -> Result<Vec<ForceError>, MechanicsError> {
    let n = names.len();
    let found = InverseDynamics::of(network, held_out.q(), held_out.v(), held_out.a())?.external;
    let count = held_out.len() as f64;
    let one = |(i, (name, spread)): (usize, (&String, f64))| {
        let pairs = found.iter().zip(held_out.force()).skip(i).step_by(n);
        let square = pairs.map(|(found, force)| (found - force).powi(2)).sum::<f64>() / count;
        ForceError { name: name.clone(), rms: square.sqrt(), spread, nmse: square / (spread * spread) }
    };
    Ok(names.iter().zip(force_spreads(held_out)).enumerate().map(one).collect())
}

/// Describes in a sentence how well the model reproduces the forces.
pub(crate) fn judged(errors: &[ForceError]) -> String {
    let lost: Vec<&str> = errors.iter().filter(|e| e.is_lost()).map(|e| e.name.as_str()).collect();
    let worst = errors.iter().map(|e| e.nmse).fold(0.0, |worst: f64, x| if x.is_nan() { x } else { worst.max(x) });
    let verdict = match lost.len() {
        0 if worst <= WELL_LEARNED_FORCE => {
            "good: the learned Lagrangian gives the forces of motion that it has not seen".to_string()
        }
        0 => "limited: the learned Lagrangian gives the forces of motion that it has not seen roughly".to_string(),
        all if all == errors.len() => {
            "bad: the learned Lagrangian does not give the forces of motion that it has not seen".to_string()
        }
        _ => format!("limited: the force of {} was not learned", lost.join(", ")),
    };
    let each: Vec<String> = errors.iter().map(|e| format!("{} {} %", e.name, percentage(e.nmse))).collect();
    format!("{verdict}; squared error over the variance of the force: {}.", each.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(all: &[(&str, f64)]) -> Vec<ForceError> {
        let one =
            |(name, nmse): &(&str, f64)| ForceError { name: name.to_string(), rms: 1.0, spread: 1.0, nmse: *nmse };
        all.iter().map(one).collect()
    }

    #[test]
    fn a_force_that_is_not_learned_is_named() {
        let verdict = |all: &[(&str, f64)]| judged(&errors(all)).split(';').next().unwrap_or_default().to_string();
        assert!(verdict(&[("q1", 0.01), ("q2", 0.04)]).starts_with("good"));
        assert!(verdict(&[("q1", 0.01), ("q2", 0.2)]).starts_with("limited"));
        let one = verdict(&[("q1", 0.01), ("q2", 0.5), ("q3", f64::NAN)]);
        assert!(one.starts_with("limited") && one.contains("q2, q3") && !one.contains("q1"), "{one}");
        assert!(verdict(&[("q1", 0.9), ("q2", 0.5)]).starts_with("bad"));
    }
}
