//! The states of interest of a description: their bounds, the shell around a centre, and the starts of test trajectories.

use super::{Description, DescriptionError, Quantity};
use crate::lagrangian::system::{Bounds, ShellAdvice, TrajectoryTest};
use crate::names::unknown;
use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;
use core::f64::consts::PI;

impl Description {
    /// Returns the bounds of the coordinates; a velocity that follows from the mass shell has none.
    pub(super) fn base_bounds(&self, fixed: Option<usize>) -> Result<Bounds, DescriptionError> {
        let mut bounds = Bounds { positions: Vec::new(), velocities: Vec::new() };
        for (i, coordinate) in self.coordinates.iter().enumerate() {
            let missing =
                |what: &str| DescriptionError::new(format!("coordinates[{i}]"), format!("missing key \"{what}\""));
            bounds.positions.push(match &coordinate.bounds {
                Some(pair) => ordered(&format!("coordinates[{i}].bounds"), pair)?,
                None if coordinate.periodic => (0.0, 2.0 * PI),
                None => return Err(missing("bounds")),
            });
            bounds.velocities.push(match &coordinate.velocity_bounds {
                Some(pair) => ordered(&format!("coordinates[{i}].velocity_bounds"), pair)?,
                None if fixed == Some(i) => (0.0, 0.0),
                None => return Err(missing("velocity_bounds")),
            });
        }
        Ok(bounds)
    }

    /// Returns a box of states, with the columns in a table replaced.
    pub(super) fn bounds(
        &self,
        table: &str,
        given: &BTreeMap<String, [Quantity; 2]>,
        base: Bounds,
    ) -> Result<Bounds, DescriptionError> {
        let mut bounds = base;
        for (column, pair) in given {
            let key = format!("{table}.{column}");
            let pair = ordered(&key, pair)?;
            let names = self.coordinates.iter().map(|c| c.name.clone());
            let columns: Vec<String> = names.clone().chain(names.map(|name| format!("{name}_dot"))).collect();
            let n = self.coordinates.len();
            match columns.iter().position(|known| known == column) {
                Some(i) if i < n => bounds.positions[i] = pair,
                Some(i) => bounds.velocities[i - n] = pair,
                None => {
                    return Err(DescriptionError::new(key, unknown("key", column, columns.iter().map(String::as_str))));
                }
            }
        }
        Ok(bounds)
    }

    /// Returns the shell of the training states; `time` is the time-like coordinate of the mass shell.
    pub(super) fn shell_advice(&self, time: Option<usize>) -> Result<Option<ShellAdvice>, DescriptionError> {
        let Some(shell) = &self.shell else { return Ok(None) };
        if time.is_none() {
            let problem = "expected a metric with a time_like coordinate that has no velocity_bounds";
            return Err(DescriptionError::new("shell", problem));
        }
        let names = || self.coordinates.iter().map(|c| c.name.as_str());
        let mut coordinates = Vec::with_capacity(shell.coordinates.len());
        for name in &shell.coordinates {
            match names().position(|known| known == name) {
                Some(i) if Some(i) != time && !coordinates.contains(&i) => coordinates.push(i),
                Some(_) => {
                    let problem = format!("expected coordinates of space, each once, found {name:?}");
                    return Err(DescriptionError::new("shell.coordinates", problem));
                }
                None => return Err(DescriptionError::new("shell.coordinates", unknown("coordinate", name, names()))),
            }
        }
        if coordinates.is_empty() {
            return Err(DescriptionError::new("shell.coordinates", "expected one name at least"));
        }
        let radius = ordered("shell.radius", &shell.radius)?;
        let rapidity = shell.rapidity.map_or(1.0, |rapidity| rapidity.0);
        if radius.0 <= 0.0 {
            return Err(DescriptionError::new(
                "shell.radius",
                format!("expected distances above 0, found {}", radius.0),
            ));
        }
        if !(rapidity.is_finite() && rapidity >= 0.0) {
            let problem = format!("expected a finite number, at least 0, found {rapidity}");
            return Err(DescriptionError::new("shell.rapidity", problem));
        }
        Ok(Some(ShellAdvice { coordinates: coordinates.into(), radius, rapidity }))
    }

    pub(super) fn trajectory_test(&self, validation: &Bounds) -> Result<TrajectoryTest, DescriptionError> {
        let positive = |key: &str, value: Option<Quantity>, usual: f64| match value {
            Some(Quantity(x)) if !(x.is_finite() && x > 0.0) => {
                Err(DescriptionError::new(key, format!("expected a finite number above 0, found {x}")))
            }
            other => Ok(other.map_or(usual, |x| x.0)),
        };
        let t_end = positive("trajectory.t_end", self.trajectory.t_end, 10.0)?;
        let dt = positive("trajectory.dt", self.trajectory.dt, t_end / 100.0)?;
        if t_end / dt > 1e6 {
            return Err(DescriptionError::new(
                "trajectory.dt",
                format!("expected at least a millionth of t_end = {t_end}"),
            ));
        }
        // A trajectory may start at any angle.
        let half = |&(low, high): &(f64, f64)| (0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high);
        let middle = Bounds {
            positions: validation
                .positions
                .iter()
                .zip(&self.coordinates)
                .map(|(b, c)| if c.periodic { *b } else { half(b) })
                .collect(),
            velocities: validation.velocities.iter().map(half).collect(),
        };
        let start = self.bounds("trajectory.start", &self.trajectory.start, middle)?;
        Ok(TrajectoryTest { start, t_end, dt })
    }
}

/// Checks that bounds are finite and in increasing order.
fn ordered(key: &str, &[Quantity(low), Quantity(high)]: &[Quantity; 2]) -> Result<(f64, f64), DescriptionError> {
    if low.is_finite() && high.is_finite() && low < high && (high - low).is_finite() {
        return Ok((low, high));
    }
    Err(DescriptionError::new(key, format!("expected [low, high], finite and in this order, found [{low}, {high}]")))
}
