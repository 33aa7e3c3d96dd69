//! Measured quantities that are not coordinates: rolled out, identified, and refused where the file says nothing sensible.

use crate::running::{Folder, Run, lnn, text};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;
use std::fmt::Write as _;

/// Two pendula of which only the upper angle is measured. The truth: masses 1 and 0.6, lengths 1 and 0.8.
const ONE_ANGLE: &str = r#"
name = "one-angle"
lagrangian = """(m1 + m2)*l1^2*theta1_dot^2/2 + m2*l2^2*theta2_dot^2/2 + m2*l1*l2*theta1_dot*theta2_dot*cos(theta1 - theta2)
    + (m1 + m2)*g*l1*cos(theta1) + m2*g*l2*cos(theta2)"""
dissipation = "c*(theta2_dot - theta1_dot)^2/2"
[[coordinates]]
name = "theta1"
periodic = true
bounds = [-2, 2]
velocity_bounds = [-5, 5]
[[coordinates]]
name = "theta2"
periodic = true
bounds = [-2, 2]
velocity_bounds = [-5, 5]
[parameters]
m1 = 1
m2 = { default = 0.7, learn = true, range = "positive" }
l1 = { default = 1.1, learn = true, range = "positive" }
l2 = { default = 0.9, learn = true, range = "positive" }
g = 9.81
c = { default = 0, range = "at least 0" }
[measured]
angle = "theta1"
"#;

/// A pendulum on a rod of 0.8 m and loss 0.15, whose sensors are the formulas that follow.
const PENDULUM: &str = r#"
name = "watched-pendulum"
lagrangian = "l^2*theta_dot^2/2 + g*l*cos(theta)"
dissipation = "b*theta_dot^2/2"
[[coordinates]]
name = "theta"
periodic = true
bounds = [-2, 2]
velocity_bounds = [-6, 6]
[parameters]
g = 9.81
l = { default = 0.9, learn = true, range = "positive" }
b = { default = 0.1, learn = true }
[parameters.k]
default = 1
"#;

fn star() -> String {
    text(
        &std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
            .join("examples/systems/star_in_projection.toml"),
    )
}

/// A motion of a system, with parameters other than the file's: its columns by name.
fn motion(folder: &Folder, system: &str, options: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let out = text(&folder.path("motion.csv"));
    let line = format!("rollout --system {system} --out {out} --overwrite --rtol 1e-11 --atol 1e-12 {options}");
    let run = lnn(&line.split(' ').collect::<Vec<_>>());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let csv = std::fs::read_to_string(out).unwrap();
    let names = csv.lines().next().unwrap().split(',').map(str::to_string).collect();
    let rows = csv.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    (names, rows)
}

/// A log of some columns of a motion under other names, each with noise of a standard deviation.
fn log(folder: &Folder, motion: &(Vec<String>, Vec<Vec<f64>>), columns: &[(&str, &str, f64)], seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let place = |name: &str| motion.0.iter().position(|known| known == name).unwrap_or_else(|| panic!("{name}"));
    let mut csv = "t".to_string();
    columns.iter().for_each(|(_, name, _)| write!(csv, ",{name}").unwrap());
    for row in &motion.1 {
        write!(csv, "\n{}", row[0]).unwrap();
        for (column, _, noise) in columns {
            let draw: f64 = StandardNormal.sample(&mut rng);
            write!(csv, ",{}", row[place(column)] + noise * draw).unwrap();
        }
    }
    folder.file("log.csv", &csv)
}

/// `lnn identify` as JSON.
fn identified(system: &str, log: &str, more: &[&str]) -> Value {
    let run = lnn(&[&["identify", log, "--system", system, "--json"], more].concat());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    serde_json::from_str(&run.stdout).unwrap()
}

/// Distances of constants from their truth, in standard errors.
fn off(found: &Value, truth: &[(&str, f64)]) -> Vec<f64> {
    let of = |(name, truth): &(&str, f64)| {
        let own = &found["constants"][name];
        let error = own["standard_error"].as_f64().unwrap_or_else(|| panic!("{name}: {found}"));
        (own["value"].as_f64().unwrap() - truth) / error
    };
    truth.iter().map(of).collect()
}

/// Seeds 0 to 3 of a log: every model fits, every constant is within three and a half errors, three quarters within two.
fn honest(truth: &[(&str, f64)], found: impl Fn(u64) -> Value) {
    let mut all = Vec::new();
    for seed in 0..4 {
        let found = found(seed);
        assert_eq!(found["explained"], true, "{seed}: {found}");
        all.extend(off(&found, truth));
    }
    assert!(all.iter().all(|off| off.abs() < 3.5), "{all:?}");
    assert!(4 * all.iter().filter(|off| off.abs() < 2.0).count() >= 3 * all.len(), "{all:?}");
}

const SWING: &str = "--param m2=0.6 --param l1=1 --param l2=0.8 --state 0.9,-0.5,0,0 --t-end 8 --dt 0.02";

#[test]
fn one_angle_of_two_pendula_tells_their_constants() {
    let folder = Folder::new();
    let system = folder.file("one.toml", ONE_ANGLE);
    let motion = motion(&folder, &system, SWING);
    let columns = [("theta1", "angle", 1e-3)];
    honest(&[("m2", 0.6), ("l1", 1.0), ("l2", 0.8)], |seed| {
        identified(&system, &log(&folder, &motion, &columns, seed), &[])
    });
}

#[test]
fn a_loss_that_the_form_lacks_is_noticed() {
    let folder = Folder::new();
    let system = folder.file("one.toml", ONE_ANGLE);
    let motion = motion(&folder, &system, &format!("{SWING} --param c=0.05"));
    for seed in 0..2 {
        let found = identified(&system, &log(&folder, &motion, &[("theta1", "angle", 1e-3)], seed), &[]);
        assert_eq!(found["explained"], false, "{seed}: {found}");
    }
}

#[test]
fn a_star_is_weighed_by_its_place_on_the_sky_and_its_radial_velocity() {
    let folder = Folder::new();
    let system = folder.file("star.toml", std::fs::read_to_string(star()).unwrap());
    let options =
        "--param GM=39.5 --param i=1 --param node=0.4 --param v0=0.7 --state 0.8,0.5,0.3,8 --t-end 2 --dt 0.02";
    let motion = motion(&folder, &system, options);
    let columns = [("north", "north", 5e-3), ("east", "east", 5e-3), ("rv", "rv", 0.05)];
    let truth = [("GM", 39.5), ("i", 1.0), ("node", 0.4), ("v0", 0.7)];
    honest(&truth, |seed| identified(&system, &log(&folder, &motion, &columns, seed), &[]));
}

#[test]
fn a_pendulum_is_known_by_a_distance_or_an_accelerometer() {
    let folder = Folder::new();
    let truth = [("l", 0.8), ("b", 0.15)];
    let cases = [
        ("range = \"sqrt((1.5 - l*sin(theta))^2 + (l*cos(theta))^2)\"", "range", 2e-3),
        ("along = { formula = \"l*theta_ddot + g*sin(theta)\", unit = \"m/s^2\" }", "along", 0.01),
    ];
    for (entry, name, noise) in cases {
        let system = folder.file("pendulum.toml", format!("{PENDULUM}[measured]\n{entry}\n"));
        let motion = motion(&folder, &system, "--param l=0.8 --param b=0.15 --state 1.2,0.4 --t-end 8 --dt 0.02");
        honest(&truth, |seed| identified(&system, &log(&folder, &motion, &[(name, name, noise)], seed), &[]));
    }
}

/// A sensor of volts, with a gain and an offset, in a column of another name.
const VOLTS: &str = "offset = { default = 0, learn = true }\n[measured]\nvolts = { formula = \"k*theta + offset\", unit = \"V\", column = \"U\" }\n";

#[test]
fn gain_and_offset_of_a_sensor_are_found_beside_the_constants() {
    let folder = Folder::new();
    let pendulum = PENDULUM.replace("[parameters.k]\ndefault = 1\n", "k = { default = 2, learn = true }\n");
    let system = folder.file("pendulum.toml", format!("{pendulum}{VOLTS}"));
    let options = "--param l=0.8 --param b=0.15 --param k=2.5 --param offset=0.3 --state 1.5,0.4 --t-end 8 --dt 0.02";
    let motion = motion(&folder, &system, options);
    let truth = [("l", 0.8), ("b", 0.15), ("k", 2.5), ("offset", 0.3)];
    honest(&truth, |seed| identified(&system, &log(&folder, &motion, &[("volts", "U", 5e-3)], seed), &[]));
}

#[test]
fn a_gain_that_is_one_with_an_amplitude_is_called_a_product() {
    let folder = Folder::new();
    let system = r#"
name = "spring"
lagrangian = "x_dot^2/2 - w^2*x^2/2"
[[coordinates]]
name = "x"
bounds = [-2, 2]
velocity_bounds = [-3, 3]
[parameters]
w = { default = 1.8, learn = true, range = "positive" }
k = { default = 2, learn = true }
s = { default = 1.5, learn = true }
[forces]
x = "s"
[measured]
volts = "k*x"
"#;
    let system = folder.file("spring.toml", system);
    let motion = motion(&folder, &system, "--param w=2 --param k=2.5 --param s=1 --state 1,0.4 --t-end 12 --dt 0.02");
    let found = identified(&system, &log(&folder, &motion, &[("volts", "volts", 0.01)], 0), &[]);
    assert_eq!(found["explained"], true, "{found}");
    // The scale of x is free: only the product of gain and force shows.
    let known = &found["undetermined"][0]["known"][0];
    assert!(known["product"] == true && known["terms"]["k"] == known["terms"]["s"], "{found}");
    let distance = (known["value"].as_f64().unwrap() - 2.5) / known["standard_error"].as_f64().unwrap();
    assert!(distance.abs() < 3.5 && off(&found, &[("w", 2.0)])[0].abs() < 3.5, "{found}");
}

#[test]
fn a_sensor_may_have_an_offset_in_each_log() {
    let folder = Folder::new();
    let zero = "zero = { default = 0, per = \"trajectory\", learn = true }\n[measured]\nx = \"l*sin(theta) + zero\"\n";
    let system = folder.file("pendulum.toml", format!("{PENDULUM}{zero}").replace("[parameters.k]\ndefault = 1\n", ""));
    let plain = folder.file("plain.toml", format!("{PENDULUM}[measured]\nx = \"l*sin(theta)\"\n"));
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut csv = "run,t,x".to_string();
    for (run, offset, state) in [("a", 0.1, "1.2,0.4"), ("b", -0.2, "0.8,-1")] {
        let options = format!("--param l=0.8 --param b=0.15 --state {state} --t-end 6 --dt 0.02");
        let (names, rows) = motion(&folder, &plain, &options);
        let place = names.iter().position(|name| name == "x").unwrap();
        for row in rows {
            let draw: f64 = StandardNormal.sample(&mut rng);
            write!(csv, "\n{run},{},{}", row[0], row[place] + offset + 2e-3 * draw).unwrap();
        }
    }
    let found = identified(&system, &folder.file("log.csv", &csv), &["--trajectory", "run"]);
    let truth = [("l", 0.8), ("b", 0.15), ("zero_a", 0.1), ("zero_b", -0.2)];
    assert!(found["explained"] == true && off(&found, &truth).iter().all(|off| off.abs() < 3.5), "{found}");
}

#[test]
fn noise_explains_nothing() {
    let folder = Folder::new();
    let system = folder.file("one.toml", ONE_ANGLE);
    let flat = (vec!["t".to_string(), "zero".to_string()], (0..400).map(|k| vec![0.02 * f64::from(k), 0.0]).collect());
    for seed in 0..2 {
        let found = identified(&system, &log(&folder, &flat, &[("zero", "angle", 0.1)], seed), &[]);
        assert_eq!(found["explained"], false, "{found}");
    }
}

#[test]
fn gaps_and_errors_are_those_of_single_readings() {
    let folder = Folder::new();
    let file = std::fs::read_to_string(star()).unwrap();
    let named = |file: String, name: &str| {
        file.replace(
            &format!("\n{name} = {{ "),
            &format!("\n{name} = {{ error = \"{name}_err\", column = \"{name}_read\", "),
        )
    };
    let system = folder.file("star.toml", ["north", "east", "rv"].into_iter().fold(file, named));
    let options =
        "--param GM=39.5 --param i=1 --param node=0.4 --param v0=0.7 --state 0.8,0.5,0.3,8 --t-end 2 --dt 0.01";
    let (names, rows) = motion(&folder, &system, options);
    let place = |name: &str| names.iter().position(|known| known == name).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut csv = "t,north_read,east_read,rv_read,north_err,east_err,rv_err\n".to_string();
    for (k, row) in rows.iter().enumerate() {
        write!(csv, "{}", row[0]).unwrap();
        // Every third sample is an image, every second a spectrum, and errors differ by row.
        let sizes = [("north", 3, 4e-3), ("east", 3, 6e-3), ("rv", 2, 0.05)];
        let sizes = sizes.map(|(name, every, size)| (name, every, size * if k % 5 == 0 { 2.0 } else { 1.0 }));
        for (name, every, size) in sizes {
            let draw: f64 = StandardNormal.sample(&mut rng);
            let read = format!("{}", row[place(name)] + size * draw);
            write!(csv, ",{}", if k % every == 0 { read } else { String::new() }).unwrap();
        }
        sizes.iter().for_each(|(.., size)| write!(csv, ",{size}").unwrap());
        csv.push('\n');
    }
    let found = identified(&system, &folder.file("log.csv", &csv), &[]);
    assert_eq!(found["explained"], true, "{found}");
    let off = off(&found, &[("GM", 39.5), ("i", 1.0), ("node", 0.4), ("v0", 0.7)]);
    assert!(off.iter().all(|off| off.abs() < 3.5), "{off:?}");
}

#[test]
fn mistakes_are_named_on_one_line() {
    let folder = Folder::new();
    let log = folder.file("log.csv", "t,volts\n0,1\n0.1,2\n");
    let refused = |entry: &str, more: &[&str], code: i32, words: &[&str]| {
        let system = folder.file("pendulum.toml", format!("{PENDULUM}[measured]\n{entry}\n"));
        let run: Run = lnn(&[&["identify", &log, "--system", &system], more].concat());
        assert_eq!(run.stderr.trim_end().lines().count(), 1, "{}", run.stderr);
        run.refused(code, words);
    };
    refused(
        "volts = \"k*thet\"",
        &[],
        2,
        &["pendulum.toml", "measured.volts.formula", "column 3", "unknown name \"thet\""],
    );
    refused(
        "volts = \"k + t\"",
        &[],
        2,
        &["measured.volts.formula", "expected a coordinate, a velocity or an acceleration"],
    );
    refused("other = \"k*theta\"", &[], 1, &["log.csv", "other"]);
    refused("volts = { formula = \"theta\", colum = \"x\" }", &[], 2, &["pendulum.toml", "colum"]);
    refused("volts = { formula = \"theta\", error = \"e\" }\nmore = \"theta_dot\"", &[], 2, &["measured.more.error"]);
    refused("theta_dot = \"k*theta\"", &[], 2, &["measured.theta_dot.formula", "another name"]);
    refused("energy = \"k*theta\"", &[], 2, &["measured.energy.formula", "another name"]);
    refused("volts = 3", &[], 2, &["pendulum.toml", "measured"]);
    refused("volts = \"k*theta\"", &["--gain", "theta"], 2, &["--gain", "[measured]"]);
    refused("volts = \"k*theta\"", &["--coords", "volts"], 2, &["--coords", "[measured]"]);
    refused("volts = \"k*theta\"", &["--error", "e"], 2, &["--error", "[measured]"]);
}
