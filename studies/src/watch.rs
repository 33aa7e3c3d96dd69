//! A watch over the figures that README and the pages state: which of them no longer hold, and how old the tables are.
//!
//! `lnn-studies watch` runs the command of every headline, reads its figure from what the command prints or writes, and prints
//! `holds` or `NO LONGER` beside the bound that the page's figure implies. It ends with an error if one does not hold. A headline whose
//! recordings are missing has no figure, which is said and is no error. Times are those of two idle cores.
//!
//! Then, for README and every page, how many rows of tables state figures, the commit that the oldest row comes from, and how many commits
//! have changed the numerics since. A row that was reworded without a measurement looks newer than it is.

use crate::{Outcome, ROOT};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Where the figure of a command stands.
enum Figure {
    /// In `summary.json` of the folder that stands for `OUT`, at this pointer.
    Summary(&'static str),
    /// In what is printed: of every line that holds this text, this one of the numbers after it, counted from 0; the largest of all lines.
    Largest(&'static str, usize),
    /// The smallest of them.
    Smallest(&'static str, usize),
}

/// What a page says, the command that measures it, and its bound: the figure with room for other machines and rounding.
struct Headline {
    page: &'static str,
    says: &'static str,
    command: &'static str,
    figure: Figure,
    bound: f64,
    minutes: u32,
}

impl Headline {
    fn holds(&self, found: f64) -> bool {
        match self.figure {
            Figure::Smallest(..) => found >= self.bound,
            Figure::Summary(_) | Figure::Largest(..) => found <= self.bound,
        }
    }
}

#[rustfmt::skip]
const HEADLINES: [Headline; 16] = [
    Headline { page: "README.md", says: "double pendulum, validation loss of seed 0", command: "lnn train double-pendulum --seed 0 --out OUT", figure: Figure::Summary("/validation_loss"), bound: 6e-4, minutes: 1 },
    Headline { page: "docs/results.md", says: "largest mean error of its mass matrix", command: "lnn train double-pendulum --seed 0 --out OUT", figure: Figure::Summary("/mass_matrix/mean"), bound: 7e-4, minutes: 1 },
    Headline { page: "README.md", says: "training with evaluation and report, s", command: "lnn train double-pendulum --seed 0 --out OUT", figure: Figure::Summary("/wall_seconds"), bound: 40.0, minutes: 1 },
    Headline { page: "docs/results.md", says: "double pendulum, preset best, seed 0", command: "lnn train double-pendulum --preset best --seed 0 --out OUT", figure: Figure::Summary("/validation_loss"), bound: 3e-4, minutes: 10 },
    Headline { page: "docs/structures.md", says: "separate kinetic and potential energy, loss", command: "lnn train double-pendulum --structure mechanical --seed 0 --out OUT", figure: Figure::Summary("/validation_loss"), bound: 1.6e-4, minutes: 1 },
    Headline { page: "docs/structures.md", says: "error of that mass matrix", command: "lnn train double-pendulum --structure mechanical --seed 0 --out OUT", figure: Figure::Summary("/mass_matrix/mean"), bound: 2e-5, minutes: 1 },
    Headline { page: "docs/formula.md", says: "pendulum, constants within %", command: "lnn-studies formula --part positions --only pendulum --seeds 2", figure: Figure::Largest("constants within ", 0), bound: 2.0, minutes: 2 },
    Headline { page: "docs/identify.md", says: "ranges of 90 % that hold the truth, of 100", command: "lnn-studies identify --part coverage", figure: Figure::Smallest(": ", 0), bound: 85.0, minutes: 5 },
    Headline { page: "docs/identify.md", says: "seven-joint arm by its rows, farthest sum, standard errors", command: "lnn-studies measured --part links", figure: Figure::Largest("the farthest", 0), bound: 6.0, minutes: 1 },
    Headline { page: "docs/results.md", says: "1-pendulum from chunks, constraints found", command: "lnn-studies open-tables --table chunks --row 1-pendulum --in cartesian --seeds 1", figure: Figure::Largest("cartesian", 1), bound: 1e-5, minutes: 2 },
    Headline { page: "docs/results.md", says: "gyroscope from chunks, constraints found (constrained networks: 3.2e-5)", command: "lnn-studies open-tables --table chunks --row gyroscope --in cartesian --seeds 1", figure: Figure::Largest("cartesian", 1), bound: 1e-4, minutes: 9 },
    Headline { page: "docs/results.md", says: "spring, error of the energy (Hamiltonian networks: 3.8e-4)", command: "lnn-studies open-tables --table hamiltonian --row spring --seeds 1", figure: Figure::Largest("spring", 1), bound: 3e-4, minutes: 1 },
    Headline { page: "docs/results.md", says: "rotor from chunks (Hamiltonian networks: 0.28)", command: "lnn-studies open-tables --table chunks --row rotor --in generalized --seeds 1", figure: Figure::Largest("generalized", 1), bound: 0.28, minutes: 2 },
    Headline { page: "docs/results.md", says: "3-body, error of the energy", command: "lnn-studies open-tables --table hamiltonian --row 3-body --seeds 1", figure: Figure::Largest("3-body", 1), bound: 1e-3, minutes: 4 },
    Headline { page: "docs/recorded-motion.md", says: "films with friction, 0.5 s ahead, rad", command: "lnn-studies measured --part films", figure: Figure::Largest("friction, through the motion", 3), bound: 0.09, minutes: 10 },
    Headline { page: "docs/constraints.md", says: "double pendulum with constraints found, loss", command: "lnn-studies constraints --part learned --system cartesian-chain-2 --seeds 1", figure: Figure::Largest("mechanical", 1), bound: 2e-6, minutes: 5 },
];

fn root() -> &'static Path {
    Path::new(ROOT)
}

/// The output of a command, printed and written; an error in words if it cannot be run or fails.
fn output_of(command: &str, out: &Path) -> Result<String, String> {
    let mut words = command.split_whitespace();
    let program = words.next().unwrap_or_default();
    let program = match program {
        "lnn" => root().join("target/release/lnn"),
        "lnn-studies" => std::env::current_exe().map_err(|error| format!("lnn-studies: {error}"))?,
        other => PathBuf::from(other),
    };
    let words = words.map(|word| if word == "OUT" { out.as_os_str().to_owned() } else { word.into() });
    let done = Command::new(&program).args(words).current_dir(root()).output();
    let done = done.map_err(|error| format!("{}: {error}", program.display()))?;
    let text = String::from_utf8_lossy(&done.stdout).into_owned();
    match done.status.success() {
        true => Ok(text),
        false => Err(String::from_utf8_lossy(&done.stderr).lines().last().unwrap_or("no message").to_string()),
    }
}

/// The numbers of a text.
fn numbers(text: &str) -> impl Iterator<Item = f64> {
    text.split(|c: char| c.is_whitespace() || c == ',' || c == '%').filter_map(|word| word.parse().ok())
}

fn figure(headline: &Headline, printed: &str, out: &Path) -> Option<f64> {
    let after = |text: &str, nth: usize| -> Vec<f64> {
        printed.lines().filter_map(|line| numbers(&line[line.find(text)? + text.len()..]).nth(nth)).collect()
    };
    match headline.figure {
        Figure::Summary(pointer) => {
            let text = std::fs::read_to_string(out.join("summary.json")).ok()?;
            serde_json::from_str::<serde_json::Value>(&text).ok()?.pointer(pointer)?.as_f64()
        }
        Figure::Largest(text, nth) => after(text, nth).into_iter().reduce(f64::max),
        Figure::Smallest(text, nth) => after(text, nth).into_iter().reduce(f64::min),
    }
}

/// Runs the headlines; `true` if none failed to hold.
fn watch(headlines: &[&Headline]) -> bool {
    let (mut all, mut last) = (true, None::<(&str, Result<String, String>)>);
    let out = root().join("target/watch");
    println!("{:9} {:>10} {:>10} {:>7}  what", "", "found", "bound", "s");
    for headline in headlines {
        let started = Instant::now();
        // Figures of one command follow each other.
        let printed = match last.take() {
            Some((command, printed)) if command == headline.command => printed,
            _ => {
                drop(std::fs::remove_dir_all(&out));
                output_of(headline.command, &out)
            }
        };
        let found = printed.as_ref().ok().and_then(|printed| figure(headline, printed, &out));
        let verdict = found.map_or("no figure", |found| if headline.holds(found) { "holds" } else { "NO LONGER" });
        let known = found.map_or("-".to_string(), |found| format!("{found:.3e}"));
        let seconds = started.elapsed().as_secs_f64();
        println!(
            "{verdict:9} {known:>10} {:>10.1e} {seconds:>7.1}  {}: {}",
            headline.bound, headline.page, headline.says
        );
        if let Err(error) = &printed {
            println!("{:39}  {error}", "");
        }
        all &= found.is_none_or(|found| headline.holds(found));
        last = Some((headline.command, printed));
    }
    all
}

fn git(arguments: &[&str]) -> Option<String> {
    let done = Command::new("git").args(arguments).current_dir(root()).output().ok()?;
    done.status.success().then(|| String::from_utf8_lossy(&done.stdout).trim().to_string())
}

/// Folders whose changes may change a figure.
const NUMERICS: [&str; 3] = ["crates/lnn-engine/src", "src/learning", "src/physics"];

/// For a page the rows of tables with figures, the commit of the oldest, and commits of the numerics since; `None` without rows.
fn age(page: &str) -> Option<(usize, String, u64)> {
    let blame = git(&["blame", "-s", "-l", "HEAD", "--", page])?;
    let rows = blame.lines().filter_map(|line| {
        let (commit, text) = (line.split_whitespace().next()?, line.split_once(") ")?.1);
        let is_row = text.starts_with('|') && text.contains(|c: char| c.is_ascii_digit());
        is_row.then(|| commit.trim_start_matches('^').to_string())
    });
    let mut commits: Vec<String> = rows.collect();
    let count = commits.len();
    commits.sort_unstable();
    commits.dedup();
    let since = |commit: &String| {
        let range = format!("{commit}..HEAD");
        let arguments = [&["rev-list", "--count", &range, "--"][..], &NUMERICS].concat();
        git(&arguments)?.parse::<u64>().ok()
    };
    let oldest = commits.iter().filter_map(|commit| Some((since(commit)?, commit))).max()?;
    Some((count, oldest.1[..oldest.1.len().min(9)].to_string(), oldest.0))
}

fn ages() {
    let Some(pages) = git(&["ls-files", "README.md", "docs/*.md"]) else {
        return println!("no history beside these sources: ages are not known");
    };
    println!("\n{:30} {:>5} {:>10} {:>16}", "page", "rows", "oldest", "changes since");
    for page in pages.lines() {
        if let Some((rows, oldest, since)) = age(page) {
            println!("{page:30} {rows:>5} {oldest:>10} {since:>16}");
        }
    }
}

/// Arguments.
#[derive(clap::Args)]
pub struct Args {
    /// Leave out headlines that take longer, in minutes
    #[arg(long, default_value_t = 10)]
    minutes: u32,
    /// Only headlines of which page or words contain this text
    #[arg(long, default_value = "")]
    only: String,
    /// List the headlines without running them
    #[arg(long)]
    list: bool,
}

/// Runs or lists the headlines; then the ages of all tables.
///
/// # Errors
/// A figure that no longer holds.
pub fn run(Args { minutes, only, list }: Args) -> Outcome<()> {
    let asked = |headline: &&Headline| {
        headline.minutes <= minutes && (headline.page.contains(&only) || headline.says.contains(&only))
    };
    let headlines: Vec<&Headline> = HEADLINES.iter().filter(asked).collect();
    let mut all = true;
    if list {
        headlines.iter().for_each(|h| println!("{:>3} min  {}: {}\n         {}", h.minutes, h.page, h.says, h.command));
    } else {
        println!("{}", git(&["describe", "--always", "--dirty"]).unwrap_or_else(|| "no history".to_string()));
        output_of("cargo build --release --locked --quiet", Path::new(""))?;
        all = watch(&headlines);
    }
    ages();
    if all { Ok(()) } else { Err("a figure no longer holds".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    /// Figures are found in what is printed, and bounds are bounds.
    #[test]
    fn figures_are_found_and_bounds_are_bounds() {
        let printed = "a row\n  loss 2.5e-7, 3 s\n  loss 4e-7\nloss none";
        let of = |figure| Headline { page: "", says: "", command: "", figure, bound: 3e-7, minutes: 0 };
        let largest = of(Figure::Largest("loss ", 0));
        assert_eq!(figure(&largest, printed, Path::new("")), Some(4e-7));
        assert!(!largest.holds(4e-7));
        let smallest = of(Figure::Smallest("loss ", 0));
        assert_eq!(figure(&smallest, printed, Path::new("")), Some(2.5e-7));
        assert!(!smallest.holds(2.5e-7) && smallest.holds(3e-7));
        assert_eq!(figure(&of(Figure::Largest("loss ", 1)), printed, Path::new("")), Some(3.0));
        assert_eq!(figure(&of(Figure::Summary("/loss")), printed, Path::new("no such folder")), None);
        assert!(HEADLINES.iter().all(|headline| root().join(headline.page).exists()));
    }

    #[test]
    fn every_command_is_understood() {
        for Headline { command, .. } in &HEADLINES {
            let words = command.split_whitespace();
            if command.starts_with("lnn-studies ") {
                crate::Program::try_parse_from(words).unwrap_or_else(|error| panic!("{command}: {error}"));
            } else {
                lnn_cli::check_arguments(words.map(Into::into)).unwrap_or_else(|error| panic!("{command}: {error}"));
            }
        }
    }
}
