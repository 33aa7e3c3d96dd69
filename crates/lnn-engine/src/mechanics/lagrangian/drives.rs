//! Computes the forces of drives on some coordinates that produce given accelerations of constrained motion.

use super::constraints::{along_rows, complement, independent_rows};
use super::{Manifold, MechanicsError, dot};
use crate::lagrangian::thresholds::LEAST_DRIVE_MOTION;
use crate::linalg::{Workspace, eigh};
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// Rejects drives, given by the indices of their coordinates, if there are fewer than degrees of freedom.
///
/// # Errors
/// [`MechanicsError::Drives`].
pub(super) fn require<S: Scalar>(
    n: usize,
    manifold: Option<&dyn Manifold<S>>,
    drives: &[usize],
) -> Result<(), MechanicsError> {
    let expected = n - manifold.map_or(0, |manifold| manifold.names().len());
    let distinct = (0..n).filter(|i| drives.contains(i)).count();
    if distinct < expected || drives.len() != distinct {
        return Err(MechanicsError::Drives { expected, found: distinct });
    }
    Ok(())
}

/// Computes the smallest force `(n)` on the driven coordinates that has the same effect as `force` on motion with the constraint rows `A`,
/// `(m, n)`: `Z' B u = Z' f` with a basis `Z` of the null space of `A`. Returns `None` if some allowed motion does not move the drives.
pub(super) fn driven<S: Scalar>(drives: &[usize], rows: &[S], force: &[S]) -> Option<Vec<S>> {
    let (n, count) = (force.len(), drives.len());
    let free = complement(n, &independent_rows(n, rows).1);
    let moved: Vec<S> = free.chunks_exact(n).flat_map(|z| drives.iter().map(move |&i| z[i])).collect();
    let asked: Vec<S> = free.chunks_exact(n).map(|z| dot(z, force)).collect();
    let d = asked.len();
    let gram: Vec<S> =
        (0..d * d).map(|at| dot(&moved[at / d * count..][..count], &moved[at % d * count..][..count])).collect();
    let (mut values, mut vectors) = (asked.clone(), gram.clone());
    eigh(d, &gram, &mut values, &mut vectors, &mut Workspace::new()).ok()?;
    let least = values.iter().fold(1.0, |least: f64, value| least.min(value.to_f64()));
    if least < LEAST_DRIVE_MOTION * LEAST_DRIVE_MOTION {
        return None;
    }
    let mut found = vec![<S as Real>::zero(); n];
    drives.iter().zip(along_rows(count, &moved, &asked).0).for_each(|(&i, u)| found[i] = u);
    Some(found)
}
