//! Batched small dense linear algebra: solve, symmetric eigen, inertia, minors.

mod matmul;

pub use matmul::{MatMut, MatRef, gemm};
