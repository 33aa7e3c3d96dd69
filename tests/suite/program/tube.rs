//! `--tube` of `lnn rollout`: a tube from motion that a fit held out, or from other recordings.

use super::fit::{COLUMNS, pendulum};
use crate::running::{Folder, lnn, text};
use serde_json::Value;
use std::fs;

#[test]
fn a_tube_comes_from_motion_that_was_held_out_or_from_other_recordings() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", pendulum(30, false, 0.005));
    let [run, motion, plot] = ["run", "motion.csv", "motion.svg"].map(|name| text(&folder.path(name)));
    let small = ["--hidden", "16,16", "--epochs", "30", "--hold-out", "0.7", "--out", &run];
    lnn(&[&["fit", &data], &COLUMNS[..], &small].concat()).succeeded();
    let rollout = ["rollout", &run, "--state", "1,0", "--t-start", "2", "--dt", "0.1", "--out", &motion, "--overwrite"];
    let until = |end: &str, more: &[&str]| lnn(&[&rollout[..], &["--json", "--t-end", end], more].concat());
    let rollout = |more: &[&str]| until("4", more);

    let inside = rollout(&["--tube", "0.9", "--plot", &plot]);
    inside.succeeded();
    let tube: &Value = &serde_json::from_str::<Value>(&inside.stdout).unwrap()["tube"];
    let motions: Vec<u64> = tube["motions"].as_array().unwrap().iter().map(|x| x.as_u64().unwrap()).collect();
    assert!(tube["share"] == 0.9 && motions.iter().sum::<u64>() >= 18 && motions[0].abs_diff(motions[1]) < 2);
    let half = |k: usize| tube["half_widths"]["angle"][k].as_f64().unwrap();
    assert_eq!(tube["times"].as_array().unwrap().last().unwrap().as_f64().map(|t| (t * 1e6).round()), Some(2e6));
    let csv = fs::read_to_string(&motion).unwrap();
    assert!(csv.lines().next().unwrap().ends_with("energy,angle_low,angle_high"), "{csv}");
    let rows = csv.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect());
    let rows: Vec<Vec<f64>> = rows.collect();
    assert_eq!((rows.len(), rows[0].len()), (21, 6));
    for row in &rows {
        let (q, low, high) = (row[1], row[4], row[5]);
        assert!(low < q && q < high && (high + low - 2.0 * q).abs() < 1e-9, "{row:?}");
    }
    assert!(((rows[0][5] - rows[0][1]) / half(0) - 1.0).abs() < 1e-9);
    assert!(fs::read_to_string(&plot).unwrap().contains("angle_high"));

    let few = rollout(&["--tube", "0.95"]);
    few.refused(1, &["--tube 0.95", "at least 38 whole motions of 2 s", "--tube-data"]);
    let long = until("30", &["--tube", "0.9"]);
    long.refused(1, &["at least 18 whole motions of 28 s", "found 0"]);
    // All motions of other recordings count.
    let more = folder.file("more.csv", pendulum(38, true, 0.005));
    rollout(&["--tube", "0.95", "--tube-data", &more]).succeeded();
    rollout(&["--tube", "1.5"]).refused(2, &["--tube"]);
    until("1", &["--tube", "0.9"]).refused(2, &["--tube", "backwards"]);
    let plain = rollout(&[]);
    assert!(serde_json::from_str::<Value>(&plain.stdout).unwrap().get("tube").is_none());
    fs::remove_file(folder.path("run").join("config.toml")).unwrap();
    rollout(&["--tube", "0.9"]).refused(1, &["config.toml", "--tube"]);
}

#[test]
fn a_system_has_no_tube() {
    let folder = Folder::new();
    let out = text(&folder.path("motion.csv"));
    let roll =
        ["rollout", "--system", "harmonic-oscillator", "--state", "1,0", "--t-end", "1", "--dt", "0.1", "--out", &out];
    lnn(&[&roll[..], &["--tube", "0.9"]].concat()).refused(2, &["--tube"]);
    assert!(!folder.path("motion.csv").exists());
}
