//! Bodies of simple shapes, and rotations in MuJoCo's notations.

use super::mjcf::Styled;
use super::rigid::{Body, Place, turned};
use super::xml::{Fault, fault};
use crate::lagrangian::{Matrix, Vector, transposed};
use crate::pipeline::thresholds::DEFAULT_DENSITY;
use std::f64::consts::PI;

fn length(x: Vector<f64>) -> f64 {
    x[0].hypot(x[1]).hypot(x[2])
}

/// Normalizes a vector; `None` for a zero vector.
fn unit(x: Vector<f64>) -> Option<Vector<f64>> {
    let length = length(x);
    (length > f64::MIN_POSITIVE && length.is_finite()).then(|| x.map(|x| x / length))
}

/// Rotation matrix of a quaternion `w, x, y, z` of any length.
pub(super) fn of_quaternion(q: [f64; 4]) -> Option<Matrix<f64>> {
    let size = q[0].hypot(q[1]).hypot(q[2]).hypot(q[3]);
    if !(size > f64::MIN_POSITIVE && size.is_finite()) {
        return None;
    }
    let [w, x, y, z] = q.map(|q| q / size);
    Some([
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ])
}

/// Rotation about an axis by an angle in rad.
pub(super) fn about(axis: Vector<f64>, angle: f64) -> Option<Matrix<f64>> {
    let (sine, cosine) = (angle / 2.0).sin_cos();
    let [x, y, z] = unit(axis)?;
    of_quaternion([cosine, sine * x, sine * y, sine * z])
}

/// Rotation whose x axis is along the first vector, and whose y axis is in the plane of both.
pub(super) fn of_axes(x: Vector<f64>, y: Vector<f64>) -> Option<Matrix<f64>> {
    let x = unit(x)?;
    let along: f64 = x.iter().zip(y).map(|(x, y)| x * y).sum();
    let y = unit([0, 1, 2].map(|i| y[i] - along * x[i]))?;
    let z = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    Some(transposed([x, y, z]))
}

/// Smallest rotation that takes the z axis to a vector.
pub(super) fn onto(z: Vector<f64>) -> Option<Matrix<f64>> {
    let [x, y, z] = unit(z)?;
    match z > -1.0 + f64::EPSILON {
        true => of_quaternion([1.0 + z, -y, x, 0.0]),
        false => of_quaternion([0.0, 1.0, 0.0, 0.0]),
    }
}

/// Computes the body of a geom in the frame of the body that contains it.
pub(super) fn body(geom: &Styled<'_, '_, '_>) -> Result<Body, Fault> {
    let kind = geom.text("type").unwrap_or("sphere");
    let mass = geom.numbers("mass", &[1])?.map(|mass| mass[0]);
    let density = geom.numbers("density", &[1])?.map_or(DEFAULT_DENSITY, |density| density[0]);
    if mass == Some(0.0) || mass.is_none() && density == 0.0 || kind == "plane" {
        return Ok(Body::default());
    }
    if mass.is_some_and(|mass| mass < 0.0) || density < 0.0 {
        return Err(fault(geom.node, "expected a mass and a density of at least 0"));
    }
    let mut place = geom.place()?;
    let size = geom.numbers("size", &[1, 2, 3])?.unwrap_or_default();
    let half = match geom.numbers("fromto", &[6])? {
        None => None,
        Some(ends) => {
            let (from, to) = ([ends[0], ends[1], ends[2]], [ends[3], ends[4], ends[5]]);
            let along: Vector<f64> = std::array::from_fn(|i| to[i] - from[i]);
            let turn = onto(along).ok_or_else(|| fault(geom.node, "`fromto`: expected two points"))?;
            place = Place { turn, at: std::array::from_fn(|i| (from[i] + to[i]) / 2.0) };
            Some(length(along) / 2.0)
        }
    };
    let missing = || fault(geom.node, format!("`size`: expected the positive sizes of a {kind}"));
    let at = |i: usize| size.get(i).copied().filter(|x| *x > 0.0).ok_or_else(missing);
    let tall = |i: usize| half.map_or_else(|| at(i), Ok);
    let (volume, squares) = match kind {
        "sphere" => of_ellipsoid([at(0)?; 3]),
        "ellipsoid" => of_ellipsoid([at(0)?, at(1)?, tall(2)?]),
        "box" => {
            let [x, y, z] = [at(0)?, if half.is_some() && size.len() == 1 { at(0)? } else { at(1)? }, tall(2)?];
            (8.0 * x * y * z, [x, y, z].map(|x| x * x / 3.0))
        }
        "cylinder" => of_cylinder(at(0)?, tall(1)?),
        "capsule" => of_capsule(at(0)?, tall(1)?),
        _ => {
            let problem = format!("a {kind} has no body that is computed here, expected <inertial> in its body");
            return Err(fault(geom.node, problem));
        }
    };
    let mass = mass.unwrap_or(density * volume);
    let [x, y, z] = squares.map(|square| mass * square);
    let inertia = [[y + z, 0.0, 0.0], [0.0, x + z, 0.0], [0.0, 0.0, x + y]];
    Ok(Body::about(mass, place.at, &turned(&place.turn, &inertia)))
}

/// Volume of a shape, and mean squares of the coordinates about its centre.
type Shape = (f64, [f64; 3]);

fn of_ellipsoid([a, b, c]: [f64; 3]) -> Shape {
    (4.0 / 3.0 * PI * a * b * c, [a, b, c].map(|x| x * x / 5.0))
}

fn of_cylinder(radius: f64, half: f64) -> Shape {
    (2.0 * PI * radius * radius * half, [radius * radius / 4.0, radius * radius / 4.0, half * half / 3.0])
}

/// A capsule consists of a cylinder and two half balls, whose centres of mass are `3 r/8` from their faces.
fn of_capsule(radius: f64, half: f64) -> Shape {
    let (tube, [across, _, along]) = of_cylinder(radius, half);
    let (ball, [round, ..]) = of_ellipsoid([radius; 3]);
    let whole = tube + ball;
    let caps = round + half * half + 0.75 * radius * half;
    let mean = |of_tube: f64, of_ball: f64| (tube * of_tube + ball * of_ball) / whole;
    (whole, [mean(across, round), mean(across, round), mean(along, caps)])
}
