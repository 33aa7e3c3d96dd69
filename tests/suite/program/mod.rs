//! The program `lnn` from outside.

mod check;
mod configuration;
mod conveniences;
mod dissipation;
mod experiment;
mod fit;
mod forces;
mod hostile;
mod inspect;
mod motion;
mod pipes;
mod resume;
mod still;
mod train;
mod words;
