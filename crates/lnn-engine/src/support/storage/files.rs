//! Files that are written completely or not at all, through a few operations that tests can make fail.

use std::ffi::{OsStr, OsString};
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::{fs, io};

/// Operations of a file system. [`Disk`] is the real one; tests use a failing one instead.
pub trait Files: Send + Sync {
    /// Creates a file for writing; fails if it exists.
    ///
    /// # Errors
    /// The error of the system.
    fn create(&self, path: &Path) -> io::Result<File>;
    /// Writes some of the bytes and returns their number.
    ///
    /// # Errors
    /// The error of the system.
    fn write(&self, file: &mut File, bytes: &[u8]) -> io::Result<usize>;
    /// Waits until the content of the file is on the disk.
    ///
    /// # Errors
    /// The error of the system.
    fn sync(&self, file: &File) -> io::Result<()>;
    /// Renames a file, replacing any file of that name.
    ///
    /// # Errors
    /// The error of the system.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Waits until the names in a directory are on the disk.
    ///
    /// # Errors
    /// The error of the system.
    fn sync_directory(&self, directory: &Path) -> io::Result<()>;
    /// Reads a regular file of at most `limit` bytes.
    ///
    /// # Errors
    /// [`ReadError`].
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, ReadError>;
    /// Removes a file.
    ///
    /// # Errors
    /// The error of the system.
    fn remove(&self, path: &Path) -> io::Result<()>;
}

/// The real file system.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

impl Files for Disk {
    fn create(&self, path: &Path) -> io::Result<File> {
        OpenOptions::new().write(true).create_new(true).open(path)
    }
    fn write(&self, file: &mut File, bytes: &[u8]) -> io::Result<usize> {
        file.write(bytes)
    }
    fn sync(&self, file: &File) -> io::Result<()> {
        file.sync_all()
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(from, to)
    }
    fn sync_directory(&self, directory: &Path) -> io::Result<()> {
        match File::open(directory).and_then(|directory| directory.sync_all()) {
            // Some systems cannot open or synchronise a directory; there the rename must suffice.
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::PermissionDenied | io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported
                ) =>
            {
                Ok(())
            }
            result => result,
        }
    }
    fn read(&self, path: &Path, limit: u64) -> Result<Vec<u8>, ReadError> {
        read_regular(path, limit)
    }
    fn remove(&self, path: &Path) -> io::Result<()> {
        fs::remove_file(path)
    }
}

/// Number of retries after a signal interrupts an operation, before it counts as failed.
const INTERRUPTIONS: usize = 64;

/// Repeats an operation that a signal interrupted.
fn uninterrupted<T>(mut operation: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    for _ in 0..INTERRUPTIONS {
        match operation() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            result => return result,
        }
    }
    operation()
}

/// Writes all bytes, in several calls if necessary.
pub(super) fn write_all(files: &dyn Files, file: &mut File, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        match uninterrupted(|| files.write(file, bytes))? {
            0 => return Err(io::Error::new(io::ErrorKind::WriteZero, "the system takes no more bytes")),
            written => bytes = bytes.get(written..).unwrap_or_default(),
        }
    }
    Ok(())
}

/// The reason why a file could not be read.
#[derive(Debug)]
#[non_exhaustive]
pub enum ReadError {
    /// The file does not exist.
    Missing,
    /// The path is a directory, a pipe or a device.
    NotRegular(&'static str),
    /// The file exceeds the size limit.
    TooLarge {
        /// Size of the file.
        bytes: u64,
        /// Largest size.
        limit: u64,
    },
    /// The system reported an error.
    Io(io::Error),
}

impl std::fmt::Display for ReadError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Missing => f.write_str("no such file"),
            Self::NotRegular(found) => write!(f, "expected a regular file, found {found}"),
            Self::TooLarge { bytes, limit } => write!(f, "{bytes} bytes are more than the {limit} this reader takes"),
            Self::Io(error) => write!(f, "cannot read: {error}"),
        }
    }
}

impl std::error::Error for ReadError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Io(error) => Some(error),
            _ => None,
        }
    }
}

impl From<io::Error> for ReadError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// Opens a regular file of at most `limit` bytes; also returns its size.
///
/// Links are followed. Kind and size are checked before the file is opened, so that a pipe cannot block and a device cannot fill the
/// memory.
///
/// # Errors
/// [`ReadError`].
pub fn open_regular(path: &Path, limit: u64) -> Result<(File, u64), ReadError> {
    let data = match fs::metadata(path) {
        Ok(data) => data,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(ReadError::Missing),
        Err(error) => return Err(error.into()),
    };
    if data.is_dir() {
        return Err(ReadError::NotRegular("a directory"));
    }
    if !data.is_file() {
        return Err(ReadError::NotRegular("a pipe or device"));
    }
    if data.len() > limit {
        return Err(ReadError::TooLarge { bytes: data.len(), limit });
    }
    Ok((File::open(path)?, data.len()))
}

/// Reads a regular file of at most `limit` bytes, opened with [`open_regular`]; fails if the file grows beyond the limit while it is read.
///
/// # Errors
/// [`ReadError`].
pub fn read_regular(path: &Path, limit: u64) -> Result<Vec<u8>, ReadError> {
    let (file, _) = open_regular(path, limit)?;
    let mut bytes = Vec::new();
    let read = file.take(limit.saturating_add(1)).read_to_end(&mut bytes)? as u64;
    if read > limit { Err(ReadError::TooLarge { bytes: read, limit }) } else { Ok(bytes) }
}

/// Writes `bytes` to `path` so that a reader sees either the old or the new content, never a part of it.
///
/// The bytes are written to a temporary file in the same directory, synchronised to the disk, and given the final name by a rename, which
/// is synchronised with the directory. A link is followed; a target that is not a regular file (`/dev/stdout`, a pipe) is written in place.
/// On failure the temporary file is removed and the old content remains. Only if the synchronisation of the directory fails is the new
/// content in place, and a power failure could still undo the rename.
///
/// # Errors
/// The error of the file system; a directory as target is rejected.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_whole(&Disk, path, bytes)
}

/// Does the same as [`write_atomically`], but never replaces a file with content, not even one that another writer creates meanwhile.
///
/// # Errors
/// [`io::ErrorKind::AlreadyExists`] for a file with content; otherwise those of [`write_atomically`].
pub fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if fs::symlink_metadata(path).is_ok() {
        let full = fs::metadata(path).is_ok_and(|data| data.is_file() && data.len() > 0);
        return if full { Err(io::ErrorKind::AlreadyExists.into()) } else { write_atomically(path, bytes) };
    }
    let temporary = TemporaryFile::write(&Disk, path, bytes)?;
    match fs::hard_link(&temporary.path, path) {
        Ok(()) => uninterrupted(|| Disk.sync_directory(&temporary.directory)),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Err(error),
        // The file system does not support hard links.
        Err(_) => temporary.take_name(),
    }
}

/// Does the same as [`write_atomically`] with the file operations `files`.
///
/// # Errors
/// Those of [`write_atomically`].
pub fn write_whole(files: &dyn Files, path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = AtomicWriter::create(files, path)?;
    file.append(bytes)?;
    file.finish()
}

/// Writes a file piece by piece; readers see the old content until [`AtomicWriter::finish`], as with [`write_atomically`].
///
/// If it is dropped earlier, it leaves nothing behind, except for data already written in place to a pipe or device.
pub struct AtomicWriter<'a> {
    files: &'a dyn Files,
    file: File,
    /// The temporary file; `None` if the target is written in place.
    temporary: Option<TemporaryFile<'a>>,
    /// Buffer for the next write.
    buffer: Vec<u8>,
}

/// Size of the buffer in bytes.
const BUFFER: usize = 1 << 16;

impl<'a> AtomicWriter<'a> {
    /// Starts writing the file `path`.
    ///
    /// # Errors
    /// The error of the file system; a directory as target is rejected.
    pub fn create(files: &'a dyn Files, path: &Path) -> io::Result<Self> {
        let target = match fs::canonicalize(path) {
            Ok(existing) => existing,
            Err(error) if error.kind() == io::ErrorKind::NotFound => path.to_path_buf(),
            Err(error) => return Err(error),
        };
        let (temporary, file) = match fs::metadata(&target) {
            Ok(data) if data.is_dir() => return Err(io::Error::new(io::ErrorKind::IsADirectory, "is a directory")),
            Ok(data) if !data.is_file() => (None, OpenOptions::new().write(true).open(&target)?),
            _ => {
                let (temporary, file) = TemporaryFile::create(files, &target)?;
                (Some(temporary), file)
            }
        };
        Ok(Self { files, file, temporary, buffer: Vec::new() })
    }

    /// Appends bytes.
    ///
    /// # Errors
    /// The error of the file system, for example if the disk is full; nothing can be appended after it.
    pub fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.buffer.is_empty() && bytes.len() >= BUFFER {
            return write_all(self.files, &mut self.file, bytes);
        }
        self.buffer.extend_from_slice(bytes);
        if self.buffer.len() < BUFFER {
            return Ok(());
        }
        self.flush()
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// Those of [`write_atomically`].
    pub fn finish(mut self) -> io::Result<()> {
        self.flush()?;
        match self.temporary {
            None => Ok(()),
            Some(temporary) => {
                temporary.complete(&self.file)?;
                temporary.take_name()
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        let written = write_all(self.files, &mut self.file, &self.buffer);
        self.buffer.clear();
        written
    }
}

/// Checks whether [`write_atomically`] could write to `path`, before the content is computed.
///
/// A temporary file is created next to the target and removed again.
///
/// # Errors
/// Those of [`write_atomically`].
pub fn check_target(path: &Path) -> io::Result<()> {
    match fs::metadata(path) {
        Ok(data) if data.is_dir() => Err(io::Error::new(io::ErrorKind::IsADirectory, "is a directory")),
        Ok(data) if !data.is_file() => OpenOptions::new().write(true).open(path).map(drop),
        Ok(_) => TemporaryFile::create(&Disk, &fs::canonicalize(path)?).map(drop),
        Err(_) => TemporaryFile::create(&Disk, path).map(drop),
    }
}

/// Writes `bytes` to `newest` and keeps its old content in `previous` until the next call.
///
/// The new content is read back before anything is removed. If anything fails, or the program is killed at any time, `newest` or `previous`
/// contains the complete old or new content. Set `keep` to false if the content of `newest` is known to be damaged, so that it does not
/// replace `previous`.
///
/// # Errors
/// The error of the file system, or `InvalidData` if the bytes read back differ.
pub fn replace(files: &dyn Files, newest: &Path, previous: &Path, bytes: &[u8], keep: bool) -> io::Result<()> {
    let temporary = TemporaryFile::write(files, newest, bytes)?;
    temporary.verify(bytes)?;
    if keep && newest.exists() {
        uninterrupted(|| files.rename(newest, previous))?;
    }
    temporary.take_name()
}

/// A temporary file in the directory of its target; it is removed unless it is renamed to the target.
struct TemporaryFile<'a> {
    files: &'a dyn Files,
    target: PathBuf,
    directory: PathBuf,
    path: PathBuf,
    named: bool,
}

impl<'a> TemporaryFile<'a> {
    /// Creates an empty temporary file.
    fn create(files: &'a dyn Files, target: &Path) -> io::Result<(Self, File)> {
        let name = target.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "names no file"))?;
        let directory = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
            _ => PathBuf::from("."),
        };
        let path = directory.join(temporary_name(name));
        let file = uninterrupted(|| files.create(&path))?;
        Ok((Self { files, target: target.to_path_buf(), directory, path, named: false }, file))
    }

    /// Creates the temporary file with these bytes and synchronises it to the disk.
    fn write(files: &'a dyn Files, target: &Path, bytes: &[u8]) -> io::Result<Self> {
        let (temporary, mut file) = Self::create(files, target)?;
        write_all(files, &mut file, bytes)?;
        temporary.complete(&file)?;
        Ok(temporary)
    }

    /// Gives the file the permissions of an existing target, and synchronises it to the disk.
    fn complete(&self, file: &File) -> io::Result<()> {
        if let Ok(old) = fs::metadata(&self.target) {
            file.set_permissions(old.permissions())?;
        }
        uninterrupted(|| self.files.sync(file))
    }

    /// Reads the file back and compares it.
    fn verify(&self, bytes: &[u8]) -> io::Result<()> {
        let read = uninterrupted(|| {
            self.files.read(&self.path, bytes.len() as u64).map_err(|error| match error {
                super::ReadError::Io(error) => error,
                other => io::Error::new(io::ErrorKind::InvalidData, other.to_string()),
            })
        })?;
        if read == bytes {
            Ok(())
        } else {
            Err(io::Error::new(io::ErrorKind::InvalidData, "the bytes read back are not those written"))
        }
    }

    fn take_name(mut self) -> io::Result<()> {
        uninterrupted(|| self.files.rename(&self.path, &self.target))?;
        self.named = true;
        uninterrupted(|| self.files.sync_directory(&self.directory))
    }
}

impl Drop for TemporaryFile<'_> {
    fn drop(&mut self) {
        if !self.named {
            // The first error is reported; a failed removal is ignored.
            let _ = uninterrupted(|| self.files.remove(&self.path));
        }
    }
}

/// Suffix of the name of a temporary file.
const TEMPORARY: &str = ".tmp";

/// Returns a number that is unique in this process.
pub(in crate::support::storage) fn serial() -> usize {
    static COUNTER: AtomicUsize = AtomicUsize::new(0);
    COUNTER.fetch_add(1, Ordering::Relaxed)
}

/// Returns `.NAME.PROCESS.NUMBER.tmp`.
fn temporary_name(name: &OsStr) -> OsString {
    let number = serial();
    let mut temporary = OsString::from(".");
    temporary.push(name);
    temporary.push(format!(".{}.{number}{TEMPORARY}", std::process::id()));
    temporary
}

/// Removes the temporary files of killed writers from a directory.
///
/// Files of running processes are kept; if the system does not list running processes (in `/proc`), all are kept.
pub fn remove_leftovers(files: &dyn Files, directory: &Path) {
    let processes = Path::new("/proc");
    if !processes.join("self").exists() {
        return;
    }
    for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let dead = name.to_str().and_then(writer).is_some_and(|process| !processes.join(process.to_string()).exists());
        if dead {
            // A file that cannot be removed does no harm.
            let _ = files.remove(&entry.path());
        }
    }
}

/// Returns the number of the process that wrote a temporary file, from its name.
fn writer(name: &str) -> Option<u32> {
    let mut parts = name.strip_prefix('.')?.strip_suffix(TEMPORARY)?.rsplit('.');
    parts.next()?.parse::<usize>().ok()?;
    let process = parts.next()?.parse().ok()?;
    parts.next().map(|_| process)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::{Disk, ReadError, read_regular};

    fn entries(directory: &Path) -> usize {
        fs::read_dir(directory).unwrap().count()
    }

    #[test]
    fn writes_replaces_and_leaves_nothing_behind() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.csv");
        write_atomically(&path, b"one").unwrap();
        assert_eq!(read_regular(&path, 3).unwrap(), b"one");
        write_atomically(&path, b"two").unwrap();
        assert_eq!(read_regular(&path, 3).unwrap(), b"two");
        assert_eq!(entries(directory.path()), 1);
    }

    #[test]
    fn a_growing_file_is_seen_when_it_is_finished() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.csv");
        write_atomically(&path, b"old").unwrap();
        for finished in [false, true] {
            let mut file = AtomicWriter::create(&Disk, &path).unwrap();
            (0..30_000).for_each(|k| file.append(format!("{k:06}").as_bytes()).unwrap());
            file.append(&[b'x'; BUFFER]).unwrap();
            assert_eq!(read_regular(&path, 3).unwrap(), b"old");
            if finished {
                file.finish().unwrap();
            }
        }
        let content = fs::read(&path).unwrap();
        assert_eq!(content.len(), 180_000 + BUFFER);
        assert!((0..30_000).all(|k| content[6 * k..6 * k + 6] == *format!("{k:06}").as_bytes()));
        assert_eq!(entries(directory.path()), 1);
    }

    #[test]
    fn failures_keep_the_old_content() {
        let directory = tempfile::tempdir().unwrap();
        let write = |path: &Path| write_atomically(path, b"x");
        for attempt in [write, check_target] {
            assert_eq!(attempt(directory.path()).unwrap_err().kind(), io::ErrorKind::IsADirectory);
            assert!(attempt(&directory.path().join("missing/a.csv")).is_err());
            assert!(attempt(Path::new("")).is_err());
        }
        check_target(&directory.path().join("a.csv")).unwrap();
        assert_eq!(entries(directory.path()), 0);
    }

    #[test]
    fn the_previous_content_lives_on_unless_it_is_damaged() {
        let directory = tempfile::tempdir().unwrap();
        let (newest, previous) = (directory.path().join("a"), directory.path().join("b"));
        let put = |bytes: &[u8], keep| replace(&Disk, &newest, &previous, bytes, keep).unwrap();
        let both = || (read_regular(&newest, 9).unwrap(), read_regular(&previous, 9).ok());
        put(b"1", true);
        assert_eq!(both(), (b"1".to_vec(), None));
        put(b"2", true);
        assert_eq!(both(), (b"2".to_vec(), Some(b"1".to_vec())));
        put(b"3", false);
        assert_eq!(both(), (b"3".to_vec(), Some(b"1".to_vec())));
        assert_eq!(entries(directory.path()), 2);
    }

    #[test]
    fn only_temporary_files_of_dead_processes_are_removed() {
        let directory = tempfile::tempdir().unwrap();
        let name = |name: &str| directory.path().join(name);
        // No process has this number: it exceeds the largest that Linux assigns.
        let dead = name(".model.safetensors.4194999.0.tmp");
        let living = name(&format!(".a.{}.7.tmp", std::process::id()));
        let others = [living, name("a.4194999.0.tmp"), name(".4194999.0.tmp"), name(".a.b.0.tmp"), name("tmp")];
        for file in others.iter().chain([&dead]) {
            fs::write(file, b"x").unwrap();
        }
        remove_leftovers(&Disk, directory.path());
        assert!(others.iter().all(|file| file.exists()));
        assert_eq!(dead.exists(), !Path::new("/proc/self").exists());
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_stay_what_they_are() {
        let directory = tempfile::tempdir().unwrap();
        let (target, link) = (directory.path().join("real"), directory.path().join("link"));
        fs::write(&target, b"old").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        write_atomically(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().file_type().is_symlink());
        assert_eq!(fs::read(&target).unwrap(), b"new");
        write_atomically(Path::new("/dev/null"), b"gone").unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
        assert!(matches!(read_regular(Path::new("/dev/zero"), 9), Err(ReadError::NotRegular(_))));
    }

    #[test]
    fn reads_are_bounded() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a");
        fs::write(&path, b"four").unwrap();
        assert!(matches!(read_regular(&path, 3), Err(ReadError::TooLarge { bytes: 4, limit: 3 })));
        assert!(matches!(read_regular(directory.path(), 3), Err(ReadError::NotRegular("a directory"))));
        assert!(matches!(read_regular(&directory.path().join("b"), 3), Err(ReadError::Missing)));
    }
}
