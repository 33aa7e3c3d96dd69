//! Integrators.

mod constraints;
mod events;
mod forces;
mod integrators;
