//! Euler-Lagrange terms of hand-written systems.

mod black_holes;
mod constraints;
mod described;
mod random;
mod relativity;
mod systems;
