//! Several readers of one open file.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::{Arc, Mutex, PoisonError};

/// A reader of the first `size` bytes of a file with a position of its own; clones are further readers of the same file.
#[derive(Clone, Debug)]
pub struct Shared {
    file: Arc<Mutex<File>>,
    size: u64,
    position: u64,
}

impl Shared {
    /// A reader at the beginning.
    pub fn new(file: File, size: u64) -> Self {
        Self { file: Arc::new(Mutex::new(file)), size, position: 0 }
    }

    /// A further reader, at `position`.
    pub fn at(&self, position: u64) -> Self {
        Self { position, ..self.clone() }
    }
}

impl Read for Shared {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.size.saturating_sub(self.position);
        let most = buffer.len().min(usize::try_from(left).unwrap_or(usize::MAX));
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(self.position))?;
        let read = file.read(&mut buffer[..most])?;
        self.position += read as u64;
        Ok(read)
    }
}

impl Seek for Shared {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let position = match to {
            SeekFrom::Start(position) => Some(position),
            SeekFrom::End(offset) => self.size.checked_add_signed(offset),
            SeekFrom::Current(offset) => self.position.checked_add_signed(offset),
        };
        self.position = position.ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "seek before the start"))?;
        Ok(self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readers_do_not_disturb_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, b"0123456789").unwrap();
        let mut one = Shared::new(File::open(&path).unwrap(), 8);
        let mut two = one.at(4);
        let mut byte = [0; 2];
        for (reader, expected) in [(0, b"01"), (1, b"45"), (0, b"23"), (1, b"67")] {
            let reader = if reader == 0 { &mut one } else { &mut two };
            reader.read_exact(&mut byte).unwrap();
            assert_eq!(&byte, expected);
        }
        assert_eq!(two.read(&mut byte).unwrap(), 0);
        assert_eq!((one.seek(SeekFrom::End(-1)).unwrap(), one.seek(SeekFrom::Current(-9)).is_err()), (7, true));
    }
}
