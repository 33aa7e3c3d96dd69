//! Detects branches of constraints along a motion: where a row vanishes or becomes dependent on the others, a second branch begins, and the
//! equations do not determine which one the motion follows.

use super::StepFailure;
use super::dense::cubic;
use super::thresholds::{
    BRANCH, BRANCH_PLACES, BRANCH_TRISECTIONS, EXACT_HALVINGS, ROUGH_HALVINGS, ROW_PARTS, SUSPICIOUS_COSINE,
    SUSPICIOUS_SINGULAR_VALUE,
};
use crate::lagrangian::{Manifold, ManifoldRows, dot};
use crate::linalg::{Workspace, eigh};
use crate::scalar::{Real, Scalar, are_finite};
use crate::tape::Replay;

/// Data about the constraint rows up to the last step.
pub(super) struct Regularity<'a, S> {
    manifold: &'a dyn Manifold<S>,
    /// 1, or -1 for a motion backwards in time.
    direction: S,
    /// Largest length of every row so far, and the largest value so far of the smallest singular value of the rows in these units.
    sizes: Vec<S>,
    largest: S,
    /// State and rows at the end of the last step.
    q: Vec<S>,
    v: Vec<S>,
    matrix: Vec<S>,
    /// Offsets of the rows in the matrix, with the total number last.
    starts: Vec<usize>,
    rows: ManifoldRows<S>,
    /// Sparse programs of the rows; the matrix then contains only the nonzero elements.
    sparse: Option<Sparse<S>>,
}

/// Programs of rows, and buffers.
struct Sparse<S> {
    elements: Replay<S>,
    shifted: Replay<S>,
    pivots: Vec<S>,
}

impl<'a, S: Scalar> Regularity<'a, S> {
    /// Creates the data at the start of a motion.
    pub fn new(manifold: &'a dyn Manifold<S>, (q, v): (&[S], &[S]), backwards: bool) -> Self {
        let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
        let m = manifold.names().len();
        let programs = manifold
            .programs()
            .filter(|_| m > 0)
            .and_then(|programs| Some((programs.elements()?, programs.shifted()?)));
        let (sparse, starts) = match programs {
            Some(((elements, starts), shifted)) => {
                (Some(Sparse { elements, shifted, pivots: vec![zero; m] }), starts.to_vec())
            }
            None => (None, (0..=m).map(|row| row * q.len()).collect()),
        };
        let mut known = Self {
            manifold,
            direction: if backwards { -one } else { one },
            sizes: vec![zero; m],
            largest: zero,
            q: q.to_vec(),
            v: v.to_vec(),
            matrix: Vec::new(),
            starts,
            rows: ManifoldRows::default(),
            sparse,
        };
        known.matrix = known.matrix_at(q);
        known.grow();
        known.largest = known.least(q);
        known
    }

    /// Returns all elements of the rows, or only the nonzero ones.
    fn matrix_at(&mut self, q: &[S]) -> Vec<S> {
        if let Some(sparse) = &mut self.sparse {
            let mut matrix = vec![S::nan(); self.starts.last().copied().unwrap_or(0)];
            // Fields of the right sizes cannot fail.
            let _ = sparse.elements.evaluate(1, &[q, &self.v], &[], &mut [&mut matrix]);
            return matrix;
        }
        self.manifold.rows(q, &self.v, &mut self.rows);
        self.rows.matrix.clone()
    }

    fn grow(&mut self) {
        for (size, at) in self.sizes.iter_mut().zip(self.starts.windows(2)) {
            let row = &self.matrix[at[0]..at[1]];
            *size = S::max(*size, Real::sqrt(dot(row, row)));
        }
    }

    /// Returns the reciprocals of the sizes.
    fn units(&self) -> Vec<S> {
        let zero = <S as Real>::zero();
        self.sizes.iter().map(|&size| if size > zero { size.recip() } else { zero }).collect()
    }

    /// Returns `true` if the smallest singular value of the scaled rows exceeds a positive number, using the sparse programs.
    fn is_above(&mut self, value: S, q: &[S]) -> bool {
        let units = self.units();
        let Some(Sparse { shifted, pivots, .. }) = &mut self.sparse else { return false };
        let inputs = [q, &self.v, &units, &[value * value]];
        let done = shifted.evaluate(1, &inputs, &[], &mut [&mut pivots[..]]);
        done.is_ok() && pivots.iter().all(|&pivot| pivot > <S as Real>::zero())
    }

    /// Determines the smallest singular value of the scaled rows by bisection with this many halvings, if it exceeds a number; `NaN` for
    /// rows that are not finite.
    fn halved(&mut self, (above, halvings): (S, usize), q: &[S]) -> S {
        let matrix = self.matrix_at(q);
        let rows = self.starts.windows(2).map(|at| &matrix[at[0]..at[1]]).zip(self.units());
        // The smallest singular value is at most the length of any row.
        let shortest = rows.fold(S::infinity(), |least, (row, unit)| {
            let size = Real::sqrt(dot(row, row)) * unit;
            if size < least || size.is_nan() { size } else { least }
        });
        if !shortest.is_finite() {
            return S::nan();
        }
        let (mut low, mut high) = (above, shortest);
        for _ in 0..halvings {
            let middle = (low + high) * S::half();
            if self.is_above(middle, q) { low = middle } else { high = middle }
        }
        low
    }

    /// Computes the smallest singular value of the scaled rows.
    fn least(&mut self, q: &[S]) -> S {
        match self.sparse {
            Some(_) => self.halved((<S as Real>::zero(), EXACT_HALVINGS), q),
            None => self.least_direction(q).0,
        }
    }

    /// Computes the smallest singular value of the scaled rows, and the index of the row with the largest component in its singular vector.
    fn least_direction(&mut self, q: &[S]) -> (S, usize) {
        self.manifold.rows(q, &self.v, &mut self.rows);
        let (n, m, zero) = (self.q.len(), self.sizes.len(), <S as Real>::zero());
        let (matrix, units) = (&self.rows.matrix, self.units());
        let row = |i: usize| &matrix[i * n..(i + 1) * n];
        let gram: Vec<S> = (0..m * m).map(|at| dot(row(at / m), row(at % m)) * units[at / m] * units[at % m]).collect();
        let (mut squares, mut directions) = (vec![zero; m], vec![zero; m * m]);
        if eigh(m, &gram, &mut squares, &mut directions, &mut Workspace::new()).is_err() {
            return (S::nan(), 0);
        }
        let most = (0..m).fold(0, |most, i| if directions[i].abs() > directions[most].abs() { i } else { most });
        (Real::sqrt(S::max(squares.first().copied().unwrap_or(zero), zero)), most)
    }

    /// Checks a step of length `h`, given the state at its end.
    ///
    /// # Errors
    /// [`StepFailure::Branch`] if the rows become dependent within the step.
    pub fn step(&mut self, h: S, q: &[S], v: &[S]) -> Result<(), StepFailure> {
        let matrix = self.matrix_at(q);
        let starts = self.starts.clone();
        let turns = |before: &[S], after: &[S]| {
            let mut rows = starts.windows(2).map(|at| (&before[at[0]..at[1]], &after[at[0]..at[1]]));
            rows.any(|(a, b)| dot(a, b) < S::of_f64(SUSPICIOUS_COSINE) * Real::sqrt(dot(a, a) * dot(b, b)))
        };
        let mut last = self.matrix.clone();
        let mut turned = false;
        for k in 1..ROW_PARTS {
            let place = self.place(k as f64 / ROW_PARTS as f64, h, q, v);
            let next = self.matrix_at(&place);
            turned |= turns(&last, &next);
            last = next;
        }
        turned |= turns(&last, &matrix);
        let floor = S::of_f64(SUSPICIOUS_SINGULAR_VALUE) * self.largest;
        // With sparse programs, it is sufficient to compare the singular value with bounds.
        let (is_low, value) = if self.sparse.is_none() {
            let value = self.least(q);
            (value < floor, value)
        } else if self.is_above(self.largest, q) {
            (false, self.halved((self.largest, ROUGH_HALVINGS), q))
        } else {
            (are_finite(&matrix) && !self.is_above(floor, q), self.largest)
        };
        if turned || is_low {
            self.search_step(h, q, v)?;
        }
        self.matrix = matrix;
        self.grow();
        self.largest = S::max(self.largest, value);
        self.q.copy_from_slice(q);
        self.v.copy_from_slice(v);
        Ok(())
    }

    /// Returns the coordinates at the fraction `x` of a step of length `h` that ends at `(q, v)`, by Hermite interpolation.
    fn place(&self, x: f64, h: S, q: &[S], v: &[S]) -> Vec<S> {
        let at = |i: usize| cubic(S::of_f64(x), h * self.direction, [self.q[i], self.v[i], q[i], v[i]]);
        (0..q.len()).map(at).collect()
    }

    /// Minimizes the smallest singular value within a step.
    fn search_step(&mut self, h: S, q: &[S], v: &[S]) -> Result<(), StepFailure> {
        let signed = h * self.direction;
        let mut at = |x: f64| {
            let place = self.place(x, h, q, v);
            self.least(&place)
        };
        let width = 1.0 / BRANCH_PLACES as f64;
        let values: Vec<S> = (0..=BRANCH_PLACES).map(|k| at(k as f64 * width)).collect();
        let lowest = (0..=BRANCH_PLACES).fold(0, |low, k| if values[k] < values[low] { k } else { low }) as f64 * width;
        let (mut low, mut high) = ((lowest - width).max(0.0), (lowest + width).min(1.0));
        for _ in 0..BRANCH_TRISECTIONS {
            let third = (high - low) / 3.0;
            if at(low + third) < at(high - third) { high -= third } else { low += third }
        }
        let share = 0.5 * (low + high);
        if at(share) < S::of_f64(BRANCH) * self.largest {
            let place = self.place(share, h, q, v);
            let (_, constraint) = self.least_direction(&place);
            return Err(StepFailure::Branch { constraint, ahead: share * signed.to_f64() });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{EulerLagrange, SystemInstance};

    #[test]
    fn the_smallest_singular_value_by_the_pattern_is_that_of_all_elements() {
        for name in ["cartesian-chain-1", "cartesian-chain-9", "rolling-disk", "four-bar-linkage"] {
            let model: Box<dyn EulerLagrange<f64>> = SystemInstance::named(name, &[]).unwrap().build().unwrap();
            let number = |k: usize| (0.37 * k as f64 + 0.3).sin();
            let q: Vec<f64> = (0..model.coordinates()).map(number).collect();
            let mut known = Regularity::new(model.manifold().unwrap(), (&q, &q), false);
            assert!(known.sparse.is_some());
            let moved: Vec<f64> = q.iter().map(|q| q * q + 0.1).collect();
            for q in [&q, &moved] {
                let (exact, _) = known.least_direction(q);
                assert!((known.least(q) - exact).abs() < 1e-7, "{name}: {exact}");
                assert!(known.is_above(0.99 * exact, q) && !known.is_above(1.01 * exact, q), "{name}: {exact}");
                let near = known.halved((0.5 * exact, ROUGH_HALVINGS), q);
                assert!(near <= exact && near > 0.999 * exact, "{name}: {near} {exact}");
            }
            assert!(known.least(&vec![f64::NAN; q.len()]).is_nan());
        }
    }

    #[test]
    fn a_short_step_is_regular_and_one_through_a_branch_is_not() {
        // When the four bars are in a line, the linkage can continue in two ways.
        let model: Box<dyn EulerLagrange<f64>> = SystemInstance::named(
            "four-bar-linkage",
            &[("b".to_string(), "3".to_string()), ("c".to_string(), "1".to_string())],
        )
        .unwrap()
        .build()
        .unwrap();
        let at = |angle: f64| [angle.cos(), angle.sin(), 3.0 + angle.cos(), angle.sin()];
        let speed = |angle: f64| [-angle.sin(), angle.cos(), -angle.sin(), angle.cos()];
        let start = (&at(-0.5)[..], &speed(-0.5)[..]);
        let mut known = Regularity::new(model.manifold().unwrap(), start, false);
        assert!(known.sparse.is_some() && known.step(0.1, &at(-0.4), &speed(-0.4)).is_ok());
        let through = known.step(0.42, &at(0.02), &speed(0.02));
        let Err(StepFailure::Branch { ahead, .. }) = through else { panic!("{through:?}") };
        assert!((ahead - 0.4).abs() < 1e-3, "{ahead}");
    }
}
