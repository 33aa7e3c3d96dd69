//! Coordinates around a centre: distances, directions, the equator.

use super::error::RelativityError;
use super::event::directions;
use crate::geometry::{Equator, Turn, TurningPoint};
use crate::lagrangian::EulerLagrange;
use std::f64::consts::FRAC_PI_2;

/// Which coordinates say where something is around a centre; the axis of a spin is `z`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CentralCoordinates {
    /// `t`, `x`, `y`, `z`.
    Cartesian(Chart),
    /// `t`, `r`, `theta`, `phi`.
    Spherical {
        /// Index of the time.
        time: usize,
        /// Index of the radius.
        radius: usize,
        /// Index of the angle from the axis.
        polar: usize,
        /// Index of the angle about the axis.
        azimuth: usize,
    },
}

impl CentralCoordinates {
    /// Recognizes `t, x, y, z` and `t, r, theta, phi` by their names, in any order; `None` for other coordinates.
    pub fn of_names(names: &[&str]) -> Option<Self> {
        let index = |name: &str| names.iter().position(|n| *n == name);
        let time = index("t").filter(|_| names.len() == 4)?;
        let cartesian = || Some(Self::Cartesian(Chart { time, space: [index("x")?, index("y")?, index("z")?] }));
        let spherical =
            || Some(Self::Spherical { time, radius: index("r")?, polar: index("theta")?, azimuth: index("phi")? });
        cartesian().or_else(spherical)
    }

    /// Index of the time.
    pub(crate) fn time(self) -> usize {
        match self {
            Self::Cartesian(Chart { time, .. }) | Self::Spherical { time, .. } => time,
        }
    }

    /// The place of a distance in a direction `(x, y, z)` of unit length, `(4)`, at time 0.
    pub(crate) fn place(self, distance: f64, [x, y, z]: [f64; 3]) -> [f64; 4] {
        let mut q = [0.0; 4];
        match self {
            Self::Cartesian(Chart { space, .. }) => {
                space.iter().zip([x, y, z]).for_each(|(&i, x)| q[i] = distance * x);
            }
            Self::Spherical { radius, polar, azimuth, .. } => {
                (q[radius], q[polar], q[azimuth]) = (distance, z.acos(), y.atan2(x));
            }
        }
        q
    }

    /// Points `(points, 4)` in all directions, their distances uniform in the logarithm.
    pub(crate) fn points(self, points: usize, range: (f64, f64)) -> Vec<f64> {
        directions(points, range).flat_map(|(distance, direction)| self.place(distance, direction)).collect()
    }

    /// Distance from the centre.
    pub fn distance(self, q: &[f64]) -> f64 {
        match self {
            Self::Cartesian(Chart { space, .. }) => space.iter().map(|&i| q[i] * q[i]).sum::<f64>().sqrt(),
            Self::Spherical { radius, .. } => q[radius],
        }
    }

    /// A number of the sign of the rate of the distance.
    pub(crate) fn outward(self, q: &[f64], v: &[f64]) -> f64 {
        match self {
            Self::Cartesian(Chart { space, .. }) => space.iter().map(|&i| q[i] * v[i]).sum(),
            Self::Spherical { radius, .. } => v[radius],
        }
    }

    /// Angle about the axis, up to full turns.
    pub(crate) fn azimuth(self, q: &[f64]) -> f64 {
        match self {
            Self::Cartesian(Chart { space: [x, y, _], .. }) => q[y].atan2(q[x]),
            Self::Spherical { azimuth, .. } => q[azimuth],
        }
    }

    /// Position in space, `(x, y, z)` of the distance and the angles.
    pub(crate) fn position(self, q: &[f64]) -> [f64; 3] {
        match self {
            Self::Cartesian(Chart { space, .. }) => space.map(|i| q[i]),
            Self::Spherical { radius, polar, azimuth, .. } => {
                let across = q[radius] * q[polar].sin();
                [across * q[azimuth].cos(), across * q[azimuth].sin(), q[radius] * q[polar].cos()]
            }
        }
    }

    /// A point of the equator, for [`CentralCoordinates::equator`].
    pub fn origin(self) -> [f64; 4] {
        let mut q = [0.0; 4];
        if let Self::Spherical { polar, .. } = self {
            q[polar] = FRAC_PI_2;
        }
        q
    }

    /// The equator of a metric along `x`; `origin` is that of [`CentralCoordinates::origin`].
    pub fn equator<'a>(self, model: &'a dyn EulerLagrange<f64>, origin: &'a [f64; 4]) -> Equator<'a, f64> {
        let (time, radius, turn) = match self {
            Self::Cartesian(Chart { time, space: [x, y, _] }) => (time, x, Turn::Across(y)),
            Self::Spherical { time, radius, azimuth, .. } => (time, radius, Turn::Angle(azimuth)),
        };
        Equator { model, time, radius, turn, point: origin }
    }

    /// The state of a motion that turns in the equator at a distance.
    pub fn turning(self, distance: f64, turning: &TurningPoint<f64>) -> [[f64; 4]; 2] {
        let (q, mut v) = (self.place(distance, [1.0, 0.0, 0.0]), [0.0; 4]);
        v[self.time()] = turning.time_rate;
        match self {
            Self::Cartesian(Chart { space: [_, y, _], .. }) => v[y] = distance * turning.turning_rate,
            Self::Spherical { azimuth, .. } => v[azimuth] = turning.turning_rate,
        }
        [q, v]
    }
}

/// Indices of the coordinates of a metric: a time, on which it does not depend, and Cartesian places around a centre at their origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chart {
    /// Index of the time.
    pub time: usize,
    /// Indices of `x`, `y`, `z`.
    pub space: [usize; 3],
}

impl Default for Chart {
    /// `t, x, y, z`.
    fn default() -> Self {
        Self { time: 0, space: [1, 2, 3] }
    }
}

impl Chart {
    /// Refuses a model of another number of coordinates, and indices that do not name each of them once.
    ///
    /// # Errors
    /// [`RelativityError::Coordinates`], [`RelativityError::Chart`].
    pub(super) fn check(&self, coordinates: usize) -> Result<(), RelativityError> {
        let Self { time, space } = *self;
        if coordinates != 4 {
            return Err(RelativityError::Coordinates { found: coordinates });
        }
        let mut named = [time, space[0], space[1], space[2]];
        named.sort_unstable();
        if named == [0, 1, 2, 3] { Ok(()) } else { Err(RelativityError::Chart { time, space }) }
    }

    /// The places of a vector `(4)`.
    pub(crate) fn space_of(&self, vector: [f64; 4]) -> [f64; 3] {
        self.space.map(|i| vector[i])
    }

    /// The vector of a time and places, `(4)`.
    pub(crate) fn vector(&self, time: f64, space: [f64; 3]) -> [f64; 4] {
        let mut vector = [0.0; 4];
        vector[self.time] = time;
        self.space.iter().zip(space).for_each(|(&i, x)| vector[i] = x);
        vector
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_named_once() {
        let chart = Chart { time: 2, space: [3, 0, 1] };
        assert_eq!(chart.vector(5.0, [1.0, 2.0, 3.0]), [2.0, 3.0, 5.0, 1.0]);
        assert_eq!(chart.space_of([2.0, 3.0, 5.0, 1.0]), [1.0, 2.0, 3.0]);
        assert_eq!(chart.check(4), Ok(()));
        assert_eq!(chart.check(3), Err(RelativityError::Coordinates { found: 3 }));
        for wrong in [Chart { time: 1, ..Chart::default() }, Chart { time: 4, ..Chart::default() }] {
            assert!(matches!(wrong.check(4), Err(RelativityError::Chart { .. })));
        }
    }
}
