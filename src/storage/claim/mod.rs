//! Claims of directories: of many processes, on machines that may share nothing but files, one at a time works in a directory.
//!
//! A claim is a file `.lnn.claim.K`, `K = 1, 2, ..`; the one with the highest number counts. Its claimant alone writes to it: at
//! every heartbeat, and to release it. Whoever finds the highest claim released, or silent for longer than its lease, creates the
//! file with the next number. Creation is atomic, so that of many takers one succeeds; and nothing that is alive is ever moved,
//! so that none takes a claim which another has just taken. A claimant that finds a higher number than its own has lost.
//!
//! Silence is the time between two times of modification, that of the claim and that of a file made now in the same directory:
//! both are told by the machine that holds the files, so that the clocks of claimants do not matter.

mod holder;

pub use holder::Holder;
use holder::State;

use crate::storage::lock_owner::{LockOwner, machine};
use crate::storage::read::{ReadError, read_regular};
use crate::storage::write::serial;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

/// Beginning of the name of a claim.
const NAME: &str = ".lnn.claim.";

/// Longest claim that is read, in bytes.
const MAX_BYTES: u64 = 1024;

/// Attempts to take a directory that others take and leave meanwhile.
const ATTEMPTS: usize = 20;

/// Who claims: this process, with the lease of its claims.
#[derive(Clone, Debug)]
pub struct Claimant {
    /// Mark that processes of this machine have in common, if that is known.
    machine: Option<String>,
    lease: Duration,
}

/// A claim that is ours until it is released, cleared or lost.
#[derive(Debug)]
pub struct Claim {
    directory: PathBuf,
    number: u64,
    head: String,
    beats: AtomicU64,
}

/// Result of an attempt to claim a directory.
#[derive(Debug)]
pub enum Taken {
    /// It is ours; taken over from a claimant that fell silent, if there is one.
    Ours(Claim, Option<Holder>),
    /// Another claimant holds it, or has it in hand right now.
    Held(Option<Holder>),
}

/// State of a directory.
#[derive(Debug)]
pub enum Standing {
    /// It can be claimed by this number; the highest claim is of a claimant that fell silent, if there is one.
    Free(u64, Option<Holder>),
    /// It is claimed, by a claimant whose words cannot be read if there is none.
    Held(Option<Holder>),
}

impl Claimant {
    /// This process; its claims may be taken over when they have been silent for `lease`.
    pub fn this(lease: Duration) -> Self {
        Self { machine: machine(), lease }
    }

    /// Time between two heartbeats: a sixth of the lease.
    pub fn beat(&self) -> Duration {
        self.lease / 6
    }

    /// Silence after which a claim may be taken over.
    pub fn lease(&self) -> Duration {
        self.lease
    }

    /// Claims a directory. `alone`: no other process of this machine works in it, which only a lock can tell; then a claim of
    /// this machine is that of a dead process.
    ///
    /// # Errors
    /// The file system's.
    pub fn take(&self, directory: &Path, alone: bool) -> io::Result<Taken> {
        let mut least = 0;
        for _ in 0..ATTEMPTS {
            let (number, before) = match self.standing(directory, alone, least)? {
                Standing::Held(holder) => return Ok(Taken::Held(holder)),
                Standing::Free(number, before) => (number, before),
            };
            let claim = Claim::new(directory, number, self);
            match OpenOptions::new().write(true).create_new(true).open(path(directory, number)) {
                Ok(mut file) => {
                    let written = file.write_all(claim.text(State::Held).as_bytes()).and_then(|()| file.sync_data());
                    match written.and_then(|()| claim.is_ours()) {
                        Ok(true) => return Ok(Taken::Ours(claim, before)),
                        // The list of names was an old one.
                        Ok(false) => ignore(fs::remove_file(path(directory, number))),
                        Err(error) => {
                            ignore(fs::remove_file(path(directory, number)));
                            return Err(error);
                        }
                    }
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
            least = number;
        }
        Ok(Taken::Held(None))
    }

    /// State of a directory, seen by this process; `alone` as for [`take`](Self::take). Claims below `least` are known to be
    /// old.
    ///
    /// # Errors
    /// The file system's.
    pub fn standing(&self, directory: &Path, alone: bool, least: u64) -> io::Result<Standing> {
        let mut newest = numbers(directory)?.into_iter().max().unwrap_or(0).max(least);
        // Lists of names may be old where files come over a network.
        while path(directory, newest + 1).exists() {
            newest += 1;
        }
        if newest == 0 {
            return Ok(Standing::Free(1, None));
        }
        let file = path(directory, newest);
        let (text, modified) = match read(&file) {
            Ok(found) => found,
            // Cleared meanwhile, by a claimant that has finished.
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Standing::Held(None)),
            Err(error) => return Err(error),
        };
        let silence = || silence(directory, modified);
        Ok(match Holder::parse(&text) {
            // Being written, or left by a process that was killed before it could write.
            None if silence() > self.lease => Standing::Free(newest + 1, None),
            None => Standing::Held(None),
            Some((_, State::Released)) => Standing::Free(newest + 1, None),
            Some((mut holder, State::Held)) => {
                holder.silent = silence();
                let dead = alone && self.machine.is_some() && holder.machine == self.machine;
                let free = dead || holder.silent > holder.lease;
                if free { Standing::Free(newest + 1, Some(holder)) } else { Standing::Held(Some(holder)) }
            }
        })
    }
}

impl Claim {
    fn new(directory: &Path, number: u64, claimant: &Claimant) -> Self {
        // Tells the claims of a process apart.
        let serial = serial();
        let machine = claimant.machine.as_deref().unwrap_or_default();
        let (owner, lease) = (LockOwner::this().text(), claimant.lease.as_secs_f64());
        let head = format!("{owner}machine {machine}\nserial {serial}\nlease {lease}\n");
        Self { directory: directory.to_path_buf(), number, head, beats: AtomicU64::new(0) }
    }

    /// Number of the claim: one more than that of claimants before.
    #[cfg(test)]
    pub fn number(&self) -> u64 {
        self.number
    }

    /// `true` unless another claimant has taken the directory over.
    ///
    /// # Errors
    /// The file system's.
    pub fn is_ours(&self) -> io::Result<bool> {
        let text = match read(&path(&self.directory, self.number)) {
            Ok((text, _)) => text,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(false),
            Err(error) => return Err(error),
        };
        Ok(text.starts_with(&self.head) && !path(&self.directory, self.number + 1).try_exists()?)
    }

    /// A heartbeat; `false` if another claimant has taken the directory over.
    ///
    /// # Errors
    /// The file system's.
    pub fn renew(&self) -> io::Result<bool> {
        self.beats.fetch_add(1, Ordering::Relaxed);
        self.write(State::Held)
    }

    /// Leaves the directory to the next claimant, who need not wait.
    pub fn release(&self) {
        // A claim that cannot be released falls silent.
        let _ = self.write(State::Released);
    }

    /// Removes this claim and those before it: there is nothing left to claim the directory for.
    pub fn clear(&self) {
        if !self.is_ours().unwrap_or(false) {
            return;
        }
        let mut old = numbers(&self.directory).unwrap_or_default();
        old.retain(|&number| number <= self.number);
        // Ours last: until then nobody takes an earlier number for the highest.
        old.sort_unstable();
        old.iter().for_each(|&number| ignore(fs::remove_file(path(&self.directory, number))));
    }

    /// Writes in place: whoever has it open, or lists the directory, sees the same file.
    fn write(&self, state: State) -> io::Result<bool> {
        if !self.is_ours()? {
            return Ok(false);
        }
        let mut file = match OpenOptions::new().write(true).open(path(&self.directory, self.number)) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(false),
            Err(error) => return Err(error),
        };
        file.write_all(self.text(state).as_bytes())?;
        file.sync_data()?;
        Ok(true)
    }

    /// The text of the claim, as long in every state.
    fn text(&self, state: State) -> String {
        format!("{}beats {:020}\n{}\n", self.head, self.beats.load(Ordering::Relaxed), state.word())
    }
}

/// Name of a claim with its directory.
fn path(directory: &Path, number: u64) -> PathBuf {
    directory.join(format!("{NAME}{number}"))
}

/// Numbers of the claims in a directory.
fn numbers(directory: &Path) -> io::Result<Vec<u64>> {
    let number = |entry: fs::DirEntry| entry.file_name().to_str()?.strip_prefix(NAME)?.parse().ok();
    let entries = fs::read_dir(directory)?.collect::<io::Result<Vec<_>>>()?;
    Ok(entries.into_iter().filter_map(number).collect())
}

/// The text of a claim and the time of its last heartbeat. Opening it asks the machine that holds the file.
fn read(path: &Path) -> io::Result<(String, SystemTime)> {
    let modified = File::open(path)?.metadata()?.modified()?;
    let bytes = read_regular(path, MAX_BYTES).map_err(|error| match error {
        ReadError::Io(error) => error,
        ReadError::Missing => ErrorKind::NotFound.into(),
        other => io::Error::new(ErrorKind::InvalidData, other.to_string()),
    })?;
    Ok((String::from_utf8_lossy(&bytes).into_owned(), modified))
}

/// Time since a modification, by the clock that it was told by. One in the future is of a clock that was set back: a claimant
/// that is alive has written since.
fn silence(directory: &Path, modified: SystemTime) -> Duration {
    let now = probe(directory).unwrap_or_else(|_| SystemTime::now());
    now.duration_since(modified).unwrap_or_else(|ahead| ahead.duration())
}

/// The time by the clock of the machine that holds the files: that of a file made now.
fn probe(directory: &Path) -> io::Result<SystemTime> {
    let number = serial();
    // Like other temporary files, so that one left behind is removed.
    let path = directory.join(format!(".lnn.clock.{}.{number}.tmp", std::process::id()));
    let modified = OpenOptions::new().write(true).create_new(true).open(&path).and_then(|mut file| {
        file.write_all(b"now\n").and_then(|()| file.sync_data())?;
        file.metadata()?.modified()
    });
    ignore(fs::remove_file(&path));
    modified
}

/// Leaves a failure aside: a file that cannot be removed does no harm.
fn ignore(_: io::Result<()>) {}

#[cfg(test)]
mod tests;
