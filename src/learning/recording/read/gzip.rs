//! Text packed by gzip.

use super::archive::most_unpacked;
use flate2::read::MultiGzDecoder;
use std::io::{self, Read};

/// First bytes of such a file.
pub const MAGIC: &[u8] = b"\x1f\x8b";

/// Reader of packed data that limits the unpacked size to a hundred times the packed size.
pub struct Gzip<R> {
    decoder: MultiGzDecoder<R>,
    /// Number of bytes that may still be unpacked.
    left: u64,
}

impl<R: Read> Gzip<R> {
    /// Creates a reader for `size` packed bytes.
    pub fn new(input: R, size: u64) -> Self {
        Self { decoder: MultiGzDecoder::new(input), left: most_unpacked(size) }
    }
}

impl<R: Read> Read for Gzip<R> {
    /// Fills the buffer unless there are no more bytes.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut done = 0;
        while done < buffer.len() {
            let damaged = |error: io::Error| match error.kind() {
                io::ErrorKind::UnexpectedEof => io::Error::other("the gzip data are cut off"),
                io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => {
                    io::Error::other(format!("the gzip data are damaged: {error}"))
                }
                _ => error,
            };
            match self.decoder.read(&mut buffer[done..]).map_err(damaged)? {
                0 => break,
                now => done += now,
            }
        }
        self.left = self.left.checked_sub(done as u64).ok_or_else(|| {
            io::Error::other("the gzip data unpack to more than 100 times their size, which measured numbers never do")
        })?;
        Ok(done)
    }
}
