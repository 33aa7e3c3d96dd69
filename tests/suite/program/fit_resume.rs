//! Fits that are stopped and gone on with, from outside.
#![cfg(unix)]

use crate::program::fit::{COLUMNS, pendulum};
use crate::running::{Folder, command, lnn, text};
use lnn::training::{LATEST, PREVIOUS};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Everything that is the same for a fit that was never stopped.
fn result(directory: &Path) -> (Vec<u8>, Vec<String>, Value) {
    let read = |name: &str| fs::read(directory.join(name)).unwrap();
    let mut summary: Value = serde_json::from_slice(&read("summary.json")).unwrap();
    // Times, and the name of the file.
    for key in ["wall_seconds", "training_seconds", "held_out"] {
        assert!(summary.as_object_mut().unwrap().remove(key).is_some());
    }
    let histories =
        ["history.csv", "shooting.csv"].map(|name| fs::read_to_string(directory.join(name)).unwrap_or_default());
    let lines = histories.iter().flat_map(|csv| csv.lines()).map(|line| line.rsplit_once(',').unwrap().0.to_string());
    (read("model.safetensors"), lines.collect(), summary)
}

/// Runs a fit and ends it by SIGTERM as soon as `reached` says so of its log.
fn stopped(arguments: &[&str], reached: impl Fn(&str) -> bool, folder: &Folder) -> String {
    let log = folder.path("log");
    let stderr = fs::File::create(&log).unwrap();
    let mut command = command(arguments);
    let mut child = command.env("LNN_LOG", "info").stdout(Stdio::null()).stderr(stderr).spawn().unwrap();
    for _ in 0..6000 {
        if reached(&fs::read_to_string(&log).unwrap()) || child.try_wait().unwrap().is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let _ = Command::new("kill").args(["-TERM", &child.id().to_string()]).stderr(Stdio::null()).status();
    let status = child.wait().unwrap();
    let said = fs::read_to_string(&log).unwrap();
    assert_eq!(status.code(), Some(143), "{said}");
    said.lines().last().unwrap().to_string()
}

#[test]
fn a_fit_stopped_in_the_middle_comes_to_the_same_end() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", pendulum(6, true, 0.003));
    let fit = ["fit", &data, "--hidden", "16,16", "--targets", "motion", "--epochs", "40", "--shooting-epochs", "20"];
    let base = [&fit[..], &COLUMNS, &["--threads", "1"]].concat();
    let (whole, out) = (text(&folder.path("whole")), text(&folder.path("out")));
    lnn(&[&base[..], &["--out", &whole]].concat()).succeeded();

    // Once in the training on accelerations, once in multiple shooting.
    let epochs = |log: &str| log.matches(" epoch=").count();
    let last = stopped(&[&base[..], &["--out", &out]].concat(), |log| epochs(log) >= 5, &folder);
    let on = format!("continue with: lnn fit --resume {out}");
    assert!(last.contains("interrupted") && last.ends_with(&on), "{last}");
    assert!(folder.path("out/model.safetensors").is_file());
    lnn(&["train", "--resume", &out]).refused(1, &["this is a run of lnn fit, not of lnn train"]);
    let resume = |more: &[&str]| lnn(&[&["fit", "--resume", &out], more].concat());
    resume(&["--seed", "4"]).refused(2, &["--resume", "training.seed", "4 requested"]);
    resume(&["--out", &whole]).refused(2, &["--resume"]);
    let anew = lnn(&[&base[..], &["--out", &out]].concat());
    assert!(
        anew.code == Some(1)
            && anew.stderr.contains("unfinished")
            && anew.stderr.contains(&on["continue with: ".len()..]),
        "{}",
        anew.stderr
    );
    let shooting = |log: &str| log.contains("gap") && epochs(log) >= 5;
    // The whole command again says nothing else.
    let again = [&base[..], &["--resume", &out, "--checkpoint-every", "3"]].concat();
    let last = stopped(&again, shooting, &folder);
    assert!(last.ends_with(&on), "{last}");
    assert!(folder.path("out").join(LATEST).is_file());

    // Other data are refused, the same at another place are taken; a damaged checkpoint is not the end.
    let other = folder.file("other.csv", pendulum(6, true, 0.004));
    let refused = resume(&[&other]);
    assert!(refused.code == Some(1) && refused.stderr.contains("the checkpoint is of other"), "{}", refused.stderr);
    fs::rename(&data, folder.path("moved.csv")).unwrap();
    resume(&[]).refused(1, &["swings.csv", "no such file"]);
    fs::write(folder.path("out").join(LATEST), b"damaged").unwrap();
    let resumed = resume(&[&text(&folder.path("moved.csv")), "--threads", "1"]);
    resumed.succeeded();
    assert!(resumed.stderr.contains(PREVIOUS), "{}", resumed.stderr);
    assert!(result(&folder.path("out")) == result(&folder.path("whole")));
    assert!(!folder.path("out").join(LATEST).exists() && !folder.path("out").join(PREVIOUS).exists());
    let config = |run: &str| fs::read_to_string(folder.path(run).join("config.toml")).unwrap();
    assert_eq!(config("out").replace("moved.csv", "swings.csv"), config("whole"));

    // Finished: nothing is left to do.
    let done = resume(&[]);
    assert!(done.code == Some(0) && done.stdout.contains("has finished"), "{}{}", done.stdout, done.stderr);
    lnn(&["train", "--resume", &out]).refused(1, &["this is a run of lnn fit"]);
}

#[test]
fn arguments_of_a_fit_that_goes_on_are_checked() {
    let folder = Folder::new();
    let none = text(&folder.path("none"));
    lnn(&["fit", "--resume", &none]).refused(1, &["none", "no such directory"]);
    fs::create_dir(&none).unwrap();
    lnn(&["fit", "--resume", &none]).refused(1, &["no checkpoint"]);
    lnn(&["fit", "--resume", &none, "--overwrite"]).refused(2, &["--overwrite"]);
    lnn(&["fit", "--hidden", "4"]).refused(2, &["DATA"]);
    for value in ["0", "0s", "x"] {
        lnn(&["fit", "x.csv", "--coords", "x", "--checkpoint-every", value]).refused(2, &["--checkpoint-every"]);
    }
    assert_eq!(folder.names(), ["none"]);
}

#[test]
fn members_that_are_trained_are_not_trained_again() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", pendulum(6, true, 0.003));
    let fit = ["fit", &data, "--hidden", "16", "--epochs", "150", "--members", "4", "--targets", "smoothed"];
    let base = [&fit[..], &COLUMNS, &["--threads", "1"]].concat();
    let (whole, out) = (text(&folder.path("whole")), text(&folder.path("out")));
    lnn(&[&base[..], &["--out", &whole]].concat()).succeeded();
    let last = stopped(&[&base[..], &["--out", &out]].concat(), |log| log.contains("member 3 of 4"), &folder);
    let on = format!("continue with: lnn fit --resume {out}");
    assert!(last.contains("2 of 4 members are trained") && last.ends_with(&on), "{last}");
    let first = folder.path("out/member-1.safetensors");
    let written = || fs::metadata(&first).unwrap().modified().unwrap();
    let before = written();
    let run = lnn(&["fit", "--resume", &out, "--threads", "1"]);
    run.succeeded();
    assert!(run.stderr.contains("member 3 of 4") && !run.stderr.contains("member 2 of 4"), "{}", run.stderr);
    assert!(written() == before && result(&folder.path("out")) == result(&folder.path("whole")));
    let models = ["member-1.safetensors", "member-3.safetensors"];
    assert!(
        models.iter().all(|name| fs::read(folder.path("out").join(name)).unwrap()
            == fs::read(folder.path("whole").join(name)).unwrap())
    );
    assert!(!folder.path("out").join(LATEST).exists());
}
