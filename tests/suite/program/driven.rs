//! Systems with forces as formulas: rolled out, identified, and refused where no time is known.
#![cfg(feature = "cli")]

use crate::common::program::{Folder, Run, lnn, text};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write as _;

/// A motor drives a spring: `x'' = -k x + F cos(om t + phi)`.
const SPRING: &str = r#"
name = "driven-spring"
lagrangian = "x_dot^2/2 - k*x^2/2"
[[coordinates]]
name = "x"
bounds = [-3, 3]
velocity_bounds = [-5, 5]
[parameters]
k = 4
F = 0.7
om = 1.3
phi = 0.4
[forces]
x = "F*cos(om*t + phi)"
"#;

/// A pendulum of unit length in a drive, the constants 20 % off their truth: g 9.81, F 1.5, om 2.2, phi 0.5.
const PENDULUM: &str = r#"
name = "driven-pendulum"
lagrangian = "theta_dot^2/2 + g*cos(theta)"
[[coordinates]]
name = "theta"
unit = "rad"
periodic = true
velocity_bounds = [-8, 8]
[parameters]
g = { default = 9.81, unit = "1/s^2" }
F = { default = 1.8, learn = true }
om = { default = 1.76, learn = true, range = "positive" }
phi = { default = 0.6, learn = true }
[forces]
theta = "F*cos(om*t + phi)"
"#;

/// Columns of a CSV.
fn columns(csv: &str) -> Vec<Vec<f64>> {
    let rows = csv.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect::<Vec<f64>>());
    let rows: Vec<Vec<f64>> = rows.collect();
    (0..rows[0].len()).map(|k| rows.iter().map(|row| row[k]).collect()).collect()
}

/// `lnn rollout` of a system into a file, with options between blanks, and the columns that it wrote.
fn motion((system, out): (&str, &str), options: &str) -> (Run, Vec<Vec<f64>>) {
    let line = format!("rollout --system {system} --out {out} --overwrite {options}");
    let run = lnn(&line.split(' ').collect::<Vec<_>>());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let found = columns(&std::fs::read_to_string(out).unwrap());
    (run, found)
}

#[test]
fn a_driven_spring_moves_as_its_closed_form() {
    let folder = Folder::new();
    let (system, out) = (folder.file("spring.toml", SPRING), text(&folder.path("motion.csv")));
    let (k, f, om, phi) = (4.0f64, 0.7, 1.3f64, 0.4f64);
    let w = k.sqrt();
    // From t0 at x = 0.5, v = -0.2.
    let exact = |t: f64, t0: f64| {
        let (c, d) = (f / (k - om * om), om * t0 + phi);
        let (x, v) = (0.5 - c * d.cos(), -0.2 + c * om * d.sin());
        c * (om * t + phi).cos() + x * (w * (t - t0)).cos() + v / w * (w * (t - t0)).sin()
    };
    for (method, start, accuracy) in [("dopri5", 0.0, 2e-6), ("gauss6", 3.0, 1e-9), ("variational", 0.0, 5e-3)] {
        let options = format!("--state 0.5,-0.2 --t-start {start} --t-end 15 --dt 0.02 --method {method}");
        let (run, found) = motion((&system, &out), &options);
        assert!(run.stdout.contains("forces added"), "{}", run.stdout);
        for (t, x) in found[0].iter().zip(&found[1]) {
            assert!((x - exact(*t, start)).abs() < accuracy, "{method} {t}: {x} {}", exact(*t, start));
        }
    }
    // A recorded force acts beside it, and here takes it away.
    let options = "--state 0.5,0 --t-end 3 --dt 0.1 --force x_force=-0.7 --param om=1e-9 --param phi=0";
    let (_, found) = motion((&system, &out), options);
    assert!(found[0].iter().zip(&found[1]).all(|(t, x)| (x - 0.5 * (w * t).cos()).abs() < 1e-5));
    let states = folder.file("states.csv", "x,x_dot\n0.5,0\n");
    lnn(&["inspect", "--system", &system, "--states", &states]).refused(1, &["time t"]);
    let run = text(&folder.path("run"));
    lnn(&["train", &system, "--epochs", "1", "--out", &run]).refused(2, &["driven-spring", "time t"]);
    let charges = format!("rollout --system {system} --state 0.5,0 --t-end 1 --dt 0.1 --charges --out -");
    lnn(&charges.split(' ').collect::<Vec<_>>()).refused(2, &["--charges"]);
    // What is read off the Lagrangian does not depend on the drive.
    assert_eq!(lnn(&["symmetries", "--system", &system]).code, Some(0));
}

#[test]
fn the_drive_of_a_pendulum_is_identified() {
    let folder = Folder::new();
    let (system, out) = (folder.file("pendulum.toml", PENDULUM), text(&folder.path("motion.csv")));
    let (mut within, seeds) = (0, 5);
    for seed in 0..seeds {
        let options = "--param F=1.5 --param om=2.2 --param phi=0.5 --t-end 20 --dt 0.02 --rtol 1e-11 --atol 1e-12";
        let (_, motion) = motion((&system, &out), &format!("{options} --state 0.{},0", 4 + seed));
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut csv = "t,theta\n".to_string();
        for (t, theta) in motion[0].iter().zip(&motion[1]) {
            let noise: f64 = StandardNormal.sample(&mut rng);
            writeln!(csv, "{t},{}", theta + 1e-2 * noise).unwrap();
        }
        let data = folder.file("data.csv", csv);
        let run = lnn(&["identify", &data, "--system", &system, "--json"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let found: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!(found["explained"], true, "{}", run.stdout);
        for (name, truth) in [("F", 1.5), ("om", 2.2), ("phi", 0.5)] {
            let [value, error] = ["value", "standard_error"].map(|key| found["constants"][name][key].as_f64().unwrap());
            assert!((value - truth).abs() < 5.0 * error && error < 0.02 * truth, "{seed} {name} {value} {error}");
            within += usize::from((value - truth).abs() < 2.0 * error);
        }
    }
    assert!(within >= 11, "{within} of 15 constants within two standard errors");
}
