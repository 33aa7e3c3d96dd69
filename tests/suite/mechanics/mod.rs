//! Euler-Lagrange terms of hand-written systems.

mod described;
mod random;
mod relativity;
mod systems;
