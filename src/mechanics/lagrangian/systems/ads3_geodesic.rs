//! Geodesic of 3-dimensional anti-de Sitter space.

use super::anti_de_sitter;
use crate::lagrangian::system::System;

pub use super::anti_de_sitter::AdsGeodesic;

/// Catalogue entry.
pub const SYSTEM: System = anti_de_sitter::system(
    "ads3-geodesic",
    "Geodesic of AdS3 in half-space coordinates",
    3,
    "t_dot = sqrt(x_dot^2 + z_dot^2 + (z/L)^2)",
    None,
);
