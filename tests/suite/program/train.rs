//! Training, roll-out and evaluation from outside, on networks too small to learn much.

use crate::running::{joined, lead, said_by};
use lnn::configuration::Config;
use lnn::lagrangian::SystemInstance;
use lnn::network::ModelFile;
use lnn::presets::Preset;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn lnn(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lnn")).args(arguments).output().unwrap()
}

/// The run failed with this code and one line that says all of `parts`.
fn refused(output: &Output, code: i32, parts: &[&str]) {
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{stderr}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    assert!(
        stderr.starts_with("error: ") && parts.iter().all(|part| stderr.contains(part)),
        "{stderr} lacks {parts:?}"
    );
}

fn text(path: &Path) -> String {
    path.to_str().unwrap().to_string()
}

/// The quick preset of a system, small enough for a test.
fn small(system: &str) -> Config {
    let mut config = Preset::Quick.config(&SystemInstance::named(system, &[]).unwrap()).unwrap();
    config.data.training = 512;
    config.data.validation = 128;
    config.data.test = 128;
    config.network.hidden = vec![16, 16];
    config.phases[0].epochs = 3;
    config
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }
    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
    fn config(&self, config: &Config) -> String {
        let path = self.path("small.toml");
        fs::write(&path, toml::to_string(config).unwrap()).unwrap();
        text(&path)
    }
    /// Trains the small configuration of a system into `out`.
    fn train(&self, system: &str, out: &str, more: &[&str]) -> String {
        let (config, out) = (self.config(&small(system)), text(&self.path(out)));
        said_by(&lnn(&[&["train", "--config", &config, "--out", &out], more].concat()))
    }
}

#[test]
fn a_training_leaves_a_complete_and_repeatable_folder() {
    let folder = Folder::new();
    let printed = folder.train("double-pendulum", "one", &["--threads", "1"]);
    assert!(printed.contains("loss (paper): validation") && printed.contains("report.html"));
    let one = folder.path("one");
    let files = ["model.safetensors", "config.toml", "history.csv", "summary.json", "report.html", "training_loss.svg"];
    for name in files {
        assert!(one.join(name).metadata().unwrap().len() > 0, "{name}");
    }
    // The report links to a page on which the exact system moves beside the model.
    let [report, page] = ["report.html", "play.html"].map(|name| fs::read_to_string(one.join(name)).unwrap());
    assert!(report.contains("href=\"play.html\"") && page.contains("class=\"exact\"") && page.len() < 500_000);
    assert!(fs::read_dir(&one).unwrap().all(|e| !e.unwrap().file_name().to_str().unwrap().starts_with('.')));
    let history = fs::read_to_string(one.join("history.csv")).unwrap();
    assert_eq!(history.lines().count(), 4);
    let summary: Value = serde_json::from_slice(&fs::read(one.join("summary.json")).unwrap()).unwrap();
    assert_eq!((summary["epochs"].as_u64(), summary["seed"].as_u64()), (Some(3), Some(0)));
    assert!(summary["validation_loss"].as_f64().unwrap() > 0.0 && summary["states_per_second"].as_f64().unwrap() > 0.0);
    assert_eq!(summary["accelerations"].as_array().unwrap().len(), 2);
    assert_eq!(summary["trajectories"].as_array().unwrap().len(), 4);
    let report = fs::read_to_string(one.join("report.html")).unwrap();
    assert!(report.contains("<svg viewBox") && !report.contains("http"));
    // What was learned and how good comes first; a report opens at once.
    let first = report.find("class=\"lead\"").unwrap();
    let sentence = lead(&report);
    assert!(sentence.starts_with("Double pendulum: ") && joined(&printed).starts_with(&sentence));
    assert!(first < report.find("<h2>").unwrap() && first < report.find("loss (paper)").unwrap());
    assert!(["good: ", "limited: ", "bad: "].iter().any(|word| sentence.contains(word)), "{sentence}");
    assert!(report.len() < 2_000_000, "{}", report.len());
    // How long the prediction is valid stands in the summary, on the screen and in the report.
    let valid = &summary["valid_time"];
    assert_eq!((valid["threshold"].as_f64(), valid["starts"].as_u64()), (Some(0.4), Some(4)));
    assert!(valid["median"].as_f64().unwrap() >= 0.0 && summary["trajectories"][0]["valid"]["time"].is_number());
    for text in [&printed, &report] {
        assert!(text.contains("Prediction valid (error below 0.4 of the spread of the motion), median of 4 starts"));
    }

    // The written configuration repeats the run, on any number of threads; another seed does not.
    let (two, three) = (text(&folder.path("two")), text(&folder.path("three")));
    let written = text(&one.join("config.toml"));
    said_by(&lnn(&["train", "double-pendulum", "--config", &written, "--threads", "2", "--out", &two]));
    let json = said_by(&lnn(&["train", "--config", &written, "--seed", "5", "--out", &three, "--json"]));
    assert_eq!(serde_json::from_str::<Value>(&json).unwrap()["seed"], 5);
    let model = |name: &str| fs::read(folder.path(name).join("model.safetensors")).unwrap();
    assert_eq!(model("one"), model("two"));
    assert_ne!(model("one"), model("three"));
}

#[test]
fn precision_and_parameters_reach_the_model() {
    let folder = Folder::new();
    folder.train("n-pendulum", "chain", &["--precision", "f64", "--epochs", "1", "--param", "l=0.5"]);
    let model = ModelFile::<f64>::load(&folder.path("chain/model.safetensors")).unwrap();
    assert_eq!(model.header.precision.name(), "f64");
    assert_eq!((model.header.parameters["l"], model.header.parameters["n"]), (0.5, 4.0));
    assert!(model.weights.iter().any(|w| f64::from(*w as f32) != *w));
}

#[test]
fn a_model_moves_and_is_judged() {
    let folder = Folder::new();
    folder.train("spring-pendulum", "run", &[]);
    let model = text(&folder.path("run/model.safetensors"));
    let out = text(&folder.path("path.csv"));
    let rollout = |state: &str, more: &[&str]| {
        lnn(&[
            &["rollout", &model, "--state", state, "--t-end", "0.02", "--dt", "0.01", "--out", &out, "--overwrite"],
            more,
        ]
        .concat())
    };
    let header = ModelFile::<f64>::load(Path::new(&model)).unwrap().header;
    let middle: Vec<String> = header.position.iter().map(|b| (0.5 * (b[0] + b[1])).to_string()).collect();
    let start = format!("{},0,0", middle.join(","));
    for method in ["dopri5", "dop853"] {
        said_by(&rollout(&start, &["--method", method]));
        let csv = fs::read_to_string(&out).unwrap();
        assert_eq!(csv.lines().count(), 4, "{csv}");
        assert_eq!(csv.lines().next().unwrap(), format!("t,{},energy", header.columns.join(",")));
    }
    // A start outside the training range keeps the start at most, and says which column left.
    let outside = format!("{},{},0", middle.join(","), 2.0 * header.velocity[0][1]);
    refused(&rollout(&outside, &[]), 1, &["training range", &header.columns[2]]);
    assert!(fs::read_to_string(&out).unwrap().starts_with("t,"));

    refused(&rollout("1,2,3", &[]), 2, &["--state: expected 4 numbers", "found 3"]);
    refused(&rollout("1,nan,0,0", &[]), 2, &["--state", "nan"]);
    refused(&rollout(&start, &["--dt", "0"]), 2, &["--dt"]);
    refused(
        &lnn(&["rollout", &model, "--state", &start, "--t-end", "inf", "--dt", "1", "--out", &out]),
        2,
        &["--t-end"],
    );
    refused(&lnn(&["rollout", &model, "--state", &start, "--t-end", "1", "--dt", "-1", "--out", &out]), 2, &["--dt"]);
    refused(&rollout(&start, &["--rtol", "-1"]), 2, &["--rtol"]);
    refused(&rollout(&start, &["--method", "euler"]), 2, &["euler", "dop853"]);
    let nowhere = text(&folder.path("missing/path.csv"));
    refused(
        &lnn(&["rollout", &model, "--state", &start, "--t-end", "0.1", "--dt", "0.1", "--out", &nowhere]),
        1,
        &[&nowhere],
    );
    refused(
        &lnn(&["rollout", &out, "--state", &start, "--t-end", "0.1", "--dt", "0.1", "--out", &out]),
        1,
        &["safetensors"],
    );

    let table = said_by(&lnn(&["evaluate", &model, "--starts", "2"]));
    assert!(table.contains("accelerations") && table.contains("report.html"));
    let json = said_by(&lnn(&["evaluate", &model, "--overwrite", "--starts", "2", "--json"]));
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["trajectories"].as_array().unwrap().len(), 2);
    assert!(folder.path("run/evaluation/lagrangian.svg").is_file());
    assert!(json["trajectories"][0]["conserved_error"].is_null());
    let evaluate =
        |more: &[&str]| lnn(&[&["evaluate", &model, "--overwrite", "--starts", "2", "--json"], more].concat());
    let (near, still) = (["--positions", "1:1.5,0.03:0.03"], ["--velocities", "0:0"]);
    let json = said_by(&evaluate(&[&near[..], &still, &["--until", "0.05", "--rtol", "1e-9"]].concat()));
    let json: Value = serde_json::from_str(&json).unwrap();
    for start in json["trajectories"].as_array().unwrap() {
        let numbers =
            |key: &str| start[key].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<_>>();
        let (q, v) = (numbers("q"), numbers("v"));
        assert!((1.0..=1.5).contains(&q[0]) && q[1] == 0.03 && v == [0.0, 0.0], "{start}");
        assert!((start["compared_until"].as_f64().unwrap() - 0.05).abs() < 1e-9, "{start}");
        assert!(start["lyapunov_exponent"].is_number() && start["velocity_error"].as_array().unwrap().len() == 2);
    }
    // Faster than the model was trained for.
    let fast = format!("{}:{0}", 3.0 * header.velocity[0][1]);
    let table = said_by(&lnn(&["evaluate", &model, "--overwrite", "--velocities", &fast, "--until", "0.1"]));
    let left = format!("{} outside the training range at 0.0", header.columns[2]);
    assert!(joined(&table).contains(&left), "{table}");
    refused(&evaluate(&["--positions", "0:1,0:1,0:1"]), 2, &["--positions: expected 1 or 2 pairs LOW:HIGH, found 3"]);
    refused(&evaluate(&["--velocities", "1:0"]), 2, &["--velocities", "LOW:HIGH"]);
    refused(&evaluate(&["--until", "0"]), 2, &["--until"]);
    refused(&evaluate(&["--until", "1e12"]), 1, &["the evaluation takes about"]);
    refused(&evaluate(&["--rtol", "nan"]), 2, &["--rtol"]);
    refused(&lnn(&["evaluate", &model, "--starts", "0"]), 2, &["--starts"]);
    refused(&lnn(&["evaluate", &text(&folder.path("none"))]), 1, &["no such file"]);
}

#[test]
fn a_relativistic_model_knows_the_range_of_the_imposed_velocity() {
    let folder = Folder::new();
    let printed = folder.train("ads4-geodesic", "run", &["--epochs", "1"]);
    assert!(printed.contains("until [m]"));
    let model = text(&folder.path("run/model.safetensors"));
    let header = ModelFile::<f64>::load(Path::new(&model)).unwrap().header;
    // x_dot, y_dot, z_dot and z at their bounds give 6.62; three quarters of the states are slowed down, half of them reversed.
    let [low, high] = header.velocity[0];
    assert!((-6.63..-1.0).contains(&low) && (1.0..6.63).contains(&high), "{low} {high}");
    assert_eq!(header.velocity[1], [-1.0, 1.0]);
    assert!((header.architecture.scale[0] - high.max(5.0)).abs() < 1e-6 * high);

    let out = text(&folder.path("path.csv"));
    let rollout = |state: &str| {
        let options = ["--t-end", "0.0002", "--dt", "0.0001", "--out", &out, "--overwrite"];
        lnn(&[&["rollout", &model, "--state", state], &options[..]].concat())
    };
    let inside = 0.5 * high;
    assert!(said_by(&rollout(&format!("0,0,0,3,{inside},0,0,0"))).contains(" m, "));
    refused(&rollout("0,0,0,3,6.7,0,0,0"), 1, &["training range", "t_dot"]);
    let json = said_by(&lnn(&["evaluate", &model, "--overwrite", "--starts", "2", "--json"]));
    let json: Value = serde_json::from_str(&json).unwrap();
    for start in json["trajectories"].as_array().unwrap() {
        let number = |key: &str, k: usize| start[key][k].as_f64().unwrap();
        let square: f64 = (1..4).map(|k| number("v", k).powi(2)).sum::<f64>() + number("q", 3).powi(2);
        assert!((number("v", 0) - square.sqrt()).abs() < 1e-14 && number("q", 0) == 0.0);
        assert!(start["conserved_error"]["max"].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn wrong_trainings_are_refused_before_anything_is_written() {
    let folder = Folder::new();
    let out = text(&folder.path("out"));
    let train = |arguments: &[&str]| lnn(&[&["train", "--out", &out], arguments].concat());
    refused(&train(&["duoble-pendulum"]), 2, &["duoble-pendulum", "double-pendulum"]);
    refused(&train(&[]), 2, &["SYSTEM"]);
    for (flag, values) in [
        ("--epochs", ["0", "-1", "1.5"]),
        ("--threads", ["0", "-2", "x"]),
        ("--seed", ["-1", "1e3", "x"]),
        ("--precision", ["f16", "dd", "64"]),
        ("--preset", ["slow", "", "Quick"]),
    ] {
        for value in values {
            refused(&train(&["double-pendulum", flag, value]), 2, &[flag]);
        }
    }
    refused(&train(&["double-pendulum", "--param", "m9=1"]), 2, &["m9"]);
    refused(&train(&["n-pendulum", "--preset", "paper"]), 2, &["paper", "n-pendulum"]);
    refused(&train(&["double-pendulum", "--config", &text(&folder.path("no.toml"))]), 1, &["no.toml: no such file"]);

    let good = toml::to_string(&small("double-pendulum")).unwrap();
    let with = |old: &str, new: &str, parts: &[&str]| {
        assert!(good.contains(old), "{old} is not in {good}");
        let path = folder.path("bad.toml");
        fs::write(&path, good.replacen(old, new, 1)).unwrap();
        refused(&train(&["--config", &text(&path)]), 2, &[&["bad.toml"], parts].concat());
    };
    with("epochs = 3", "epcohs = 3", &["epcohs", "epochs"]);
    with("epochs = 3", "epochs = 0", &["phase[0].epochs"]);
    with("epochs = 3", "epochs = \"many\"", &["phase[0].epochs", "found \"many\""]);
    with("seed = 0", "seed = 0\nseed = 1", &["duplicate"]);
    with("rate = 0.005", "rate = nan", &["phase[0].rate", "NaN"]);
    with("rate = 0.005", "rate = 0.0", &["phase[0].rate"]);
    with("batch = 128", "batch = 0", &["optimizer.batch"]);
    with("hidden = [16, 16]", "hidden = []", &["network.hidden"]);
    with("activation = \"gelu\"", "activation = \"gelo\"", &["gelo", "gelu"]);
    with("activation = \"gelu\"", "activation = \"identity\"", &["network.activation", "identity"]);
    with("input_layer = \"none\"", "input_layer = \"dty\"", &["dty", "dyt"]);
    let odd = "hidden = [16, 15]\nactivation = \"quadratic-softplus\"";
    with("hidden = [16, 16]\nactivation = \"gelu\"", odd, &["network.hidden[1]", "even", "15"]);
    // A mistake that concerns many keys is a line for each of them.
    let path = folder.path("bad.toml");
    fs::write(&path, good.replacen("double-pendulum", "triple-pendulum", 1)).unwrap();
    let other = train(&["--config", &text(&path)]);
    let stderr = String::from_utf8_lossy(&other.stderr);
    assert_eq!(other.status.code(), Some(2), "{stderr}");
    let fields = ["data.validation_position", "data.validation_velocity", "phase[0].position", "phase[0].velocity"];
    assert_eq!(stderr.lines().count(), fields.len(), "{stderr}");
    for (line, field) in stderr.lines().zip(fields) {
        assert!(line.starts_with("error: ") && line.contains("bad.toml:") && line.contains(field), "{line}");
        assert!(line.ends_with("one [low, high] per coordinate, found 2 for 3"), "{line}");
    }
    let config = folder.config(&small("double-pendulum"));
    refused(&train(&["spring-pendulum", "--config", &config]), 2, &["double-pendulum", "spring-pendulum"]);
    assert!(!folder.path("out").exists());
}

#[cfg(unix)]
#[test]
fn directories_that_cannot_be_written_are_named_before_training() {
    let folder = Folder::new();
    let config = folder.config(&small("double-pendulum"));
    let file = text(&folder.path("small.toml"));
    refused(&lnn(&["train", "--config", &config, "--out", &file]), 1, &["small.toml"]);
    refused(&lnn(&["train", "--config", &config, "--out", "/proc/lnn"]), 1, &["/proc/lnn"]);
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_the_best_model() {
    let folder = Folder::new();
    let mut long = small("double-pendulum");
    long.phases[0].epochs = 1_000_000;
    let (config, out) = (folder.config(&long), text(&folder.path("out")));
    let child = Command::new(env!("CARGO_BIN_EXE_lnn"))
        .args(["train", "--config", &config, "--out", &out, "--checkpoint-every", "1"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let second = lnn_when_locked(&config, &folder.path("out"));
    refused(&second, 1, &["another run"]);
    // The second checkpoint is written when an epoch has ended.
    crate::running::wait_for(&folder.path("out/checkpoint.previous.safetensors"));
    let signalled = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(signalled.success());
    let output = child.wait_with_output().unwrap();
    refused(&output, 130, &["interrupted", "is in"]);
    let model = ModelFile::<f32>::load(&folder.path("out/model.safetensors")).unwrap();
    assert!(model.header.validation_loss.is_finite());
    assert!(folder.path("out/report.html").is_file());
}

/// A second run into a directory, once the first has taken it.
#[cfg(unix)]
fn lnn_when_locked(config: &str, out: &Path) -> Output {
    // The file says who has locked it once it is locked.
    let locked = || std::fs::metadata(out.join(".lnn.lock")).is_ok_and(|file| file.len() > 0);
    crate::running::wait_until("the lock", locked);
    lnn(&["train", "--config", config, "--out", &text(out)])
}
