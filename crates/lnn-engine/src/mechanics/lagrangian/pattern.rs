//! The sparsity pattern of the second derivatives of a Lagrangian: which can be nonzero, and which are constant.

use crate::lagrangian::thresholds::PICTURE_ROWS;
use crate::linalg::components;
use crate::scalar::{Real, Scalar};
use crate::tape::{Directions, Program, ROWS, TANGENTS, Tracer};
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;
#[cfg(feature = "serde")]
use serde::Serialize;

/// What the recording shows about an element that is not always zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize), serde(rename_all = "lowercase"))]
pub enum Element {
    /// The same at all states.
    Constant,
    /// A function of the state.
    Varying,
}

/// The second derivatives of a Lagrangian that are not zero everywhere, according to its recording: row, column and kind.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize))]
pub struct Pattern {
    /// Number of coordinates `n`.
    pub coordinates: usize,
    /// Elements of `M = d2L/dv dv`, both triangles.
    pub mass_matrix: Vec<(usize, usize, Element)>,
    /// Elements of `d2L/dv dq`, with rows by velocities.
    pub mixed: Vec<(usize, usize, Element)>,
    /// Elements of `d2L/dq dq`, both triangles.
    pub stiffness: Vec<(usize, usize, Element)>,
}

impl Pattern {
    /// Finds the pattern of the Lagrangian with this value; returns `None` if it is too large.
    pub(crate) fn of<S: Scalar>(value: &Program<S>) -> Option<Self> {
        let n = value.inputs() / 2;
        let mut places = Vec::new();
        let program = Program::<S>::record_within(ROWS, (2 * n, value.parameters()), |x, p| {
            let directions = Directions {
                seeds: (0..2 * n).map(|input| vec![(input as u32, Tracer::one())]).collect(),
                rows: (0..2 * n).map(|input| Some(input as u32)).collect(),
                shared: u32::MAX,
                budget: TANGENTS,
            };
            let second = value.derivatives(x, p, Some(&directions))?.second;
            let mut outputs = Vec::new();
            for (row, elements) in second.into_iter().enumerate() {
                for (column, x) in elements {
                    places.push((row, column as usize));
                    outputs.push(x);
                }
            }
            Some(outputs)
        });
        let program = program.ok()?;
        let mut pattern = Self { coordinates: n, mass_matrix: Vec::new(), mixed: Vec::new(), stiffness: Vec::new() };
        for (k, (row, column)) in places.into_iter().enumerate() {
            let element = if program.is_uniform(k) { Element::Constant } else { Element::Varying };
            let (list, i, j) = match (row >= n, column >= n) {
                (true, true) => (&mut pattern.mass_matrix, row - n, column - n),
                (true, false) => {
                    pattern.mixed.push((row - n, column, element));
                    continue;
                }
                _ => (&mut pattern.stiffness, row, column),
            };
            list.push((i, j, element));
            if i != j {
                list.push((j, i, element));
            }
        }
        for list in [&mut pattern.mass_matrix, &mut pattern.mixed, &mut pattern.stiffness] {
            list.sort_unstable_by_key(|&(i, j, _)| (i, j));
        }
        Some(pattern)
    }

    /// Returns the groups of coordinates that are not coupled by any second derivative, each in increasing order.
    pub fn blocks(&self) -> Vec<Vec<usize>> {
        let joined = [&self.mass_matrix, &self.mixed, &self.stiffness].into_iter().flatten();
        components(self.coordinates, joined.map(|&(i, j, _)| (i, j)))
    }
}

/// Draws the three matrices: `#` is a varying element, `=` a constant one, `.` a zero.
impl fmt::Display for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let n = self.coordinates;
        let matrices =
            [("M = d2L/dv dv", &self.mass_matrix), ("d2L/dv dq", &self.mixed), ("d2L/dq dq", &self.stiffness)];
        let cell = n.div_ceil(PICTURE_ROWS).max(1);
        for (name, elements) in matrices {
            let constant = elements.iter().filter(|(.., element)| *element == Element::Constant).count();
            let (count, all) = (elements.len(), n * n);
            writeln!(f, "{name}: {count} of {all} elements are not zero, {constant} of them constant")?;
            let side = n.div_ceil(cell);
            let mut picture = vec![b'.'; side * side];
            for &(i, j, element) in elements {
                let sign = &mut picture[i / cell * side + j / cell];
                match element {
                    Element::Varying => *sign = b'#',
                    Element::Constant if *sign == b'.' => *sign = b'=',
                    Element::Constant => {}
                }
            }
            for row in picture.chunks(side.max(1)) {
                writeln!(f, "  {}", String::from_utf8_lossy(row))?;
            }
        }
        let blocks = self.blocks().len();
        writeln!(f, "{blocks} {} of coupled coordinates", if blocks == 1 { "group" } else { "groups" })?;
        if cell > 1 {
            writeln!(f, "a sign stands for {cell} rows and columns")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{EulerLagrange, Lagrangian, Mechanics};

    /// A line of coupled masses, the first of which has a metric, and a separate mass.
    struct Line;

    impl Lagrangian for Line {
        fn coordinates(&self) -> usize {
            4
        }
        fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
            let springs = q[..3].windows(2).fold(R::zero(), |sum, q| sum + (q[1] - q[0]).powi(4));
            p[0] * v[0].sqr() * (R::one() + q[0].sqr()) + v[1].sqr() + v[2].sqr() + p[0] * v[1] * v[2] - springs
                + v[3].sqr()
                + q[3].sqr() * p[0]
        }
    }

    #[test]
    fn zeros_and_constants_are_known_from_the_recording() {
        let pattern = Mechanics::<_, f64>::new(Line, [2.0]).pattern().unwrap();
        use Element::{Constant, Varying};
        assert_eq!(
            pattern.mass_matrix,
            [(0, 0, Varying), (1, 1, Constant), (1, 2, Constant), (2, 1, Constant), (2, 2, Constant), (3, 3, Constant)]
        );
        assert_eq!(pattern.mixed, [(0, 0, Varying)]);
        assert_eq!(pattern.stiffness.len(), 8);
        assert_eq!(pattern.stiffness[7], (3, 3, Constant));
        assert_eq!(pattern.blocks(), [vec![0, 1, 2], vec![3]]);
        let picture = pattern.to_string();
        assert!(picture.contains("  #...\n  .==.\n  .==.\n  ...=\n") && picture.contains("2 groups"), "{picture}");
    }
}
