//! Integrators.

mod constraints;
mod forces;
mod integrators;
