//! Decisions and numbers out of bytes.

/// Bytes as an endless source: zeros after the last.
#[derive(Clone)]
pub struct Bytes<'a>(pub &'a [u8]);

impl Bytes<'_> {
    /// The next byte.
    pub fn byte(&mut self) -> u8 {
        let Some((&first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        first
    }
    /// A number below `count`.
    pub fn below(&mut self, count: usize) -> usize {
        usize::from(self.byte()) % count.max(1)
    }
    /// A yes or no.
    pub fn flag(&mut self) -> bool {
        self.byte() & 1 == 1
    }
    /// Sixteenths in `[-8, 8)`.
    pub fn small(&mut self) -> f64 {
        f64::from(self.byte() as i8) / 16.0
    }
    /// Any 64 bits as a number.
    pub fn any(&mut self) -> f64 {
        f64::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }
    /// Whether there are no more.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// Reproducible numbers (SplitMix64; Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// A number below `count`.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count.max(1) as u64) as usize
    }
    /// Between 1/2 and 1 in size, of either sign: sums of such do not cancel exactly.
    pub fn sign(&mut self) -> f64 {
        let bits = self.bits();
        let size = 0.5 + (bits >> 12) as f64 / 2f64.powi(53);
        if bits & 1 == 1 { size } else { -size }
    }
}
