//! Run-time CPU dispatch, for plain loops and for kernels in explicit vectors.

pub(crate) use pulp::{Simd, WithSimd};

/// Runs `kernel` compiled for the widest vector instructions this CPU has (AVX-512, AVX2 + FMA, NEON, or baseline).
///
/// The loops inside must be inlined into the closure (`#[inline(always)]`) to be vectorised; a `mul_add` in them is
/// one instruction where the CPU fuses it.
#[inline(always)]
pub fn vectorized<R>(kernel: impl FnOnce() -> R) -> R {
    struct Kernel<F>(F);
    impl<F: FnOnce() -> R, R> pulp::WithSimd for Kernel<F> {
        type Output = R;
        #[inline(always)]
        fn with_simd<S: pulp::Simd>(self, _simd: S) -> R {
            (self.0)()
        }
    }
    pulp::Arch::new().dispatch(Kernel(kernel))
}

/// Runs a kernel in explicit vectors with the widest instructions this CPU has.
#[inline(always)]
pub(crate) fn in_vectors<K: WithSimd>(kernel: K) -> K::Output {
    pulp::Arch::new().dispatch(kernel)
}
