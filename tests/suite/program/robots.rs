//! Robots in URDF files: listed, rolled out, identified from torques, and written back.

use crate::running::{Folder, lnn, text};
use lnn::random::RngStream;
use rand::Rng;
use rand_distr::StandardNormal;
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;

const PICKER: &str = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/systems/picker.urdf");

/// A tree of so many links, two on each from the root on, with joints about all axes.
fn tree(links: usize) -> String {
    let mut robot = "<robot name=\"tree\">\n  <link name=\"l0\"/>\n".to_string();
    for k in 1..=links {
        let (parent, x) = (k / 2, k as f64);
        let axis = ["0 0 1", "0 1 0", "1 0 0", "0.6 0 0.8"][k % 4];
        let centre = format!("{} {} {}", 0.05 * x.sin(), 0.05 * x.cos(), 0.1);
        let [mass, inertia] = [0.5 + 1.0 / x, 0.02 + 0.01 * x.sin()];
        let _ = writeln!(
            robot,
            r#"  <link name="l{k}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/><inertia ixx="{inertia}" iyy="0.02" izz="0.015" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
  <joint name="j{k}" type="revolute"><parent link="l{parent}"/><child link="l{k}"/><origin xyz="0.02 {} 0.2" rpy="{} 0 0.3"/><axis xyz="{axis}"/>
    <limit lower="-2" upper="2" velocity="3" effort="9"/><dynamics damping="0.2" friction="0.1"/></joint>"#,
            0.1 * x.sin(),
            0.4 * x.cos()
        );
    }
    robot + "</robot>\n"
}

/// A motion of every joint by sines of its own: times, and columns of positions, velocities and accelerations.
fn motion(joints: usize, seconds: f64) -> String {
    let columns = ["", "_dot", "_ddot"].iter().flat_map(|end| (1..=joints).map(move |k| format!("j{k}{end}")));
    let mut csv = format!("t,{}\n", columns.collect::<Vec<_>>().join(","));
    let samples = (seconds * 100.0) as usize;
    for sample in 0..samples {
        let t = sample as f64 / 100.0;
        let sum = |k: usize, order: i32| -> f64 {
            let part = |i: usize| {
                let (rate, phase) = (1.3 + 0.37 * (k as f64) + 2.1 * i as f64, k as f64 * 1.7 + i as f64);
                let rate = 1.0 + rate % 6.0;
                let turned = rate * t + phase + f64::from(order) * std::f64::consts::FRAC_PI_2;
                0.4 / rate.sqrt() * rate.powi(order) * turned.sin()
            };
            (0..3).map(part).sum()
        };
        let state = (0..3).flat_map(|order| (1..=joints).map(move |k| (k, order)));
        let row: Vec<String> = state.map(|(k, order)| sum(k, order).to_string()).collect();
        let _ = writeln!(csv, "{t},{}", row.join(","));
    }
    csv
}

/// A log of positions and torques of that motion with noise, torques by the program itself.
fn log(folder: &Folder, robot: &str, joints: usize, seconds: f64) -> String {
    let motion = motion(joints, seconds);
    let states = folder.file("motion.csv", &motion);
    let run = lnn(&["inspect", "--system", robot, "--states", &states, "--inverse", "--format", "csv"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let mut csv = ["j", "tau"].map(|what| (1..=joints).map(|k| format!(",{what}{k}")).collect::<String>()).concat();
    csv.insert(0, 't');
    let mut rng = RngStream::Region.generator(1);
    let mut noisy = |text: &str, size: f64| {
        let noise: f64 = rng.sample(StandardNormal);
        format!(",{}", text.parse::<f64>().unwrap() + size * noise)
    };
    for (own, forces) in motion.lines().zip(run.stdout.lines()).skip(1) {
        let (time, own) = own.split_once(',').unwrap();
        let own: String = own.split(',').take(joints).map(|x| noisy(x, 1e-4)).collect();
        let forces: String = forces.split(',').skip(1).take(joints).map(|x| noisy(x, 0.02)).collect();
        let _ = write!(csv, "\n{time}{own}{forces}");
    }
    csv.push('\n');
    folder.file("log.csv", csv)
}

#[test]
fn a_robot_is_a_system_of_every_command() {
    let folder = Folder::new();
    let shown = lnn(&["systems", "--system", PICKER]);
    assert_eq!(shown.code, Some(0), "{}", shown.stderr);
    assert!(shown.stderr.contains("<transmission>") && shown.stdout.contains("turns by lift"), "{}", shown.stdout);
    let listed = lnn(&["systems", "--system", PICKER, "--json"]);
    let listed: Value = serde_json::from_str(&listed.stdout).unwrap();
    assert_eq!(listed["links"][3]["coordinate"], "grip");
    let motion = text(&folder.path("motion.csv"));
    let roll = ["--state", "0,0.5,0.01,0.5,0,0", "--t-end", "0.5", "--dt", "0.1", "--out", &motion];
    lnn(&[&["rollout", "--system", PICKER][..], &roll].concat()).succeeded();
    assert_eq!(fs::read_to_string(&motion).unwrap().lines().count(), 7);
    // Its description goes with what is made of it.
    let (small, run) =
        (folder.file("small.toml", "[data]\ntraining = 64\nvalidation = 16\ntest = 16\n"), text(&folder.path("run")));
    let copy = folder.file("copy.urdf", fs::read(PICKER).unwrap());
    lnn(&["train", &copy, "--config", &small, "--epochs", "1", "--hidden", "4", "--out", &run]).succeeded();
    fs::remove_file(&copy).unwrap();
    lnn(&["evaluate", &run, "--starts", "1"]).succeeded();
    let broken = folder.file("broken.urdf", "<robot>\n<link/></robot>");
    lnn(&["systems", "--system", &broken]).refused(2, &["broken.urdf:2: <link>", "name"]);
}

#[test]
fn a_tree_is_identified_and_written_back() {
    let folder = Folder::new();
    let joints = 3;
    let truth = folder.file("truth.urdf", tree(joints));
    let data = log(&folder, &truth, joints, 4.0);
    // What is known before: no viscous friction, and inertias without their products.
    let start = tree(joints).replace("damping=\"0.2\"", "damping=\"0\"").replace("ixy=\"0.001\"", "ixy=\"0\"");
    let start = folder.file("start.urdf", start);
    let out = text(&folder.path("found.urdf"));
    let torques = (1..=joints).map(|k| format!("tau{k}")).collect::<Vec<_>>().join(",");
    let found = lnn(&["identify", &data, "--system", &start, "--force", &torques, "--json", "--out", &out]);
    assert_eq!(found.code, Some(0), "{}", found.stderr);
    let written = fs::read_to_string(&out).unwrap();
    assert_eq!(written.lines().count(), fs::read_to_string(&start).unwrap().lines().count());
    let forces = |robot: &str| -> Vec<f64> {
        let states = text(&folder.path("motion.csv"));
        let run = lnn(&["inspect", "--system", robot, "--states", &states, "--inverse", "--format", "csv"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        run.stdout
            .lines()
            .skip(1)
            .flat_map(|line| line.split(',').map(|x| x.parse::<f64>().unwrap()).collect::<Vec<_>>())
            .collect()
    };
    let [exact, before, after] = [&truth, &start, &out].map(|robot| forces(robot));
    let rms = |other: &[f64]| {
        let squares: f64 = exact.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum();
        (squares / exact.len() as f64).sqrt()
    };
    assert!(rms(&after) < 0.03 * rms(&before), "{} {}", rms(&after), rms(&before));
    lnn(&["identify", &data, "--system", &start, "--force", &torques, "--out", &start]).refused(1, &["start.urdf"]);
}
