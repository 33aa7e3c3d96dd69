//! The program killed at random moments: at most one interval is lost, and the end is the same to the last byte.
#![cfg(unix)]

use lnn::configuration::Config;
use lnn::lagrangian::SystemInstance;
use lnn::presets::Preset;
use lnn::storage::Disk;
use lnn::training::{LATEST, PREVIOUS, saved};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn config() -> Config {
    let mut config = Preset::Quick.config(&SystemInstance::named("harmonic-oscillator", &[]).unwrap()).unwrap();
    (config.data.training, config.data.validation, config.data.test) = (1024, 64, 64);
    // The program writes out every parameter.
    config.parameters = [("k".to_string(), 1.0), ("m".to_string(), 1.0)].into();
    config.network.hidden = vec![16];
    config.optimizer.batch = 64;
    config.phases[0].epochs = 40;
    config
}

fn lnn(arguments: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lnn"));
    command.env("LNN_LOG", "info").args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn succeed(arguments: &[&str]) {
    let output = lnn(arguments).wait_with_output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Columns of the histories but the last, the time.
fn history(directory: &Path) -> String {
    let shooting = fs::read_to_string(directory.join("shooting.csv")).unwrap_or_default();
    let csv = fs::read_to_string(directory.join("history.csv")).unwrap() + &shooting;
    csv.lines().map(|line| format!("{}\n", line.rsplit_once(',').unwrap().0)).collect()
}

/// The summary without its times.
fn summary(directory: &Path) -> Value {
    let mut summary: Value = serde_json::from_slice(&fs::read(directory.join("summary.json")).unwrap()).unwrap();
    for key in ["wall_seconds", "training_seconds", "states_per_second"] {
        // A fit does not count its states.
        assert!(summary.as_object_mut().unwrap().remove(key).is_some() || key == "states_per_second");
    }
    summary
}

/// The last epoch that the log on standard error names.
fn last_epoch(log: &str) -> Option<usize> {
    let mut numbers =
        log.lines().filter_map(|line| line.split("epoch=").nth(1)?.split_whitespace().next()?.parse().ok());
    numbers.next_back()
}

/// A run to kill: what is started in a folder, and what its checkpoint says of its configuration.
struct Case {
    verb: &'static str,
    start: fn(&Path) -> Vec<String>,
    configuration: Option<fn() -> String>,
}

/// A training by a configuration in the folder.
const TRAIN: Case = Case {
    verb: "train",
    start: |folder| {
        let file = folder.join("c.toml");
        fs::write(&file, toml::to_string(&config()).unwrap()).unwrap();
        ["--config", file.to_str().unwrap()].map(String::from).to_vec()
    },
    configuration: Some(|| toml::to_string(&config()).unwrap()),
};

/// A fit of made swings, on accelerations and then through the motion.
const FIT: Case = Case {
    verb: "fit",
    start: |folder| {
        let file = folder.join("swings.csv");
        let rows = (0..4).flat_map(|run| (0..120).map(move |k| (run, 0.02 * f64::from(k))));
        let line = |(run, t): (i32, f64)| {
            let (size, rate) = (0.4 + 0.1 * f64::from(run), 3.0 + 0.2 * f64::from(run));
            format!("{run},{t},{}\n", size * (rate * t).cos() + 1e-3 * (1e3 * t).sin())
        };
        fs::write(&file, "run,t,x\n".to_string() + &rows.map(line).collect::<String>()).unwrap();
        let file = file.to_str().unwrap();
        let fit = [file, "--coords", "x", "--trajectory", "run", "--hidden", "8,8", "--targets", "motion"];
        fit.into_iter().chain(["--epochs", "30", "--shooting-epochs", "30"]).map(String::from).collect()
    },
    configuration: None,
};

/// Kills a run `kills` times, always goes on with it, and compares the end with a run that was left alone.
fn survive(case: &Case, kills: usize, seed: u64) {
    let folder = tempfile::tempdir().unwrap();
    let text = |path: &Path| path.to_str().unwrap().to_string();
    let (alone, killed) = (folder.path().join("alone"), folder.path().join("killed"));
    let begin = [case.verb, "--threads", "1", "--checkpoint-every", "1"].map(String::from);
    let given = (case.start)(folder.path());
    let start =
        |out: &Path| [&begin[..], &given, &["--overwrite".to_string(), "--out".to_string(), text(out)]].concat();
    let resume = |out: &Path| [&begin[..], &["--resume".to_string(), text(out)]].concat();
    let began = Instant::now();
    succeed(&start(&alone).iter().map(String::as_str).collect::<Vec<_>>());
    let span = began.elapsed();

    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut done, mut finished) = (0, 0);
    while done < kills {
        // From its beginning again when it has come to its end, so that every stretch of it is hit.
        let go_on = killed.join(LATEST).exists() || killed.join(PREVIOUS).exists();
        let arguments = if go_on { resume(&killed) } else { start(&killed) };
        let mut child = lnn(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        std::thread::sleep(Duration::from_secs_f64(span.as_secs_f64() * random.random_range(0.0..0.6)));
        let ended = child.try_wait().unwrap();
        // SIGKILL.
        child.kill().unwrap();
        let output = child.wait_with_output().unwrap();
        let status = output.status;
        match ended {
            Some(status) => {
                assert!(status.success());
                compare(&killed, &alone);
                finished += 1;
            }
            None if status.success() => finished += 1,
            None => done += 1,
        }
        if killed.join(LATEST).exists() || killed.join(PREVIOUS).exists() {
            let found = saved(&Disk, &killed).unwrap().content;
            if let Some(configuration) = case.configuration {
                assert_eq!(found.config, configuration());
            }
            // The log names an epoch, counted from 0, before the checkpoint behind it is written.
            let log = last_epoch(&String::from_utf8_lossy(&output.stderr));
            assert!(found.epochs >= log.unwrap_or(0), "{found:?}, but epoch {log:?} had ended");
        }
    }
    if killed.join(LATEST).exists() || killed.join(PREVIOUS).exists() {
        succeed(&resume(&killed).iter().map(String::as_str).collect::<Vec<_>>());
    } else if finished == 0 || !killed.join("model.safetensors").exists() {
        succeed(&start(&killed).iter().map(String::as_str).collect::<Vec<_>>());
    }
    compare(&killed, &alone);
    let hidden =
        fs::read_dir(&killed).unwrap().filter(|e| e.as_ref().unwrap().file_name().to_str().unwrap().starts_with('.'));
    assert_eq!(hidden.count(), 0);
}

fn compare(killed: &Path, alone: &Path) {
    let model = |directory: &Path| fs::read(directory.join("model.safetensors")).unwrap();
    assert!(model(killed) == model(alone), "the models differ");
    assert_eq!(history(killed), history(alone));
    assert_eq!(summary(killed), summary(alone));
}

#[test]
fn twenty_kills() {
    survive(&TRAIN, 20, 1);
}

#[test]
fn ten_kills_of_a_fit() {
    survive(&FIT, 10, 3);
}

#[test]
#[ignore = "minutes"]
fn two_hundred_kills() {
    survive(&TRAIN, 200, 2);
    survive(&FIT, 200, 4);
}
