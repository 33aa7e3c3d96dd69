//! The order of `lnn fit`: the command given, or that of the checkpoint that `--resume DIR` names.

use crate::cli::CliError;
use crate::cli::fit_config::Args;
use crate::cli::folder::Folder;
use crate::cli::input::is_standard;
use crate::cli::resume::{Found, Learner, find, say_finished};
use crate::cli::run_args::RunArgs;
use crate::cli::said::Said;
use crate::training::LATEST;
use clap::parser::ValueSource;
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// Arguments that may be others when a fit goes on, and those that say where it does.
const FREE: [&str; 5] = ["resume", "data", "threads", "checkpoint_every", "json"];

/// The arguments behind `lnn fit`.
#[derive(Parser)]
#[command(no_binary_name = true)]
struct Words {
    #[command(flatten)]
    args: Args,
}

/// A fit to run.
pub struct Order {
    /// Its arguments, those of the checkpoint for a fit that goes on.
    pub args: Args,
    /// The command as it was first given.
    pub said: Said,
    /// The directory of a fit that goes on.
    pub resumed: Option<Folder>,
}

impl Order {
    /// The fit that the arguments ask for, `words` being the same as they were typed; `None` if it has been done before.
    ///
    /// # Errors
    /// A data error for a directory without a fit to go on with, a usage error for arguments that contradict it.
    pub fn of(args: &Args, words: &[OsString]) -> Result<Option<Self>, CliError> {
        let Some(path) = &args.run.resume else {
            return Ok(Some(Self { args: args.clone(), said: Said::now(words), resumed: None }));
        };
        // Looked for before anything is created, and again when nobody else can write.
        find(path, Learner::Fit)?;
        let folder = Folder::open(path)?;
        let said = match find(path, Learner::Fit)? {
            Found::Finished(_, json) => {
                say_finished(path, args.run.json.then_some(&json))?;
                return Ok(None);
            }
            Found::Unfinished(text) => Said::parse(&text)
                .ok_or_else(|| CliError::file(&path.join(LATEST), "the command of the fit is not in it"))?,
        };
        let mut saved = matches(&said.arguments).map_err(|e| {
            CliError::file(&path.join(LATEST), format_args!("the command in it is not understood: {e}"))
        })?;
        require_same(path, &saved, words)?;
        let mut saved = Words::from_arg_matches_mut(&mut saved).map_err(|e| CliError::file(path, e))?.args;
        let RunArgs { threads, checkpoint_every, json, .. } = args.run;
        // What comes from standard input has to come again.
        let found = |file: &PathBuf| if is_standard(file) { file.clone() } else { said.path(file) };
        let config = saved.run.config.as_ref().map(found);
        saved.run = RunArgs { threads, checkpoint_every, json, config, ..saved.run };
        saved.recording.data = if args.recording.data.is_empty() {
            saved.recording.data.iter().map(found).collect()
        } else {
            args.recording.data.clone()
        };
        Ok(Some(Self { args: saved, said, resumed: Some(folder) }))
    }
}

fn matches<T: AsRef<OsStr>>(words: &[T]) -> Result<ArgMatches, clap::Error> {
    Words::command().try_get_matches_from(words.iter().map(|word| word.as_ref().to_os_string()))
}

/// Refuses arguments that are given beside `--resume` and differ from those of the checkpoint.
fn require_same(directory: &Path, saved: &ArgMatches, words: &[OsString]) -> Result<(), CliError> {
    let asked = matches(words).map_err(CliError::usage)?;
    let raw = |matches: &ArgMatches, id: &str| -> Option<String> {
        let values = matches.try_get_raw(id).ok().flatten()?;
        Some(values.map(|value| value.to_string_lossy()).collect::<Vec<_>>().join(","))
    };
    for argument in Words::command().get_arguments() {
        let id = argument.get_id().as_str();
        if FREE.contains(&id) || asked.value_source(id) != Some(ValueSource::CommandLine) {
            continue;
        }
        let (before, now) = (raw(saved, id), raw(&asked, id));
        if before != now {
            let say = |value: Option<String>| value.unwrap_or_else(|| "nothing".to_string());
            let name = argument.get_long().unwrap_or(id);
            let differ = format!("--{name}: {} in the checkpoint, {} asked for", say(before), say(now));
            return Err(CliError::usage(format_args!("--resume {}: {differ}", directory.display())));
        }
    }
    Ok(())
}
