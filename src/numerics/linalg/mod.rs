//! Batched small dense linear algebra: solve, minimum-norm solution, symmetric eigen, inertia, minors; products.
//!
//! Matrices are row-major `(batch, n, n)` slices, vectors `(batch, n)`. Kernels run on lanes: element `(i, j)` of
//! `LANES` matrices side by side, every lane through the same branch-free steps, so that a matrix gives the same
//! bits wherever it stands in a batch. A [`Workspace`] is reused; nothing else allocates for matrices up to the size
//! from which faer takes over.
//!
//! ```
//! use lnn::linalg::{LinalgError, Workspace, eigenvalues, solve};
//!
//! // Two systems at once: [[2, 1], [1, 2]] x = (3, 3) and diag(4, -1) x = (4, 1).
//! let (matrices, right) = ([2.0, 1.0, 1.0, 2.0, 4.0, 0.0, 0.0, -1.0], [3.0, 3.0, 4.0, 1.0]);
//! let (mut x, mut values, mut workspace) = ([0.0_f64; 4], [0.0; 4], Workspace::new());
//! solve(2, &matrices, &right, &mut x, &mut workspace)?;
//! assert!(x.iter().zip([1.0, 1.0, 1.0, -1.0]).all(|(x, exact)| (x - exact).abs() < 1e-15));
//! eigenvalues(2, &matrices, &mut values, &mut workspace)?;
//! assert!(values.iter().zip([1.0, 3.0, -1.0, 4.0]).all(|(w, exact)| (w - exact).abs() < 1e-15));
//! # Ok::<(), LinalgError>(())
//! ```

mod batch;
mod condition;
mod eigh;
mod elimination;
mod error;
mod few_rows;
mod inertia;
mod jacobi;
mod large_systems;
mod linear_systems;
mod matmul;
mod minimum_norm;
mod minors;
mod signature;
#[cfg(feature = "rollout")]
mod singular;
mod solve;

pub(crate) use batch::Buffer;
pub(crate) use batch::LANES;
pub use batch::Workspace;
pub use condition::condition_number;
pub use eigh::{eigenvalues, eigh};
pub use error::{Failure, LinalgError};
pub use inertia::{Inertia, inertia, is_positive_definite};
#[doc(hidden)]
pub use matmul::{MatMut, MatRef, gemm};
#[doc(hidden)]
pub use minimum_norm::{MinimumNorm, minimum_norm};
#[doc(hidden)]
pub use minors::{Scaled, adjugate, leading_minors};
#[doc(hidden)]
pub use signature::{
    SignatureBuffers, Violation, characteristic_scales, eigenvalue_violation, has_one_negative, has_signature,
    one_negative_violation, sylvester_violation,
};
#[cfg(feature = "rollout")]
pub(crate) use singular::singular;
pub use solve::inverse;
pub use solve::solve;

/// Sum of products.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
