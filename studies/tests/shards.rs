//! Processes with a share of an experiment each, killed at random moments and started again: the tables that are merged, and the
//! models, are those of a single process, to the last byte.
#![cfg(unix)]

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// An experiment whose report takes pictures of its runs over.
const NAME: &str = "training-range";
/// Shares, and processes at a time.
const SHARES: usize = 4;
/// Kills in all rounds together.
const KILLS: usize = 50;

/// A command about the runs in a directory.
fn experiment(before: &[&str], out: &Path, after: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lnn-studies"));
    command
        .arg("experiment")
        .args(before)
        .args([NAME, "--scale", "smoke", "--seeds", "4", "--out"])
        .arg(out)
        .args(after);
    command
}

fn succeed(mut command: Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Files of an experiment, without those of its runs.
fn tables(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(out.join(format!("{NAME}-smoke"))).unwrap().map(|entry| entry.unwrap());
    let files = entries.filter(|entry| entry.file_type().unwrap().is_file());
    files.map(|entry| (entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap())).collect()
}

/// Runs with their states.
fn states(out: &Path) -> BTreeMap<String, String> {
    let listed = succeed(experiment(&[], out, &["--list", "--json"]));
    let objects = listed.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let text = |object: &Value, key: &str| object[key].as_str().unwrap().to_string();
    objects.map(|object| (text(&object, "run"), text(&object, "state"))).collect()
}

/// Finishes all shares and kills at most so many processes on the way, each of which is started again; returns how many were killed,
/// and how many of these worked on a run.
fn survive(out: &Path, kills: usize, random: &mut ChaCha8Rng) -> (usize, usize) {
    let start = |share: usize| -> Child {
        let share = format!("{share}/{SHARES}");
        let mut command = experiment(&[], out, &["--threads", "1", "--shard", &share]);
        command.stdout(Stdio::null()).stderr(Stdio::inherit()).spawn().unwrap()
    };
    let mut running: Vec<(usize, Child)> = (1..=SHARES).map(|share| (share, start(share))).collect();
    let (mut killed, mut at_work) = (0, 0);
    while !running.is_empty() {
        std::thread::sleep(Duration::from_secs_f64(random.random_range(0.0..0.3)));
        if killed < kills {
            let victim = random.random_range(0..running.len());
            let (share, child) = &mut running[victim];
            // SIGKILL.
            child.kill().unwrap();
            if !child.wait().unwrap().success() {
                at_work += usize::from(states(out).values().any(|state| state == "open"));
                *child = start(*share);
                killed += 1;
            }
        }
        running.retain_mut(|(share, child)| match child.try_wait().unwrap() {
            None => true,
            Some(status) => {
                assert!(status.success(), "share {share}: {status}");
                false
            }
        });
    }
    assert!(states(out).values().all(|state| state == "finished"));
    (killed, at_work)
}

#[test]
fn shares_are_killed_and_started_again() {
    let folder = tempfile::tempdir().unwrap();
    let alone = folder.path().join("alone");
    succeed(experiment(&[], &alone, &["--threads", "2"]));
    let expected = tables(&alone);
    assert!(expected.contains_key("table.csv") && expected.contains_key("report.html") && expected.len() > 3);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let (mut killed, mut at_work, mut round) = (0, 0, 0);
    // As many rounds as it takes.
    while killed < KILLS {
        round += 1;
        let out = folder.path().join(format!("round {round}"));
        let (more, of_these) = survive(&out, KILLS - killed, &mut random);
        (killed, at_work) = (killed + more, at_work + of_these);
        for _ in 0..2 {
            succeed(experiment(&["merge"], &out, &[]));
            let merged = tables(&out);
            assert!(merged.keys().eq(expected.keys()), "{:?}", merged.keys());
            for (name, bytes) in &merged {
                assert!(*bytes == expected[name], "{name} differs in round {round}");
            }
        }
        for run in states(&out).keys() {
            let model = |out: &Path| fs::read(out.join(format!("{NAME}-smoke/{run}/model.safetensors"))).unwrap();
            assert!(model(&out) == model(&alone), "the models of {run} differ");
        }
    }
    assert!(at_work >= KILLS / 5, "only {at_work} of {killed} kills came before all runs were finished");
}
