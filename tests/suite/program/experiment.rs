//! `lnn experiment` from outside: everything runs, nothing finished runs twice.
#![cfg(feature = "cli")]

use crate::common::program::{joined, lead};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn lnn(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lnn")).arg("experiment").args(arguments).output().unwrap()
}

fn succeeded(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn smoke(name: &str, out: &Path, threads: &str) -> String {
    succeeded(&lnn(&[name, "--scale", "smoke", "--threads", threads, "--out", out.to_str().unwrap()]))
}

#[test]
fn every_experiment_of_the_paper_runs() {
    let listed = succeeded(&lnn(&[]));
    let out = tempfile::tempdir().unwrap();
    let printed = smoke("all", out.path(), "2");
    for experiment in lnn::experiments::experiments() {
        assert!(listed.contains(experiment.name) && listed.contains(experiment.paper));
        assert!(printed.contains(experiment.title));
        let folder = out.path().join(format!("{}-smoke", experiment.name));
        let table = fs::read_to_string(folder.join("table.csv")).unwrap();
        let runs = experiment.runs(lnn::experiments::Scale::Smoke, 1);
        for run in &runs {
            assert!(table.contains(&format!("\"{}\"", run.label)), "{table}");
            for file in ["record.json", "model.safetensors", "config.toml", "report.html"] {
                assert!(folder.join(&run.name).join(file).is_file(), "{}: no {file}", run.name);
            }
        }
        let report = fs::read_to_string(folder.join("report.html")).unwrap();
        assert!(report.contains(experiment.title) && report.matches("<figure").count() >= 2);
        // The report and the screen say the same.
        let sentence = lead(&report);
        assert!(sentence.starts_with("Lowest loss ") && joined(&printed).contains(&sentence), "{sentence}");
        assert!(report.len() < 2_000_000, "{}: {}", experiment.name, report.len());
        // Relativistic runs are held to their signature, not to positive eigenvalues.
        if experiment.name == "ads4-geodesic" {
            let config = fs::read_to_string(folder.join(&runs[0].name).join("config.toml")).unwrap();
            assert!(config.contains("kind = \"lorentzian-sylvester\"") && config.contains("time = \"t\""), "{config}");
        }
    }
    // The page of results lists what the program lists.
    let page = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/results.md")).unwrap();
    for experiment in lnn::experiments::experiments() {
        assert!(page.contains(&format!("| `{}` | {} |", experiment.name, experiment.paper)), "{}", experiment.name);
    }
}

#[test]
fn finished_runs_are_kept_and_missing_ones_made_again() {
    let out = tempfile::tempdir().unwrap();
    smoke("old-tricks", out.path(), "1");
    let folder = out.path().join("old-tricks-smoke");
    let read = |file: &str| fs::read(folder.join(file)).unwrap();
    let table = read("table.csv");
    let model = read("liu-tricks-seed0/model.safetensors");
    let kept = "cranmer-initialisation-as-in-the-paper-seed0/record.json";
    let record = String::from_utf8(read(kept)).unwrap();
    // A mark that a new run would not leave; one run lost, one made with another configuration.
    let marked = record.replace("\"seconds\":", "\"seconds\":1000000");
    assert_ne!(marked, record);
    fs::write(folder.join(kept), &marked).unwrap();
    fs::remove_file(folder.join("liu-tricks-seed0/record.json")).unwrap();
    let changed = "paper-s-model-seed0/config.toml";
    let config = String::from_utf8(read(changed)).unwrap();
    fs::write(folder.join(changed), config.replace("rate = 0.001", "rate = 0.002")).unwrap();

    // Of the latter an hour of work could be lost.
    let again = ["old-tricks", "--scale", "smoke", "--threads", "2", "--out", out.path().to_str().unwrap()];
    let refused = lnn(&again);
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("paper-s-model-seed0: a finished run of another configuration is there"), "{stderr}");
    let curves = format!("x={}", folder.join("curves.csv").display());
    fs::write(folder.join("curves.csv"), "seconds,validation_loss\n0,1\n1,0.5\n").unwrap();
    let refused = lnn(&[&again[..], &["--overwrite", "--beside", &curves]].concat());
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("curves.csv: this command reads it"));
    assert!(String::from_utf8(read(changed)).unwrap().contains("rate = 0.002"));
    succeeded(&lnn(&[&again[..], &["--overwrite"]].concat()));
    assert_eq!(String::from_utf8(read(kept)).unwrap(), marked);
    assert_eq!(read(changed), config.into_bytes());
    // The same numbers on another number of threads.
    assert_eq!(read("table.csv"), table);
    assert_eq!(read("liu-tricks-seed0/model.safetensors"), model);
}

#[test]
fn more_seeds_are_more_runs_of_the_same_rows() {
    let out = tempfile::tempdir().unwrap();
    let path = out.path().to_str().unwrap();
    succeeded(&lnn(&["scaling", "--scale", "smoke", "--seeds", "2", "--out", path]));
    let folder = out.path().join("scaling-smoke");
    let table = fs::read_to_string(folder.join("table.csv")).unwrap();
    assert_eq!(table.lines().count(), 4);
    assert!(table.lines().skip(1).all(|line| line.split("\",\"").nth(1) == Some("2")), "{table}");
    let models = ["physical-scaling-seed0", "physical-scaling-seed1"]
        .map(|run| fs::read(folder.join(run).join("model.safetensors")).unwrap());
    assert_ne!(models[0], models[1]);
}

#[test]
fn single_rows_can_be_run_and_tables_say_what_they_compare() {
    let out = tempfile::tempdir().unwrap();
    let path = out.path().to_str().unwrap();
    let only = |text| lnn(&["scaling", "--scale", "smoke", "--only", text, "--out", path]);
    let printed = succeeded(&only("DyT"));
    let table = || fs::read_to_string(out.path().join("scaling-smoke/table.csv")).unwrap();
    assert!(table().lines().count() == 2 && table().lines().nth(1).unwrap().starts_with("\"DyT\""), "{}", table());
    for part in ["RAdam", "lambda = 5", "without the penalty"] {
        assert!(printed.contains(part), "{printed} lacks {part}");
    }
    // Without the rows to compare there is no reduction of ours beside the paper's.
    let is_missing = |printed: &str| {
        let line = printed.lines().find(|line| line.contains("physical scaling  no scaling") && line.contains("40.9"));
        line.is_some_and(|line| line.split_whitespace().any(|word| word == "-"))
    };
    assert!(is_missing(&printed), "{printed}");
    let printed = smoke("scaling", out.path(), "1");
    assert_eq!(table().lines().count(), 4);
    assert!(printed.contains("40.9") && !is_missing(&printed), "{printed}");
    let refused = only("dyt");
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert_eq!((refused.status.code(), stderr.lines().count()), (Some(2), 1), "{stderr}");
    assert!(stderr.contains("no row begins so; there are `physical scaling`, `no scaling`, `DyT`"), "{stderr}");
}

#[test]
fn wrong_names_and_directories_are_refused() {
    for (arguments, code, part) in [
        (["activation", "--scale", "smoke"], 2, "activations"),
        (["scaling", "--scale", "tiny"], 2, "tiny"),
        (["scaling", "--seeds", "0"], 2, "--seeds"),
        (["scaling", "--seeds", "18446744073709551615"], 2, "at most 10000"),
        (["scaling", "--out", "/dev/null/x"], 1, "/dev/null"),
    ] {
        let output = lnn(&arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{stderr}");
        assert!(stderr.starts_with("error: ") && stderr.lines().count() == 1 && stderr.contains(part), "{stderr}");
    }
}
