//! The directory that a command writes into: the requested one, or the first free one of `NAME`, `NAME-2`, `NAME-3`, ..

use crate::CliError;
use crate::directories::folder::{Attempt, Folder};
use crate::directories::results::{Writer, found, require_no_input, require_room};
use crate::terminal::output;
use std::path::{Path, PathBuf};

/// A directory request.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// Requested directory, if there is one.
    pub out: Option<&'a Path>,
    /// Default directory.
    pub usual: &'a Path,
    /// `true` if existing results may be replaced.
    pub overwrite: bool,
    /// Files that the command reads.
    pub inputs: &'a [&'a Path],
    /// Kind of the command that writes.
    pub writer: Writer,
}

/// Opens the directory. Without `out` and `overwrite` it is the first one that contains no run and that no run is writing into.
///
/// # Errors
/// A data error for a directory that contains a run, that another run has locked, where an input would be overwritten, or that cannot be
/// written.
pub fn open(wanted: &Wanted<'_>) -> Result<Folder, CliError> {
    let Wanted { out, usual, overwrite, inputs, writer } = *wanted;
    if let (Some(path), _) | (None, (true, path)) = (out, (overwrite, usual)) {
        require_no_input(path, inputs)?;
        let folder = Folder::open(path)?;
        require_room(path, writer, overwrite)?;
        return Ok(folder);
    }
    let mut taken = None;
    for number in 1_u32.. {
        let path = if number == 1 { usual.to_path_buf() } else { numbered(usual, number) };
        if let Some(what) = found(&path) {
            taken = Some((path, what));
            continue;
        }
        require_no_input(&path, inputs)?;
        match Folder::attempt(&path)? {
            Attempt::Open(folder) => match found(&path) {
                None => {
                    if let Some((before, what)) = taken {
                        output::note(&format!(
                            "{}: there is {what}; writing into {}",
                            before.display(),
                            path.display()
                        ));
                    }
                    return Ok(folder);
                }
                Some(what) => taken = Some((path, what)),
            },
            Attempt::Held(holder) => taken = Some((path, format!("a run in progress{holder}"))),
        }
    }
    Err(CliError::file(usual, "there are no free numbers for another directory"))
}

/// Appends a number to a path, as in `NAME-2`.
fn numbered(path: &Path, number: u32) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!("-{number}"));
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lnn::pipeline::{MODEL, Output};

    #[test]
    fn the_first_free_directory_serves() {
        let directory = tempfile::tempdir().unwrap();
        let usual = directory.path().join("runs/arm");
        let wanted = Wanted { out: None, usual: &usual, overwrite: false, inputs: &[], writer: Writer::Learner };
        let first = open(&wanted).unwrap();
        // The first is locked, the second free; then both contain a model.
        let second = open(&wanted).unwrap();
        assert_eq!((first.path(), second.path()), (usual.as_path(), numbered(&usual, 2).as_path()));
        for folder in [first, second] {
            folder.write(MODEL, b"x").unwrap();
        }
        assert!(open(&wanted).unwrap().path().ends_with("runs/arm-3"));
        assert!(open(&Wanted { overwrite: true, ..wanted }).unwrap().path().ends_with("runs/arm"));
        let out = numbered(&usual, 2);
        let asked = Wanted { out: Some(&out), ..wanted };
        let refusal = open(&asked).unwrap_err().to_string();
        assert!(refusal.contains("arm-2: there is model.safetensors; --overwrite replaces it"), "{refusal}");
        assert!(open(&Wanted { overwrite: true, ..asked }).is_ok());
        let input = out.join("../arm-2").join(MODEL);
        let refusal = open(&Wanted { overwrite: true, inputs: &[&input], ..asked }).unwrap_err().to_string();
        assert!(refusal.contains("this command reads it"), "{refusal}");
        let evaluator = Wanted { overwrite: true, writer: Writer::Evaluator, ..asked };
        assert!(open(&evaluator).unwrap_err().to_string().contains("an evaluation would replace"));
    }
}
