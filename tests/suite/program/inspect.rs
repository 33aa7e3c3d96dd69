//! The program from outside: results, exit codes and the one line that says what is wrong.

use crate::running::{Folder, HEADER, inspect, lnn, model, text};
use serde_json::Value;
use std::process::Command;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn systems_are_listed() {
    let run = lnn(&["systems", "--json"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let all: Vec<Value> = run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let all = Value::from(all);
    let names: Vec<_> = all.as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    for name in [
        "double-pendulum",
        "triple-pendulum",
        "n-pendulum",
        "spring-pendulum",
        "sphere-geodesic",
        "constant-force",
        "harmonic-oscillator",
        "kepler",
        "henon-heiles",
        "lattice",
        "cloth",
        "charged-particle",
        "ads2-geodesic",
        "ads3-geodesic",
        "ads4-geodesic",
        "schwarzschild-geodesic",
    ] {
        assert!(names.contains(&name), "{name}");
    }
    let named = |name: &str| all.as_array().unwrap().iter().find(|s| s["name"] == name).unwrap();
    let ads = named("ads4-geodesic");
    assert_eq!((ads["time_like"].as_str(), ads["time_unit"].as_str()), (Some("t"), Some("m")));
    assert_eq!(ads["units"][4], "m/m");
    let shell = "t_dot = sqrt(x_dot^2 + y_dot^2 + z_dot^2 + (z/L)^2)";
    assert_eq!(ads["constraint"], shell);
    let pendulum = named("double-pendulum");
    assert!(pendulum["time_like"].is_null() && pendulum["constraint"].is_null() && pendulum["time_unit"] == "s");
    for system in all.as_array().unwrap() {
        let n = system["coordinates"].as_array().unwrap().len();
        for (key, length) in [("columns", 2 * n), ("units", 2 * n), ("periodic", n)] {
            assert_eq!(system[key].as_array().unwrap().len(), length, "{key} of {}", system["name"]);
        }
        for parameter in system["parameters"].as_array().unwrap() {
            assert!(
                parameter["symbol"].is_string() && parameter["default"].is_number() && parameter["unit"].is_string()
            );
        }
        assert_eq!(system["bounds"]["validation"]["position"].as_array().unwrap().len(), n);
    }
    let table = lnn(&["systems"]).stdout;
    assert!(names.iter().all(|name| table.contains(name)));
    assert!(table.contains(shell) && table.contains("time-like"));
}

#[test]
fn inspect_prints_every_term() {
    let folder = Folder::new();
    // Equal masses and lengths, g = 9.8, both rods level and at rest: M = [[2, 1], [1, 1]], g = -9.8 (2, 1), a = (-9.8, 0).
    let quarter = std::f64::consts::FRAC_PI_2;
    let states = folder.file("s.csv", format!("{HEADER}{quarter:?},{quarter:?},0,0\n0,0,1,2\n"));
    let objects = inspect("double-pendulum", &states, &[]).objects();
    assert_eq!(objects.len(), 2);
    let close = |value: &Value, expected: &[f64]| {
        let found = numbers(value);
        assert_eq!(found.len(), expected.len());
        assert!(
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 1e-14 * b.abs().max(1.0)),
            "{found:?} {expected:?}"
        );
    };
    let level = &objects[0];
    close(&level["mass_matrix"][0], &[2.0, 1.0]);
    close(&level["mass_matrix"][1], &[1.0, 1.0]);
    close(&level["eigenvalues"], &[(3.0 - 5f64.sqrt()) / 2.0, (3.0 + 5f64.sqrt()) / 2.0]);
    close(&level["dl_dq"], &[-19.6, -9.8]);
    close(&level["coriolis"], &[0.0, 0.0]);
    close(&level["momentum"], &[0.0, 0.0]);
    close(&level["acceleration"], &[-9.8, 0.0]);
    let swinging = &objects[1];
    close(&swinging["momentum"], &[4.0, 3.0]);
    let (energy, value) = (swinging["energy"].as_f64().unwrap(), swinging["lagrangian"].as_f64().unwrap());
    // T = p.v/2 = 5, so E + L = 2 T whatever the zero of the potential.
    assert!((energy + value - 10.0).abs() < 1e-13);
    let keys: Vec<_> = swinging.as_object().unwrap().keys().collect();
    assert_eq!(keys.len(), 8);

    let table = inspect("double-pendulum", &states, &["--format", "table"]);
    assert_eq!(table.code, Some(0));
    assert!(table.stdout.starts_with("row 2\n") && table.stdout.contains("row 3\n"));
}

#[test]
fn linearizations_are_slopes_of_the_accelerations() {
    let folder = Folder::new();
    // theta1 is moved, then the velocity of theta2.
    let states = folder.file("s.csv", format!("{HEADER}0.3,0.2,1,-1\n0.3001,0.2,1,-1\n0.3,0.2,1,-0.9999\n"));
    let objects = inspect("double-pendulum", &states, &["--linearize"]).objects();
    let row = |k: usize, name: &str, i: usize| numbers(&objects[k][name][i]);
    for (moved, name, column) in [(1, "acceleration_by_q", 0), (2, "acceleration_by_v", 1)] {
        for i in 0..2 {
            let [before, after] = [0, moved].map(|k| numbers(&objects[k]["acceleration"])[i]);
            let middle = (row(0, name, i)[column] + row(moved, name, i)[column]) / 2.0;
            assert!(((after - before) / 1e-4 - middle).abs() < 1e-5, "{name} {i}");
        }
    }
    // Twice the mass and gravity give the slopes by parameters of m1, m2, l1, l2, g: a is homogeneous in the masses.
    let by: Vec<Vec<f64>> = (0..5).map(|k| row(0, "acceleration_by_parameters", k)).collect();
    assert!((0..2).all(|i| (by[0][i] + by[1][i]).abs() < 1e-12) && by[4].iter().any(|x| x.abs() > 1e-3));
    // By a force: the inverse of the mass matrix.
    let (m, w) = (objects[0]["mass_matrix"].clone(), objects[0]["acceleration_by_force"].clone());
    let [m, w] = [m, w].map(|matrix| [numbers(&matrix[0]), numbers(&matrix[1])]);
    assert!((m[0][0] * w[0][0] + m[0][1] * w[1][0] - 1.0).abs() < 1e-13);
    // A state without an acceleration has none of its slopes.
    let pole = folder.file("p.csv", "theta,phi,theta_dot,phi_dot\n0,2,3,4\n1,2,3,4\n");
    let found = inspect("sphere-geodesic", &pole, &["--linearize"]);
    assert_eq!(found.code, Some(1));
    let lines: Vec<Value> = found.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines[0]["acceleration_by_q"].is_null() && lines[1]["acceleration_by_q"].is_array());
}

#[test]
fn the_structure_of_a_lagrangian_is_a_picture() {
    let picture = lnn(&["inspect", "--system", "henon-heiles", "--structure"]);
    assert_eq!(picture.code, Some(0));
    assert!(picture.stdout.contains("  =.\n  .=\n") && picture.stdout.contains("1 group "), "{}", picture.stdout);
    let object = lnn(&["inspect", "--system", "kepler", "--structure", "--json"]);
    let object: Value = serde_json::from_str(&object.stdout).unwrap();
    assert_eq!(
        (object["mass_matrix"][1][2].as_str(), object["mixed"].as_array().unwrap().len()),
        (Some("constant"), 0)
    );
    assert_eq!(object["stiffness"][0][2], "varying");
    // A network is as full as its form says.
    let full = lnn(&["inspect", "--model", "examples/data/double_pendulum.safetensors", "--structure"]);
    assert!(full.stdout.contains("M = d2L/dv dv: 4 of 4 elements"), "{}", full.stdout);
    assert_eq!(lnn(&["inspect", "--system", "kepler"]).code, Some(2));
}

#[test]
fn canonical_forms_agree_at_the_base_state() {
    let folder = Folder::new();
    let states = folder.file("s.csv", format!("{HEADER}0.3,0.2,1,-1\n0.7,-1.2,0.5,2\n"));
    let plain = inspect("double-pendulum", &states, &[]).objects();
    let base = inspect("double-pendulum", &states, &["--canonical"]).objects();
    assert_eq!(base[0]["lagrangian"], 0.0);
    assert!(
        numbers(&base[0]["momentum"]).iter().all(|p| *p == 0.0) && base[0]["energy"].as_f64().unwrap().abs() < 1e-14
    );
    let matrix: Vec<f64> = base[0]["mass_matrix"].as_array().unwrap().iter().flat_map(numbers).collect();
    assert!((matrix[0] * matrix[3] - matrix[1] * matrix[2] - 1.0).abs() < 1e-14);
    for (before, after) in plain.iter().zip(&base) {
        assert_eq!(before["acceleration"], after["acceleration"]);
        assert_eq!(after.as_object().unwrap().len(), before.as_object().unwrap().len() + 1);
    }
    // Twice the masses are the same arm, at a base state that is named as well.
    let named = "--canonical=0.3,0.2,1,-1";
    let heavy = inspect("double-pendulum", &states, &[named, "--param", "m1=2", "m2=2"]).objects();
    for key in ["lagrangian", "energy", "canonical_factor"] {
        let half = if key == "canonical_factor" { 0.5 } else { 1.0 };
        for (one, two) in base.iter().zip(&heavy) {
            let [one, two] = [one, two].map(|state| state[key].as_f64().unwrap());
            assert!((half * one - two).abs() < 1e-13, "{key}: {one} {two}");
        }
    }
    let told = inspect("double-pendulum", &states, &["--canonical", "--format", "table"]).stdout;
    assert!(told.contains("canonical_factor"), "{told}");
    inspect("double-pendulum", &states, &["--canonical=1,2"]).refused(2, &["--canonical", "expected 4", "found 2"]);
    let pole = folder.file("p.csv", "theta,phi,theta_dot,phi_dot\n0,2,3,4\n");
    inspect("sphere-geodesic", &pole, &["--canonical"]).refused(1, &["--canonical", "the mass matrix is singular"]);
}

#[test]
fn inspect_takes_columns_in_any_order_and_parameters_in_any_form() {
    let folder = Folder::new();
    let straight = folder.file("a.csv", format!("{HEADER}0.1,0.2,0.3,0.4\n"));
    let turned = folder.file("b.csv", "\u{feff}theta2_dot, theta1 ,theta1_dot,theta2\r\n0.4,0.1,0.3,0.2\r\n");
    let together = inspect("double-pendulum", &straight, &["--param", "m1=2", "l2=0.5"]).objects();
    let apart = inspect("double-pendulum", &turned, &["--param", "m1=2", "--param", "l2=0.5"]).objects();
    assert_eq!(together, apart);
    assert_ne!(together, inspect("double-pendulum", &straight, &[]).objects());

    let chain = folder.file("c.csv", "theta1,theta1_dot,theta2,theta2_dot,theta3,theta3_dot\n1,2,3,4,5,6\n");
    let three = inspect("n-pendulum", &chain, &["--param", "n=3"]).objects();
    assert_eq!(numbers(&three[0]["acceleration"]).len(), 3);
}

#[test]
fn precision_is_that_of_the_run() {
    let folder = Folder::new();
    let states = folder.file("s.csv", format!("{HEADER}0.1,0.2,0.3,0.4\n"));
    let energy = |precision: &str| {
        let run = inspect("double-pendulum", &states, &["--precision", precision]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let digits = run.stdout.rsplit("\"energy\":").next().unwrap().trim_end().trim_end_matches('}').to_string();
        (serde_json::from_str::<f64>(&digits).unwrap(), digits)
    };
    let (single, _) = energy("f32");
    let (double, _) = energy("f64");
    let (judge, digits) = energy("dd");
    assert!((single - judge).abs() < 1e-5 * judge.abs() && single != judge);
    assert!((double - judge).abs() < 1e-14 * judge.abs());
    assert!(digits.chars().filter(char::is_ascii_digit).count() > 28, "{digits}");
}

#[test]
fn a_singular_mass_matrix_leaves_the_other_rows_right() {
    let folder = Folder::new();
    let states = folder.file("s.csv", "theta,phi,theta_dot,phi_dot\n1,2,3,4\n0,0,1,1\n1.5,2,3,4\n");
    let run = inspect("sphere-geodesic", &states, &[]);
    assert_eq!(run.code, Some(1));
    assert_eq!(run.stderr.lines().count(), 1);
    assert!(run.stderr.contains("row 3: the mass matrix is singular (condition number inf)"), "{}", run.stderr);
    let objects: Vec<Value> = run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(objects.len(), 3);
    assert!(objects[1]["acceleration"].is_null() && objects[1]["error"].is_string());
    assert!(objects[1]["mass_matrix"].is_array());
    for k in [0, 2] {
        assert!(objects[k]["error"].is_null());
        assert_eq!(numbers(&objects[k]["acceleration"]).len(), 2);
    }
}

#[test]
fn a_model_is_inspected_like_a_system() {
    let folder = Folder::new();
    let path = folder.path("model.safetensors");
    model().save(&path).unwrap();
    let states = folder.file("s.csv", format!("{HEADER}0.1,0.2,3,4\n{:?},0.2,3,4\n", 0.1 + std::f64::consts::TAU));
    let run = |precision| lnn(&["inspect", "--model", &text(&path), "--states", &states, "--precision", precision]);
    let (single, double, judge) = (run("f32").objects(), run("f64").objects(), run("dd").objects());
    for key in ["momentum", "dl_dq", "eigenvalues", "coriolis", "acceleration"] {
        for (k, exact) in numbers(&judge[0][key]).into_iter().enumerate() {
            let size = exact.abs().max(1.0);
            assert!((numbers(&double[0][key])[k] - exact).abs() < 1e-12 * size, "{key}");
            assert!((numbers(&single[0][key])[k] - exact).abs() < 1e-3 * size, "{key}");
            // A turn further the network sees the same angle.
            assert!((numbers(&double[1][key])[k] - exact).abs() < 1e-11 * size, "{key}");
        }
    }
}

#[test]
fn files_that_are_no_models_are_data_errors() {
    let folder = Folder::new();
    let states = folder.file("s.csv", format!("{HEADER}1,2,3,4\n"));
    let refused = |path: &str, parts: &[&str]| {
        lnn(&["inspect", "--model", path, "--states", &states]).refused(1, &[&[path], parts].concat());
    };
    refused(&text(&folder.path("missing.safetensors")), &["no such file"]);
    refused(&text(folder.0.path()), &["there is no model.safetensors in this directory"]);
    refused(&states, &["not a whole safetensors file"]);
    let bytes = model().to_bytes().unwrap();
    refused(&folder.file("cut", &bytes[..bytes.len() - 5]), &["not a whole safetensors file"]);
    let mut flipped = bytes.clone();
    *flipped.last_mut().unwrap() ^= 4;
    refused(&folder.file("flipped", flipped), &["damaged: checksum"]);
    let empty = br#"{"w":{"dtype":"F32","shape":[0],"data_offsets":[0,0]}}"#;
    let foreign = [&(empty.len() as u64).to_le_bytes()[..], empty].concat();
    refused(&folder.file("foreign", foreign), &["not of an lnn model"]);

    let path = folder.file("model", bytes);
    let both = ["inspect", "--model", &path, "--states", &states, "--system", "double-pendulum"];
    lnn(&both).refused(2, &["--system", "--model"]);
    lnn(&["inspect", "--model", &path, "--states", &states, "--param", "m1=1"]).refused(2, &["--param", "--model"]);
    lnn(&["inspect", "--states", &states]).refused(2, &["--system"]);
}

#[test]
fn wrong_arguments_are_usage_errors() {
    let folder = Folder::new();
    let states = folder.file("s.csv", format!("{HEADER}1,2,3,4\n"));
    inspect("duoble-pendulum", &states, &[]).refused(2, &["duoble-pendulum", "double-pendulum"]);
    inspect("double-pendulum", &states, &["--param", "m3=1"]).refused(2, &["m3", "m1"]);
    inspect("double-pendulum", &states, &["--param", "m1=nan"]).refused(2, &["m1", "nan"]);
    inspect("double-pendulum", &states, &["--param", "m1=-1"]).refused(2, &["m1", "-1"]);
    inspect("double-pendulum", &states, &["--param", "m1=1", "m1=2"]).refused(2, &["m1"]);
    inspect("double-pendulum", &states, &["--param", "m1"]).refused(2, &["--param", "SYMBOL=VALUE"]);
    inspect("n-pendulum", &states, &["--param", "n=0"]).refused(2, &["n-pendulum", "0"]);
    inspect("double-pendulum", &states, &["--precision", "f16"]).refused(2, &["f16", "f64"]);
    inspect("double-pendulum", &states, &["--frmat", "json"]).refused(2, &["--frmat", "--format"]);
    lnn(&["inspect", "--system", "double-pendulum"]).refused(2, &["--states"]);
    lnn(&["sistems"]).refused(2, &["sistems", "systems"]);
    let nothing = lnn(&[]);
    assert_eq!(nothing.code, Some(2));
    assert!(nothing.stderr.contains("Usage"));
    let version = lnn(&["--version"]);
    assert_eq!((version.code, version.stdout), (Some(0), format!("lnn {}\n", env!("CARGO_PKG_VERSION"))));
    let help = lnn(&["inspect", "--help"]);
    assert_eq!((help.code, help.stderr.as_str()), (Some(0), ""));
}

#[test]
fn bad_states_are_data_errors() {
    let folder = Folder::new();
    let refused = |content: &[u8], parts: &[&str]| {
        let states = folder.file("s.csv", content);
        inspect("double-pendulum", &states, &[]).refused(1, &[&["s.csv: "], parts].concat());
    };
    let with = |row: &str| format!("{HEADER}1,2,3,4\n{row}\n").into_bytes();
    refused(&with("nan,2,3,4"), &["row 3, column theta1: expected a finite number, found \"nan\""]);
    refused(&with("1,2,1e999,4"), &["row 3, column theta1_dot", "1e999"]);
    refused(&with("1,,3,4"), &["row 3, column theta2", "found \"\""]);
    refused(&with("1,2,3"), &["row 3: expected 4 fields, found 3"]);
    refused(b"theta1,theta2,theta1_dot\n1,2,3\n", &["missing column theta2_dot"]);
    refused(b"t,theta1,theta2,theta1_dot,theta2_do\n1,2,3,4,5\n", &["unknown column \"theta2_do\""]);
    refused(b"theta1,theta2,theta1_dot,theta1\n1,2,3,4\n", &["duplicate column theta1"]);
    refused(b"theta1;theta2;theta1_dot;theta2_dot\n1;2;3\n", &["expected 4 fields separated by semicolons, found 3"]);
    refused(b"1,2,3,4\n", &["expected a header with the columns theta1,theta2"]);
    refused(HEADER.as_bytes(), &["no rows"]);
    refused(b"", &["empty"]);
    refused(b"\xff\xfe\x00", &["row 1: not UTF-8"]);

    inspect("double-pendulum", &text(&folder.path("missing.csv")), &[]).refused(1, &["missing.csv: no such file"]);
    inspect("double-pendulum", &text(folder.0.path()), &[]).refused(1, &["found a directory"]);
}

#[cfg(unix)]
#[test]
fn devices_closed_pipes_and_full_disks_end_quietly_or_with_a_line() {
    use std::process::Stdio;
    let folder = Folder::new();
    inspect("double-pendulum", "/dev/zero", &[]).refused(1, &["/dev/zero: expected a regular file"]);

    let rows = "0.1,0.2,0.3,0.4\n".repeat(20_000);
    let states = folder.file("many.csv", format!("{HEADER}{rows}"));
    let arguments = ["inspect", "--system", "double-pendulum", "--states", &states];
    let mut child = Command::new(env!("CARGO_BIN_EXE_lnn"))
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stderr.len()), (Some(0), 0));

    if let Ok(full) = std::fs::OpenOptions::new().write(true).open("/dev/full") {
        let output = Command::new(env!("CARGO_BIN_EXE_lnn")).arg("systems").stdout(full).output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        assert!(String::from_utf8_lossy(&output.stderr).starts_with("error: standard output: "));
    }
}

#[test]
fn the_log_goes_to_standard_error_and_its_filter_is_checked() {
    let run = |filter: &str| {
        Command::new(env!("CARGO_BIN_EXE_lnn")).args(["systems", "--json"]).env("LNN_LOG", filter).output().unwrap()
    };
    let loud = run("trace");
    assert_eq!(loud.status.code(), Some(0));
    assert!(String::from_utf8(loud.stdout).unwrap().lines().all(|line| serde_json::from_str::<Value>(line).is_ok()));
    let wrong = run("lnn=nonsense");
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).starts_with("error: LNN_LOG: "));
}
