//! Free fall of uncharged matter into a charged black hole, in Cartesian Kerr-Schild coordinates.

pub use super::kerr_schild::KerrSchild;

/// Catalogue entry.
pub const SYSTEM: crate::lagrangian::system::System = super::kerr_schild::system(KerrSchild::ReissnerNordstrom);
