//! Physics of a model in the files of `lnn train`, `lnn evaluate` and `lnn fit`.

use super::fit::{COLUMNS, pendulum};
use crate::running::{Folder, lnn, text};
use serde_json::Value;
use std::fs;

fn numbers(object: &Value, keys: &[&str]) -> Vec<f64> {
    keys.iter().map(|key| object[key].as_f64().unwrap_or_else(|| panic!("{key} in {object}"))).collect()
}

#[test]
fn a_sphere_is_told_by_its_curvature_and_its_symmetries() {
    let folder = Folder::new();
    let out = text(&folder.path("sphere"));
    let (network, budget) = (["--structure", "metric", "--hidden", "24,24"], ["--epochs", "4", "--threads", "2"]);
    let train = ["train", "sphere-geodesic", "--out", &out];
    let run = lnn(&[&train[..], &network, &budget].concat());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let summary: Value =
        serde_json::from_str(&fs::read_to_string(folder.path("sphere/summary.json")).unwrap()).unwrap();
    let physics = &summary["physics"];
    let curvature = &physics["curvature_scalar"];
    for spread in numbers(&curvature["exact"], &["median", "low", "high"]) {
        assert!((spread - 2.0).abs() < 1e-12, "{curvature}");
    }
    let [median, low, high] = numbers(&curvature["learned"], &["median", "low", "high"])[..] else { panic!() };
    assert!((median - 2.0).abs() < 0.5 && low < median && median < high, "{curvature}");
    let symmetries = &physics["exact_symmetries"];
    assert_eq!((symmetries["count"].as_u64(), symmetries["name"].as_str()), (Some(3), Some("so(3)")));
    assert_eq!(symmetries["fields"][2].as_str(), Some("d_phi"));
    assert!(physics["symmetries"].is_object());
    // Energy and three charges; the integrator loses less than a rough model.
    let charges = physics["charges"].as_array().unwrap();
    assert_eq!((charges.len(), charges[0]["symmetry"].as_str()), (4, Some("energy")));
    for charge in charges {
        let [drift, model, integrator] = numbers(charge, &["drift", "by_model", "by_integrator"])[..] else { panic!() };
        assert!((drift - model - integrator).abs() < 1e-12 && integrator.abs() < 1e-3, "{charge}");
    }
    assert!(charges.iter().any(|charge| charge["by_model"].as_f64().unwrap().abs() > 1e-4));
    let signature = &physics["signature"];
    assert_eq!(signature["by_construction"].as_bool(), Some(true));
    assert_eq!(numbers(signature, &["positive", "negative", "certified", "open"]), [2.0, 0.0, 1.0, 0.0]);
    assert_eq!(physics["metric"].as_array().unwrap().len(), 3);
    // One factor serves metric, curvature and the comparison.
    let common = &physics["equivalence"];
    let [factor, motion, matrix, energy] = numbers(common, &["factor", "motion", "mass_matrix", "energy"])[..] else {
        panic!()
    };
    assert_eq!(factor, curvature["factor"].as_f64().unwrap());
    assert!((factor * common["factors"][0].as_f64().unwrap() - 1.0).abs() < 1e-12, "{common}");
    assert!([motion, matrix, energy].iter().all(|x| *x > 1e-6 && *x < 0.5), "{common}");
    let told = &run.stdout;
    assert!(told.contains("Difference of the learned Lagrangian from the exact one"), "{told}");
    assert!(
        told.contains("Difference from the exact Lagrangian, up to a factor and a gauge term: Lagrangian "),
        "{told}"
    );
    for file in ["metric_theta_theta.svg", "metric_phi_phi.svg"] {
        assert!(folder.path("sphere").join(file).exists(), "no {file}");
    }

    let report = fs::read_to_string(folder.path("sphere/report.html")).unwrap();
    let section = report.split("<h2>Physics</h2>").nth(1).unwrap().split("<h2>").next().unwrap();
    for part in ["g[phi,phi]", "curvature scalar R", "so(3)", "cot(theta)*cos(phi) d_phi", "by the integrator"] {
        assert!(section.contains(part), "{part}");
    }
    assert!(section.contains("The structure of the model proves 2 positive and 0 negative eigenvalues"));
    assert!(
        report.contains("The exact one is 2.00000 everywhere") && folder.path("sphere/curvature_scalar.svg").exists()
    );
    pictures_come_first(&report);

    // An evaluation of the same states finds the same.
    let run = lnn(&["evaluate", &out, "--json", "--threads", "1"]);
    let evaluated: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(evaluated["physics"], *physics);
}

/// Every picture of what was learned stands under a heading, and above all tables but the short one.
fn pictures_come_first(report: &str) {
    let (figures, headings) = (report.matches("<figure").count(), report.matches("<h3>").count());
    assert!(figures > 0 && figures == headings, "{figures} pictures, {headings} headings");
    let of_training = report.find("<h2>Training</h2>").unwrap();
    let last_picture = report[..of_training].rfind("<figure").unwrap();
    assert!(last_picture < report.find("<div class=\"scroll\"><table>").unwrap());
}

#[test]
fn a_fit_has_the_part_of_the_model() {
    let folder = Folder::new();
    let data = folder.file("data.csv", pendulum(4, false, 1e-4));
    let out = text(&folder.path("fitted"));
    let fit = ["fit", &data, "--hidden", "8", "--epochs", "2", "--out", &out];
    let run = lnn(&[&fit[..], &COLUMNS].concat());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let summary: Value =
        serde_json::from_str(&fs::read_to_string(folder.path("fitted/summary.json")).unwrap()).unwrap();
    let physics = &summary["physics"];
    assert!(physics["curvature_scalar"].is_null() && physics["exact_symmetries"].is_null());
    assert!(physics["equivalence"].is_null());
    assert!(physics["charges"].as_array().unwrap().is_empty() && physics["symmetries"].is_object());
    // A black box is searched box by box.
    let shares = numbers(&physics["signature"], &["certified", "refuted", "open"]);
    assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    let boxes = physics["signature"]["boxes"].as_u64().unwrap();
    assert!(boxes > 0 && physics["signature"]["by_construction"].as_bool() == Some(false));
    let report = fs::read_to_string(folder.path("fitted/report.html")).unwrap();
    pictures_come_first(&report);
    for file in ["potential.svg", "mass_matrix.svg", "energy_held_out.svg"] {
        assert!(folder.path("fitted").join(file).exists(), "no {file}");
    }
    assert!(report.contains("<h2>Physics</h2>") && report.contains(&format!("by {boxes} boxes")));
}
