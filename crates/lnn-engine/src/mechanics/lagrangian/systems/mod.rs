//! Hand-written systems, one file for each family: Lagrangian, closed-form acceleration and catalogue entry; and the catalogue of all of
//! them.

mod anti_de_sitter;
mod boyer_lindquist;
mod kepler;
mod kerr_schild;
mod lattices;
mod oscillators;
mod pendula;
mod sphere_geodesic;
mod uniform_fields;

pub use anti_de_sitter::AdsGeodesic;
pub use boyer_lindquist::{KerrGeodesic, SchwarzschildGeodesic};
pub use kepler::Kepler;
pub use kerr_schild::KerrSchild;
pub use lattices::{Cloth, Lattice};
pub use oscillators::{HarmonicOscillator, HenonHeiles};
pub use pendula::{DoublePendulum, NPendulum, SpringPendulum, TriplePendulum};
pub use sphere_geodesic::SphereGeodesic;
pub use uniform_fields::{ChargedParticle, ConstantForce};

use super::system::{ClosedForm, Coordinate, Layout, Parameter, Plane, Range, System};
use super::{EulerLagrange, LagrangianVisitor, Mechanics, SystemInstance};
use crate::scalar::{Dd, Scalar};
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::any::Any;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Lists one system per line: its catalogue entry and how its Lagrangian is constructed from the number of coordinates.
macro_rules! catalogue {
    ($($module:ident::$system:ident: $make:expr;)*) => {
        /// The catalogue entries of all systems.
        pub(super) static SYSTEMS: &[System] = &[$($module::$system),*];

        /// Index of each system in [`SYSTEMS`].
        #[allow(non_camel_case_types, clippy::upper_case_acronyms)]
        enum Place { $($system),* }

        /// Constructs the model of a configured system.
        fn construct<S: Scalar>(configured: &SystemInstance<S>) -> Option<Box<dyn EulerLagrange<S>>> {
            let n = configured.coordinates;
            if let Some(described) = &configured.system.described {
                let parameters = configured.parameters.clone();
                return Some(Box::new(Mechanics::new(described.lagrangian.clone(), parameters)));
            }
            $(if configured.system.name == SYSTEMS[Place::$system as usize].name {
                let make: fn(usize) -> _ = $make;
                return Some(Box::new(Mechanics::new(make(n), configured.parameters.clone())));
            })*
            None
        }

        /// Passes the Lagrangian of a configured system to a visitor.
        pub(super) fn visit_lagrangian<S, V: LagrangianVisitor>(configured: &SystemInstance<S>, visitor: V) -> Option<V::Output> {
            let n = configured.coordinates;
            if let Some(described) = &configured.system.described {
                return Some(visitor.visit(&described.lagrangian));
            }
            $(if configured.system.name == SYSTEMS[Place::$system as usize].name {
                let make: fn(usize) -> _ = $make;
                return Some(visitor.visit(&make(n)));
            })*
            None
        }

        /// Computes the closed-form acceleration of a configured system.
        pub(super) fn closed_acceleration<S: Scalar>(configured: &SystemInstance<S>, q: &[S], v: &[S]) -> Vec<S> {
            let n = configured.coordinates;
            $(if configured.system.name == SYSTEMS[Place::$system as usize].name {
                let make: fn(usize) -> _ = $make;
                return make(n).acceleration(&configured.parameters, q, v);
            })*
            vec![S::nan(); n]
        }

        /// Computes the velocity of the time-like coordinate on the mass shell, if the system has one.
        pub(super) fn constrained_velocity<S: Scalar>(configured: &SystemInstance<S>, q: &[S], v: &[S]) -> Option<S> {
            let n = configured.coordinates;
            $(if configured.system.name == SYSTEMS[Place::$system as usize].name {
                let make: fn(usize) -> _ = $make;
                return make(n).constrained_velocity(&configured.parameters, q, v);
            })*
            None
        }
    };
}

catalogue! {
    pendula::DOUBLE_PENDULUM: |_| DoublePendulum;
    pendula::TRIPLE_PENDULUM: |_| TriplePendulum;
    pendula::N_PENDULUM: |n| NPendulum { n };
    pendula::SPRING_PENDULUM: |_| SpringPendulum;
    sphere_geodesic::SPHERE: |_| SphereGeodesic;
    uniform_fields::CONSTANT_FORCE: |_| ConstantForce;
    oscillators::HARMONIC_OSCILLATOR: |_| HarmonicOscillator;
    kepler::KEPLER: |_| Kepler;
    oscillators::HENON_HEILES: |_| HenonHeiles;
    lattices::LATTICE: |n| Lattice { n };
    lattices::CLOTH: |n| Cloth { side: Layout::Net.chosen(n) };
    uniform_fields::CHARGED_PARTICLE: |_| ChargedParticle;
    anti_de_sitter::ADS2: |n| AdsGeodesic { n };
    anti_de_sitter::ADS3: |n| AdsGeodesic { n };
    anti_de_sitter::ADS4: |n| AdsGeodesic { n };
    boyer_lindquist::SCHWARZSCHILD: |_| SchwarzschildGeodesic;
    kerr_schild::SCHWARZSCHILD_CARTESIAN: |_| KerrSchild::Schwarzschild;
    kerr_schild::REISSNER_NORDSTROM_CARTESIAN: |_| KerrSchild::ReissnerNordstrom;
    boyer_lindquist::KERR: |_| KerrGeodesic;
    kerr_schild::KERR_CARTESIAN: |_| KerrSchild::Kerr;
}

/// Does the same as [`construct`] with friction. It is compiled once for each scalar type in this crate and not in every crate that calls
/// it, since all systems with all forward-mode numbers are a lot of code.
pub(super) fn unconstrained<S: Scalar>(configured: &SystemInstance<S>) -> Option<Box<dyn EulerLagrange<S>>> {
    fn single(configured: &SystemInstance<f32>) -> Option<Box<dyn EulerLagrange<f32>>> {
        Some(configured.with_friction(construct(configured)?))
    }
    fn double(configured: &SystemInstance<f64>) -> Option<Box<dyn EulerLagrange<f64>>> {
        Some(configured.with_friction(construct(configured)?))
    }
    fn double_double(configured: &SystemInstance<Dd>) -> Option<Box<dyn EulerLagrange<Dd>>> {
        Some(configured.with_friction(construct(configured)?))
    }
    let configured: &dyn Any = configured;
    let built: Box<dyn Any> = if let Some(configured) = configured.downcast_ref() {
        Box::new(single(configured))
    } else if let Some(configured) = configured.downcast_ref() {
        Box::new(double(configured))
    } else {
        Box::new(double_double(configured.downcast_ref()?))
    };
    *built.downcast().ok()?
}

/// A mass with the default 1 kg.
const fn mass(symbol: &'static str) -> Parameter {
    Parameter::new(symbol, "1", "kg", Range::Positive)
}
/// A length with the default 1 m.
const fn length(symbol: &'static str) -> Parameter {
    Parameter::new(symbol, "1", "m", Range::Positive)
}
/// The acceleration of gravity in the paper; zero and negative values are allowed.
const ACCELERATION_OF_GRAVITY: Parameter = Parameter::new("g", "9.8", "m/s^2", Range::Any);

/// The plane of the first two coordinates, `x` and `y`.
const X_AND_Y: Plane = Plane { labels: ["x [m]", "y [m]"], point: |_, q| (q[0], q[1]) };
/// Labels for the position of the last point mass of a chain.
const LAST_BOB: [&str; 2] = ["x of the last bob [m]", "y of the last bob [m]"];
/// The result for a wrong number of parameters.
const NOWHERE: (f64, f64) = (f64::NAN, f64::NAN);

/// Computes `e x e'`, where `e` is the direction given by polar angle and azimuth.
fn angular_velocity([theta, phi]: [f64; 2], [theta_dot, phi_dot]: [f64; 2]) -> [f64; 3] {
    let ((sin, cos), (sin_phi, cos_phi)) = (theta.sin_cos(), phi.sin_cos());
    // theta' contributes in the direction of increasing phi, sin theta phi' opposite to increasing theta.
    let along = sin * phi_dot;
    [-sin_phi * theta_dot - along * cos * cos_phi, cos_phi * theta_dot - along * cos * sin_phi, along * sin]
}

/// Returns coordinates that are lengths.
fn lengths(names: &[&'static str]) -> Vec<Coordinate> {
    names.iter().map(|&name| Coordinate::length(name)).collect()
}

/// Returns `theta1`, `theta2`, and so on; `theta` for a single angle.
fn angles(n: usize) -> Vec<Coordinate> {
    (1..=n).map(|i| Coordinate::angle(if n == 1 { "theta".into() } else { format!("theta{i}") })).collect()
}
