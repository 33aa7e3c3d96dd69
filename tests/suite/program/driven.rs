//! Systems with forces as formulas: rolled out, identified, and refused where no time is known.

use crate::running::{Folder, Run, lnn, text};
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

/// Times and first coordinates of a motion as a CSV, with noise of a size and a seed, and with more columns.
fn noisy(header: &str, motion: &[Vec<f64>], (size, seed): (f64, u64), mut more: impl FnMut(f64) -> String) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut csv = format!("{header}\n");
    for (t, q) in motion[0].iter().zip(&motion[1]) {
        let noise: f64 = StandardNormal.sample(&mut rng);
        writeln!(csv, "{t},{}{}", q + size * noise, more(*t)).unwrap();
    }
    csv
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
        // Its own forces account for the change of its energy.
        let number = |name: &str| {
            let rest = run.stdout.split(name).nth(1).unwrap_or_else(|| panic!("{name} in {}", run.stdout));
            rest.split([',', '\n']).next().unwrap().trim().parse::<f64>().unwrap()
        };
        let (change, removed) = (number("energy changed by "), number("own forces and time removed "));
        assert!(change.abs() > 0.1 && (change + removed).abs() < 1e-3 * change.abs(), "{}", run.stdout);
        for (t, x) in found[0].iter().zip(&found[1]) {
            assert!((x - exact(*t, start)).abs() < accuracy, "{method} {t}: {x} {}", exact(*t, start));
        }
    }
    // A recorded force acts beside it, and here takes it away.
    let options = "--state 0.5,0 --t-end 3 --dt 0.1 --force x_force=-0.7 --param om=1e-9 --param phi=0";
    let (_, found) = motion((&system, &out), options);
    assert!(found[0].iter().zip(&found[1]).all(|(t, x)| (x - 0.5 * (w * t).cos()).abs() < 1e-5));
    // States have terms at their times.
    let states = folder.file("states.csv", "x,x_dot,t\n0.5,0,0\n0.5,0,2\n");
    let run = lnn(&["inspect", "--system", &system, "--states", &states]);
    for (line, t) in run.stdout.lines().zip([0.0, 2.0]) {
        let terms: serde_json::Value = serde_json::from_str(line).unwrap();
        let a = terms["acceleration"][0].as_f64().unwrap();
        assert!((a - (0.7 * (1.3 * t + 0.4f64).cos() - 4.0 * 0.5)).abs() < 1e-12, "{}", run.stdout);
    }
    let bare = folder.file("bare.csv", "x,x_dot\n0.5,0\n");
    lnn(&["inspect", "--system", &system, "--states", &bare]).refused(1, &["bare.csv", "column t"]);
    lnn(&["inspect", "--system", &system, "--states", &states, "--linearize"]).refused(2, &["time"]);
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
        let data = folder.file("data.csv", noisy("t,theta", &motion, (1e-2, seed), |_| String::new()));
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

/// A pendulum whose support shakes, `y = a cos(om t)`, and whose rod grows at a rate.
const SHAKEN: &str = r#"
name = "shaken-pendulum"
lagrangian = "rod^2*theta_dot^2/2 + rod*(g - a*om^2*cos(om*t))*cos(theta)"
[definitions]
rod = "1 + rate*t"
[[coordinates]]
name = "theta"
unit = "rad"
periodic = true
velocity_bounds = [-8, 8]
[parameters]
g = 9.81
a = { default = 0.05, learn = true }
om = { default = 7, learn = true, range = "positive" }
rate = { default = 0, learn = true }
"#;

#[test]
fn a_lagrangian_in_time_is_rolled_out_and_identified() {
    let folder = Folder::new();
    let (system, out) = (folder.file("shaken.toml", SHAKEN), text(&folder.path("motion.csv")));
    let truth = [("a", 0.06), ("om", 6.6), ("rate", 0.03)];
    let values = truth.map(|(name, value)| format!("--param {name}={value}")).join(" ");
    let options = format!("{values} --state 0.5,0.3 --t-start 1 --t-end 11 --dt 0.02");
    // Methods that have nothing in common agree, and the energy is accounted for.
    let (_, reference) = motion((&system, &out), &format!("{options} --method dop853 --rtol 1e-13 --atol 1e-13"));
    for (method, step, accuracy) in
        [("gauss6", "0.01", 1e-9), ("gauss4", "0.005", 1e-7), ("variational", "0.001", 1e-4)]
    {
        let (run, found) = motion((&system, &out), &format!("{options} --method {method} --step {step}"));
        let worst = found[1].iter().zip(&reference[1]).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
        assert!(worst < accuracy, "{method}: {worst}");
        let defect = run.stdout.split("defect ").nth(1).and_then(|rest| rest.split_whitespace().next()).unwrap();
        assert!(defect.parse::<f64>().unwrap().abs() < 1e3 * accuracy, "{method}: {}", run.stdout);
    }
    // The equation of motion, written by hand, holds along it.
    let (rows, h) = (reference[0].len(), 0.02);
    for k in 2..rows - 2 {
        let (t, theta, v) = (reference[0][k], reference[1][k], &reference[2]);
        let a = (8.0 * (v[k + 1] - v[k - 1]) - (v[k + 2] - v[k - 2])) / (12.0 * h);
        let rod = 1.0 + 0.03 * t;
        let wanted = -((9.81 - 0.06 * 6.6 * 6.6 * (6.6 * t).cos()) * theta.sin() + 2.0 * 0.03 * v[k]) / rod;
        assert!((a - wanted).abs() < 1e-3, "{t}: {a} {wanted}");
    }
    let data = folder.file("data.csv", noisy("t,theta", &reference, (1e-3, 3), |_| String::new()));
    let run = lnn(&["identify", &data, "--system", &system, "--json"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let found: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(found["explained"], true, "{}", run.stdout);
    for (name, truth) in truth {
        let [value, error] = ["value", "standard_error"].map(|key| found["constants"][name][key].as_f64().unwrap());
        assert!((value - truth).abs() < 4.0 * error && error < 0.05 * truth, "{name} {value} {error}");
    }
    // A rod that does not grow does not fit.
    let still = lnn(&["identify", &data, "--system", &system, "--json", "--constants", "a,om"]);
    let found: serde_json::Value = serde_json::from_str(&still.stdout).unwrap();
    assert_eq!(found["explained"], false, "{}", still.stdout);
    // The forces that make the accelerations of the equation written by hand are none, at every time; other accelerations need `rod^2` of them.
    let mut states = String::from("theta,theta_dot,theta_ddot,t\n");
    for (t, more) in [(0.0, 0.0), (1.3, 0.0), (2.7, 0.5)] {
        let (theta, v, rod): (f64, f64, f64) = (0.4, 1.5, 1.0 + 0.03 * t);
        let a = -((9.81 - 0.06 * 6.6 * 6.6 * f64::cos(6.6 * t)) * theta.sin() + 2.0 * 0.03 * v) / rod;
        writeln!(states, "{theta},{v},{},{t}", a + more).unwrap();
    }
    let file = folder.file("states.csv", states);
    let mut inverse = vec!["inspect", "--system", &system, "--states", &file, "--inverse", "--format", "csv"];
    inverse.extend(values.split(' '));
    let run = lnn(&inverse);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let forces = run.stdout.lines().skip(1).map(|line| line.split(',').nth(1).unwrap().parse::<f64>().unwrap());
    for (force, wanted) in forces.zip([0.0, 0.0, 0.5 * 1.081_f64.powi(2)]) {
        assert!((force - wanted).abs() < 1e-12, "{}", run.stdout);
    }
    assert!(run.stdout.starts_with("t,") && run.stdout.lines().count() == 4, "{}", run.stdout);
    let missing = folder.file("missing.csv", "theta,theta_dot,theta_ddot\n0.4,1.5,0\n");
    lnn(&["inspect", "--system", &system, "--states", &missing, "--inverse"]).refused(1, &["missing column t"]);
    // Where no time is known it is refused, and nothing panics.
    for command in ["symmetries", "certify"] {
        lnn(&[command, "--system", &system]).refused(2, &["time t"]);
    }
    let net = ["fit", &data, "--coords", "theta", "--known", &system, "--epochs", "1", "--out"];
    lnn(&[&net[..], &[&text(&folder.path("run"))]].concat()).refused(2, &["time `t`"]);
    let held = SHAKEN.replace("[parameters]", "[constraints]\nsupport = \"theta - 0.1*t\"\n[parameters]");
    lnn(&["systems", "--system", &folder.file("held.toml", held)]).refused(2, &["held.toml", "support", "time `t`"]);
    let circle = SHAKEN.replace("1 + rate*t", "1 + rate*t*rod");
    lnn(&["systems", "--system", &folder.file("circle.toml", circle)]).refused(2, &["rod", "itself"]);
}

#[test]
fn the_smallest_accelerations_of_a_system_in_time_are_those_at_each_time() {
    let folder = Folder::new();
    let open = "name = \"open\"\nlagrangian = \"(x_dot + y_dot)^2/2 - cos(3*t)*(x + y)\"\n\
        [[coordinates]]\nname = \"x\"\nbounds = [-1, 1]\nvelocity_bounds = [-1, 1]\n\
        [[coordinates]]\nname = \"y\"\nbounds = [-1, 1]\nvelocity_bounds = [-1, 1]\n";
    let system = folder.file("open.toml", open);
    let states = folder.file("states.csv", "x,y,x_dot,y_dot,t\n0.3,0.1,0,0,0\n0.3,0.1,0,0,0.8\n");
    let run = lnn(&["inspect", "--system", &system, "--states", &states, "--least-norm"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    for (line, t) in run.stdout.lines().zip([0.0, 0.8]) {
        let terms: serde_json::Value = serde_json::from_str(line).unwrap();
        for k in 0..2 {
            let a = terms["acceleration"][k].as_f64().unwrap();
            assert!((a + f64::cos(3.0 * t) / 2.0).abs() < 1e-12, "{line}");
        }
    }
    let out = text(&folder.path("motion.csv"));
    let [roll, end] = ["rollout --state 0.3,0.1,0,0 --t-end 1 --dt 0.1 --least-norm --rtol 1e-10 --system", "--out"];
    let args: Vec<&str> = roll.split(' ').chain([&system[..], end, &out]).collect();
    let run = lnn(&args);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    // x'' = -cos(3 t)/2 from rest.
    let csv = std::fs::read_to_string(&out).unwrap();
    let x: f64 = csv.lines().last().unwrap().split(',').nth(1).unwrap().parse().unwrap();
    assert!((x - 0.3 - (f64::cos(3.0) - 1.0) / 18.0).abs() < 1e-7, "{x}");
}

/// A pendulum with a motor: its torque is a gain times the voltage.
const MOTOR: &str = r#"
name = "motor"
lagrangian = "J*theta_dot^2/2 + w*cos(theta)"
dissipation = "b*theta_dot^2/2"
[[coordinates]]
name = "theta"
unit = "rad"
periodic = true
velocity_bounds = [-20, 20]
[parameters]
J = { default = 0.02, unit = "kg m^2" }
w = { default = 0.5, unit = "N m" }
b = { default = 0.01, learn = true }
K = { default = 0.1, learn = true, unit = "N m/V" }
[inputs]
u = "V"
[forces]
theta = "K*u"
"#;

#[test]
fn inputs_of_forces_are_read_from_recordings() {
    let folder = Folder::new();
    let (system, out) = (folder.file("motor.toml", MOTOR), text(&folder.path("motion.csv")));
    // A voltage of 2 V is the torque K u.
    let (_, one) = motion((&system, &out), "--state 0.1,0 --t-end 3 --dt 0.1 --force u=2 --method gauss6");
    let (run, other) =
        motion((&system, &out), "--state 0.1,0 --t-end 3 --dt 0.1 --force u=0 --force theta_force=0.2 --method gauss6");
    assert!(run.stdout.contains("forces added"), "{}", run.stdout);
    assert!(one[1].iter().zip(&other[1]).all(|(a, b)| (a - b).abs() < 1e-12));
    let voltage = |t: f64| 3.0 * (1.7 * t).sin() + 1.5 * (4.3 * t + 1.0).sin();
    let rows: String = (0..=500).map(|k| format!("{0},{1}\n", k as f64 * 0.02, voltage(k as f64 * 0.02))).collect();
    let drive = folder.file("drive.csv", format!("t,u\n{rows}"));
    let options =
        format!("--state 0.1,0 --t-end 10 --dt 0.02 --force {drive} --param K=0.13 --param b=0.015 --method dop853");
    let (run, truth) = motion((&system, &out), &format!("{options} --rtol 1e-11 --atol 1e-12"));
    assert!(!run.stderr.contains("theta_force"), "{}", run.stderr);
    let (mut within, mut explained, seeds) = (0, 0, 6);
    for seed in 0..seeds {
        let csv = noisy("t,theta,u", &truth, (1e-3, seed), |t| format!(",{}", voltage(t)));
        let run = lnn(&["identify", &folder.file("log.csv", csv), "--system", &system, "--json"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let found: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
        explained += usize::from(found["explained"] == true);
        for (name, truth) in [("K", 0.13), ("b", 0.015)] {
            let [value, error] = ["value", "standard_error"].map(|key| found["constants"][name][key].as_f64().unwrap());
            assert!((value - truth).abs() < 5.0 * error && error < 0.002 * truth, "{seed} {name} {value} {error}");
            within += usize::from((value - truth).abs() < 2.0 * error);
        }
    }
    assert!(within >= 9 && explained >= 5, "{within} of 12 within two errors, {explained} of 6 explained");
    // A motor without friction does not fit the last log, and a wrong column drives nothing.
    let log = text(&folder.path("log.csv"));
    let swapped = std::fs::read_to_string(&log).unwrap().replacen("t,theta,u", "t,theta,unused", 1);
    let wrong = swapped.lines().enumerate().map(|(k, row)| match k {
        0 => format!("{row},u\n"),
        _ => format!("{row},{}\n", (k as f64 * 0.37).sin()),
    });
    let wrong = folder.file("wrong.csv", wrong.collect::<String>());
    for (data, more) in
        [(&log, ["--constants", "K", "--param", "b=0"]), (&wrong, ["--constants", "K,b", "--param", "b=0.01"])]
    {
        let run = lnn(&[&["identify", data, "--system", &system, "--json"][..], &more].concat());
        let found: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!(found["explained"], false, "{}", run.stdout);
    }
    // What is missing or wrong is named.
    let roll = ["rollout", "--system", &system, "--state", "0,0", "--t-end", "1", "--dt", "0.1", "--out", "-"];
    lnn(&roll).refused(2, &["--force", "u"]);
    let bare = folder.file("bare.csv", format!("t,theta\n{rows}"));
    lnn(&["identify", &bare, "--system", &system]).refused(1, &["bare.csv", "input", "\"u\""]);
    for (from, to, says) in [
        ("dissipation = \"b*", "dissipation = \"u*b*", "unknown name \"u\""),
        ("theta = \"K*u\"", "theta = \"K\"", "inputs.u"),
        ("u = \"V\"", "b = \"V\"", "`b` is taken"),
        ("u = \"V\"", "\"u v\" = \"V\"", "valid name"),
    ] {
        let file = folder.file("wrong.toml", MOTOR.replace(from, to));
        lnn(&["systems", "--system", &file]).refused(2, &["wrong.toml", says]);
    }
}

#[test]
fn a_frequency_is_found_in_a_long_recording() {
    let folder = Folder::new();
    let (system, out) = (folder.file("pendulum.toml", PENDULUM), text(&folder.path("motion.csv")));
    let options = "--param F=0.3 --param om=2.2 --param phi=0.5 --t-end 150 --dt 0.1 --rtol 1e-11 --atol 1e-12";
    let (_, motion) = motion((&system, &out), &format!("{options} --state 0.4,0"));
    let data = folder.file("data.csv", noisy("t,theta", &motion, (3e-3, 5), |_| String::new()));
    let identified = |start: &str| {
        let run = lnn(&["identify", &data, "--system", &system, "--json", "--param", "F=0.36", "--param", start]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        serde_json::from_str::<serde_json::Value>(&run.stdout).unwrap()
    };
    // 27 periods of beating away: forty values at the end of the whole recording would not reach so far.
    let found = identified("om=1.76");
    let om = &found["constants"]["om"];
    assert!((om["value"].as_f64().unwrap() - 2.2).abs() < 5.0 * om["standard_error"].as_f64().unwrap(), "{found}");
    assert_eq!(found["explained"], true, "{found}");
    // A phase is known up to full turns: it is the one next to the start.
    let phi = &found["constants"]["phi"];
    assert!((phi["value"].as_f64().unwrap() - 0.5).abs() < 5.0 * phi["standard_error"].as_f64().unwrap(), "{found}");
    // What is out of reach is not said to be searched.
    let found = identified("om=40");
    let says = found["obstacles"].as_array().unwrap();
    assert!(says.iter().any(|text| text.as_str().unwrap().starts_with("om was searched")), "{found}");
}

/// A charged particle in the field of a wiggler, `B cos(k z)`.
const WIGGLER: &str = include_str!("../../../examples/systems/wiggler.toml");

/// A phase that grows with time, or with the distance that is gone, has as many minima as periods.
#[test]
fn frequencies_and_wave_numbers_are_found_from_afar() {
    let folder = Folder::new();
    let found = |(name, system, from): (&str, &str, &str), noise: f64, starts: [&str; 2]| {
        let (file, out) = (folder.file(name, system), text(&folder.path("motion.csv")));
        let (_, motion) = motion((&file, &out), &format!("{from} --rtol 1e-11 --atol 1e-12"));
        let data = match (motion.len() - 1) / 2 {
            1 => noisy("t,theta", &motion, (noise, 5), |_| String::new()),
            _ => {
                let mut rng = ChaCha8Rng::seed_from_u64(6);
                let mut z = motion[2]
                    .iter()
                    .map(|z| z + noise * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, &mut rng));
                noisy("t,x,z", &motion, (noise, 5), |_| format!(",{}", z.next().unwrap()))
            }
        };
        let data = folder.file("data.csv", data);
        starts.map(|start| {
            let run = lnn(&["identify", &data, "--system", &file, "--json", "--param", start]);
            assert_eq!(run.code, Some(0), "{}", run.stderr);
            let found: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
            assert_eq!(found["explained"], true, "{start}: {}", run.stdout);
            found
        })
    };
    let is_near = |found: &serde_json::Value, name: &str, truth: f64| {
        let [value, error] = ["value", "standard_error"].map(|key| found["constants"][name][key].as_f64().unwrap());
        assert!((value - truth).abs() < 5.0 * error && error < 0.01 * truth, "{name} {value} {error}");
    };
    let shaken = ("shaken.toml", SHAKEN, "--state 0.8,0 --t-end 15 --dt 0.02");
    found(shaken, 1e-2, ["om=5.7", "om=8.3"]).iter().for_each(|found| is_near(found, "om", 7.0));
    let wiggler = ("wiggler.toml", WIGGLER, "--state 0.1,0,0,1 --t-end 25 --dt 0.05");
    found(wiggler, 1e-2, ["k=1.65", "k=2.35"]).iter().for_each(|found| is_near(found, "k", 2.0));
}

/// A mass on a spring that carries another payload in every log.
const LOADED: &str = r#"
name = "loaded-spring"
lagrangian = "total*x_dot^2/2 - k*x^2/2"
[definitions]
total = "1 + payload"
[[coordinates]]
name = "x"
bounds = [-3, 3]
velocity_bounds = [-5, 5]
[parameters]
k = { default = 3, learn = true, range = "positive" }
payload = { default = 0.3, unit = "kg", per = "trajectory", known = { empty = 0 } }
"#;

#[test]
fn a_payload_differs_between_logs() {
    let folder = Folder::new();
    let (system, out) = (folder.file("loaded.toml", LOADED), text(&folder.path("motion.csv")));
    let truth = [("empty", 0.0), ("half", 0.5), ("no 2", 1.2)];
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut csv = "t,x,log\n".to_string();
    for (log, payload) in truth {
        let options =
            format!("--state 1,0 --t-end 12 --dt 0.05 --param k=4 --param payload={payload} --rtol 1e-11 --atol 1e-12");
        let (_, motion) = motion((&system, &out), &options);
        for (t, x) in motion[0].iter().zip(&motion[1]) {
            let noise: f64 = StandardNormal.sample(&mut rng);
            writeln!(csv, "{t},{},{log}", x + 2e-3 * noise).unwrap();
        }
    }
    let data = folder.file("data.csv", &csv);
    let run = lnn(&["identify", &data, "--system", &system, "--trajectory", "log", "--json"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let found: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(found["explained"], true, "{}", run.stdout);
    assert!(found["constants"].get("payload_empty").is_none() && found["between"].is_null(), "{}", run.stdout);
    for (name, truth) in [("k", 4.0), ("payload_half", 0.5), ("payload_no_2", 1.2)] {
        let [value, error] = ["value", "standard_error"].map(|key| found["constants"][name][key].as_f64().unwrap());
        assert!((value - truth).abs() < 4.0 * error && error < 0.01, "{name} {value} {error}");
    }
    // One payload for all logs does not fit.
    let shared =
        folder.file("shared.toml", LOADED.replace("per = \"trajectory\", known = { empty = 0 }", "learn = true"));
    let run = lnn(&["identify", &data, "--system", &shared, "--trajectory", "log", "--json"]);
    let found: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(found["explained"], false, "{}", run.stdout);
    // Without a known one, nothing but ratios are determined.
    let open = folder.file("open.toml", LOADED.replace(", known = { empty = 0 }", ""));
    let run = lnn(&["identify", &data, "--system", &open, "--trajectory", "log", "--json"]);
    let found: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert!(found["constants"]["k"]["standard_error"].is_null(), "{}", run.stdout);
    for (from, to, says) in [("empty = 0", "full = 0", "no trajectory full"), ("per = \"trajectory\", ", "", "per")] {
        let file = folder.file("wrong.toml", LOADED.replace(from, to));
        lnn(&["identify", &data, "--system", &file, "--trajectory", "log"]).refused(2, &[says]);
    }
}

/// A joint whose gear loses a share of the torque `u` of its motor, beside dry and viscous friction.
const GEAR: &str = r#"
name = "gear"
lagrangian = "J*theta_dot^2/2"
[[coordinates]]
name = "theta"
unit = "rad"
periodic = true
velocity_bounds = [-20, 20]
[parameters]
J = { default = 0.06, learn = true }
b = { default = 0.08, learn = true }
c = { default = 0.1, learn = true }
mu = { default = 0.05, learn = true }
[inputs]
u = "N*m"
[forces]
theta = "u - (c + mu*abs(u))*tanh(theta_dot/0.05) - b*theta_dot"
"#;

#[test]
fn friction_that_grows_with_the_load_is_identified() {
    let folder = Folder::new();
    let (system, out) = (folder.file("gear.toml", GEAR), text(&folder.path("motion.csv")));
    let drive = |t: f64| 0.9 * (2.5 * t).sin() + 0.5 * (6.9 * t + 1.0).sin() + 0.4 * (1.1 * t + 2.0).sin();
    let mut torque = "t,u\n".to_string();
    (0..=500).for_each(|k| writeln!(torque, "{},{}", 0.01 * f64::from(k), drive(0.01 * f64::from(k))).unwrap());
    let torque = folder.file("torque.csv", torque);
    let truth = [("J", 0.05), ("b", 0.1), ("c", 0.15), ("mu", 0.12)];
    let given: String = truth.iter().map(|(name, value)| format!(" --param {name}={value}")).collect();
    let options = format!("--state 0,0 --t-end 5 --dt 0.01 --rtol 1e-11 --atol 1e-12 --force {torque}{given}");
    let (_, motion) = motion((&system, &out), &options);
    let identified = |system: &str, seed: u64| -> serde_json::Value {
        let data = folder.file("data.csv", noisy("t,theta,u", &motion, (1e-4, seed), |t| format!(",{}", drive(t))));
        let run = lnn(&["identify", &data, "--system", system, "--json"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        serde_json::from_str(&run.stdout).unwrap()
    };
    let mut explained = 0;
    for seed in 0..3 {
        let found = identified(&system, seed);
        explained += u8::from(found["explained"] == true);
        for (name, truth) in truth {
            let [value, error] = ["value", "standard_error"].map(|key| found["constants"][name][key].as_f64().unwrap());
            assert!((value - truth).abs() < 4.0 * error && error < 0.01 * truth, "{seed} {name} {value} {error}");
        }
    }
    // A right model is refused once in a hundred times.
    assert!(explained >= 2, "{explained} of 3");
    // Without the load the same motion is not explained.
    let unloaded = GEAR.replace(" + mu*abs(u)", "").replace("mu = { default = 0.05, learn = true }", "");
    let found = identified(&folder.file("unloaded.toml", unloaded), 0);
    assert_eq!(found["explained"], false, "{found}");
}
