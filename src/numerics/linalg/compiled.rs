//! The routines of `f32` and `f64`, compiled once, here.

use super::{large_systems, matmul};
use crate::scalar::{MatMut, MatRef, Matrices};

macro_rules! by_faer {
    ($($float:ty)*) => {$(
        impl Matrices for $float {
            fn product(c: MatMut<'_, Self>, accumulate: bool, alpha: Self, a: MatRef<'_, Self>, b: MatRef<'_, Self>) {
                matmul::fast(c, accumulate, alpha, a, b);
            }
            fn eliminate(
                n: usize,
                m: usize,
                matrices: &[Self],
                right: Option<&[Self]>,
                solutions: &mut [Self],
            ) -> Option<Vec<usize>> {
                Some(large_systems::eliminate(n, m, matrices, right, solutions))
            }
            fn eigh(n: usize, matrix: &[Self], values: &mut [Self], vectors: &mut [Self]) -> bool {
                large_systems::decompose(n, matrix, values, vectors);
                true
            }
        }
    )*};
}
by_faer!(f32 f64);
