//! Coordinates around a centre: distances, directions, the equator.

use super::Chart;
use super::directions::directions;
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
