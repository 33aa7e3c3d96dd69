//! Arguments of the program.

use super::timing::Stopwatch;
use std::path::PathBuf;

/// How to call it.
pub const USAGE: &str = "usage: cargo bench --bench work_precision -- [--quick | --smoke] \
[--part rollouts|derivatives|activations|matrices].. [--model FILE] [--out DIR]";

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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Rollouts,
    Derivatives,
    Activations,
    Matrices,
}

impl Part {
    pub const ALL: [Self; 4] = [Self::Rollouts, Self::Derivatives, Self::Activations, Self::Matrices];

    /// Name on the command line and of the part's files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rollouts => "rollouts",
            Self::Derivatives => "derivatives",
            Self::Activations => "activations",
            Self::Matrices => "matrices",
        }
    }
}

/// What to measure and where to write it.
#[derive(Clone, Debug)]
pub struct Options {
    pub scale: Scale,
    pub parts: Vec<Part>,
    /// Learned double pendulum; trained if not given.
    pub model: Option<PathBuf>,
    pub out: PathBuf,
}

impl Options {
    /// Everything at the smallest scale.
    pub fn smoke() -> Self {
        let out = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/work-precision-smoke");
        Self { scale: Scale::Smoke, parts: Part::ALL.to_vec(), model: None, out }
    }

    /// Reads the arguments after the program's name.
    ///
    /// # Errors
    /// What is wrong with them, in words.
    pub fn parse(arguments: &[String]) -> Result<Self, String> {
        let out = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/work-precision");
        let mut options = Self { scale: Scale::Full, parts: Vec::new(), model: None, out };
        let mut arguments = arguments.iter().cloned();
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
            match argument.as_str() {
                "--bench" => {}
                "--quick" if options.scale == Scale::Full => options.scale = Scale::Quick,
                "--quick" => {}
                "--smoke" => options.scale = Scale::Smoke,
                "--model" => options.model = Some(value()?.into()),
                "--out" => options.out = value()?.into(),
                "--part" => {
                    let name = value()?;
                    let part = Part::ALL.into_iter().find(|part| part.name() == name);
                    options.parts.push(part.ok_or_else(|| format!("unknown part {name:?}"))?);
                }
                _ => return Err(format!("unknown argument {argument:?}")),
            }
        }
        if options.parts.is_empty() {
            options.parts = Part::ALL.to_vec();
        }
        Ok(options)
    }

    /// One of three by scale.
    pub fn choose<T>(&self, smoke: T, quick: T, full: T) -> T {
        match self.scale {
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
