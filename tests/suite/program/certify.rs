//! Certificates of signature from the command line.

use crate::running::{Folder, lnn};
use serde_json::Value;
use std::fs;

const MODEL: &str = "examples/data/double_pendulum.safetensors";

fn object(arguments: &[&str]) -> Value {
    let run = lnn(&[&["certify", "--json"], arguments].concat());
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""), "{arguments:?}");
    serde_json::from_str(&run.stdout).unwrap()
}

fn shares(found: &Value) -> [f64; 3] {
    ["certified", "refuted", "open"].map(|name| found[name].as_f64().unwrap())
}

#[test]
fn systems_are_certified_and_refuted_with_a_witness() {
    let whole = object(&["--system", "double-pendulum", "--boxes", "2000", "--seconds", "1000"]);
    assert_eq!(shares(&whole), [1.0, 0.0, 0.0]);
    assert!(whole["witness"].is_null() && whole["condition_bound"].as_f64().unwrap() > 6.8);
    assert_eq!(
        (whole["by_construction"].as_bool(), whole["signature"].to_string()),
        (Some(false), "[2,0]".to_string())
    );
    let hole = ["--system", "schwarzschild-geodesic", "--boxes", "2000", "--seconds", "1000"];
    let outside = object(&hole);
    let nearly = |share: f64| share > 1.0 - 1e-12;
    // The Lagrangian has a branch at f = 1/2, r = 4 M: what lies there stays open.
    let [certified, refuted, _] = shares(&outside);
    assert!(nearly(certified) && refuted == 0.0 && outside["signature"] == serde_json::json!([3, 1]), "{outside}");
    let definite = object(&[&hole[..], &["--signature", "4,0"]].concat());
    let [certified, refuted, _] = shares(&definite);
    assert!(nearly(refuted) && certified == 0.0, "{definite}");
    let witness = ["q", "v"].map(|key| definite["witness"][key].as_array().unwrap().len());
    assert_eq!((witness, definite["columns"].as_array().unwrap().len()), ([4, 4], 8));
    assert_eq!(definite["witness"]["eigenvalues"].as_array().unwrap().len(), 4);

    // A system of one's own, whose mass changes its sign at x = 1.
    let folder = Folder::new();
    let file = folder.path("sign.toml");
    let text = "name = \"sign\"\nlagrangian = \"(x - 1)*x_dot^2/2\"\n\n\
                [[coordinates]]\nname = \"x\"\nbounds = [0, 4]\nvelocity_bounds = [-1, 1]\n";
    fs::write(&file, text).unwrap();
    let file = file.to_str().unwrap();
    let sign = object(&["--system", file, "--boxes", "200", "--seconds", "1000"]);
    let [certified, refuted, open] = shares(&sign);
    assert!(open < 1e-6 && (certified - 0.75).abs() <= open && (refuted - 0.25).abs() <= open, "{sign}");
    assert!(sign["witness"]["q"][0].as_f64().unwrap() < 1.0);
    let right = object(&["--system", file, "--box", "x=2..3,x_dot=-9..9"]);
    assert_eq!(shares(&right), [1.0, 0.0, 0.0]);
}

#[test]
fn a_model_is_certified_in_part_and_says_where() {
    let region = "theta1=-0.5..0.5,theta2=-0.5..0.5,theta1_dot=-0.8..0.8,theta2_dot=-0.8..0.8";
    let limits = ["--model", MODEL, "--box", region, "--boxes", "100", "--seconds", "1000", "--threads"];
    let (one, two) = (object(&[&limits[..], &["1"]].concat()), object(&[&limits[..], &["2"]].concat()));
    let [certified, refuted, open] = shares(&one);
    assert!((certified + refuted + open - 1.0).abs() < 1e-12 && open < 1.0);
    for field in ["certified", "refuted", "open", "boxes", "witness", "condition_bound"] {
        assert_eq!(one[field], two[field], "{field}");
    }
    let small = ["--box", "theta1=0.4..0.5,theta2=1..1.1,theta1_dot=-0.1..0.1,theta2_dot=-0.1..0.1"];
    let text = lnn(&[&["certify", "--model", MODEL, "--seconds", "1000"][..], &small].concat());
    assert_eq!((text.code, text.stderr.as_str()), (Some(0), ""));
    assert!(text.stdout.contains("certified     100.0000 %"), "{}", text.stdout);
    assert!(text.stdout.lines().all(|line| line.chars().count() <= 120), "{}", text.stdout);
}

#[test]
fn what_does_not_fit_is_one_line() {
    let system = ["certify", "--system", "double-pendulum"];
    let failed = |more: &[&str], parts: &[&str]| lnn(&[&system[..], more].concat()).refused(2, parts);
    failed(&["--box", "theta3=0..1"], &["unknown column \"theta3\"", "theta1"]);
    failed(&["--box", "theta1=0..1,theta1=0..2"], &["theta1 is given twice"]);
    failed(&["--box", "theta1=1..0"], &["COLUMN=LOW..HIGH"]);
    failed(&["--signature", "2,1"], &["a signature of 2 eigenvalues"]);
    failed(&["--condition", "0.5"], &["at least 1"]);
    lnn(&["certify", "--model", "nowhere.safetensors"]).refused(1, &["nowhere.safetensors"]);
}
