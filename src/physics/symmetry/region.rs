//! States drawn from a box.

use crate::random::RngStream;
use rand::Rng;

/// A box of states: `[low, high]` of every coordinate and velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Of the coordinates, `(n)`.
    pub position: Vec<[f64; 2]>,
    /// Of the velocities, `(n)`.
    pub velocity: Vec<[f64; 2]>,
}

/// Draws that are refused, for each that is taken, before it is given up.
const REFUSED: usize = 100;

impl Region {
    /// Coordinates and velocities `(states, n)`, uniform in the box, the same for the same seed.
    ///
    /// `accept` may change a velocity, such as the one that a mass shell fixes, and refuses a state by `false`; the result is
    /// shorter where it refuses nearly all.
    pub fn states(
        &self,
        states: usize,
        seed: u64,
        mut accept: impl FnMut(&[f64], &mut [f64]) -> bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let mut random = RngStream::Region.generator(seed);
        let mut draw = |bounds: &[[f64; 2]]| -> Vec<f64> {
            bounds.iter().map(|[low, high]| low + (high - low) * random.random::<f64>()).collect()
        };
        let (mut all, mut taken) = ((Vec::new(), Vec::new()), 0);
        for _ in 0..REFUSED * states {
            if taken == states {
                break;
            }
            let (q, mut v) = (draw(&self.position), draw(&self.velocity));
            if accept(&q, &mut v) && v.iter().all(|v| v.is_finite()) {
                all.0.extend(q);
                all.1.extend(v);
                taken += 1;
            }
        }
        all
    }
}

/// Part of every range of its training that a model is looked at: near the edges it is worst.
const INNER: f64 = 0.8;

/// The middle of a range.
pub(crate) fn middle([low, high]: [f64; 2]) -> [f64; 2] {
    let (middle, half) = (0.5 * (low + high), 0.5 * INNER * (high - low));
    [middle - half, middle + half]
}
