//! `lnn check`: what recorded motion is good for, and which files are refused how.

use crate::running::{Folder, Run, lnn};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;
use std::fmt::Write;

/// Two coordinates that swing, with noise of 0.001, at 100 samples per second.
fn swing(rows: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = || 1e-3 * Distribution::<f64>::sample(&StandardNormal, &mut rng);
    let row = |k: usize| {
        let t = k as f64 / 100.0;
        [t, (3.0 * t).sin() + noise(), 0.5 * (5.0 * t).cos() + 0.1 * (7.0 * t).sin() + noise()]
    };
    (0..rows).map(row).collect()
}

fn csv(header: &str, rows: &[[f64; 3]]) -> String {
    let mut text = format!("{header}\n");
    for [t, x, y] in rows {
        writeln!(text, "{t:.6},{x:.6},{y:.6}").unwrap();
    }
    text
}

fn check(files: &[&str], more: &[&str]) -> Run {
    lnn(&[&["check"], files, more].concat())
}

/// What `--json` prints.
fn survey(files: &[&str], more: &[&str]) -> Value {
    let run = check(files, &[more, &["--json"]].concat());
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    serde_json::from_str(&run.stdout).unwrap()
}

fn near(value: &Value, expected: f64, relative: f64) {
    let x = value.as_f64().unwrap();
    assert!((x / expected - 1.0).abs() <= relative, "{x}, expected {expected}");
}

#[test]
fn good_data_are_described() {
    let folder = Folder::new();
    let files: Vec<String> =
        (0..3).map(|k| folder.file(&format!("run{k}.csv"), csv("t,x,y", &swing(1500, k)))).collect();
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let found = survey(&files, &["--coords", "x,y"]);
    assert_eq!((&found["files"], &found["samples"], &found["time"]), (&3.into(), &4500.into(), &"t".into()));
    for k in 0..2 {
        near(&found["coordinates"][k]["noise"], 1e-3, 0.1);
    }
    near(&found["tracks"][0]["rate"], 100.0, 1e-9);
    near(&found["coordinates"][0]["acceleration"], 9.0 / 2f64.sqrt(), 0.03);
    near(&found["coordinates"][0]["samples_per_period"], 100.0 * std::f64::consts::TAU / 3.0, 0.05);
    assert_eq!((&found["targets"], &found["suspicious_count"]), (&"smoothed".into(), &0.into()));
    assert_eq!((found["warnings"].as_array().unwrap().len(), &found["tracks"][2]["last_row"]), (0, &1501.into()));
    assert!(found["held_out_text"].as_str().unwrap().contains("run"));

    let run = check(&files, &["--coords", "x,y"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    for part in ["3 files, 3 trajectories, 4500 samples", "x ", "targets: smoothed", "held out", "100.0"] {
        assert!(run.stdout.contains(part), "{part:?} is not in\n{}", run.stdout);
    }
}

#[test]
fn what_is_wrong_with_the_motion_is_said() {
    let folder = Folder::new();
    let mut rows = swing(2000, 5);
    rows[700][1] += 0.05;
    for row in &mut rows[1000..1040] {
        row[2] = 0.25;
    }
    for row in &mut rows[1500..] {
        row[0] += 3.0;
    }
    rows.insert(21, rows[20]);
    let file = folder.file("rough.csv", csv("t,x,y", &rows));
    let found = survey(&[&file], &["--coords", "x,y"]);
    let kinds: Vec<(u64, &str)> = found["suspicious"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| (s["row"].as_u64().unwrap(), s["kind"].as_str().unwrap()))
        .collect();
    assert!(kinds.contains(&(703, "outlier")) && kinds.contains(&(1003, "frozen")), "{kinds:?}");
    assert_eq!(
        (&found["duplicates"], &found["cuts"][0]["before"], &found["cuts"][0]["after"]),
        (&1.into(), &1502.into(), &1503.into())
    );
    assert!(found["tracks"][1]["name"].as_str().unwrap().ends_with("rough.csv rows 1503-2002"));
    let text = check(&[&file], &["--coords", "x,y"]).stdout;
    for part in ["gap: 3.010 s", "left out: 1 row that repeats", "a frozen sensor?", "outlier, off by", "warning: "] {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
}

#[test]
fn gaps_and_rows_left_out_are_counted() {
    let folder = Folder::new();
    let missing =
        |k: usize| k % 40 == 17 || (500..504).contains(&k) || (800..820).contains(&k) || (830..850).contains(&k);
    let rows = swing(2000, 5).into_iter().enumerate().filter(|(k, _)| !missing(*k)).map(|(_, row)| row);
    let file = folder.file("film.csv", csv("t,x,y", &rows.collect::<Vec<_>>()));
    let found = survey(&[&file], &["--coords", "x,y"]);
    let bridged = &found["bridged"];
    assert_eq!((&bridged["rows"], &bridged["longest"]), (&(49 + 4).into(), &4.into()));
    assert_eq!(
        (&found["dropped"][0]["samples"], &found["cuts"][0]["steps"].as_f64().unwrap().round()),
        (&10.into(), &21.0)
    );
    assert_eq!((found["tracks"].as_array().unwrap().len(), &found["suspicious_count"]), (2, &0.into()));
    near(&found["tracks"][0]["rate"], 100.0, 1e-6);
    let warnings = found["warnings"].to_string();
    assert!(warnings.contains("53 rows") && !warnings.contains("10 rows"), "{warnings}");
    let text = check(&[&file], &["--coords", "x,y"]).stdout;
    for part in ["50 short gaps", "53 rows", "10 samples between gaps"] {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
}

#[test]
fn columns_units_and_angles() {
    let folder = Folder::new();
    // Degrees that wrap, milliseconds, no header, a column that tells runs apart.
    let mut text = String::new();
    for (run, t) in (0..2).flat_map(|run| (0..600).map(move |t| (run, f64::from(t)))) {
        let angle = 200.0 * t * 0.01 + 20.0 * (0.03 * t).sin();
        let wrapped = (angle + 180.0).rem_euclid(360.0) - 180.0;
        writeln!(text, "{run},{},{wrapped:.4}", 10.0 * t).unwrap();
    }
    let file = folder.file("angles.csv", &text);
    let arguments = ["--columns", "run,ms,theta", "--coords", "theta", "--periodic", "theta", "--time", "ms"];
    let more = ["--trajectory", "run", "--units", "theta=deg,ms=ms"];
    let found = survey(&[&file], &[arguments.as_slice(), &more].concat());
    assert_eq!(found["tracks"].as_array().unwrap().len(), 2);
    near(&found["tracks"][1]["end"], 5.99, 1e-12);
    let most = (200.0 * 5.99 + 20.0 * (0.03f64 * 599.0).sin()).to_radians();
    near(&found["coordinates"][0]["max"], most, 1e-3);
    // Rounding to 0.0001 degrees is all the noise there is.
    near(&found["coordinates"][0]["noise"], 1e-4f64.to_radians() / 12f64.sqrt(), 0.15);
    // Not told that it is an angle, it is noticed.
    let plain = ["--columns", "run,ms,theta", "--coords", "theta", "--time", "ms", "--trajectory", "run"];
    let warnings = survey(&[&file], &plain)["warnings"].to_string();
    assert!(warnings.contains("jumps by 360"), "{warnings}");
}

#[test]
fn measured_velocities_are_compared() {
    let folder = Folder::new();
    let rows: Vec<[f64; 3]> =
        swing(1000, 3).iter().map(|[t, x, _]| [*t, *x, 3.0f64.to_degrees() * (3.0 * t).cos()]).collect();
    let file = folder.file("v.csv", csv("time,x,v", &rows));
    let found = survey(&[&file], &["--coords", "x", "--velocity", "v"]);
    near(&found["coordinates"][0]["measured_velocity"]["factor"], 1f64.to_degrees(), 0.02);
    assert!(found["warnings"].to_string().contains("degrees where radians are expected?"));
    let right = survey(&[&file], &["--coords", "x", "--velocity", "v", "--units", "v=deg/s"]);
    assert_eq!(right["warnings"], Value::Array(vec![]));
}

#[test]
fn bad_files_are_refused() {
    let folder = Folder::new();
    let refused = |name: &str, content: &[u8], parts: &[&str]| {
        let file = folder.file(name, content);
        check(&[&file], &["--coords", "x,y"]).refused(1, &[&[name], parts].concat());
    };
    let good = csv("t,x,y", &swing(40, 1));
    let with = |line: &str| good.replacen("\n0.050000,", &format!("\n{line}\n0.050000,"), 1).into_bytes();
    refused("inf.csv", &with("0.045,inf,1"), &["row 7, column x: expected a finite number, found \"inf\""]);
    refused("huge.csv", &with("0.045,1,1e999"), &["row 7, column y", "1e999"]);
    refused("text.csv", &with("0.045,?,1"), &["row 7, column x", "found \"?\""]);
    refused("ragged.csv", &with("0.045,1"), &["row 7: expected 3 fields, found 2"]);
    refused(
        "back.csv",
        &with("0.025,1,1"),
        &["row 7, column t: expected a time later than 0.04 of row 6, found 0.025"],
    );
    refused("equal.csv", &with("0.04,1,1"), &["row 7", "row 6", "with other values"]);
    let cut = good.replace(',', ";").replacen("\n0.050000;", "\n0.045;1\n0.050000;", 1);
    refused("semicolon.csv", cut.as_bytes(), &["row 7: expected 3 fields separated by semicolons, found 2"]);
    refused(
        "missing.csv",
        csv("t,x,yy", &swing(40, 1)).as_bytes(),
        &["row 1: missing coordinate: unknown column \"y\""],
    );
    refused("twice.csv", csv("t,x,x", &swing(40, 1)).as_bytes(), &["row 1: duplicate column x"]);
    refused("empty.csv", b"", &["the file is empty"]);
    refused("header.csv", b"t,x,y\n", &["no rows of numbers"]);
    refused("few.csv", csv("t,x,y", &swing(5, 1)).as_bytes(), &["at least 16 rows", "found 5"]);
    refused("array.npy", b"\x93NUMPY\x01\x00\x02\x00{}", &["array's header has no descr"]);
    refused("archive.npz", b"PK\x03\x04....", &["incomplete or damaged archive"]);
    let empty = [b"PK\x05\x06".as_slice(), &[0; 18]].concat();
    refused("empty.npz", &empty, &["the archive holds no arrays"]);
    let none = folder.path("none.csv");
    check(&[none.to_str().unwrap()], &["--coords", "x"]).refused(1, &["none.csv: no such file"]);
    check(&[folder.0.path().to_str().unwrap()], &["--coords", "x"]).refused(1, &["found a directory"]);
}

#[test]
fn what_is_recognised_in_a_file_is_told() {
    let folder = Folder::new();
    let german = csv("Zeit [s],Weg x [cm],Winkel (°)", &swing(1500, 1)).replace(',', ";").replace('.', ",");
    let file = folder.file("german.csv", german);
    let columns = ["--coords", "Weg x [cm],Winkel", "--time", "Zeit", "--periodic", "Winkel"];
    let found = survey(&[&file], &columns);
    assert_eq!((&found["coordinates"][0]["name"], &found["time"]), (&"Weg_x".into(), &"Zeit".into()));
    near(&found["coordinates"][0]["noise"], 1e-5, 0.3);
    let facts = &found["formats"][0];
    assert_eq!((&facts["decimal_comma"], &facts["separator"]), (&true.into(), &"semicolon".into()));
    assert_eq!((&facts["units"]["Weg_x"], &facts["units"]["Winkel"]), (&"cm".into(), &"°".into()));
    // The configuration of a fit names the columns so too, and a unit that is given counts more.
    let config = lnn(&[&["fit", &file, "--print-config"], columns.as_slice()].concat());
    assert_eq!(config.code, Some(0), "{}", config.stderr);
    assert!(config.stdout.contains("coords = [\"Weg_x\", \"Winkel\"]"), "{}", config.stdout);
    let found = survey(&[&file], &[columns.as_slice(), &["--units", "Weg_x=m"]].concat());
    near(&found["coordinates"][0]["noise"], 1e-3, 0.3);
}

#[test]
fn trajectories_side_by_side_are_checked() {
    let folder = Folder::new();
    let file = folder.file("wide.csv", csv("t,x1,x2", &swing(200, 1)));
    let found = survey(&[&file], &["--coords", "x", "--wide"]);
    assert_eq!((&found["samples"], found["tracks"].as_array().map(Vec::len)), (&400.into(), Some(2)));
    check(&[&file], &["--coords", "x", "--wide", "--trajectory", "t"]).refused(2, &["--wide"]);
    check(&[&file], &["--coords", "y", "--wide"]).refused(1, &["wide.csv", "y1, y2"]);
}

#[cfg(unix)]
#[test]
fn a_pipe_is_refused_at_once() {
    let folder = Folder::new();
    let pipe = folder.path("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    check(&[pipe.to_str().unwrap()], &["--coords", "x"]).refused(1, &["found a pipe or device"]);
}

#[test]
fn contradicting_arguments_are_refused() {
    let folder = Folder::new();
    let file = folder.file("good.csv", csv("t,x,y", &swing(40, 1)));
    let refused = |more: &[&str], part: &str| check(&[&file], more).refused(2, &[part]);
    refused(&["--coords", "x", "--velocity", "y,t"], "velocity: expected 1 column, one per coordinate, found 2");
    refused(&["--coords", "x,x"], "column x is used twice");
    refused(&["--coords", "x", "--periodic", "z"], "unknown coordinate \"z\"");
    refused(&["--coords", "x", "--units", "x=parsec"], "unknown unit \"parsec\"");
    refused(&["--coords", "x", "--units", "xdeg"], "COLUMN=UNIT");
    refused(&["--coords", "x", "--rate", "0"], "--rate");
    refused(&["--coords", "x", "--rate", "5", "--time", "t"], "--rate");
}

/// Three filmed runs of a real double pendulum, kept outside the crate: image coordinates of three markers, in fifths of
/// a pixel, 400 frames a second.
#[test]
fn a_filmed_pendulum_is_known_to_a_pixel() {
    let folder =
        std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("../shared/data/ibm-double-pendulum");
    let files: Vec<String> = (0..3).map(|k| folder.join(format!("{k}.csv")).display().to_string()).collect();
    if !folder.is_dir() {
        println!("skipped: {} is not there", folder.display());
        return;
    }
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let pixels = ["3=0.2", "4=0.2", "5=0.2", "6=0.2"].join(",");
    let found = survey(&files, &["--coords", "3,4,5,6", "--rate", "400", "--units", &pixels]);
    assert_eq!((found["tracks"].as_array().unwrap().len(), &found["samples"]), (3, &53016.into()));
    near(&found["tracks"][0]["rate"], 400.0, 1e-9);
    for k in 0..4 {
        let noise = found["coordinates"][k]["noise"].as_f64().unwrap();
        assert!((0.02..1.2).contains(&noise), "noise of {noise} pixels");
    }
}

#[test]
fn motion_of_first_order_is_recognised_by_what_drives_it() {
    let folder = Folder::new();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut noise = || 5e-3 * Distribution::<f64>::sample(&StandardNormal, &mut rng);
    let pump = |t: f64| 2.0 + 0.5 * (0.31 * t).sin() + 0.4 * (0.17 * t).cos() + 0.3 * (0.73 * t).sin();
    let (mut level, mut text) = ([3.0f64, 2.0], "t,h1,h2,u\n".to_string());
    for k in 0..1200 {
        let t = 0.2 * f64::from(k);
        writeln!(text, "{t:.1},{:.4},{:.4},{:.4}", level[0] + noise(), level[1] + noise(), pump(t)).unwrap();
        for j in 0..100 {
            let root = level.map(f64::sqrt);
            level[0] += 0.0004 * (pump(t + 0.002 * f64::from(j)) - root[0]);
            level[1] += 0.0004 * (root[0] - root[1]);
        }
    }
    let file = folder.file("tanks.csv", &text);
    let found = survey(&[&file], &[]);
    assert_eq!(found["first_order"]["from"], serde_json::json!(["u"]), "{found}");
    assert_eq!((found["warnings"].as_array().unwrap().len(), &found["next"]), (1, &"first-order".into()));
    let said = check(&[&file], &[]);
    assert!(!said.stdout.contains("next:"), "{}", said.stdout);
    // Another file without that column is read all the same.
    let other = folder
        .file("other.csv", text.lines().map(|line| line.rsplit_once(',').unwrap().0).collect::<Vec<_>>().join("\n"));
    assert_eq!(survey(&[&file, &other], &[])["first_order"], Value::Null);
}
