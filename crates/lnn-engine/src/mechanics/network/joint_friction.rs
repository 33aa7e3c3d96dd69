//! Friction of every coordinate individually, as in the joints of a machine; with or without a Rayleigh dissipation.
//!
//! Let `w` be the scaled velocity of a coordinate and `F` the size of its friction, [`Sizes::friction`](super::Sizes). The dissipation
//!
//! ```text
//! F (softplus(a) w^2/2 + softplus(b) k ln cosh(w/k) + softplus(c) u (1 - exp(-(w/u)^2)))
//! ```
//!
//! consists of a viscous force, a dry one that saturates beyond the speed `k = exp(knee)`, and, for [`JointFriction::Stribeck`], an
//! additional one near the speed `u = exp(fall)` that decreases at higher speeds. All three forces oppose the velocity.

use crate::network::thresholds::{INITIAL_SPEED, INITIAL_STRENGTH};
use crate::scalar::Real;
use alloc::vec::Vec;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Friction of every coordinate individually.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum JointFriction {
    /// No friction.
    #[default]
    None,
    /// Viscous and dry friction.
    Dry,
    /// Viscous and dry friction, with additional friction at low speeds.
    Stribeck,
}

impl JointFriction {
    /// Returns `true` if there is no joint friction.
    pub(crate) fn is_none(&self) -> bool {
        *self == Self::None
    }

    /// Returns the initial parameters of `n` coordinates, row by row: `a`, `b`, the knee, then `c` and the fall.
    pub(super) fn initial(self, n: usize) -> Vec<f64> {
        let rows = [INITIAL_STRENGTH, INITIAL_STRENGTH, INITIAL_SPEED.ln(), INITIAL_STRENGTH, INITIAL_SPEED.ln()];
        rows.into_iter().take(self.rows()).flat_map(|row| vec![row; n]).collect()
    }

    /// Returns the number of parameters of one coordinate.
    pub(crate) fn rows(self) -> usize {
        match self {
            Self::None => 0,
            Self::Dry => 3,
            Self::Stribeck => 5,
        }
    }

    /// Computes the dissipation at scaled velocities; `size` is the size of each coordinate's friction.
    pub(super) fn dissipation<R: Real>(self, parameters: &[R], velocities: &[R], size: impl Fn(usize) -> f64) -> R {
        let n = velocities.len();
        let rows: Vec<&[R]> = parameters.chunks_exact(n).collect();
        let one = |(i, &w): (usize, &R)| {
            let [viscous, dry, knee] = [0, 1, 2].map(|row: usize| rows[row][i]);
            let knee = knee.exp();
            let both = viscous.softplus() * w.sqr() * R::half() + dry.softplus() * knee * (w / knee).ln_cosh();
            let all = match rows[3..] {
                [rise, fall] => {
                    let fall = fall[i].exp();
                    both + rise[i].softplus() * fall * (R::one() - (-(w / fall).sqr()).exp())
                }
                _ => both,
            };
            all * R::of(size(i))
        };
        velocities.iter().enumerate().map(one).fold(R::zero(), |sum, one| sum + one)
    }
}
