//! Standard streams: readers that go away, no colours for those that are no terminals, the filter of the log.
#![cfg(unix)]

use crate::running::{Folder, HEADER, Run, command, lnn, text};
use lnn::lagrangian::SystemInstance;
use lnn::presets::Preset;
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};

/// A training of an instant.
fn configuration(folder: &Folder) -> String {
    let mut config = Preset::Quick.config(&SystemInstance::named("harmonic-oscillator", &[]).unwrap()).unwrap();
    (config.data.training, config.data.validation, config.data.test) = (64, 16, 16);
    config.network.hidden = vec![4];
    config.phases[0].epochs = 2;
    folder.file("c.toml", toml::to_string(&config).unwrap())
}

/// Reads one line and goes, as `| head -1` does; the line, the exit code and standard error.
fn first_line(arguments: &[&str]) -> (String, Option<i32>, String) {
    let mut child = command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let mut stderr = String::new();
    child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
    (line, child.wait().unwrap().code(), stderr)
}

#[test]
fn a_reader_may_go_after_the_first_line() {
    let folder = Folder::new();
    let states = folder.file("s.csv", format!("{HEADER}{}", "0.1,0.2,0.3,0.4\n".repeat(20_000)));
    let config = configuration(&folder);
    let out = text(&folder.path("out"));
    for arguments in [
        &["systems"][..],
        &["systems", "--json"],
        &["--help"],
        &["train", "--help"],
        &["inspect", "--system", "double-pendulum", "--states", &states],
        &["inspect", "--system", "double-pendulum", "--states", &states, "--format", "table"],
        &["train", "--config", &config, "--out", &out],
    ] {
        let (line, code, stderr) = first_line(arguments);
        assert!(!line.is_empty(), "{arguments:?}");
        assert_eq!((code, stderr.as_str()), (Some(0), ""), "{arguments:?}");
    }
    // What was trained is there all the same.
    assert!(folder.path("out/model.safetensors").is_file() && folder.path("out/summary.json").is_file());
}

#[test]
fn nobody_listening_changes_no_exit_code() {
    let run = |script: &str, arguments: &[&str]| {
        let script = format!("exec \"$0\" \"$@\" {script}");
        Run::of(Command::new("sh").args(["-c", &script, env!("CARGO_BIN_EXE_lnn")]).args(arguments))
    };
    for closed in [">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"] {
        assert_eq!(run(closed, &["systems"]).code, Some(0), "{closed}");
        assert_eq!(run(closed, &["sistems"]).code, Some(2), "{closed}");
        assert_eq!(run(closed, &["evaluate", "nowhere"]).code, Some(1), "{closed}");
    }
}

#[test]
fn there_are_no_colours_without_a_terminal() {
    let folder = Folder::new();
    let config = configuration(&folder);
    let out = text(&folder.path("out"));
    for (arguments, code) in [
        (&["--help"][..], 0),
        (&["rollout", "--help"], 0),
        (&["systems"], 0),
        (&[], 2),
        (&["sistems"], 2),
        (&["train", "--config", &config, "--out", &out], 0),
        (&["evaluate", "nowhere"], 1),
    ] {
        let run =
            Run::of(command(arguments).env("LNN_LOG", "trace").env("TERM", "xterm-256color").env_remove("NO_COLOR"));
        assert_eq!(run.code, Some(code), "{arguments:?}: {}", run.stderr);
        assert!(!run.stdout.contains('\x1b') && !run.stderr.contains('\x1b'), "{arguments:?}");
    }
}

#[test]
fn results_and_messages_go_their_own_ways() {
    let folder = Folder::new();
    let config = configuration(&folder);
    let out = text(&folder.path("out"));
    let train = |filter: &str| {
        Run::of(
            command(&["train", "--config", &config, "--out", &out, "--overwrite", "--json", "--threads", "1"])
                .env("LNN_LOG", filter),
        )
    };
    // Every event is a line with its level; the result is JSON beside any number of them.
    let lines = |filter: &str, level: &str| {
        let run = train(filter);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert_eq!(serde_json::from_str::<Value>(&run.stdout).unwrap()["system"], "harmonic-oscillator");
        run.stderr.lines().filter(|line| line.contains(level)).count()
    };
    assert!(lines("info", " INFO ") >= 2);
    assert!(lines("lnn=info", " INFO ") >= 2);
    for silent in ["off", "error", "warn", "info,lnn=off", "foreign=trace"] {
        assert_eq!(lines(silent, ""), 0, "{silent}");
    }
    let unset = lnn(&["train", "--config", &config, "--out", &out, "--overwrite"]);
    assert_eq!((unset.code, unset.stderr.as_str()), (Some(0), ""));
    let wrong = Run::of(command(&["systems"]).env("LNN_LOG", "lnn=loud"));
    wrong.refused(2, &["LNN_LOG: "]);
    let failed = lnn(&["evaluate", &text(&folder.path("nowhere"))]);
    failed.refused(1, &["nowhere: no such file"]);
    assert!(fs::read_to_string(folder.path("out/history.csv")).unwrap().lines().count() > 2);
}
