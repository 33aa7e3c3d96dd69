//! `lnn sweep`: trainings over the values of some keys of a configuration, all runs or a share of them; finished runs are not repeated.

use crate::CliError;
use crate::arguments::number::{thread_count, whole};
use crate::arguments::train_config;
use crate::directories::runs::{Orders, Work, merge, perform, print_list};
use crate::directories::shard::Shard;
use crate::terminal::error::argument_error;
use crate::thresholds::MOST_RUNS;
use clap::Parser;
use lnn::configuration::Config;
use lnn::experiments::{Choice, Variation, combinations, sweep_runs};
use lnn::names::pluralize;
use lnn::pipeline::Sweep;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A configuration of `lnn train`, FILE.toml; missing keys have the values of the preset quick.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// A key and its values, such as penalty.lambda=0.1,1 or network.hidden=[64],[128,128]; may be repeated, and all combinations
    /// are trained.
    #[arg(long, value_name = "KEY=A,B,C", allow_hyphen_values = true)]
    vary: Vec<Variation>,
    /// Seeds of every combination, from that of the configuration on.
    #[arg(long, value_name = "N", default_value = "1", allow_hyphen_values = true, value_parser = whole(1, MOST_RUNS))]
    seeds: usize,
    /// Directory; a sweep continues with the runs that are there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Threads; as many runs are trained in parallel, and the results do not depend on the number [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
    threads: Option<usize>,
    /// Only the I-th of N shares of the runs, I from 1 to N; no tables are written [default: that of a Slurm array, or all].
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// List the runs: finished, in progress, or open.
    #[arg(long)]
    list: bool,
    /// Write tables, plots and report from the finished runs, without running any.
    #[arg(long, conflicts_with_all = ["list", "shard", "overwrite"])]
    merge: bool,
    /// Replace finished runs of other configurations.
    #[arg(long, conflicts_with = "list")]
    overwrite: bool,
    /// One JSON object per line instead of tables.
    #[arg(long)]
    json: bool,
}

/// Trains every combination, or a share of them, lists them, or makes tables of the finished ones.
///
/// # Errors
/// A usage error for a configuration or a key that is wrong, a data error for files, an interruption; finished runs are kept.
pub fn run(args: &Args) -> Result<(), CliError> {
    let work = vec![args.work()?];
    if args.list {
        return print_list(work, args.shard, args.json);
    }
    if args.merge {
        return merge(work, args.json);
    }
    let Args { threads, shard, overwrite, json, .. } = *args;
    perform(work, &Orders { threads, shard, overwrite, json })
}

/// Rejects values that give the same configuration, such as `0.1` and `0.10`, which would be trained twice.
fn require_different(configurations: &[(Choice, Config)]) -> Result<(), CliError> {
    let text =
        |choice: &Choice| choice.iter().map(|(key, value)| format!("{key}={value}")).collect::<Vec<_>>().join(" ");
    let mut known: BTreeMap<String, &Choice> = BTreeMap::new();
    for (choice, config) in configurations {
        if let Some(other) = known.insert(toml::to_string(config).map_err(CliError::data)?, choice) {
            let (one, other) = (text(other), text(choice));
            return Err(CliError::usage(format_args!("--vary: {one} and {other} are one configuration")));
        }
    }
    Ok(())
}

/// The arguments of a training.
#[derive(Parser)]
struct Training {
    #[command(flatten)]
    args: train_config::Args,
}

impl Args {
    fn work(&self) -> Result<Work, CliError> {
        if let Some((k, Variation { key, .. })) =
            self.vary.iter().enumerate().find(|(k, one)| self.vary[..*k].iter().any(|other| other.key == one.key))
        {
            return Err(CliError::usage(format_args!(
                "--vary {key}: the key is given twice, the second time as number {}",
                k + 1
            )));
        }
        let counts = self.vary.iter().map(|one| one.values.len());
        let count = counts.fold(self.seeds, usize::saturating_mul);
        if count > MOST_RUNS {
            let runs = pluralize(count, "run", "runs");
            return Err(CliError::usage(format_args!("--vary: {runs}, expected at most {MOST_RUNS}")));
        }
        let configured = |choice: Vec<(String, String)>| {
            let set = choice.iter().map(|(key, value)| format!("--set={key}={value}").into());
            let words = ["train".into(), "--config".into(), self.file.clone().into_os_string()];
            let training = Training::try_parse_from(words.into_iter().chain(set)).map_err(|e| argument_error(&e))?;
            let (config, _) = training.args.resolve(None)?;
            Ok((choice, config))
        };
        let configurations =
            combinations(&self.vary).into_iter().map(configured).collect::<Result<Vec<_>, CliError>>()?;
        require_different(&configurations)?;
        let runs = (0..).zip(sweep_runs(configurations, self.seeds)).collect();
        let words = self.words();
        let (merge, list) = (format!("{words} --merge"), format!("{words} --list"));
        Ok(Work { experiment: Box::new(Sweep), path: self.out.clone(), runs, merge, list, inputs: Vec::new() })
    }

    /// Formats the command with the options that define the runs.
    fn words(&self) -> String {
        let mut words = format!("lnn sweep {}", self.file.display());
        words.extend(self.vary.iter().map(|one| format!(" --vary '{}={}'", one.key, one.values.join(","))));
        if self.seeds != 1 {
            words += &format!(" --seeds {}", self.seeds);
        }
        format!("{words} --out {}", self.out.display())
    }
}
