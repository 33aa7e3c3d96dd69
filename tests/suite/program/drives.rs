//! `lnn formula` of systems with a periodic drive, and with friction that depends on the position.

use crate::running::{Folder, lnn, text};
use lnn::random::RngStream;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;
use std::fmt::Write as _;

/// A double well with friction and a drive, `x'' + 0.2 x' - x + x^3 = 0.3 cos(1.2 t)`, and van der Pol's oscillator.
const DUFFING: &str = r#"
name = "duffing"
lagrangian = "x_dot^2/2 + x^2/2 - x^4/4 + 0.3*x*cos(om*t)"
dissipation = "0.1*x_dot^2"
[[coordinates]]
name = "x"
bounds = [-2, 2]
velocity_bounds = [-2, 2]
[parameters]
om = 1.2
"#;
const CYCLE: &str = r#"
name = "cycle"
lagrangian = "x_dot^2/2 - 2*x^2"
dissipation = "-0.3*(1 - x^2)*x_dot^2"
[[coordinates]]
name = "x"
bounds = [-2, 2]
velocity_bounds = [-4, 4]
"#;

/// Positions of a system from some states, with a noise of 1e-3.
fn recorded(folder: &Folder, system: &str, states: &[&str], until: &str) -> String {
    let mut rng = RngStream::Trajectories.generator(5);
    let mut csv = "run,t,x\n".to_string();
    for (run, state) in states.iter().enumerate() {
        let rolled = ["rollout", "--system", system, "--state", state, "--t-end", until, "--dt", "0.05", "--out", "-"];
        let rolled = lnn(&[&rolled[..], &["--rtol", "1e-10", "--atol", "1e-10"]].concat());
        assert_eq!(rolled.code, Some(0), "{}", rolled.stderr);
        for row in rolled.stdout.lines().skip(1) {
            let row: Vec<f64> = row.split(',').map(|x| x.parse().unwrap()).collect();
            let noise: f64 = StandardNormal.sample(&mut rng);
            writeln!(csv, "{run},{},{}", row[0], row[1] + 1e-3 * noise).unwrap();
        }
    }
    folder.file("motion.csv", csv)
}

fn formula(data: &str, options: &[&str]) -> Value {
    let words =
        ["formula", data, "--coords", "x", "--trajectory", "run", "--json", "--bootstraps", "4", "--no-gyroscopic"];
    let run = lnn(&[&words[..], options].concat());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    serde_json::from_str(&run.stdout).unwrap()
}

/// Terms with their coefficients, those of the dissipation function after `D: `.
fn terms(found: &Value) -> Vec<(String, f64)> {
    let of = |term: &Value| {
        let kind = if term["dissipation"] == true { "D: " } else { "" };
        (format!("{kind}{}", term["term"].as_str().unwrap()), term["coefficient"].as_f64().unwrap())
    };
    found["terms"].as_array().unwrap().iter().map(of).collect()
}

fn are_near(found: &Value, truth: &[(&str, f64)]) {
    let terms = terms(found);
    let near = |(term, c): &(&str, f64)| terms.iter().any(|(own, x)| own == term && (x / c - 1.0).abs() < 0.02);
    assert!(terms.len() == truth.len() && truth.iter().all(near), "{terms:?}");
}

#[test]
fn the_drive_of_an_oscillator_is_found_and_its_file_moves() {
    let folder = Folder::new();
    let system = folder.file("duffing.toml", DUFFING);
    let data = recorded(&folder, &system, &["0.5,0.2"], "60");
    let out = text(&folder.path("found.toml"));
    let basis = ["--friction", "--basis", "polynomial:4"];
    let found = formula(&data, &[&basis[..], &["--out", &out]].concat());
    assert_eq!(found["verdict"], "found", "{found}");
    let driven = ("x*cos(om*t)", 0.3);
    are_near(&found, &[("x_dot^2", 0.5), ("x^2", 0.5), ("x^4", -0.25), driven, ("D: x_dot^2", 0.1)]);
    let number = |key: &str| found["drive"][key].as_f64().unwrap();
    let (off, error) = ((number("frequency") - 1.2).abs(), number("standard_error"));
    assert!(off < 3.0 * error && error < 1e-3, "{off} {error}");
    // The file moves as the system does, and is one that `lnn identify` fits.
    let last = |system: &str| {
        let roll = ["rollout", "--system", system, "--state", "0.3,0", "--t-start", "3", "--t-end", "11", "--dt", "8"];
        let run = lnn(&[&roll[..], &["--out", "-"]].concat());
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        run.stdout.trim_end().lines().last().unwrap().split(',').nth(1).unwrap().parse::<f64>().unwrap()
    };
    assert!((last(&out) - last(&system)).abs() < 2e-2, "{} {}", last(&out), last(&system));
    let run = lnn(&["identify", &data, "--system", &out, "--trajectory", "run", "--json"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let again: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(again["explained"], true, "{}", run.stdout);
    let value = again["constants"]["om"]["value"].as_f64().unwrap();
    assert!((value - 1.2).abs() < 1e-4, "{value}");
    // Without a drive, and in too few of its periods, there is none.
    let without = formula(&data, &[&basis[..], &["--no-drive"]].concat());
    assert!(without["verdict"] == "not in the library" && without["drive"].is_null(), "{without}");
    let short = recorded(&folder, &system, &["0.5,0.2", "-1,0.3", "0.1,-0.4", "1.2,0", "0.8,0.9", "0,0"], "10");
    let short = formula(&short, &basis);
    assert!(short["verdict"] != "found" && short["drive"].is_null(), "{short}");
}

#[test]
fn friction_of_the_position_is_found_and_is_no_drive() {
    let folder = Folder::new();
    let system = folder.file("cycle.toml", CYCLE);
    let data = recorded(&folder, &system, &["0.5,0.2"], "40");
    let basis = ["--basis", "polynomial:2"];
    let found = formula(&data, &[&basis[..], &["--friction"]].concat());
    assert_eq!(found["verdict"], "found", "{found}");
    are_near(&found, &[("x_dot^2", 0.5), ("x^2", -2.0), ("D: x_dot^2", -0.3), ("D: x_dot^2*x^2", 0.3)]);
    // An oscillation that keeps itself going is as regular as a drive.
    let without = formula(&data, &basis);
    assert_ne!(without["verdict"], "found", "{without}");
}
