//! Hand-written systems, one file each: Lagrangian, closed-form acceleration, catalogue entry.

pub mod ads2_geodesic;
pub mod ads3_geodesic;
pub mod ads4_geodesic;
mod anti_de_sitter;
mod chain;
pub mod charged_particle;
pub mod constant_force;
pub mod double_pendulum;
pub mod harmonic_oscillator;
pub mod henon_heiles;
pub mod kepler;
pub mod kerr_cartesian;
pub mod kerr_geodesic;
pub mod kerr_schild;
pub mod n_pendulum;
pub mod reissner_nordstrom_cartesian;
pub mod schwarzschild_cartesian;
pub mod schwarzschild_geodesic;
pub mod sphere_geodesic;
pub mod spring_pendulum;
pub mod triple_pendulum;

use super::system::{Coordinate, Parameter, Plane, Range};

/// A mass of 1 kg.
const fn mass(symbol: &'static str) -> Parameter {
    Parameter::new(symbol, "1", "kg", Range::Positive)
}
/// A length of 1 m.
const fn length(symbol: &'static str) -> Parameter {
    Parameter::new(symbol, "1", "m", Range::Positive)
}
/// The paper's acceleration of gravity; zero and negative values are allowed.
const ACCELERATION_OF_GRAVITY: Parameter = Parameter::new("g", "9.8", "m/s^2", Range::Any);

/// The plane of the first two coordinates, `x` and `y`.
const X_AND_Y: Plane = Plane { labels: ["x [m]", "y [m]"], point: |_, q| (q[0], q[1]) };
/// Labels of the place of a chain's last point mass.
const LAST_BOB: [&str; 2] = ["x of the last bob [m]", "y of the last bob [m]"];
/// No place, for a wrong number of parameters.
const NOWHERE: (f64, f64) = (f64::NAN, f64::NAN);

/// `e x e'`, `e` the direction of polar angle and azimuth.
fn angular_velocity([theta, phi]: [f64; 2], [theta_dot, phi_dot]: [f64; 2]) -> [f64; 3] {
    let ((sin, cos), (sin_phi, cos_phi)) = (theta.sin_cos(), phi.sin_cos());
    // theta' points along growing phi, sin theta phi' against growing theta.
    let along = sin * phi_dot;
    [-sin_phi * theta_dot - along * cos * cos_phi, cos_phi * theta_dot - along * cos * sin_phi, along * sin]
}

/// Coordinates that are lengths.
fn lengths(names: &[&'static str]) -> Vec<Coordinate> {
    names.iter().map(|&name| Coordinate::length(name)).collect()
}

/// `theta1`, `theta2`, ..; `theta` if there is one.
fn angles(n: usize) -> Vec<Coordinate> {
    (1..=n).map(|i| Coordinate::angle(if n == 1 { "theta".into() } else { format!("theta{i}") })).collect()
}
