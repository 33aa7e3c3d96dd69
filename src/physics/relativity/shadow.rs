//! Shadows: a picture's rays, one for every pixel, and the edge, by bisection between rays that are captured and rays that escape.

use super::camera::{Camera, Tetrad};
use super::orbits::{dot, norm};
use super::rays::{Ray, RayOutcome, Tracing, trace, trace_each};
use super::thresholds::{EDGE_HALVINGS, EDGE_TOLERANCE, TOLERANCES};
use super::{RelativityError, expect};
use crate::lagrangian::EulerLagrange;
use std::f64::consts::{PI, TAU};

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
    /// Share of the pixels that one picture has in the shadow, or unfinished, and the other on the sky, or on another sky.
    pub shadow: f64,
    /// Median of the angles between the places on the sky, in rad; `NaN` where there is no sky.
    pub median: f64,
    /// 99 % of the angles are smaller, in rad.
    pub most: f64,
}

impl Shadow {
    /// Follows the ray of the middle of every pixel of a camera.
    ///
    /// `progress` receives the number of pixels of every finished block, from any thread. Pixels that the model had not reached when it was
    /// interrupted are unfinished. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`RelativityError`].
    pub fn of(
        model: &dyn EulerLagrange<f64>,
        camera: &Camera,
        tracing: &Tracing,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Result<Self, RelativityError> {
        let tetrad = Tetrad::new(model, camera)?;
        let Camera { chart, width, height, .. } = *camera;
        let start = |pixel: usize| {
            let middle = camera.direction((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
            (tetrad.event, tetrad.ray(middle))
        };
        Ok(Shadow { width, height, rays: trace_each(model, &chart, width * height, &start, tracing, progress)? })
    }
}

/// A place on one of the two skies, if there is one.
type Place = Option<(usize, [f64; 3])>;

/// Angle between unit vectors, in rad, accurate also near 0.
pub(super) fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let difference: [f64; 3] = std::array::from_fn(|i| a[i] - b[i]);
    let half = 0.5 * norm(difference);
    if dot(a, b) > 0.0 { 2.0 * half.asin() } else { dot(a, b).max(-1.0).acos() }
}

impl Shadow {
    /// Fraction of the pixels that belong to the shadow.
    pub(crate) fn share(&self) -> f64 {
        self.count(|fate| fate == RayOutcome::Captured) as f64 / self.rays.len() as f64
    }

    /// Share of the pixels that show the second region; 0 if there is none.
    pub(crate) fn crossed(&self) -> f64 {
        self.count(|fate| matches!(fate, RayOutcome::Crossed(_))) as f64 / self.rays.len() as f64
    }

    /// Number of rays that were followed to an end.
    pub fn finished(&self) -> usize {
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

    /// Largest drift of `g(k, k)` over the sum of the sizes of its terms, of the rays that come from a sky.
    pub(crate) fn drift(&self) -> f64 {
        let escaped = self.rays.iter().filter(|ray| ray.fate.sky().is_some());
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
                (Some((one, a)), Some((other, b))) if one == other => angles.push(angle(a, b)),
                (None, None) => {}
                _ => apart += 1,
            }
        }
        angles.sort_by(f64::total_cmp);
        let at = |part: f64| {
            let place = (part * angles.len() as f64) as usize;
            angles.get(place.min(angles.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
        };
        Ok(Difference { shadow: f64::from(apart) / self.rays.len() as f64, median: at(0.5), most: at(0.99) })
    }

    /// The places on the sky of each pixel, with the number of the sky.
    pub(super) fn pairs(&self, other: &Self) -> Result<impl Iterator<Item = (Place, Place)>, RelativityError> {
        let (first, second) = ((self.width, self.height), (other.width, other.height));
        if first != second {
            return Err(RelativityError::Sizes { first, second });
        }
        Ok(self.rays.iter().zip(&other.rays).map(|(a, b)| (a.fate.sky(), b.fate.sky())))
    }
}

/// A place of the edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Angle from the direction of the centre, in the frame of the camera, in rad.
    pub angle: f64,
    /// Celestial coordinates of its ray, in the unit of the coordinates: to the right, and above.
    pub celestial: [f64; 2],
}

/// The edge of a shadow, and its area.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Places at equal angles around the centre of the picture, from the right upwards; a multiple of four.
    pub edges: Vec<Edge>,
    /// Area in celestial coordinates, in the square of the unit of the coordinates.
    pub area: f64,
}

impl Outline {
    /// Mean of the angles of the edge, in rad: the angular radius of a circle around the centre.
    pub(crate) fn radius(&self) -> f64 {
        self.edges.iter().map(|edge| edge.angle).sum::<f64>() / self.edges.len() as f64
    }

    fn quarter(&self, quarters: usize) -> Edge {
        self.edges[quarters * self.edges.len() / 4]
    }

    /// The edge right of the centre.
    pub fn right(&self) -> Edge {
        self.quarter(0)
    }
    /// The edge above the centre.
    pub(crate) fn top(&self) -> Edge {
        self.quarter(1)
    }
    /// The edge left of the centre.
    pub(crate) fn left(&self) -> Edge {
        self.quarter(2)
    }
    /// The edge below the centre.
    pub(crate) fn bottom(&self) -> Edge {
        self.quarter(3)
    }

    /// Finds the edge of the shadow, or of the second region, in directions around the centre of the picture, to `pi/2^30` of an angle and the
    /// error of rays a hundred times as accurate as those of a picture; `None` if the ray of the centre is not captured.
    ///
    /// The shadow is assumed to end once along every direction. `directions` is rounded up to a multiple of four.
    ///
    /// # Errors
    /// [`RelativityError`].
    pub fn of(
        model: &dyn EulerLagrange<f64>,
        camera: &Camera,
        tracing: &Tracing,
        directions: usize,
    ) -> Result<Option<Self>, RelativityError> {
        expect(directions > 0, "directions", "at least 1", directions as f64)?;
        let tetrad = Tetrad::new(model, camera)?;
        let count = directions.next_multiple_of(4);
        let tracing = Tracing { tolerance: (EDGE_TOLERANCE * tracing.tolerance).max(TOLERANCES.0), ..*tracing };
        let toward = |k: usize, angle: f64| {
            let ((sin, cos), (up, right)) = (angle.sin_cos(), (TAU * k as f64 / count as f64).sin_cos());
            tetrad.ray([sin * right, sin * up, cos])
        };
        let captured = |tangents: Vec<[f64; 4]>| -> Result<Vec<bool>, RelativityError> {
            let starts: Vec<_> = tangents.into_iter().map(|k| (tetrad.event, k)).collect();
            let rays = trace(model, &camera.chart, &starts, &tracing, &|_| ())?;
            Ok(rays.iter().map(|ray| !matches!(ray.fate, RayOutcome::Escaped(_))).collect())
        };
        if captured(vec![toward(0, 0.0)])? != [true] {
            return Ok(None);
        }
        let mut brackets = vec![(0.0, PI); count];
        for _ in 0..EDGE_HALVINGS {
            let middles: Vec<f64> = brackets.iter().map(|(low, high)| 0.5 * (low + high)).collect();
            let inside = captured(middles.iter().enumerate().map(|(k, &angle)| toward(k, angle)).collect())?;
            for ((bracket, middle), inside) in brackets.iter_mut().zip(middles).zip(inside) {
                *(if inside { &mut bracket.0 } else { &mut bracket.1 }) = middle;
            }
        }
        let edge = |(k, (low, high)): (usize, (f64, f64))| {
            let angle = 0.5 * (low + high);
            Edge { angle, celestial: tetrad.celestial(toward(k, angle)) }
        };
        let edges: Vec<Edge> = brackets.into_iter().enumerate().map(edge).collect();
        let area = area(&edges.iter().map(|edge| edge.celestial).collect::<Vec<_>>());
        Ok(Some(Outline { edges, area }))
    }
}

/// Area within a smooth closed curve through an even number of points at equal steps of its parameter, `(x y' - y x')/2` integrated with the
/// derivatives of the trigonometric interpolant: the error falls faster than any power of the number.
///
/// Source: Trefethen, Spectral Methods in MATLAB (2000), chapter 3.
fn area(points: &[[f64; 2]]) -> f64 {
    let n = points.len();
    let mut sum = 0.0;
    for (j, a) in points.iter().enumerate() {
        for (k, b) in points.iter().enumerate().filter(|(k, _)| *k != j) {
            let steps = j as f64 - k as f64;
            let sign = if (j + k) % 2 == 0 { 0.5 } else { -0.5 };
            let weight = sign / (steps * PI / n as f64).tan();
            sum += weight * (a[0] * b[1] - a[1] * b[0]);
        }
    }
    0.5 * sum * TAU / n as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_of_an_ellipse_is_exact() {
        let points: Vec<[f64; 2]> = (0..16)
            .map(|k| {
                let (sin, cos) = (TAU * f64::from(k) / 16.0).sin_cos();
                [3.0 * cos + 1.0, 2.0 * sin - 0.5 * cos]
            })
            .collect();
        assert!((area(&points) - 6.0 * PI).abs() < 1e-13, "{}", area(&points));
    }
}
