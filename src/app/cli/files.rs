//! Which path leads to which file, and files that must not be overwritten.

use crate::cli::CliError;
use std::fs;
use std::path::Path;

/// `true` if two paths lead to the same file: by links, by other spellings, by hard links.
pub fn same_file(a: &Path, b: &Path) -> bool {
    let (Ok(a), Ok(b)) = (fs::canonicalize(a), fs::canonicalize(b)) else { return false };
    a == b || same_node(&a, &b)
}

#[cfg(unix)]
fn same_node(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let node = |path: &Path| fs::metadata(path).ok().map(|data| (data.dev(), data.ino()));
    node(a).is_some() && node(a) == node(b)
}

#[cfg(not(unix))]
fn same_node(_: &Path, _: &Path) -> bool {
    false
}

/// `true` if there is a regular file with something in it, be it by a link.
pub fn holds_something(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|data| data.is_file() && data.len() > 0)
}

/// Refuses to write to a file that the command reads, and to one that holds something unless it may be replaced.
///
/// # Errors
/// A data error naming the file.
pub fn require_free(path: &Path, inputs: &[&Path], overwrite: bool) -> Result<(), CliError> {
    if let Some(input) = inputs.iter().find(|input| same_file(path, input)) {
        let same = if *path == **input { String::new() } else { format!(", which is {}", input.display()) };
        return Err(CliError::file(path, format_args!("this command reads it{same}: it is never overwritten")));
    }
    if !overwrite && holds_something(path) {
        return Err(CliError::file(path, "there is a file already; --overwrite replaces it"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn files_are_known_under_all_their_names() {
        let directory = tempfile::tempdir().unwrap();
        let path = |name: &str| directory.path().join(name);
        fs::write(path("a"), "x").unwrap();
        fs::write(path("b"), "x").unwrap();
        fs::create_dir(path("d")).unwrap();
        std::os::unix::fs::symlink(path("a"), path("link")).unwrap();
        std::os::unix::fs::symlink(directory.path(), path("d/up")).unwrap();
        fs::hard_link(path("a"), path("hard")).unwrap();
        for same in ["a", "./a", "d/../a", "link", "d/up/a", "d/up/link", "hard"] {
            assert!(same_file(&path("a"), &path(same)), "{same}");
            let refusal = require_free(&path(same), &[&path("a")], true).unwrap_err().to_string();
            assert!(refusal.contains("never overwritten"), "{refusal}");
        }
        for other in ["b", "c", "d"] {
            assert!(!same_file(&path("a"), &path(other)), "{other}");
        }
        assert!(require_free(&path("b"), &[&path("a")], false).unwrap_err().to_string().contains("--overwrite"));
        require_free(&path("b"), &[&path("a")], true).unwrap();
        // Nothing is lost with an empty file or a device.
        fs::write(path("c"), "").unwrap();
        for free in [path("c"), path("none"), "/dev/null".into()] {
            require_free(&free, &[&path("a")], false).unwrap();
        }
    }
}
