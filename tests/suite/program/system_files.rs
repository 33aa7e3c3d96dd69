//! Systems in files of one's own, from outside.
#![cfg(unix)]

use crate::running::{Folder, lnn, text};
use serde_json::Value;
use std::fs;

const PENDULUM: &str = include_str!("../../../examples/systems/pendulum.toml");

/// A training of seconds.
const SMALL: &str =
    "[data]\ntraining = 512\nvalidation = 64\ntest = 64\n[network]\nhidden = [8]\n[[phase]]\nepochs = 2\n";

#[test]
fn a_file_is_a_system_of_every_command_and_goes_with_its_model() {
    let folder = Folder::new();
    let (file, small) = (folder.file("my.toml", PENDULUM), folder.file("small.toml", SMALL));
    let run = text(&folder.path("run"));
    let train = |more: &[&str]| lnn(&[&["train", "--config", &small, "--threads", "1"], more].concat());
    train(&[&file, "--param", "l=0.5", "--out", &run]).succeeded();
    // Everything else without the file.
    fs::remove_file(&file).unwrap();
    lnn(&["evaluate", &run, "--starts", "1"]).succeeded();
    let json: Value =
        serde_json::from_slice(&fs::read(folder.path("run/evaluation/evaluation.json")).unwrap()).unwrap();
    assert_eq!(json["system"], "pendulum");
    let again = text(&folder.path("again"));
    lnn(&["train", "--config", &text(&folder.path("run/config.toml")), "--threads", "2", "--out", &again]).succeeded();
    assert_eq!(
        fs::read(folder.path("run/model.safetensors")).unwrap(),
        fs::read(folder.path("again/model.safetensors")).unwrap()
    );
    lnn(&["train", "--from", &run, "--config", &small, "--out", &text(&folder.path("from"))]).succeeded();
    let motion = text(&folder.path("motion.csv"));
    let roll = ["--state", "0.1,0", "--t-end", "1", "--dt", "0.1", "--out", &motion, "--json", "--overwrite"];
    let found = lnn(&[&["rollout", &run, "--beyond-range"], roll.as_slice()].concat());
    found.succeeded();
    assert_eq!(serde_json::from_str::<Value>(&found.stdout).unwrap()["time_unit"], "s");
    // The exact motion of the file.
    let file = folder.file("my.toml", PENDULUM);
    lnn(&[&["rollout", "--system", &file, "--param", "l=0.5"], roll.as_slice()].concat()).succeeded();
    let last = fs::read_to_string(&motion).unwrap();
    let theta: f64 = last.lines().last().unwrap().split(',').nth(1).unwrap().parse().unwrap();
    // Small oscillations: 0.1 cos(sqrt(g/l)), a little slower.
    assert!((theta - 0.1 * (9.8f64 / 0.5).sqrt().cos()).abs() < 3e-4, "{theta}");
    // Another system with the same columns, and one with other columns.
    lnn(&["evaluate", &run, "--system", &file, "--param", "l=0.4", "--starts", "1"]).succeeded();
    lnn(&["evaluate", &run, "--system", "kepler"])
        .refused(2, &["--system kepler: expected the model's columns theta,theta_dot"]);
}

#[test]
fn a_run_goes_on_with_its_own_system_alone() {
    let folder = Folder::new();
    let (file, small) = (folder.file("my.toml", PENDULUM), folder.file("small.toml", SMALL));
    let run = text(&folder.path("run"));
    lnn(&["train", &file, "--config", &small, "--threads", "1", "--out", &run]).succeeded();
    let resume = |file: &str| lnn(&["train", "--resume", &run, file]);
    resume(&file).succeeded();
    let changed = folder.file("my.toml", PENDULUM.replace("cos(theta)", "sin(theta)"));
    resume(&changed).refused(2, &["--resume", "description.lagrangian", "requested"]);
    // A comment changes nothing.
    resume(&folder.file("same.toml", format!("# the same\n{PENDULUM}"))).succeeded();
    // Its configuration with another file.
    let config = text(&folder.path("run/config.toml"));
    lnn(&["train", "--config", &config, &changed]).refused(2, &["describes pendulum differently"]);
}

#[test]
fn a_file_is_inspected_in_every_precision() {
    let folder = Folder::new();
    let two = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/systems/two_pendula.toml");
    let states = folder.file("s.csv", "theta1,theta2,theta1_dot,theta2_dot\n0.1,0.2,0.3,0.4\n3,-2,1,5\n");
    for precision in ["f32", "f64", "dd"] {
        let look = |system: &str| {
            lnn(&["inspect", "--system", system, "--states", &states, "--precision", precision, "--param", "m1=0.1"])
                .objects()
        };
        for (a, b) in look(two).iter().zip(look("double-pendulum")) {
            let number = |value: &Value, k: usize| {
                value["acceleration"][k].to_string().trim_matches('"').parse::<f64>().unwrap()
            };
            let tolerance = if precision == "f32" { 1e-4 } else { 1e-12 };
            for k in 0..2 {
                assert!(
                    (number(a, k) - number(&b, k)).abs() <= tolerance * number(&b, k).abs(),
                    "{precision}: {a} {b}"
                );
            }
        }
    }
    let one = lnn(&["systems", "--system", two, "--json"]).objects();
    assert_eq!(
        (one.len(), &one[0]["name"], &one[0]["parameters"][0]["symbol"]),
        (1, &"two-pendula".into(), &"g".into())
    );
}

#[test]
fn mistakes_name_file_line_key_and_column() {
    let folder = Folder::new();
    let file = folder.file("my.toml", PENDULUM.replace("cos(theta)", "cos(thta)"));
    let expected = format!("{file}:5: lagrangian: column 33: unknown name \"thta\", did you mean \"theta\"?");
    for command in [&["train"][..], &["systems", "--system"]] {
        lnn(&[command, &[file.as_str()]].concat()).refused(2, &[&expected]);
    }
    lnn(&["train", &text(&folder.path("none.toml"))]).refused(1, &["none.toml"]);
    lnn(&["train", "pendulum"]).refused(2, &["unknown system \"pendulum\""]);
    lnn(&["train", &folder.file("p.toml", PENDULUM), "--preset", "paper"]).refused(2, &["pendulum has no such preset"]);
    // A configuration with a broken description.
    let printed = lnn(&["train", &folder.file("p.toml", PENDULUM), "--print-config"]);
    printed.succeeded();
    let config = folder.file("c.toml", printed.stdout.replace("cos(theta)", "cos(thta)"));
    lnn(&["train", "--config", &config]).refused(2, &["c.toml:", "description.lagrangian: column 33: unknown name"]);
}
