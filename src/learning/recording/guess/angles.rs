//! Recognises angles and their units.

use super::names::{in_degrees, is_angle};
use super::thresholds::{MOST_TURNS_IN_RADIANS, SAMPLES_PER_JUMP, TURN_TOLERANCE, WRAPPED_RANGE};
use std::f64::consts::TAU;

/// An angle.
#[derive(Clone, Debug, PartialEq)]
pub struct Angle {
    /// `true` if it is in degrees.
    pub degrees: bool,
    /// The reason.
    pub because: String,
}

impl Angle {
    /// An angle in radians.
    pub fn radians(because: &str) -> Self {
        Self { degrees: false, because: because.to_string() }
    }
}

/// Recognises an angle by its jumps by a full turn, or by its name. `restarts` are the rows at which a trajectory begins.
pub fn angle(name: &str, values: &[f64], restarts: &[usize]) -> Option<Angle> {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let steps = || (1..values.len()).filter(|k| !restarts.contains(k)).map(|k| (values[k] - values[k - 1]).abs());
    let jumps = |turn: f64| match high - low <= WRAPPED_RANGE * turn && high - low > (1.0 - TURN_TOLERANCE) * turn {
        true => steps().filter(|step| (step / turn - 1.0).abs() < TURN_TOLERANCE).count(),
        false => 0,
    };
    // A few long steps among many short ones.
    let few = |count: usize| count > 0 && count * SAMPLES_PER_JUMP <= values.len();
    if few(jumps(TAU)) {
        return Some(Angle::radians("it jumps by a full turn"));
    }
    if few(jumps(360.0)) {
        return Some(Angle { degrees: true, because: "it jumps by 360".to_string() });
    }
    if in_degrees(name) {
        return Some(Angle { degrees: true, because: "its name".to_string() });
    }
    if !is_angle(name) {
        return None;
    }
    // Beyond a turn to either side, and within one in degrees.
    let degrees = low.abs().max(high.abs()) > MOST_TURNS_IN_RADIANS * TAU && low >= -360.0 && high <= 360.0;
    let because = if degrees {
        format!("its name; in degrees, because it reaches {:.0}", low.abs().max(high.abs()))
    } else {
        "its name".to_string()
    };
    Some(Angle { degrees, because })
}
