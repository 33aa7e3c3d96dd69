//! `summary.json` and `evaluation.json` have the keys that the page of documentation lists, and no others.

use crate::running::{Folder, lnn, text};
use serde_json::Value;
use std::collections::BTreeSet;

/// Objects whose keys are names of the data.
const NAMED: [&str; 4] = ["physics.region", "misfit", "constants", "constant_ranges"];

/// A key of the page: path, commands that write it, `true` if they always do.
struct Documented {
    path: String,
    commands: String,
    always: bool,
}

/// The cells of the tables of the page under a heading.
fn table(heading: &str) -> Vec<Vec<String>> {
    let page =
        std::fs::read_to_string(concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/docs/summary.md")).unwrap();
    let (_, rest) = page.split_once(&format!("\n## {heading}\n")).unwrap();
    let rows = rest.split("\n## ").next().unwrap().lines().filter(|line| line.starts_with('|')).skip(2);
    rows.map(|line| line.trim_matches('|').split('|').map(|cell| cell.trim().replace('`', "")).collect()).collect()
}

fn documented() -> Vec<Documented> {
    let shapes = table("Shapes");
    let mut all = Vec::new();
    for row in table("Keys") {
        let [path, commands, shape, _] = &row[..] else { panic!("{row:?}") };
        let always = !commands.starts_with('(');
        let commands = commands.trim_matches(['(', ')']).to_string();
        let name = shape.trim_matches(['(', ')']);
        let below = shapes.iter().filter(|row| row[0] == name).map(|row| format!("{path}.{}", row[1]));
        let with_shape: Vec<String> = below.collect();
        assert!(name.is_empty() || !with_shape.is_empty(), "{path}: no shape {name}");
        // In brackets the object may be missing.
        let whole = shape.is_empty() || shape.starts_with('(');
        let always_below = always && !shape.starts_with('(');
        let commands = || commands.clone();
        all.extend(whole.then(|| Documented {
            path: path.clone(),
            commands: commands(),
            always: always && name.is_empty(),
        }));
        all.extend(with_shape.into_iter().map(|path| Documented { path, commands: commands(), always: always_below }));
    }
    all
}

/// Paths of all values that are neither objects nor lists of objects.
fn paths(path: &str, value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) if !object.is_empty() => {
            for (name, value) in object {
                let name = if NAMED.contains(&path) { "NAME" } else { name };
                let path = if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
                paths(&path, value, found);
            }
        }
        Value::Array(items) if items.first().is_some_and(Value::is_object) => {
            items.iter().for_each(|item| paths(&format!("{path}[]"), item, found));
        }
        _ => _ = found.insert(path.to_string()),
    }
}

fn hold(command: char, json: &str) {
    let mut found = BTreeSet::new();
    paths("", &serde_json::from_str(json).unwrap(), &mut found);
    let all = documented();
    let of = |one: &&Documented| one.commands.contains(command);
    for path in &found {
        // An object that is missing, or a list that is empty, stands for what is below it.
        let below = [format!("{path}."), format!("{path}[")];
        let known =
            |one: &Documented| one.path == *path || below.iter().any(|below| one.path.starts_with(below.as_str()));
        assert!(all.iter().filter(of).any(known), "{command}: {path} is not documented");
    }
    for Documented { path, .. } in all.iter().filter(of).filter(|one| one.always) {
        assert!(found.contains(path), "{command}: there is no {path}");
    }
}

#[test]
fn every_key_of_a_summary_is_documented_and_every_documented_key_is_there() {
    let folder = Folder::new();
    let out = text(&folder.path("trained"));
    let small = ["--hidden", "4", "--epochs", "2", "--threads", "1", "--json"];
    let trained = lnn(&[&["train", "double-pendulum", "--out", &out][..], &small].concat());
    trained.succeeded();
    hold('T', &trained.stdout);
    let evaluated = lnn(&["evaluate", &out, "--json"]);
    evaluated.succeeded();
    hold('E', &evaluated.stdout);
    let data = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/data/pendulum.csv");
    let columns = ["fit", data, "--coords", "theta1,theta2", "--periodic", "theta1,theta2", "--trajectory", "run"];
    let of_fit = text(&folder.path("fitted"));
    let more = ["--targets", "smoothed", "--out", &of_fit];
    let fitted = lnn(&[&columns[..], &more, &small].concat());
    fitted.succeeded();
    hold('F', &fitted.stdout);
    // Both are what is written.
    assert_eq!(std::fs::read_to_string(folder.path("fitted/summary.json")).unwrap(), fitted.stdout);
}
