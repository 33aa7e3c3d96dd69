//! Configurations that are printed, completed, changed and found wrong, from outside.

use crate::running::{Folder, lnn, piped, text};
use lnn::configuration::{Config, Regularizer};
use lnn::network::ModelFile;
use lnn_cli::parse_config;
use std::fs;

/// A training so small that it takes a moment.
const SMALL: &str = "[data]\ntraining = 256\nvalidation = 64\ntest = 64\n[network]\nhidden = [8, 8]\n";

/// Lines of a run that found mistakes.
fn mistakes(run: &crate::running::Run) -> Vec<&str> {
    assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""), "{}", run.stderr);
    run.stderr.lines().map(|line| line.strip_prefix("error: ").unwrap()).collect()
}

#[test]
fn a_printed_configuration_is_complete_and_commented() {
    let folder = Folder::new();
    for (system, preset) in [("double-pendulum", "paper"), ("n-pendulum", "quick"), ("ads4-geodesic", "best")] {
        let printed = lnn(&["train", system, "--preset", preset, "--param", &parameter(system), "--print-config"]);
        assert_eq!((printed.code, printed.stderr.as_str()), (Some(0), ""));
        let config: Config = parse_config(&printed.stdout).unwrap();
        assert!(!config.parameters.is_empty());
        // Read again, alone or over another preset, it says the same.
        let file = folder.file("printed.toml", &printed.stdout);
        for more in [&[][..], &["--preset", "quick"]] {
            let again = lnn(&[&["train", "--config", &file, "--print-config"], more].concat());
            assert_eq!(again.stdout, printed.stdout, "{}", again.stderr);
        }
        let comments = printed.stdout.lines().filter(|line| line.starts_with("# ")).count();
        assert!(comments > 50, "{comments}");
    }
    assert_eq!(folder.names(), ["printed.toml"]);
    let markdown = lnn(&["train", "kepler", "--print-config=markdown"]).stdout;
    assert!(markdown.contains("| `embed_periodic` | true, false |"), "{markdown}");
}

/// A parameter of a system with another value than its default.
fn parameter(system: &str) -> String {
    match system {
        "n-pendulum" => "n=3".to_string(),
        "ads4-geodesic" => "L=2".to_string(),
        _ => "m1=2".to_string(),
    }
}

#[test]
fn missing_keys_are_the_presets_and_parameters_are_written_down() {
    let folder = Folder::new();
    let file = folder.file("small.toml", format!("{SMALL}[parameters]\nm1 = 2\n"));
    let out = text(&folder.path("run"));
    let run = lnn(&["train", "double-pendulum", "--config", &file, "--epochs", "1", "--out", &out]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let written: Config = parse_config(&fs::read_to_string(folder.path("run/config.toml")).unwrap()).unwrap();
    let all: Vec<(&str, f64)> = written.parameters.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    assert_eq!(all, [("g", 9.8), ("l1", 1.0), ("l2", 1.0), ("m1", 2.0), ("m2", 1.0)]);
    assert_eq!((written.optimizer.batch, written.phases[0].rate, written.phases[0].epochs), (128, 5e-3, 1));
    let report = fs::read_to_string(folder.path("run/report.html")).unwrap();
    assert!(report.contains("Parameters of the system"));
    // From standard input, with the system in it.
    let complete = format!("system = \"double-pendulum\"\n{SMALL}");
    let printed = piped(&["train", "--config", "-", "--print-config"], complete.as_bytes());
    assert_eq!((printed.code, printed.stderr.as_str()), (Some(0), ""));
    assert_eq!(parse_config::<Config>(&printed.stdout).unwrap().network.hidden, [8, 8]);
    piped(&["train", "--config", "-", "--print-config"], SMALL.as_bytes()).refused(2, &["standard input: system"]);
    piped(&["train", "--config", "-"], b"seed = ").refused(2, &["standard input:1: "]);
}

#[test]
fn all_mistakes_of_a_file_are_listed_at_once() {
    let folder = Folder::new();
    let wrong = "system = \"double-pendulum\"\nsede = 1\nprecision = \"f16\"\n[parameters]\nm1 = -1\nm9 = 1\n[network]\n\
                 hidden = []\nalpha = nan\n[optimizer]\nbatch = \"many\"\n[[phase]]\nrate = -1.0\nt_max = 0.0\n";
    let file = folder.file("wrong.toml", wrong);
    let run = lnn(&["train", "--config", &file]);
    let expected = [
        ("2: sede", "seed"),
        ("3: precision", "f16"),
        ("5: parameters.m1", "above 0"),
        ("6: parameters.m9", "m9"),
        ("11: optimizer.batch", "many"),
    ];
    let found = mistakes(&run);
    assert_eq!(found.len(), expected.len(), "{found:#?}");
    for (line, (place, part)) in found.iter().zip(expected) {
        assert!(line.contains(&format!("wrong.toml:{place}: ")) && line.contains(part), "{line}");
    }
    // Without wrong parameters the ranges are known as well.
    let file = folder.file("wrong.toml", wrong.replace("m1 = -1\nm9 = 1\n", ""));
    let run = lnn(&["train", "--config", &file]);
    let expected = ["2: sede", "3: precision", "6: network.hidden", "7: network.alpha", "9: optimizer.batch"];
    let expected = [&expected[..], &["11: phase[0].rate", "12: phase[0].t_max"]].concat();
    let found = mistakes(&run);
    assert_eq!(found.len(), expected.len(), "{found:#?}");
    for (line, place) in found.iter().zip(expected) {
        assert!(line.contains(&format!("wrong.toml:{place}: ")), "{line} is not at {place}");
    }
    let file = folder.file("wrong.toml", "system = \"duoble-pendulum\"\n[optimizer]\nclip = true\n");
    let run = lnn(&["train", "--config", &file]);
    let found = mistakes(&run);
    assert!(found.len() == 2 && found[0].contains(":1: system: ") && found[1].contains(":3: optimizer.clip: "));
    assert!(found[0].contains("did you mean \"double-pendulum\"?"), "{found:?}");
    assert_eq!(folder.names(), ["wrong.toml"]);
}

#[test]
fn printed_structures_are_read_back_as_they_are() {
    let folder = Folder::new();
    for (system, structure) in
        [("ads4-geodesic", "metric"), ("sphere-geodesic", "metric"), ("triple-pendulum", "mechanical")]
    {
        let printed = lnn(&["train", system, "--structure", structure, "--print-config"]).stdout;
        let file = folder.file("printed.toml", &printed);
        assert_eq!(lnn(&["train", "--config", &file, "--print-config"]).stdout, printed, "{system}");
        let off_shell = folder.file("off_shell.toml", printed.replace("[data]\n", "[data]\nrescaled_fraction = 0.5\n"));
        let read = lnn(&["train", "--config", &off_shell, "--print-config"]);
        let config: Config = parse_config(&read.stdout).unwrap();
        assert_eq!(config.data.rescaled_fraction, 0.5, "{}", read.stderr);
    }
}

#[test]
fn what_is_changed_most_has_options() {
    let changed = |system: &str, more: &[&str]| -> Config {
        let run = lnn(&[&["train", system, "--print-config"], more].concat());
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        parse_config(&run.stdout).unwrap()
    };
    let more = ["--hidden", "32,16", "--activation", "softplus", "--penalty", "sylvester", "--lambda", "7"];
    let config = changed("double-pendulum", &[&more[..], &["--learning-rate", "1e-3", "--epochs", "12"]].concat());
    assert_eq!((config.network.hidden.as_slice(), config.network.activation.name()), (&[32, 16][..], "softplus"));
    assert_eq!(config.penalty, Regularizer::Sylvester { lambda: 7.0 });
    assert_eq!((config.phases[0].rate, config.phases[0].epochs, config.phases[0].t_max), (1e-3, 12, 12.0));
    let config = changed("double-pendulum", &["--preset", "paper", "--epochs", "70", "--learning-rate", "1e-4"]);
    let phases: Vec<(usize, f64)> = config.phases.iter().map(|phase| (phase.epochs, phase.t_max)).collect();
    assert_eq!(phases, [(30, 3.0), (20, 3.0), (20, 3.0)]);
    assert!((config.phases[1].rate - 4e-6).abs() < 1e-18 && config.phases[0].rate == 1e-4);
    let lambda = |config: Config| config.penalty.lambda();
    assert_eq!(lambda(changed("ads4-geodesic", &["--lambda", "0"])), 0.0);
    let refused = |system: &str, more: &[&str], parts: &[&str]| {
        lnn(&[&["train", system, "--print-config"], more].concat()).refused(2, parts);
    };
    refused("kepler", &["--penalty", "lorentzian-sylvester"], &["--penalty", "time"]);
    refused("kepler", &["--penalty", "none", "--lambda", "1"], &["--lambda"]);
    refused("kepler", &["--activation", "gleu"], &["--activation: network.activation", "gelu"]);
    refused("double-pendulum", &["--preset", "paper", "--epochs", "2"], &["--epochs 2", "3 phases"]);
    refused(
        "kepler",
        &["--hidden", "15", "--activation", "quadratic-softplus"],
        &["--hidden: network.hidden[0]", "even"],
    );
    refused("kepler", &["--lambda", "-1"], &["--lambda"]);
    // Every other key, with all mistakes at once.
    let config = changed("kepler", &["--set", "optimizer.batch=64", "--set", "phase[0].schedule=constant"]);
    assert_eq!((config.optimizer.batch, config.phases[0].epochs), (64, 40));
    let more = ["--set", "optimizer.bacth=64", "--set=phase[3].rate=1", "--seed", "-1", "--param", "mu=-1"];
    let run = lnn(&[&["train", "kepler", "--print-config"], &more[..]].concat());
    let found = mistakes(&run);
    for part in ["--seed: seed", "--set optimizer.bacth", "--set phase[3].rate", "--param mu"] {
        assert!(found.iter().any(|line| line.contains(part)), "{part}: {found:#?}");
    }
    assert_eq!((run.code, found.len()), (Some(2), 4));
}

/// A swing of a harmonic oscillator in four runs.
fn swings() -> String {
    let mut csv = "run,t,x\n".to_string();
    for run in 0..4 {
        for k in 0..120 {
            let t = 0.05 * f64::from(k);
            csv += &format!("{run},{t},{}\n", (1.0 + 0.3 * f64::from(run)) * (2.0 * t + f64::from(run)).cos());
        }
    }
    csv
}

#[test]
fn a_fit_reads_the_configuration_that_it_writes() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", swings());
    let columns = ["--coords", "x", "--trajectory", "run"];
    let out = |name: &str| text(&folder.path(name));
    let changes =
        ["--hidden", "8,8", "--epochs", "6", "--learning-rate", "1e-3", "--lambda", "3", "--activation", "tanh"];
    let more = ["--hold-out", "0.3", "--seed", "5", "--horizon", "0.5", "--name", "spring", "--window", "9"];
    let first = lnn(&[&["fit", &data, "--out", &out("one")], &columns[..], &changes, &more].concat());
    assert_eq!(first.code, Some(0), "{}", first.stderr);
    let written = text(&folder.path("one/config.toml"));
    let toml = fs::read_to_string(&written).unwrap();
    for line in
        ["held_out = 0.3", "horizon = 0.5", "window = 9", "coords = [\"x\"]", "activation = \"tanh\"", "lambda = 3.0"]
    {
        assert!(toml.contains(line), "{line} is not in\n{toml}");
    }
    let second = lnn(&["fit", "--config", &written, "--out", &out("two")]);
    assert_eq!(second.code, Some(0), "{}", second.stderr);
    let model = |name: &str| fs::read(folder.path(name).join("model.safetensors")).unwrap();
    assert_eq!(model("one"), model("two"));
    assert_eq!(fs::read(&written).unwrap(), fs::read(folder.path("two/config.toml")).unwrap());
    let header = ModelFile::<f64>::load(&folder.path("two/model.safetensors")).unwrap().header;
    assert_eq!((header.system.as_str(), header.seed), ("spring", 5));

    // What it would use is printed with comments; that is a configuration too, and arguments change it.
    let printed = lnn(&["fit", "--config", &written, "--print-config"]);
    assert_eq!(printed.code, Some(0), "{}", printed.stderr);
    let file = folder.file("printed.toml", &printed.stdout);
    let again = lnn(&["fit", "--config", &file, "--print-config"]);
    assert_eq!(again.stdout, printed.stdout);
    let changed = lnn(&["fit", "--config", &file, "--print-config", "--hidden", "4", "--seed", "1", "--hold-out", "0"]);
    assert!(changed.stdout.contains("hidden = [4]") && changed.stdout.contains("held_out = 0.0"));
    assert!(lnn(&["fit", &data, "--coords", "x", "--print-config=markdown"]).stdout.contains("| `targets` |"));

    // Little of it is enough, and all mistakes are listed.
    let partial = folder.file("partial.toml", "[training.network]\nhidden = [8]\n[[training.phase]]\nepochs = 2\n");
    let printed = lnn(&[&["fit", &data, "--config", &partial, "--print-config"], &columns[..]].concat());
    assert_eq!(printed.code, Some(0), "{}", printed.stderr);
    assert!(printed.stdout.contains("hidden = [8]") && printed.stdout.contains("epochs = 2"));
    lnn(&["fit", "--config", &partial]).refused(2, &["partial.toml", "recording.files"]);
    let wrong = "held_out = 1.5\nnoise = [-1]\ntragets = \"motion\"\n[recording]\nunits = [\"x\"]\n[shooting]\nbatch = 0\n\
                 [training.network]\nhidden = []\n[[training.phase]]\nrate = 0\n";
    let wrong = folder.file("wrong.toml", wrong);
    let run = lnn(&[&["fit", &data, "--config", &wrong], &columns[..]].concat());
    let found = mistakes(&run);
    let places = ["1: held_out", "2: noise[0]", "3: tragets", "5: recording.units[0]", "7: shooting.batch"];
    let places = [&places[..], &["9: training.network.hidden", "11: training.phase[0].rate"]].concat();
    assert_eq!(found.len(), places.len(), "{found:#?}");
    for (line, place) in found.iter().zip(places) {
        assert!(line.contains(&format!("wrong.toml:{place}: ")), "{line} is not at {place}");
    }
}
