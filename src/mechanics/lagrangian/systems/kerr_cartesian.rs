//! Free fall into a spinning black hole, in Cartesian Kerr-Schild coordinates.

pub use super::kerr_schild::KerrSchild;

/// Catalogue entry.
pub const SYSTEM: crate::lagrangian::system::System = super::kerr_schild::system(KerrSchild::Kerr);
