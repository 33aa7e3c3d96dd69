//! Coordinates of a metric: which is the time, which are the places.

use super::error::RelativityError;

/// Indices of the coordinates of a metric: a time, on which it does not depend, and Cartesian places around a centre at their origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chart {
    /// Index of the time.
    pub time: usize,
    /// Indices of `x`, `y`, `z`.
    pub space: [usize; 3],
}

impl Default for Chart {
    /// `t, x, y, z`.
    fn default() -> Self {
        Self { time: 0, space: [1, 2, 3] }
    }
}

impl Chart {
    /// Refuses a model of another number of coordinates, and indices that do not name each of them once.
    ///
    /// # Errors
    /// [`RelativityError::Coordinates`], [`RelativityError::Chart`].
    pub(super) fn check(&self, coordinates: usize) -> Result<(), RelativityError> {
        let Self { time, space } = *self;
        if coordinates != 4 {
            return Err(RelativityError::Coordinates { found: coordinates });
        }
        let mut named = [time, space[0], space[1], space[2]];
        named.sort_unstable();
        if named == [0, 1, 2, 3] { Ok(()) } else { Err(RelativityError::Chart { time, space }) }
    }

    /// The places of a vector `(4)`.
    pub(crate) fn space_of(&self, vector: [f64; 4]) -> [f64; 3] {
        self.space.map(|i| vector[i])
    }

    /// The vector of a time and places, `(4)`.
    pub(crate) fn vector(&self, time: f64, space: [f64; 3]) -> [f64; 4] {
        let mut vector = [0.0; 4];
        vector[self.time] = time;
        self.space.iter().zip(space).for_each(|(&i, x)| vector[i] = x);
        vector
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_named_once() {
        let chart = Chart { time: 2, space: [3, 0, 1] };
        assert_eq!(chart.vector(5.0, [1.0, 2.0, 3.0]), [2.0, 3.0, 5.0, 1.0]);
        assert_eq!(chart.space_of([2.0, 3.0, 5.0, 1.0]), [1.0, 2.0, 3.0]);
        assert_eq!(chart.check(4), Ok(()));
        assert_eq!(chart.check(3), Err(RelativityError::Coordinates { found: 3 }));
        for wrong in [Chart { time: 1, ..Chart::default() }, Chart { time: 4, ..Chart::default() }] {
            assert!(matches!(wrong.check(4), Err(RelativityError::Chart { .. })));
        }
    }
}
