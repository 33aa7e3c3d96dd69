//! Run-time CPU dispatch; loops over slices side by side, as far as the shortest reaches, and over columns of row-major tables.
//!
//! They are always inlined. Parts of the standard library's adaptors are separate functions, which without optimisation across codegen
//! units are called once for every number.

use super::{Real, Scalar};
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

/// Runs a large kernel on `W` numbers side by side, as [`vectorized`] does, compiled only for combinations that are useful: a single lane
/// gains nothing from AVX-512, and a CPU without vector instructions gains nothing from several lanes.
///
/// For others the result is `None`, and the caller uses one lane at a time.
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

/// `true` if all numbers are finite.
#[inline(always)]
pub(crate) fn are_finite<S: Scalar>(numbers: &[S]) -> bool {
    const WIDTH: usize = 8;
    let zero = <S as Real>::zero();
    let mut probe = [zero; WIDTH];
    let (parts, rest) = numbers.as_chunks::<WIDTH>();
    for part in parts {
        for l in 0..WIDTH {
            probe[l] += part[l] * zero;
        }
    }
    let mut sum = zero;
    for &x in rest {
        sum += x * zero;
    }
    for x in probe {
        sum += x;
    }
    sum == zero
}

/// `f(out, x)` number by number.
#[inline(always)]
pub fn update<S: Copy>(out: &mut [S], x: &[S], f: impl Fn(&mut S, S)) {
    let n = out.len().min(x.len());
    let (out, x) = (&mut out[..n], &x[..n]);
    for k in 0..n {
        f(&mut out[k], x[k]);
    }
}

/// `f(out, x, y)` number by number.
#[inline(always)]
pub fn update2<S: Copy>(out: &mut [S], x: &[S], y: &[S], f: impl Fn(&mut S, S, S)) {
    let n = out.len().min(x.len()).min(y.len());
    let (out, x, y) = (&mut out[..n], &x[..n], &y[..n]);
    for k in 0..n {
        f(&mut out[k], x[k], y[k]);
    }
}

/// `f(out, x, y, z)` number by number.
#[inline(always)]
pub(crate) fn update3<S: Copy>(out: &mut [S], x: &[S], y: &[S], z: &[S], f: impl Fn(&mut S, S, S, S)) {
    let n = out.len().min(x.len()).min(y.len()).min(z.len());
    let (out, x, y, z) = (&mut out[..n], &x[..n], &y[..n], &z[..n]);
    for k in 0..n {
        f(&mut out[k], x[k], y[k], z[k]);
    }
}

/// A column of a row-major table: every `step`-th number from `first` on.
#[derive(Debug)]
pub(crate) struct Column<T> {
    pub numbers: T,
    pub first: usize,
    pub step: usize,
}

impl<T> Column<T> {
    /// The column of a table of rows of `step` numbers; of a plane, which has one, the plane itself.
    #[inline(always)]
    pub fn new(numbers: T, first: usize, step: usize) -> Self {
        Self { numbers, first, step }
    }
    /// Adjacent numbers.
    #[inline(always)]
    pub fn all(numbers: T) -> Self {
        Self::new(numbers, 0, 1)
    }
}

/// `f(out, x)` for the first `rows` numbers of two columns.
///
/// # Panics
/// If a column has fewer.
#[inline(always)]
pub(crate) fn update_column<S: Copy>(rows: usize, out: Column<&mut [S]>, x: Column<&[S]>, f: impl Fn(&mut S, S)) {
    let Some(last) = rows.checked_sub(1) else { return };
    // For numbers side by side this is the only check.
    assert!(out.first + last * out.step < out.numbers.len() && x.first + last * x.step < x.numbers.len());
    for k in 0..rows {
        f(&mut out.numbers[out.first + k * out.step], x.numbers[x.first + k * x.step]);
    }
}

/// `out = x` for the first `rows` numbers of two columns; between a plane and a table of few columns without a check per number.
///
/// # Panics
/// If a column has fewer.
#[inline(always)]
pub(crate) fn copy_column<S: Copy>(rows: usize, out: Column<&mut [S]>, x: Column<&[S]>) {
    #[inline(always)]
    fn fixed<S: Copy, const A: usize, const B: usize>(rows: usize, out: Column<&mut [S]>, x: Column<&[S]>) {
        let (to, from) = (&mut out.numbers.as_chunks_mut::<A>().0[..rows], &x.numbers.as_chunks::<B>().0[..rows]);
        assert!(out.first < A && x.first < B, "a column within the table");
        for k in 0..rows {
            to[k][out.first] = from[k][x.first];
        }
    }
    match (out.step, x.step) {
        (1, 1) => fixed::<S, 1, 1>(rows, out, x),
        (1, 2) => fixed::<S, 1, 2>(rows, out, x),
        (1, 3) => fixed::<S, 1, 3>(rows, out, x),
        (1, 4) => fixed::<S, 1, 4>(rows, out, x),
        (1, 6) => fixed::<S, 1, 6>(rows, out, x),
        (1, 8) => fixed::<S, 1, 8>(rows, out, x),
        (2, 1) => fixed::<S, 2, 1>(rows, out, x),
        (3, 1) => fixed::<S, 3, 1>(rows, out, x),
        (4, 1) => fixed::<S, 4, 1>(rows, out, x),
        (9, 1) => fixed::<S, 9, 1>(rows, out, x),
        (16, 1) => fixed::<S, 16, 1>(rows, out, x),
        _ => update_column(rows, out, x, |to, x| *to = x),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_ends_a_loop() {
        let mut out = [1.0, 2.0, 3.0];
        update(&mut out, &[10.0, 20.0], |out, x| *out += x);
        assert_eq!(out, [11.0, 22.0, 3.0]);
        update2(&mut out, &[1.0, 1.0, 1.0, 1.0], &[2.0], |out, x, y| *out = x + y);
        assert_eq!(out, [3.0, 22.0, 3.0]);
        update3(&mut out[1..], &[1.0; 9], &[2.0; 9], &[4.0; 9], |out, x, y, z| *out = x + y + z);
        assert_eq!(out, [3.0, 7.0, 7.0]);
    }

    #[test]
    fn columns_of_tables_of_any_width() {
        let table = [0.0, 1.0, 2.0, 10.0, 11.0, 12.0]; // (2, 3)
        let mut out = [0.0; 4]; // (2, 2)
        update_column(2, Column::new(&mut out, 1, 2), Column::new(&table, 2, 3), |out, x| *out = x);
        assert_eq!(out, [0.0, 2.0, 0.0, 12.0]);
        update_column(1, Column::all(&mut out), Column::new(&table, 1, 3), |out, x| *out += x);
        assert_eq!(out, [1.0, 2.0, 0.0, 12.0]);
        // Widths that are compiled in and others, to and from a plane.
        for width in 1..18 {
            let table: Vec<f64> = (0..3 * width).map(|k| k as f64).collect();
            for column in 0..width {
                let (mut plane, mut back) = ([0.0; 3], vec![0.0; 3 * width]);
                copy_column(3, Column::all(&mut plane), Column::new(&table, column, width));
                copy_column(3, Column::new(&mut back, column, width), Column::all(&plane));
                for (k, (&x, &y)) in table.iter().zip(&back).enumerate() {
                    assert_eq!(y, if k % width == column { x } else { 0.0 });
                }
            }
        }
    }
}
