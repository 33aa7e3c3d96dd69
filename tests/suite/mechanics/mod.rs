//! Euler-Lagrange terms of hand-written systems.

mod random;
mod relativity;
mod systems;
