//! Integrators and trajectories.
