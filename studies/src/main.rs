//! The program `lnn-studies`: longer studies with the library `lnn`, one command each.
//!
//! `cargo run --release -p lnn-studies -- COMMAND` builds and runs one.
#![forbid(unsafe_code)]

mod constraints;
mod experiment;
mod formula;
mod identify;
mod measured;
mod open_tables;
mod rates;
mod setups;
mod watch;

use clap::Parser;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// The repository.
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
/// Where recorded pendula of several arms are looked for.
const ARMS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/multi-arm-pendulum");

/// The folder for the results of a study, `target/NAME`.
fn results(name: &str) -> PathBuf {
    let folder = Path::new(ROOT).join("target").join(name);
    std::fs::create_dir_all(&folder).expect("a folder for the results");
    folder
}

/// Studies of the paper, of recorded motion, of tables that others published, and of how often verdicts are wrong.
#[derive(clap::Parser)]
#[command(name = "lnn-studies", version)]
struct Program {
    #[command(subcommand)]
    study: Study,
}

#[derive(clap::Subcommand)]
enum Study {
    /// Constraints: found in motion, kept, learned under, and what they cost.
    Constraints(constraints::Args),
    /// Regenerate a table or figure of the paper, or list them.
    Experiment(Box<experiment::Args>),
    /// Formulas found in simulated and in recorded motion.
    Formula(formula::Args),
    /// Constants of known forms from simulated and recorded motion.
    Identify(identify::Args),
    /// Predictions of recorded motion, and what recordings determine.
    Measured(measured::Args),
    /// Tables that others published, by their protocols.
    OpenTables(open_tables::Args),
    /// How often verdicts are wrong.
    Rates(rates::Args),
    /// Figures of README and the pages that no longer hold.
    Watch(watch::Args),
}

fn main() -> ExitCode {
    let program = match Program::try_parse() {
        Ok(program) => program,
        Err(error) => return lnn_cli::answer(&error),
    };
    match program.study {
        Study::Constraints(args) => constraints::run(args),
        Study::Formula(args) => formula::run(args),
        Study::Measured(args) => measured::run(args),
        Study::OpenTables(args) => open_tables::run(args),
        Study::Experiment(args) => return lnn_cli::ended(|| experiment::run(&args)),
        Study::Identify(args) => return ended(identify::run(args)),
        Study::Rates(args) => return ended(rates::run(args)),
        Study::Watch(args) => return ended(watch::run(args)),
    }
    ExitCode::SUCCESS
}

/// The exit code of a study that may fail, whose error is printed.
fn ended(outcome: Outcome<()>) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Commands of this program on a page: in lines of shell blocks and in code spans.
    fn commands(page: &str) -> Vec<String> {
        let pieces = page.split(['`', '\n']).flat_map(|piece| {
            ["cargo run --release -p lnn-studies -- ", "lnn-studies "].map(|name| piece.strip_prefix(name))
        });
        pieces.flatten().map(|rest| rest.split(" #").next().unwrap_or_default().trim().to_string()).collect()
    }

    /// A word that stands for something, replaced by what it may stand for.
    fn example(word: &str) -> &str {
        match word {
            "NAME" => "quick",
            "N" => "1",
            "PART" => "positions",
            other => other,
        }
    }

    #[test]
    fn every_command_of_the_pages_is_understood() {
        let pages = fs::read_dir(Path::new(ROOT).join("docs")).unwrap().map(|entry| entry.unwrap().path());
        let pages = pages.filter(|path| path.extension().is_some_and(|end| end == "md"));
        let (mut count, mut faults) = (0, Vec::new());
        for page in pages.chain([Path::new(ROOT).join("README.md")]) {
            for line in commands(&fs::read_to_string(&page).unwrap()) {
                count += 1;
                let words = ["lnn-studies"].into_iter().chain(line.split_whitespace().map(example));
                if let Err(error) = Program::try_parse_from(words) {
                    faults.push(format!("{}: {line}: {error}", page.display()));
                }
            }
        }
        assert!(count > 60 && faults.is_empty(), "{count} commands\n{}", faults.join("\n"));
    }
}
