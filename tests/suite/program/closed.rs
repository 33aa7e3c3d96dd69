//! Closed chains: their constants from motion and from forces, and the forces of their drives.

use crate::running::{Folder, lnn, text};
use serde_json::Value;
use std::fs;

const SYSTEM: &str = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/systems/slider_crank.toml");
const POINTS: &str = r#"
name = "slider-by-points"
lagrangian = "m1*(x1_dot^2 + y1_dot^2)/2 - m1*g*y1 + m2*x2_dot^2/2"
[[coordinates]]
name = "x1"
bounds = [-2, 2]
velocity_bounds = [-2, 2]
[[coordinates]]
name = "y1"
bounds = [-2, 2]
velocity_bounds = [-2, 2]
[[coordinates]]
name = "x2"
bounds = [-4, 4]
velocity_bounds = [-2, 2]
[parameters]
m1 = 1
m2 = 0.7
g = 9.81
r = 1
l = 2
[constraints]
crank = "x1^2 + y1^2 - r^2"
rod = "(x2-x1)^2 + y1^2 - l^2"
again = "2*(x2-x1)^2 + 2*y1^2 - 2*l^2"
"#;
const TRUTH: [&str; 8] = ["--param", "m2=0.7", "--param", "r=1", "--param", "l=2", "--param", "c=0.5"];
const M1: f64 = 1.0;
const M2: f64 = 0.7;
const G: f64 = 9.81;
const L: f64 = 2.0;

/// The place of the slider at an angle of a crank of 1 m, and its first three derivatives.
fn slider(angle: f64) -> [f64; 3] {
    let (s, c) = angle.sin_cos();
    let height = (L * L - s * s).sqrt();
    let slope = -s * c / height;
    [c + height, -s + slope, -c - (c * c - s * s) / height - slope * slope / height]
}

/// The angle of a crank that is driven, with its rate and acceleration.
fn angle(t: f64) -> [f64; 3] {
    let (a, b) = ((1.7 * t).sin_cos(), (2.9 * t + 0.5).sin_cos());
    [
        0.9 * t + 0.8 * a.0 + 0.5 * b.0,
        0.9 + 0.8 * 1.7 * a.1 + 0.5 * 2.9 * b.1,
        -0.8 * 1.7 * 1.7 * a.0 - 0.5 * 2.9 * 2.9 * b.0,
    ]
}

/// The torque on the crank that makes its motion, `I a + I' v^2 / 2 + V'`, with `I = m1 + m2 x'^2` of a crank of 1 m, and `c` of friction.
fn torque([angle, speed, acceleration]: [f64; 3], c: f64) -> f64 {
    let [_, x1, x2] = slider(angle);
    (M1 + M2 * x1 * x1) * acceleration + M2 * x1 * x2 * speed * speed + M1 * G * angle.cos() + c * x1 * x1 * speed
}

/// A normal number of a seed.
fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = *state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    (-2.0 * (1.0 - uniform()).ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
}

fn parsed(run: &str) -> Value {
    serde_json::from_str(run).unwrap()
}

/// Deviations of constants from the truth in standard errors.
fn deviations(found: &Value, truth: &[(&str, f64)]) -> Vec<f64> {
    let of = |(name, truth): &(&str, f64)| {
        let [value, error] = ["value", "standard_error"].map(|key| found["constants"][name][key].as_f64().unwrap());
        (value - truth) / error
    };
    truth.iter().map(of).collect()
}

fn judge(deviations: &[f64], explained: usize) {
    let within = |limit: f64| deviations.iter().filter(|z| z.abs() < limit).count();
    let all = deviations.len();
    assert!(within(3.5) == all && 20 * within(2.0) >= 17 * all && explained >= 3, "{deviations:?} {explained}");
}

#[test]
fn constants_of_a_slider_crank_follow_from_its_motion() {
    let folder = Folder::new();
    let starts = [["1,2.3547,0,0", "1"], ["-2,1.3652,0,0", "2"], ["0.3,2.9334,3,-1.3147", "3"]];
    let rolled = |start: &str| {
        let shared = ["rollout", "--system", SYSTEM, "--state", start, "--t-end", "4", "--dt", "0.02", "--out", "-"];
        let run = lnn(&[&shared[..], &TRUTH].concat());
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        run.stdout
    };
    let motion = starts.map(|[start, name]| (rolled(start), name));
    let (mut all, mut explained) = (Vec::new(), 0);
    for seed in 0..4 {
        let mut state = seed;
        let mut lines = vec!["run,t,theta,x".to_string()];
        for (motion, name) in &motion {
            for line in motion.lines().skip(1) {
                let row: Vec<f64> = line.split(',').take(3).map(|x| x.parse().unwrap()).collect();
                let [angle, x] = [row[1], row[2]].map(|q| q + 1e-3 * normal(&mut state));
                lines.push(format!("{name},{},{angle},{x}", row[0]));
            }
        }
        let path = folder.path(&format!("motion{seed}.csv"));
        fs::write(&path, lines.join("\n")).unwrap();
        let out = text(&folder.path(&format!("found{seed}.toml")));
        let run = lnn(&["identify", &text(&path), "--system", SYSTEM, "--trajectory", "run", "--json", "--out", &out]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let found = parsed(&run.stdout);
        all.extend(deviations(&found, &[("m2", 0.7), ("r", 1.0), ("l", 2.0), ("c", 0.5)]));
        explained += usize::from(found["explained"] == true);
        if seed == 0 {
            // What was found moves; without friction nothing fits.
            let moved = lnn(&[
                "rollout",
                "--system",
                &out,
                "--state",
                "1,2.3547,0,0",
                "--t-end",
                "1",
                "--dt",
                "0.1",
                "--out",
                "-",
            ]);
            assert_eq!(moved.code, Some(0), "{}", moved.stderr);
            let shared = ["identify", &text(&path), "--system", SYSTEM, "--trajectory", "run", "--json"];
            let wrong = lnn(&[&shared[..], &["--constants", "m2,r,l", "--param", "c=0"]].concat());
            assert_eq!((wrong.code, &parsed(&wrong.stdout)["explained"]), (Some(0), &Value::Bool(false)));
            // A length that is said to be known, and is not.
            let off = lnn(&[&shared[..], &["--constants", "m2,c", "--param", "l=2.1", "--param", "r=1"]].concat());
            off.refused(1, &["`rod`", "root mean square"]);
        }
    }
    judge(&all, explained);
}

#[test]
fn constants_of_a_slider_crank_follow_from_its_forces() {
    let folder = Folder::new();
    let (mut all, mut explained) = (Vec::new(), 0);
    for seed in 0..4 {
        let mut state = 100 + seed;
        let mut lines = vec!["t,theta,x,torque,push".to_string()];
        for k in 0..1500 {
            let t = 0.01 * f64::from(k);
            let moved = angle(t);
            let mut noisy = |x: f64, sigma: f64| x + sigma * normal(&mut state);
            let [angle, x] = [moved[0], slider(moved[0])[0]].map(|q| noisy(q, 2e-4));
            lines.push(format!("{t},{angle},{x},{},0", noisy(torque(moved, 0.5), 0.1)));
        }
        let path = text(&folder.path(&format!("forces{seed}.csv")));
        fs::write(&path, lines.join("\n")).unwrap();
        let shared = ["identify", &path, "--system", SYSTEM, "--force", "torque,push", "--targets", "forces", "--json"];
        let lengths = ["--param", "r=1", "--param", "l=2", "--constants"];
        let run = lnn(&[&shared[..], &lengths, &["m1,m2,c"]].concat());
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let found = parsed(&run.stdout);
        all.extend(deviations(&found, &[("m1", 1.0), ("m2", 0.7), ("c", 0.5)]));
        explained += usize::from(found["explained"] == true);
        if seed == 0 {
            let wrong = lnn(&[&shared[..], &lengths, &["m1,m2", "--param", "c=0"]].concat());
            assert_eq!((wrong.code, &parsed(&wrong.stdout)["explained"]), (Some(0), &Value::Bool(false)));
            lnn(&[&shared[..], &lengths, &["m1,l"]].concat()).refused(2, &["depend on l", "--targets motion"]);
        }
    }
    judge(&all, explained);
}

#[test]
fn drives_of_a_closed_chain_make_its_motion() {
    let folder = Folder::new();
    let (system, states) = (text(&folder.path("points.toml")), folder.path("states.csv"));
    fs::write(&system, POINTS).unwrap();
    let times = [0.1, 0.7, 1.3, 2.6];
    let mut lines = vec!["x1,y1,x2,x1_dot,y1_dot,x2_dot,x1_ddot,y1_ddot,x2_ddot".to_string()];
    for t in times {
        let [angle, speed, acceleration] = angle(t);
        let ((s, c), [x, x1, x2]) = (angle.sin_cos(), slider(angle));
        let v = [-s * speed, c * speed, x1 * speed];
        let (turn, pull) = (acceleration, speed * speed);
        let a = [-s * turn - c * pull, c * turn - s * pull, x1 * turn + x2 * pull];
        let row: Vec<String> = [c, s, x].iter().chain(&v).chain(&a).map(f64::to_string).collect();
        lines.push(row.join(","));
    }
    fs::write(&states, lines.join("\n")).unwrap();
    let states = text(&states);
    let run =
        |more: &[&str]| lnn(&[&["inspect", "--system", &system, "--inverse", "--states", &states], more].concat());
    let numbers = |line: &str, key: &str| -> Vec<f64> {
        parsed(line)[key].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    };
    for (drives, of_slider, of_crank) in [("x2", true, false), ("x1,y1", false, true), ("", true, true)] {
        let options = ["--drives", drives];
        let found = run(if drives.is_empty() { &[] } else { &options });
        assert_eq!(found.code, Some(0), "{}", found.stderr);
        for (line, t) in found.stdout.lines().zip(times) {
            let moved = angle(t);
            let ((s, c), [_, x1, _]) = (moved[0].sin_cos(), slider(moved[0]));
            // The shortest force that turns the crank by the torque.
            let turned = [-s, c, x1];
            let acts = [of_crank, of_crank, of_slider].map(|acts| f64::from(u8::from(acts)));
            let size: f64 = turned.iter().zip(&acts).map(|(x, acts)| acts * x * x).sum();
            let external = numbers(line, "external_force");
            for ((found, x), acts) in external.iter().zip(turned).zip(acts) {
                assert!((found - acts * x * torque(moved, 0.0) / size).abs() < 1e-10, "{drives} {line}");
            }
            let [all, held] = ["generalized_force", "constraint_force"].map(|key| numbers(line, key));
            (0..3).for_each(|i| assert!((all[i] - external[i] - held[i]).abs() < 1e-12, "{line}"));
        }
    }
    let wrong = |drives: &str, code: i32, part: &str| {
        let found = run(&["--drives", drives]);
        assert!(found.code == Some(code) && found.stderr.contains(part), "{}", found.stderr);
    };
    wrong("x3", 2, "--drives: unknown coordinate \"x3\"");
    wrong("x2,x2", 2, "--drives: coordinate x2 is given twice");
    // At its dead centre the slider moves nothing.
    fs::write(&states, format!("{}\n1,0,3,0,1,0,-1,0,-1.5\n", lines[0])).unwrap();
    wrong("x2", 1, "drives stand still");
    assert_eq!(run(&["--drives", "y1"]).code, Some(0));
    // An acceleration that the rods do not allow.
    fs::write(&states, format!("{}\n1,0,3,0,1,0,-1,0,1.5\n", lines[0])).unwrap();
    wrong("y1", 1, "3.000e0 away from what the constraints allow, most by `rod`");
}
