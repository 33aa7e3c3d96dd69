//! `lnn rollout`: steps, long motions written as they go.
#![cfg(unix)]

use crate::running::{Folder, command, lnn, model, text};
use serde_json::Value;
use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A step longer than the time between samples is cut to it: the same motion by every method, in both directions.
#[test]
fn longer_steps_are_cut_to_the_samples() {
    let folder = Folder::new();
    let model = folder.file("m", model().to_bytes().unwrap());
    let out = text(&folder.path("out.csv"));
    for method in ["midpoint", "gauss4", "gauss6", "variational"] {
        for t_end in ["0.3", "-0.3"] {
            let motion = |step: &[&str]| {
                let base =
                    ["rollout", &model, "--state", "1,2,0.5,-0.5", "--t-end", t_end, "--dt", "0.1", "--method", method];
                let run = lnn(&[&base[..], &["--out", &out], step].concat());
                assert_eq!(run.code, Some(0), "{}", run.stderr);
                let csv = fs::read_to_string(&out).unwrap();
                fs::remove_file(&out).unwrap();
                (csv, run.stderr)
            };
            let (expected, silent) = motion(&[]);
            assert_eq!(silent, "");
            for step in ["1e14", "1e300", "0.2"] {
                let (csv, said) = motion(&["--step", step]);
                assert_eq!(csv, expected, "{method} {step}");
                assert!(said.starts_with("note: --step ") && said.contains("longer than --dt 0.1"), "{said}");
            }
        }
    }
}

/// Ctrl-C in the middle of a long motion keeps the samples so far and leaves nothing else.
#[test]
fn an_interrupted_motion_keeps_its_samples() {
    let folder = Folder::new();
    let model = folder.file("m", model().to_bytes().unwrap());
    let out = text(&folder.path("out.csv"));
    let arguments = ["rollout", &model, "--state", "1,2,0,0", "--t-end", "900", "--dt", "0.00001", "--out", &out];
    let child = command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // Until the temporary file has grown.
    let limit = Instant::now() + Duration::from_secs(60);
    let written = || {
        let entries = fs::read_dir(folder.0.path()).unwrap().map(|entry| entry.unwrap());
        let draft = entries.filter(|entry| entry.file_name().to_str().unwrap().ends_with(".tmp"));
        draft.map(|entry| entry.metadata().unwrap().len()).sum::<u64>()
    };
    while written() < 1 << 17 {
        assert!(Instant::now() < limit, "nothing is written");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.starts_with("error: interrupted at t = ") && said.contains("samples are in"), "{said}");
    let csv = fs::read_to_string(&out).unwrap();
    let (fields, last) = (csv.lines().next().unwrap().split(',').count(), csv.lines().last().unwrap());
    assert!(csv.ends_with('\n') && last.split(',').count() == fields && csv.lines().count() > 1000);
    assert_eq!(folder.names(), ["m", "out.csv"]);
}

/// The energy of a pendulum; along geodesics of a metric that depends on its time, where the energy changes, `g(v, v)`.
#[test]
fn a_motion_says_what_it_conserves() {
    let folder = Folder::new();
    let moved = |system: &str, state: &str, more: &[&str]| {
        let out = text(&folder.path("out.csv"));
        let base = ["rollout", "--system", system, "--state", state, "--t-end", "3", "--dt", "0.1", "--overwrite"];
        let run = lnn(&[&base[..], &["--out", &out], more].concat());
        run.succeeded();
        run.stdout
    };
    let facts = |system: &str, state: &str| serde_json::from_str::<Value>(&moved(system, state, &["--json"])).unwrap();
    let swinging = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/systems/pendulum.toml");
    let pendulum = facts(swinging, "0.5,0");
    assert_eq!((&pendulum["conserved"]["quantity"], &pendulum["time_unit"]), (&"energy".into(), &"s".into()));
    let universe = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/systems/expanding_universe.toml");
    // Slower than light, and light, at a(10) = 1.
    for (state, square) in [("10,0,0,0,1.25,0.75,0,0", -1.0), ("10,0,0,0,1,0.6,0.8,0", 0.0)] {
        let found = facts(universe, state);
        let kept = &found["conserved"];
        assert_eq!((&kept["quantity"], &found["time_unit"]), (&"g(v, v)".into(), &"Gyr".into()));
        assert!((kept["start"].as_f64().unwrap() - square).abs() < 1e-14, "{found}");
        assert!(kept["largest_change"].as_f64().unwrap() < 1e-5, "{found}");
        let said = moved(universe, state, &[]);
        assert!(said.contains("g(v, v)") && said.contains("tau = 3 Gyr") && !said.contains("energy"), "{said}");
    }
    // A metric in a file without units claims none.
    let file = fs::read_to_string(universe).unwrap().replace("time_unit = \"Gyr\"\n", "");
    let (plain, plot) = (folder.file("plain.toml", file), text(&folder.path("plot.svg")));
    let said = moved(&plain, "10,0,0,0,1.25,0.75,0,0", &["--plot", &plot]);
    assert!(said.contains("tau = 3,"), "{said}");
    let plot = fs::read_to_string(&plot).unwrap();
    assert!(plot.contains("affine parameter") && !plot.contains("[s]") && !plot.contains("time ["));
    // The terms of a state name it too, beside the energy.
    let states = folder.file("s.csv", "t,x,y,z,t_dot,x_dot,y_dot,z_dot\n10,0,0,0,1.25,0.75,0,0\n");
    let terms = lnn(&["inspect", "--system", universe, "--states", &states]).objects().remove(0);
    assert!((terms["g(v, v)"].as_f64().unwrap() + 1.0).abs() < 1e-14 && terms.get("energy").is_some(), "{terms}");
    let states = folder.file("p.csv", "theta,theta_dot\n0.5,0\n");
    let terms = lnn(&["inspect", "--system", swinging, "--states", &states]).objects().remove(0);
    assert!(terms.get("g(v, v)").is_none(), "{terms}");
}
