//! Symmetries, conserved quantities and common ground of Lagrangians whose answers are known.

mod canonical;
mod charges;
mod common_ground;
mod exact;
mod quadratic;
mod random;

use lnn::lagrangian::{EulerLagrange, ExpressionLagrangian, Mechanics, SystemInstance};
use lnn::symmetry::{Basis, Chart, Degrees, Region, Symmetries};

/// A Lagrangian with names, charts and bounds of its coordinates; velocities are within `[-1, 1]` unless said otherwise.
pub struct Subject {
    pub model: Box<dyn EulerLagrange<f64>>,
    pub names: Vec<String>,
    pub charts: Vec<Chart>,
    pub region: Region,
}

/// A coordinate: name, chart, bounds.
pub type Coordinate = (&'static str, Chart, [f64; 2]);

pub const PHI: Coordinate = ("phi", Chart::Circle, [0.0, 6.3]);
pub const THETA: Coordinate = ("theta", Chart::Polar, [0.3, 2.8]);

/// A length between -2 and 2.
pub const fn line(name: &'static str) -> Coordinate {
    (name, Chart::Line, [-2.0, 2.0])
}

/// A length between 0.5 and 3.
pub const fn radius(name: &'static str) -> Coordinate {
    (name, Chart::HalfLine, [0.5, 3.0])
}

impl Subject {
    pub fn new(model: Box<dyn EulerLagrange<f64>>, coordinates: &[Coordinate]) -> Self {
        Self {
            model,
            names: coordinates.iter().map(|c| c.0.to_string()).collect(),
            charts: coordinates.iter().map(|c| c.1).collect(),
            region: Region {
                position: coordinates.iter().map(|c| c.2).collect(),
                velocity: vec![[-1.0, 1.0]; coordinates.len()],
            },
        }
    }

    /// `L` by a formula.
    pub fn formula(coordinates: &[Coordinate], formula: &str) -> Self {
        let names: Vec<&str> = coordinates.iter().map(|c| c.0).collect();
        let lagrangian = ExpressionLagrangian::new(&names, &[], formula).unwrap();
        Self::new(Box::new(Mechanics::new(lagrangian, Vec::new())), coordinates)
    }

    /// A system of the catalogue.
    pub fn system(name: &str, coordinates: &[Coordinate]) -> Self {
        Self::new(SystemInstance::named(name, &[]).unwrap().build().unwrap(), coordinates)
    }

    pub fn basis(&self, degrees: Option<Degrees>) -> Basis {
        Basis::new(&self.names, &self.charts, degrees.unwrap_or_else(|| Degrees::usual(&self.charts)))
    }

    pub fn states(&self, states: usize) -> (Vec<f64>, Vec<f64>) {
        self.region.states(states, 1, |_, _| true)
    }

    /// Symmetries over the usual basis, or over one of other degrees.
    pub fn symmetries(&self, degrees: Option<Degrees>) -> Symmetries {
        let basis = self.basis(degrees);
        let (q, v) = self.states((3 * (self.names.len() + 1) * basis.len()).max(200));
        Symmetries::find(self.model.as_ref(), &basis, (&q, &v), Some(Symmetries::EXACT)).unwrap()
    }
}

/// Degrees of powers and harmonics.
pub fn degrees(polynomial: usize, trigonometric: usize) -> Option<Degrees> {
    Some(Degrees { polynomial, trigonometric, hyperbolic: 0 })
}
