//! The camera: its position and motion, and the direction of every pixel.

use super::coordinates::{Chart, depends_on_time};
use super::orbits::{along, dot, lower, norm, product, scaled};
use super::thresholds::{EXAMINED_SPAN, SKY_OF_EXACT, SKY_OF_LEARNED};
use super::{RelativityError, expect};
use crate::geometry::Metric;
use crate::lagrangian::{EulerLagrange, Request, Terms};
use std::f64::consts::PI;

/// Motion of the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Observer {
    /// At rest: its coordinates do not change.
    #[default]
    Rest,
    /// Along the normal of the slices of equal time. In Kerr-Schild coordinates it falls, outside the horizon and inside.
    Normal,
}

impl Observer {
    /// All motions.
    pub const ALL: [Self; 2] = [Self::Rest, Self::Normal];

    /// Returns its name in options.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rest => "rest",
            Self::Normal => "normal",
        }
    }

    /// Describes it in a few words.
    pub const fn about(self) -> &'static str {
        match self {
            Self::Rest => "At rest",
            Self::Normal => {
                "Along the normal of the slices of equal time; in Kerr-Schild coordinates this observer falls inwards"
            }
        }
    }
}

/// A camera that looks at the centre.
///
/// Up is the direction of falling inclination: a hole whose spin points along `z` turns from the left towards the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Coordinates of the metric.
    pub chart: Chart,
    /// Euclidean distance from the centre in the coordinates, in their unit.
    pub distance: f64,
    /// Angle from the axis `z`, in rad, from 0 to pi.
    pub inclination: f64,
    /// Angle about the axis `z` from `x` towards `y`, in rad.
    pub azimuth: f64,
    /// Motion.
    pub observer: Observer,
    /// Angle between the left and the right end of the picture, in rad, below pi.
    pub field_of_view: f64,
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Camera {
    /// Pixels of a picture at most: minutes of work, and a gigabyte.
    pub const MOST_PIXELS: usize = 1 << 24;

    /// A camera at rest over `x` with 400 x 400 pixels of 70 degrees, at a distance and an inclination in rad.
    pub fn new(distance: f64, inclination: f64) -> Self {
        Self {
            chart: Chart::default(),
            distance,
            inclination,
            azimuth: 0.0,
            observer: Observer::Rest,
            field_of_view: 70f64.to_radians(),
            width: 400,
            height: 400,
        }
    }

    /// Distance of the sky of an exact metric.
    pub fn sky_of_exact(&self) -> f64 {
        SKY_OF_EXACT * self.distance
    }

    /// Distance of the sky of a learned metric.
    pub fn sky_of_learned(&self) -> f64 {
        SKY_OF_LEARNED * self.distance
    }

    /// Refuses numbers out of range.
    ///
    /// # Errors
    /// [`RelativityError::Invalid`].
    pub(super) fn check(&self) -> Result<(), RelativityError> {
        let Self { distance, inclination, azimuth, field_of_view, width, height, .. } = *self;
        let positive = distance.is_finite() && distance > 0.0;
        expect(positive, "distance", "a finite number above 0", distance)?;
        expect((0.0..=PI).contains(&inclination), "inclination", "0 to pi", inclination)?;
        expect(azimuth.is_finite(), "azimuth", "a finite number", azimuth)?;
        let narrow = field_of_view > 0.0 && field_of_view < PI;
        expect(narrow, "field of view", "an angle between 0 and pi", field_of_view)?;
        let pixels = width.checked_mul(height).filter(|pixels| (1..=Self::MOST_PIXELS).contains(pixels));
        expect(pixels.is_some(), "pixels", "1 to 2^24", width as f64 * height as f64)
    }

    /// Directions right, up and forward in the coordinates of space, orthonormal in the Euclidean sense.
    pub(crate) fn axes(&self) -> [[f64; 3]; 3] {
        let ((si, ci), (sa, ca)) = (self.inclination.sin_cos(), self.azimuth.sin_cos());
        [[-sa, ca, 0.0], [-ci * ca, -ci * sa, si], [-si * ca, -si * sa, -ci]]
    }

    /// Coordinates of the camera at the time 0.
    pub(crate) fn event(&self) -> [f64; 4] {
        self.chart.vector(0.0, scaled(-self.distance, self.axes()[2]))
    }

    /// Direction of a point of the picture: components right, up and forward, a unit vector. Columns and rows are counted from the upper
    /// left corner; the middle of the first pixel is `(0.5, 0.5)`.
    pub(crate) fn direction(&self, column: f64, row: f64) -> [f64; 3] {
        let (width, height) = (self.width as f64, self.height as f64);
        let scale = 2.0 * (0.5 * self.field_of_view).tan() / width;
        let toward = [scale * (column - 0.5 * width), scale * (0.5 * height - row), 1.0];
        scaled(norm(toward).recip(), toward)
    }
}

/// Orthonormal frame of a camera: `g(e_0, e_0) = -1`, `g(e_k, e_k) = 1`, all else 0, whatever sign convention the metric has.
#[derive(Clone, Debug, PartialEq)]
pub struct Tetrad {
    /// Coordinates of the camera.
    pub event: [f64; 4],
    /// Velocity of the camera, then the directions right, up and forward, each a vector `(4)`.
    pub legs: [[f64; 4]; 4],
    /// `g_ij` at the camera, `(4, 4)`, of signature `-+++`.
    metric: Vec<f64>,
    camera: Camera,
}

impl Tetrad {
    /// The frame of a camera in a metric by Gram-Schmidt orthonormalization: velocity, forward, right, up.
    ///
    /// # Errors
    /// [`RelativityError`]: a model that is not a metric of space-time, a camera that cannot be at rest at its position.
    pub fn new(model: &dyn EulerLagrange<f64>, camera: &Camera) -> Result<Self, RelativityError> {
        camera.check()?;
        camera.chart.check(model.coordinates())?;
        let event = camera.event();
        let centre = camera.chart.vector(0.0, scaled(0.5, camera.chart.space_of(event)));
        let mirrored = camera.chart.vector(0.0, scaled(-1.0, camera.chart.space_of(event)));
        let points = [event, centre, mirrored].concat();
        if depends_on_time(model, camera.chart.time, &points, EXAMINED_SPAN * camera.distance)? {
            return Err(RelativityError::DependsOnTime);
        }
        let mut terms = Terms::default();
        model.terms(&event, &[0.0; 4], Request::MASS_MATRIX, &mut terms)?;
        let found = Metric::new(4, &terms.mass_matrix)?;
        let sign = match (found.signature.negative, found.signature.positive) {
            (1, 3) => 1.0,
            (3, 1) => -1.0,
            (negative, positive) => return Err(RelativityError::Signature { negative, positive }),
        };
        let metric: Vec<f64> = found.components.iter().map(|g| sign * g).collect();
        let time = camera.chart.time;
        let velocity = match camera.observer {
            Observer::Rest => camera.chart.vector(1.0, [0.0; 3]),
            Observer::Normal => std::array::from_fn(|i| -sign * found.inverse[4 * i + time]),
        };
        let square = -product(&metric, velocity, velocity);
        if square.is_nan() || square <= 0.0 {
            return Err(RelativityError::NothingRests);
        }
        let mut legs = [scaled(square.sqrt().recip(), velocity); 4];
        let mut done = vec![0];
        for (leg, axis) in [(3, 2), (1, 0), (2, 1)] {
            let mut vector = camera.chart.vector(0.0, camera.axes()[axis]);
            for &k in &done {
                let sign = if k == 0 { 1.0 } else { -1.0 };
                vector = along(vector, sign * product(&metric, vector, legs[k]), legs[k]);
            }
            legs[leg] = scaled(product(&metric, vector, vector).sqrt().recip(), vector);
            done.push(leg);
        }
        Ok(Self { event, legs, metric, camera: *camera })
    }

    /// Tangent of the ray that shows a direction (parts right, up, forward, a unit vector), backwards in time: `k = -e_0 + n_k e_k`.
    pub fn ray(&self, direction: [f64; 3]) -> [f64; 4] {
        let start = scaled(-1.0, self.legs[0]);
        direction.iter().zip(&self.legs[1..]).fold(start, |k, (&part, &leg)| along(k, part, leg))
    }

    /// Celestial coordinates of a ray from the camera, `R` times the parts of its momentum along right and up over its energy `-p_t`, in the
    /// unit of the coordinates: impact parameters to the right and above of the centre.
    ///
    /// The first times the sine of the inclination is `-L_z/E` of the light, exactly, in every metric around the axis `z` (Bardeen 1973); its
    /// length is `L/E` where the metric is the same in all directions.
    pub fn celestial(&self, k: [f64; 4]) -> [f64; 2] {
        let momentum = lower(&self.metric, k);
        let [right, up, _] = self.camera.axes();
        let (energy, space) = (momentum[self.camera.chart.time], self.camera.chart.space_of(momentum));
        [right, up].map(|axis| self.camera.distance * dot(axis, space) / energy)
    }
}

#[cfg(test)]
mod tests {
    use super::super::orbits::dot;
    use super::*;

    #[test]
    fn pixels_have_their_directions() {
        let camera = Camera { width: 40, height: 20, ..Camera::new(10.0, 1.1) };
        assert_eq!(camera.direction(20.0, 10.0), [0.0, 0.0, 1.0]);
        let [right, up, forward] = camera.direction(40.0, 10.0);
        assert!((right.atan2(forward) - 35f64.to_radians()).abs() < 1e-14 && up == 0.0);
        let corner = camera.direction(0.0, 0.0);
        assert!(corner[0] < 0.0 && corner[1] == -corner[0] / 2.0 && (norm(corner) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn it_looks_at_the_centre() {
        for (inclination, azimuth) in [(0.0, 0.0), (0.7, -2.0), (PI / 2.0, 1.0), (PI, 0.3)] {
            let camera = Camera { azimuth, ..Camera::new(10.0, inclination) };
            let [right, up, forward] = camera.axes();
            let place = camera.chart.space_of(camera.event());
            assert!(norm(place) - 10.0 < 1e-14 && (dot(place, forward) + 10.0).abs() < 1e-14);
            assert!(dot(right, up).abs() + dot(up, forward).abs() + dot(right, forward).abs() < 1e-14);
            // Right x up points backwards.
            let z = right[0] * up[1] - right[1] * up[0];
            assert!((z + forward[2]).abs() < 1e-14);
        }
    }

    #[test]
    fn numbers_without_a_picture_are_refused() {
        let fine = Camera::new(10.0, 1.0);
        assert_eq!(fine.check(), Ok(()));
        for wrong in [
            Camera { distance: 0.0, ..fine },
            Camera { inclination: -0.1, ..fine },
            Camera { azimuth: f64::NAN, ..fine },
            Camera { field_of_view: PI, ..fine },
            Camera { width: 0, ..fine },
            Camera { height: usize::MAX, ..fine },
        ] {
            assert!(matches!(wrong.check(), Err(RelativityError::Invalid { .. })), "{wrong:?}");
        }
    }
}
