//! `lnn geometry` from outside.

use crate::running::{Folder, lnn, model};
use serde_json::Value;

const KEYS: [&str; 11] = [
    "metric",
    "inverse_metric",
    "determinant",
    "signature",
    "christoffel",
    "riemann",
    "ricci",
    "ricci_scalar",
    "einstein",
    "weyl",
    "kretschmann",
];

fn close(value: &Value, exact: f64) -> bool {
    (value.as_f64().unwrap() - exact).abs() <= 1e-13 * exact.abs().max(1.0)
}

#[test]
fn every_tensor_is_printed() {
    let folder = Folder::new();
    // Other columns are left out.
    let points = folder.file("p.csv", "z,t,x,y,tau\n2,0,0,0,9\n0.5,1,2,3,9\n");
    let objects = lnn(&["geometry", "--system", "ads4-geodesic", "--points", &points]).objects();
    assert_eq!(objects.len(), 2);
    for (object, z) in objects.iter().zip([2.0f64, 0.5]) {
        let keys: Vec<_> = object.as_object().unwrap().keys().collect();
        assert_eq!(keys.len(), KEYS.len());
        assert!(KEYS.iter().all(|key| keys.iter().any(|found| found == key)));
        assert_eq!(object["signature"], serde_json::json!([1, 3]));
        assert!(close(&object["metric"][0][0], -1.0 / z.powi(2)) && close(&object["inverse_metric"][3][3], z.powi(2)));
        assert!(close(&object["determinant"], -1.0 / z.powi(8)));
        // Upper index first: G^z_tt = -1/z, G^t_tz = -1/z.
        assert!(close(&object["christoffel"][3][0][0], -1.0 / z) && close(&object["christoffel"][0][0][3], -1.0 / z));
        assert!(close(&object["christoffel"][3][1][1], 1.0 / z));
        // R^x_yxy = -g_yy.
        assert!(close(&object["riemann"][1][2][1][2], -1.0 / z.powi(2)));
        assert!(close(&object["ricci"][0][0], 3.0 / z.powi(2)) && close(&object["ricci_scalar"], -12.0));
        assert!(close(&object["einstein"][1][1], 3.0 / z.powi(2)) && close(&object["kretschmann"], 24.0));
        assert!(close(&object["weyl"][0][1][0][1], 0.0));
    }
}

#[test]
fn precisions_parameters_and_tables() {
    let folder = Folder::new();
    let points = folder.file("p.csv", "theta,phi\n0.1,0\n");
    let run = |more: &[&str]| lnn(&[&["geometry", "--system", "sphere-geodesic", "--points", &points], more].concat());
    let scalar = |more: &[&str]| {
        run(more).stdout.split("\"ricci_scalar\":").nth(1).unwrap().split(',').next().unwrap().to_string()
    };
    let digits = |text: &str| text.split('e').next().unwrap().chars().filter(char::is_ascii_digit).count();
    // One third of a square metre.
    let parameters = ["--param", "R=3", "--precision"];
    let printed = ["f32", "f64", "dd"].map(|precision| scalar(&[&parameters[..], &[precision]].concat()));
    assert_eq!((digits(&printed[0]), digits(&printed[1])), (9, 17));
    assert!(
        printed[2].starts_with("0.22222222222222222222222222") || printed[2].starts_with("2.2222222222222222222222222"),
        "{}",
        printed[2]
    );
    // 0.1 is one tenth in double-double: sin(0.1)^2.
    let wide = run(&["--precision", "dd"]).stdout;
    assert!(wide.contains("9.966711079379184437901741625915"), "{wide}");
    let table = run(&["--format", "table"]).stdout;
    assert!(table.starts_with("row 2: theta = 0.1, phi = 0\n") && table.contains("phi,phi"), "{table}");
    assert!(table.lines().all(|line| line.len() <= 120) && !table.contains(" theta,phi "), "{table}");
    assert_eq!(run(&["--json"]).stdout, run(&[]).stdout);
    assert_eq!(run(&["--velocity", "-1,2"]).stdout, run(&[]).stdout);
}

#[test]
fn a_point_is_given_by_the_names_of_its_coordinates() {
    let at = |point: &str, more: &[&str]| {
        lnn(&[&["geometry", "--system", "schwarzschild-geodesic", "--at", point], more].concat())
    };
    let point = "phi=0,r = 3,theta=pi/2,t=-1";
    let table = at(point, &[]);
    table.succeeded();
    let rows: Vec<Vec<&str>> = table.stdout.lines().map(|line| line.split_whitespace().collect()).collect();
    for (component, value) in [("t,t", "-0.3333333"), ("r,t,t", "0.03703704"), ("t,r,t,r", "-0.07407407")] {
        assert!(rows.iter().any(|row| row.ends_with(&[component, value])), "{component} {}", table.stdout);
    }
    assert!(!table.stdout.contains("theta,phi,phi "), "below rounding: {}", table.stdout);
    // Every digit is in the JSON, the same as that of a file.
    let folder = Folder::new();
    let points = folder.file("p.csv", format!("t,r,theta,phi\n-1,3,{:e},0\n", std::f64::consts::FRAC_PI_2));
    let file = lnn(&["geometry", "--system", "schwarzschild-geodesic", "--points", &points]);
    assert_eq!(at(point, &["--json"]).stdout, file.stdout);
    let latex = at(point, &["--format", "latex"]).stdout;
    assert!(latex.contains("\\begin{align*}\n") && latex.contains("  R_{trtr} &= -0.07407407 \\\\\n"), "{latex}");
    assert!(latex.contains("\\Gamma^{r}{}_{tt}") && latex.contains("R_{\\theta\\phi\\theta\\phi}"), "{latex}");
    at("r=3,t=1", &[]).refused(2, &["--at", "missing theta, phi"]);
    at("r=3,t=1,theta=1,fi=0", &[]).refused(2, &["--at", "\"fi\"", "phi"]);
    at("r=3,t=1,theta=1,phi=0,r=4", &[]).refused(2, &["--at", "r", "twice"]);
    at("r=3,t=1,theta=1,phi=1/0", &[]).refused(2, &["--at", "phi", "finite"]);
    at(point, &["--points", &points]).refused(2, &["--at", "--points"]);
    let degenerate = at("t=0,r=3,theta=0,phi=0", &[]);
    assert_eq!(degenerate.code, Some(1));
    assert!(degenerate.stderr.contains("--at") && degenerate.stderr.contains("degenerate"), "{}", degenerate.stderr);
}

/// The wormhole has `R = -2 b^2/(b^2 + l^2)^2` and `K = 12 b^4/(b^2 + l^2)^4`, the universe of matter `R = 4/(3 t^2)` and
/// `K = 80/(27 t^4)`.
#[test]
fn space_times_in_files_have_their_curvature() {
    let of = |file: &str, param: &str, at: &str| {
        let system = format!("{}/examples/systems/{file}", concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        lnn(&["geometry", "--system", &system, "--param", param, "--at", at, "--json"]).objects().remove(0)
    };
    for (b, l) in [(1.5f64, -2.0f64), (0.5, 0.25)] {
        let found = of("wormhole.toml", &format!("b={b}"), &format!("t=0,l={l},theta=1,phi=0"));
        let area = b * b + l * l;
        assert!(close(&found["ricci_scalar"], -2.0 * b * b / area.powi(2)), "{found}");
        assert!(close(&found["kretschmann"], 12.0 * b.powi(4) / area.powi(4)), "{found}");
    }
    let t: f64 = 2.5;
    let found = of("expanding_universe.toml", "t0=7", "t=2.5,x=1,y=0,z=-3");
    assert!(close(&found["ricci_scalar"], 4.0 / (3.0 * t * t)), "{found}");
    assert!(close(&found["kretschmann"], 80.0 / (27.0 * t.powi(4))), "{found}");
    // Matter at rest has the density 8 pi rho = 3 H^2 and no pressure.
    assert!(close(&found["einstein"][0][0], 4.0 / (3.0 * t * t)) && close(&found["einstein"][1][1], 0.0), "{found}");
}

#[test]
fn a_degenerate_point_is_named_and_the_others_are_printed() {
    let folder = Folder::new();
    let points = folder.file("p.csv", "theta,phi\n1,0\n0,0\n2,0\n");
    let run = lnn(&["geometry", "--system", "sphere-geodesic", "--points", &points]);
    assert_eq!(run.code, Some(1));
    let objects: Vec<Value> = run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(objects.len(), 3);
    assert!(objects[1]["error"].as_str().unwrap().contains("degenerate") && objects[1]["riemann"].is_null());
    assert!(objects[1]["metric"][0][0] == 1.0 && objects[1]["determinant"] == 0.0);
    assert!(objects[0].get("error").is_none() && close(&objects[2]["ricci_scalar"], 2.0));
    assert!(run.stderr.starts_with("error: ") && run.stderr.contains("row 3: the metric is degenerate"));
    // A horizon in coordinates that end there.
    let points = folder.file("h.csv", "t,r,theta,phi\n0,2,1,0\n");
    let run = lnn(&["geometry", "--system", "schwarzschild-geodesic", "--points", &points]);
    assert_eq!(run.code, Some(1));
    let object: Value = serde_json::from_str(&run.stdout).unwrap();
    assert!(object["metric"].is_null() && object["error"] == "the metric is not finite");
}

#[test]
fn models_have_a_geometry_and_mistakes_are_named() {
    let folder = Folder::new();
    let path = folder.path("model.safetensors");
    model().save(&path).unwrap();
    let path = path.to_str().unwrap();
    let points = folder.file("p.csv", "theta1,theta2\n0.5,1\n7,2\n");
    let run = lnn(&["geometry", "--model", path, "--points", &points, "--precision", "dd"]);
    assert_eq!((run.code, run.stdout.lines().count()), (Some(0), 2));
    assert!(run.stderr.starts_with("note: ") && run.stderr.contains("--velocity"), "{}", run.stderr);
    let moved = lnn(&["geometry", "--model", path, "--points", &points, "--precision", "dd", "--velocity", "1,2"]);
    assert_ne!(run.stdout, moved.stdout);
    let refused = |velocity: &str, parts: &[&str]| {
        lnn(&["geometry", "--model", path, "--points", &points, "--velocity", velocity]).refused(2, parts);
    };
    refused("1", &["--velocity", "expected 2", "found 1"]);
    refused("1,x", &["--velocity", "finite numbers (theta1,theta2)"]);
    let missing = folder.file("m.csv", "theta1\n0.5\n");
    lnn(&["geometry", "--model", path, "--points", &missing]).refused(1, &["missing column theta2"]);
    lnn(&["geometry", "--points", &points]).refused(2, &["--system"]);
}

/// Values of a coordinate at the surfaces on a line, with what the determinant does there.
fn surfaces(arguments: &[&str], coordinate: &str) -> Vec<(f64, String)> {
    let run = lnn(&[&["geometry", "--json"], arguments].concat());
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""), "{}", run.stdout);
    let found: Value = serde_json::from_str(&run.stdout).unwrap();
    let all = found["surfaces"].as_array().unwrap().iter();
    all.map(|at| (at["point"][coordinate].as_f64().unwrap(), at["change"].as_str().unwrap().to_string())).collect()
}

#[test]
fn horizons_and_ergosurfaces_are_those_of_closed_forms() {
    let is = |found: &[(f64, String)], radii: &[f64]| {
        assert_eq!(found.len(), radii.len(), "{found:?}");
        for ((r, change), exact) in found.iter().zip(radii) {
            assert!((r - exact).abs() < 1e-14 * exact.abs() && change == "zero", "{found:?} {radii:?}");
        }
    };
    let hole = ["--system", "schwarzschild-geodesic", "--surface", "t", "--from", "0,1,1.2,0", "--to", "0,6,1.2,0"];
    is(&surfaces(&hole, "r"), &[2.0]);
    is(&surfaces(&[&hole[..], &["--param", "M=1.5", "--steps", "7"]].concat(), "r"), &[3.0]);
    // Outward and inward, through the same horizon.
    let cartesian = ["--system", "schwarzschild-cartesian", "--surface", "t", "--from", "0,-5,0,0", "--to", "0,6,0,0"];
    is(&surfaces(&cartesian, "x"), &[-2.0, 2.0]);
    // Ergosurface r = 1 + sqrt(1 - a^2 cos^2 theta), horizon 1 + sqrt(1 - a^2), at several angles and spins.
    for (a, theta) in [("0.5", 0.4f64), ("0.9", 1.1), ("0.99", 2.5)] {
        let spin: f64 = a.parse().unwrap();
        let [from, to] = ["1.05", "3"].map(|r| format!("0,{r},{theta},0"));
        let line = ["--system", "kerr-geodesic", "--param", &format!("a={a}"), "--from", &from, "--to", &to];
        let ergosurface = 1.0 + (1.0 - (spin * theta.cos()).powi(2)).sqrt();
        is(&surfaces(&[&line[..], &["--surface", "t"]].concat(), "r"), &[ergosurface]);
        let horizon = 1.0 + (1.0 - spin * spin).sqrt();
        is(&surfaces(&[&line[..], &["--surface", "t,phi"]].concat(), "r"), &[horizon]);
    }
}

#[test]
fn a_line_without_a_surface_and_mistakes() {
    let line = ["geometry", "--system", "ads4-geodesic", "--from", "0,0,0,1", "--to", "0,0,0,5"];
    let surface = |block: &str| lnn(&[&line[..], &["--surface", block]].concat());
    let found = lnn(&[&line[..], &["--surface", "t", "--json"]].concat());
    assert_eq!((found.code, found.stdout.as_str()), (Some(0), "{\"block\":[\"t\"],\"surfaces\":[]}\n"));
    surface("t,w").refused(2, &["--surface", "unknown coordinate \"w\""]);
    surface("t,t").refused(2, &["--surface", "t is given twice"]);
    lnn(&[&line[..5], &["--surface", "t"]].concat()).refused(2, &["--to"]);
    lnn(&[&line[..4], &["0,1", "--to", "0,0,0,5", "--surface", "t"]].concat()).refused(2, &["--from", "expected 4"]);
    for steps in ["0", "1000001", "4294967296", "18446744073709551615"] {
        lnn(&[&line[..], &["--surface", "t", "--steps", steps]].concat()).refused(2, &["--steps", "from 1 to 1000000"]);
    }
    let hole = ["geometry", "--system", "schwarzschild-geodesic", "--surface", "t"];
    let told = lnn(&[&hole[..], &["--from", "0,1,1.2,0", "--to", "0,6,1.2,0"]].concat()).stdout;
    assert!(told.starts_with("determinant of the metric's block t: 1 change of sign on the line\n"), "{told}");
    assert!(told.contains("zero") && told.lines().all(|line| line.chars().count() <= 120), "{told}");
    let wide = ["--system", "schwarzschild-geodesic", "--surface", "t", "--precision", "dd"];
    let found = surfaces(&[&wide[..], &["--from", "0,1,1.2,0", "--to", "0,6,1.2,0"]].concat(), "r");
    assert!(found.len() == 1 && (found[0].0 - 2.0).abs() < 1e-15, "{found:?}");
}

#[test]
fn curvature_of_more_coordinates_than_fit_into_memory_is_refused() {
    let folder = Folder::new();
    for (count, code) in [(32, 0), (33, 2)] {
        let names: Vec<String> = (0..count).map(|k| format!("q{k}")).collect();
        let squares: Vec<String> = names.iter().map(|name| format!("{name}_dot^2/2")).collect();
        let mut text = format!("name = \"flat\"\ntitle = \"Flat\"\nlagrangian = \"{}\"\n", squares.join(" + "));
        for name in &names {
            text += &format!("[[coordinates]]\nname = \"{name}\"\nbounds = [-1, 1]\nvelocity_bounds = [-1, 1]\n");
        }
        let system = folder.file(&format!("flat{count}.toml"), text);
        let zeros = vec!["0"; count].join(",");
        let points = folder.file("points.csv", format!("{}\n{zeros}\n", names.join(",")));
        let run = lnn(&["geometry", "--system", &system, "--points", &points, "--format", "table"]);
        match code {
            0 => assert_eq!((run.code, run.stderr.as_str()), (Some(0), "")),
            _ => run.refused(2, &["33 coordinates are too many, at most 32"]),
        }
        // A line needs no curvature.
        let ones = vec!["1"; count].join(",");
        let line = ["geometry", "--system", &system, "--surface", "q0", "--from", &zeros, "--to", &ones];
        assert_eq!(lnn(&line).code, Some(0));
    }
}
