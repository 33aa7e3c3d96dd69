//! What the program says where the right answer is "no" or "not yet": motion that is no motion, factors that no motion determines, quantities that
//! are not conserved.

use crate::running::{Folder, lnn, text};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;

/// A system file of two coordinates.
fn written(folder: &Folder, name: &str, coordinates: [&str; 2], lagrangian: &str, more: &str) -> String {
    let mut toml = format!("name = \"{name}\"\ntitle = \"A test\"\nlagrangian = \"{lagrangian}\"\n{more}\n");
    for coordinate in coordinates {
        writeln!(toml, "[[coordinates]]\nname = \"{coordinate}\"\nbounds = [0.5, 1.5]\nvelocity_bounds = [-1, 1]")
            .unwrap();
    }
    folder.file(&format!("{name}.toml"), toml)
}

fn symmetries(system: &str, more: &[&str]) -> (Value, String) {
    let arguments = [&["symmetries", "--system", system], more].concat();
    let json = lnn(&[&arguments[..], &["--json"]].concat());
    assert_eq!(json.code, Some(0), "{}", json.stderr);
    (serde_json::from_str(&json.stdout).unwrap(), lnn(&arguments).stdout)
}

/// A space that grows: the momentum along `x` is conserved, an energy is not.
#[test]
fn a_metric_that_depends_on_its_time_conserves_no_energy() {
    let folder = Folder::new();
    for (name, scale, fields) in [("grows", "t^2", 1), ("stays", "1", 3)] {
        let metric = format!("({scale}*x_dot^2 - t_dot^2)/2");
        let file = written(&folder, name, ["t", "x"], &metric, "");
        let (found, told) = symmetries(&file, &["--basis", "polynomial:1"]);
        assert_eq!((&found["invariant"], found["count"].as_u64()), (&"g(v, v)".into(), Some(fields)), "{found}");
        assert!(!told.contains("energy") && told.contains("g(v, v) is conserved"), "{told}");
    }
    let (_, told) = symmetries("sphere-geodesic", &[]);
    assert!(told.contains("the energy is conserved"), "{told}");
}

/// Friction takes the angular momentum, and the momentum along the coordinate that it acts on.
#[test]
fn friction_leaves_only_the_charges_that_it_does_no_work_along() {
    let folder = Folder::new();
    let free = "(x_dot^2 + y_dot^2)/2";
    let file = written(&folder, "sledge", ["x", "y"], free, "dissipation = \"y_dot^2/10\"");
    let (found, told) = symmetries(&file, &["--basis", "polynomial:1", "--quadratic"]);
    let fields: Vec<&str> = found["fields"].as_array().unwrap().iter().map(|field| field.as_str().unwrap()).collect();
    let kept: Vec<bool> = found["conserved"].as_array().unwrap().iter().map(|kept| kept.as_bool().unwrap()).collect();
    assert!(fields.len() >= 3 && found["invariant"] == "nothing", "{found}");
    for (field, kept) in fields.iter().zip(kept) {
        assert_eq!(kept, *field == "d_x", "{field}");
    }
    assert!(told.contains("no, by friction") && told.contains("no time translation"), "{told}");
}

#[test]
fn a_metric_that_is_none_at_the_present_time_is_refused_for_its_time() {
    let folder = Folder::new();
    let coordinates = ["t", "x", "y", "z"]
        .map(|name| format!("[[coordinates]]\nname = \"{name}\"\nbounds = [1, 30]\nvelocity_bounds = [-1, 1]\n"));
    for (k, scale) in ["1/t^2", "ln(t)", "1 + t/100"].into_iter().enumerate() {
        let metric = format!("lagrangian = \"({scale})*(x_dot^2 + y_dot^2 + z_dot^2 - t_dot^2)/2\"");
        let toml = format!("name = \"sky{k}\"\ntitle = \"A test\"\n{metric}\n{}", coordinates.concat());
        let (file, out) = (folder.file(&format!("sky{k}.toml"), toml), text(&folder.path("sky.png")));
        lnn(&["shadow", "--system", &file, "--out", &out, "--width", "4", "--edges", "0"])
            .refused(2, &["--time", "depends on its time"]);
    }
}

/// Masses of groups that do not act on each other have factors that no motion determines, one each and of either sign.
#[test]
fn lagrangians_are_compared_up_to_a_factor_of_every_group() {
    let folder = Folder::new();
    let oscillators =
        |x: f64, y: f64, joined: f64| format!("{x}*((1 + x^2)*x_dot^2/2 - x^2) + {y}*(y_dot^2/2 - y^4) - {joined}*x*y");
    let file = |name: &str, x, y, joined| written(&folder, name, ["x", "y"], &oscillators(x, y, joined), "");
    let compared =
        |a: &str, b: &str| -> Value { serde_json::from_str(&lnn(&["compare", a, b, "--json"]).stdout).unwrap() };
    let (one, other) = (file("one", 1.0, 1.0, 0.0), file("other", 3.0, -0.01, 0.0));
    let found = compared(&other, &one);
    let factors: Vec<f64> = found["group_factors"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    assert!((factors[0] - 3.0).abs() < 1e-9 && (factors[1] + 0.01).abs() < 1e-11, "{factors:?}");
    for distance in ["mass_matrix", "motion", "lagrangian", "energy"] {
        assert!(found[distance].as_f64().unwrap() < 1e-9, "{distance} {found}");
    }
    // Joined they have one factor.
    let found = compared(&file("joined", 3.0, 1.0, 0.3), &file("joint", 1.0, 1.0, 0.1));
    assert!(found["group_factors"] == Value::Array(vec![]) && found["mass_matrix"].as_f64().unwrap() > 0.3, "{found}");
}

/// Two oscillators at 50 Hz, `x'' = -4 x - x^3`, `y'' = -9 y - y^3`, with a spring between them or without, in six runs.
fn oscillators(joined: f64, seconds: f64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut csv = "run,t,x,y\n".to_string();
    let pull = |q: [f64; 2]| {
        let spring = joined * (q[0] - q[1]);
        [-4.0 * q[0] - q[0].powi(3) - spring, -9.0 * q[1] - q[1].powi(3) + spring]
    };
    for run in 0..6 {
        let mut q: [f64; 2] = std::array::from_fn(|_| rng.random_range(0.4..1.2));
        let mut v: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        for k in 0..(50.0 * seconds) as usize {
            writeln!(csv, "{run},{},{},{}", 0.02 * k as f64, q[0], q[1]).unwrap();
            // Twenty steps of Verlet.
            for _ in 0..20 {
                let a = pull(q);
                let half: [f64; 2] = std::array::from_fn(|i| v[i] + 5e-4 * a[i]);
                q = std::array::from_fn(|i| q[i] + 1e-3 * half[i]);
                let a = pull(q);
                v = std::array::from_fn(|i| half[i] + 5e-4 * a[i]);
            }
        }
    }
    csv
}

/// Standard output and summary of a small fit of `x` and `y`.
fn fitted(folder: &Folder, csv: String, more: &[&str]) -> (String, Value) {
    let (data, out) = (folder.file("motion.csv", csv), text(&folder.path("out")));
    let columns =
        ["fit", &data, "--coords", "x,y", "--trajectory", "run", "--out", &out, "--overwrite", "--hidden", "24,24"];
    let run = lnn(&[&columns[..], more].concat());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let summary = fs::read(folder.path("out").join("summary.json")).unwrap();
    (run.stdout, serde_json::from_slice(&summary).unwrap())
}

#[test]
fn coordinates_that_move_by_themselves_are_named_and_give_no_good_model() {
    let folder = Folder::new();
    let (told, found) = fitted(&folder, oscillators(0.0, 12.0), &["--epochs", "200"]);
    assert!(!told.starts_with("measured: good"), "{told}");
    let groups = found["groups"].as_array().unwrap();
    assert_eq!(
        (groups.len(), &groups[1]["coordinates"][0], &groups[1]["unit_known"]),
        (2, &"y".into(), &false.into()),
        "{told}"
    );
    assert!(told.contains("y is decoupled"), "{told}");
    // The map of what has a factor of its own is greyed out, and says why.
    let greyed = |file: &str| {
        let captions = fs::read(folder.path("out").join("captions.json")).unwrap();
        let captions: Value = serde_json::from_slice(&captions).unwrap();
        captions[file]["caption"].as_str().unwrap().contains("Greyed out: y is decoupled")
    };
    let maps = ["mass_matrix_x_x.svg", "mass_matrix_y_y.svg", "potential.svg"];
    assert_eq!(maps.map(greyed), [false, true, true]);
    let (_, found) = fitted(&folder, oscillators(3.0, 12.0), &["--epochs", "200"]);
    assert!(found.get("groups").is_none() && !maps.iter().any(|map| greyed(map)), "{found}");
}

#[test]
fn short_recordings_and_noise_give_no_good_model() {
    let folder = Folder::new();
    let (told, found) = fitted(&folder, oscillators(3.0, 1.2), &["--epochs", "30"]);
    assert!(!told.starts_with("measured: good"), "{told}");
    let ahead = found["model"].as_array().unwrap().last().unwrap()["seconds"].as_f64().unwrap();
    assert!(found["fastest_period"].as_f64().is_none_or(|period| period > ahead), "{found}");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut noise = "run,t,x,y\n".to_string();
    for k in 0..600 {
        let [x, y]: [f64; 2] = std::array::from_fn(|_| rng.sample(StandardNormal));
        writeln!(noise, "{},{},{x},{y}", k / 150, 0.02 * f64::from(k % 150)).unwrap();
    }
    let data = folder.file("noise.csv", noise);
    let run = lnn(&["fit", &data, "--coords", "x,y", "--trajectory", "run", "--hidden", "8", "--epochs", "2"]);
    assert!(run.code != Some(0) || !run.stdout.starts_with("measured: good"), "{}", run.stdout);
}
