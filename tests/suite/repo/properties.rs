//! Every property has the settings of all, by which cases that failed are kept.

use std::fs;
use std::path::Path;

/// Files below a folder that hold properties, with the number of blocks and of those with the common settings.
fn blocks(folder: &Path, found: &mut Vec<(String, usize, usize)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            blocks(&path, found);
        } else if path.extension().is_some_and(|end| end == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            let code = || text.lines().map(str::trim_start).filter(|line| !line.starts_with("//"));
            let begun = code().filter(|line| line.ends_with("proptest! {")).count();
            let set =
                code().filter(|line| line.starts_with("#![proptest_config(") && line.contains("properties(")).count();
            if begun > 0 {
                found.push((path.display().to_string(), begun, set));
            }
        }
    }
}

#[test]
fn properties_keep_the_cases_that_failed() {
    let mut found = Vec::new();
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    ["crates", "src", "tests"].iter().for_each(|folder| blocks(&root.join(folder), &mut found));
    assert!(found.len() > 10, "{found:?}");
    found.retain(|(_, begun, set)| begun != set);
    assert!(found.is_empty(), "{found:?}");
    let ignored = fs::read_to_string(root.join(".gitignore")).unwrap();
    assert!(!ignored.contains("regressions"), "{ignored}");
}
