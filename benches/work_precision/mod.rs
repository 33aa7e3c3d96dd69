//! The parts of the work-precision program, one after the other on one thread.

mod activations;
mod batch;
mod case;
mod derivatives;
mod differences;
mod engines;
mod learned;
mod machine;
mod matrices;
mod options;
mod output;
mod problems;
mod reference;
mod rivals;
mod rollouts;
mod summary;
mod timing;

pub use options::Options;

use lnn::report::Report;
use options::Part;
use output::{Section, write};
use std::time::Instant;

/// Runs the chosen parts and writes everything into the directory of the options.
///
/// # Errors
/// What cannot be read or written, in words.
pub fn run(options: &Options) -> Result<(), String> {
    std::fs::create_dir_all(&options.out).map_err(|e| format!("{}: {e}", options.out.display()))?;
    let machine = machine::description(options);
    let mut report = Report::new("Run time against error").preformatted(&machine);
    println!("{machine}");
    for part in options.parts() {
        let begun = Instant::now();
        let section: Section = match part {
            Part::Rollouts => rollouts::section(options)?,
            Part::Derivatives => derivatives::section(options)?,
            Part::Activations => activations::section(options),
            Part::Matrices => matrices::section(options),
        };
        report = write(&section, &options.out, &machine, report)?;
        eprintln!("{part:?}: {:.1} s", begun.elapsed().as_secs_f64());
    }
    output::save(&options.out.join("report.html"), report.to_html().as_bytes())?;
    println!("written to {}", options.out.display());
    Ok(())
}
