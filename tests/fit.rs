//! `lnn fit` from outside: recorded swings of a pendulum, learned by networks small enough for a test.
#![cfg(feature = "cli")]

mod common;

use common::program::{Folder, Run, lnn, text};
use lnn::lagrangian::{EulerLagrange, HandWritten, Lagrangian, MechanicsError, Request, Terms};
use lnn::network::file::ModelFile;
use lnn::rollout::{Method, Options, rollout};
use lnn::scalar::Real;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;

/// `L = v^2/2 + 9 cos q`: an angle from the downward vertical.
struct Pendulum;

impl Lagrangian for Pendulum {
    fn coordinates(&self) -> usize {
        1
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        v[0].sqr() * R::half() + R::from_f64(9.0) * q[0].cos()
    }
}

/// The pendulum with a friction `-v/2`.
struct Damped(HandWritten<Pendulum, f64>);

impl EulerLagrange<f64> for Damped {
    fn coordinates(&self) -> usize {
        1
    }
    fn conserves_energy(&self) -> bool {
        false
    }
    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        self.0.terms(q, v, request, terms)?;
        terms.acceleration.iter_mut().zip(v).for_each(|(a, v)| *a -= 0.5 * v);
        Ok(())
    }
}

/// Swings at 50 Hz over 3 s as a CSV, columns `run,t,angle,speed,push`, angles with a noise of `sigma`.
fn swings(runs: usize, damped: bool, sigma: f64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut csv = "run,t,angle,speed,push\n".to_string();
    let pendulum = HandWritten::new(Pendulum, vec![]);
    let model: Box<dyn EulerLagrange<f64>> = if damped { Box::new(Damped(pendulum)) } else { Box::new(pendulum) };
    for run in 0..runs {
        let start = [rng.random_range(-1.5..1.5), rng.random_range(-2.0..2.0)];
        let options = Options { method: Method::Dop853, ..Options::new(3.0, 0.02) };
        let motion = rollout(model.as_ref(), &start[..1], &start[1..], &options).complete().unwrap();
        let mut terms = Terms::default();
        model.terms(&motion.q, &motion.v, Request::ACCELERATION, &mut terms).unwrap();
        for k in 0..motion.len() {
            let noise: f64 = rng.sample(StandardNormal);
            let (q, v, a) = (motion.q[k] + sigma * noise, motion.v[k], terms.acceleration[k]);
            writeln!(csv, "{run},{},{q},{v},{a}", motion.t[k]).unwrap();
        }
    }
    csv
}

/// Learns by a small network.
fn fit(folder: &Folder, data: &str, out: &str, more: &[&str]) -> Run {
    let out = text(&folder.path(out));
    let base = ["fit", data, "--coords", "angle", "--trajectory", "run", "--periodic", "angle", "--out", &out];
    lnn(&[&base[..], &["--hidden", "24,24"], more].concat())
}

/// `summary.json` of a run that succeeded.
fn summary(folder: &Folder, run: &Run, out: &str) -> Value {
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    // Of one coordinate friction and Lagrangian are not told apart, which is said.
    assert!(run.stderr.lines().all(|line| line.starts_with("note: every motion of one coordinate")), "{}", run.stderr);
    serde_json::from_slice(&fs::read(folder.path(out).join("summary.json")).unwrap()).unwrap()
}

/// Median error at the largest distance in time, of the model and of a straight line.
fn errors(summary: &Value) -> (f64, f64) {
    let last = |name: &str| summary[name].as_array().unwrap().last().unwrap()["median"].as_f64().unwrap();
    (last("model"), last("constant_velocity"))
}

#[test]
fn recorded_positions_become_a_model_that_predicts() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", swings(12, false, 0.0));
    let run = fit(&folder, &data, "out", &["--epochs", "60"]);
    let found = summary(&folder, &run, "out");
    assert_eq!(found["targets"], "smoothed");
    let (model, straight) = errors(&found);
    assert!(model < 0.1 * straight, "{model} {straight}");
    assert_eq!(found["wrong_signature"], 0.0);
    assert!(run.stdout.contains("learned from smoothed accelerations") && run.stdout.contains("report: "));
    let mut names: Vec<_> =
        fs::read_dir(folder.path("out")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    for name in
        ["config.toml", "history.csv", "model.safetensors", "prediction_error.png", "report.html", "summary.json"]
    {
        assert!(names.iter().any(|n| n == name), "{name} is not in {names:?}");
    }
    // The model is one like any other, with the user's own names.
    let model = text(&folder.path("out/model.safetensors"));
    let header = ModelFile::<f64>::load(folder.path("out/model.safetensors").as_path()).unwrap().header;
    assert_eq!(
        (header.system.as_str(), header.columns),
        ("measured", vec!["angle".to_string(), "angle_dot".to_string()])
    );
    let states = folder.file("states.csv", "angle,angle_dot\n0.5,0.25\n");
    let terms = &lnn(&["inspect", "--model", &model, "--states", &states]).objects()[0];
    let a = terms["acceleration"][0].as_f64().unwrap();
    assert!((a + 9.0 * 0.5_f64.sin()).abs() < 0.5, "{a}");
    let csv = text(&folder.path("motion.csv"));
    let motion = lnn(&["rollout", &model, "--state", "0.5,0.25", "--t-end", "1", "--dt", "0.1", "--out", &csv]);
    assert_eq!((motion.code, motion.stderr.as_str()), (Some(0), ""));
    lnn(&["evaluate", &model]).refused(1, &["measured"]);
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", swings(6, true, 0.003));
    let more = ["--targets", "motion", "--friction", "4", "--epochs", "3", "--shooting-epochs", "2", "--threads"];
    let model = |threads: &str| {
        summary(&folder, &fit(&folder, &data, threads, &[&more[..], &[threads]].concat()), threads);
        fs::read(folder.path(threads).join("model.safetensors")).unwrap()
    };
    let one = model("1");
    assert!(one == model("2") && one == model("3"));
    assert!(folder.path("1/shooting.csv").exists());
}

#[test]
fn measured_accelerations_and_friction_are_learned() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", swings(12, true, 0.0));
    let all = ["--velocity", "speed", "--acceleration", "push", "--epochs", "60"];
    let with = fit(&folder, &data, "with", &[&all[..], &["--friction"]].concat());
    let with = summary(&folder, &with, "with");
    assert_eq!(with["targets"], "measured");
    assert!(with["test_loss"].as_f64().unwrap() < 0.05, "{}", with["test_loss"]);
    // Of one coordinate friction is not told apart from L, but it takes and never gives.
    assert!(with["energy"]["friction"].as_f64().unwrap() > 0.0, "{}", with["energy"]);
}

#[test]
fn what_cannot_be_learned_from_is_named() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", swings(2, false, 0.0));
    let refused = |more: &[&str], code, parts: &[&str]| fit(&folder, &data, "out", more).refused(code, parts);
    refused(&["--targets", "measured"], 2, &["no accelerations were given", "--acceleration"]);
    refused(&["--timelike", "time"], 2, &["--timelike time", "angle"]);
    refused(&["--hold-out", "1"], 2, &["--hold-out", "between 0 and 1"]);
    refused(&["--window", "8"], 1, &["window: expected an odd number"]);
    refused(&["--noise", "0.1,0.2"], 1, &["noise: expected 1 numbers"]);
    refused(&["--hidden", "0"], 2, &["--hidden"]);
    refused(&["--velocity", "sped"], 1, &["sped", "speed"]);
    let short = folder.file("short.csv", "t,angle\n0,1\n0.1,1.1\n0.2,1.2\n");
    lnn(&["fit", &short, "--coords", "angle"]).refused(1, &["short.csv"]);
    assert_eq!(folder.names(), ["short.csv", "swings.csv"]);
}

#[test]
fn the_commands_of_the_readme_run() {
    let folder = Folder::new();
    let readme = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let commands = readme.lines().filter_map(|line| line.strip_prefix("cargo run --release -- "));
    let commands: Vec<&str> = commands.filter(|c| c.starts_with("check ") || c.starts_with("fit ")).collect();
    assert_eq!(commands.len(), 2, "{commands:?}");
    let out = text(&folder.path("out"));
    for command in commands {
        let mut arguments: Vec<&str> = command.split_whitespace().collect();
        if arguments[0] == "fit" {
            arguments.extend(["--epochs", "2", "--shooting-epochs", "1", "--out", &out]);
        }
        let run = lnn(&arguments);
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""), "{command}");
        assert!(run.stdout.contains("theta2"), "{}", run.stdout);
    }
    assert!(folder.path("out/report.html").exists());
}
