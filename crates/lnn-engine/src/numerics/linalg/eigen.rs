//! Batched symmetric eigendecomposition by cyclic Jacobi on lanes, accurate for graded and clustered spectra.
//!
//! Rotations by the smaller angle, in the form of Rutishauser (1966), in rounds of `n/2` that do not touch each other
//! (Brent and Luk 1985): their angles do not wait for one another. An off-diagonal element is dropped once it is below
//! `eps/4` of the geometric mean of its diagonal elements (Demmel and Veselic 1992), or below `eps^2` of the largest
//! element, so that no sweep is spent on denormals.

use super::batch::{Aligned, Buffer, LANES, Lane, Workspace, across, rows, select, with_size};
use super::blocks::by_blocks;
use super::thresholds::MOST_EIGEN_SWEEPS;
use super::{Failure, LinalgError, expect_length, large_systems};
use crate::scalar::{Real, Scalar, in_lanes};

/// Eigenvalues, ascending, and eigenvectors of a batch of symmetric matrices: `M = sum_k w_k u_k u_k^T`.
///
/// `matrices` is `(batch, n, n)` (the upper triangle is read), `values` `(batch, n)`, `vectors` `(batch, n, n)` with
/// `u_k` as ROW `k`.
///
/// # Errors
/// [`LinalgError::Shape`]; [`LinalgError::NotFinite`] names the first matrix with an infinity or a `NaN`, its results
/// are `NaN`, the others are right.
pub fn eigh<S: Scalar>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    vectors: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    expect_length("eigenvectors", matrices.len(), vectors.len())?;
    run(n, matrices, values, vectors, workspace)
}

/// Eigenvalues alone, ascending; arguments and errors as in [`eigh`].
///
/// # Errors
/// As [`eigh`].
pub fn eigenvalues<S: Scalar>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    run(n, matrices, values, &mut [], workspace)
}

/// Both; `vectors` may be empty.
fn run<S: Scalar>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    vectors: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    workspace.clear_failures();
    let size = n * n;
    let batch = matrices.len() / size.max(1);
    expect_length("matrices", batch * size, matrices.len())?;
    expect_length("eigenvalues", batch * n, values.len())?;
    if batch == 0 {
        return Ok(());
    }
    if by_blocks(n, matrices, values, vectors, &mut workspace.block) {
        return Ok(());
    }
    for (row, m) in matrices.chunks_exact(size).enumerate() {
        let values = &mut values[row * n..(row + 1) * n];
        if m.iter().any(|m| !m.is_finite()) || values.iter().any(|w| !w.is_finite()) {
            values.fill(S::nan());
            if !vectors.is_empty() {
                vectors[row * size..(row + 1) * size].fill(S::nan());
            }
            workspace.failures_mut().push((row, Failure::NotFinite));
        }
    }
    workspace.outcome()
}

/// Treats every matrix as a whole, by lanes or, if it is large, by the routine of its scalar; `true` if all is known to be finite.
pub(super) fn whole<S: Scalar>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    vectors: &mut [S],
    buffer: &mut Buffer<S>,
) -> bool {
    let size = n * n;
    let one_by_one = matrices.chunks_exact(size).zip(values.chunks_exact_mut(n)).enumerate().all(|(row, (m, w))| {
        let u = if vectors.is_empty() { &mut [][..] } else { &mut vectors[row * size..(row + 1) * size] };
        large_systems::eigh(n, m, w, u)
    });
    if one_by_one {
        false
    } else if const { size_of::<S>() < size_of::<f64>() } {
        split::<S, { 2 * LANES }>(n, matrices, values, vectors, buffer)
    } else {
        split::<S, LANES>(n, matrices, values, vectors, buffer)
    }
}

/// In blocks of `W`, with a single matrix at the end alone; `true` if all is finite.
fn split<S: Scalar, const W: usize>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    vectors: &mut [S],
    buffer: &mut Buffer<S>,
) -> bool {
    let batch = values.len() / n;
    let together = batch - usize::from(batch % W == 1);
    let finite = decompose::<S, W>(n, matrices, values, vectors, (0, together), buffer);
    let done = if finite.is_some() { together } else { 0 };
    let rest = decompose::<S, 1>(n, matrices, values, vectors, (done, batch), buffer);
    finite != Some(false) && rest != Some(false)
}

/// Eigenvalues, ascending, and eigenvectors as rows (if `vectors` is not empty) of the matrices `start..end` of a
/// batch in blocks of `W`; the upper triangle is read.
///
/// The result is `true` if all is finite; the eigenvalues of a matrix that is not are `NaN`. It is `None`, and nothing is done, if the CPU
/// does not support this many lanes (see [`in_lanes`]).
pub(super) fn decompose<S: Scalar, const W: usize>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    vectors: &mut [S],
    (start, end): (usize, usize),
    buffer: &mut Buffer<S>,
) -> Option<bool> {
    // Elements within these bounds need no scaling.
    let reach = S::min_positive().ilogb() / -12;
    let one = <S as Real>::one();
    let range = (one.ldexp(-reach), one.ldexp(reach));
    let mut finite = true;
    in_lanes::<W, _>(
        #[inline(always)]
        || {
            with_size!((S, W) n, buffer, |n| 2 * n * n + n + 2, |storage| {
                let (a, rest) = storage.split_at_mut(n * n);
                let (turns, u) = rest.split_at_mut(n + 2);
                let u = if vectors.is_empty() { &mut [][..] } else { &mut u[..n * n] };
                for start in (start..end).step_by(W) {
                    let (largest, probe) = load(n, matrices, start, a);
                    let exponents = rescale(a, &largest, &range);
                    diagonalize(n, a, u, turns);
                    finite &= store(n, (a, u), turns, &exponents, &probe, (&mut *values, &mut *vectors), start);
                }
            });
            finite
        },
    )
}

/// Loads a block; returns the largest absolute elements, and zero where all is finite, `NaN` otherwise.
#[inline(always)]
fn load<S: Scalar, const W: usize>(
    n: usize,
    matrices: &[S],
    start: usize,
    a: &mut [Lane<S, W>],
) -> (Lane<S, W>, Lane<S, W>) {
    let rows = rows::<S, W>(matrices, n * n, start);
    let zero = <S as Real>::zero();
    let (mut largest, mut probe) = ([zero; W], [zero; W]);
    for (e, element) in a[..n * n].iter_mut().enumerate() {
        let x = across(&rows, e);
        for l in 0..W {
            let size = x[l].abs();
            largest[l] = select(size > largest[l], size, largest[l]);
            probe[l] += x[l] * zero;
        }
        *element = x;
    }
    (largest, probe)
}

/// Scales lanes whose elements are far from 1 by a power of two; returns the exponents to put back.
#[inline(always)]
fn rescale<S: Scalar, const W: usize>(a: &mut [Lane<S, W>], largest: &Lane<S, W>, range: &(S, S)) -> [i32; W] {
    let mut exponents = [0; W];
    let mut near = true;
    for l in 0..W {
        near &= (largest[l] >= range.0) & (largest[l] <= range.1);
    }
    if !near {
        for l in 0..W {
            let near = (largest[l] >= range.0) & (largest[l] <= range.1);
            if !near && largest[l] > <S as Real>::zero() && largest[l].is_finite() {
                exponents[l] = largest[l].ilogb();
                for lane in a.iter_mut() {
                    lane[l] = lane[l].ldexp(-exponents[l]);
                }
            }
        }
    }
    exponents
}

/// Pair `k` of a round among `n` indices, in ascending order; the second is `n` where one index of an odd number rests.
///
/// Every pair meets once in the `n - 1` rounds (`n` if odd) of a sweep.
#[inline(always)]
fn pair(n: usize, round: usize, k: usize) -> (usize, usize) {
    let last = (n + n % 2).max(2) - 1;
    if k == 0 {
        return (round, last);
    }
    let wrap = |i: usize| if i >= last { i - last } else { i };
    let (p, q) = (wrap(round + k), wrap(round + last - k));
    if p < q { (p, q) } else { (q, p) }
}

/// Diagonalises the upper triangle of `a` in place; eigenvalues are left on its diagonal.
///
/// If `vectors` is not empty it receives the eigenvectors as rows. Elements are expected near 1 (see [`rescale`]).
#[inline(always)]
fn diagonalize<S: Scalar, const W: usize>(
    n: usize,
    a: &mut [Lane<S, W>],
    vectors: &mut [Lane<S, W>],
    turns: &mut [Lane<S, W>],
) {
    let a = &mut a[..n * n];
    let turns = &mut turns[..n + 2];
    let zero = <S as Real>::zero();
    for (k, lane) in vectors.iter_mut().enumerate() {
        *lane = [if k % (n + 1) == 0 { <S as Real>::one() } else { zero }; W];
    }
    let mut floor = [zero; W];
    for i in 0..n {
        for j in i..n {
            let x = a[i * n + j];
            for l in 0..W {
                let size = x[l].abs();
                floor[l] = select(size > floor[l], size, floor[l]);
            }
        }
    }
    for l in 0..W {
        let least = S::epsilon() * S::epsilon() * floor[l];
        floor[l] = least * least;
    }
    let pairs = n.div_ceil(2);
    for _ in 0..MOST_EIGEN_SWEEPS {
        let mut quiet = true;
        for round in 0..2 * pairs - 1 {
            let mut still = true;
            for k in 0..pairs {
                let (p, q) = pair(n, round, k);
                if q < n {
                    still &= !angle(n, a, p, q, &floor, &mut turns[2 * k..2 * k + 2]);
                }
            }
            if !still {
                quiet = false;
                turn(n, a, vectors, round, turns);
            }
        }
        if quiet {
            break;
        }
    }
}

/// Sine of the angle and tangent of its half that annihilate element `(p, q)`, zero in lanes that are done; the
/// element and the diagonal are brought up to date. Whether any lane turns.
#[inline(always)]
fn angle<S: Scalar, const W: usize>(
    n: usize,
    a: &mut [Lane<S, W>],
    p: usize,
    q: usize,
    floor: &Lane<S, W>,
    turns: &mut [Lane<S, W>],
) -> bool {
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    let (mut app, mut aqq, apq) = (a[p * n + p], a[q * n + q], a[p * n + q]);
    let quarter = S::epsilon() * S::of_f64(0.25);
    let mut any = false;
    // Twice the element where it counts.
    let mut twice = [zero; W];
    for l in 0..W {
        let square = apq[l] * apq[l];
        let turn = (square > quarter * quarter * (app[l] * aqq[l]).abs()) & (square > floor[l]);
        twice[l] = select(turn, apq[l] + apq[l], zero);
        any |= turn;
    }
    a[p * n + q] = [zero; W];
    if !any {
        turns[0] = [zero; W];
        turns[1] = [zero; W];
        return false;
    }
    let (mut s, mut tau) = ([zero; W], [zero; W]);
    for l in 0..W {
        let w = twice[l];
        let d = aqq[l] - app[l];
        // tan = w / u, sin = w / h, tan of half the angle = w / (h + u), |tan| <= 1.
        let r = d.lane_fused(d, w * w).sqrt();
        let u = d.abs() + r;
        let u = select(w == zero, one, u);
        let h = u.lane_fused(u, w * w).sqrt();
        let w = select(d < zero, -w, w);
        let t = w / u;
        s[l] = w / h;
        tau[l] = w / (h + u);
        let shift = t * (twice[l] * S::half());
        app[l] -= shift;
        aqq[l] += shift;
    }
    a[p * n + p] = app;
    a[q * n + q] = aqq;
    turns[0] = s;
    turns[1] = tau;
    true
}

/// Applies the rotations of a round to all but the elements they annihilate and the diagonal.
#[inline(always)]
fn turn<S: Scalar, const W: usize>(
    n: usize,
    a: &mut [Lane<S, W>],
    vectors: &mut [Lane<S, W>],
    round: usize,
    turns: &[Lane<S, W>],
) {
    let place = |i: usize, j: usize| if i < j { i * n + j } else { j * n + i };
    let pairs = n.div_ceil(2);
    for k in 0..pairs {
        let (p, q) = pair(n, round, k);
        let (s, tau) = (turns[2 * k], turns[2 * k + 1]);
        for m in k + 1..pairs {
            // The 2x2 block between two planes, turned from both sides.
            let (v, w) = pair(n, round, m);
            let (s2, tau2) = (turns[2 * m], turns[2 * m + 1]);
            let (pv, pw) = (place(p, v), place(p, w));
            if q < n {
                let (qv, qw) = (place(q, v), place(q, w));
                let (x, y) = rotate(&a[pv], &a[qv], &s, &tau);
                let (z, t) = rotate(&a[pw], &a[qw], &s, &tau);
                (a[pv], a[pw]) = rotate(&x, &z, &s2, &tau2);
                (a[qv], a[qw]) = rotate(&y, &t, &s2, &tau2);
            } else {
                (a[pv], a[pw]) = rotate(&a[pv], &a[pw], &s2, &tau2);
            }
        }
        if q < n && !vectors.is_empty() {
            let (head, tail) = vectors.split_at_mut(q * n);
            let (x, y) = (&mut head[p * n..p * n + n], &mut tail[..n]);
            for k in 0..n {
                (x[k], y[k]) = rotate(&x[k], &y[k], &s, &tau);
            }
        }
    }
}

/// `(c x - s y, s x + c y)`.
#[inline(always)]
fn rotate<S: Scalar, const W: usize>(
    x: &Lane<S, W>,
    y: &Lane<S, W>,
    s: &Lane<S, W>,
    tau: &Lane<S, W>,
) -> (Lane<S, W>, Lane<S, W>) {
    let (mut first, mut second) = (*x, *y);
    for l in 0..W {
        first[l] = (-s[l]).lane_fused(tau[l].lane_fused(x[l], y[l]), x[l]);
        second[l] = s[l].lane_fused((-tau[l]).lane_fused(y[l], x[l]), y[l]);
    }
    (first, second)
}

/// Writes a block out in ascending order of the eigenvalues; whether all is finite.
///
/// A zero is written as positive zero: a rotation by nothing may change its sign.
#[inline(always)]
fn store<S: Scalar, const W: usize>(
    n: usize,
    (a, u): (&[Lane<S, W>], &[Lane<S, W>]),
    ranks: &mut [Lane<S, W>],
    exponents: &[i32; W],
    probe: &Lane<S, W>,
    (values, vectors): (&mut [S], &mut [S]),
    start: usize,
) -> bool {
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    let ranks = &mut ranks[..n];
    ranks.fill([zero; W]);
    let mut check = *probe;
    for i in 0..n {
        let x = a[i * n + i];
        for l in 0..W {
            check[l] += x[l] * zero;
        }
        for j in 0..i {
            let y = a[j * n + j];
            let (mut upper, mut lower) = (ranks[i], ranks[j]);
            for l in 0..W {
                let after = select(y[l] <= x[l], one, zero);
                upper[l] += after;
                lower[l] += one - after;
            }
            (ranks[i], ranks[j]) = (upper, lower);
        }
    }
    let count = (values.len() / n - start).min(W);
    let mut finite = true;
    for l in 0..count {
        let values = &mut values[(start + l) * n..][..n];
        for i in 0..n {
            let rank = (ranks[i][l].to_f64() as usize).min(n - 1);
            let value = a[i * n + i][l] + check[l];
            values[rank] = if exponents[l] == 0 { value } else { value.ldexp(exponents[l]) };
            if !u.is_empty() {
                let row = &mut vectors[((start + l) * n + rank) * n..][..n];
                let u = &u[i * n..i * n + n];
                for k in 0..n {
                    row[k] = u[k][l] + zero;
                }
            }
        }
        finite &= check[l] == zero && (exponents[l] == 0 || values.iter().all(|w| w.is_finite()));
    }
    finite
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::dot;

    #[test]
    fn lanes_find_what_faer_finds() {
        for n in [3, 40, 70] {
            let batch = LANES + 2;
            let mut m = vec![0.0; batch * n * n];
            for (b, m) in m.chunks_exact_mut(n * n).enumerate() {
                for i in 0..n {
                    for j in 0..n {
                        m[i * n + j] = ((i * j * 7 + (i + j) * 13 + b * 5) % 101) as f64 / 101.0 - 0.5;
                    }
                }
            }
            let (mut w, mut u) = (vec![0.0; batch * n], m.clone());
            let (mut faer, mut its) = (w.clone(), m.clone());
            assert!(split::<f64, LANES>(n, &m, &mut w, &mut u, &mut Buffer::default()));
            eigh(n, &m, &mut faer, &mut its, &mut Workspace::new()).unwrap();
            let rounding = 16.0 * n as f64 * f64::EPSILON;
            for (b, m) in m.chunks_exact(n * n).enumerate() {
                let (w, u, faer) = (&w[b * n..][..n], &u[b * n * n..][..n * n], &faer[b * n..][..n]);
                let size = faer[0].abs().max(faer[n - 1].abs());
                for (k, u) in u.chunks_exact(n).enumerate() {
                    assert!((w[k] - faer[k]).abs() < rounding * size, "{n}, {k}: {} {}", w[k], faer[k]);
                    let rest =
                        m.chunks_exact(n).zip(u).fold(0.0, |m: f64, (row, x)| m.max((dot(row, u) - w[k] * x).abs()));
                    assert!(rest < rounding * size && (dot(u, u) - 1.0).abs() < rounding, "{n}, {k}: {rest}");
                }
            }
        }
    }
}
