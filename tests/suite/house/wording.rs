//! Words of documentation: a sentence begins with the noun it is about.

use super::rooms::ROOMS;
use std::fs;
use std::path::Path;

/// Lines of a folder's sources that begin a comment of documentation with a word that names nothing, and all such comments.
fn search(folder: &Path, found: &mut Vec<String>) -> usize {
    let mut comments = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            comments += search(&path, found);
            continue;
        }
        let source = fs::read_to_string(&path).unwrap();
        let mut before = false;
        for (k, line) in source.lines().map(str::trim_start).enumerate() {
            let text = ["/// ", "//! "].iter().find_map(|mark| line.strip_prefix(mark));
            comments += usize::from(text.is_some() && !before);
            let opens = |word: &str| text.is_some_and(|text| text.starts_with(word));
            if !before && ["What ", "How ", "Whether "].iter().any(|word| opens(word)) {
                found.push(format!("{}:{}: {line}", path.display(), k + 1));
            }
            before = text.is_some();
        }
    }
    comments
}

#[test]
fn documentation_begins_with_a_noun() {
    let (mut found, mut comments) = (Vec::new(), 0);
    for room in ROOMS {
        comments += search(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(room), &mut found);
    }
    assert!(comments > 1500, "only {comments} comments found");
    assert!(found.is_empty(), "{}", found.join("\n"));
}
