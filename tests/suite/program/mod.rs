//! The program `lnn` from outside.

mod certify;
mod check;
mod configuration;
mod conveniences;
mod dissipation;
mod experiment;
mod fit;
mod fit_resume;
mod forces;
mod geometry;
mod hostile;
mod inspect;
mod limits;
mod motion;
mod overwrite;
mod physics;
mod pipes;
mod resume;
mod screen;
mod shadow;
mod signals;
mod still;
mod symmetries;
mod system_files;
mod train;
mod words;
