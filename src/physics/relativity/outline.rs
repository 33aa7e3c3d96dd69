//! The edge of a shadow, by bisection between rays that are captured and rays that escape.

use super::camera::Camera;
use super::camera::Tetrad;
use super::error::{RelativityError, expect};
use super::rays::{RayOutcome, TOLERANCES, Tracing, trace};
use crate::lagrangian::EulerLagrange;
use std::f64::consts::{PI, TAU};

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
    fn quarter(&self, quarters: usize) -> Edge {
        self.edges[quarters * self.edges.len() / 4]
    }

    /// The edge right of the centre.
    pub fn right(&self) -> Edge {
        self.quarter(0)
    }
    /// The edge above the centre.
    pub fn top(&self) -> Edge {
        self.quarter(1)
    }
    /// The edge left of the centre.
    pub fn left(&self) -> Edge {
        self.quarter(2)
    }
    /// The edge below the centre.
    pub fn bottom(&self) -> Edge {
        self.quarter(3)
    }
}

/// Halvings of the angle from 0 to pi.
const HALVINGS: usize = 30;
/// Tolerance of a step here over that of a picture.
const FINER: f64 = 0.01;

/// Finds the edge of the shadow in directions around the centre of the picture, to `pi/2^30` of an angle and the error of rays that are a
/// hundred times as exact as those of a picture; `None` if the ray of the centre is not captured.
///
/// Along every direction the shadow is taken to end once. `directions` is rounded up to a multiple of four.
///
/// # Errors
/// [`RelativityError`].
pub fn outline(
    model: &dyn EulerLagrange<f64>,
    camera: &Camera,
    tracing: &Tracing,
    directions: usize,
) -> Result<Option<Outline>, RelativityError> {
    expect(directions > 0, "directions", "at least 1", directions as f64)?;
    let tetrad = Tetrad::new(model, camera)?;
    let count = directions.next_multiple_of(4);
    let tracing = Tracing { tolerance: (FINER * tracing.tolerance).max(TOLERANCES.0), ..*tracing };
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
    for _ in 0..HALVINGS {
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
