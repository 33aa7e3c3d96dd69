//! Arguments of the program.

use super::timing::Stopwatch;
use clap::ValueEnum;
use std::path::PathBuf;

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Seconds; shows that every part writes what it should, its numbers mean nothing.
    Smoke,
    /// Below two minutes.
    Quick,
    /// Below ten minutes.
    Full,
}

/// A part of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Part {
    Rollouts,
    Derivatives,
    Activations,
    Matrices,
}

/// What to measure and where to write it.
#[derive(Clone, Debug, clap::Parser)]
pub struct Options {
    /// Below two minutes in the place of ten
    #[arg(long)]
    quick: bool,
    /// Seconds; shows that every part writes what it should, its numbers mean nothing
    #[arg(long)]
    smoke: bool,
    /// A part, several times for several; all if not given
    #[arg(long = "part")]
    parts: Vec<Part>,
    /// Learned double pendulum; trained if not given
    #[arg(long)]
    pub model: Option<PathBuf>,
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/target/work-precision"))]
    pub out: PathBuf,
    #[arg(long, hide = true)]
    bench: bool,
}

impl Options {
    /// Everything at the smallest scale.
    pub fn smoke() -> Self {
        let out = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/work-precision-smoke");
        Self { quick: false, smoke: true, parts: Vec::new(), model: None, out, bench: false }
    }

    pub fn scale(&self) -> Scale {
        match (self.smoke, self.quick) {
            (true, _) => Scale::Smoke,
            (false, true) => Scale::Quick,
            (false, false) => Scale::Full,
        }
    }

    /// In their order.
    pub fn parts(&self) -> impl Iterator<Item = Part> {
        let all = Part::value_variants().iter().copied();
        all.filter(|part| self.parts.is_empty() || self.parts.contains(part))
    }

    /// One of three by scale.
    pub fn choose<T>(&self, smoke: T, quick: T, full: T) -> T {
        match self.scale() {
            Scale::Smoke => smoke,
            Scale::Quick => quick,
            Scale::Full => full,
        }
    }

    /// How often and how long to measure.
    pub fn stopwatch(&self) -> Stopwatch {
        Stopwatch {
            repeats: self.choose(2, 10, 20),
            shortest: self.choose(1e-5, 1e-3, 5e-3),
            longest: self.choose(0.02, 2.0, 5.0),
        }
    }
}
