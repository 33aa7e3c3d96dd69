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

/// Runs a large kernel on `W` numbers side by side, as [`vectorized`] does, in no more copies than are ever used: a single
/// lane gains nothing from AVX-512, and a CPU without vector instructions nothing from several lanes.
///
/// Those it refuses: the result is `None`, and the caller goes one lane at a time.
#[inline(always)]
pub(crate) fn in_lanes<const W: usize, R>(kernel: impl FnOnce() -> R) -> Option<R> {
    #[cfg(target_arch = "x86_64")]
    {
        if const { W > 1 }
            && let Some(simd) = pulp::x86::V4::try_new()
        {
            return Some(simd.vectorize(kernel));
        }
        if let Some(simd) = pulp::x86::V3::try_new() {
            return Some(simd.vectorize(kernel));
        }
        if const { W > 1 } { None } else { Some(kernel()) }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        Some(vectorized(kernel))
    }
}
