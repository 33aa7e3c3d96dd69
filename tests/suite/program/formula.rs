//! `lnn formula`: a Lagrangian as a formula, from motion and from a model.

use crate::running::lnn;
use lnn::lagrangian::{EulerLagrange, ExpressionLagrangian, Mechanics, SystemInstance};
use lnn::random::RngStream;
use lnn::rollout::{RolloutOptions, rollout};
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write;
use std::fs;

/// Swings of a system of one coordinate `a` from rest, as a CSV, with a noise of 1e-4.
fn swings(formula: &str, starts: &[f64]) -> String {
    swings_of(&Mechanics::new(ExpressionLagrangian::new(&["a"], &[], formula).unwrap(), Vec::<f64>::new()), starts)
}

/// The same of a model.
fn swings_of(model: &dyn EulerLagrange<f64>, starts: &[f64]) -> String {
    let mut rng = RngStream::Trajectories.generator(1);
    let mut csv = "run,t,a\n".to_string();
    for (run, start) in starts.iter().enumerate() {
        let motion = rollout(model, &[*start], &[0.0], &RolloutOptions::new(3.0, 0.05)).complete().unwrap();
        for (t, a) in motion.t.iter().zip(&motion.q) {
            let noise: f64 = StandardNormal.sample(&mut rng);
            writeln!(csv, "{run},{t},{}", a + 1e-4 * noise).unwrap();
        }
    }
    csv
}

const STARTS: [f64; 6] = [0.4, -0.9, 1.3, 1.9, -2.4, 2.8];

#[test]
fn a_pendulum_is_read_off_its_swings_and_the_file_is_a_system() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    fs::write(at("swings.csv"), swings("a_dot^2/2 + 4*cos(a)", &STARTS)).unwrap();
    let data =
        ["formula", &at("swings.csv"), "--coords", "a", "--periodic", "a", "--trajectory", "run"].map(String::from);
    let with = |more: &[&str]| {
        let words: Vec<String> = data.iter().cloned().chain(more.iter().map(ToString::to_string)).collect();
        lnn(&words.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let found = with(&["--json", "--out", &at("found.toml"), "--name", "swing"]);
    assert_eq!(found.code, Some(0), "{}", found.stderr);
    let found: serde_json::Value = serde_json::from_str(&found.stdout).unwrap();
    assert_eq!(found["verdict"], "found");
    let terms = found["terms"].as_array().unwrap();
    let texts: Vec<&str> = terms.iter().map(|t| t["term"].as_str().unwrap()).collect();
    assert_eq!(texts, ["a_dot^2", "cos(a)"]);
    let [value, error] = ["coefficient", "standard_error"].map(|key| terms[1][key].as_f64().unwrap());
    assert!((value - 4.0).abs() < 4e-3 && error > 0.0 && error < 4e-3, "{value} {error}");
    assert!(terms[1]["probability"].as_f64() > Some(0.9));
    let system = lnn(&["systems", "--system", &at("found.toml")]);
    assert!(system.code == Some(0) && system.stdout.contains("swing"), "{}", system.stderr);
    let rolled =
        lnn(&["rollout", "--system", &at("found.toml"), "--state", "1,0", "--t-end", "1", "--dt", "0.5", "--out", "-"]);
    assert_eq!(rolled.code, Some(0), "{}", rolled.stderr);
    // The common factor is what the user says.
    let scaled = with(&["--format", "latex", "--scale", "a_dot^2=1"]);
    assert!(
        ["L = 1\\,\\dot{a}^{2} + 8", "L = 1\\,\\dot{a}^{2} + 7.9"].iter().any(|start| scaled.stdout.starts_with(start)),
        "{}",
        scaled.stdout
    );
    assert_eq!(with(&["--scale", "a_dot^3=1"]).code, Some(2));
    assert_eq!(with(&["--function", "a_dot"]).code, Some(2));
    assert_eq!(with(&["--out", &at("found.txt")]).code, Some(2));
}

#[test]
fn of_lagrangians_with_one_motion_the_definite_and_short_one_is_found() {
    // The momentum of the cart is conserved and a total derivative: its square may be added.
    let formula = "x_dot^2 + x_dot*a_dot*cos(a) + a_dot^2/2 + 9.81*cos(a)";
    let cart = Mechanics::new(ExpressionLagrangian::new(&["x", "a"], &[], formula).unwrap(), Vec::<f64>::new());
    let mut rng = RngStream::Trajectories.generator(2);
    let mut csv = "run,t,x,a\n".to_string();
    let starts = [0.5, -1.0, 1.4, -1.8, 2.2, -2.5, 2.8, 3.0, 0.9, -0.6, -2.1, 1.7];
    for (run, start) in starts.iter().enumerate() {
        let motion = rollout(&cart, &[0.0, *start], &[0.0; 2], &RolloutOptions::new(3.0, 0.01)).complete().unwrap();
        for (t, q) in motion.t.iter().zip(motion.q.chunks_exact(2)) {
            let mut noisy =
                |x: f64| x + 1e-2 * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, &mut rng);
            writeln!(csv, "{run},{t},{},{}", noisy(q[0]), noisy(q[1])).unwrap();
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cart.csv").to_str().unwrap().to_string();
    fs::write(&path, csv).unwrap();
    let data = ["formula", &path, "--coords", "x,a", "--periodic", "a", "--trajectory", "run", "--json"];
    let found = lnn(&[&data[..], &["--basis", "trigonometric:2", "--bootstraps", "4"]].concat());
    assert_eq!(found.code, Some(0), "{}", found.stderr);
    let found: serde_json::Value = serde_json::from_str(&found.stdout).unwrap();
    let terms = found["terms"].as_array().unwrap().iter();
    let terms: Vec<(&str, f64)> =
        terms.map(|t| (t["term"].as_str().unwrap(), t["coefficient"].as_f64().unwrap())).collect();
    let truth = [("a_dot^2", 0.25), ("x_dot^2", 0.5), ("x_dot*a_dot*cos(a)", 0.5), ("cos(a)", 4.905)];
    assert_eq!(terms.len(), truth.len(), "{terms:?}");
    let near = |(term, c): &(&str, f64)| terms.iter().any(|(t, x)| t == term && (x / c - 1.0).abs() < 0.05);
    assert!(truth.iter().all(near), "{terms:?}");
}

#[test]
fn a_formula_with_friction_is_a_system_that_loses_energy() {
    const DAMPED: &str = "name = \"damped\"\nlagrangian = \"a_dot^2/2 + 4*cos(a)\"\ndissipation = \"0.1*a_dot^2\"\n\
        [[coordinates]]\nname = \"a\"\nunit = \"rad\"\nperiodic = true\nvelocity_bounds = [-9, 9]\n";
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let system =
        SystemInstance::<f64>::new(std::borrow::Cow::Owned(lnn::pipeline::parse_system(DAMPED).unwrap()), &[]).unwrap();
    fs::write(at("swings.csv"), swings_of(&*system.build().unwrap(), &STARTS)).unwrap();
    let data = ["formula", &at("swings.csv"), "--coords", "a", "--periodic", "a", "--trajectory", "run", "--friction"];
    let found = lnn(&[&data[..], &["--json", "--out", &at("found.toml")]].concat());
    assert_eq!(found.code, Some(0), "{}", found.stderr);
    let found: serde_json::Value = serde_json::from_str(&found.stdout).unwrap();
    let terms = found["terms"].as_array().unwrap();
    let seen: Vec<(bool, &str, &str)> = terms
        .iter()
        .map(|t| (t["dissipation"] == true, t["term"].as_str().unwrap(), t["unit"].as_str().unwrap()))
        .collect();
    assert_eq!(seen, [(false, "a_dot^2", "1"), (false, "cos(a)", "1/s^2"), (true, "a_dot^2", "1/s")]);
    assert!((terms[2]["coefficient"].as_f64().unwrap() - 0.1).abs() < 2e-3, "{found}");
    // The file moves as the system did.
    fs::write(at("damped.toml"), DAMPED).unwrap();
    let last = |file: &str| {
        let roll = ["rollout", "--system", file, "--state", "1,0", "--t-end", "4", "--dt", "1", "--out", "-"];
        let rolled = lnn(&roll);
        assert_eq!(rolled.code, Some(0), "{}", rolled.stderr);
        let row = rolled.stdout.trim_end().lines().last().unwrap().to_string();
        row.split(',').nth(1).unwrap().parse::<f64>().unwrap()
    };
    let [own, exact] = [at("found.toml"), at("damped.toml")].map(|file| last(&file));
    assert!((own - exact).abs() < 5e-3, "{own} {exact}");
    // Networks learn it with a friction.
    let config = lnn(&["train", &at("found.toml"), "--print-config"]);
    assert!(config.code == Some(0) && config.stdout.contains("\ndissipation = 16"), "{}", config.stdout);
    assert!(config.stdout.contains("dissipation = \"c3*a_dot^2\""), "{}", config.stdout);
}

#[test]
fn what_the_library_lacks_is_said_and_a_function_of_the_user_helps() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("swings.csv").to_str().unwrap().to_string();
    fs::write(&path, swings("a_dot^2/2 - cosh(a)", &[0.5, 1.0, 1.5, -2.0, 2.5, -3.0])).unwrap();
    let data = ["formula", &path, "--coords", "a", "--trajectory", "run", "--json", "--basis", "polynomial:2"];
    let verdict = |more: &[&str]| {
        let run = lnn(&[&data[..], more].concat());
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        serde_json::from_str::<serde_json::Value>(&run.stdout).unwrap()
    };
    let without = verdict(&[]);
    assert_eq!(without["verdict"], "not in the library");
    assert!(without["left"].as_array().unwrap().iter().any(|l| l["residual"].as_f64() > Some(2.0)));
    let with = verdict(&["--function", "cosh(a)"]);
    assert_eq!(with["verdict"], "found");
    assert_eq!(with["terms"].as_array().unwrap().len(), 2);
    assert_eq!(with["terms"][1]["term"], "(cosh(a))");
}

/// Rows `run,t,..` of runs of 150 samples every 20 ms as a CSV, each row by its run and time with noise of 1e-3; `kept` by run and sample.
fn recorded(names: &str, row: impl Fn(usize, f64) -> Vec<f64>, kept: impl Fn(usize, usize) -> bool) -> String {
    let mut rng = RngStream::Trajectories.generator(3);
    let mut csv = format!("run,t,{names}\n");
    for (run, k) in (0..6).flat_map(|run| (0..150).map(move |k| (run, k))) {
        let t = 0.02 * k as f64;
        let mut noise = || 1e-3 * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, &mut rng);
        let row: Vec<String> = row(run, t).into_iter().map(|x| (x + noise()).to_string()).collect();
        if kept(run, k) {
            writeln!(csv, "{run},{t},{}", row.join(",")).unwrap();
        }
    }
    csv
}

/// The answer to rows of recorded motion.
fn answer(csv: String, coordinates: &str, more: &[&str]) -> Result<serde_json::Value, (Option<i32>, String)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("motion.csv").to_str().unwrap().to_string();
    fs::write(&path, csv).unwrap();
    let data = ["formula", &path, "--coords", coordinates, "--trajectory", "run", "--json", "--bootstraps", "4"];
    let run = lnn(&[&data[..], more].concat());
    if run.code == Some(0) { Ok(serde_json::from_str(&run.stdout).unwrap()) } else { Err((run.code, run.stderr)) }
}

fn terms(found: &serde_json::Value) -> Vec<&str> {
    found["terms"].as_array().unwrap().iter().map(|t| t["term"].as_str().unwrap()).collect()
}

/// An anharmonic oscillator from rest, `x'' = -4 x + x^2`.
fn wave(run: usize, t: f64) -> f64 {
    let (mut x, mut v, h) = (0.4 + 0.2 * run as f64, 0.0, 1e-3);
    for _ in 0..(t / h).round() as usize {
        v -= h / 2.0 * (4.0 * x - x * x);
        x += h * v;
        v -= h / 2.0 * (4.0 * x - x * x);
    }
    x
}

#[test]
fn what_holds_no_law_is_refused_with_its_reason() {
    let all = |_: usize, _: usize| true;
    let refused = |csv: String, coordinates: &str, names: &str| match answer(csv, coordinates, &[]) {
        Err((Some(1), text)) => assert!(text.contains(names), "{names}: {text}"),
        other => panic!("{names}: {other:?}"),
    };
    refused(recorded("x", |_, _| vec![0.0], all), "x", "x ");
    refused(recorded("x,y", |run, t| vec![wave(run, t), 2.0 * wave(run, t) + 1.0], all), "x,y", "y ");
    refused(recorded("x", |run, t| vec![((t + run as f64 / 7.0) as usize % 2) as f64], all), "x", "x ");
    let wild = |run: usize, t: f64| vec![if run == 2 && (t - 1.0).abs() < 1e-6 { 1e6 } else { wave(run, t) }];
    refused(recorded("x", wild, all), "x", "row 352");
    let rod = |run: usize, t: f64| vec![wave(run, t).sin(), -wave(run, t).cos()];
    refused(recorded("x,y", rod, all), "x,y", "x^2");
}

#[test]
fn blocks_have_a_factor_each_and_the_ladder_finds_their_terms() {
    let row =
        |run: usize, t: f64| vec![(3.0 * t + run as f64).sin() * (0.5 + 0.1 * run as f64), wave((run + 3) % 6, t)];
    let found = answer(recorded("x,y", row, |_, _| true), "x,y", &[]).unwrap();
    assert_eq!(found["verdict"], "found", "{found}");
    assert_eq!(found["blocks"], serde_json::json!([["x"], ["y"]]));
    assert_eq!(terms(&found), ["x_dot^2", "y_dot^2", "x^2", "y^2", "y^3"], "{found}");
    let values: Vec<f64> =
        found["terms"].as_array().unwrap().iter().map(|t| t["coefficient"].as_f64().unwrap()).collect();
    for (value, truth) in values.iter().zip([0.5, 0.5, -4.5, -2.0, 1.0 / 3.0]) {
        assert!((value / truth - 1.0).abs() < 0.02, "{values:?}");
    }
    assert_eq!(found["basis"], "polynomial:3,trigonometric:3");
}

#[test]
fn lost_rows_change_nothing() {
    let row = |run: usize, t: f64| vec![wave(run, t)];
    for kept in [|run: usize, k: usize| (7 * k * k + 3 * k + 11 * run) % 25 != 4, |_: usize, k: usize| k % 25 != 24] {
        let found = answer(recorded("x", row, kept), "x", &["--basis", "polynomial:3"]).unwrap();
        assert_eq!(
            (found["verdict"].as_str(), terms(&found)),
            (Some("found"), vec!["x_dot^2", "x^2", "x^3"]),
            "{found}"
        );
    }
}

#[test]
fn a_model_has_its_own_columns() {
    let run = lnn(&["formula", "examples/data/double_pendulum.safetensors", "--coords", "a"]);
    assert!(run.code == Some(2) && run.stderr.contains("--coords"), "{}", run.stderr);
}
