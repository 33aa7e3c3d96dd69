//! Elements of NumPy arrays.

use super::Problem;

/// Type of the elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Element {
    /// `f`, `i` or `u`.
    kind: u8,
    /// Bytes.
    size: usize,
    big_endian: bool,
}

impl Element {
    /// A type string such as `<f8`.
    pub fn parse(name: &str) -> Result<Self, Problem> {
        let expected = "expected floats of 4 or 8 bytes or integers of 1 to 8";
        let found = |what: &str| Problem::Array(format!("an array of {what} ({name}), {expected}"));
        let bytes = name.as_bytes();
        let (&[order, kind], Some(size)) = (bytes.get(..2).unwrap_or(&[0, 0]), name.get(2..)) else {
            return Err(found("unknown elements"));
        };
        match (kind, size.parse::<usize>()) {
            (b'f', Ok(size @ (4 | 8))) | (b'i' | b'u', Ok(size @ (1 | 2 | 4 | 8))) => {
                Ok(Self { kind, size, big_endian: order == b'>' })
            }
            (b'O', _) => Err(found("Python objects")),
            (b'c', _) => Err(found("complex numbers")),
            (b'S' | b'U', _) => Err(found("text")),
            (b'b', _) => Err(found("truth values")),
            _ => Err(found("other elements")),
        }
    }

    /// Bytes of an element.
    pub fn size(self) -> usize {
        self.size
    }

    /// The nearest `f64` of an element's bytes.
    pub fn decode(self, bytes: &[u8]) -> f64 {
        let mut word = [0; 8];
        for (k, byte) in bytes.iter().enumerate() {
            word[if self.big_endian { self.size - 1 - k } else { k }] = *byte;
        }
        let bits = u64::from_le_bytes(word);
        let unused = 64 - 8 * self.size as u32;
        match (self.kind, self.size) {
            (b'f', 4) => f64::from(f32::from_bits(bits as u32)),
            (b'f', _) => f64::from_bits(bits),
            (b'i', _) => ((bits << unused) as i64 >> unused) as f64,
            _ => bits as f64,
        }
    }
}
