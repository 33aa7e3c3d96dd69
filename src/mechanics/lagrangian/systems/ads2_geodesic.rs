//! Geodesic of 2-dimensional anti-de Sitter space.

use super::anti_de_sitter;
use crate::lagrangian::system::System;

pub use super::anti_de_sitter::AdsGeodesic;

/// Catalogue entry.
pub const SYSTEM: System = anti_de_sitter::system(
    "ads2-geodesic",
    "Geodesic of AdS2 in half-space coordinates",
    2,
    "t_dot = sqrt(z_dot^2 + (z/L)^2)",
    None,
);
