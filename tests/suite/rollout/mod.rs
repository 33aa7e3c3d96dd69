//! Integrators.

mod forces;
mod integrators;
