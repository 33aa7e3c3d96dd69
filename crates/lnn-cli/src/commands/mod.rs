//! The commands, each from its arguments to what it prints.

pub mod certify;
pub mod check;
pub mod compare;
pub mod constraints;
pub mod evaluate;
pub mod fit;
pub mod formula;
pub mod geometry;
pub mod identify;
pub mod inspect;
pub mod manual;
pub mod page;
pub mod rollout;
pub mod shadow;
pub mod sweep;
pub mod symmetries;
pub mod systems;
pub mod train;
