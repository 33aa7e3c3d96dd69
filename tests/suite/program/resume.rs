//! Trainings that are stopped and gone on with, from outside.
#![cfg(unix)]

use lnn::configuration::Config;
use lnn::lagrangian::SystemInstance;
use lnn::presets::Preset;
use lnn::training::{LATEST, PREVIOUS};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

fn start(arguments: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lnn"));
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn lnn(arguments: &[&str]) -> Output {
    start(arguments).wait_with_output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The run failed with this code, its last line says all of `parts`, and the lines before it are notes.
fn refused(output: &Output, code: i32, parts: &[&str]) {
    let text = stderr(output);
    assert_eq!(output.status.code(), Some(code), "{text}");
    let (last, notes) = text.lines().collect::<Vec<_>>().split_last().map(|(l, n)| (l.to_string(), n.len())).unwrap();
    assert!(last.starts_with("error: ") && parts.iter().all(|part| last.contains(part)), "{last} lacks {parts:?}");
    assert_eq!(text.lines().filter(|line| line.starts_with("note: ")).count(), notes, "{text}");
}

fn succeeded(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", stderr(output));
    String::from_utf8(output.stdout.clone()).unwrap()
}

struct Folder(tempfile::TempDir);

impl Folder {
    /// With a configuration of so many epochs.
    fn new(epochs: usize) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        fs::write(folder.path("c.toml"), toml::to_string(&config(epochs)).unwrap()).unwrap();
        folder
    }
    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
    fn text(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_string()
    }
    fn train(&self, out: &str, more: &[&str]) -> Child {
        let (config, out) = (self.text("c.toml"), self.text(out));
        start(&[&["train", "--config", &config, "--out", &out], more].concat())
    }
    /// Trains into `out` and presses Ctrl-C after the first checkpoint.
    fn stopped(&self, out: &str) -> Output {
        let child = self.train(out, &[]);
        wait_for(&self.path(out).join(LATEST));
        std::thread::sleep(Duration::from_millis(100));
        interrupt(&child);
        child.wait_with_output().unwrap()
    }
    fn resume(&self, out: &str, more: &[&str]) -> Output {
        lnn(&[&["train", "--resume", &self.text(out)], more].concat())
    }
}

/// Epochs of a training that is interrupted early on.
const EPOCHS: usize = 400;

fn config(epochs: usize) -> Config {
    let mut config = Preset::Quick.config(&SystemInstance::named("double-pendulum", &[]).unwrap()).unwrap();
    (config.data.training, config.data.validation, config.data.test) = (4096, 128, 128);
    config.network.hidden = vec![16, 16];
    config.phases[0].epochs = epochs;
    config
}

fn wait_for(path: &Path) {
    for _ in 0..1000 {
        if path.exists() {
            return;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("{} does not come", path.display());
}

fn interrupt(child: &Child) {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
}

/// Model, history and summary without times.
fn result(directory: &Path) -> (Vec<u8>, Vec<String>, Value) {
    let read = |name: &str| fs::read(directory.join(name)).unwrap();
    let mut summary: Value = serde_json::from_slice(&read("summary.json")).unwrap();
    for key in ["wall_seconds", "training_seconds", "states_per_second"] {
        assert!(summary.as_object_mut().unwrap().remove(key).is_some());
    }
    let csv = String::from_utf8(read("history.csv")).unwrap();
    let history = csv.lines().map(|line| line.rsplit_once(',').unwrap().0.to_string()).collect();
    (read("model.safetensors"), history, summary)
}

#[test]
fn a_training_stopped_in_the_middle_comes_to_the_same_end() {
    // Some seconds, whatever the machine: far more than until the interruption.
    let folder = Folder::new(EPOCHS);
    succeeded(&folder.train("whole", &[]).wait_with_output().unwrap());
    let stopped = folder.stopped("stopped");
    let out = folder.text("stopped");
    refused(&stopped, 130, &["interrupted", &format!("continue with: lnn train --resume {out}")]);
    assert!(folder.path("stopped").join(LATEST).exists());

    // Another configuration is refused, and so is beginning anew on top of what is there.
    refused(&folder.resume("stopped", &["--seed", "5"]), 2, &["seed: 0 in the checkpoint, 5 requested"]);
    refused(
        &folder.resume("stopped", &["--epochs", "7"]),
        2,
        &["phase[0].epochs", &format!("{EPOCHS} in the checkpoint, 7 requested")],
    );
    refused(&folder.resume("stopped", &["--param", "m1=2"]), 2, &["parameters.m1"]);
    refused(&lnn(&["train", "spring-pendulum", "--resume", &out]), 2, &["system"]);
    refused(&folder.resume("stopped", &["--out", "x"]), 2, &["--resume"]);
    let anew = folder.train("stopped", &[]).wait_with_output().unwrap();
    refused(&anew, 1, &["unfinished", &format!("lnn train --resume {out}")]);

    // A damaged newest checkpoint: the one before serves, and a line says so.
    fs::write(folder.path("stopped").join(LATEST), b"damaged").unwrap();
    let resumed = folder.resume("stopped", &["--threads", "2"]);
    assert!(stderr(&resumed).starts_with("note: ") && stderr(&resumed).contains(PREVIOUS), "{}", stderr(&resumed));
    succeeded(&resumed);
    let threads = |mut result: (Vec<u8>, Vec<String>, Value)| {
        result.2["threads"] = Value::Null;
        result
    };
    assert!(threads(result(&folder.path("stopped"))) == threads(result(&folder.path("whole"))));
    assert!(!folder.path("stopped").join(LATEST).exists() && !folder.path("stopped").join(PREVIOUS).exists());

    // Finished: nothing is left to do.
    let before = fs::metadata(folder.path("stopped").join("summary.json")).unwrap().modified().unwrap();
    assert!(succeeded(&folder.resume("stopped", &[])).contains("has finished"));
    let json: Value = serde_json::from_str(&succeeded(&folder.resume("stopped", &["--json"]))).unwrap();
    assert_eq!(json["epochs"], EPOCHS);
    refused(&folder.resume("stopped", &["--seed", "5"]), 2, &["seed"]);
    assert_eq!(fs::metadata(folder.path("stopped").join("summary.json")).unwrap().modified().unwrap(), before);
}

#[test]
fn nothing_to_go_on_from_is_an_error() {
    let folder = Folder::new(1);
    refused(&folder.resume("none", &[]), 1, &["none", "no such directory"]);
    fs::create_dir(folder.path("empty")).unwrap();
    refused(&folder.resume("empty", &[]), 1, &["empty", "no checkpoint"]);
    fs::write(folder.path("empty").join(LATEST), b"x").unwrap();
    refused(&folder.resume("empty", &[]), 1, &["empty", LATEST, PREVIOUS]);
    for value in ["0", "-1", "0s", "1.5", "s", "nans", "1e999s"] {
        let output = folder.train("out", &["--checkpoint-every", value]).wait_with_output().unwrap();
        refused(&output, 2, &["--checkpoint-every"]);
    }
    assert!(!folder.path("out").exists() && !folder.path("none").exists());
}

#[test]
fn a_second_ctrl_c_ends_at_once() {
    let folder = Folder::new(1_000_000);
    let child = folder.train("out", &[]);
    wait_for(&folder.path("out").join(LATEST));
    interrupt(&child);
    std::thread::sleep(Duration::from_millis(50));
    // It may have ended by now.
    let _ = Command::new("kill").args(["-INT", &child.id().to_string()]).stderr(Stdio::null()).status();
    assert_eq!(child.wait_with_output().unwrap().status.code(), Some(130));
    // Nothing is lost by that: the checkpoint goes on.
    assert_eq!(lnn::training::saved(&lnn::storage::Disk, &folder.path("out")).unwrap().fallback, None);
}

#[test]
fn a_directory_has_one_run_and_outlives_a_dead_one() {
    let folder = Folder::new(1_000_000);
    let mut child = folder.train("out", &[]);
    let process = child.id();
    wait_for(&folder.path("out").join(LATEST));
    let second = folder.train("out", &[]).wait_with_output().unwrap();
    refused(&second, 1, &["another run", &format!("process {process} on ")]);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(folder.path("out/.lnn.lock").exists());
    // The lock went with the process; what it left is named.
    let third = folder.train("out", &[]).wait_with_output().unwrap();
    refused(&third, 1, &["unfinished"]);
    assert!(stderr(&third).contains(&format!("taken over from process {process}")), "{}", stderr(&third));
    assert!(!folder.path("out/.lnn.lock").exists());
}

#[test]
fn full_disks_and_lost_directories_are_named() {
    let folder = Folder::new(1);
    fs::create_dir(folder.path("out")).unwrap();
    if Path::new("/dev/full").exists() {
        std::os::unix::fs::symlink("/dev/full", folder.path("out/model.safetensors")).unwrap();
        let full = folder.train("out", &[]).wait_with_output().unwrap();
        refused(&full, 1, &["model.safetensors", "cannot write"]);
        // The training is not lost: with room on the disk it goes on to its end.
        fs::remove_file(folder.path("out/model.safetensors")).unwrap();
        succeeded(&folder.resume("out", &[]));
        succeeded(&folder.train("whole", &[]).wait_with_output().unwrap());
        assert!(result(&folder.path("out")) == result(&folder.path("whole")));

        let model = folder.text("out/model.safetensors");
        let motion = ["rollout", &model, "--state", "1,1,0,0", "--t-end", "0.02", "--dt", "0.01", "--out", "/dev/full"];
        refused(&lnn(&motion), 1, &["/dev/full"]);
        refused(&lnn(&["train", "double-pendulum", "--out", "/dev/full"]), 1, &["/dev/full"]);
    }
    // A directory that vanishes under a running training.
    let long = Folder::new(1_000_000);
    let child = long.train("gone", &[]);
    wait_for(&long.path("gone").join(LATEST));
    fs::rename(long.path("gone"), long.path("elsewhere")).unwrap();
    std::thread::sleep(Duration::from_millis(300));
    interrupt(&child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).lines().last().unwrap().contains("gone"), "{}", stderr(&output));
}

#[test]
fn work_that_does_not_fit_into_memory_is_refused() {
    let folder = Folder::new(1);
    let good = fs::read_to_string(folder.path("c.toml")).unwrap();
    let with = |old: &str, new: &str, code: i32, parts: &[&str]| {
        assert!(good.contains(old), "{old} is not in {good}");
        fs::write(folder.path("c.toml"), good.replacen(old, new, 1)).unwrap();
        refused(&folder.train("out", &[]).wait_with_output().unwrap(), code, parts);
    };
    with("hidden = [16, 16]", "hidden = [1000000, 16]", 2, &["network.hidden[0]"]);
    with("training = 4096", "training = 1000000000000", 2, &["data.training"]);
    with("batch = 128", "batch = 1000000000000", 2, &["optimizer.batch"]);
    if Path::new("/proc/meminfo").exists() {
        let widths = vec!["65536"; 64].join(", ");
        let parts = ["training takes about", " TB of memory", "are available"];
        with("hidden = [16, 16]", &format!("hidden = [{widths}]"), 1, &parts);
        let phase = &good[good.find("[[phase]]").unwrap()..];
        let many = format!("{}{}", good.replacen("training = 4096", "training = 1073741824", 1), phase.repeat(40));
        fs::write(folder.path("c.toml"), many).unwrap();
        refused(&folder.train("out", &[]).wait_with_output().unwrap(), 1, &parts);
        fs::write(folder.path("c.toml"), &good).unwrap();
        succeeded(&folder.train("run", &[]).wait_with_output().unwrap());
        let model = folder.text("run/model.safetensors");
        refused(
            &lnn(&["evaluate", &model, "--starts", "1000000", "--until", "1e5"]),
            1,
            &["the evaluation takes about"],
        );
    }
}
