//! Random streams: one seed, independent draws for each purpose.
//!
//! ```
//! use lnn::random::RngStream;
//! use rand::Rng;
//!
//! let draw = |seed| -> f64 { RngStream::Weights.generator(seed).random() };
//! assert_eq!(draw(7), draw(7));
//! assert_ne!(draw(7), draw(8));
//! ```

use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Generator of random numbers of one [`RngStream`]: any function over [`rand::Rng`] takes it, its state can be stored.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(transparent))]
pub struct RandomGenerator(ChaCha8Rng);

impl RngCore for RandomGenerator {
    #[inline]
    fn next_u32(&mut self) -> u32 {
        self.0.next_u32()
    }
    #[inline]
    fn next_u64(&mut self) -> u64 {
        self.0.next_u64()
    }
    #[inline]
    fn fill_bytes(&mut self, bytes: &mut [u8]) {
        self.0.fill_bytes(bytes);
    }
}

/// Streams of the random generator: one seed, independent draws for each purpose.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum RngStream {
    /// Initial weights.
    Weights,
    /// Order of the data in a phase.
    Order(usize),
    /// Training states of a phase.
    Training(usize),
    /// Validation states.
    Validation,
    /// Test states.
    Test,
    /// Starts of the trajectory test.
    Trajectories,
    /// States at which a Lagrangian is examined.
    Region,
    /// Order of the segments of multiple shooting.
    Segments,
    /// Trajectories of a recording, or given states, that are held out.
    HeldOut,
    /// Copies of a recording with new noise.
    Copies,
}

impl RngStream {
    /// The generator of this purpose.
    pub fn generator(self, seed: u64) -> RandomGenerator {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(self.number());
        RandomGenerator(rng)
    }

    /// Number of the stream; every purpose uses a separate stream.
    fn number(self) -> u64 {
        match self {
            Self::Weights => 0,
            Self::Validation => 1,
            Self::Test => 2,
            Self::Trajectories => 3,
            Self::Region => 4,
            Self::Segments => 5,
            Self::HeldOut => 8,
            Self::Copies => 9,
            Self::Order(phase) => 16 + 2 * phase as u64,
            Self::Training(phase) => 17 + 2 * phase as u64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn no_two_purposes_share_a_stream() {
        let phased = (0..100).flat_map(|phase| [RngStream::Order(phase), RngStream::Training(phase)]);
        let single = [
            RngStream::Weights,
            RngStream::Validation,
            RngStream::Test,
            RngStream::Trajectories,
            RngStream::Region,
            RngStream::Segments,
            RngStream::HeldOut,
            RngStream::Copies,
        ];
        let streams: Vec<RngStream> = single.into_iter().chain(phased).collect();
        let first: BTreeSet<u64> = streams.iter().map(|stream| stream.generator(7).next_u64()).collect();
        assert_eq!(first.len(), streams.len());
    }
}
