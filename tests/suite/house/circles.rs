//! No circles: of two files none leads back to itself by its imports, inside a room either.
//!
//! A folder's front file (`mod.rs`) states the contract of its folder and puts its files together: what it imports from them does
//! not count, what they import from it does. A name that a file imports and others take from there counts as one of the file that has it.

use super::rooms::{closing, sources, tokens, without_tests};
use std::collections::{BTreeMap, BTreeSet};

/// Files that are one thing in several: a tape and the numbers that it records name each other, and so do a sweep over operations
/// and the operations that it goes through, affine arithmetic and its product of matrices.
const ONE_THING: [&[&str]; 4] = [
    &["certificate::affine", "certificate::number"],
    &["tape::eager", "tape::var"],
    &["tape::program::recorder", "tape::program::tracer"],
    &["tape::engine::compile", "tape::engine::evaluation", "tape::engine::operation"],
];

type Path = Vec<String>;

/// A path that a file names, and the name under which files below it may find it there.
struct Named {
    path: Path,
    exported: Option<String>,
}

/// Every leaf of a `use` tree between `start` and its end, as segments, with the name it gets.
fn leaves(tokens: &[String], prefix: &[String], found: &mut Vec<(Path, String)>) {
    let mut path = prefix.to_vec();
    let mut i = 0;
    while i < tokens.len() {
        match tokens[i].as_str() {
            "::" => {}
            "{" => {
                let end = closing(tokens, i);
                let (mut level, mut from) = (0, i + 1);
                for k in i..end {
                    match tokens[k].as_str() {
                        "{" => level += 1,
                        "}" => level -= 1,
                        _ => {}
                    }
                    if (tokens[k] == "," && level == 1) || (level == 0 && k > i) {
                        if from < k {
                            leaves(&tokens[from..k], &path, found);
                        }
                        from = k + 1;
                    }
                }
                return;
            }
            "as" => {
                let name = tokens.get(i + 1).cloned().unwrap_or_default();
                found.push((path, name));
                return;
            }
            "self" if !path.is_empty() => {}
            segment => path.push(segment.to_string()),
        }
        i += 1;
    }
    let name = path.last().cloned().unwrap_or_default();
    found.push((path, name));
}

/// A path from the root of the crate; `None` for one of another crate.
fn absolute(path: &[String], module: &[String], children: &BTreeSet<String>) -> Option<Path> {
    let first = path.first()?;
    if first == "crate" {
        return Some(path[1..].to_vec());
    }
    let ups = path.iter().take_while(|s| *s == "super").count();
    if ups > 0 {
        let from = module.len().checked_sub(ups)?;
        return Some([&module[..from], &path[ups..]].concat());
    }
    if first == "self" {
        return Some([module, &path[1..]].concat());
    }
    let below = [module, &path[..1]].concat().join("::");
    children.contains(&below).then(|| [module, path].concat())
}

/// What a file names, outside of its tests.
fn names_of(source: &str, module: &[String], files: &BTreeSet<String>) -> Vec<Named> {
    let (tokens, _) = without_tests(&tokens(source));
    let (mut named, mut i) = (Vec::new(), 0);
    while i < tokens.len() {
        if tokens[i] == "use" {
            let end = (i..tokens.len()).find(|k| tokens[*k] == ";").unwrap_or(tokens.len());
            let mut found = Vec::new();
            leaves(&tokens[i + 1..end], &[], &mut found);
            for (path, name) in found {
                if let Some(path) = absolute(&path, module, files) {
                    named.push(Named { path, exported: Some(name) });
                }
            }
            i = end;
        } else if (tokens[i] == "crate" || tokens[i] == "super") && tokens.get(i + 1).is_some_and(|next| next == "::") {
            let mut path = vec![tokens[i].clone()];
            while tokens.get(i + 1).is_some_and(|next| next == "::") && i + 2 < tokens.len() {
                path.push(tokens[i + 2].clone());
                i += 2;
            }
            named.extend(absolute(&path, module, files).map(|path| Named { path, exported: None }));
        }
        i += 1;
    }
    named
}

/// The file that has what a path names: the longest module of it, behind all re-exports.
fn file_of(path: &[String], exports: &BTreeMap<(String, String), Path>, files: &BTreeSet<String>) -> Option<String> {
    let mut path = path.to_vec();
    for _ in 0..8 {
        let mut module = String::new();
        let mut rest = path.len();
        for (k, segment) in path.iter().enumerate() {
            let longer = if module.is_empty() { segment.clone() } else { format!("{module}::{segment}") };
            if !files.contains(&longer) {
                rest = k;
                break;
            }
            module = longer;
        }
        let next = path.get(rest).and_then(|name| exports.get(&(module.clone(), name.clone())));
        match next {
            Some(target) if *target != path => path = [target.as_slice(), &path[rest + 1..]].concat(),
            _ => return (!module.is_empty()).then_some(module),
        }
    }
    None
}

/// Imports among files: modules by the modules they import from.
fn imports(sources: &[(Path, String)]) -> BTreeMap<String, BTreeSet<String>> {
    let files: BTreeSet<String> = sources.iter().map(|(module, _)| module.join("::")).collect();
    let all: Vec<(String, Vec<Named>)> =
        sources.iter().map(|(module, text)| (module.join("::"), names_of(text, module, &files))).collect();
    let exported = |module: &String, n: &Named| Some(((module.clone(), n.exported.clone()?), n.path.clone()));
    let exports: BTreeMap<(String, String), Path> =
        all.iter().flat_map(|(module, named)| named.iter().filter_map(move |n| exported(module, n))).collect();
    let mut graph: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (module, named) in &all {
        let found = named.iter().filter_map(|n| file_of(&n.path, &exports, &files));
        let other = found.filter(|file| file != module && !file.starts_with(&format!("{module}::")));
        graph.entry(module.clone()).or_default().extend(other);
    }
    graph
}

/// Files that lead back to themselves, with the next ones on the way.
fn circles(graph: &BTreeMap<String, BTreeSet<String>>) -> Vec<String> {
    let reached = |start: &String| {
        let (mut seen, mut ahead) = (BTreeSet::new(), vec![start]);
        while let Some(file) = ahead.pop() {
            ahead.extend(graph.get(file).into_iter().flatten().filter(|next| seen.insert((*next).clone())));
        }
        seen
    };
    let reached: BTreeMap<&String, BTreeSet<String>> = graph.keys().map(|file| (file, reached(file))).collect();
    let back = |file: &String, next: &String| reached.get(next).is_some_and(|seen| seen.contains(file));
    let one_thing = |a: &str, b: &str| {
        let within = |name: &str, part: &&str| name == *part || name.starts_with(&format!("{part}::"));
        ONE_THING.iter().any(|parts| [a, b].iter().all(|name| parts.iter().any(|part| within(name, part))))
    };
    let edges = graph.iter().flat_map(|(file, next)| next.iter().map(move |next| (file, next)));
    edges
        .filter(|(file, next)| back(file, next) && !one_thing(file, next))
        .map(|(file, next)| format!("{file} imports from {next}, which leads back"))
        .collect()
}

#[test]
fn no_file_leads_back_to_itself() {
    let sources: Vec<(Path, String)> = sources()
        .into_iter()
        .map(|(path, _, _, text)| {
            let module = path.trim_start_matches("src/").trim_end_matches(".rs").trim_end_matches("/mod");
            (module.split('/').map(String::from).collect(), text)
        })
        .collect();
    let graph = imports(&sources);
    assert!(graph.values().map(BTreeSet::len).sum::<usize>() > 500, "the graph is not read");
    let found = circles(&graph);
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn circles_are_found_behind_re_exports_and_fronts() {
    let of = |files: &[(&str, &str)]| {
        let split = |(module, text): &(&str, &str)| {
            (module.split("::").map(String::from).collect::<Path>(), (*text).to_string())
        };
        circles(&imports(&files.iter().map(split).collect::<Vec<_>>()))
    };
    let front = ("a", "mod b; mod c; pub use b::B; pub use c::C;");
    assert_eq!(of(&[front, ("a::b", "use crate::a::C;"), ("a::c", "use super::b::B;")]).len(), 2);
    assert_eq!(
        of(&[front, ("a::b", "fn f() { crate::a::C::new() }"), ("a::c", "use crate::a::{B as D, X};")]).len(),
        2
    );
    assert!(of(&[front, ("a::b", "use crate::a::Other;"), ("a::c", "use super::b::B;")]).is_empty());
    assert!(
        of(&[front, ("a::b", "#[cfg(test)]\nmod tests { use crate::a::C; }"), ("a::c", "use super::b::B;")]).is_empty()
    );
    assert_eq!(of(&[("a", ""), ("a::x", "use crate::b::Y;"), ("b", "use crate::a::x::X;")]).len(), 2);
}
