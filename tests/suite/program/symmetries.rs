//! `lnn symmetries`, `lnn compare` and `lnn rollout --charges` from outside.

use crate::running::{Folder, lnn, text};
use serde_json::Value;

fn object(arguments: &[&str]) -> Value {
    let run = lnn(arguments);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""), "{}", run.stdout);
    serde_json::from_str(&run.stdout).unwrap()
}

#[test]
fn symmetries_of_a_system_are_told_in_json_and_in_words() {
    let found = object(&["symmetries", "--system", "sphere-geodesic", "--format", "json", "--quadratic"]);
    assert_eq!((found["count"].as_u64(), found["name"].as_str()), (Some(3), Some("so(3)")));
    assert_eq!(found["killing_form_signature"], serde_json::json!([3, 0, 0]));
    assert_eq!(found["fields"][2], "d_phi");
    assert_eq!(found["time_translation"], true);
    assert!(found["gap"].as_f64().unwrap() > 1e6);
    assert_eq!(found["structure_constants"].as_array().unwrap().len(), 3);
    assert_eq!(found["quadratic"]["count"], 0);
    let values: Vec<f64> = found["singular_values"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    assert!(values.is_sorted() && values[2] < 1e-10 && values[3] > 1e-2);

    let told = lnn(&["symmetries", "--system", "sphere-geodesic"]).stdout;
    assert!(told.starts_with("sphere-geodesic: 3 point symmetries, algebra so(3); time translation"), "{told}");
    assert!(told.contains("cot(theta)*cos(phi) d_phi") && told.contains("[X1, X2] = "), "{told}");
    assert!(told.lines().all(|line| line.chars().count() <= 120), "{told}");
    let told = lnn(&["symmetries", "--system", "double-pendulum"]).stdout;
    assert!(told.starts_with("double-pendulum: no point symmetry in space; time translation"), "{told}");
}

#[test]
fn options_choose_basis_region_and_states() {
    let kepler = ["symmetries", "--system", "kepler", "--json", "--param", "mu=2", "--basis", "polynomial:1"];
    let found = object(&[&kepler[..], &["--region", "x=-1:3,y_dot=-1:1", "--points", "50", "--seed", "7"]].concat());
    assert_eq!((found["count"].as_u64(), found["functions"].as_u64()), (Some(1), Some(3)));
    assert_eq!((found["points"].as_u64(), found["seed"].as_u64()), (Some(50), Some(7)));
    for (more, problem) in [
        (["--region", "u=1:2"], "unknown column \"u\""),
        (["--region", "x=3:1"], "expected NAME=LOW:HIGH"),
        (["--basis", "fourier:2"], "unknown family \"fourier\""),
        (["--points", "0"], "expected a whole number above 0"),
        (["--points", "100000000"], "--points: expected at most 1777777"),
        (["--tolerance", "1e308"], "from 2.2e-16 (rounding) to 0.1"),
        (["--tolerance", "1e-300"], "from 2.2e-16 (rounding) to 0.1"),
        (["--region", "x=0:0"], "expected NAME=LOW:HIGH"),
        (["--region", "y_dot=1:1.0000001"], "expected NAME=LOW:HIGH"),
    ] {
        lnn(&[&kepler[..4], &more].concat()).refused(2, &[problem]);
    }
    lnn(&[&kepler[..4], &["--points", "3"]].concat()).refused(1, &["more states or a smaller basis"]);
}

/// A system of so many coordinates of this unit and these bounds, a chain of masses.
fn chain(folder: &Folder, count: usize, unit: &str, bounds: &str) -> String {
    let names = |k: usize| format!("q{k}");
    let squares: Vec<String> = (0..count).map(|k| format!("{}_dot^2/2", names(k))).collect();
    let pulls: String = (1..count).map(|k| format!(" - ({} - {})^2", names(k - 1), names(k))).collect();
    let mut text = format!("name = \"chain\"\ntitle = \"Chain\"\nlagrangian = \"{}{pulls}\"\n", squares.join(" + "));
    for k in 0..count {
        text += &format!(
            "[[coordinates]]\nname = \"{}\"\nunit = \"{unit}\"\nbounds = {bounds}\nvelocity_bounds = [-1, 1]\n",
            names(k)
        );
    }
    folder.file("chain.toml", text)
}

#[test]
fn many_coordinates_are_searched_or_refused_at_once() {
    let folder = Folder::new();
    // As many harmonics as for spheres in 16 polar angles would be beyond all memory.
    let polar = chain(&folder, 16, "rad", "[0.5, 2.5]");
    let found = object(&["symmetries", "--system", &polar, "--json"]);
    assert!(found["functions"].as_u64().unwrap() < 80, "{}", found["functions"]);
    for command in [&["symmetries", "--system", &polar][..], &["compare", &polar, &polar]] {
        lnn(&[command, &["--basis", "trigonometric:12"]].concat()).refused(2, &["--basis: ", "at most 4000 "]);
        lnn(&[command, &["--points", "100000000"]].concat()).refused(2, &["--points: expected at most "]);
    }
}

#[test]
fn a_degenerate_lagrangian_is_called_so() {
    let folder = Folder::new();
    let columns = ["x", "y"].map(|name| {
        format!("[[coordinates]]\nname = \"{name}\"\nunit = \"m\"\nbounds = [-2, 2]\nvelocity_bounds = [-1, 1]\n")
    });
    let lagrangian = "name = \"flat\"\ntitle = \"Flat\"\nlagrangian = \"(x_dot + y_dot)^2/2\"\n";
    let system = folder.file("flat.toml", format!("{lagrangian}{}", columns.concat()));
    let found = object(&["symmetries", "--system", &system, "--json"]);
    assert_eq!((found["singular_states"].as_u64(), found["closes"].as_bool()), (Some(400), Some(false)));
    assert!(found["closure"].as_f64().unwrap() > 0.1);
    assert!(found["name"].is_null() && found["killing_form_signature"].is_null(), "{found}");
    assert_eq!(found["structure_constants"], serde_json::json!([]));
    let told = lnn(&["symmetries", "--system", &system]).stdout;
    assert!(told.contains("degenerate") && told.contains("closure") && !told.contains("[X1, X2]"), "{told}");
    let regular = object(&["symmetries", "--system", "kepler", "--json"]);
    assert_eq!((regular["singular_states"].as_u64(), regular["closes"].as_bool()), (Some(0), Some(true)));
    // It has no accelerations that could be the same.
    let same = object(&["compare", &system, &system, "--json"]);
    assert!(same["motion"].is_null() && same["motionless_states"] == 400, "{same}");
    assert!(same["mass_matrix"].as_f64().unwrap() < 1e-12, "{same}");
}

#[test]
fn a_model_has_no_symmetry_that_its_system_has_not() {
    // The network was trained on a double pendulum, which has none; nothing of its errors may look like one.
    let path = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/data/double_pendulum.safetensors");
    let found = object(&["symmetries", "--model", path, "--json"]);
    assert!(found["count"].is_null() || found["count"] == 0, "{found}");
    assert_eq!((found["fields"].as_array().unwrap().len(), found["name"].as_str()), (0, None));
}

#[test]
fn lagrangians_are_compared() {
    let found = object(&["compare", "kepler", "kepler", "--json"]);
    for key in ["lagrangian", "motion", "mass_matrix", "energy"] {
        assert!(found[key].as_f64().unwrap() < 1e-12, "{key}: {found}");
    }
    assert!((found["factors"][0].as_f64().unwrap() - 1.0).abs() < 1e-12);
    let other = object(&["compare", "kepler", "kepler", "--param-b", "mu=2", "--json"]);
    assert!(other["motion"].as_f64().unwrap() > 0.1 && other["mass_matrix"].as_f64().unwrap() < 1.0, "{other}");
    let told = lnn(&["compare", "kepler", "henon-heiles"]).stdout;
    assert!(told.starts_with("A = ") && told.contains("motion, accelerations"), "{told}");
    lnn(&["compare", "kepler", "ads4-geodesic"]).refused(2, &["the same coordinates", "x,y and t,x,y,z"]);
}

#[test]
fn a_roll_out_tells_its_charges() {
    let folder = Folder::new();
    let out = text(&folder.path("orbit.csv"));
    let kepler =
        ["rollout", "--system", "kepler", "--state", "1,0,0,0.9", "--t-end", "5", "--dt", "0.05", "--out", &out];
    let facts = object(&[&kepler[..], &["--charges", "--json"]].concat());
    let charges = facts["charges"].as_array().unwrap();
    let names: Vec<&str> = charges.iter().map(|charge| charge["symmetry"].as_str().unwrap()).collect();
    assert_eq!(names, ["energy", "-y d_x + x d_y"]);
    assert!((charges[1]["start"].as_f64().unwrap() - 0.9).abs() < 1e-12);
    let number = |key: &str| charges[1][key].as_f64().unwrap();
    assert!(number("drift").abs() < 1e-4 && number("by_model").abs() < 1e-12);
    assert!((number("drift") - number("by_model") - number("by_integrator")).abs() < 1e-15);
    let told = lnn(&[&kepler[..], &["--charges", "--overwrite"]].concat()).stdout;
    assert!(told.contains("by the integrator"), "{told}");
    let without = object(&[&kepler[..], &["--overwrite", "--json"]].concat());
    assert!(without["charges"].is_null());
}
