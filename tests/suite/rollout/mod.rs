//! Integrators.

mod integrators;
