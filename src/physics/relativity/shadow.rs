//! A picture's rays: one for every pixel.

use super::camera::Camera;
use super::camera::Tetrad;
use super::error::RelativityError;
use super::event::{dot, norm};
use super::rays::{Ray, RayOutcome, Tracing, trace_each};
use crate::lagrangian::EulerLagrange;

/// Ends of the rays of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Shadow {
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Rays, row by row from the upper left corner.
    pub(crate) rays: Vec<Ray>,
}

/// Differences of two pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Share of the pixels that one picture has in the shadow, or unfinished, and the other on the sky.
    pub shadow: f64,
    /// Median of the angles between the places on the sky, in rad; `NaN` where there is no sky.
    pub median: f64,
    /// 99 % of the angles are smaller, in rad.
    pub most: f64,
}

/// Follows the ray of the middle of every pixel of a camera.
///
/// `progress` receives the number of pixels of every block that is done, from any thread. Pixels that a model had not reached when it was
/// interrupted are unfinished. The result does not depend on the number of threads.
///
/// # Errors
/// [`RelativityError`].
pub fn shadow(
    model: &dyn EulerLagrange<f64>,
    camera: &Camera,
    tracing: &Tracing,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Shadow, RelativityError> {
    let tetrad = Tetrad::new(model, camera)?;
    let Camera { chart, width, height, .. } = *camera;
    let start = |pixel: usize| {
        let middle = camera.direction((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
        (tetrad.event, tetrad.ray(middle))
    };
    Ok(Shadow { width, height, rays: trace_each(model, &chart, width * height, &start, tracing, progress)? })
}

/// Angle between unit vectors, in rad, right near 0 too.
pub(super) fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let difference: [f64; 3] = std::array::from_fn(|i| a[i] - b[i]);
    let half = 0.5 * norm(difference);
    if dot(a, b) > 0.0 { 2.0 * half.asin() } else { dot(a, b).max(-1.0).acos() }
}

impl Shadow {
    /// Share of the pixels that belong to the shadow.
    pub(crate) fn share(&self) -> f64 {
        self.count(|fate| fate == RayOutcome::Captured) as f64 / self.rays.len() as f64
    }

    /// Number of rays that were followed to an end.
    pub(crate) fn finished(&self) -> usize {
        self.rays.len() - self.unfinished()
    }

    /// Number of rays that were left unfinished.
    pub(crate) fn unfinished(&self) -> usize {
        self.count(|fate| fate == RayOutcome::Unfinished)
    }

    fn count(&self, of: impl Fn(RayOutcome) -> bool) -> usize {
        self.rays.iter().filter(|ray| of(ray.fate)).count()
    }

    /// Steps of all rays, rejected ones included; each evaluates the model six times.
    pub(crate) fn steps(&self) -> usize {
        self.rays.iter().map(|ray| ray.steps).sum()
    }

    /// Largest drift of `g(k, k)` over the sum of the sizes of its terms, of the rays that escaped.
    pub(crate) fn drift(&self) -> f64 {
        let escaped = self.rays.iter().filter(|ray| matches!(ray.fate, RayOutcome::Escaped(_)));
        escaped.map(|ray| ray.drift).fold(0.0, f64::max)
    }

    /// Differences from another picture of the same camera.
    ///
    /// # Errors
    /// [`RelativityError::Sizes`].
    pub(crate) fn difference(&self, other: &Self) -> Result<Difference, RelativityError> {
        let (mut apart, mut angles) = (0, Vec::new());
        for pair in self.pairs(other)? {
            match pair {
                (RayOutcome::Escaped(a), RayOutcome::Escaped(b)) => angles.push(angle(a, b)),
                (RayOutcome::Escaped(_), _) | (_, RayOutcome::Escaped(_)) => apart += 1,
                _ => {}
            }
        }
        angles.sort_by(f64::total_cmp);
        let at = |part: f64| {
            let place = (part * angles.len() as f64) as usize;
            angles.get(place.min(angles.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
        };
        Ok(Difference { shadow: f64::from(apart) / self.rays.len() as f64, median: at(0.5), most: at(0.99) })
    }

    /// The ends of the rays of each pixel.
    pub(super) fn pairs(
        &self,
        other: &Self,
    ) -> Result<impl Iterator<Item = (RayOutcome, RayOutcome)>, RelativityError> {
        let (first, second) = ((self.width, self.height), (other.width, other.height));
        if first != second {
            return Err(RelativityError::Sizes { first, second });
        }
        Ok(self.rays.iter().zip(&other.rays).map(|(a, b)| (a.fate, b.fate)))
    }
}
