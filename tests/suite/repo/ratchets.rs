//! Sizes of the source that may shrink but not grow unseen: `tests/ratchets.txt`.

use super::floors::sources;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

const TABLE: &str = "tests/ratchets.txt";

/// Lines of code that are not blank; comments and unit tests are none.
fn lines(code: &str) -> Vec<&str> {
    code.lines().filter(|line| !line.trim().is_empty()).collect()
}

/// Lines of the longest function: from its `fn` to the brace that stands below its first letter.
fn longest(lines: &[&str]) -> usize {
    let depth = |line: &str| line.len() - line.trim_start().len();
    let starts = |line: &str| {
        let line = line.trim_start();
        let words =
            line.split(' ').take_while(|word| ["pub", "const", "async", "fn"].iter().any(|w| word.starts_with(w)));
        words.clone().any(|word| word == "fn") && !line.ends_with(';')
    };
    let end = |at: usize| {
        let closed = |line: &&str| depth(line) == depth(lines[at]) && line.trim_start().starts_with('}');
        lines[at..].iter().position(closed).map_or(1, |end| end + 1)
    };
    (0..lines.len()).filter(|&at| starts(lines[at])).map(end).max().unwrap_or(0)
}

/// Lines of a command without its imports and its declared arguments.
fn own_lines(lines: &[&str]) -> usize {
    let mut rest = lines;
    let mut count = 0;
    while let [first, ..] = rest {
        let is_import = ["use ", "pub use ", "mod "].iter().any(|start| first.starts_with(start));
        let is_declared = first.starts_with("#[derive(") && first.contains("clap::");
        let end = match (is_import, is_declared) {
            (true, _) => rest.iter().position(|line| line.ends_with(';')),
            (_, true) => rest.iter().position(|line| line.starts_with('}')),
            _ => None,
        };
        count += usize::from(!is_import && !is_declared);
        rest = &rest[end.unwrap_or(0) + 1..];
    }
    count
}

/// `true` for a numeric constant, also of several numbers, of a module or within a function.
fn is_number(line: &str) -> bool {
    let line = line.trim_start();
    let line = line.strip_prefix("pub").map_or(line, |line| line.split_once(' ').map_or(line, |(_, line)| line));
    let value = line.strip_prefix("const ").and_then(|line| line.split_once(": ")).map_or("", |(_, value)| value);
    let kind = value.split_once(" =").map_or("", |(kind, _)| kind);
    let mut kinds = kind.split(['(', ')', '[', ']', ',', ';', ' ']).filter(|part| !part.is_empty());
    kinds.next().is_some_and(|kind| ["f64", "f32", "usize", "u64", "u32", "i64", "i32"].contains(&kind))
}

/// What is counted.
fn counts() -> BTreeMap<String, usize> {
    let sources = sources();
    let mut counts = BTreeMap::new();
    let mut folders: BTreeMap<&str, usize> = BTreeMap::new();
    let mut add = |name: String, count: usize| *counts.entry(name).or_insert(0) += count;
    for (name, code) in &sources {
        let lines = lines(code);
        let floor = name.split_once('/').map_or("crate", |(floor, _)| floor);
        add(format!("lines of code, {floor}"), lines.len());
        add("lines of code".into(), lines.len());
        let hidden = lines.iter().filter(|line| line.contains("doc(hidden)")).count();
        add("hidden items and re-exports".into(), hidden);
        *folders.entry(name.rsplit_once('/').map_or("", |(folder, _)| folder)).or_default() += 1;
    }
    let rooms: Vec<&str> = sources.iter().filter_map(|(name, _)| name.strip_suffix("thresholds.rs")).collect();
    let beside = |(name, _): &&(String, String)| {
        rooms.iter().any(|room| name.starts_with(room)) && !name.ends_with("/thresholds.rs")
    };
    let numbers = sources.iter().filter(beside).flat_map(|(_, code)| lines(code)).filter(|line| is_number(line));
    counts.insert("numbers that stand outside of their room's thresholds.rs".into(), numbers.count());
    let sizes = sources.iter().map(|(_, code)| lines(code));
    let (largest, function) = sizes.fold((0, 0), |most, lines| (most.0.max(lines.len()), most.1.max(longest(&lines))));
    counts.insert("lines of code of the largest file".into(), largest);
    counts.insert("lines of the longest function".into(), function);
    let commands = sources.iter().filter(|(name, _)| name.starts_with("cli/commands/"));
    let command = commands.map(|(_, code)| own_lines(&lines(code))).max().unwrap_or(0);
    counts.insert("lines of the longest command without its imports and declared arguments".into(), command);
    counts.insert("files of the fullest folder".into(), folders.into_values().max().unwrap_or(0));
    counts
}

/// A larger number in the table is a decision, whose reason stands in the message of its commit.
#[test]
fn nothing_grows_unseen() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join(TABLE);
    let counts = counts();
    if std::env::var_os("LNN_WRITE_RATCHETS").is_some() {
        let lines = counts.iter().map(|(name, count)| format!("{count:>6}  {name}\n"));
        fs::write(&path, lines.collect::<String>()).unwrap();
    }
    let table = fs::read_to_string(&path).unwrap();
    let allowed: BTreeMap<&str, usize> = table
        .lines()
        .map(|line| line.trim_start().split_once("  ").unwrap())
        .map(|(count, name)| (name, count.parse().unwrap()))
        .collect();
    println!("{table}");
    assert!(counts.keys().map(String::as_str).eq(allowed.keys().copied()), "{TABLE} counts other things");
    let grown: Vec<String> = counts
        .iter()
        .filter(|(name, count)| **count > allowed[name.as_str()])
        .map(|(name, count)| format!("{name}: {count}, at most {}", allowed[name.as_str()]))
        .collect();
    let write = "LNN_WRITE_RATCHETS=1 cargo test --test suite ratchets";
    assert!(grown.is_empty(), "{}\nshrink it, or write the table anew and say why: {write}", grown.join("\n"));
}

#[test]
fn numbers_are_recognized() {
    let numbers = [
        "const A: f64 = 3.0;",
        "pub(super) const B: usize = 4;",
        "pub const C: u64 = 1 << 20;",
        "    const RUN: usize = 16;",
        "const PAIR: (f64, usize) = (1.0, 2);",
        "const ROW: [f64; 2] = [1.0, 2.0];",
    ];
    assert!(numbers.into_iter().all(is_number));
    let others = ["const NAMES: [&str; 1] = [\"a\"];", "let x: f64 = 3.0;", "const D: Kind = of(1);"];
    assert!(!others.into_iter().any(is_number));
}

#[test]
fn imports_and_arguments_of_commands_are_left_out() {
    let text = "use a::{\n    b,\n};\nmod c;\n#[derive(Debug, clap::Args)]\npub struct Args {\n    d: u8,\n}\npub fn run() {\n    e();\n}\n";
    assert_eq!(own_lines(&lines(text)), 3);
    assert_eq!(own_lines(&lines("#[derive(Debug)]\nstruct F {\n    g: u8,\n}\n")), 4);
}

#[test]
fn functions_are_measured() {
    let text = "fn one() {\n    a();\n}\n\nimpl B {\n    pub const fn two(\n        a: u8,\n    ) -> u8 {\n        a\n    }\n}\n";
    let lines = lines(text);
    assert_eq!((lines.len(), longest(&lines)), (10, 5));
}
