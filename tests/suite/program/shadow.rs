//! `lnn shadow` from outside.

use crate::running::{Folder, lnn, text};
use lnn::lagrangian::SystemInstance;
use lnn::network::{Header, Layout, ModelFile, StoredPrecision};
use serde_json::Value;
use std::fs;

/// A black hole in Cartesian coordinates, by its metric as text.
const WRITTEN: &str =
    concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/systems/black_hole_cartesian.toml");

/// Width and height of a PNG.
fn size(folder: &Folder, name: &str) -> (u32, u32) {
    let file = fs::read(folder.path(name)).unwrap();
    assert!(file.starts_with(b"\x89PNG\r\n\x1a\n") && file.ends_with(b"IEND\xae\x42\x60\x82"));
    let number = |at: usize| u32::from_be_bytes(file[at..at + 4].try_into().unwrap());
    (number(16), number(20))
}

/// A metric that nobody learned: a network without weights, flat space up to a factor.
fn flat_network(folder: &Folder) -> String {
    let system = SystemInstance::<f64>::named("schwarzschild-cartesian", &[]).unwrap();
    let config = lnn::presets::Preset::Quick.config(&system).unwrap();
    let architecture = config.architecture(&system, vec![1.0; 4]).unwrap();
    assert_eq!(architecture.form.cyclic, [0]);
    let weights = vec![0.0; Layout::new(&architecture).parameters];
    let columns = system.system.columns(4);
    let header = Header {
        format: lnn::network::Header::FORMAT,
        crate_version: env!("CARGO_PKG_VERSION").to_string(),
        architecture,
        system: "schwarzschild-cartesian".to_string(),
        parameters: [("M".to_string(), 1.0)].into(),
        columns,
        forces: Vec::new(),
        constraints: [].into(),
        description: None,
        precision: StoredPrecision::F64,
        position: vec![[-40.0, 40.0]; 4],
        velocity: vec![[-3.0, 3.0]; 4],
        seed: 1,
        validation_loss: 0.25,
    };
    let path = folder.path("flat.safetensors");
    ModelFile { header, weights }.save(&path).unwrap();
    text(&path)
}

#[test]
fn a_metric_in_a_file_casts_the_shadow_of_the_catalogues() {
    let folder = Folder::new();
    let of = |system: &str, name: &str, threads: &str| {
        let out = text(&folder.path(name));
        let seen = ["--inclination", "60", "--width", "24", "--height", "16", "--edges", "4", "--threads", threads];
        let run = lnn(&[&["shadow", "--system", system, "--out", &out, "--json"], &seen[..]].concat()).objects();
        assert_eq!((run.len(), size(&folder, name)), (1, (24, 16)));
        run.into_iter().next().unwrap()
    };
    let (written, exact) = (of(WRITTEN, "a.png", "1"), of("schwarzschild-cartesian", "b.png", "2"));
    assert_eq!(fs::read(folder.path("a.png")).unwrap(), fs::read(folder.path("b.png")).unwrap());
    assert_eq!((&written["system"], &written["unit"]), (&"black-hole-cartesian".into(), &"m".into()));
    for seen in [&written, &exact] {
        let number = |key: &str| seen["exact"][key].as_f64().unwrap();
        for (side, sign) in [("left", -1.0), ("right", 1.0), ("bottom", -1.0), ("top", 1.0)] {
            assert!((number(side) - sign * 27f64.sqrt()).abs() < 1e-5, "{side}: {seen}");
        }
        assert!((number("area") / (27.0 * std::f64::consts::PI) - 1.0).abs() < 1e-5, "{seen}");
        assert!(number("share") > 0.08 && number("drift") < 1e-4 && number("unfinished") == 0.0, "{seen}");
        assert!(seen.get("learned").is_none() && seen.get("difference").is_none());
    }
}

#[test]
fn learned_and_exact_stand_side_by_side() {
    let folder = Folder::new();
    let (model, out) = (flat_network(&folder), text(&folder.path("sky.png")));
    let both = ["shadow", "--model", &model, "--system", "schwarzschild-cartesian", "--out", &out, "--width", "20"];
    let run = lnn(&[&both[..], &["--edges", "0", "--json"]].concat()).objects();
    assert_eq!(size(&folder, "sky.png"), (3 * 20 + 2 * 8, 20));
    let share = |value: &Value| value.as_f64().unwrap();
    // Flat space has no shadow, and the picture of the hole is another one.
    assert_eq!((share(&run[0]["learned"]["share"]), &run[0]["learned"]["area"]), (0.0, &Value::Null));
    assert_eq!(share(&run[0]["difference"]["shadow"]), share(&run[0]["exact"]["share"]));
    assert!(share(&run[0]["difference"]["pixels"]) > 0.1 && share(&run[0]["difference"]["median_angle"]) > 1.0);
    // A file that is there stays.
    lnn(&both).refused(1, &["sky.png", "--overwrite"]);
    let told = lnn(&[&both[..], &["--overwrite", "--edges", "4"]].concat());
    assert_eq!((told.code, told.stderr.as_str()), (Some(0), ""));
    assert!(
        told.stdout.contains("left edge, impact parameter [m]") && told.stdout.contains("-5.196"),
        "{}",
        told.stdout
    );
    assert!(told.stdout.lines().all(|line| line.chars().count() <= 120), "{}", told.stdout);
    // The model alone.
    let alone = lnn(&["shadow", "--model", &model, "--out", &text(&folder.path("one.png")), "--width", "8", "--json"]);
    assert!(alone.objects()[0]["exact"].is_null() && size(&folder, "one.png") == (8, 8));
    let overwritten = ["shadow", "--model", &model, "--out", &model];
    lnn(&overwritten).refused(2, &["--out", ".png"]);
}

/// The throat of radius `b` is seen from `l` within `sin(angle) = b/sqrt(b^2 + l^2)`.
#[test]
fn a_wormhole_has_a_second_sky() {
    let folder = Folder::new();
    let system = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/systems/wormhole.toml");
    let out = text(&folder.path("sky.png"));
    let seen = ["--distance", "4", "--param", "b=2", "--width", "24", "--edges", "4", "--json"];
    let found = lnn(&[&["shadow", "--system", system, "--out", &out], &seen[..]].concat()).objects().remove(0);
    assert_eq!((size(&folder, "sky.png"), found["distance"].as_f64()), ((24, 24), Some(4.0)));
    let number = |key: &str| found["exact"][key].as_f64().unwrap();
    let exact = (2.0 / 20f64.sqrt()).asin();
    assert!((number("throat_radius") - exact.to_degrees()).abs() < 1e-4, "{found}");
    assert!((number("right") - 2.0).abs() < 1e-5 && (number("left") + 2.0).abs() < 1e-5, "{found}");
    // A disc of that angle in a picture of 70 degrees, of 24 x 24 pixels.
    let share = std::f64::consts::PI * (exact.tan() / 35f64.to_radians().tan() * 12.0).powi(2) / (24.0 * 24.0);
    assert!((number("second_share") - share).abs() < 0.05 && number("share") == 0.0, "{found} {share}");
    // A metric with one sky says nothing of another.
    let one = text(&folder.path("one.png"));
    let hole = lnn(&["shadow", "--system", WRITTEN, "--out", &one, "--width", "8", "--edges", "0", "--json"]).objects();
    assert!(hole[0]["exact"].get("second_share").is_none(), "{hole:?}");
}

#[test]
fn cameras_that_cannot_be_are_refused() {
    let folder = Folder::new();
    let out = text(&folder.path("sky.png"));
    let refused = |system: &str, more: &[&str], parts: &[&str]| {
        lnn(&[&["shadow", "--system", system, "--out", &out], more].concat()).refused(2, parts);
    };
    let hole = "kerr-cartesian";
    refused(hole, &["--distance", "1.8"], &["--observer", "no camera can be at rest"]);
    refused(hole, &["--inclination", "181"], &["--inclination"]);
    refused(hole, &["--field-of-view", "180"], &["--field-of-view"]);
    refused(hole, &["--space", "x,y"], &["--space", "expected three names, found 2"]);
    refused(hole, &["--space", "x,y,zz"], &["--space", "unknown coordinate \"zz\""]);
    refused(hole, &["--time", "x"], &["--time, --space", "four different coordinates"]);
    refused("schwarzschild-geodesic", &[], &["--space", "radial coordinate"]);
    refused("ads3-geodesic", &["--space", "x,x,z"], &[]);
    refused(hole, &["--edges", "3"], &["--edges", "multiple of four"]);
    lnn(&["shadow", "--out", &out]).refused(2, &["--system"]);
    lnn(&["shadow", "--system", hole, "--out", "a.svg"]).refused(2, &["--out", ".png"]);
    assert!(!folder.path("sky.png").exists());
}
