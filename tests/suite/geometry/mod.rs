//! The geometry of Lagrangians: curvature against closed forms, identities of random metrics, surfaces.

mod closed_forms;
mod identities;
mod networks;
mod orbits;
mod spaces;
mod surfaces;
