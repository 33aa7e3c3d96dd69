//! `lnn sweep`: all combinations run, whole or in shares, and the tables are numbers.

use crate::running::{Folder, Run, lnn, text};
use serde_json::Value;
use std::fs;

/// A training of a moment.
const SMALL: &str =
    "system = \"harmonic-oscillator\"\n[data]\ntraining = 128\nvalidation = 64\ntest = 64\n[network]\nhidden = [4]\n";

fn sweep(file: &str, out: &str, more: &[&str]) -> Run {
    let vary = ["--vary", "penalty.lambda=0.5,2", "--vary", "network.hidden=[4],[3,3]"];
    lnn(&[&["sweep", file, "--out", out, "--threads", "1"], &vary[..], more].concat())
}

#[test]
fn all_combinations_are_run_once_and_gathered_as_numbers() {
    let folder = Folder::new();
    let file = folder.file("small.toml", SMALL.replace("[network]", "[[phase]]\nepochs = 2\n[network]"));
    let [alone, shared] = ["alone", "shared"].map(|name| text(&folder.path(name)));
    let run = sweep(&file, &alone, &["--json"]);
    run.succeeded();
    let object: Value = serde_json::from_str(&run.stdout).unwrap();
    let rows = object["rows"].as_array().unwrap();
    assert_eq!((rows.len(), &object["runs"], &object["scale"]), (4, &4.into(), &Value::Null));
    assert_eq!(rows[1]["row"], "penalty.lambda = 0.5, network.hidden = [3,3]");
    assert!(rows.iter().all(|row| row["loss_median"].as_f64().unwrap() > 0.0 && row["loss_paper"].is_null()));

    // Shares make the same files, and a run that is finished is not made again.
    for share in ["1/2", "2/2"] {
        sweep(&file, &shared, &["--shard", share]).succeeded();
    }
    assert!(!folder.path("shared/runs.csv").exists());
    let kept = fs::metadata(folder.path("shared/penalty-lambda-2-network-hidden-4-seed0/record.json")).unwrap();
    let merged = sweep(&file, &shared, &["--merge"]);
    merged.succeeded();
    for file in ["runs.csv", "table.csv"] {
        let of = |out: &str| fs::read_to_string(folder.path(out).join(file)).unwrap();
        assert_eq!(of("alone"), of("shared"));
    }
    sweep(&file, &shared, &[]).succeeded();
    let again = fs::metadata(folder.path("shared/penalty-lambda-2-network-hidden-4-seed0/record.json")).unwrap();
    assert_eq!(kept.modified().unwrap(), again.modified().unwrap());

    let runs = fs::read_to_string(folder.path("alone/runs.csv")).unwrap();
    let mut lines = runs.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert!(
        ["seed", "penalty.lambda", "network.hidden", "loss", "valid_time"].iter().all(|name| header.contains(name))
    );
    assert_eq!((lines.clone().count(), lines.filter(|line| line.contains("\"learned\"")).count()), (4, 4), "{runs}");
    assert!(fs::read_to_string(folder.path("alone/report.html")).unwrap().contains("Sweep over configurations"));
}

#[test]
fn what_cannot_be_varied_is_named() {
    let folder = Folder::new();
    let file = folder.file("small.toml", SMALL);
    let out = text(&folder.path("out"));
    let refused =
        |vary: &[&str], parts: &[&str]| lnn(&[&["sweep", &file, "--out", &out], vary].concat()).refused(2, parts);
    refused(&["--vary", "penalty.lamda=1,2"], &["penalty.lamda"]);
    refused(&["--vary", "penalty.lambda=1,-2"], &["penalty.lambda", "-2"]);
    refused(&["--vary", "penalty.lambda"], &["--vary", "expected KEY=VALUE,VALUE,.."]);
    refused(&["--vary", "seed=1,2", "--vary", "seed=3,4"], &["--vary seed: the key is given twice"]);
    refused(&["--vary", "penalty.lambda=1,2", "--seeds", "9999"], &["19998 runs"]);
    assert_eq!(folder.names(), ["small.toml"]);
    let listed = lnn(&["sweep", &file, "--out", &out, "--vary", "seed=4,5", "--list", "--json"]);
    let states: Vec<Value> = listed.objects();
    assert!(states.len() == 2 && states.iter().all(|run| run["state"] == "open"), "{}", listed.stdout);
}
