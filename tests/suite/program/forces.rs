//! An arm with motors from outside: learned with its torques, judged with them, rolled out under them, asked for them.

use crate::running::{Folder, Run, lnn, model, text};
use lnn::configuration::Penalty;
use lnn::data::{PrepareOptions, RecordingSplit};
use lnn::lagrangian::SystemInstance;
use lnn::network::ModelFile;
use lnn::recording::{Columns, LoadedRecording};
use lnn::rollout::{Driven, RolloutOptions, SampledForce};
use lnn::training::Objective;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::sync::OnceLock;

/// Samples per second.
const RATE: f64 = 50.0;
const COLUMNS: [&str; 12] = [
    "--coords",
    "upper,lower",
    "--velocity",
    "upper_dot,lower_dot",
    "--acceleration",
    "upper_ddot,lower_ddot",
    "--force",
    "shoulder,elbow",
    "--trajectory",
    "run",
    "--periodic",
    "upper,lower",
];
const HEADER: &str = "run,t,upper,lower,upper_dot,lower_dot,upper_ddot,lower_ddot,shoulder,elbow\n";

/// Runs of two seconds of a double pendulum driven by torques of a few N m, linear between the samples; every line of a run.
fn runs(count: usize) -> Vec<Vec<String>> {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let arm = SystemInstance::<f64>::named("double-pendulum", &[]).unwrap().build().unwrap();
    (0..count)
        .map(|run| {
            let times: Vec<f64> = (0..=(2.0 * RATE) as usize).map(|k| k as f64 / RATE).collect();
            let mut draw = |size: f64| rng.random_range(-size..size);
            // Two sines for each motor.
            let waves: Vec<[f64; 3]> = (0..4).map(|_| [draw(3.0), 4.0 + draw(3.0), draw(3.0)]).collect();
            let torque = |t: f64, motor: usize| -> f64 {
                waves[2 * motor..2 * motor + 2].iter().map(|[a, w, phase]| a * (w * t + phase).sin()).sum()
            };
            let values: Vec<f64> = times.iter().flat_map(|&t| [torque(t, 0), torque(t, 1)]).collect();
            let force = SampledForce::new(2, times, values.clone()).unwrap();
            let driven = Driven::new(arm.as_ref(), &force);
            let (q, v) = ([draw(1.5), draw(1.5)], [draw(2.0), draw(2.0)]);
            let motion = driven.rollout(&q, &v, &RolloutOptions::reference(2.0, 1.0 / RATE)).complete().unwrap();
            (0..motion.len())
                .map(|k| {
                    let (q, v) = motion.state(k);
                    let a = driven.acceleration(motion.t[k], q, v).unwrap();
                    let numbers = [q, v, &a, &values[2 * k..2 * k + 2]].concat();
                    numbers.iter().fold(format!("{run},{}", motion.t[k]), |mut line, x| {
                        write!(line, ",{x}").unwrap();
                        line
                    })
                })
                .collect()
        })
        .collect()
}

/// The arm learned with its torques, for all tests that need one: the folder, what was printed, `summary.json`.
fn learned() -> &'static (Folder, Run, Value) {
    static LEARNED: OnceLock<(Folder, Run, Value)> = OnceLock::new();
    LEARNED.get_or_init(|| {
        let folder = Folder::new();
        let data = folder.file("arm.csv", HEADER.to_string() + &runs(120).concat().join("\n"));
        let out = text(&folder.path("out"));
        let more = ["--hidden", "48,48", "--epochs", "150", "--horizon", "0.5"];
        let run = lnn(&[&["fit", &data, "--out", &out], &COLUMNS[..], &more].concat());
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let summary = serde_json::from_slice(&fs::read(folder.path("out/summary.json")).unwrap()).unwrap();
        (folder, run, summary)
    })
}

fn model_file(folder: &Folder) -> String {
    text(&folder.path("out/model.safetensors"))
}

/// The numbers of a CSV below its header.
fn table(csv: &str) -> Vec<Vec<f64>> {
    csv.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect()
}

#[test]
fn a_driven_arm_is_judged_with_its_torques() {
    let (folder, run, summary) = learned();
    let last = |name: &str| summary[name].as_array().unwrap().last().unwrap()["median"].as_f64().unwrap();
    let (model, straight) = (last("model"), last("constant_velocity"));
    // Without the torques the arm would be some tenths of a rad off.
    assert!(model < 0.1 * straight, "{model} {straight}");
    let energy = &summary["energy"];
    let [kinetic, change, work, friction, defect, rms] =
        ["kinetic", "change", "work", "friction", "defect", "defect_rms"].map(|name| energy[name].as_f64().unwrap());
    assert!((change - (work - friction + defect)).abs() < 1e-9 * kinetic, "{energy}");
    assert!(rms >= defect.abs() && rms < 0.5 * kinetic && friction == 0.0, "{energy}");
    assert!((change - work).abs() < 0.1 * kinetic && work.abs() > 0.15 * kinetic, "{energy}");
    let line = run.stdout.lines().skip_while(|line| !line.starts_with("energy along")).nth(1).unwrap();
    assert!(line.contains("work of the known forces"), "{line}");
    assert!(folder.path("out/prediction_forces.svg").exists());
    assert!(fs::read_to_string(folder.path("out/report.html")).unwrap().contains("Known forces"));
    let header = ModelFile::<f64>::load(folder.path("out/model.safetensors").as_path()).unwrap().header;
    assert_eq!(header.forces, ["shoulder", "elbow"]);
}

#[test]
fn a_motion_is_rolled_out_under_recorded_torques() {
    let (folder, ..) = learned();
    let (model, out) = (model_file(folder), text(&folder.path("motion.csv")));
    let recorded = runs(3).swap_remove(2);
    // The recording as it is, from its fourth sample on, columns of no use left aside; in other units too.
    let forces = folder.file("run.csv", HEADER.to_string() + &recorded.join("\n"));
    let rows = table(&(HEADER.to_string() + &recorded.join("\n")));
    let milli: String =
        rows.iter().map(|row| format!("{},{},{}\n", 1e3 * row[9], 1e3 * row[1], 1e3 * row[8])).collect();
    let milli = folder.file("milli.csv", format!("lower_force,clock,shoulder\n{milli}"));
    let state = rows[3][2..6].iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let (from, to) = (rows[3][1].to_string(), rows[28][1].to_string());
    let start =
        ["rollout", &model, "--state", &state, "--t-start", &from, "--t-end", &to, "--dt", "0.02", "--out", &out];
    let roll = |more: &[&str]| {
        let run = lnn(&[&start[..], &["--overwrite"], more].concat());
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""), "{more:?}");
        let motion = table(&fs::read_to_string(&out).unwrap());
        let error = motion[25][1..3].iter().zip(&rows[28][2..4]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!((motion[25][0] - rows[28][1]).abs() < 1e-12 && motion.len() == 26);
        (error, run.stdout)
    };
    let (error, said) = roll(&["--force", &forces]);
    assert!(error < 0.1, "{error}");
    let balance = said.lines().nth(1).unwrap();
    assert!(balance.contains("forces added ") && balance.contains("friction removed 0,"), "{said}");
    let (without, said) = roll(&[]);
    assert!(without > 2.0 * error && !said.contains("forces added"), "{without} {error} {said}");
    let units = ["--force", &milli, "--force-time", "clock", "--force-units", "clock=ms,shoulder=mN,lower_force=1e-3"];
    let (same, _) = roll(&units);
    assert!((same - error).abs() < 1e-6, "{same} {error}");
    for method in ["dop853", "midpoint", "gauss4", "gauss6", "variational"] {
        let step: &[&str] = if method == "dop853" { &[] } else { &["--step", "0.01"] };
        let (error, _) = roll(&[&["--force", &forces, "--method", method], step].concat());
        assert!(error < 0.1, "{method} {error}");
    }
    // Constants by name, one motor and the other.
    let (constant, _) = roll(&["--force", "shoulder=0.5", "--force", "lower_force=-1"]);
    assert!((constant - without).abs() > 1e-3);
    let one: String = rows.iter().map(|row| format!("{},{}\n", row[1], row[8])).collect();
    let one = folder.file("one.csv", format!("time,shoulder\n{one}"));
    let (mixed, _) = roll(&["--force", &one, "--force", "elbow=0"]);
    assert!((mixed - error).abs() > 1e-4);
}

#[test]
fn forces_that_make_no_sense_are_named() {
    let folder = Folder::new();
    let path = folder.path("arm.safetensors");
    model().save(&path).unwrap();
    let (model, out) = (text(&path), text(&folder.path("motion.csv")));
    let start = ["rollout", &model, "--state", "1,2,0,0", "--t-end", "1", "--dt", "0.1", "--out", &out];
    let refused = |more: &[&str], code: i32, parts: &[&str]| {
        lnn(&[&start[..], more].concat()).refused(code, parts);
    };
    refused(&["--force", "tau=1"], 2, &["--force", "unknown force \"tau\"", "theta1_force"]);
    refused(&["--force", "theta1_force=much"], 2, &["theta1_force", "finite number", "much"]);
    refused(&["--force", "theta1_force=1", "--force", "theta1_force=2"], 2, &["twice"]);
    refused(&["--force-time", "t"], 2, &["--force"]);
    refused(&["--force", "theta1_force=1", "--force-time", "t"], 2, &["--force-time", "CSV"]);
    refused(&["--force", "nothing.csv"], 1, &["nothing.csv", "no such file"]);
    let file = |content: &str| folder.file("forces.csv", content);
    let with = |content: &str, more: &[&str], code: i32, parts: &[&str]| {
        let path = file(content);
        refused(&[&["--force", path.as_str()], more].concat(), code, parts);
    };
    with("", &[], 1, &["forces.csv", "empty"]);
    with("theta1_force\n1\n", &[], 1, &["t or time", "--force-time"]);
    with("t,x\n0,1\n", &[], 1, &["no column of forces", "theta1_force, theta2_force"]);
    with("t,theta1_force\n0,1\n0.5,1\n", &[], 1, &["known from t = 0 to 0.5", "0 to 1", "--t-end"]);
    with("t,theta1_force\n0,1\n2,1\n2,1\n", &[], 1, &["row 4, column t", "after 2"]);
    with("t,theta1_force\n0,1\n2,no\n", &[], 1, &["row 3, column theta1_force", "no"]);
    with("t,theta1_force\n0,1\n2,1\n", &["--force", "theta1_force=1"], 2, &["theta1_force", "constant and a column"]);
    with("t,theta1_force\n0,1\n2,1\n", &["--force-units", "theta2_force=mN"], 2, &["--force-units", "theta2_force"]);
    with("t,theta1_force\n0,1\n2,1\n", &["--force-units", "theta1_force=pound"], 2, &["pound"]);
    let path = file("t,theta1_force\n0,1\n2,1\n");
    refused(&["--force", &path, "--force", &path], 2, &["one file at most"]);
    assert!(!folder.path("motion.csv").exists());
}

/// Accelerations in, torques out, and back to the motion.
#[test]
fn the_torques_of_a_motion_are_asked_for() {
    let (folder, ..) = learned();
    let recorded = runs(2).swap_remove(1);
    let rows = table(&(HEADER.to_string() + &recorded.join("\n")));
    let states = folder.file("known.csv", HEADER.to_string() + &recorded.join("\n"));
    let ask = ["inspect", "--model", &model_file(folder), "--states", &states, "--inverse"].map(String::from);
    let ask: Vec<&str> = ask.iter().map(String::as_str).collect();
    let objects = lnn(&ask).objects();
    let (mut error, mut size) = (0.0, 0.0);
    for (object, row) in objects.iter().zip(&rows) {
        let external = object["external_force"].as_array().unwrap();
        assert_eq!(&object["generalized_force"], &object["external_force"]);
        assert!(object.get("friction").is_none());
        for (found, torque) in external.iter().zip(&row[8..]) {
            error += (found.as_f64().unwrap() - torque).powi(2);
            size += torque * torque;
        }
    }
    assert!(objects.len() == rows.len() && error < 0.15 * size, "{error} {size}");
    let csv = lnn(&[&ask[..], &["--format", "csv"]].concat());
    assert_eq!((csv.code, csv.stderr.as_str(), csv.stdout.lines().next()), (Some(0), "", Some("t,shoulder,elbow")));
    assert_eq!(table(&csv.stdout)[7][1], objects[7]["external_force"][0].as_f64().unwrap());
    // What was found drives a motion.
    let (forces, out) = (folder.file("found.csv", &csv.stdout), text(&folder.path("again.csv")));
    let state = rows[0][2..6].iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let model = model_file(folder);
    let run = lnn(&[
        "rollout", &model, "--state", &state, "--t-end", "0.5", "--dt", "0.02", "--force", &forces, "--out", &out,
    ]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let motion = table(&fs::read_to_string(&out).unwrap());
    assert!((motion[25][1] - rows[25][2]).abs() < 0.02, "{} {}", motion[25][1], rows[25][2]);

    // By the Lagrangian itself: level rods at rest are held by their weight.
    let level = folder.file(
        "level.csv",
        format!(
            "theta1,theta2,theta1_dot,theta2_dot,theta1_ddot,theta2_ddot\n{0},{0},0,0,0,0\n",
            0.5 * std::f64::consts::PI
        ),
    );
    let exact = ["inspect", "--system", "double-pendulum", "--states", &level, "--inverse", "--precision", "dd"];
    let row = &lnn(&exact).objects()[0];
    assert!(
        (row["external_force"][0].as_f64().unwrap() - 2.0 * row["external_force"][1].as_f64().unwrap()).abs() < 1e-12
    );
    assert_eq!(row["gravity_force"], row["external_force"]);
    assert!(["inertial_force", "coriolis_force"].iter().all(|part| row[part][0].as_f64() == Some(0.0)), "{row:?}");
    // Rows that fail say why, the others are as they are alone.
    let mixed = std::fs::read_to_string(&level).unwrap() + "0,1,1e200,0,0,0\n" + "1,1,0,0,0,0\n" + "0,1,0,1e200,0,0\n";
    let run =
        lnn(&["inspect", "--system", "double-pendulum", "--states", &folder.file("mixed.csv", mixed), "--inverse"]);
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    let rows: Vec<Value> = run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let failed = |row: &Value| row.get("error").is_some() && row["external_force"][0].is_null();
    assert_eq!(rows.iter().map(failed).collect::<Vec<_>>(), [false, true, false, true]);
    assert!((rows[2]["external_force"][1].as_f64().unwrap() - 9.8 * 1.0_f64.sin()).abs() < 1e-12, "{:?}", rows[2]);
    assert!(run.stderr.contains("row 3"), "{}", run.stderr);
    let missing = folder.file("missing.csv", "theta1,theta2,theta1_dot,theta2_dot\n1,1,0,0\n");
    let refused = |states: &str, more: &[&str], code, parts: &[&str]| {
        lnn(&[&["inspect", "--system", "double-pendulum", "--states", states], more].concat()).refused(code, parts);
    };
    refused(&missing, &["--inverse"], 1, &["missing column theta1_ddot, theta2_ddot"]);
    refused(&missing, &["--format", "csv"], 2, &["--format csv", "--inverse"]);
}

/// The loss in the model file and in the summary is that of the weights beside it.
#[test]
fn a_model_fitted_through_its_motion_has_its_own_losses() {
    let folder = Folder::new();
    let data = folder.file("arm.csv", HEADER.to_string() + &runs(12).concat().join("\n"));
    let out = text(&folder.path("out"));
    let more = ["--targets", "motion", "--hidden", "16,16", "--epochs", "4", "--shooting-epochs", "3"];
    let columns =
        ["--coords", "upper,lower", "--force", "shoulder,elbow", "--trajectory", "run", "--periodic", "upper,lower"];
    let run = lnn(&[&["fit", &data, "--out", &out], &columns[..], &more].concat());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let ModelFile { header, weights } = ModelFile::<f32>::load(folder.path("out/model.safetensors").as_path()).unwrap();
    let list = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
    let meaning = Columns {
        coords: list(&["upper", "lower"]),
        force: list(&["shoulder", "elbow"]),
        trajectory: Some("run".to_string()),
        periodic: list(&["upper", "lower"]),
        ..Columns::default()
    };
    let recording = LoadedRecording::read(&[&data], &meaning).unwrap().recording;
    let measured = RecordingSplit::new(&recording, &PrepareOptions::default()).unwrap();
    let sets = measured.datasets::<f32>(lnn::recording::Targets::Motion).unwrap();
    let mut objective = Objective::new(&header.architecture, Penalty::None, 1).unwrap();
    let [validation, test] = [&sets.validation, &sets.test].map(|set| f64::from(objective.loss(&weights, set).loss));
    let summary: Value = serde_json::from_slice(&fs::read(folder.path("out/summary.json")).unwrap()).unwrap();
    assert_eq!(header.validation_loss, validation);
    assert_eq!(summary["validation_loss"].as_f64(), Some(validation));
    assert_eq!(summary["test_loss"].as_f64(), Some(test));
    // They are not those of the weights that multiple shooting began with.
    let history = fs::read_to_string(folder.path("out/history.csv")).unwrap();
    let at = history.lines().next().unwrap().split(',').position(|name| name == "validation_loss").unwrap();
    let before = history.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().parse::<f64>().unwrap());
    assert!(before.fold(f64::INFINITY, f64::min) != validation);
}

/// A few runs with noisy torques, noisier than the accelerations: the torques are what is learned from.
#[test]
fn motion_under_noisy_torques_is_learned_by_its_forces() {
    let folder = Folder::new();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut noisy = |line: &String| {
        let numbers: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        let [upper, lower] = [numbers[2], numbers[3]].map(|q| q + rng.random_range(-0.002..0.002));
        let [shoulder, elbow] = [numbers[8], numbers[9]].map(|torque| torque + rng.random_range(-1.0..1.0));
        format!("{},{},{upper},{lower},{shoulder},{elbow}", numbers[0], numbers[1])
    };
    let lines: Vec<String> = runs(12).iter().flatten().map(&mut noisy).collect();
    let data = folder.file("noisy.csv", format!("run,t,upper,lower,shoulder,elbow\n{}\n", lines.join("\n")));
    let columns =
        ["--coords", "upper,lower", "--force", "shoulder,elbow", "--trajectory", "run", "--periodic", "upper,lower"];
    let survey = lnn(&[&["check", &data, "--json"], &columns[..]].concat());
    let advised: Value = serde_json::from_str(&survey.stdout).unwrap();
    assert_eq!(advised["targets"], "forces");

    let out = text(&folder.path("out"));
    let fit = |more: &[&str]| lnn(&[&["fit", &data], &columns[..], &["--hidden", "8", "--epochs", "2"], more].concat());
    let run = fit(&["--out", &out]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let summary: Value = serde_json::from_slice(&fs::read(folder.path("out/summary.json")).unwrap()).unwrap();
    assert_eq!(summary["targets"], "forces");
    let errors = summary["force_errors"].as_array().unwrap();
    assert_eq!(errors.iter().map(|e| e["name"].as_str().unwrap()).collect::<Vec<_>>(), ["upper", "lower"]);
    let number = |e: &Value, key: &str| e[key].as_f64().unwrap();
    for e in errors {
        let (nmse, ratio) = (number(e, "nmse"), number(e, "rms") / number(e, "spread"));
        assert!((nmse - ratio * ratio).abs() < 1e-9 * nmse, "{e}");
    }
    // Two epochs learn nothing: no range is stated, and both forces are named for it.
    assert!(errors.iter().all(|e| number(e, "nmse") > 0.3) && summary.get("withheld").is_some(), "{errors:?}");
    assert!(summary["determination"].as_array().unwrap().is_empty());
    let config: toml::Table = fs::read_to_string(folder.path("out/config.toml")).unwrap().parse().unwrap();
    assert_eq!(config["targets"].as_str(), Some("forces"));
    let network = &config["training"]["network"];
    assert_eq!((network["structure"].as_str(), network["joint_friction"].as_str()), (Some("mechanical"), Some("dry")));
    let header = ModelFile::<f64>::load(folder.path("out/model.safetensors").as_path()).unwrap().header;
    assert!(header.architecture.form.sizes.is_some());

    // The model is gone on with, sizes and all, and friction by joint can be had otherwise.
    let (again, other) = (text(&folder.path("again")), text(&folder.path("other")));
    assert_eq!(fit(&["--from", &out, "--out", &again]).code, Some(0));
    let run = fit(&["--out", &other, "--joint-friction", "none", "--structure", "black-box", "--seed", "1"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(!fs::read_to_string(folder.path("other/config.toml")).unwrap().contains("joint_friction"));
    // Accelerations can be had, too: then no force judges.
    let smoothed = text(&folder.path("smoothed"));
    assert_eq!(fit(&["--out", &smoothed, "--targets", "smoothed", "--joint-friction"]).code, Some(0));
    assert!(fs::read_to_string(folder.path("smoothed/config.toml")).unwrap().contains("joint_friction = \"dry\""));
    let summary: Value = serde_json::from_slice(&fs::read(folder.path("smoothed/summary.json")).unwrap()).unwrap();
    assert!(summary["targets"] == "smoothed" && summary.get("force_errors").is_none());

    let refused = |more: &[&str], parts: &[&str]| lnn(&[&["fit", &data], more].concat()).refused(2, parts);
    let unforced = ["--coords", "upper,lower", "--trajectory", "run", "--targets", "forces"];
    refused(&unforced, &["--targets forces", "--force"]);
    refused(&[&columns[..], &["--joint-friction", "wet"]].concat(), &["--joint-friction", "stribeck", "wet"]);
}

/// A spring that hardens, alone and under a drive.
const SPRING: &str = r#"
name = "spring"
lagrangian = "x_dot^2/2 - k*x^2/2 - b*x^4/4"
coordinates = [{ name = "x", bounds = [-3, 3], velocity_bounds = [-3, 3] }]
[parameters]
k = { default = 1, learn = true }
b = { default = 0.5, learn = true }
"#;

#[test]
fn forces_may_be_formulas_of_time_and_columns() {
    let folder = Folder::new();
    let alone = folder.file("spring.toml", SPRING);
    let driven = folder.file("driven.toml", SPRING.to_string() + "[forces]\nx = \"0.3*cos(1.2*t)\"\n");
    let roll = |system: &str, more: &[&str]| {
        let words = ["rollout", "--system", system, "--state", "0.7,0", "--t-end", "20", "--dt", "0.05", "--out", "-"];
        let run = lnn(&[&words[..], &["--rtol", "1e-11", "--atol", "1e-11"], more].concat());
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        table(&run.stdout)
    };
    let motion = roll(&driven, &[]);
    let by_formula = roll(&alone, &["--force", "x_force=0.3*cos(1.2*t)"]);
    let apart = motion.iter().zip(&by_formula).map(|(a, b)| (a[1] - b[1]).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-8, "{apart}");

    let row = |row: &Vec<f64>| {
        let (t, current) = (row[0], 2.0 * (1.2 * row[0]).cos());
        format!("{t},{},{current},{}\n", row[1], 0.3 * (1.2 * t).cos())
    };
    let data = folder.file("motion.csv", "t,x,current,f\n".to_string() + &motion.iter().map(row).collect::<String>());
    let ways = ["f", "=0.3*cos(1.2*t)", "=0.15*current"];
    let constants = ways.map(|force| {
        let run = lnn(&["identify", &data, "--system", &alone, "--force", force, "--between", "cubic", "--json"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let found: Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!(found["verdict"]["kind"], "exact", "{force}: {}", run.stdout);
        ["k", "b"].map(|name| found["constants"][name]["value"].as_f64().unwrap())
    });
    assert!(constants.iter().all(|[k, b]| (k - 1.0).abs() < 1e-4 && (b - 0.5).abs() < 1e-4), "{constants:?}");

    let losses = ways.map(|force| {
        let out = text(&folder.path(&format!("fit-{}", force.len())));
        let words = ["fit", &data, "--coords", "x", "--force", force, "--hidden", "4", "--epochs", "2", "--out", &out];
        let run = lnn(&[&words[..], &["--targets", "smoothed", "--json"]].concat());
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let said: Value = serde_json::from_str(&run.stdout).unwrap();
        said["validation_loss"].as_f64().unwrap()
    });
    assert!(losses.iter().all(|loss| (loss / losses[0] - 1.0).abs() < 1e-9), "{losses:?}");

    for (force, word, code) in
        [("=0.3*cos(1.2*tt)", "tt", 1), ("=1/t", "t = 0", 2), ("=cos(", "cos", 2), ("=t,=t", "force", 2)]
    {
        let run = lnn(&["identify", &data, "--system", &alone, "--force", force]);
        assert_eq!(run.code, Some(code), "{force}: {}", run.stderr);
        assert!(run.stderr.contains(word) && !run.stderr.contains("panicked"), "{force}: {}", run.stderr);
    }
    let run = lnn(&["rollout", "--system", &alone, "--state", "0,0", "--force", "x_force=0.3*cos(w*t)"]);
    assert!(run.code == Some(2) && run.stderr.contains('w'), "{}", run.stderr);
}
