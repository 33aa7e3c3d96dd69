//! The house: rooms import only from rooms above them, and third-party types stay inside their adapters.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Rooms from top to bottom; a file may name its own room and those before it.
pub(super) const ROOMS: [&str; 27] = [
    "names",
    "scalar",
    "storage",
    "random",
    "ops",
    "forward",
    "linalg",
    "tape",
    "recording",
    "lagrangian",
    "geometry",
    "rollout",
    "network",
    "symmetry",
    "certificate",
    "optimizers",
    "configuration",
    "data",
    "training",
    "shooting",
    "presets",
    "analysis",
    "relativity",
    "experiments",
    "report",
    "pipeline",
    "cli",
];

/// Crates and the only places that may name them.
const ADAPTERS: [(&str, &str); 18] = [
    ("pulp", "src/scalar/"),
    ("rand_chacha", "src/random/"),
    ("xprec", "src/scalar/"),
    ("libm", "src/scalar/"),
    ("faer", "src/linalg/"),
    ("nalgebra", "src/rollout/"),
    ("ode_solvers", "src/rollout/"),
    ("argmin", "src/training/"),
    ("argmin", "src/shooting/"),
    ("safetensors", "src/storage/container/"),
    ("crc32fast", "src/storage/container/"),
    ("zip", "src/recording/read/npz.rs"),
    ("flate2", "src/report/plot/png.rs"),
    ("clap", "src/cli/"),
    ("clap_complete", "src/cli/"),
    ("clap_mangen", "src/cli/"),
    ("indicatif", "src/cli/"),
    ("signal_hook", "src/cli/interrupt.rs"),
];

/// Source without comments and literals, cut into identifiers and single symbols (`::` is one).
pub(super) fn tokens(source: &str) -> Vec<String> {
    let chars: Vec<char> = source.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let (mut tokens, mut i) = (Vec::new(), 0);
    while i < chars.len() {
        let c = chars[i];
        if c == '/' && at(i + 1) == '/' {
            while i < chars.len() && chars[i] != '\n' {
                i += 1;
            }
        } else if c == '/' && at(i + 1) == '*' {
            let mut depth = 0;
            loop {
                match (at(i), at(i + 1)) {
                    ('/', '*') => (depth, i) = (depth + 1, i + 2),
                    ('*', '/') => (depth, i) = (depth - 1, i + 2),
                    _ => i += 1,
                }
                if depth == 0 || i >= chars.len() {
                    break;
                }
            }
        } else if c == 'r' && (at(i + 1) == '"' || (at(i + 1) == '#' && matches!(at(i + 2), '"' | '#'))) {
            let hashes = chars[i + 1..].iter().take_while(|c| **c == '#').count();
            i += hashes + 2;
            while i < chars.len() && !(chars[i] == '"' && (1..=hashes).all(|k| at(i + k) == '#')) {
                i += 1;
            }
            i += hashes + 1;
        } else if c == '"' {
            i += 1;
            while i < chars.len() && chars[i] != '"' {
                i += if chars[i] == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if c == '\'' && at(i + 1) == '\\' {
            i += 3;
            while i < chars.len() && chars[i] != '\'' {
                i += 1;
            }
            i += 1;
        } else if c == '\'' && at(i + 2) == '\'' {
            i += 3;
        } else if c.is_alphanumeric() || c == '_' {
            let start = i;
            while i < chars.len() && (chars[i].is_alphanumeric() || chars[i] == '_') {
                i += 1;
            }
            tokens.push(chars[start..i].iter().collect());
        } else {
            let double = c == ':' && at(i + 1) == ':';
            if !c.is_whitespace() {
                tokens.push(if double { "::".to_string() } else { c.to_string() });
            }
            i += if double { 2 } else { 1 };
        }
    }
    tokens
}

/// Index just behind the bracket that closes the one at `open`.
pub(super) fn closing(tokens: &[String], open: usize) -> usize {
    let mut depth = 0;
    for (k, token) in tokens.iter().enumerate().skip(open) {
        match token.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return k + 1;
        }
    }
    tokens.len()
}

/// Drops `#[cfg(test)]` items; the names of modules in other files declared that way come second.
pub(super) fn without_tests(tokens: &[String]) -> (Vec<String>, Vec<String>) {
    let mark = ["#", "[", "cfg", "(", "test", ")", "]"];
    let (mut kept, mut modules, mut i) = (Vec::new(), Vec::new(), 0);
    while i < tokens.len() {
        if tokens[i..].len() > mark.len() && tokens[i..].iter().zip(mark).all(|(a, b)| a == b) {
            i += mark.len();
            while i < tokens.len() && tokens[i] == "#" {
                i = closing(tokens, i + 1);
            }
            if let Some(k) = tokens[i..].iter().take(4).position(|t| t == "mod")
                && tokens.get(i + k + 2).is_some_and(|t| t == ";")
            {
                modules.push(tokens[i + k + 1].clone());
            }
            while i < tokens.len() && tokens[i] != "{" && tokens[i] != ";" {
                i += 1;
            }
            i = if i < tokens.len() && tokens[i] == "{" { closing(tokens, i) } else { i + 1 };
        } else {
            kept.push(tokens[i].clone());
            i += 1;
        }
    }
    (kept, modules)
}

/// First path segments after the crate root, however it is named: `crate::x`, `crate::{x, y}`, `super::..::x`.
///
/// `depth` is the number of modules between the crate root and this file.
fn rooms_named(tokens: &[String], depth: usize) -> BTreeSet<String> {
    let mut named = BTreeSet::new();
    for start in 0..tokens.len() {
        let mut i = start;
        match tokens[i].as_str() {
            "crate" => i += 1,
            "super" if start < 2 || tokens[start - 2] != "super" => {
                let mut ups = 0;
                while i + 1 < tokens.len() && tokens[i] == "super" {
                    (ups, i) = (ups + 1, i + if tokens[i + 1] == "::" { 2 } else { 1 });
                }
                if ups < depth {
                    continue;
                }
                i -= 1;
            }
            _ => continue,
        }
        if tokens.get(i).is_none_or(|t| t != "::") {
            continue;
        }
        match tokens.get(i + 1) {
            Some(open) if open == "{" => {
                let end = closing(tokens, i + 1);
                let (mut level, mut first) = (0, true);
                for token in &tokens[i + 1..end] {
                    match token.as_str() {
                        "{" => level += 1,
                        "}" => level -= 1,
                        "," if level == 1 => first = true,
                        name if level == 1 && first => {
                            named.insert(name.to_string());
                            first = false;
                        }
                        _ => {}
                    }
                }
            }
            Some(name) => {
                named.insert(name.clone());
            }
            None => {}
        }
    }
    named
}

/// Rooms below `room` that a file names.
fn upward_imports(source: &str, room: &str, depth: usize) -> Vec<String> {
    let place = |name: &str| ROOMS.iter().position(|r| *r == name);
    let (tokens, _) = without_tests(&tokens(source));
    rooms_named(&tokens, depth).into_iter().filter(|name| place(name) > place(room)).collect()
}

/// Foreign crates that a file names outside their adapters.
fn leaked_crates(source: &str, path: &str) -> Vec<&'static str> {
    let (tokens, _) = without_tests(&tokens(source));
    let names = |foreign: &str| {
        tokens.iter().enumerate().any(|(k, token)| {
            let own = k > 1 && tokens[k - 1] == "::" && tokens[k - 2].chars().all(|c| c.is_alphanumeric() || c == '_');
            let path = tokens.get(k + 1).is_some_and(|next| next == "::");
            token == foreign && !own && (path || (k > 0 && tokens[k - 1] == "use"))
        })
    };
    let at_home = |foreign: &str| ADAPTERS.iter().any(|(name, home)| *name == foreign && path.starts_with(home));
    let crates: BTreeSet<&'static str> = ADAPTERS.iter().map(|(foreign, _)| *foreign).collect();
    crates.into_iter().filter(|foreign| !at_home(foreign) && names(foreign)).collect()
}

fn rust_files(directory: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Every source file that is not a test: path from the crate's root, room, depth, text.
pub(super) fn sources() -> Vec<(String, String, usize, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    rust_files(&root.join("src"), &mut files);
    files.sort();
    let texts: Vec<_> = files.iter().map(|file| fs::read_to_string(file).unwrap()).collect();
    let mut tests = BTreeSet::new();
    for (file, text) in files.iter().zip(&texts) {
        let stem = file.file_stem().unwrap();
        let folder =
            if stem == "mod" || stem == "lib" { file.parent().unwrap().into() } else { file.with_extension("") };
        for module in without_tests(&tokens(text)).1 {
            tests.insert(folder.join(format!("{module}.rs")));
            tests.insert(folder.join(module).join("mod.rs"));
        }
    }
    let inside = |file: &Path| file.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
    files
        .iter()
        .zip(texts)
        .filter(|(file, _)| !tests.contains(*file))
        .map(|(file, text)| (inside(file), text))
        .filter(|(path, _)| path.matches('/').count() > 1)
        .map(|(path, text)| {
            let room = path.split('/').nth(1).unwrap().to_string();
            let depth = path.matches('/').count() - usize::from(path.ends_with("/mod.rs"));
            (path, room, depth, text)
        })
        .collect()
}

#[test]
fn nothing_imports_upwards() {
    let sources = sources();
    assert!(sources.len() > 20, "only {} files found", sources.len());
    let mut faults = Vec::new();
    for (path, room, depth, text) in &sources {
        assert!(ROOMS.contains(&room.as_str()), "{path}: unknown room");
        faults.extend(upward_imports(text, room, *depth).iter().map(|name| format!("{path} imports from {name}")));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn third_party_types_stay_in_their_adapters() {
    let mut faults = Vec::new();
    for (path, _, _, text) in sources() {
        faults.extend(leaked_crates(&text, &path).iter().map(|name| format!("{path} names {name}")));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn files_stay_small() {
    for (path, _, _, text) in sources() {
        assert!(text.lines().count() <= 500, "{path} has {} lines", text.lines().count());
    }
}

#[test]
fn the_search_finds_what_it_looks_for() {
    let up = |source: &str| upward_imports(source, "linalg", 2);
    assert_eq!(up("use crate::network::X;"), ["network"]);
    assert_eq!(up("use crate::{scalar::Real, network::{scalar, X}, cli};"), ["cli", "network"]);
    assert_eq!(up("fn f() { super::super::tape::record() }"), ["tape"]);
    assert_eq!(up("let c = '\"'; use crate::tape; let d = '\\'';"), ["tape"]);
    assert!(up("use super::tape; use crate::scalar::{Real}; use super::super::ops;").is_empty());
    assert!(up("// crate::tape\n/* crate::tape */ /// [`crate::tape`]\nconst A: &str = \"crate::tape\";").is_empty());
    assert!(up("const A: &str = r#\"\" crate::tape \"#; fn f<'a>(x: &'a str) {}").is_empty());
    assert!(up("#[cfg(test)]\nmod tests { use crate::tape::X; fn f() {} }").is_empty());
    assert_eq!(up("#[cfg(test)]\nmod tests { fn f() {} }\nuse crate::tape::X;"), ["tape"]);
    assert_eq!(without_tests(&tokens("#[cfg(test)]\nmod tests;\nmod other;")).1, ["tests"]);
    assert_eq!(leaked_crates("use faer::Mat;", "src/network/mod.rs"), ["faer"]);
    assert_eq!(leaked_crates("fn f() { ::argmin::core::f() }", "src/cli/mod.rs"), ["argmin"]);
    assert_eq!(leaked_crates("fn f() { argmin::core::f() }", "src/cli/mod.rs"), ["argmin"]);
    assert!(leaked_crates("use faer::Mat;", "src/linalg/large.rs").is_empty());
    assert!(leaked_crates("// faer::Mat\nuse crate::linalg::faer::X;", "src/network/mod.rs").is_empty());
}
