//! The program with a model of a user's own system that loses energy.

use crate::running::{Folder, lnn, model, text};
use lnn::network::{Layout, ModelFile, NetworkLagrangian};
use lnn::rollout::{Integrator, RolloutOptions, rollout};
use serde_json::Value;
use std::fs;

/// The small network as that of an arm nobody has written a Lagrangian for, with friction or without.
fn arm(dissipation: Option<usize>) -> ModelFile<f32> {
    let mut arm = model();
    arm.header.system = "my arm".to_string();
    arm.header.parameters.clear();
    arm.header.columns = ["shoulder", "elbow", "shoulder_dot", "elbow_dot"].map(String::from).to_vec();
    arm.header.architecture.dissipation = dissipation;
    let layout = Layout::new(&arm.header.architecture);
    arm.weights.extend((arm.weights.len()..layout.parameters).map(|k| (k as f32 * 0.3).cos()));
    arm
}

fn saved(folder: &Folder, name: &str, model: &ModelFile<f32>) -> String {
    let path = folder.path(name);
    model.save(&path).unwrap();
    text(&path)
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn inspect_shows_friction_of_models_that_have_it() {
    let folder = Folder::new();
    let states = folder.file("states.csv", "elbow,shoulder,shoulder_dot,elbow_dot\n0.5,1,2,-1\n3,2,0,0\n");
    let model = saved(&folder, "damped.safetensors", &arm(Some(4)));
    let rows = lnn(&["inspect", "--model", &model, "--states", &states]).objects();
    let row = &rows[0];
    let [force, a, g, c] = ["force", "acceleration", "dl_dq", "coriolis"].map(|name| numbers(&row[name]));
    let power = row["dissipation"].as_f64().unwrap();
    assert!(power > 0.0 && (power + force[0] * 2.0 - force[1]).abs() < 1e-14 * power.max(1.0), "{power} {force:?}");
    for i in 0..2 {
        let mass = numbers(&row["mass_matrix"][i]);
        let defect = mass[0] * a[0] + mass[1] * a[1] - (g[i] - c[i] + force[i]);
        assert!(defect.abs() < 1e-12, "{defect:.1e}");
    }
    // At rest there is no friction.
    assert_eq!((numbers(&rows[1]["force"]), rows[1]["dissipation"].as_f64()), (vec![0.0; 2], Some(0.0)));
    let table = lnn(&["inspect", "--model", &model, "--states", &states, "--format", "table", "--precision", "dd"]);
    assert!(table.code == Some(0) && table.stdout.contains("  dissipation  "), "{}", table.stdout);

    let plain = saved(&folder, "plain.safetensors", &arm(None));
    let rows = lnn(&["inspect", "--model", &plain, "--states", &states]).objects();
    assert!(rows[0].get("force").is_none() && rows[0].get("dissipation").is_none());
    assert_eq!(rows[0].as_object().unwrap().len(), 8);
}

#[test]
fn a_motion_with_friction_comes_with_its_energy_balance() {
    let folder = Folder::new();
    let (damped, plain) = (arm(Some(4)), arm(None));
    let model = saved(&folder, "damped.safetensors", &damped);
    let out = text(&folder.path("motion.csv"));
    let start = ["--state", "1,2,0.5,-0.5", "--t-end", "0.5", "--dt", "0.01", "--out", &out, "--overwrite"];
    let tight = ["--rtol", "1e-10", "--atol", "1e-12"];
    let run = lnn(&[&["rollout", &model], &start[..], &tight].concat());
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let (first, second) = run.stdout.trim_end().split_once('\n').unwrap();
    // Nobody said in what unit the time of this system is.
    assert!(first.starts_with("51 samples to t = 0.5, "), "{first}");
    let words: Vec<&str> = second.split([' ', ',']).collect();
    let after = |word: &str| -> f64 { words[words.iter().position(|w| *w == word).unwrap() + 1].parse().unwrap() };
    let (change, taken, defect) = (after("by"), after("removed"), after("defect"));
    assert!(taken > 0.0 && change < 0.0 && defect.abs() < 1e-7 * taken, "{second}");
    let csv = fs::read_to_string(&out).unwrap();
    assert_eq!(csv.lines().next(), Some("t,shoulder,elbow,shoulder_dot,elbow_dot,energy"));
    // The same by the library.
    let network = NetworkLagrangian::new(damped.header.architecture, damped.weights).unwrap().cast::<f64>();
    let options = RolloutOptions::new(0.5, 0.01).tolerances(1e-10, 1e-12).method(Integrator::Dopri5);
    let balance = rollout(&network, &[1.0, 2.0], &[0.5, -0.5], &options).trajectory.energy_balance(&network).unwrap();
    assert!((balance.dissipated - taken).abs() <= 1e-9 * taken, "{balance:?} {taken}");

    for method in ["dop853", "midpoint", "gauss4", "gauss6"] {
        let run = lnn(&[&["rollout", &model], &start[..], &["--method", method]].concat());
        assert_eq!((run.code, run.stdout.lines().count()), (Some(0), 2), "{}", run.stderr);
    }
    let refused = lnn(&[&["rollout", &model], &start[..], &["--method", "variational"]].concat());
    refused.refused(2, &["variational", "friction", "gauss6"]);
    let plain = saved(&folder, "plain.safetensors", &plain);
    let run = lnn(&[&["rollout", &plain], &start[..], &["--method", "variational"]].concat());
    assert_eq!((run.code, run.stdout.lines().count()), (Some(0), 2), "{}", run.stderr);
    assert!(run.stdout.contains("conserve energy"), "{}", run.stdout);
}

#[test]
fn a_system_without_an_exact_motion_is_not_evaluated() {
    let folder = Folder::new();
    for units in [None, Some(2)] {
        let model = saved(&folder, "arm.safetensors", &arm(units));
        let out = text(&folder.path("evaluation"));
        lnn(&["evaluate", &model, "--out", &out]).refused(1, &["arm.safetensors", "\"my arm\"", "no exact motion"]);
        assert!(!folder.path("evaluation").exists());
    }
}
