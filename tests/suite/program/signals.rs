//! SIGTERM, as batch systems send it, and disks that fill up: what was learned is kept.
#![cfg(unix)]

use crate::running::{Folder, Run, command, lnn, text, wait_for, wait_until};
use lnn::lagrangian::SystemInstance;
use lnn::presets::Preset;
use lnn::storage::Disk;
use lnn::training::{LATEST, saved};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A training of so many epochs.
fn configuration(folder: &Folder, epochs: usize) -> String {
    let mut config = Preset::Quick.config(&SystemInstance::named("double-pendulum", &[]).unwrap()).unwrap();
    (config.data.training, config.data.validation, config.data.test) = (512, 64, 64);
    config.network.hidden = vec![8, 8];
    config.phases[0].epochs = epochs;
    folder.file("c.toml", toml::to_string(&config).unwrap())
}

fn start(arguments: &[&str]) -> Child {
    command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn send(signal: &str, child: &Child) {
    // The process may have ended by now.
    let _ = Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status().unwrap();
}

#[test]
fn a_batch_system_ends_a_training_with_everything_kept() {
    let folder = Folder::new();
    let (config, out) = (configuration(&folder, 1_000_000), folder.path("out"));
    let arguments = ["train", "--config", &config, "--out", &text(&out), "--checkpoint-every", "1"];
    let child = start(&arguments);
    wait_for(&out.join("checkpoint.previous.safetensors"));
    send("-TERM", &child);
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(143), "{stderr}");
    assert!(
        stderr.contains("interrupted, the best of") && stderr.contains("continue with: lnn train --resume "),
        "{stderr}"
    );
    assert!(out.join("model.safetensors").is_file() && out.join("report.html").is_file());
    assert!(saved(&Disk, &out).unwrap().content.epochs > 0);

    // A second signal ends at once, with its own exit code, and the checkpoint stays. A new checkpoint says that training goes on.
    let written = || out.join(LATEST).metadata().and_then(|data| data.modified()).ok();
    let before = written();
    let child = start(&["train", "--resume", &text(&out), "--checkpoint-every", "1"]);
    wait_until("a new checkpoint", || written().is_some_and(|now| Some(now) != before));
    send("-INT", &child);
    send("-TERM", &child);
    assert!(matches!(child.wait_with_output().unwrap().status.code(), Some(143 | 130)));
    // An end between two renames leaves the one before it.
    assert!(saved(&Disk, &out).unwrap().content.epochs > 0);
}

#[test]
fn a_motion_ends_with_the_samples_that_it_has() {
    let folder = Folder::new();
    let model = folder.file("m", crate::running::model().to_bytes().unwrap());
    let out_file = folder.path("out.csv");
    let out = text(&out_file);
    let state = ["--state", "1,1,0,0", "--t-end", "900", "--dt", "0.00001", "--beyond-range"];
    let child = start(&[&["rollout", &model, "--out", &out], &state[..]].concat());
    // Samples go into a temporary file beside the one asked for, a piece at a time.
    let begun = |entry: std::fs::DirEntry| {
        let samples = entry.file_name().to_string_lossy().starts_with(".out.csv");
        samples && entry.metadata().is_ok_and(|data| data.len() > 0)
    };
    let folder = out_file.parent().unwrap();
    wait_until("samples", || std::fs::read_dir(folder).unwrap().flatten().any(begun));
    send("-TERM", &child);
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(143), "{stderr}");
    assert!(stderr.contains("interrupted at t = "), "{stderr}");
    assert!(std::fs::read_to_string(&out).unwrap().lines().count() > 1);
}

#[test]
fn a_long_search_says_so_and_ends_at_once() {
    use std::io::{BufRead, BufReader};
    let mut child = start(&["symmetries", "--system", "triple-pendulum", "--basis", "trigonometric:8"]);
    let mut note = String::new();
    BufReader::new(child.stderr.as_mut().unwrap()).read_line(&mut note).unwrap();
    assert!(note.starts_with("note: ") && note.contains(" unknown coefficients at "), "{note}");
    send("-TERM", &child);
    assert_eq!(child.wait().unwrap().code(), Some(143));
}

/// Ends a command by a signal a second after its start, and gives its exit code, its words and the time that it took to end.
fn ended(child: Child, signal: &str) -> (Option<i32>, String, Duration) {
    std::thread::sleep(Duration::from_secs(1));
    send(signal, &child);
    let began = Instant::now();
    let output = child.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap(), began.elapsed())
}

/// `true` if the tests run under nohup: then the programs that they start ignore hangups too. Where the system does not tell, they leave hangups alone.
fn hangups_are_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_none_or(|mask| mask & 1 == 1)
}

/// Steps between two samples, pixels of a picture, boxes of a proof: every loop looks at its flag.
#[test]
fn every_loop_ends_soon_by_every_signal() {
    let folder = Folder::new();
    let (csv, png) = (text(&folder.path("r.csv")), text(&folder.path("s.png")));
    let state = vec!["0.5"; 40].join(",");
    let chain =
        ["rollout", "--system", "n-pendulum", "--param", "n=20", "--state", &state, "--out", &csv, "--overwrite"];
    let fixed = ["--method", "gauss6", "--t-end", "1", "--dt", "1", "--step", "1e-6"];
    let adaptive = ["--t-end", "1e6", "--dt", "1e6", "--rtol", "1e-13"];
    let shadow = ["shadow", "--system", "kerr-cartesian", "--width", "1200", "--threads", "1", "--out", &png];
    let certify = ["certify", "--system", "n-pendulum", "--seconds", "1000", "--boxes", "100000000", "--threads", "1"];
    for (signal, code) in [("-INT", 130), ("-TERM", 143), ("-HUP", 129)] {
        if signal == "-HUP" && hangups_are_ignored() {
            continue;
        }
        for (arguments, words) in [
            ([&chain[..], &fixed].concat(), "interrupted at t = "),
            ([&chain[..], &adaptive].concat(), "interrupted at t = "),
            (certify.to_vec(), ""),
        ] {
            let (found, stderr, took) = ended(start(&arguments), signal);
            assert_eq!(found, Some(code), "{arguments:?}: {stderr}");
            assert!(stderr.contains(words) && took < Duration::from_secs(3), "{arguments:?}, {took:?}: {stderr}");
        }
    }
    // The samples up to there are written, and the energy of each.
    let samples = std::fs::read_to_string(&csv).unwrap();
    assert!(samples.lines().count() == 2 && !samples.contains("NaN"), "{samples}");
    let (code, stderr, took) = ended(start(&shadow), "-TERM");
    assert!(code == Some(143) && took < Duration::from_secs(3), "{took:?}: {stderr}");
    assert!(stderr.contains("of 1440000 rays") && folder.path("s.png").is_file(), "{stderr}");
}

/// What a parent ignores stays ignored: nohup.
#[test]
fn an_ignored_hangup_ends_nothing() {
    let folder = Folder::new();
    let (state, csv) = (vec!["0.5"; 40].join(","), text(&folder.path("r.csv")));
    let rollout = ["rollout", "--system", "n-pendulum", "--param", "n=20", "--state", &state, "--out", &csv];
    let more = ["--t-end", "1e6", "--dt", "1e6", "--rtol", "1e-13"];
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' HUP; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_lnn")]).args(rollout).args(more);
    let mut child = shell.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(500));
    send("-HUP", &child);
    std::thread::sleep(Duration::from_millis(500));
    assert!(child.try_wait().unwrap().is_none());
    assert_eq!(ended(child, "-TERM").0, Some(143));
}

/// Files may grow to a certain size, as on a disk that is almost full: model, tables and page fit, the report with its pictures
/// does not.
#[test]
fn on_a_full_disk_pictures_are_lost_first() {
    let folder = Folder::new();
    let (config, out) = (configuration(&folder, 2), folder.path("out"));
    let script = "trap '' XFSZ; ulimit -f 200; exec \"$0\" \"$@\"";
    let mut shell = Command::new("sh");
    shell.args(["-c", script, env!("CARGO_BIN_EXE_lnn"), "train", "--config", &config, "--out", &text(&out)]);
    let run = Run::of(shell.env_remove("LNN_LOG"));
    run.refused(1, &["report.html: cannot write: ", "lnn train --resume "]);
    for name in ["model.safetensors", "config.toml", "history.csv", "summary.json", "captions.json"] {
        assert!(out.join(name).is_file(), "{name}");
    }
    assert!(!out.join("report.html").exists() && !out.join("lagrangian.svg").exists());
    // With room on the disk the rest comes.
    let resumed = lnn(&["train", "--resume", &text(&out)]);
    assert_eq!((resumed.code, resumed.stderr.as_str()), (Some(0), ""));
    assert!(out.join("report.html").is_file() && out.join("lagrangian.svg").is_file() && !out.join(LATEST).exists());
}

/// A certificate that is interrupted is what is proven by then.
#[cfg(target_os = "linux")]
#[test]
fn a_certificate_ends_with_what_is_proven() {
    let model = "examples/data/double_pendulum.safetensors";
    let child = start(&[
        "certify",
        "--model",
        model,
        "--seconds",
        "80000",
        "--boxes",
        "100000000",
        "--condition",
        "3",
        "--json",
    ]);
    let caught = || {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask >> 14 & 1 == 1)
    };
    wait_until("a handler of the signal", caught);
    // The handler stands before the search begins.
    std::thread::sleep(Duration::from_secs(1));
    send("-TERM", &child);
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(143), "{stderr}");
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let shares = ["certified", "refuted", "open"].map(|name| found[name].as_f64().unwrap());
    assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12 && shares[2] > 0.0, "{found}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
}

/// Searches of seconds and more: signs of life at once, an end within a second, and nothing written.
#[test]
fn searches_show_life_and_end_at_once() {
    use std::io::{BufRead, BufReader};
    let folder = Folder::new();
    let row = |k: u32| {
        let t = 0.01 * f64::from(k);
        let q = (0..7).map(|i| format!(",{}", ((1.0 + 0.37 * f64::from(i)) * t + f64::from(i)).sin()));
        format!("{t}{}\n", q.collect::<String>())
    };
    let data = folder.file("arm.csv", format!("t,q1,q2,q3,q4,q5,q6,q7\n{}", (0..6000).map(row).collect::<String>()));
    let arm = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/systems/seven_joints.toml");
    let out = text(&folder.path("found.toml"));
    let columns = ["--coords", "q1,q2,q3,q4,q5,q6,q7"];
    let identify = ["identify", &data, "--system", arm, "--targets", "motion", "--threads", "1", "--out", &out];
    let formula = ["formula", &data, "--basis", "polynomial:1", "--threads", "1", "--out", &out];
    for arguments in [&identify[..], &[&formula[..], &columns].concat()] {
        let began = Instant::now();
        let mut child = start(arguments);
        let mut line = String::new();
        let mut said = BufReader::new(child.stderr.take().unwrap());
        said.read_line(&mut line).unwrap();
        assert!(line.starts_with("progress: "), "{line}");
        // Smoothing takes its time where tests are compiled without optimisation.
        assert!(began.elapsed() < Duration::from_secs(8), "{:?}", began.elapsed());
        send("-INT", &child);
        let pressed = Instant::now();
        assert_eq!(child.wait().unwrap().code(), Some(130));
        assert!(pressed.elapsed() < Duration::from_secs(3), "{arguments:?}: {:?}", pressed.elapsed());
        let last = said.lines().last().unwrap().unwrap();
        assert!(last.starts_with("error: interrupted") && !folder.path("found.toml").exists(), "{last}");
    }
}
