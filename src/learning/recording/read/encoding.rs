//! Text in encodings other than UTF-8.

use serde::Serialize;
use std::borrow::Cow;
use std::io::{self, Read};

/// Encoding of a text file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub enum Encoding {
    /// UTF-8, which includes ASCII.
    #[default]
    #[serde(rename = "utf-8")]
    Utf8,
    /// UTF-16 after a byte order mark, as in Excel's "Unicode text".
    #[serde(rename = "utf-16")]
    Utf16,
    /// Windows-1252, which includes the printable part of Latin-1.
    #[serde(rename = "windows-1252")]
    Windows1252,
}

/// Byte order mark of UTF-8.
pub const MARK: &[u8] = b"\xef\xbb\xbf";

/// Characters of the bytes `0x80` to `0x9f` of Windows-1252; the five undefined bytes are unchanged.
const WINDOWS: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}', '\u{90}', '‘', '’',
    '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
];

/// Text of bytes in UTF-8 or, if they are invalid, in Windows-1252; none if it contains control characters.
pub fn decode(bytes: &[u8]) -> Option<(Cow<'_, str>, Encoding)> {
    if bytes.iter().any(|byte| byte.is_ascii_control() && !byte.is_ascii_whitespace()) {
        return None;
    }
    Some(match std::str::from_utf8(bytes) {
        Ok(text) => (text.into(), Encoding::Utf8),
        Err(_) => {
            let letter = |byte: &u8| match byte {
                0x80..=0x9f => WINDOWS[usize::from(byte - 0x80)],
                _ => char::from(*byte),
            };
            (bytes.iter().map(letter).collect::<String>().into(), Encoding::Windows1252)
        }
    })
}

/// `true` for the beginning of a text in UTF-16: its byte order mark, not followed by a zero character as in UTF-32.
pub fn is_utf16(start: &[u8]) -> bool {
    (start.starts_with(b"\xff\xfe") || start.starts_with(b"\xfe\xff")) && start.get(2..4) != Some(&[0, 0])
}

/// Reader of UTF-16 as UTF-8.
pub struct Utf16<R> {
    input: R,
    /// Byte order, once the byte order mark is read.
    big_endian: Option<bool>,
    /// First half of a surrogate pair.
    high: Option<u16>,
    /// Decoded bytes that have not been read yet.
    ready: Vec<u8>,
}

impl<R: Read> Utf16<R> {
    /// A reader positioned before the byte order mark.
    pub fn new(input: R) -> Self {
        Self { input, big_endian: None, high: None, ready: Vec::new() }
    }

    /// Decodes more bytes; the buffer remains empty at the end of the file.
    fn more(&mut self) -> io::Result<()> {
        let mut bytes = Vec::new();
        (&mut self.input).take(1 << 16).read_to_end(&mut bytes)?;
        let wrong = || {
            io::Error::new(
                io::ErrorKind::InvalidData,
                "the text begins with the mark of UTF-16 but is not valid UTF-16",
            )
        };
        let big = *self.big_endian.get_or_insert(bytes.starts_with(b"\xfe\xff"));
        if bytes.len() % 2 == 1 || (bytes.is_empty() && self.high.is_some()) {
            return Err(wrong());
        }
        let word = |pair: &[u8]| {
            let pair = [pair[0], pair[1]];
            if big { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) }
        };
        let words: Vec<u16> = self.high.take().into_iter().chain(bytes.chunks_exact(2).map(word)).collect();
        let whole = match words.split_last() {
            Some((last, rest)) if (0xd800..0xdc00).contains(last) => {
                self.high = Some(*last);
                rest
            }
            _ => &words,
        };
        let text: Result<String, _> = char::decode_utf16(whole.iter().copied()).collect();
        self.ready = text.map_err(|_| wrong())?.into_bytes();
        // The first half of a surrogate pair does not end the file.
        if self.ready.is_empty() && self.high.is_some() { self.more() } else { Ok(()) }
    }
}

impl<R: Read> Read for Utf16<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut done = 0;
        while done < buffer.len() {
            if self.ready.is_empty() {
                self.more()?;
                if self.ready.is_empty() {
                    break;
                }
            }
            let now = self.ready.len().min(buffer.len() - done);
            buffer[done..done + now].copy_from_slice(&self.ready[..now]);
            self.ready.drain(..now);
            done += now;
        }
        Ok(done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_windows_are_letters() {
        assert_eq!(decode(b"L\xe4nge \xb5 \xb0 \x80").unwrap(), ("Länge µ ° €".into(), Encoding::Windows1252));
        assert_eq!(decode("Länge".as_bytes()).unwrap(), ("Länge".into(), Encoding::Utf8));
        assert_eq!((decode(b"t\0x"), decode(b"\x01")), (None, None));
    }

    #[test]
    fn utf16_becomes_utf8() {
        // Surrogate pairs cross the ends of the blocks that are read.
        let text = format!("\u{feff}t;Länge\n{}", "0;𝄞\n".repeat(20_001));
        for big in [false, true] {
            let bytes: Vec<u8> =
                text.encode_utf16().flat_map(|w| if big { w.to_be_bytes() } else { w.to_le_bytes() }).collect();
            assert!(is_utf16(&bytes));
            let mut found = String::new();
            Utf16::new(bytes.as_slice()).read_to_string(&mut found).unwrap();
            assert_eq!(found, text);
            assert!(Utf16::new(&bytes[..bytes.len() - 1]).read_to_string(&mut String::new()).is_err());
        }
        assert!(Utf16::new(b"\xff\xfe\x00\xd8".as_slice()).read_to_string(&mut String::new()).is_err());
        assert!(!is_utf16(b"\xff\xfe\0\0"));
    }
}
