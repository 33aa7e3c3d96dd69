//! Geodesic of 4-dimensional anti-de Sitter space.

use super::anti_de_sitter;
use crate::lagrangian::system::{PaperBudget, PaperPhase, System};

pub use super::anti_de_sitter::AdsGeodesic;

/// Catalogue entry.
pub const SYSTEM: System = anti_de_sitter::system(
    "ads4-geodesic",
    "Geodesic of AdS4 in half-space coordinates",
    4,
    "t_dot = sqrt(x_dot^2 + y_dot^2 + z_dot^2 + (z/L)^2)",
    Some(PaperBudget { states: 120_000, hidden: &[500; 3], phases: &[PaperPhase::new(300, 1e-3, 1e-7)] }),
);
