//! `lnn identify`: constants of systems in files, from recorded motion.

use crate::common::arm::{self, Faults, JOINTS};
use crate::running::{Folder, lnn, text};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;

const DATA: &str = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/data/pendulum.csv");
const SYSTEM: &str = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/systems/damped_pendula.toml");

#[test]
fn constants_and_friction_of_the_example_are_found_and_written() {
    let folder = Folder::new();
    let out = text(&folder.path("found.toml"));
    let run = lnn(&["identify", DATA, "--system", SYSTEM, "--trajectory", "run", "--json", "--out", &out]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let found: Value = serde_json::from_str(&run.stdout).unwrap();
    for (name, truth) in [("m2", 1.0), ("l1", 1.0), ("l2", 1.0), ("c1", 0.08), ("c2", 0.05)] {
        let [value, error] = ["value", "standard_error"].map(|key| found["constants"][name][key].as_f64().unwrap());
        assert!((value - truth).abs() < 4.0 * error && error < 0.02 * truth, "{name} {value} {error}");
    }
    assert_eq!(found["constants"]["m2"]["unit"], "kg");
    assert_eq!((found["undetermined"].as_array().unwrap().len(), &found["explained"]), (0, &Value::Bool(true)));
    // The file has friction: after ten minutes the arms hang.
    let rolled = ["rollout", "--system", &out, "--state", "1,1,0,0", "--t-end", "600", "--dt", "600", "--out", "-"];
    let rolled = lnn(&rolled);
    assert_eq!(rolled.code, Some(0), "{}", rolled.stderr);
    let last: Vec<f64> = rolled.stdout.lines().last().unwrap().split(',').map(|x| x.parse().unwrap()).collect();
    assert!(last[0] == 600.0 && last[1..5].iter().all(|x| x.abs() < 0.05), "{last:?}");
    let shown = lnn(&["systems", "--system", &out]);
    assert!(shown.code == Some(0) && shown.stdout.contains("--param m2="), "{}", shown.stdout);
    let learned = lnn(&["train", &out, "--out", &text(&folder.path("run")), "--epochs", "1", "--hidden", "4"]);
    assert_eq!(learned.code, Some(0), "{}", learned.stderr);
    // A grey box takes it with its friction.
    let known =
        ["fit", DATA, "--coords", "theta1,theta2", "--trajectory", "run", "--known", &out, "--epochs", "1", "--out"];
    let known = lnn(&[&known[..], &[&text(&folder.path("fit"))]].concat());
    assert_eq!(known.code, Some(0), "{}", known.stderr);
}

#[test]
fn a_page_shows_what_was_fitted_and_stays() {
    let folder = Folder::new();
    let page = text(&folder.path("constants.html"));
    let arguments = ["identify", DATA, "--system", SYSTEM, "--trajectory", "run", "--html", &page];
    let printed = lnn(&arguments);
    assert_eq!(printed.code, Some(0), "{}", printed.stderr);
    let html = std::fs::read_to_string(&page).unwrap();
    // Three pictures for each of two coordinates and one of the correlations; the verdict that was printed.
    assert_eq!(html.matches("<figure").count(), 7);
    let verdict = printed.stdout.lines().find(|line| line.starts_with("The model fits")).unwrap();
    assert!(html.contains(verdict) && html.contains("theta1 [rad]"), "{verdict}");
    lnn(&arguments).refused(1, &["constants.html", "--overwrite"]);
    assert_eq!(lnn(&[&arguments[..], &["--overwrite", "--json"]].concat()).code, Some(0));
}

#[test]
fn segments_are_as_short_as_asked_for_and_no_shorter_than_six_samples() {
    let run = |seconds: &str| {
        let all = ["identify", DATA, "--system", SYSTEM, "--trajectory", "run", "--json", "--segment", seconds];
        lnn(&all)
    };
    run("0.02").refused(2, &["--segment", "at least 6 samples", "0.02 s"]);
    let short = run("0.1");
    let found: Value = serde_json::from_str(&short.stdout).unwrap();
    assert!((found["segment_seconds"].as_f64().unwrap() - 0.1).abs() < 0.03, "{}", found["segment_seconds"]);
}

#[test]
fn rows_and_open_directions_are_named() {
    let folder = Folder::new();
    let mut lines: Vec<String> = fs::read_to_string(DATA).unwrap().lines().map(String::from).collect();
    // Row 301 of the file, the header being the first.
    let mut fields: Vec<String> = lines[300].split(',').map(String::from).collect();
    fields[2] = format!("{}", fields[2].parse::<f64>().unwrap() + 0.4);
    lines[300] = fields.join(",");
    let path = folder.path("outlier.csv");
    fs::write(&path, lines.join("\n")).unwrap();
    let path = text(&path);
    let all = ["identify", &path, "--system", SYSTEM, "--trajectory", "run", "--robust"];
    let run = lnn(&[&all[..], &["--constants", "m1,m2,l1,l2,g,c1,c2", "--json"]].concat());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let found: Value = serde_json::from_str(&run.stdout).unwrap();
    let outlier = &found["outliers"][0];
    assert_eq!((&outlier["row"], &outlier["coordinate"]), (&Value::from(301), &Value::from("theta1")), "{outlier}");
    // A force tells one of the two directions; masses beside lengths and gravity stay together whatever the motion.
    let open = found["undetermined"].as_array().unwrap();
    let (directions, advice) = (open[0]["directions"].as_array().unwrap(), open[0]["advice"].as_str().unwrap());
    assert!(open.len() == 1 && directions.len() == 2 && advice.contains("--force"), "{open:?}");
    let shown = lnn(&all);
    assert!(shown.code == Some(0) && shown.stdout.contains("301"), "{}", shown.stdout);
}

/// A pendulum seen in two parts of an hour apart, every state by two instruments, each with its error in degrees.
#[test]
fn gaps_repeated_times_and_errors_of_rows_are_taken_as_they_are() {
    let folder = Folder::new();
    let (start, system) =
        (["--state", "1.2,0", "--t-end", "40", "--dt", "0.05"], ["--system", "n-pendulum", "--param", "n=1"]);
    let made = lnn(&[&["rollout"], &system[..], &start, &["--param", "l=0.7", "--out", "-"]].concat());
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    let rows: Vec<Vec<f64>> =
        made.stdout.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    let write = |name: &str, rows: &[String]| {
        let path = folder.path(name);
        fs::write(&path, format!("t,theta,sigma\n{}\n", rows.join("\n"))).unwrap();
        text(&path)
    };
    let seen = rows.iter().enumerate().filter(|(k, _)| k % 400 < 60).flat_map(|(k, row)| {
        let off = |size: f64, phase: f64| row[1].to_degrees() + size * (7.7 * k as f64 * k as f64 + phase).sin();
        [format!("{},{},0.1", row[0], off(0.14, 0.0)), format!("{},{},2", row[0], off(2.8, 1.0))]
    });
    let seen: Vec<String> = seen.collect();
    let path = write("seen.csv", &seen);
    let run = |path: &str| {
        let columns = ["--units", "theta=deg", "--error", "sigma", "--constants", "l", "--json"];
        lnn(&[&["identify", path], &system[..], &columns].concat())
    };
    let found = run(&path);
    assert_eq!(found.code, Some(0), "{}", found.stderr);
    let found: Value = serde_json::from_str(&found.stdout).unwrap();
    let [value, error] = ["value", "standard_error"].map(|key| found["constants"]["l"][key].as_f64().unwrap());
    assert!((value - 0.7).abs() < 5.0 * error && error < 2e-4, "{value} {error}");
    assert_eq!((&found["converged"], &found["samples"]), (&Value::Bool(true), &Value::from(seen.len())), "{found}");
    // An error that is none is named by its row.
    for wrong in ["0", "-1"] {
        let mut rows = seen.clone();
        rows[4] = format!("{},{wrong}", rows[4].rsplit_once(',').unwrap().0);
        let refused = run(&write("wrong.csv", &rows));
        refused.refused(1, &["row 6", "sigma", "above 0"]);
    }
    // Who does not follow the motion goes on refusing repeated times.
    let checked = lnn(&["check", &path, "--coords", "theta"]);
    assert!(checked.code == Some(1) && checked.stderr.contains("row 3"), "{}", checked.stderr);
}

#[test]
fn what_free_pendula_tell_is_the_same_from_every_start() {
    let truth = [("m1", 1.0), ("m2", 1.0), ("l1", 1.0), ("l2", 1.0), ("c1", 0.08), ("c2", 0.05), ("g", 9.81)];
    let truth: BTreeMap<&str, f64> = truth.into();
    let base = ["identify", DATA, "--system", SYSTEM, "--trajectory", "run", "--json"];
    let mut all_advice = Vec::new();
    for start in [&[][..], &["m1=3", "g=4", "c2=0.2"], &["l1=2", "l2=0.5", "m2=2"]] {
        let params: Vec<&str> = start.iter().flat_map(|pair| ["--param", pair]).collect();
        let run = lnn(&[&base[..], &["--constants", "m1,m2,l1,l2,g,c1,c2"], &params].concat());
        let found: Value = serde_json::from_str(&run.stdout).unwrap();
        let open = &found["undetermined"][0];
        let known = open["known"].as_array().unwrap();
        assert_eq!(known.len(), 5, "{start:?}: {open}");
        for known in known {
            let of = |(name, power): (&String, &Value)| truth[name.as_str()].powf(power.as_f64().unwrap());
            let exact: f64 = known["terms"].as_object().unwrap().iter().map(of).product();
            let [value, error] = ["value", "standard_error"].map(|key| known[key].as_f64().unwrap());
            assert!((value - exact).abs() < 3.0 * error && error < 0.1 * exact, "{start:?}: {known} {exact}");
        }
        all_advice.push(open["advice"].clone());
    }
    assert!(all_advice.iter().all(|advice| *advice == all_advice[0]), "{all_advice:?}");
}

#[test]
fn a_listed_system_serves_and_what_is_wrong_is_named() {
    let base = ["identify", DATA, "--trajectory", "run", "--system"];
    let with = |more: &[&str]| lnn(&[&base[..], more].concat());
    let listed = with(&["double-pendulum", "--constants", "l2", "--param", "g=9.81", "--json"]);
    assert_eq!(listed.code, Some(0), "{}", listed.stderr);
    // The catalogue's pendulum has no friction.
    let found: Value = serde_json::from_str(&listed.stdout).unwrap();
    assert_eq!(found["explained"], Value::Bool(false), "{}", found["verdict"]);
    for (wrong, code, named) in [
        (&["double-pendulum", "--out", "found.toml"][..], 2, "--out"),
        (&[SYSTEM, "--out", "found.txt"], 2, "--out"),
        (&[SYSTEM, "--constants", "m3"], 2, "--constants"),
        (&[SYSTEM, "--gain", "theta3"], 2, "--gain"),
        (&[SYSTEM, "--coords", "theta1"], 2, "--coords"),
        (&[SYSTEM, "--noise", "0.1"], 2, "--noise"),
        (&[SYSTEM, "--error", "sigma"], 2, "--error"),
        (&[SYSTEM, "--error", "s1,s2"], 1, "s1"),
        (&[SYSTEM, "--param", "m9=1"], 2, "--param"),
        (&[SYSTEM, "--segment", "0"], 2, "--segment"),
        (&["particle-on-ellipse", "--coords", "theta1,theta2", "--constants", "g"], 1, "wire"),
        (&[SYSTEM, "--coords", "theta1,theta9"], 1, "theta9"),
        (&[SYSTEM, "--force", "tau1"], 2, "--force"),
    ] {
        let run = with(wrong);
        assert_eq!(run.code, Some(code), "{wrong:?}: {}", run.stderr);
        assert!(run.stderr.contains(named) && run.stderr.lines().count() == 1, "{wrong:?}: {}", run.stderr);
    }
}

const ARM: &str = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/systems/seven_joints.toml");

#[test]
fn links_move_as_the_recursion_of_newton_and_euler_says() {
    let folder = Folder::new();
    let motion = arm::Motion::new(3);
    let states: Vec<[[f64; JOINTS]; 3]> = (0..5).map(|k| motion.at(0.7 * f64::from(k))).collect();
    let columns = ["", "_dot", "_ddot"].iter().flat_map(|end| (1..=JOINTS).map(move |k| format!("q{k}{end}")));
    let mut csv = columns.collect::<Vec<_>>().join(",") + "\n";
    for state in &states {
        csv += &(state.concat().iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n");
    }
    let file = folder.file("states.csv", csv);
    let constants: Vec<String> = arm::constants().iter().map(|(name, x)| format!("{name}={x}")).collect();
    let params: Vec<&str> = constants.iter().flat_map(|pair| ["--param", pair]).collect();
    let run =
        lnn(&[&["inspect", "--system", ARM, "--inverse", "--states", &file, "--format", "csv"][..], &params].concat());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let rows: Vec<Vec<f64>> =
        run.stdout.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), states.len());
    for (row, [q, v, a]) in rows.iter().zip(&states) {
        let exact = arm::torques(q, v, a);
        assert!(row.iter().zip(exact).all(|(found, exact)| (found - exact).abs() < 1e-9), "{row:?} {exact:?}");
    }
}

#[test]
fn torques_of_a_log_tell_the_sums_of_the_constants_of_an_arm() {
    let folder = Folder::new();
    let data = folder.file("arm.csv", arm::log(6.0, Faults::USUAL, 1));
    let torques = arm::names("tau").join(",");
    let out = text(&folder.path("found.toml"));
    let asked = ["identify", &data, "--system", ARM, "--force", &torques, "--json", "--out", &out];
    let run = lnn(&asked);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let found: Value = serde_json::from_str(&run.stdout).unwrap();
    let truth: BTreeMap<String, f64> = arm::constants().into_iter().collect();
    let (mut far, mut sums) = (Vec::new(), 0);
    for sum in found["combinations"].as_array().unwrap() {
        let [value, error] = ["value", "standard_error"].map(|key| sum[key].as_f64().unwrap());
        let exact: f64 =
            sum["terms"].as_object().unwrap().iter().map(|(name, x)| x.as_f64().unwrap() * truth[name]).sum();
        far.push((value - exact).abs() / error);
        sums += usize::from(sum["terms"].as_object().unwrap().len() > 1);
    }
    // A revolute arm with a vertical first axis has 43 base parameters; each joint has two of friction.
    assert!(far.len() == 43 + 14 && sums > 10, "{} {sums}", far.len());
    far.sort_by(f64::total_cmp);
    assert!(far[far.len() / 2] < 2.0 && far[far.len() - 1] < 8.0, "{far:?}");
    let open = found["undetermined"].as_array().unwrap();
    let named = |at: usize, name: &str| open[at]["constants"].as_array().unwrap().iter().any(|known| known == name);
    assert!(open.len() == 2 && named(0, "m1") && named(1, "m3"), "{open:?}");
    for left in found["residuals"].as_array().unwrap() {
        let [rms, spread] = ["rms", "spread"].map(|key| left[key].as_f64().unwrap());
        assert!(rms < 0.2 * spread, "{left}");
    }
    // The file keeps its links and moves as the arm does: torques of its own log, by it.
    let written = fs::read_to_string(&out).unwrap();
    assert!(written.contains("[[links]]") && !written.contains("[definitions]"), "{written}");
    let again = lnn(&["systems", "--system", &out]);
    assert_eq!(again.code, Some(0), "{}", again.stderr);
    // Beside a network, and from a configuration that has the links itself: they are written out in what is kept.
    let links = folder.file(
        "links.toml",
        "system = \"elbow\"\n[description]\nname = \"elbow\"\n[description.parameters]\nm2 = 0.5\n[[description.links]]\n[[description.links]]\na = 0.3\n",
    );
    let model = text(&folder.path("elbow"));
    let learned = lnn(&["train", "--config", &links, "--out", &model, "--epochs", "1", "--hidden", "4"]);
    assert_eq!(learned.code, Some(0), "{}", learned.stderr);
    let kept = fs::read_to_string(folder.path("elbow").join("config.toml")).unwrap();
    assert!(kept.contains("link2_L") && !kept.contains("links]]"), "{kept}");
    let rolled = lnn(&["rollout", &model, "--state", "0.1,0.2,0,0", "--t-end", "0.1", "--dt", "0.1", "--out", "-"]);
    assert_eq!(rolled.code, Some(0), "{}", rolled.stderr);
    // Sensors are a matter of the motion.
    for follows in [["--offset", "q1"], ["--segment", "1"]] {
        lnn(&[&asked[..7], &["--targets", "forces"], &follows].concat()).refused(2, &["--targets", "sensor constants"]);
    }
    lnn(&["identify", &data, "--system", ARM, "--targets", "forces"]).refused(2, &["--targets", "known forces"]);
}

/// A pendulum that is led along two tones, 300 a second over 6 s: an encoder of 3 mrad that repeats one reading in eight, a torque with noise.
fn led(folder: &Folder) -> String {
    let mut random = 1_u64;
    let mut uniform = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut csv, mut last) = (String::from("t,q,tau\n"), 0.0);
    for k in 0..1800 {
        let t = f64::from(k) / 300.0;
        let [q, v, a] = [(1.1, 2.3, 0.3), (0.6, 5.1, 1.0)].iter().fold([0.0; 3], |[q, v, a], (size, rate, phase)| {
            let (sin, cos) = (rate * t + phase).sin_cos();
            [q + size * sin, v + size * rate * cos, a - size * rate * rate * sin]
        });
        let noise = 0.15 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0);
        if k == 0 || uniform() > 0.125 {
            last = (q / 0.003).round() * 0.003;
        }
        csv += &format!("{t},{last},{}\n", 0.14 * a + 2.8 * q.sin() + 0.05 * v + noise);
    }
    folder.file("led.csv", csv)
}

#[test]
fn readings_that_are_repeated_do_not_excuse_a_wrong_form() {
    let folder = Folder::new();
    let data = led(&folder);
    let found = |weight: &str| {
        let potential = if weight.is_empty() { String::new() } else { format!("{weight} = 2\n") };
        let term = if weight.is_empty() { String::new() } else { format!(" + {weight}*cos(q)") };
        let system = folder.file(
            "swing.toml",
            format!(
                "name = \"swing\"\nlagrangian = \"I*q_dot^2/2{term}\"\ndissipation = \"b*q_dot^2/2\"\n[[coordinates]]\nname = \"q\"\n\
                 periodic = true\nvelocity_bounds = [-10, 10]\n[parameters]\nI = 0.1\nb = 0.1\n{potential}"
            ),
        );
        let run = lnn(&["identify", &data, "--system", &system, "--force", "tau", "--targets", "forces", "--json"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        serde_json::from_str::<Value>(&run.stdout).unwrap()
    };
    let (right, wrong) = (found("G"), found(""));
    let over_noise = |found: &Value| found["over_noise"].as_f64().unwrap();
    assert!((0.7..1.3).contains(&over_noise(&right)) && over_noise(&wrong) > 3.0, "{}", wrong["verdict"]);
    assert_eq!(wrong["verdict"]["kind"], "large", "{}", wrong["verdict"]);
    for (name, truth) in [("I", 0.14), ("G", 2.8), ("b", 0.05)] {
        let [value, error] = ["value", "standard_error"].map(|key| right["constants"][name][key].as_f64().unwrap());
        assert!((value - truth).abs() < 4.0 * error && error < 0.2 * truth, "{name} {value} {error}");
    }
}
