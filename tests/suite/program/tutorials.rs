//! The tutorials and the page of limits, followed as by a reader: their files are written, their commands run in order, and what comes out is what
//! the pages quote and what the recordings were made with.

use crate::running::{Folder, Run, command, text};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// A value with its standard error.
type Measured = [f64; 2];

/// A command of a page with its standard output, and whether that is one JSON object.
struct Step {
    line: String,
    stdout: String,
    object: bool,
}

impl Step {
    fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|e| panic!("{}: {e}", self.line))
    }
}

/// A page whose commands have run.
struct Followed {
    folder: Folder,
    steps: Vec<Step>,
    /// Values that the page quotes and that came out again.
    quoted: usize,
}

impl Followed {
    /// The step whose line holds this.
    fn step(&self, part: &str) -> &Step {
        self.steps.iter().find(|step| step.line.contains(part)).unwrap_or_else(|| panic!("no command with {part}"))
    }
    /// A column of a file that the page wrote.
    fn column(&self, file: &str, name: &str) -> Vec<f64> {
        let table = fs::read_to_string(self.folder.path(file)).unwrap();
        let mut rows = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let header = rows.next().unwrap();
        let at = header.iter().position(|column| *column == name).unwrap_or_else(|| panic!("{file}: no {name}"));
        rows.map(|row| row[at].parse().unwrap()).collect()
    }
}

/// Fenced blocks of a page: language and content.
fn blocks(page: &str) -> Vec<(&str, &str)> {
    page.split("\n```").skip(1).step_by(2).filter_map(|block| block.split_once('\n')).collect()
}

/// The file that a block is, by its first line `# NAME.END`.
fn file_name(block: &str) -> Option<&str> {
    let name = block.lines().next()?.strip_prefix("# ")?;
    (name.contains('.') && !name.contains(' ')).then_some(name)
}

/// Everything that a formula or an identification states with an error, by the name that the tables give it.
fn determined(found: &Value) -> BTreeMap<String, Measured> {
    let mut all = BTreeMap::new();
    let mut put = |name: String, entry: &Value, key: &str| {
        if let (Some(value), Some(error)) = (entry[key].as_f64(), entry["standard_error"].as_f64()) {
            all.entry(name).or_insert([value, error]);
        }
    };
    for (name, entry) in found["constants"].as_object().into_iter().flatten() {
        put(name.clone(), entry, "value");
    }
    let open = found["undetermined"].as_array().into_iter().flatten();
    let named = open.flat_map(|group| group["known"].as_array().into_iter().flatten());
    for entry in found["combinations"].as_array().into_iter().flatten().chain(named) {
        put(entry["name"].as_str().unwrap().to_string(), entry, "value");
    }
    for entry in found["terms"].as_array().into_iter().flatten() {
        let term = entry["term"].as_str().unwrap();
        let name = if entry["dissipation"] == true { format!("D: {term}") } else { term.to_string() };
        put(name, entry, "coefficient");
    }
    all
}

/// How many values of a result a block of output quotes; each is within half a standard error of the result.
fn quoted(block: &str, found: &Value) -> usize {
    let (known, place) = (determined(found), if found["terms"].is_array() { 2 } else { 1 });
    let mut count = 0;
    for row in block.lines() {
        let fields: Vec<&str> = row.split("  ").map(str::trim).filter(|field| !field.is_empty()).collect();
        let Some([value, error]) = fields.first().and_then(|name| known.get(*name)) else { continue };
        let Some(Ok(said)) = fields.get(place).map(|field| field.parse::<f64>()) else { continue };
        assert!((said - value).abs() <= 0.5 * error, "{row}: {value} +- {error}");
        count += 1;
    }
    count
}

/// Whether a command can print JSON instead of its table.
fn has_json(words: &[String]) -> bool {
    let kinds = ["formula", "geometry", "identify", "shadow", "symmetries", "compare"];
    kinds.contains(&words[0].as_str()) && !words.iter().any(|word| word == "--format")
}

/// Follows a page of `docs`; `change` makes a command small.
fn follow(page: &str, change: impl Fn(&mut Vec<String>)) -> Followed {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let content = fs::read_to_string(root.join("docs").join(page)).unwrap();
    let mut followed = Followed { folder: Folder::new(), steps: Vec::new(), quoted: 0 };
    let mut latest = 0;
    for (language, block) in blocks(&content) {
        if language != "sh" {
            if let Some(name) = file_name(block) {
                followed.folder.file(name, format!("{block}\n"));
            }
            for step in followed.steps[latest..].iter().filter(|step| step.object) {
                followed.quoted += quoted(block, &step.json());
            }
            continue;
        }
        latest = followed.steps.len();
        for line in block.lines() {
            let Some(rest) = line.split(" #").next().and_then(|line| line.trim().strip_prefix("lnn ")) else {
                continue;
            };
            let place =
                |word: &str| if word.starts_with("examples/") { text(&root.join(word)) } else { word.to_string() };
            let mut words: Vec<String> = rest.split_whitespace().map(place).collect();
            change(&mut words);
            let object = has_json(&words);
            if object {
                words.push("--json".to_string());
            }
            let given: Vec<&str> = words.iter().map(String::as_str).collect();
            let run = Run::of(command(&given).current_dir(followed.folder.0.path()));
            assert_eq!(run.code, Some(0), "{page}: {line}: {}", run.stderr);
            for pair in given.windows(2).filter(|pair| ["--out", "--html", "--plot"].contains(&pair[0])) {
                let written = fs::metadata(followed.folder.path(pair[1])).map(|file| file.len());
                assert!(written.is_ok_and(|bytes| bytes > 0), "{page}: {line}: no {}", pair[1]);
            }
            followed.steps.push(Step { line: line.to_string(), stdout: run.stdout, object });
        }
    }
    followed
}

/// Fails unless a result states this within four standard errors, which are positive.
fn states(found: &Value, name: &str, truth: f64) {
    let known = determined(found);
    let [value, error] = known.get(name).unwrap_or_else(|| panic!("no {name} in {known:?}"));
    assert!(*error > 0.0 && (value - truth).abs() < 4.0 * error, "{name}: {value} +- {error}, not {truth}");
}

#[test]
fn a_film_becomes_a_law_with_its_constants() {
    let film = follow("tutorial-film.md", |_| ());
    let law = film.step("lnn formula").json();
    assert_eq!((&law["verdict"], law["terms"].as_array().unwrap().len()), (&"found".into(), 8));
    for (term, truth) in [
        ("y", -9.81),
        ("x^2", -25.0),
        ("y^2", -25.0),
        ("sqrt(x^2 + y^2)", 12.5),
        ("D: x_dot^2", 0.01),
        ("D: y_dot^2", 0.01),
    ] {
        states(&law, term, truth);
    }
    // Three pictures of each coordinate.
    let page = fs::read_to_string(film.folder.path("law.html")).unwrap();
    assert_eq!(page.matches("<figure").count(), 6);
    let constants = film.step("constants.html").json();
    assert_eq!(constants["explained"], true);
    for (name, truth) in [("g", 9.81), ("k", 10.0), ("l0", 0.25), ("c", 0.004)] {
        states(&constants, name, truth);
    }
    states(&film.step("--units t=8").json(), "g", 9.81 / 64.0);
    states(&film.step("--offset x,y").json(), "g", 9.81);
    assert_eq!(film.step("--constants g,k,l0").json()["explained"], false);
    let open = film.step("--constants m,g,k,l0,c").json();
    states(&open, "g", 9.81);
    states(&open, "l0", 0.25);
    assert!(!determined(&open).contains_key("m") && !open["undetermined"].as_array().unwrap().is_empty());
    assert!(film.quoted >= 20, "{} values quoted", film.quoted);
    // Friction only takes energy.
    assert!(film.column("swing.csv", "energy").windows(2).all(|pair| pair[1] < pair[0] + 1e-6));
}

/// Constants with which `tests/scripts/tutorial_data.py` made the log; all others of the determined sums are 0.
const ARM: [(&str, f64); 20] = [
    ("Fc1", 0.6),
    ("Fc2", 0.5),
    ("Fc3", 0.3),
    ("Fv1", 0.5),
    ("Fv2", 0.4),
    ("Fv3", 0.2),
    ("Izz1", 0.015),
    ("Ixx2", 0.0072),
    ("Iyy2", 0.1434),
    ("Izz2", 0.1422),
    ("Ixz2", -0.0108),
    ("mx2", 0.54),
    ("Ixx3", 0.00215),
    ("Iyy3", 0.04975),
    ("Izz3", 0.0499),
    ("Ixy3", -0.00225),
    ("m3", 1.5),
    ("mx3", 0.225),
    ("my3", 0.015),
    ("mz3", 0.0),
];

#[test]
fn a_log_of_an_arm_gives_its_constants_and_its_torques() {
    let robot = follow("tutorial-robot.md", |_| ());
    let found = robot.step("arm.html").json();
    assert_eq!(found["explained"], true);
    let sums = found["combinations"].as_array().unwrap();
    assert!(sums.len() > 15, "{sums:?}");
    for sum in sums {
        let terms = sum["terms"].as_object().unwrap().iter();
        let known = |name: &str| ARM.iter().find(|(known, _)| *known == name).map_or(0.0, |(_, value)| *value);
        let truth: f64 = terms.map(|(name, factor)| factor.as_f64().unwrap() * known(name)).sum();
        let [value, error] = ["value", "standard_error"].map(|key| sum[key].as_f64().unwrap());
        assert!((value - truth).abs() < 4.0 * error, "{}: {value} +- {error}, not {truth}", sum["name"]);
    }
    // Held out horizontally, held up, and raised.
    let torques: Vec<Vec<f64>> = robot
        .step("lnn inspect")
        .stdout
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|field| field.parse().unwrap()).collect())
        .collect();
    let weight = 9.81 * (0.54 + 0.4 * 1.5 + 0.225);
    assert!((torques[0][1] - weight).abs() < 0.05 && torques[1][1].abs() < 0.3, "{torques:?}");
    assert!((torques[2][1] - torques[0][1] - 2.1).abs() < 0.2, "{torques:?}");
    assert!(robot.column("fall.csv", "energy").windows(2).all(|pair| pair[1] < pair[0] + 1e-4));
    // What is wrong with an arm shows.
    assert_eq!(robot.step("smooth.toml").json()["explained"], false);
    let ceiling = robot.step("ceiling.toml").json();
    let [moment, error] = determined(&ceiling)["mx2 + 0.4000*m3"];
    assert!(ceiling["explained"] == false && moment < -10.0 * error, "{moment} +- {error}");
    assert!(robot.quoted >= 17, "{} values quoted", robot.quoted);
}

#[test]
fn a_urdf_becomes_that_of_the_arm_that_was_built() {
    let arm = follow("tutorial-urdf.md", |_| ());
    let found = arm.step("--out built.urdf").json();
    assert_eq!(found["explained"], true);
    // Friction, and a first moment of the forearm with the wrist, as `tests/scripts/tutorial_data.py` has them.
    for (name, truth) in [("Fc1", 8.0), ("Fc2", 9.0), ("Fc3", 5.0), ("Fv1", 6.0), ("Fv3", 4.0), ("Fv6", 0.8)] {
        states(&found, name, truth);
    }
    let [forearm, wrist] = [1.25 * 4.0, 1.1 * 1.8 + 1.15 * 1.5 + 1.3 * 0.4 + 0.9];
    states(&found, "mx3 + 0.3900*m4 + 0.3900*m5 + 0.3900*m6", 0.17 * forearm + 0.39 * wrist);
    let torque = |step: &Step| -> f64 {
        let row = step.stdout.lines().nth(1).unwrap();
        row.split(',').nth(1).unwrap().parse().unwrap()
    };
    let upper = 1.1 * 12.0 * 0.215 + 0.42 * (forearm + wrist);
    let truth = -9.81 * (upper + 0.17 * forearm + 0.39 * wrist);
    let [drawn, built] = ["inspect --system examples", "inspect --system built"].map(|part| torque(arm.step(part)));
    assert!((built - truth).abs() < 0.01 * (drawn - truth).abs(), "{built} and {drawn}, not {truth}");
    // Every byte beside numbers of bodies and friction stays.
    let drawings = fs::read_to_string(
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("examples/systems/six_joints.urdf"),
    );
    let written = fs::read_to_string(arm.folder.path("built.urdf")).unwrap();
    let kept = |text: &str| -> Vec<String> {
        let own = ["<inertia ", "<mass ", "<dynamics ", "<origin "];
        let other = text.lines().filter(|line| !own.iter().any(|tag| line.contains(tag)));
        other.map(String::from).collect()
    };
    assert_eq!(kept(&written), kept(&drawings.unwrap()));
    assert_eq!(arm.step("--constants m2").json()["explained"], false);
    assert!(arm.quoted >= 7, "{} values quoted", arm.quoted);
}

#[test]
fn voltages_and_angles_give_the_constants_of_a_motor() {
    let motor = follow("tutorial-motor.md", |_| ());
    let found = motor.step("--html motor.html").json();
    assert_eq!(found["explained"], true);
    for (name, truth) in [("l", 0.2), ("K", 0.15), ("b", 0.01), ("Fc", 0.03)] {
        states(&found, name, truth);
    }
    assert_eq!(motor.step("smooth.toml").json()["explained"], false);
    // Without the mass only its ratios are known.
    let open = motor.step("--constants").json();
    states(&open, "l", 0.2);
    states(&open, "Fc/m", 0.06);
    assert!(!determined(&open).contains_key("K") && !determined(&open).contains_key("m"));
    assert!(motor.quoted >= 6, "{} values quoted", motor.quoted);
    // Two volts hold the pendulum out: K u = m g l sin(theta).
    let last = motor.column("held.csv", "theta").pop().unwrap();
    assert!((last - (0.3_f64 / 0.981).asin()).abs() < 0.04, "{last}");
}

#[test]
fn observations_of_a_star_give_its_orbit() {
    let star = follow("tutorial-star.md", |_| ());
    let found = star.step("--html star.html").json();
    assert_eq!(found["explained"], true);
    for (name, truth) in [("GM", 43.4), ("i", 0.7), ("node", 0.5), ("v0", 0.4)] {
        states(&found, name, truth);
    }
    for (name, truth) in [("GM", 43.4), ("i", 0.7), ("node", 0.5)] {
        states(&star.step("sky.toml").json(), name, truth);
    }
    assert_eq!(star.step("other.toml").json()["explained"], false);
    assert!(star.quoted >= 7, "{} values quoted", star.quoted);
}

#[test]
fn a_metric_has_a_curvature_a_fall_and_a_sky() {
    // Few pixels, few places of the edge.
    let metric = follow("tutorial-metric.md", |words| {
        if words[0] == "shadow" {
            words.iter_mut().filter(|word| **word == "200").for_each(|word| *word = "16".to_string());
            words.extend(["--edges", "4"].map(String::from));
        }
    });
    let throat = metric.step("--at t=0,l=0").json();
    for (key, truth) in [("ricci_scalar", -3.0), ("kretschmann", 13.0)] {
        let value = throat[key].as_f64().unwrap_or_else(|| panic!("no {key}"));
        assert!((value - truth).abs() < 1e-9, "{key}: {value}");
    }
    assert_eq!(metric.step("lnn symmetries").json()["count"], 4);
    let energy = metric.column("fall.csv", "energy");
    assert!(energy.iter().all(|value| (value + 0.5).abs() < 1e-7), "{energy:?}");
    // From rest at l = 8: E^2 = exp(-2 M/r), and l_dot^2 = E^2 exp(2 M/b) - 1 in the throat.
    let speed = (1.0 - 1.0 / 65_f64.sqrt()).exp_m1().sqrt();
    let fastest = metric.column("fall.csv", "l_dot").into_iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    assert!((fastest - speed).abs() < 1e-3, "{fastest}, not {speed}");
    let farthest = metric.column("fall.csv", "l").into_iter().fold(0.0, f64::min);
    assert!((farthest + 8.0).abs() < 1e-3, "{farthest}");
    for (picture, impact) in [("sky.png", 0.5_f64.exp()), ("massless.png", 1.0)] {
        let edge = metric.step(picture).json()["exact"]["right"].as_f64().unwrap();
        assert!((edge - impact).abs() < 1e-4, "{picture}: {edge}");
    }
}

#[test]
fn what_motion_leaves_open_is_open_until_something_determines_it() {
    let limits = follow("limits.md", |_| ());
    // A gauge changes neither the motion nor what is left of L beside it.
    let gauge = limits.step("lnn compare oscillator.toml gauged.toml").json();
    for key in ["motion", "lagrangian", "mass_matrix"] {
        assert!(gauge[key].as_f64().unwrap() < 1e-12, "{gauge}");
    }
    assert!(gauge["gauge"].as_array().unwrap().iter().any(|term| term.as_f64().unwrap().abs() > 1.0), "{gauge}");
    let near = |found: &Value, name: &str, truth: f64| {
        let [value, _] = determined(found)[name];
        assert!((value - truth).abs() < 1e-4 * truth, "{name}: {value}, not {truth}");
    };
    // Another start gives another mass with the same ratio; a known force gives the mass.
    let [heavy, light] = ["--param m=3", "--param m=0.5"].map(|start| limits.step(start).json());
    for free in [&heavy, &light] {
        near(free, "k/m", 4.0);
        assert!(!determined(free).contains_key("m") && !determined(free).contains_key("k"));
    }
    let mass = |found: &Value| found["constants"]["m"]["value"].as_f64().unwrap();
    assert!(mass(&heavy) > 1.5 * mass(&light), "{} {}", mass(&heavy), mass(&light));
    let pulled = limits.step("lnn identify pulled.csv").json();
    near(&pulled, "m", 1.0);
    near(&pulled, "k", 4.0);
    // Two blocks have two open factors, a coupling leaves one.
    let groups = |found: &Value| found["undetermined"].as_array().unwrap().len();
    let (apart, coupled) = (limits.step("identify blocks.csv").json(), limits.step("identify coupled.csv").json());
    assert_eq!((groups(&apart), groups(&coupled)), (2, 1));
    near(&apart, "k1/m1", 4.0);
    near(&apart, "k2/m2", 10.0);
    let value = |name: &str| coupled["constants"][name]["value"].as_f64().unwrap();
    assert!((value("m2") / value("m1") - 2.0).abs() < 1e-3, "{coupled}");
    let factors = limits.step("--param-b m2=7").json()["group_factors"].clone();
    assert!((factors[1].as_f64().unwrap() - 2.0 / 7.0).abs() < 1e-9, "{factors}");
    assert!(limits.quoted >= 8, "{} values quoted", limits.quoted);
}
