//! Systems with events: found by roll-outs, written, refused, and left alone by other commands.

use crate::running::{Folder, Run, lnn, text};

/// A ball that is thrown and bounces.
const BALL: &str = r#"name = "ball"
lagrangian = "m*(x_dot^2 + y_dot^2)/2 - m*g*y"
[[coordinates]]
name = "x"
bounds = [-2, 10]
velocity_bounds = [-3, 3]
[[coordinates]]
name = "y"
bounds = [0, 2]
velocity_bounds = [-5, 5]
[parameters]
m = { default = 2, learn = true }
g = 9.81
e = 0.8
[events]
ground = { when = "y", falling = true, then = { restitution = "e" } }
apex = { when = "y_dot", falling = true }
net = { when = "x - 1.995", rising = true, then = "stop" }
"#;

/// `lnn rollout` of a system into a file, with options between blanks.
fn motion((system, out): (&str, &str), options: &str) -> Run {
    let line = format!("rollout --system {system} --out {out} --overwrite {options}");
    lnn(&line.split(' ').collect::<Vec<_>>())
}

#[test]
fn a_ball_bounces_until_it_reaches_the_net() {
    let folder = Folder::new();
    let (system, out) = (folder.file("ball.toml", BALL), text(&folder.path("motion.csv")));
    let events = text(&folder.path("events.csv"));
    let run = motion((&system, &out), &format!("--state 0,1,1,0 --t-end 3 --dt 0.01 --events {events}"));
    assert_eq!((run.code, run.stdout.contains("201 samples to t = 1.99")), (Some(0), true), "{}", run.stdout);
    assert!(run.stdout.contains("impacts removed") && run.stdout.contains("energy_lost"), "{}", run.stdout);
    let csv = std::fs::read_to_string(&events).unwrap();
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("event,t,x,y,x_dot,y_dot,energy_before,energy_after,energy_lost"));
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let fall = (2.0f64 / 9.81).sqrt();
    let number = |row: usize, column: usize| rows[row][column].parse::<f64>().unwrap();
    assert_eq!((rows[0][0], rows[1][0], rows.last().unwrap()[0]), ("\"ground\"", "\"apex\"", "\"net\""));
    assert!((number(0, 1) - fall).abs() < 1e-10 && (number(1, 1) - 1.8 * fall).abs() < 1e-10);
    assert!((number(0, 8) - 0.36 * 2.0 * 9.81).abs() < 1e-9 && rows[1][8].is_empty());
    // The samples keep their times, and the last one is at the net.
    let samples = std::fs::read_to_string(&out).unwrap();
    assert_eq!(samples.lines().count(), 202);
    assert!(
        samples.lines().nth(51).unwrap().starts_with("0.5,") && samples.lines().last().unwrap().starts_with("1.99")
    );
    let run = motion((&system, &out), "--state 0,1,1,0 --t-end 3 --dt 0.01 --json");
    let found: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    let lost: f64 = found["events"].as_array().unwrap().iter().filter_map(|event| event["energy_lost"].as_f64()).sum();
    assert!(
        (found["impacts"].as_f64().unwrap() - lost).abs() < 1e-9
            && (found["t_end"].as_f64().unwrap() - 1.995).abs() < 1e-12
    );
    assert!(found["energy_defect"].as_f64().unwrap().abs() < 1e-8, "{}", run.stdout);
}

#[test]
fn bounces_that_accumulate_end_the_motion_and_the_samples_are_kept() {
    let folder = Folder::new();
    let (system, out) = (folder.file("ball.toml", BALL), text(&folder.path("motion.csv")));
    let run = motion((&system, &out), "--state 0,1,0,0 --t-end 10 --dt 0.1 --param e=0.5");
    assert_eq!(run.code, Some(1));
    assert!(run.stderr.contains("event `ground`") && run.stderr.contains("accumulate at t = 1.35"), "{}", run.stderr);
    assert!(run.stdout.contains("energy_lost"), "{}", run.stdout);
    assert_eq!(std::fs::read_to_string(&out).unwrap().lines().count(), 15);
    let run = motion((&system, &out), "--state 0,1,0,0 --t-end 10 --dt 0.1 --param e=1.5");
    run.refused(1, &["ground", "from 0 to 1, found 1.5"]);
    motion((&system, &out), "--state 0,1,1,0 --t-end 1 --dt 0.1 --charges").refused(2, &["--charges", "impacts"]);
}

#[test]
fn mistakes_are_placed_and_other_commands_leave_events_alone() {
    let folder = Folder::new();
    let out = text(&folder.path("motion.csv"));
    for (old, new, parts) in [
        ("when = \"y\"", "when = \"z\"", &[":16: events.ground.when", "\"z\""][..]),
        ("when = \"y\"", "when = \"y + y_dot\"", &[":16: events.ground.when", "velocity"]),
        (
            "restitution = \"e\"",
            "restitution = 1.2",
            &[":16: events.ground.then.restitution", "from 0 to 1, found 1.2"],
        ),
        ("e = 0.8", "e = 1.7", &[":16: events.ground.then.restitution", "found 1.7"]),
        ("restitution = \"e\"", "restitutoin = 1", &[":16: events.ground.then", "restitutoin"]),
        ("then = \"stop\"", "then = \"stpo\"", &[":18: events.net.then", "stpo", "`mark` or `stop`"]),
        ("then = \"stop\"", "then = 3", &[":18: events.net.then", "\"mark\", \"stop\""]),
        ("then = \"stop\"", "after = 0", &[":18: events.net.after", "at least 1"]),
        ("rising = true", "risnig = true", &[":18: events.net", "risnig"]),
    ] {
        assert!(BALL.contains(old));
        let system = folder.file("wrong.toml", BALL.replacen(old, new, 1));
        motion((&system, &out), "--state 0,1,1,0 --t-end 1 --dt 0.1").refused(2, parts);
    }
    let system = folder.file("ball.toml", BALL);
    let states = folder.file("states.csv", "x,y,x_dot,y_dot\n0,1,1,0\n");
    let run = lnn(&["inspect", "--system", &system, "--states", &states]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let plain = BALL.split("[events]").next().unwrap();
    let plain = folder.file("plain.toml", plain);
    motion((&plain, &out), &format!("--state 0,1,1,0 --t-end 0.3 --dt 0.01 --events {out}.events"))
        .refused(2, &["--events"]);
    let run = motion((&plain, &out), "--state 0,1,1,0 --t-end 0.3 --dt 0.01");
    assert!(run.code == Some(0) && !run.stdout.contains("event"), "{}", run.stdout);
    let directory = text(&folder.path("run"));
    let run = lnn(&["train", &system, "--epochs", "1", "--out", &directory]);
    assert!(run.code == Some(0) && run.stderr.contains("impacts (`ground`) are not learned"), "{}", run.stderr);
    let run = lnn(&["identify", &out, "--system", &system, "--json"]);
    assert!(run.stderr.contains("impacts (`ground`) are not learned"), "{}", run.stderr);
    // A model has the events of the system that it learned.
    let line = format!("rollout {directory} --state 0,1,1,0 --t-end 1 --dt 0.1 --beyond-range --out {out} --overwrite");
    let run = lnn(&line.split(' ').collect::<Vec<_>>());
    assert!(run.stdout.contains("event"), "{} {}", run.stdout, run.stderr);
}
