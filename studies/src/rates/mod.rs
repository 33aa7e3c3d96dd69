//! How often a verdict is wrong: every word that judges is tried on systems drawn at random whose truth is known, and above all where the
//! right answer is "no".
//!
//! `lnn-studies rates` prints one table; `--part identify`, `formula`, `drives`, `constraints`, `check`, `columns`, `machines` or `readings` prints a part of it
//! and `--seeds N` gives the number of systems of every case. The program fails if a rate lies outside the limits that the table states.

mod check;
mod columns;
mod constraints;
mod convergence;
mod determined;
mod drives;
mod formula;
mod identify;
mod machines;
mod readings;

use crate::Outcome;
use clap::ValueEnum;
use std::fmt::Write;
use std::ops::RangeInclusive;
use std::time::Instant;

/// How often something was said in a case.
#[derive(Clone, Debug)]
pub struct Rate {
    /// What was said, such as `explained`.
    pub verdict: &'static str,
    /// Of which data.
    pub case: &'static str,
    pub said: usize,
    pub of: usize,
    /// Share of the systems of the case in which it may be said.
    pub limits: RangeInclusive<f64>,
}

impl Rate {
    fn share(&self) -> f64 {
        self.said as f64 / self.of.max(1) as f64
    }

    fn holds(&self) -> bool {
        self.limits.contains(&self.share())
    }
}

/// The rates as a table.
fn table(rates: &[Rate]) -> String {
    let mut text = String::from("| said | of | times | limits | |\n|---|---|---|---|---|\n");
    for rate in rates {
        let [low, high] = [rate.limits.start(), rate.limits.end()].map(|x| 100.0 * x);
        let (Rate { verdict, case, said, of, .. }, mark) = (rate, if rate.holds() { "" } else { "outside" });
        let _ = writeln!(text, "| {verdict} | {case} | {said} of {of} | {low:.0} to {high:.0} % | {mark} |");
    }
    text
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    Identify,
    Formula,
    Drives,
    Constraints,
    Check,
    Columns,
    Machines,
    Readings,
}

impl Part {
    const ALL: [Self; 8] = [
        Self::Identify,
        Self::Formula,
        Self::Drives,
        Self::Constraints,
        Self::Check,
        Self::Columns,
        Self::Machines,
        Self::Readings,
    ];

    fn rates(self, seeds: u64) -> Outcome<Vec<Rate>> {
        match self {
            Self::Identify => {
                let parts = [identify::rates, convergence::convergence, determined::determined];
                Ok(parts.into_iter().map(|rates| rates(seeds)).collect::<Outcome<Vec<_>>>()?.concat())
            }
            Self::Formula => formula::rates(seeds),
            Self::Drives => drives::rates(seeds),
            Self::Constraints => constraints::rates(seeds),
            Self::Check => check::rates(seeds),
            Self::Columns => columns::rates(seeds),
            Self::Machines => machines::rates(seeds),
            Self::Readings => readings::rates(seeds),
        }
    }
}

/// Arguments.
#[derive(clap::Args)]
pub struct Args {
    /// Run one part alone.
    #[arg(long)]
    part: Option<Part>,
    /// Systems of every case, seeds 0 to N - 1.
    #[arg(long, value_name = "N", default_value_t = 20)]
    seeds: u64,
}

/// Prints the rates of the parts that are asked for.
///
/// # Errors
/// A rate outside of its limits.
pub fn run(args: Args) -> Outcome<()> {
    let parts = args.part.map_or(Part::ALL.to_vec(), |part| vec![part]);
    let mut outside = 0;
    for part in parts {
        let started = Instant::now();
        let rates = part.rates(args.seeds)?;
        println!("{}{:.0} s\n", table(&rates), started.elapsed().as_secs_f64());
        outside += rates.iter().filter(|rate| !rate.holds()).count();
    }
    match outside {
        0 => Ok(()),
        _ => Err(format!("{outside} rates lie outside of their limits").into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every part with one system a case.
    #[test]
    fn every_part_runs() {
        for part in Part::ALL {
            let rates = part.rates(1).expect("every system is judged");
            assert!(rates.iter().all(|rate| rate.of > 0 && rate.said <= rate.of), "{rates:?}");
        }
    }
}
