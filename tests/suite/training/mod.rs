//! Losses, penalties, optimisers, checkpoints.

mod checkpoints;
mod constraints;
mod faults;
mod faulty;
mod force_residuals;
mod left_out;
mod objective;
mod penalties;
mod presets;
mod shooting;
