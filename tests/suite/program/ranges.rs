//! What `lnn fit` states about how well the data determine a model, and what it does not state.

use crate::common::arm::{self, Faults, JOINTS, Motion};
use crate::program::fit::{COLUMNS, pendulum};
use crate::running::{Folder, Run, lnn, text};
use serde_json::Value;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;

/// The run and its `summary.json`.
fn fitted(folder: &Folder, data: &str, out: &str, more: &[&str]) -> (Run, Value) {
    let place = text(&folder.path(out));
    let run = lnn(&[&["fit", data, "--out", &place], more].concat());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let summary = serde_json::from_slice(&fs::read(folder.path(out).join("summary.json")).unwrap()).unwrap();
    (run, summary)
}

/// `true` if the report asks for `--friction`.
fn asks_for_friction(run: &Run) -> bool {
    run.stdout.lines().any(|line| line.contains("--friction"))
}

#[test]
fn the_arm_obeys_the_laws_of_mechanics() {
    let motion = Motion::new(1);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let kinetic = |t: f64| {
        let [q, v, _] = motion.at(t);
        let mass = arm::mass_matrix(&q);
        0.5 * product(&v, &mass.map(|row| product(&row, &v)))
    };
    let (mut inertial, mut heavy) = (0.0, 0.0);
    for t in [0.3, 4.7, 11.0, 19.9] {
        let [q, v, a] = motion.at(t);
        let mass = arm::mass_matrix(&q);
        for (i, row) in mass.iter().enumerate() {
            assert!((0.003..3.0).contains(&row[i]), "{i} {}", row[i]);
            assert!((0..JOINTS).all(|j| (row[j] - mass[j][i]).abs() < 1e-12), "{row:?}");
        }
        // The power of the torques that neither lift nor rub changes the kinetic energy.
        let still = arm::torques(&q, &[0.0; JOINTS], &[0.0; JOINTS]);
        assert!(product(&still, &still) > 0.0 && still == arm::gravity(&q));
        let rub = arm::friction(&v);
        let torques = arm::torques(&q, &v, &a);
        let free: Vec<f64> = (0..JOINTS).map(|k| torques[k] - still[k] - rub[k]).collect();
        let h = 1e-5;
        let change = (kinetic(t + h) - kinetic(t - h)) / (2.0 * h);
        assert!((product(&free, &v) - change).abs() < 1e-6 * (1.0 + change.abs()), "{change}");
        inertial += product(&free, &free);
        heavy += product(&still, &still);
    }
    let ratio = (heavy / inertial).sqrt();
    assert!((10.0..40.0).contains(&ratio), "{ratio}");
    let csv = arm::log(2.0, Faults::USUAL, 1);
    assert_eq!(csv, arm::log(2.0, Faults::USUAL, 1));
    assert_eq!(csv.lines().next().unwrap().split(',').count(), 1 + 2 * JOINTS);
    assert!((485..500).contains(&csv.lines().count()), "{}", csv.lines().count());
}

/// A model that explains nothing is given no ranges and calls nothing friction.
#[test]
fn a_model_that_learned_nothing_is_stated_to_be_determined_in_nothing() {
    let folder = Folder::new();
    let data = folder.file("arm.csv", arm::log(8.0, Faults::USUAL, 0));
    let [coordinates, forces] = ["q", "tau"].map(|prefix| arm::names(prefix).join(","));
    let more = ["--coords", &coordinates, "--periodic", &coordinates, "--force", &forces, "--structure", "mechanical"];
    for friction in [&["--friction"][..], &[]] {
        let (run, found) = fitted(
            &folder,
            &data,
            "out",
            &[&more[..], &["--hidden", "16", "--epochs", "2", "--overwrite"], friction].concat(),
        );
        assert!(found["withheld"].is_string() && found["determination"] == Value::Array(vec![]), "{found}");
        let worst = found["misfit"].as_object().unwrap().values().map(|x| x.as_f64().unwrap()).fold(0.0, f64::max);
        assert!(worst > 0.3, "{worst}");
        assert!(!run.stdout.contains("cases of 10") && !run.stdout.contains("well determined"), "{}", run.stdout);
        assert!(!asks_for_friction(&run), "{}", run.stdout);
    }
}

/// The end of a spiral is held out: it lies nearer to the centre than all that was learned from.
#[test]
fn held_out_states_outside_of_the_learned_ones_are_named() {
    let folder = Folder::new();
    let mut csv = "t,r,phi\n".to_string();
    for k in 0..1500 {
        let t = 0.01 * f64::from(k);
        let r = 2.0 - 0.08 * t + 0.1 * (2.0 * t).sin();
        let phi = (2.0 * t + 0.3 * t.sin() + PI).rem_euclid(2.0 * PI);
        writeln!(csv, "{t},{r},{phi}").unwrap();
    }
    let data = folder.file("spiral.csv", csv);
    let columns = ["--coords", "r,phi", "--periodic", "phi", "--hidden", "8", "--epochs", "2"];
    let (run, found) = fitted(&folder, &data, "out", &columns);
    let share = found["outside"].as_f64().unwrap();
    assert!(share > 0.5, "{share}");
    assert!(run.stdout.contains("outside the learned"), "{}", run.stdout);
}

#[test]
fn friction_of_one_coordinate_is_asked_for_where_there_is_some() {
    let folder = Folder::new();
    for (damped, sigma) in [(true, 0.002), (false, 0.002), (true, 0.0), (false, 0.0)] {
        let data = folder.file("swings.csv", pendulum(12, damped, sigma));
        let more = [&COLUMNS[..], &["--hidden", "8", "--epochs", "2", "--overwrite"]].concat();
        let (run, found) = fitted(&folder, &data, "out", &more);
        assert_eq!(asks_for_friction(&run), damped, "{damped} {sigma} {}", run.stdout);
        let decay = &found["decay"];
        let [rate, error] = ["rate", "error"].map(|key| decay[key].as_f64().unwrap());
        assert!(if damped { rate > 0.3 } else { rate.abs() < 4.0 * error.max(1e-3) }, "{decay}");
    }
}

#[test]
fn constants_of_a_known_part_have_ranges() {
    let folder = Folder::new();
    let known = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/systems/grey_pendula.toml");
    let data = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/data/pendulum.csv");
    let columns = ["--coords", "theta1,theta2", "--periodic", "theta1,theta2", "--trajectory", "run", "--friction"];
    let more = ["--known", known, "--shooting-epochs", "60"];
    let (run, found) = fitted(&folder, data, "out", &[&columns[..], &more].concat());
    let ranges = found["constant_ranges"].as_object().unwrap();
    assert_eq!(ranges.keys().collect::<Vec<_>>(), ["g", "l2", "m2"], "{found}");
    for (name, truth) in [("g", 9.81), ("l2", 1.0), ("m2", 1.0)] {
        let [low, value, high] = ["low", "value", "high"].map(|key| ranges[name][key].as_f64().unwrap());
        assert!(low <= value && value <= high && found["constants"][name] == value, "{}", ranges[name]);
        assert!(low <= truth && truth <= high && high - low < 0.3 * truth, "{}", ranges[name]);
        assert!(run.stdout.contains(&format!("{name} ")), "{}", run.stdout);
    }
}
