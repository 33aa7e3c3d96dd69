//! A file system that fails on demand.

use lnn::storage::{Disk, Files, ReadError};
use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// How an operation fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// ENOSPC.
    Full,
    /// EIO.
    Device,
    /// EINTR.
    Interrupted,
    /// Half of the bytes are written; other operations succeed.
    Short,
    /// The program ends: this operation and all after it do nothing.
    Death,
}

impl Fault {
    pub const ALL: [Self; 5] = [Self::Full, Self::Device, Self::Interrupted, Self::Short, Self::Death];
}

/// The disk, with one operation or all from one on failing.
pub struct Faulty {
    fault: Fault,
    first: usize,
    persistent: bool,
    done: AtomicUsize,
}

impl Faulty {
    /// Fails operation `first`, counted from 1, and those after it if `persistent`.
    pub fn new(fault: Fault, first: usize, persistent: bool) -> Self {
        Self { fault, first, persistent: persistent || fault == Fault::Death, done: AtomicUsize::new(0) }
    }

    /// Operations asked for so far.
    pub fn operations(&self) -> usize {
        self.done.load(Ordering::SeqCst)
    }

    /// Whether the operation that was asked for now is to fail.
    fn fails(&self) -> bool {
        let number = self.done.fetch_add(1, Ordering::SeqCst) + 1;
        number == self.first || (self.persistent && number > self.first)
    }

    fn perform<T>(&self, operation: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
        match (self.fails(), self.fault) {
            (false, _) | (true, Fault::Short) => operation(),
            (true, Fault::Full) => Err(io::Error::from(io::ErrorKind::StorageFull)),
            (true, Fault::Interrupted) => Err(io::Error::from(io::ErrorKind::Interrupted)),
            (true, Fault::Device | Fault::Death) => Err(io::Error::other("input/output error")),
        }
    }
}

impl Files for Faulty {
    fn create(&self, path: &Path) -> io::Result<File> {
        self.perform(|| Disk.create(path))
    }
    fn write(&self, file: &mut File, bytes: &[u8]) -> io::Result<usize> {
        let fails = self.fails();
        match self.fault {
            _ if !fails => Disk.write(file, bytes),
            Fault::Short => Disk.write(file, &bytes[..bytes.len().div_ceil(2)]),
            Fault::Interrupted => Err(io::Error::from(io::ErrorKind::Interrupted)),
            // A full disk takes a part before it refuses the rest.
            Fault::Full => {
                Disk.write(file, &bytes[..bytes.len() / 3])?;
                Err(io::Error::from(io::ErrorKind::StorageFull))
            }
            Fault::Device | Fault::Death => Err(io::Error::other("input/output error")),
        }
    }
    fn sync(&self, file: &File) -> io::Result<()> {
        self.perform(|| Disk.sync(file))
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.perform(|| Disk.rename(from, to))
    }
    fn sync_directory(&self, directory: &Path) -> io::Result<()> {
        self.perform(|| Disk.sync_directory(directory))
    }
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, ReadError> {
        self.perform(|| Ok(()))?;
        Disk.read(path, limit)
    }
    fn remove(&self, path: &Path) -> io::Result<()> {
        self.perform(|| Disk.remove(path))
    }
}
