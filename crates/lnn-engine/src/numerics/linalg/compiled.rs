//! The routines of `f32` and `f64`, compiled once, here.

#[cfg(feature = "faer")]
use super::by_faer;
use super::matmul;
use crate::scalar::{MatMut, MatRef, Matrices};
use alloc::vec::Vec;

macro_rules! compiled {
    ($($float:ty)*) => {$(
        impl Matrices for $float {
            fn product(c: MatMut<'_, Self>, accumulate: bool, alpha: Self, a: MatRef<'_, Self>, b: MatRef<'_, Self>) {
                #[cfg(feature = "faer")]
                if !matmul::is_small(&c, &a, &b) {
                    return by_faer::product(c, accumulate, alpha, a, b);
                }
                matmul::plain(c, accumulate, alpha, a, b);
            }
            #[cfg(feature = "faer")]
            fn eliminate(
                n: usize,
                m: usize,
                matrices: &[Self],
                right: Option<&[Self]>,
                solutions: &mut [Self],
            ) -> Option<Vec<usize>> {
                Some(by_faer::eliminate(n, m, matrices, right, solutions))
            }
            #[cfg(feature = "faer")]
            fn eigh(n: usize, matrix: &[Self], values: &mut [Self], vectors: &mut [Self]) -> bool {
                by_faer::eigh(n, matrix, values, vectors);
                true
            }
        }
    )*};
}
compiled!(f32 f64);
