//! `lnn fit` from outside: recorded swings of a pendulum, learned by networks small enough for a test.

use crate::common::damped;
use crate::running::{Folder, Run, joined, lead, lnn, text};
use lnn::lagrangian::{EulerLagrange, Request, Terms};
use lnn::network::ModelFile;
use lnn::rollout::{Integrator, RolloutOptions, rollout};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;

/// Names of the coordinates of one pendulum and of two: angles from the downward vertical.
const ANGLES: [&[&str]; 2] = [&["angle"], &["upper", "lower"]];

/// Swings at 50 Hz as a CSV, columns `run,t`, then positions, velocities and accelerations of every coordinate, the last two
/// with `_dot` and `_ddot` behind its name; positions with a noise of `sigma`.
pub(super) fn swings(model: &dyn EulerLagrange<f64>, runs: usize, seconds: f64, sigma: f64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let n = model.coordinates();
    let columns: [String; 3] =
        ["", "_dot", "_ddot"].map(|end| ANGLES[n - 1].iter().map(|name| format!(",{name}{end}")).collect());
    let mut csv = format!("run,t{}\n", columns.concat());
    for run in 0..runs {
        let mut draw = |size: f64| -> Vec<f64> { (0..n).map(|_| rng.random_range(-size..size)).collect() };
        let start = [draw(1.5 * n as f64), draw(2.0 * n as f64)];
        let options = RolloutOptions::new(seconds, 0.02).method(Integrator::Dop853);
        let motion = rollout(model, &start[0], &start[1], &options).complete().unwrap();
        let mut terms = Terms::default();
        model.terms(&motion.q, &motion.v, Request::ACCELERATION, &mut terms).unwrap();
        for (k, t) in motion.t.iter().enumerate() {
            let row = k * n..(k + 1) * n;
            let mut line = format!("{run},{t}");
            for q in &motion.q[row.clone()] {
                write!(line, ",{}", q + sigma * rng.sample::<f64, _>(StandardNormal)).unwrap();
            }
            for x in motion.v[row.clone()].iter().chain(&terms.acceleration[row]) {
                write!(line, ",{x}").unwrap();
            }
            csv += &(line + "\n");
        }
    }
    csv
}

/// Swings of one pendulum over 3 s.
pub(super) fn pendulum(runs: usize, damped: bool, sigma: f64) -> String {
    let model = damped::chain(1);
    swings(if damped { &model } else { model.model().as_ref() }, runs, 3.0, sigma)
}

/// What the columns of one pendulum mean.
pub(super) const COLUMNS: [&str; 6] = ["--coords", "angle", "--trajectory", "run", "--periodic", "angle"];

/// Learns by a small network.
fn fit(folder: &Folder, data: &str, out: &str, more: &[&str]) -> Run {
    let out = text(&folder.path(out));
    lnn(&[&["fit", data, "--out", &out, "--hidden", "24,24"], &COLUMNS[..], more].concat())
}

/// What `lnn check` warns of, as notes.
fn warnings(data: &str, columns: &[&str]) -> Vec<String> {
    let survey = &lnn(&[&["check", data, "--json"], columns].concat()).stdout;
    let survey: Value = serde_json::from_str(survey).unwrap();
    let all = survey["warnings"].as_array().unwrap();
    all.iter().map(|warning| format!("note: {}", warning.as_str().unwrap())).collect()
}

/// `summary.json` of a run that succeeded, with nothing but notes on standard error.
fn summary(folder: &Folder, run: &Run, out: &str) -> Value {
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stderr.lines().all(|line| line.starts_with("note: ")), "{}", run.stderr);
    serde_json::from_slice(&fs::read(folder.path(out).join("summary.json")).unwrap()).unwrap()
}

/// Median error at the largest distance in time, of the model and of a straight line.
fn errors(summary: &Value) -> (f64, f64) {
    let last = |name: &str| summary[name].as_array().unwrap().last().unwrap()["median"].as_f64().unwrap();
    (last("model"), last("constant_velocity"))
}

#[test]
fn polar_coordinates_are_drawn_as_a_path_in_the_plane() {
    let folder = Folder::new();
    // Ellipses of x'' = -x.
    let mut csv = "run,t,r [m],phi [deg]\n".to_string();
    for run in 0..4 {
        for k in 0..150 {
            let t = 0.05 * f64::from(k);
            let (x, y) = ((1.0 + 0.1 * f64::from(run)) * t.cos(), (0.6 + 0.05 * f64::from(run)) * t.sin());
            writeln!(csv, "{run},{t},{},{}", x.hypot(y), y.atan2(x).to_degrees()).unwrap();
        }
    }
    let (data, out) = (folder.file("orbits.csv", csv), text(&folder.path("out")));
    let columns = ["fit", &data, "--coords", "r,phi", "--trajectory", "run", "--periodic", "phi", "--out", &out];
    lnn(&[&columns[..], &["--hidden", "8,8", "--epochs", "4"]].concat()).succeeded();
    let picture = |file: &str| fs::read_to_string(folder.path("out").join(file)).unwrap();
    let path = picture("prediction_path.svg");
    for label in [">r cos phi [m]<", ">r sin phi [m]<", ">measured<", ">predicted<"] {
        assert!(path.contains(label), "{label}");
    }
    // Numbers are in SI, and so are their units.
    assert!(picture("prediction_1.svg").contains(">r [m]<") && picture("prediction_2.svg").contains(">phi [rad]<"));
}

#[test]
fn recorded_positions_become_a_model_that_predicts() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", pendulum(12, false, 0.0));
    let run = fit(&folder, &data, "out", &["--epochs", "60"]);
    let found = summary(&folder, &run, "out");
    assert_eq!(found["targets"], "smoothed");
    let (model, straight) = errors(&found);
    assert!(model < 0.1 * straight, "{model} {straight}");
    assert_eq!(found["wrong_signature"], 0.0);
    assert!(found["valid_time"]["median"].as_f64().unwrap() > 0.0 && found["valid_time"]["lyapunov_times"].is_null());
    assert!(run.stdout.contains("Prediction valid (error below 0.4 of the spread of the motion), median of"));
    let report = fs::read_to_string(folder.path("out/report.html")).unwrap();
    let sentence = lead(&report);
    assert!(sentence.starts_with("measured: good: ") || sentence.starts_with("measured: limited: "), "{sentence}");
    let useful = &found["useful_time"];
    assert!(useful["seconds"].as_f64().unwrap() > 0.5 && useful["at_least"].is_boolean(), "{useful}");
    assert!(joined(&run.stdout).starts_with(&sentence), "{}", run.stdout);
    // Each table stands once, and the report says what was learned from.
    assert_eq!(report.matches("time ahead [s]</th>").count(), 1);
    assert!(report.contains("learned from smoothed accelerations"));
    assert!(report.len() < 2_000_000, "{}", report.len());
    // Nothing exact is known.
    let page = fs::read_to_string(folder.path("out/play.html")).unwrap();
    assert!(report.contains("href=\"play.html\"") && !page.contains("class=\"exact\"") && page.len() < 500_000);
    assert!(run.stdout.contains("learned from smoothed accelerations") && run.stdout.contains("report: "));
    let mut names: Vec<_> =
        fs::read_dir(folder.path("out")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    for name in
        ["config.toml", "history.csv", "model.safetensors", "prediction_error.svg", "report.html", "summary.json"]
    {
        assert!(names.iter().any(|n| n == name), "{name} is not in {names:?}");
    }
    // The model is one like any other, with the user's own names.
    let model = text(&folder.path("out/model.safetensors"));
    let header = ModelFile::<f64>::load(folder.path("out/model.safetensors").as_path()).unwrap().header;
    assert_eq!(
        (header.system.as_str(), header.columns),
        ("measured", vec!["angle".to_string(), "angle_dot".to_string()])
    );
    let states = folder.file("states.csv", "angle,angle_dot\n0.5,0.25\n");
    let terms = &lnn(&["inspect", "--model", &model, "--states", &states]).objects()[0];
    let a = terms["acceleration"][0].as_f64().unwrap();
    assert!((a + 9.81 * 0.5_f64.sin()).abs() < 0.5, "{a}");
    let csv = text(&folder.path("motion.csv"));
    let motion = lnn(&["rollout", &model, "--state", "0.5,0.25", "--t-end", "1", "--dt", "0.1", "--out", &csv]);
    assert_eq!((motion.code, motion.stderr.as_str()), (Some(0), ""));
    lnn(&["evaluate", &model]).refused(1, &["measured"]);
}

/// Rows that a camera drops leave whole runs, and as good a model.
#[test]
fn recordings_with_dropped_rows_are_learned() {
    let folder = Folder::new();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let whole = pendulum(12, false, 0.0);
    // The first rows are the header and the first of a run.
    let kept = |(k, _): &(usize, &str)| *k < 2 || rng.random_range(0.0..1.0) >= 0.03;
    let some: Vec<&str> = whole.lines().enumerate().filter(kept).map(|(_, line)| line).collect();
    let data = folder.file("dropped.csv", some.join("\n") + "\n");
    let run = fit(&folder, &data, "out", &["--epochs", "60"]);
    let found = summary(&folder, &run, "out");
    let runs: u64 = found["trajectories"].as_array().unwrap().iter().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!((runs, &found["time_steps"]["cuts"]), (12, &0.into()));
    let missing = found["time_steps"]["bridged"]["rows"].as_u64().unwrap() as usize;
    let dropped = whole.lines().count() - some.len();
    // A row that is missing at the end of a run leaves no gap.
    assert!(missing <= dropped && missing + 12 > dropped, "{missing} of {dropped}");
    assert!(run.stdout.contains(&format!("({missing} rows missing")), "{}", run.stdout);
    let (model, straight) = errors(&found);
    assert!(model < 0.1 * straight, "{model} {straight}");
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let folder = Folder::new();
    // One sample of the noisy angles is off by 10 degrees.
    let rows = pendulum(6, true, 0.003);
    let mut rows: Vec<String> = rows.lines().map(String::from).collect();
    let mut fields: Vec<String> = rows[200].split(',').map(String::from).collect();
    fields[2] = (fields[2].parse::<f64>().unwrap() + 10f64.to_radians()).to_string();
    rows[200] = fields.join(",");
    let data = folder.file("swings.csv", rows.join("\n") + "\n");
    let mut notes = warnings(&data, &COLUMNS);
    assert!(notes.iter().any(|note| note.contains("not look like smooth motion")), "{notes:?}");
    // Of one coordinate friction and Lagrangian are not told apart.
    let friction = "note: every motion of a single coordinate has a Lagrangian: without known forces (--force) L and the friction \
                    cannot be separated";
    notes.push(friction.to_string());
    let more = ["--targets", "motion", "--friction", "4", "--epochs", "3", "--shooting-epochs", "2", "--threads"];
    let model = |threads: &str| {
        let run = fit(&folder, &data, threads, &[&more[..], &[threads]].concat());
        summary(&folder, &run, threads);
        assert_eq!(run.stderr.lines().collect::<Vec<_>>(), notes);
        fs::read(folder.path(threads).join("model.safetensors")).unwrap()
    };
    let one = model("1");
    assert!(one == model("2") && one == model("3"));
    assert!(folder.path("1/shooting.csv").exists());
}

/// Two coordinates tell friction from the forces of `L`: what it takes is what the motion loses, and accelerations are
/// learned that no `L` alone gives.
#[test]
fn measured_accelerations_and_friction_are_learned() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", swings(&damped::chain(2), 80, 2.0, 0.0));
    let names = ["--coords", "upper,lower", "--periodic", "upper,lower", "--velocity", "upper_dot,lower_dot"];
    let more =
        ["--acceleration", "upper_ddot,lower_ddot", "--trajectory", "run", "--hidden", "32,32", "--epochs", "150"];
    let learned = |out: &str, friction: &[&str]| {
        let place = text(&folder.path(out));
        let run = lnn(&[&["fit", &data, "--out", &place], &names[..], &more, friction].concat());
        let found = summary(&folder, &run, out);
        assert_eq!(found["targets"], "measured");
        // A steady loss of energy asks for friction where there is none.
        assert_eq!(run.stdout.contains("--friction learns it"), friction.is_empty(), "{}", run.stdout);
        assert_eq!(found["energy_loss"].is_object(), friction.is_empty());
        let ranges = found["determination"].as_array().unwrap();
        // Without friction the model misses some 30 % of an acceleration, as much as a model may whose ranges are stated: rounding decides.
        let counts = if friction.is_empty() { [0, 4] } else { [6, 6] };
        assert!(counts.contains(&ranges.len()), "{ranges:?}");
        if !ranges.is_empty() {
            let first = (&ranges[0]["name"], &found["unit"]);
            assert_eq!(first, (&"mean M[upper,upper]".into(), &"mean mass of upper".into()));
        }
        for range in ranges {
            let [low, learned, high] = ["low", "learned", "high"].map(|end| range[end].as_f64());
            // What the data leave open has no range.
            let holds = low <= learned && learned <= high && low.is_some();
            assert!(holds || (low.is_none() && high.is_none() && range["determined"] == "not"), "{range}");
        }
        let stated = run.stdout.contains("mean M[upper,lower]")
            && run.stdout.replace('\n', " ").contains("in about 9 cases of 10");
        assert_eq!(stated, !ranges.is_empty(), "{}", run.stdout);
        let energy = ["change", "friction", "defect"].map(|name| found["energy"][name].as_f64().unwrap());
        (energy, found["test_loss"].as_f64().unwrap())
    };
    let ([change, taken, defect], loss) = learned("without", &[]);
    // Nothing accounts for the change.
    assert!(change < 0.0 && taken == 0.0 && defect == change, "{change} {taken} {defect}");
    let ([change, taken, defect], with) = learned("with", &["--friction"]);
    assert!(change < 0.0 && defect.abs() < -0.5 * change, "{change} {taken} {defect}");
    assert!((change - (defect - taken)).abs() < 1e-9 * change.abs(), "{change} {taken} {defect}");
    assert!(with < 0.6 * loss, "{with} {loss}");
}

#[test]
fn what_cannot_be_learned_from_is_named() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", pendulum(2, false, 0.0));
    let refused = |more: &[&str], code, parts: &[&str]| fit(&folder, &data, "out", more).refused(code, parts);
    refused(&["--targets", "measured"], 2, &["no accelerations were given", "--acceleration"]);
    refused(&["--timelike", "time"], 2, &["--timelike", "angle"]);
    refused(&["--hold-out", "1"], 2, &["--hold-out: held_out"]);
    refused(&["--window", "8"], 1, &["window: expected an odd number"]);
    refused(&["--noise", "0.1,0.2"], 1, &["noise: expected 1 number, one per coordinate"]);
    refused(&["--hidden", "0"], 2, &["--hidden"]);
    for name in ["../evil", "", "/tmp/evil", "..", "a/b", ".x"] {
        refused(&["--name", name], 2, &["--name", "expected a plain name"]);
    }
    refused(&["--velocity", "angle_dt"], 1, &["angle_dt", "angle_dot"]);
    let short = folder.file("short.csv", "t,angle\n0,1\n0.1,1.1\n0.2,1.2\n");
    lnn(&["fit", &short, "--coords", "angle"]).refused(1, &["short.csv"]);
    assert_eq!(folder.names(), ["short.csv", "swings.csv"]);
}

#[test]
fn a_formula_that_is_asked_for_is_in_summary_and_report() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", pendulum(8, false, 1e-3));
    let found = summary(&folder, &fit(&folder, &data, "run", &["--epochs", "1", "--formula"]), "run");
    assert_eq!(found["formula"]["verdict"], "found");
    let terms: Vec<&str> =
        found["formula"]["terms"].as_array().unwrap().iter().map(|t| t["term"].as_str().unwrap()).collect();
    assert_eq!(terms, ["angle_dot^2", "cos(angle)"]);
    let report = fs::read_to_string(folder.path("run/report.html")).unwrap();
    assert!(report.contains("angle_dot^2") && report.contains("cos(angle)"));
    let without = summary(&folder, &fit(&folder, &data, "plain", &["--epochs", "1"]), "plain");
    assert!(without.get("formula").is_none());
}

/// Three networks of one recording: their models, their errors, and what is left between them in one gauge.
#[test]
fn members_are_trained_and_compared() {
    let folder = Folder::new();
    let data = folder.file("swings.csv", pendulum(12, false, 0.0));
    let run = fit(&folder, &data, "out", &["--epochs", "40", "--members", "3", "--seed", "4"]);
    let found = summary(&folder, &run, "out");
    let each = found["members"]["each"].as_array().unwrap();
    let files: Vec<&str> = each.iter().map(|member| member["file"].as_str().unwrap()).collect();
    assert_eq!(files, ["model.safetensors", "member-1.safetensors", "member-2.safetensors"]);
    assert_eq!(each.iter().map(|member| member["seed"].as_u64().unwrap()).collect::<Vec<_>>(), [4, 5, 6]);
    assert_eq!(each[0]["errors"], found["model"]);
    assert!(each[0]["comparison"].is_null());
    for member in &each[1..] {
        assert_eq!(member["comparison"]["factors"].as_array().unwrap().len(), 1);
        assert!(member["comparison"]["motion"].as_f64().unwrap() < 0.3, "{member}");
    }
    let median = |errors: &Value| errors.as_array().unwrap().last().unwrap()["median"].as_f64().unwrap();
    let worst = each.iter().map(|member| median(&member["errors"])).fold(0.0, f64::max);
    assert!(median(&found["members"]["mean"]) <= worst);
    for spread in ["mass_matrix_spread", "potential_spread"] {
        let spread = found["members"][spread].as_f64().unwrap();
        assert!(spread > 0.0 && spread < 0.5, "{}", found["members"]);
    }
    assert!(run.stdout.contains("spread between the members") && run.stdout.contains("member-2.safetensors"));
    // A member is the model of a fit by its seed, and another network.
    let of = |name: &str| ModelFile::<f64>::load(folder.path("out").join(name).as_path()).unwrap();
    let [first, second] = ["model.safetensors", "member-1.safetensors"].map(of);
    assert_eq!((second.header.seed, first.weights == second.weights), (5, false));
    for count in ["0", "33"] {
        let refused = fit(&folder, &data, "none", &["--members", count]);
        assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    }
}
