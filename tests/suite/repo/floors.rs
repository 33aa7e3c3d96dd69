//! The order of the modules: a file imports from its own module and from those before it, and foreign crates stay in their adapters.

use std::fs;
use std::path::Path;

/// Floors from the bottom to the top, with their modules in order.
const FLOORS: [(&str, &[&str]); 6] = [
    ("numerics", &["platform", "scalar", "random", "ops", "forward", "linalg", "tape"]),
    ("support", &["cancellation", "names", "findings", "storage"]),
    ("mechanics", &["lagrangian", "rollout", "network"]),
    ("learning", &["recording", "state", "optimizers", "configuration", "data", "training", "shooting", "presets"]),
    (
        "physics",
        &[
            "digits",
            "geometry",
            "constraints",
            "symmetry",
            "certificate",
            "analysis",
            "relativity",
            "identification",
            "formula",
        ],
    ),
    ("app", &["experiments", "report", "pipeline"]),
];

/// Crates with the only places that name them.
const ADAPTERS: [(&str, &[&str]); 15] = [
    ("pulp", &["numerics/scalar/"]),
    ("libm", &["numerics/scalar/"]),
    ("spin", &["numerics/platform.rs"]),
    ("faer", &["numerics/linalg/by_faer.rs"]),
    ("nalgebra", &["mechanics/rollout/"]),
    ("ode_solvers", &["mechanics/rollout/"]),
    ("argmin", &["learning/training/", "learning/shooting/"]),
    ("safetensors", &["support/storage/container/"]),
    ("crc32fast", &["support/storage/container/"]),
    ("postcard", &["learning/state.rs"]),
    ("zip", &["learning/recording/read/"]),
    ("flate2", &["app/report/plot/png.rs", "learning/recording/read/gzip.rs"]),
    ("roxmltree", &["app/pipeline/robot/"]),
    ("clap", &["cli/"]),
    ("signal_hook", &["cli/terminal/interrupt.rs"]),
];

/// Position of a module in the order.
fn position(module: &str) -> Option<usize> {
    FLOORS.iter().flat_map(|(_, modules)| *modules).position(|known| *known == module)
}

/// Folders of sources of the libraries, the floors below before those above.
pub(super) const LIBRARIES: [&str; 2] = ["crates/lnn-engine/src", "src"];

/// Folder of the sources of the program.
const PROGRAM: &str = "crates/lnn-cli/src";

/// Source files that are not tests, by their path below [`LIBRARIES`] or, after `cli/`, below [`PROGRAM`], without comments and tests.
pub(super) fn sources() -> Vec<(String, String)> {
    fn gather(folder: &Path, root: &Path, found: &mut Vec<(String, String)>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap();
            if path.is_dir() {
                gather(&path, root, found);
            } else if name.ends_with(".rs") && !name.ends_with("tests.rs") {
                let text = fs::read_to_string(&path).unwrap();
                let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
                let code: Vec<&str> = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
                let inside = path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
                found.push((inside, code.join("\n")));
            }
        }
    }
    let top = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let (mut found, mut program) = (Vec::new(), Vec::new());
    LIBRARIES.map(|folder| top.join(folder)).iter().for_each(|root| gather(root, root, &mut found));
    gather(&top.join(PROGRAM), &top.join(PROGRAM), &mut program);
    found.extend(program.into_iter().map(|(path, code)| (format!("cli/{path}"), code)));
    found
}

/// Names behind `crate::` in a source.
fn named(code: &str) -> impl Iterator<Item = &str> {
    code.split("crate::").skip(1).map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap())
}

#[test]
fn no_file_imports_from_a_later_module() {
    let mut faults = Vec::new();
    let mut files = 0;
    for (path, code) in sources() {
        let [floor, module, ..] = path.split('/').collect::<Vec<_>>()[..] else { continue };
        if module == "mod.rs" || floor == "cli" {
            continue;
        }
        files += 1;
        let at_home =
            FLOORS.iter().any(|(name, modules)| *name == floor && modules.contains(&module.trim_end_matches(".rs")));
        assert!(at_home, "{path}: no module of the list");
        assert!(!code.contains("use crate::{"), "{path}: one line per module, so that the order can be read off");
        let own = position(module.trim_end_matches(".rs"));
        faults.extend(named(&code).filter(|name| position(name) > own).map(|name| format!("{path} imports {name}")));
    }
    assert!(files > 200 && faults.is_empty(), "{files} files\n{}", faults.join("\n"));
}

#[test]
fn foreign_crates_stay_in_their_adapters() {
    for (path, code) in sources() {
        for (name, places) in ADAPTERS {
            let named = [format!("use {name}::"), format!(" {name}::"), format!("({name}::"), format!("<{name}::")];
            let leaks = named.iter().any(|text| code.contains(text)) && !places.iter().any(|at| path.starts_with(at));
            assert!(!leaks, "{path} names {name}");
        }
    }
}
