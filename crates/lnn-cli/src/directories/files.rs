//! Identity of files, and the rule for writing them: never over an input, and over a file with content only with `--overwrite`.

use crate::CliError;
use crate::arguments::input::is_standard;
use crate::terminal::output;
use lnn::pipeline::parse_system;
use lnn::storage::{check_target, write_atomically, write_new};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// `true` if two paths refer to the same file, also through links or different spellings.
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

/// `true` if there is a regular file with content, possibly through a link.
pub fn holds_something(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|data| data.is_file() && data.len() > 0)
}

/// Rejects writing to an input of the command, or to a file with content unless it may be replaced.
///
/// # Errors
/// A data error naming the file.
pub fn require_free(path: &Path, inputs: &[&Path], overwrite: bool) -> Result<(), CliError> {
    if let Some(input) = inputs.iter().find(|input| same_file(path, input)) {
        let same = if *path == **input { String::new() } else { format!(", which is {}", input.display()) };
        return Err(CliError::file(path, format_args!("this command reads it{same} and never overwrites it")));
    }
    if !overwrite && holds_something(path) {
        return Err(CliError::file(path, "there is a file already; --overwrite replaces it"));
    }
    Ok(())
}

/// A file that a command will write at the end; it was checked in advance to be free and writable. `-` is standard output.
#[derive(Clone, Copy, Debug)]
pub struct OutputFile<'a> {
    path: &'a Path,
    overwrite: bool,
}

impl<'a> OutputFile<'a> {
    /// Claims a file after [`require_free`] has checked it.
    ///
    /// # Errors
    /// A data error naming the file.
    pub fn claim(path: &'a Path, inputs: &[&Path], overwrite: bool) -> Result<Self, CliError> {
        if !is_standard(path) {
            require_free(path, inputs, overwrite)?;
            check_target(path).map_err(|e| cannot_write(path, e))?;
        }
        Ok(Self { path, overwrite })
    }

    /// Like [`claim`](Self::claim), for a system file.
    ///
    /// # Errors
    /// A usage error for another name than `*.toml` or `-`.
    pub fn claim_system(path: &'a Path, inputs: &[&Path], overwrite: bool) -> Result<Self, CliError> {
        if !is_standard(path) && !ends_in(path, &["toml"]) {
            return Err(CliError::usage(format_args!("--out {}: expected a name that ends in .toml", path.display())));
        }
        Self::claim(path, inputs, overwrite)
    }

    /// Writes the file atomically; a file that another program created in the meantime is kept.
    ///
    /// # Errors
    /// A data error naming the file.
    pub fn write(&self, bytes: &[u8]) -> Result<(), CliError> {
        if is_standard(self.path) {
            return output::print_bytes(bytes);
        }
        let written = if self.overwrite { write_atomically(self.path, bytes) } else { write_new(self.path, bytes) };
        written.map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => {
                let problem = "another program wrote it meanwhile; --overwrite replaces it";
                CliError::file(self.path, format_args!("cannot write: {problem}"))
            }
            _ => cannot_write(self.path, error),
        })
    }

    /// Writes the text of a system file, if it describes a system; otherwise `refused` makes the error.
    ///
    /// # Errors
    /// Those of [`write`](Self::write), and the one that `refused` makes.
    pub fn write_system(&self, text: &str, refused: impl FnOnce(String) -> CliError) -> Result<(), CliError> {
        parse_system(text).map_err(|(_, problem)| refused(format!("--out: no system file: {problem}")))?;
        self.write(text.as_bytes())
    }

    /// Prints the command's remarks: on standard error if the file itself goes to standard output.
    ///
    /// # Errors
    /// Those of [`output::print`].
    pub fn print(this: Option<Self>, text: &str) -> Result<(), CliError> {
        if this.is_some_and(|out| is_standard(out.path)) {
            text.lines().filter(|line| !line.trim().is_empty()).for_each(output::note);
            return Ok(());
        }
        output::print(text)
    }
}

/// `true` if a file name has one of these extensions, ignoring case.
pub fn ends_in(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|end| extensions.iter().any(|known| end.eq_ignore_ascii_case(known)))
}

/// Creates a parser of file names with one of these extensions.
pub fn file_ending<const N: usize>(
    extensions: &'static [&'static str; N],
) -> impl Fn(&str) -> Result<PathBuf, String> + Clone + Send + Sync + 'static {
    move |text| {
        let path = PathBuf::from(text);
        let known = ends_in(&path, extensions);
        if known { Ok(path) } else { Err(format!("expected a file that ends in .{}", extensions.join(" or ."))) }
    }
}

/// Creates the error for a file that cannot be written.
pub fn cannot_write(path: &Path, error: io::Error) -> CliError {
    CliError::file(path, format_args!("cannot write: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_writers_the_second_finds_the_file_of_the_first() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a");
        let [first, second] = [(); 2].map(|()| OutputFile::claim(&path, &[], false).unwrap());
        first.write(b"1").unwrap();
        assert!(second.write(b"2").unwrap_err().to_string().contains("cannot write: another program"));
        assert!(OutputFile::claim(&path, &[], false).is_err());
        OutputFile::claim(&path, &[], true).unwrap().write(b"3").unwrap();
        assert_eq!((fs::read(&path).unwrap(), fs::read_dir(directory.path()).unwrap().count()), (b"3".to_vec(), 1));
    }

    #[test]
    fn files_are_known_by_their_extensions() {
        let picture = file_ending(&["svg", "html"]);
        assert!(picture("a.SVG").is_ok() && picture("a.html").is_ok());
        assert!(["a.png", "a", "svg"].iter().all(|bad| picture(bad).unwrap_err().ends_with(".svg or .html")));
    }

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
            assert!(refusal.contains("never overwrites"), "{refusal}");
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
