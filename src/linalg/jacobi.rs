//! Cyclic Jacobi on lanes: symmetric eigendecomposition that loses nothing on graded or clustered spectra.
//!
//! Rotations by the smaller angle, in the form of Rutishauser (1966). An off-diagonal element is dropped once it is
//! below `eps/4` of the geometric mean of its diagonal elements (Demmel and Veselic 1992), or below `eps^2` of the
//! largest element, so that no sweep is spent on denormals.

use super::batch::Lane;
use crate::scalar::{Real, Scalar};

/// More sweeps than any matrix was seen to need (about ten at n = 20 in double-double).
const SWEEPS: usize = 40;

/// Diagonalises the upper triangle of `a` in place; eigenvalues are left on its diagonal.
///
/// If `vectors` is not empty it receives the eigenvectors as rows. Elements are expected near 1 (see [`rescale`]).
#[inline(always)]
pub(super) fn diagonalize<S: Scalar, const W: usize>(n: usize, a: &mut [Lane<S, W>], vectors: &mut [Lane<S, W>]) {
    let a = &mut a[..n * n];
    let zero = [<S as Real>::zero(); W];
    if !vectors.is_empty() {
        for (k, lane) in vectors[..n * n].iter_mut().enumerate() {
            *lane = if k % (n + 1) == 0 { [<S as Real>::one(); W] } else { zero };
        }
    }
    let largest = largest(a);
    let mut floor = zero;
    for l in 0..W {
        let least = S::EPSILON * S::EPSILON * largest[l];
        floor[l] = least * least;
    }
    for _ in 0..SWEEPS {
        let mut quiet = true;
        for p in 0..n {
            for q in p + 1..n {
                quiet &= !annihilate(n, a, vectors, p, q, &floor);
            }
        }
        if quiet {
            break;
        }
    }
}

/// One rotation in the plane `(p, q)`; whether any lane turned.
#[inline(always)]
fn annihilate<S: Scalar, const W: usize>(
    n: usize,
    a: &mut [Lane<S, W>],
    vectors: &mut [Lane<S, W>],
    p: usize,
    q: usize,
    floor: &Lane<S, W>,
) -> bool {
    let (app, aqq, apq) = (a[p * n + p], a[q * n + q], a[p * n + q]);
    let quarter = S::EPSILON * S::of_f64(0.25);
    let mut turn = [false; W];
    for l in 0..W {
        let square = apq[l] * apq[l];
        turn[l] = (square > quarter * quarter * (app[l] * aqq[l]).abs()) & (square > floor[l]);
    }
    a[p * n + q] = [<S as Real>::zero(); W];
    if !turn.iter().any(|&turn| turn) {
        return false;
    }
    // t = tan of the angle, |t| <= 1; s = sin, tau = tan of half the angle.
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    let (mut s, mut tau) = ([zero; W], [zero; W]);
    let (mut pp, mut qq) = (app, aqq);
    for l in 0..W {
        let twice = apq[l] + apq[l];
        let d = aqq[l] - app[l];
        let denominator = d.abs() + (d * d + twice * twice).sqrt();
        let signed = if d < zero { -twice } else { twice };
        let t = if turn[l] { signed / denominator } else { zero };
        let c = (one + t * t).sqrt().recip();
        s[l] = t * c;
        tau[l] = s[l] / (one + c);
        pp[l] = app[l] - t * apq[l];
        qq[l] = aqq[l] + t * apq[l];
    }
    a[p * n + p] = pp;
    a[q * n + q] = qq;
    for r in 0..p {
        rotate(a, r * n + p, r * n + q, &s, &tau);
    }
    for r in p + 1..q {
        rotate(a, p * n + r, r * n + q, &s, &tau);
    }
    for r in q + 1..n {
        rotate(a, p * n + r, q * n + r, &s, &tau);
    }
    if !vectors.is_empty() {
        for r in 0..n {
            rotate(vectors, p * n + r, q * n + r, &s, &tau);
        }
    }
    true
}

/// `(x, y) -> (c x - s y, s x + c y)` for the elements at `i < j`.
#[inline(always)]
fn rotate<S: Scalar, const W: usize>(a: &mut [Lane<S, W>], i: usize, j: usize, s: &Lane<S, W>, tau: &Lane<S, W>) {
    let (x, y) = (a[i], a[j]);
    for l in 0..W {
        a[i][l] = (-s[l]).mul_add(tau[l].mul_add(x[l], y[l]), x[l]);
        a[j][l] = s[l].mul_add((-tau[l]).mul_add(y[l], x[l]), y[l]);
    }
}

/// Largest absolute value of each lane.
#[inline(always)]
fn largest<S: Scalar, const W: usize>(a: &[Lane<S, W>]) -> Lane<S, W> {
    let mut largest = [<S as Real>::zero(); W];
    for lane in a {
        for l in 0..W {
            let size = lane[l].abs();
            largest[l] = if size > largest[l] { size } else { largest[l] };
        }
    }
    largest
}

/// Scales lanes whose elements are far from 1 by a power of two; returns the exponents to put back.
#[inline(always)]
pub(super) fn rescale<S: Scalar, const W: usize>(a: &mut [Lane<S, W>]) -> [i32; W] {
    let largest = largest(a);
    let reach = S::MIN_POSITIVE.ilogb() / -12;
    let one = <S as Real>::one();
    let (low, high) = (one.ldexp(-reach), one.ldexp(reach));
    let mut exponents = [0; W];
    for l in 0..W {
        if !(largest[l] >= low && largest[l] <= high) && largest[l] > <S as Real>::zero() && largest[l].is_finite() {
            exponents[l] = largest[l].ilogb();
            for lane in a.iter_mut() {
                lane[l] = lane[l].ldexp(-exponents[l]);
            }
        }
    }
    exponents
}

/// Moves the diagonal of `a` to `values`, scaled back, and sorts it ascending together with the rows of `vectors`.
#[inline(always)]
pub(super) fn sorted<S: Scalar, const W: usize>(
    n: usize,
    a: &[Lane<S, W>],
    exponents: &[i32; W],
    vectors: &mut [Lane<S, W>],
    values: &mut [Lane<S, W>],
) {
    let values = &mut values[..n];
    for (i, value) in values.iter_mut().enumerate() {
        *value = a[i * n + i];
        for l in 0..W {
            if exponents[l] != 0 {
                value[l] = value[l].ldexp(exponents[l]);
            }
        }
    }
    for end in (1..n).rev() {
        for i in 0..end {
            let (x, y) = (values[i], values[i + 1]);
            let mut swap = [false; W];
            for l in 0..W {
                swap[l] = x[l] > y[l];
            }
            if !swap.iter().any(|&swap| swap) {
                continue;
            }
            for l in 0..W {
                values[i][l] = if swap[l] { y[l] } else { x[l] };
                values[i + 1][l] = if swap[l] { x[l] } else { y[l] };
            }
            if !vectors.is_empty() {
                let (head, tail) = vectors.split_at_mut((i + 1) * n);
                for (x, y) in head[i * n..].iter_mut().zip(&mut tail[..n]) {
                    for l in 0..W {
                        let (a, b) = (x[l], y[l]);
                        x[l] = if swap[l] { b } else { a };
                        y[l] = if swap[l] { a } else { b };
                    }
                }
            }
        }
    }
}
