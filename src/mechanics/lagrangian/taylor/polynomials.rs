//! Products of polynomials up to the second degree, in the coefficients of their monomials.

use crate::scalar::{Real, Scalar};

/// Largest degree that is kept.
pub(super) const DEGREE: usize = 2;

/// Number of the monomials of `n` variables up to a degree of at most 2: `1`, then `x_i`, then `x_i x_j` with `j <= i`.
pub(super) fn count(n: usize, degree: usize) -> usize {
    match degree {
        0 => 1,
        1 => 1 + n,
        _ => (n + 1) * (n + 2) / 2,
    }
}

/// Place of `x_i x_j`.
pub(super) fn pair(n: usize, i: usize, j: usize) -> usize {
    let (i, j) = (i.max(j), i.min(j));
    1 + n + i * (i + 1) / 2 + j
}

/// Degrees of a polynomial in velocities and in positions, each at most 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Degrees {
    pub velocities: usize,
    pub positions: usize,
}

impl Degrees {
    /// Of a sum.
    pub fn of_sum(self, other: Self) -> Self {
        Self { velocities: self.velocities.max(other.velocities), positions: self.positions.max(other.positions) }
    }
    /// Of a product.
    pub fn of_product(self, other: Self) -> Self {
        Self {
            velocities: DEGREE.min(self.velocities + other.velocities),
            positions: DEGREE.min(self.positions + other.positions),
        }
    }
    /// Of a power series in it.
    pub fn of_series(self) -> Self {
        let all = |degree: usize| if degree > 0 { DEGREE } else { 0 };
        Self { velocities: all(self.velocities), positions: all(self.positions) }
    }
    /// Largest total degree of a power of it that is kept.
    pub fn total(self) -> usize {
        let all = self.of_series();
        all.velocities + all.positions
    }
}

/// Numbers of variables: a polynomial is one block of coefficients by the positions for each monomial of the velocities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Variables {
    pub velocities: usize,
    pub positions: usize,
}

impl Variables {
    /// Coefficients of a polynomial.
    pub fn size(self, degrees: Degrees) -> usize {
        count(self.velocities, degrees.velocities) * self.block(degrees)
    }
    /// Coefficients of a block.
    pub fn block(self, degrees: Degrees) -> usize {
        count(self.positions, degrees.positions)
    }

    /// `out += factor a`, `out` of degrees at least those of `a`.
    pub fn add_scaled<S: Scalar>(self, factor: S, (a, from): (&[S], Degrees), (out, to): (&mut [S], Degrees)) {
        let blocks = a.chunks_exact(self.block(from)).zip(out.chunks_exact_mut(self.block(to)));
        for (a, out) in blocks {
            out.iter_mut().zip(a).for_each(|(out, &a)| *out += factor * a);
        }
    }

    /// `out = a b`, cut off at the degrees of `out`, which are [`Degrees::of_product`] or more.
    pub fn multiply<S: Scalar>(
        self,
        (a, of_a): (&[S], Degrees),
        (b, of_b): (&[S], Degrees),
        (out, to): (&mut [S], Degrees),
    ) {
        out.fill(<S as Real>::zero());
        let (wide_a, wide_b, wide) = (self.block(of_a), self.block(of_b), self.block(to));
        let empty = |block: &[S]| block.iter().all(|&x| x == <S as Real>::zero());
        let n = self.velocities;
        for (p, a) in a.chunks_exact(wide_a).enumerate() {
            if empty(a) {
                continue;
            }
            // What the monomial `p` may be multiplied by.
            let others = match p {
                0 => count(n, of_b.velocities),
                _ if p <= n => count(n, of_b.velocities.min(1)),
                _ => 1,
            };
            for (r, b) in b.chunks_exact(wide_b).enumerate().take(others) {
                if empty(b) {
                    continue;
                }
                let place = match (p, r) {
                    (0, place) | (place, 0) => place,
                    _ => pair(n, p - 1, r - 1),
                };
                accumulate(self.positions, a, b, &mut out[place * wide..(place + 1) * wide]);
            }
        }
    }
}

/// `out += a b` for coefficients by the positions.
fn accumulate<S: Scalar>(n: usize, a: &[S], b: &[S], out: &mut [S]) {
    let (first, second) = (a[0], b[0]);
    out.iter_mut().zip(b).for_each(|(out, &b)| *out += first * b);
    out.iter_mut().zip(a).skip(1).for_each(|(out, &a)| *out += a * second);
    if a.len() == 1 || b.len() == 1 {
        return;
    }
    let (a, b) = (&a[1..=n], &b[1..=n]);
    let mut rest = &mut out[1 + n..];
    for i in 0..n {
        let (row, after) = rest.split_at_mut(i + 1);
        for ((out, &aj), &bj) in row[..i].iter_mut().zip(a).zip(b) {
            *out += a[i] * bj + aj * b[i];
        }
        row[i] += a[i] * b[i];
        rest = after;
    }
}
