//! Constraints from outside: in system files, in roll-outs, found in data.
#![cfg(unix)]

use crate::running::{Folder, lnn, text};
use serde_json::Value;
use std::fmt::Write;
use std::fs;

const PENDULUM: &str = include_str!("../../../examples/systems/cartesian_pendulum.toml");

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

/// Columns of a CSV without its header.
fn columns(text: &str) -> Vec<Vec<f64>> {
    text.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect()
}

#[test]
fn a_file_with_constraints_moves_on_them() {
    let folder = Folder::new();
    let file = folder.file("my.toml", PENDULUM);
    let motion = text(&folder.path("motion.csv"));
    let roll = |state: &str, more: &[&str]| {
        let start = ["rollout", "--system", &file, "--state", state, "--t-end", "5", "--dt", "0.05"];
        lnn(&[&start, ["--out", &motion, "--overwrite"].as_slice(), more].concat())
    };
    for method in ["dopri5", "variational", "gauss4"] {
        roll("0.6,-0.8,0,0", &["--method", method]).succeeded();
        let rows = columns(&fs::read_to_string(&motion).unwrap());
        assert_eq!(rows.len(), 101);
        for row in &rows {
            assert!(
                (row[1].hypot(row[2]) - 1.0).abs() < 1e-12 && (row[5] - rows[0][5]).abs() < 5e-2,
                "{method}: {row:?}"
            );
        }
    }
    // Off the rod, with the nearest state to copy; a longer rod takes it.
    roll("0.66,-0.88,0,0", &[]).refused(2, &["--state", "1.000e-1 away", "rod", "0.6,-0.8"]);
    roll("0.66,-0.88,0,0", &["--param", "l=1.1"]).succeeded();
    // At the lowest point the rod carries weight and centrifugal force.
    let states = folder.file("states.csv", "x,y,x_dot,y_dot\n0,-1,3,0\n");
    let found = lnn(&["inspect", "--system", &file, "--states", &states]);
    found.succeeded();
    let found = json(&found.stdout);
    assert!((found["constraint_force"][1].as_f64().unwrap() - 18.81).abs() < 1e-12);
    assert_eq!(
        (found["multipliers"].as_array().unwrap().len(), &found["constraint_values"][0]),
        (1, &Value::from(0.0))
    );
    assert_eq!(found["reduced_eigenvalues"].as_array().unwrap().len(), 1);
    // What knows free coordinates only says so.
    lnn(&["symmetries", "--system", &file]).refused(2, &["constraints"]);
    let listed = lnn(&["systems", "--system", &file, "--json"]);
    assert_eq!(json(&listed.stdout)["constraints"]["rod"], "x^2 + y^2 - l^2");
}

/// Choices of a training that takes a moment.
const SMALL: [&str; 6] = ["--hidden", "6", "--epochs", "2", "--threads", "2"];

/// States of a model's file that are off the rod of 1 m, by a roll-out from one that is on it.
fn off_the_rod(folder: &Folder, model: &str) -> f64 {
    let out = text(&folder.path("learned.csv"));
    let roll = ["rollout", model, "--state", "0.6,-0.8,0,0", "--t-end", "0.2", "--dt", "0.02", "--beyond-range"];
    lnn(&[&roll[..], &["--out", &out, "--overwrite"]].concat()).succeeded();
    let rows = columns(&fs::read_to_string(&out).unwrap());
    assert_eq!(rows.len(), 11);
    rows.iter().map(|row| (row[1].hypot(row[2]) - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn a_system_with_constraints_is_learned_on_them() {
    let folder = Folder::new();
    let file = folder.file("my.toml", PENDULUM);
    let run = text(&folder.path("run"));
    let few = ["--set", "data.training=256", "--set", "data.validation=64", "--set", "data.test=64"];
    let train = |system: &str, run: &str, more: &[&str]| {
        lnn(&[&["train", system, "--out", run, "--overwrite"], &SMALL[..], &few, more].concat())
    };
    train(&file, &run, &["--param", "l=1"]).succeeded();
    assert!(off_the_rod(&folder, &run) < 1e-12);
    let summary = json(&fs::read_to_string(folder.path("run/summary.json")).unwrap());
    // All states are on the constraints, where the mass matrix of one degree of freedom has one sign, and every one has an acceleration.
    assert_eq!(
        (&summary["test_states_left_out"], summary["accelerations"].as_array().unwrap().len()),
        (&Value::from(0), 2)
    );
    for picture in ["constraint_forces.svg", "constraint_drift.svg", "constrained_motion_x_y.svg"] {
        assert!(folder.path("run").join(picture).exists(), "{picture}");
    }
    // Terms of the learned model have forces of constraint, and the same command says what holds it.
    let states = folder.file("states.csv", "x,y,x_dot,y_dot\n0,-1,3,0\n");
    let terms = lnn(&["inspect", "--model", &run, "--states", &states]);
    terms.succeeded();
    assert_eq!(json(&terms.stdout)["constraint_force"].as_array().unwrap().len(), 2);
    let said = lnn(&["constraints", &run, "--json"]);
    said.succeeded();
    assert_eq!(json(&said.stdout)["constraints"][0]["formula"], "x^2 + y^2 - l^2");
    lnn(&["evaluate", &run, "--starts", "1", "--until", "0.5"]).succeeded();
    // What knows free coordinates only says so, and so does a second set of constraints.
    lnn(&["symmetries", "--model", &run]).refused(2, &["constraints"]);
    lnn(&["certify", "--model", &run]).refused(2, &["constraints"]);
    // Its page has what holds the motion, beside the exact system under the same constraint.
    let page = fs::read_to_string(folder.path("run/play.html")).unwrap();
    lnn(&["page", &run, "--out", &text(&folder.path("page.html"))]).succeeded();
    assert_eq!(fs::read_to_string(folder.path("page.html")).unwrap(), page);
    let (_, data) = page.split_once("id=\"data\">").unwrap();
    let data = json(data.split_once("</script>").unwrap().0);
    assert_eq!(data["constraints"]["rod"], "x^2 + y^2 - l^2");
    for kind in ["learned", "exact"] {
        let rows = data[kind]["held"]["rows"].as_array().unwrap();
        assert_eq!((rows.len(), &rows[0]["holonomic"]), (1, &Value::Bool(true)), "{kind}");
    }
    let start: Vec<f64> = data["start"]["q"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    assert!((start[0].hypot(start[1]) - 1.0).abs() < 1e-14, "{start:?}");
    let roll = ["rollout", &run, "--state", "0.6,-0.8,0,0", "--t-end", "1", "--dt", "0.1", "--constraints", &file];
    lnn(&[&roll[..], &["--out", &text(&folder.path("two.csv"))]].concat()).refused(2, &["constraints of its own"]);
    // One of the catalogue: formulas are kept with the model.
    let top = text(&folder.path("top"));
    train("rigid-body", &top, &["--structure", "mechanical"]).succeeded();
    let said = lnn(&["constraints", &top, "--json"]);
    assert_eq!(json(&said.stdout)["count"], 6);
    // Bounds of which no state comes to the constraint.
    let far = PENDULUM.replace("rod = \"x^2 + y^2 - l^2\"", "rod = \"x^2 + y^2 + l^2\"");
    train(&folder.file("far.toml", far), &run, &[]).refused(2, &["contradicts"]);
}

#[test]
fn recorded_motion_is_learned_under_constraints_that_were_found_or_given() {
    let folder = Folder::new();
    let file = folder.file("my.toml", PENDULUM);
    // Eight swings and turns of a pendulum of 1 m.
    let tracks: Vec<String> = (0..8)
        .map(|k| {
            let (sin, cos) = (0.8 * f64::from(k)).sin_cos();
            let rate = 0.7 * f64::from(k) - 2.0;
            let state = format!("{sin},{},{},{}", -cos, rate * cos, rate * sin);
            let out = text(&folder.path(&format!("track{k}.csv")));
            let roll =
                ["rollout", "--system", &file, "--state", &state, "--t-end", "1.5", "--dt", "0.01", "--out", &out];
            lnn(&roll).succeeded();
            out
        })
        .collect();
    let tracks: Vec<&str> = tracks.iter().map(String::as_str).collect();
    let run = text(&folder.path("run"));
    let fit = |more: &[&str]| {
        let columns = ["--coords", "x,y", "--time", "t", "--structure", "mechanical", "--out", &run, "--overwrite"];
        lnn(&[&["fit"], &tracks[..], &columns, &SMALL, more].concat())
    };
    let found = fit(&["--constraints", "find"]);
    found.succeeded();
    let summary = json(&fs::read_to_string(folder.path("run/summary.json")).unwrap());
    let constraints = &summary["constraints"];
    assert_eq!((&constraints["found"], constraints["formulas"].as_object().unwrap().len()), (&Value::from(true), 1));
    assert!(constraints["distance"].as_f64().unwrap() < 1e-5, "{constraints}");
    assert!(summary["validation_loss"].as_f64().unwrap().is_finite());
    // Predictions of held-out motion were made on the rod, none was given up.
    assert_eq!(summary["model"][0]["missing"], 0);
    assert!(off_the_rod(&folder, &run) < 1e-6);
    for picture in ["constraint_forces.svg", "constraint_drift.svg", "constrained_motion_x_y.svg"] {
        assert!(folder.path("run").join(picture).exists(), "{picture}");
    }
    let said = lnn(&["constraints", &run, "--json"]);
    said.succeeded();
    let formula = json(&said.stdout)["constraints"][0]["formula"].as_str().unwrap().to_string();
    assert!(formula.contains("x^2") && formula.contains("y^2"), "{formula}");
    // Beside a system with constraints of its own, each keeps its own.
    lnn(&["evaluate", &run, "--system", &file, "--starts", "1", "--until", "0.5"]).succeeded();
    // A fit that goes on has the same constraints: its configuration says how they came.
    let config = fs::read_to_string(folder.path("run/config.toml")).unwrap();
    assert!(config.contains("constraints = \"find\""), "{config}");

    // Given by a file, of which a run keeps the formulas; one of two that say the same is left out.
    let rods = folder.file("rods.toml", "[constraints]\nrod = \"x^2 + y^2 - 1\"\nsame = \"sqrt(x^2 + y^2) - 1\"\n");
    let given = fit(&["--constraints", &rods]);
    given.succeeded();
    assert!(given.stderr.contains("`same` follows from the others"), "{}", given.stderr);
    let summary = json(&fs::read_to_string(folder.path("run/summary.json")).unwrap());
    assert_eq!(summary["constraints"]["formulas"]["rod"], "x^2 + y^2 - 1");
    assert_eq!(summary["constraints"]["found"], false);
    assert!(off_the_rod(&folder, &run) < 1e-12);
    let config = fs::read_to_string(folder.path("run/config.toml")).unwrap();
    assert!(config.contains("[constraints]") && config.contains("rod = \"x^2 + y^2 - 1\""), "{config}");
    // Through the motion too.
    fit(&["--constraints", "find", "--targets", "motion", "--shooting-epochs", "2"]).succeeded();
    assert!(folder.path("run/shooting.csv").exists() && off_the_rod(&folder, &run) < 1e-6);
    // Without constraints nothing is said of them.
    fit(&["--constraints", "none"]).succeeded();
    let summary = json(&fs::read_to_string(folder.path("run/summary.json")).unwrap());
    assert!(summary.get("constraints").is_none());

    // What the motion does not obey, mistakes, contradictions, and no motion left are refused.
    let table = |formulas: &str| folder.file("wrong.toml", format!("[constraints]\n{formulas}\n"));
    for (formulas, parts) in [
        ("rod = \"x^2 + y^2 - 2\"", "does not obey"),
        ("rod = \"x^2 + z\"", "constraints.rod"),
        ("rod = \"x^2 + y^2 - 1\"\nline = \"x - 3\"", "contradicts"),
        ("rod = \"x^2 + y^2 - 1\"\nline = \"y - 2*x\"", "no motion"),
    ] {
        fit(&["--constraints", &table(formulas)]).refused(2, &[parts]);
    }
    fit(&["--constraints", "nowhere.toml"]).refused(1, &["nowhere.toml"]);
}

#[test]
fn mistakes_in_constraints_have_their_line() {
    let folder = Folder::new();
    let with = |formula: &str| folder.file("my.toml", PENDULUM.replace("x^2 + y^2 - l^2", formula));
    for (formula, parts) in [
        ("x^2 + z", ["constraints.rod", "z"]),
        ("x_dot*y_dot", ["constraints.rod", "linear in the velocities"]),
        ("l - 1", ["constraints.rod", "a coordinate or a velocity"]),
    ] {
        lnn(&["systems", "--system", &with(formula)]).refused(2, &parts);
    }
    let twice = PENDULUM.replace("rod = ", "line = \"x - 3*l\"\nrod = ");
    let file = folder.file("my.toml", &twice);
    let out = text(&folder.path("motion.csv"));
    let roll = ["rollout", "--system", &file, "--state", "1,0,0,0", "--t-end", "1", "--dt", "0.1", "--out", &out];
    lnn(&roll).refused(2, &["contradicts"]);
    // The same rod twice is one rod.
    let twice = PENDULUM.replace("rod = ", "again = \"(x^2 + y^2)/l - l\"\nrod = ");
    let file = folder.file("my.toml", &twice);
    let roll = ["rollout", "--system", &file, "--state", "1,0,0,0", "--t-end", "1", "--dt", "0.1", "--out", &out];
    let done = lnn(&roll);
    done.succeeded();
    assert!(done.stderr.contains("`rod` follows from the others"), "{}", done.stderr);
}

#[test]
fn what_is_found_in_data_holds_another_motion() {
    let folder = Folder::new();
    let mut data = String::from("run,t,x,y\n");
    for run in 0..12 {
        let (phase, rate) = (0.5 * f64::from(run), 1.0 + 0.2 * f64::from(run));
        for k in 0..80 {
            let t = 0.01 * f64::from(k);
            let (s, c) = (phase + rate * t).sin_cos();
            writeln!(data, "{run},{t},{:.12},{:.12}", 0.5 * s, -0.5 * c).unwrap();
        }
    }
    let (file, out) = (folder.file("data.csv", &data), text(&folder.path("found.toml")));
    let args = ["constraints", &file, "--coords", "x,y", "--trajectory", "run"];
    let found = lnn(&[&args[..], &["--json", "--out", &out]].concat());
    found.succeeded();
    let found = json(&found.stdout);
    assert_eq!((&found["count"], &found["trajectories"]), (&Value::from(1), &Value::from(12)));
    let one = &found["constraints"][0];
    assert_eq!(one["kind"], "holonomic");
    assert!((one["coefficients"]["1"].as_f64().unwrap() + 0.25).abs() < 1e-6);
    assert!(one["range"]["y^2"][0].as_f64().unwrap() <= one["range"]["y^2"][1].as_f64().unwrap());
    assert!(found["gap"].as_f64().unwrap() > 100.0 && one["formula"].as_str().unwrap().contains("x^2 + "));
    // A file that is there is kept; text says the same.
    lnn(&[&args[..], &["--out", &out]].concat()).refused(1, &["--overwrite"]);
    let said = lnn(&args);
    said.succeeded();
    assert!(said.stdout.starts_with("1 constraint found"), "{}", said.stdout);
    // Under the table of the file a free mass is a pendulum of half a metre.
    let free = folder.file(
        "free.toml",
        PENDULUM.replace("[constraints]\nrod = \"x^2 + y^2 - l^2\"\n", "").replace("l = {", "unused = {"),
    );
    let motion = text(&folder.path("motion.csv"));
    let roll =
        ["rollout", "--system", &free, "--state", "0.3,-0.4,0,0", "--t-end", "1", "--dt", "0.1", "--out", &motion];
    lnn(&[&roll[..], &["--constraints", &out]].concat()).succeeded();
    let rows = columns(&fs::read_to_string(&motion).unwrap());
    assert!(rows.iter().all(|row| (row[1].hypot(row[2]) - 0.5).abs() < 1e-6));
    // And falls without it.
    lnn(&[&roll[..], &["--overwrite"]].concat()).succeeded();
    assert!(columns(&fs::read_to_string(&motion).unwrap())[10][2] < -4.0);
    lnn(&[&roll[..], &["--overwrite", "--constraints", &free]].concat()).refused(2, &["[constraints]"]);
    lnn(&["constraints", &file, "--coords", "x,y", "--trajectory", "run", "--degree", "9"]).refused(2, &["--degree"]);
    assert_eq!(lnn(&["constraints", &file]).stdout, said.stdout, "the guess is the same");
    lnn(&["constraints", "heavy-top", "--out", &out]).refused(2, &["--out"]);
}

#[test]
fn degenerate_lagrangians_are_named_with_their_directions() {
    let folder = Folder::new();
    let file = PENDULUM.replace("m*(x_dot^2 + y_dot^2)/2 - m*g*y", "m*(x_dot - y_dot)^2/2 - m*g*(x - y)");
    let file = file.replace("[constraints]\nrod = \"x^2 + y^2 - l^2\"\n", "").replace("l = {", "unused = {");
    let file = folder.file("my.toml", &file);
    let found = lnn(&["constraints", &file, "--json"]);
    found.succeeded();
    let found = json(&found.stdout);
    assert_eq!((&found["count"], &found["open"]), (&Value::from(0), &Value::from(1)));
    assert_eq!(found["states"], found["open_states"]);
    let direction = &found["null_directions"][0];
    assert!((direction[0].as_f64().unwrap() - direction[1].as_f64().unwrap()).abs() < 1e-12);
    let states = folder.file("states.csv", "x,y,x_dot,y_dot\n0,-1,3,0\n");
    let args = ["inspect", "--system", &file, "--states", &states];
    let failed = lnn(&args);
    assert!(failed.code == Some(1) && failed.stderr.contains("singular"));
    let least = lnn(&[&args[..], &["--least-norm"]].concat());
    least.succeeded();
    let least = json(&least.stdout);
    for (i, exact) in [-4.905, 4.905].into_iter().enumerate() {
        assert!((least["acceleration"][i].as_f64().unwrap() - exact).abs() < 1e-12);
    }
    let out = text(&folder.path("motion.csv"));
    let roll = ["rollout", "--system", &file, "--state", "0,1,0,0", "--t-end", "1", "--dt", "0.1", "--out", &out];
    lnn(&roll).refused(1, &["singular"]);
    let least = lnn(&[&roll[..], &["--least-norm", "--overwrite"]].concat());
    least.succeeded();
    assert!(least.stderr.contains("along 1 direction"), "{}", least.stderr);
    let end = columns(&fs::read_to_string(&out).unwrap())[10][1..3].to_vec();
    assert!((end[0] + 4.905 / 2.0).abs() < 1e-6 && (end[1] - 1.0 - 4.905 / 2.0).abs() < 1e-6, "{end:?}");
}

const SLIDER: &str = "name = \"slider\"\n\
    lagrangian = \"m1*(x1_dot^2+y1_dot^2)/2 - m1*g*y1 + m2*x2_dot^2/2\"\n\
    [[coordinates]]\nname = \"x1\"\nbounds = [-2, 2]\nvelocity_bounds = [-2, 2]\n\
    [[coordinates]]\nname = \"y1\"\nbounds = [-2, 2]\nvelocity_bounds = [-2, 2]\n\
    [[coordinates]]\nname = \"x2\"\nbounds = [-4, 4]\nvelocity_bounds = [-2, 2]\n\
    [parameters]\nm1 = 1\nm2 = 1\ng = 9.81\nr = 1\nl = 2\n\
    [constraints]\ncrank = \"x1^2 + y1^2 - r^2\"\nrod = \"(x2-x1)^2 + y1^2 - l^2\"\nagain = \"2*(x2-x1)^2 + 2*y1^2 - 2*l^2\"\n";

#[test]
fn the_later_of_two_constraints_follows_and_inverse_dynamics_divides_the_force() {
    let folder = Folder::new();
    let file = folder.file("slider.toml", SLIDER);
    let said = json(&lnn(&["constraints", &file, "--json"]).stdout);
    assert_eq!(said["redundant"], serde_json::json!(["again"]), "{said}");
    let columns = "x1,y1,x2,x1_dot,y1_dot,x2_dot,x1_ddot,y1_ddot,x2_ddot";
    let inverse = |a: &str| {
        let states = folder.file("states.csv", format!("{columns}\n0.6,0.8,2.433030277982336,0,0,0,{a}\n"));
        lnn(&["inspect", "--system", &file, "--states", &states, "--inverse"])
    };
    // Held still: a force from outside and the rods carry the weight of 9.81 N together.
    let found = json(&inverse("0,0,0").stdout);
    let of = |name: &str| -> Vec<f64> { found[name].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect() };
    let (outside, carried) = (of("external_force"), of("constraint_force"));
    for (i, weight) in [0.0, 9.81, 0.0].into_iter().enumerate() {
        assert!((outside[i] + carried[i] - weight).abs() < 1e-9, "{found}");
    }
    // The crank turns (-0.8, 0.6) at the joint, and the slider with it: the shortest force lies along that.
    let along = [-0.8, 0.6, -0.8 - 0.6 * 0.8 / 1.833_030_277_982_336];
    let factor = outside[1] / along[1];
    assert!(outside.iter().zip(along).all(|(f, x)| (f - factor * x).abs() < 1e-9) && factor > 0.0, "{found}");
    assert_eq!(of("multipliers").len(), 2);
    // No motion of the crank has this acceleration.
    let run = inverse("1,0,0");
    assert!(run.code == Some(1) && run.stderr.contains("row 2"), "{}", run.stderr);
    let said = json(&run.stdout);
    assert!(said["error"].as_str().unwrap().contains("rod") && said["external_force"].is_null(), "{said}");
}

#[test]
fn a_motion_at_a_second_branch_ends_with_its_time_and_names_the_constraint() {
    let folder = Folder::new();
    let wheels = "name = \"gear\"\nlagrangian = \"(a_dot^2 + 2*b_dot^2)/2\"\n\
        [[coordinates]]\nname = \"a\"\nunit = \"rad\"\nbounds = [-3, 3]\nvelocity_bounds = [-2, 2]\n\
        [[coordinates]]\nname = \"b\"\nunit = \"rad\"\nbounds = [-3, 3]\nvelocity_bounds = [-2, 2]\n\
        [constraints]\nmesh = \"FORMULA\"\n";
    let roll = |formula: &str| {
        let file = folder.file("gear.toml", wheels.replace("FORMULA", formula));
        let out = text(&folder.path("motion.csv"));
        let start = ["--state", "0,0.3,1,2", "--t-end", "6", "--dt", "0.05", "--overwrite", "--out", &out];
        lnn(&[&["rollout", "--system", &file], &start[..]].concat())
    };
    // b reaches a half turn at (pi - 0.3)/2 = 1.42 s.
    roll("cos(b) - cos(2*a + 0.3)").refused(1, &["`mesh`", "second branch", "t = 1.42"]);
    roll("sin(b - 2*a - 0.3)").succeeded();
}
