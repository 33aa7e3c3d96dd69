//! Terms of network Lagrangians.

mod derivatives;
mod dissipation;
