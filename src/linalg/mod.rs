//! Batched small dense linear algebra: solve, symmetric eigen, inertia, minors; products.

pub mod matmul;
