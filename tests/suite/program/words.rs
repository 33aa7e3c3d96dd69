//! Messages name the line, the key or the option that is wrong, and the option that helps.
#![cfg(unix)]

use crate::running::{Folder, HEADER, inspect, lnn, model, text};
use lnn::configuration::Config;
use lnn::lagrangian::SystemInstance;
use lnn::presets::Preset;
use lnn_cli::{check_arguments, parse_config};
use std::ffi::OsString;

/// Every value of every key of a whole configuration, replaced by what it cannot be, is refused by line and key.
#[test]
fn every_wrong_value_of_a_configuration_is_placed() {
    let config = Preset::Quick.config(&SystemInstance::named("double-pendulum", &[]).unwrap()).unwrap();
    let good = toml::to_string(&config).unwrap();
    parse_config::<Config>(&good).unwrap();
    for (k, line) in good.lines().enumerate() {
        let Some((key, _)) = line.split_once(" = ") else { continue };
        for value in ["{a = 1}", "1979-05-27", "1 2", "'", "[1", "_"] {
            let wrong =
                |(j, other): (usize, &str)| if j == k { format!("{key} = {value}\n") } else { format!("{other}\n") };
            let bad: String = good.lines().enumerate().map(wrong).collect();
            let (place, problem) = parse_config::<Config>(&bad).unwrap_err();
            // What is no value of any key has no key.
            let syntax = ["1 2", "'", "[1", "_"].contains(&value);
            // A table of several kinds is refused as a whole.
            let kinds = problem.starts_with("penalty: ");
            assert!(
                (place == k + 1 && problem.contains(key)) || (syntax && place > k) || kinds,
                "{key} = {value}: {place}: {problem}"
            );
        }
        let mistyped = good.replacen(&format!("{key} ="), &format!("{key}zzzzzzzzz ="), 1);
        let (_, problem) = parse_config::<Config>(&mistyped).unwrap_err();
        // A table of several kinds misses its kind first.
        assert!(problem.contains(&format!("{key}zzzzzzzzz")) || key == "kind", "{problem}");
    }
}

#[test]
fn every_wrong_argument_is_named() {
    let commands: [&[&str]; 6] = [
        &["train", "double-pendulum"],
        &["rollout", "m", "--state", "1,2,3,4", "--t-end", "1", "--dt", "0.1", "--out", "o"],
        &["evaluate", "m"],
        &["inspect", "--system", "double-pendulum", "--states", "s"],
        &["check", "d", "--coords", "x"],
        &["fit", "d", "--coords", "x"],
    ];
    let mut refused = 0;
    for command in commands {
        for option in [
            "--seed",
            "--epochs",
            "--threads",
            "--precision",
            "--preset",
            "--checkpoint-every",
            "--rtol",
            "--atol",
            "--step",
            "--method",
            "--starts",
            "--until",
            "--positions",
            "--rate",
            "--units",
            "--param",
            "--format",
            "--targets",
            "--friction",
            "--zebra",
            "--t-ned",
        ] {
            for value in ["x", "", "-1", "1.5", "99999999999999999999999", "nan", "0", "1e999", "1e-30"] {
                let given = format!("{option}={value}");
                let line = [&["lnn"], command, &[&given]].concat();
                if let Err(error) = check_arguments(line.iter().map(OsString::from)) {
                    let named = error.to_string().contains(option);
                    assert!(named, "{command:?} {given}: {error}");
                    refused += 1;
                }
            }
        }
    }
    assert!(refused > 400, "{refused}");
}

#[test]
fn the_option_that_helps_is_named() {
    let folder = Folder::new();
    let rows = |header: &str| {
        let line = |k: usize| format!("{},{},{}\n", k as f64 / 100.0, (k as f64 / 10.0).sin(), k);
        format!("{header}{}", (0..40).map(line).collect::<String>())
    };
    let data = folder.file("d.csv", rows("s,x,y\n"));
    let bare = folder.file("b.csv", rows(""));
    let twice = folder.file("two.csv", format!("{}0.0,1,2\n", rows("t,x,y\n")));
    lnn(&["check", &data, "--coords", "x"])
        .refused(1, &["no column is called t or time", "--time COLUMN", "--rate HZ"]);
    lnn(&["check", &data, "--coords", "z", "--time", "s"]).refused(1, &["unknown column \"z\"", "--coords"]);
    lnn(&["check", &bare, "--coords", "x", "--rate", "5"]).refused(1, &["file without names", "--coords"]);
    lnn(&["check", &data, "--coords", "x", "--columns", "a,x,b"]).refused(1, &["found the header s,x,y", "--columns"]);
    lnn(&["check", &twice, "--coords", "x"]).refused(1, &["another trajectory?", "--trajectory"]);
    lnn(&["check", &data, "--coords", "x", "--velocity", "y,s"]).refused(2, &["--velocity: expected 1 column"]);
    lnn(&["check", &data, "--coords", "x", "--units", "x=parsec"]).refused(2, &["--units: x: unknown unit"]);
    let model = folder.file("m", model().to_bytes().unwrap());
    let out = text(&folder.path("out.csv"));
    let rollout = |more: &[&str]| lnn(&[&["rollout", &model, "--state", "1,2,0,0", "--out", &out], more].concat());
    rollout(&["--t-end", "1", "--dt", "1e-12"]).refused(2, &["--dt: requires", "at most 1e8"]);
    rollout(&["--t-end", "1", "--dt", "0.1", "--rtol", "1e-30"]).refused(2, &["--rtol", "2e-15"]);
    lnn(&["evaluate", &model, "--rtol", "1e-30"]).refused(2, &["--rtol", "2e-15"]);
    assert!(!folder.path("out.csv").exists());
}

#[test]
fn counts_are_singular_and_plural() {
    let folder = Folder::new();
    let model = folder.file("m", model().to_bytes().unwrap());
    let out = text(&folder.path("out.csv"));
    let run = lnn(&["rollout", &model, "--state", "1,2,0,0", "--t-end", "0", "--dt", "0.1", "--out", &out]);
    assert!(run.stdout.starts_with("1 sample to t = 0 s, 0 steps, "), "{}", run.stdout);
    let states = folder.file("s.csv", format!("{HEADER}1,2,3\n"));
    inspect("double-pendulum", &states, &[]).refused(1, &["row 2: expected 4 fields, found 3"]);
}
