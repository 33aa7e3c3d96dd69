//! The camera's frame: an orthonormal tetrad of the metric where it stands.

use super::camera::{Camera, Observer};
use super::error::RelativityError;
use super::stationary::depends_on_time;
use super::vector::{along, dot, lower, product, times};
use crate::geometry::Metric;
use crate::lagrangian::{EulerLagrange, Request, Terms};

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

/// Time of rays that matters, in distances of the camera.
const SPAN: f64 = 10.0;

impl Tetrad {
    /// The frame of a camera in a metric, by the method of Gram and Schmidt: velocity, forward, right, up.
    ///
    /// # Errors
    /// [`RelativityError`]: a model that is no metric of space-time, a camera that cannot rest where it stands.
    pub fn new(model: &dyn EulerLagrange<f64>, camera: &Camera) -> Result<Self, RelativityError> {
        camera.check()?;
        camera.chart.check(model.coordinates())?;
        let event = camera.event();
        let centre = camera.chart.vector(0.0, times(0.5, camera.chart.space_of(event)));
        let mirrored = camera.chart.vector(0.0, times(-1.0, camera.chart.space_of(event)));
        let points = [event, centre, mirrored].concat();
        if depends_on_time(model, camera.chart.time, &points, SPAN * camera.distance)? {
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
        let mut legs = [times(square.sqrt().recip(), velocity); 4];
        let mut done = vec![0];
        for (leg, axis) in [(3, 2), (1, 0), (2, 1)] {
            let mut vector = camera.chart.vector(0.0, camera.axes()[axis]);
            for &k in &done {
                let sign = if k == 0 { 1.0 } else { -1.0 };
                vector = along(vector, sign * product(&metric, vector, legs[k]), legs[k]);
            }
            legs[leg] = times(product(&metric, vector, vector).sqrt().recip(), vector);
            done.push(leg);
        }
        Ok(Self { event, legs, metric, camera: *camera })
    }

    /// Tangent of the ray that shows a direction (parts right, up, forward, a unit vector), backwards in time: `k = -e_0 + n_k e_k`.
    pub fn ray(&self, direction: [f64; 3]) -> [f64; 4] {
        let start = times(-1.0, self.legs[0]);
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
