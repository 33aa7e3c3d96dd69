//! Sizes of the source that may shrink but not grow unseen: `tests/ratchets.txt`.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

const TABLE: &str = "tests/ratchets.txt";

/// Rust files below a folder, by their path there.
fn files(folder: &Path, root: &Path, found: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, root, found);
        } else if path.extension().is_some_and(|end| end == "rs") {
            let name = path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
            // A checkout may have its own ends of lines.
            found.push((name, fs::read_to_string(&path).unwrap().replace("\r\n", "\n")));
        }
    }
}

/// Lines of code: neither blank, nor comments, nor unit tests.
fn code(text: &str) -> Vec<&str> {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
    text.lines().filter(|line| !line.trim().is_empty() && !line.trim_start().starts_with("//")).collect()
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

/// What is counted.
fn counts() -> BTreeMap<String, usize> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut sources = Vec::new();
    files(&root, &root, &mut sources);
    sources.retain(|(name, _)| !name.ends_with("tests.rs"));
    let mut counts = BTreeMap::new();
    let mut folders: BTreeMap<&str, usize> = BTreeMap::new();
    let mut add = |name: String, count: usize| *counts.entry(name).or_insert(0) += count;
    for (name, text) in &sources {
        let lines = code(text);
        let floor = name.split_once('/').map_or("crate", |(floor, _)| floor);
        add(format!("lines of code, {floor}"), lines.len());
        add("lines of code".into(), lines.len());
        let hidden = lines.iter().filter(|line| line.contains("doc(hidden)")).count();
        add("hidden items and re-exports".into(), hidden);
        *folders.entry(name.rsplit_once('/').map_or("", |(folder, _)| folder)).or_default() += 1;
    }
    let sizes = sources.iter().map(|(_, text)| code(text));
    let (largest, function) = sizes.fold((0, 0), |most, lines| (most.0.max(lines.len()), most.1.max(longest(&lines))));
    counts.insert("lines of code of the largest file".into(), largest);
    counts.insert("lines of the longest function".into(), function);
    counts.insert("files of the fullest folder".into(), folders.into_values().max().unwrap_or(0));
    counts
}

/// A larger number in the table is a decision, whose reason stands in the message of its commit.
#[test]
fn nothing_grows_unseen() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(TABLE);
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
fn functions_and_code_are_counted() {
    let text = "// x\nfn one() {\n    a();\n}\n\nimpl B {\n    pub const fn two(\n        a: u8,\n    ) -> u8 {\n        a\n    }\n}\n#[cfg(test)]\nmod tests {\n}\n";
    let lines = code(text);
    assert_eq!((lines.len(), longest(&lines)), (10, 5));
}
