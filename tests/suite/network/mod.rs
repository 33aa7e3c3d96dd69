//! Terms of network Lagrangians.

mod any_float;
mod derivatives;
mod dissipation;
