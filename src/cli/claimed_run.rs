//! A directory that is ours for a time: locked, so that of the processes of a machine one works in it, and claimed, so that of
//! all machines one does.

use crate::cli::folder::{Folder, Locked};
use crate::cli::heartbeat::Heartbeat;
use crate::cli::{CliError, output};
use crate::pipeline::{Checkpoints, Directory, Output, PipelineError, RunOutput};
use crate::storage::{Claim, Claimant, Disk, Files, Holder, ReadError, Taken, remove_leftovers};
use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A directory that is ours.
///
/// Dropped, it is left to the next claimant; killed, the system frees its lock, and other machines wait for its lease to end.
#[derive(Debug)]
pub struct ClaimedRun {
    // In the order in which they go.
    heartbeat: Heartbeat,
    claim: Arc<Claim>,
    folder: Folder,
}

impl ClaimedRun {
    /// Takes a directory, created if need be; who holds it, in words, if another does. `interrupt` is the flag that ends all runs.
    ///
    /// # Errors
    /// A data error if it cannot be created or written.
    pub fn take(
        path: &Path,
        claimant: &Claimant,
        interrupt: &Arc<AtomicBool>,
    ) -> Result<Result<Self, String>, CliError> {
        let cannot = |e: io::Error| CliError::file(path, format_args!("cannot claim the directory: {e}"));
        let (folder, before) = match Folder::lock(path)? {
            Locked::Ours(folder, before) => (folder, before),
            Locked::Held(holder) => return Ok(Err(words(holder.as_ref()))),
        };
        let (claim, silent) = match claimant.take(path, true).map_err(cannot)? {
            Taken::Ours(claim, silent) => (Arc::new(claim), silent),
            Taken::Held(holder) => return Ok(Err(words(holder.as_ref()))),
        };
        // Not before: processes of other machines are not among those that run here.
        remove_leftovers(&Disk, path);
        let silent = silent.map(|holder: Holder| holder.owner);
        if let Some(owner) = silent.or(before) {
            output::note(&format!("{}: taken over from {owner}, which is gone", path.display()));
        }
        match Heartbeat::start(Arc::clone(&claim), claimant, interrupt) {
            Ok(heartbeat) => Ok(Ok(Self { heartbeat, claim, folder })),
            Err(error) => {
                claim.release();
                Err(cannot(error))
            }
        }
    }
}

/// Who holds a directory.
fn words(holder: Option<&impl std::fmt::Display>) -> String {
    holder.map_or_else(|| "another process".to_string(), ToString::to_string)
}

impl Output for ClaimedRun {
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), PipelineError> {
        let path = self.folder.file(name);
        guard(&self.claim).map_err(|e| PipelineError::output(&path, format_args!("cannot write: {e}")))?;
        self.folder.write(name, bytes)
    }
}

impl RunOutput for ClaimedRun {
    fn remove(&self, name: &str) -> Result<(), PipelineError> {
        let path = self.folder.file(name);
        guard(&self.claim).map_err(|e| PipelineError::output(&path, format_args!("cannot remove: {e}")))?;
        Directory::at(self.folder.path()).remove(name)
    }

    fn checkpoints(&self) -> Option<Checkpoints> {
        let files = Arc::new(Guarded { claim: Arc::clone(&self.claim) });
        Directory::at(self.folder.path()).checkpoints().map(|checkpoints| checkpoints.through(files))
    }

    fn interrupt(&self) -> Option<Arc<AtomicBool>> {
        Some(self.heartbeat.flag())
    }

    fn is_lost(&self) -> bool {
        self.heartbeat.is_lost() || !self.claim.is_ours().unwrap_or(true)
    }

    fn finish(&self) {
        self.heartbeat.stop();
        self.claim.clear();
    }
}

impl Drop for ClaimedRun {
    fn drop(&mut self) {
        self.heartbeat.stop();
        self.claim.release();
    }
}

/// Refuses what only the claimant may do.
fn guard(claim: &Claim) -> io::Result<()> {
    if claim.is_ours()? { Ok(()) } else { Err(io::Error::other("another process has taken the run over")) }
}

/// Files that only the claimant of their directory creates, names or removes.
struct Guarded {
    claim: Arc<Claim>,
}

impl Files for Guarded {
    fn create(&self, path: &Path) -> io::Result<File> {
        guard(&self.claim).and_then(|()| Disk.create(path))
    }
    fn write(&self, file: &mut File, bytes: &[u8]) -> io::Result<usize> {
        Disk.write(file, bytes)
    }
    fn sync(&self, file: &File) -> io::Result<()> {
        Disk.sync(file)
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        guard(&self.claim).and_then(|()| Disk.rename(from, to))
    }
    fn sync_directory(&self, directory: &Path) -> io::Result<()> {
        Disk.sync_directory(directory)
    }
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, ReadError> {
        Disk.read(path, limit)
    }
    fn remove(&self, path: &Path) -> io::Result<()> {
        guard(&self.claim).and_then(|()| Disk.remove(path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::time::Duration;

    #[test]
    fn a_run_is_one_claimants_until_another_takes_it_over() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("run");
        let claimant = Claimant::this(Duration::from_secs(60));
        let take = || ClaimedRun::take(&path, &claimant, &Arc::default()).unwrap();
        let first = take().unwrap();
        let holder = take().unwrap_err();
        assert!(holder.starts_with(&format!("process {} on ", std::process::id())), "{holder}");
        first.write("a", b"1").unwrap();
        drop(first);
        let second = take().unwrap();
        let checkpoint = path.join("checkpoint.safetensors");
        fs::write(&checkpoint, "x").unwrap();
        // Another machine, which found it silent.
        fs::write(path.join(".lnn.claim.3"), "").unwrap();
        let refusal = second.write("a", b"2").unwrap_err().to_string();
        assert!(refusal.contains("another process has taken the run over"), "{refusal}");
        assert!(second.is_lost() && second.remove("a").is_err());
        assert!(second.checkpoints().unwrap().remove().is_err() && checkpoint.exists());
        second.finish();
        drop(second);
        assert_eq!(fs::read(path.join("a")).unwrap(), b"1");
        // What was claimed by another machine is, whoever has the lock here.
        assert_eq!(take().unwrap_err(), "another process");
        assert!(path.join(".lnn.claim.2").exists());
        fs::remove_file(path.join(".lnn.claim.3")).unwrap();
        take().unwrap().finish();
        let mut left: Vec<_> = fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["a", "checkpoint.safetensors"]);
    }
}
