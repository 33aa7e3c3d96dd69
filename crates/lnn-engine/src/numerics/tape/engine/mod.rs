//! The engine of Lagrangians: one recorded function `L(q, v)` of any operations; a few rules per operation give all its derivatives.
//!
//! With `A_k = dL/dy_k` the adjoints of one reverse sweep over the operations `y_k = phi_k(..)`,
//!
//! ```text
//! D2L[u, w] = sum_k A_k . phi_k''[ operands[u], operands[w] ],
//! ```
//!
//! so that `M` (directions `(0, e_i)`) and `c` (one more, `(v, 0)`) cost `n + 1` tangents in addition to the value and the adjoint.
//! Gradients of losses `l(a, M)` by parameters and state are reverse sweeps of mixed Taylor coefficients `L_st = D2L[x_s, x_t] + DL[x_st]`:
//! with `lam = M^-1 dl/da` and `G = dl/dM`
//!
//! ```text
//! d/dtheta { D_(lam,0) L - D2L[(0,lam),(v,a)] + sum_ij G_ij D2L[(0,e_i),(0,e_j)] }
//! ```
//!
//! (the first two terms: Hamzaogullari and Ozakin, eqs. A.8 and A.9), which `x_s = (0, s)`, `x_t = tau (v, 0) + (0, t)`,
//! `x_st = -tau (s, 0)` turns into one coefficient each: the first two with `s = -lam`, `t = a`, `tau = 1`, a term
//! `gamma u u^T` of `G` with `s = gamma u`, `t = u`, `tau = 0`. Whatever `n` is, `n + 11` passes give a gradient.
//!
//! A pass skips unnecessary work: tangents of values that reach `L` linearly, velocity directions of values that depend on positions alone,
//! and derivatives that no request needs. Nothing is allocated after the first call of a size.
//!
//! Derivatives are taken by scaled states `q_i/s_i`, `v_i/s_i`: all results are in scaled coordinates.

mod compile;
mod evaluation;
mod kernel;
mod operation;
mod value;

pub use compile::Recorded;
pub use evaluation::{Depth, Evaluation, MixedDirections};

/// States evaluated together at most.
pub const STATES: usize = 64;
