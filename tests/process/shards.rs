//! Eight processes on one experiment, killed at random moments: no run is finished twice, none has two claimants at a time, and
//! the tables that are merged are those of a single process, to the last byte.
#![cfg(all(feature = "cli", unix))]

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// An experiment whose report takes pictures of its runs over.
const NAME: &str = "training-range";
/// Processes at a time.
const PROCESSES: usize = 8;

/// Arguments about the runs in a directory.
fn of_runs(out: &Path) -> Vec<String> {
    let out = out.to_str().unwrap();
    [NAME, "--scale", "smoke", "--seeds", "4", "--out", out].map(String::from).to_vec()
}

/// Words of a command, behind `lnn experiment`.
fn words(before: &[&str], out: &Path, after: &[&str]) -> Vec<String> {
    let own = |words: &[&str]| words.iter().map(|word| word.to_string()).collect::<Vec<_>>();
    [own(before), of_runs(out), own(after)].concat()
}

fn succeed(arguments: &[String]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_lnn")).arg("experiment").args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// A process under way, its log in a file.
struct Process {
    child: Child,
    log: PathBuf,
}

impl Process {
    fn start(arguments: &[String], log: PathBuf) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lnn"));
        command.arg("experiment").args(arguments).env("LNN_LOG", "lnn::pipeline::experiment=info");
        let child = command.stdout(Stdio::null()).stderr(File::create(&log).unwrap()).spawn().unwrap();
        Self { child, log }
    }

    /// What it did, given when it was killed, if it was.
    fn turns(&self, killed: Option<f64>) -> Vec<(String, Turn)> {
        turns(&fs::read_to_string(&self.log).unwrap(), killed)
    }
}

/// A time in which a process had the claim of a run.
#[derive(Debug)]
struct Turn {
    begin: f64,
    end: f64,
    finished: bool,
    killed: bool,
}

/// Turns by their runs, as a log tells them: `2026-01-31T12:00:00.5Z  INFO lnn::pipeline::experiment: claimed run="x"`.
fn turns(log: &str, killed: Option<f64>) -> Vec<(String, Turn)> {
    let mut turns: Vec<(String, Turn)> = Vec::new();
    for line in log.lines().filter(|line| line.contains("INFO")) {
        let (time, run) = (time(line), line.split("run=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap());
        if line.contains(": claimed ") {
            turns.push((run.to_string(), Turn { begin: time, end: f64::NAN, finished: false, killed: false }));
        } else {
            let (_, turn) = turns.iter_mut().rev().find(|(name, _)| name == run).expect("a turn begins with a claim");
            (turn.end, turn.finished) = (time, line.contains(": finished "));
        }
    }
    for (run, turn) in turns.iter_mut().filter(|(_, turn)| turn.end.is_nan()) {
        turn.end = killed.unwrap_or_else(|| panic!("{run}: the claim was neither finished nor left"));
        turn.killed = true;
    }
    turns
}

/// Seconds since 1970 of a line of a log.
fn time(line: &str) -> f64 {
    let number = |range: std::ops::Range<usize>| line[range].parse::<f64>().unwrap();
    let (year, month, day) = (number(0..4), number(5..7), number(8..10));
    // Fliegel & Van Flandern (1968), in years that begin in March.
    let (year, month) = if month > 2.0 { (year, month - 3.0) } else { (year - 1.0, month + 9.0) };
    let leaps = (year / 4.0).floor() - (year / 100.0).floor() + (year / 400.0).floor();
    let days = 365.0 * year + leaps + ((153.0 * month + 2.0) / 5.0).floor() + day - 719_469.0;
    let seconds: f64 = line[17..].split('Z').next().unwrap().parse().unwrap();
    86_400.0 * days + 3600.0 * number(11..13) + 60.0 * number(14..16) + seconds
}

fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64()
}

/// Files of an experiment, without those of its runs.
fn tables(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(out.join(format!("{NAME}-smoke"))).unwrap().map(|entry| entry.unwrap());
    let files = entries.filter(|entry| entry.file_type().unwrap().is_file());
    files.map(|entry| (entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap())).collect()
}

/// Runs with their states.
fn states(out: &Path) -> BTreeMap<String, String> {
    let listed = succeed(&words(&[], out, &["--list", "--json"]));
    let objects = listed.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let text = |object: &Value, key: &str| object[key].as_str().unwrap().to_string();
    objects.map(|object| (text(&object, "run"), text(&object, "state"))).collect()
}

/// Eight processes on one experiment: four of them have a share each, the others all of it. Kills at most so many; returns how
/// many were killed, and how many of these at work on a run.
fn survive(out: &Path, kills: usize, random: &mut ChaCha8Rng) -> (usize, usize) {
    fs::create_dir_all(out).unwrap();
    let arguments = |process: usize| {
        let share = format!("{}/{}", process + 1, PROCESSES / 2);
        let share: &[&str] = if process < PROCESSES / 2 { &["--shard", &share] } else { &[] };
        words(&[], out, &[&["--threads", "1", "--lease", "2"], share].concat())
    };
    let mut started = 0;
    let mut start = |process: usize| {
        started += 1;
        Process::start(&arguments(process), out.join(format!("{started}.log")))
    };
    let mut under_way: Vec<(usize, Process)> = (0..PROCESSES).map(|process| (process, start(process))).collect();
    let (mut done, mut found) = (0, Vec::new());
    while !under_way.is_empty() {
        std::thread::sleep(Duration::from_secs_f64(random.random_range(0.0..0.2)));
        let victim = random.random_range(0..under_way.len());
        if done < kills {
            let (process, victim) = &mut under_way[victim];
            let killed = now();
            // SIGKILL.
            victim.child.kill().unwrap();
            if !victim.child.wait().unwrap().success() {
                found.extend(victim.turns(Some(killed)));
                *victim = start(*process);
                done += 1;
            }
        }
        under_way.retain_mut(|(process, running)| match running.child.try_wait().unwrap() {
            None => true,
            Some(status) => {
                let log = || fs::read_to_string(&running.log).unwrap();
                assert!(status.success(), "process {process}: {}", log());
                found.extend(running.turns(None));
                false
            }
        });
    }

    let at_work = found.iter().filter(|(_, turn)| turn.killed).count();
    let mut by_run: BTreeMap<String, Vec<Turn>> = BTreeMap::new();
    found.into_iter().for_each(|(run, turn)| by_run.entry(run).or_default().push(turn));
    for (run, turns) in &mut by_run {
        turns.sort_by(|a, b| a.begin.total_cmp(&b.begin));
        assert!(turns.iter().filter(|turn| turn.finished).count() <= 1, "{run} was finished twice: {turns:?}");
        assert!(turns.windows(2).all(|pair| !pair[0].finished), "{run} was claimed when it was finished: {turns:?}");
        assert!(turns.windows(2).all(|pair| pair[1].begin >= pair[0].end), "{run}: two claimants: {turns:?}");
    }
    let states = states(out);
    assert!(states.values().all(|state| state == "finished"), "{states:?}");
    assert!(states.keys().eq(by_run.keys()), "{:?}", by_run.keys());
    (done, at_work)
}

#[test]
fn fifty_kills_of_eight_processes() {
    let folder = tempfile::tempdir().unwrap();
    let alone = folder.path().join("alone");
    succeed(&words(&[], &alone, &["--threads", "2"]));
    let expected = tables(&alone);
    assert!(expected.contains_key("table.csv") && expected.contains_key("report.html") && expected.len() > 3);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let (mut killed, mut at_work, mut round) = (0, 0, 0);
    // As many rounds as it takes.
    while killed < 50 {
        round += 1;
        let out = folder.path().join(format!("round {round}"));
        let (more, of_these) = survive(&out, 50 - killed, &mut random);
        (killed, at_work) = (killed + more, at_work + of_these);
        for _ in 0..2 {
            succeed(&words(&["merge"], &out, &[]));
            let merged = tables(&out);
            assert!(merged.keys().eq(expected.keys()), "{:?}", merged.keys());
            for (name, bytes) in &merged {
                assert!(*bytes == expected[name], "{name} differs in round {round}");
            }
        }
        println!("round {round}: {killed} kills so far, {at_work} at work on a run");
        for run in states(&out).keys() {
            let model = |out: &Path| fs::read(out.join(format!("{NAME}-smoke/{run}/model.safetensors"))).unwrap();
            assert!(model(&out) == model(&alone), "the models of {run} differ");
        }
    }
    assert!(at_work >= 10, "only {at_work} of {killed} kills hit a claimant at work");
}

#[test]
fn logs_are_understood() {
    let line = |time: &str, what: &str| format!("{time}Z  INFO lnn::pipeline::experiment: {what} run=\"a\"\n");
    let (first, last) = ("1970-01-02T00:01:00.500000", "2024-02-29T12:00:00.000000");
    let log = line(first, "claimed") + "note: no turn\n" + &line(last, "finished") + &line(last, "claimed");
    let turns = turns(&log, Some(2e9));
    let told: Vec<(f64, f64, bool)> = turns.iter().map(|(_, turn)| (turn.begin, turn.end, turn.finished)).collect();
    assert_eq!(told, [(86_460.5, 1_709_208_000.0, true), (1_709_208_000.0, 2e9, false)]);
}
