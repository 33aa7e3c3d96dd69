//! Euler-Lagrange terms of a batch of states: what may be asked for, where it is stored, how the rest follows.

use crate::scalar::Scalar;
use std::ops::{BitOr, Range};

/// Which terms a caller needs; nothing else is computed.
///
/// Requests combine with `|`. Asking for [`Request::ACCELERATION`] computes `M`, `c` and `g` on the way and stores
/// them, [`Request::ENERGY`] stores `L` and `p`. The default asks for nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Request(u8);

impl Request {
    /// `L`.
    pub const LAGRANGIAN: Self = Self(1);
    /// `p = dL/dv`.
    pub const MOMENTUM: Self = Self(2);
    /// `g = dL/dq`.
    pub const DL_DQ: Self = Self(4);
    /// `M = d2L/dv dv`.
    pub const MASS_MATRIX: Self = Self(8);
    /// `c = (d2L/dv dq) v`.
    pub const CORIOLIS: Self = Self(16);
    /// `a = M^-1 (g - c)`, with `M`, `c`, `g`.
    pub const ACCELERATION: Self = Self(32 | 16 | 8 | 4);
    /// `E = p.v - L`, with `L`, `p`.
    pub const ENERGY: Self = Self(64 | 2 | 1);
    /// Everything.
    pub const ALL: Self = Self(127);

    /// Whether all of `other` is asked for.
    #[inline]
    pub const fn includes(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

impl BitOr for Request {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// Euler-Lagrange terms of `batch` states; a field is filled if it was asked for and empty otherwise.
#[derive(Clone, Debug, Default)]
pub struct Terms<S> {
    /// `L`, `(batch)`.
    pub lagrangian: Vec<S>,
    /// `p = dL/dv`, `(batch, n)`.
    pub momentum: Vec<S>,
    /// `g = dL/dq`, `(batch, n)`.
    pub dl_dq: Vec<S>,
    /// `M = d2L/dv dv`, `(batch, n, n)`, symmetric.
    pub mass_matrix: Vec<S>,
    /// `c = (d2L/dv dq) v`, `(batch, n)`.
    pub coriolis: Vec<S>,
    /// `a = M^-1 (g - c)`, `(batch, n)`.
    pub acceleration: Vec<S>,
    /// `E = p.v - L`, `(batch)`.
    pub energy: Vec<S>,
}

impl<S: Scalar> Terms<S> {
    /// Takes over what `request` asks for of the rows `rows` of a batch of `n` coordinates; the rest is emptied.
    pub(crate) fn copy_rows(&mut self, batch: &Self, n: usize, rows: Range<usize>, request: Request) {
        let copy = |to: &mut Vec<S>, from: &[S], width: usize, what: Request| {
            to.clear();
            if request.includes(what) {
                to.extend_from_slice(&from[rows.start * width..rows.end * width]);
            }
        };
        copy(&mut self.lagrangian, &batch.lagrangian, 1, Request::LAGRANGIAN);
        copy(&mut self.momentum, &batch.momentum, n, Request::MOMENTUM);
        copy(&mut self.dl_dq, &batch.dl_dq, n, Request::DL_DQ);
        copy(&mut self.mass_matrix, &batch.mass_matrix, n * n, Request::MASS_MATRIX);
        copy(&mut self.coriolis, &batch.coriolis, n, Request::CORIOLIS);
        copy(&mut self.acceleration, &batch.acceleration, n, Request::ACCELERATION);
        copy(&mut self.energy, &batch.energy, 1, Request::ENERGY);
    }
}

/// Why terms could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MechanicsError {
    /// A slice has the wrong length.
    #[error("{what}: expected {expected} numbers, found {found}")]
    Shape {
        /// Which argument.
        what: &'static str,
        /// Numbers expected.
        expected: usize,
        /// Numbers found.
        found: usize,
    },
    /// The mass matrix of a state cannot be solved with.
    #[error("mass matrix of state {row} is singular (condition number {condition:.3e})")]
    Singular {
        /// Row of the batch.
        row: usize,
        /// Estimated 2-norm condition number (infinite if exactly singular).
        condition: f64,
    },
    /// A term is not finite.
    #[error("{what} of state {row} is not finite")]
    NotFinite {
        /// Row of the batch.
        row: usize,
        /// Which term.
        what: &'static str,
    },
}

/// Anything that moves by a Lagrangian: a hand-written system or a trained network, in physical units.
///
/// Object safe: roll-outs, evaluation and reports take `&dyn EulerLagrange<S>`.
pub trait EulerLagrange<S: Scalar>: Send + Sync {
    /// Number of coordinates `n`.
    fn coordinates(&self) -> usize;

    /// Computes the requested terms of a batch.
    ///
    /// `q` and `v` are `(batch, n)` in physical units. `terms` is resized; its buffers are reused.
    ///
    /// # Errors
    /// [`MechanicsError`] naming the first row that fails. Terms other than the acceleration are filled even when a
    /// mass matrix is singular, and the accelerations of the other rows are right; those of failed rows are `NaN`.
    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError>;

    /// Whether several states at once take much less time per state than one, by more than threads need to meet.
    fn prefers_batches(&self) -> bool {
        false
    }
}
