//! Curvature at a point.

use super::{Connection, Metric};
use crate::lagrangian::MetricJet;
use crate::scalar::{Real, Scalar};

/// Curvature tensors at a point, in the conventions of Misner, Thorne and Wheeler.
#[derive(Clone, Debug, PartialEq)]
pub struct Curvature<S> {
    n: usize,
    /// `R_abcd` at `[a][b][c][d]`, `(n, n, n, n)`; antisymmetric in `ab` and `cd` and symmetric between them to the bit.
    pub lowered: Vec<S>,
    /// `R^a_bcd = d_c G^a_bd - d_d G^a_bc + G^a_ce G^e_bd - G^a_de G^e_bc` at `[a][b][c][d]`, `(n, n, n, n)`.
    pub riemann: Vec<S>,
    /// `R_bd = R^a_bad`, `(n, n)`, symmetric.
    pub ricci: Vec<S>,
    /// `R = g^bd R_bd`: 2 on the unit sphere.
    pub scalar: S,
    /// Einstein's tensor `G_ab = R_ab - g_ab R/2`, `(n, n)`; 0 for one and two coordinates, where it vanishes identically.
    pub einstein: Vec<S>,
    /// Weyl's tensor `C_abcd` at `[a][b][c][d]`, `(n, n, n, n)`, all indices down; 0 for three coordinates and fewer, where it
    /// vanishes identically or is not defined.
    ///
    /// ```text
    /// C_abcd = R_abcd - (g_ac R_bd - g_ad R_bc - g_bc R_ad + g_bd R_ac)/(n - 2) + R (g_ac g_bd - g_ad g_bc)/((n - 1)(n - 2))
    /// ```
    pub weyl: Vec<S>,
    /// Kretschmann's scalar `R_abcd R^abcd`: `48 M^2/r^6` outside a mass.
    pub kretschmann: S,
}

impl<S: Scalar> Curvature<S> {
    /// The curvature of a metric with first and second derivatives.
    ///
    /// ```text
    /// R_abcd = (d_b d_c g_ad + d_a d_d g_bc - d_a d_c g_bd - d_b d_d g_ac)/2 + G_ebc G^e_ad - G_ebd G^e_ac
    /// ```
    pub(crate) fn new(jet: &MetricJet<S>, metric: &Metric<S>, connection: &Connection<S>) -> Self {
        let n = metric.coordinates();
        let zero = <S as Real>::zero();
        let place = |a: usize, b: usize, c: usize, d: usize| ((a * n + b) * n + c) * n + d;
        let second = |k: usize, l: usize, i: usize, j: usize| jet.second[place(k, l, i, j)];
        let symbol = |of: &[S], k: usize, i: usize, j: usize| of[(k * n + i) * n + j];
        let Connection { lowered: down, symbols: up, .. } = connection;
        let mut lowered = vec![zero; n.pow(4)];
        let pairs = || (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
        for (a, b) in pairs() {
            for (c, d) in pairs().filter(|&(c, d)| (c, d) >= (a, b)) {
                let bent = second(b, c, a, d) + second(a, d, b, c) - second(a, c, b, d) - second(b, d, a, c);
                let turned = (0..n).fold(zero, |sum, e| {
                    sum + (symbol(down, e, b, c) * symbol(up, e, a, d) - symbol(down, e, b, d) * symbol(up, e, a, c))
                });
                let value = bent * <S as Real>::half() + turned;
                for (a, b, c, d) in [(a, b, c, d), (c, d, a, b)] {
                    (lowered[place(a, b, c, d)], lowered[place(b, a, d, c)]) = (value, value);
                    (lowered[place(b, a, c, d)], lowered[place(a, b, d, c)]) = (-value, -value);
                }
            }
        }
        let mut ricci = vec![zero; n * n];
        for b in 0..n {
            for d in 0..=b {
                let components = (0..n * n).map(|ac| lowered[place(ac / n, b, ac % n, d)]);
                let value = dot(metric.inverse.iter().copied(), components);
                (ricci[b * n + d], ricci[d * n + b]) = (value, value);
            }
        }
        let scalar = dot(metric.inverse.iter().copied(), ricci.iter().copied());
        let riemann = move_first(n, &metric.inverse, &lowered);
        let einstein = einstein(metric, &ricci, scalar);
        let weyl = weyl(metric, &lowered, &ricci, scalar);
        let kretschmann = kretschmann(metric, &riemann);
        Self { n, lowered, riemann, ricci, scalar, einstein, weyl, kretschmann }
    }

    /// The same in other numbers.
    pub(super) fn rounded<T: Scalar>(&self) -> Curvature<T> {
        Curvature {
            n: self.n,
            lowered: rounded(&self.lowered),
            riemann: rounded(&self.riemann),
            ricci: rounded(&self.ricci),
            scalar: self.scalar.cast(),
            einstein: rounded(&self.einstein),
            weyl: rounded(&self.weyl),
            kretschmann: self.kretschmann.cast(),
        }
    }

    /// Geodesic deviation `D^2 x^a/dt^2 = -R^a_bcd u^b x^c u^d`, `(n)`: relative acceleration of neighbours `x` apart that
    /// move with `u`.
    pub fn geodesic_deviation(&self, u: &[S], separation: &[S]) -> Vec<S> {
        let n = self.n;
        let last = |row: &[S]| dot(row.iter().copied(), u.iter().copied());
        let third = |part: &[S]| dot(part.chunks_exact(n).map(last), separation.iter().copied());
        let second = |part: &[S]| -dot(part.chunks_exact(n * n).map(third), u.iter().copied());
        self.riemann.chunks_exact(n * n * n).map(second).collect()
    }

    /// Sectional curvature `R_abcd u^a w^b u^c w^d / (g(u, u) g(w, w) - g(u, w)^2)` of the plane of `u` and `w`: 1 on the unit
    /// sphere. `NaN` or infinite of a plane that is null.
    pub fn sectional(&self, metric: &Metric<S>, u: &[S], w: &[S]) -> S {
        // g(w, R(u, w) u) is minus g(u, the deviation of w along ..): one contraction serves both.
        let turned = self.geodesic_deviation(w, u);
        let area = metric.product(u, u) * metric.product(w, w) - metric.product(u, w).sqr();
        -metric.product(u, &turned) / area
    }
}

/// [`Curvature::einstein`].
fn einstein<S: Scalar>(metric: &Metric<S>, ricci: &[S], scalar: S) -> Vec<S> {
    if metric.coordinates() <= 2 {
        return vec![<S as Real>::zero(); ricci.len()];
    }
    let half = scalar * <S as Real>::half();
    ricci.iter().zip(&metric.components).map(|(&r, &g)| r - half * g).collect()
}

/// [`Curvature::weyl`].
fn weyl<S: Scalar>(metric: &Metric<S>, lowered: &[S], r: &[S], scalar: S) -> Vec<S> {
    let (n, g) = (metric.coordinates(), &metric.components[..]);
    if n <= 3 {
        return vec![<S as Real>::zero(); lowered.len()];
    }
    let size = S::of_f64(n as f64);
    let (one, two) = (<S as Real>::one(), <S as Real>::two());
    let (traces, trace) = ((size - two).recip(), scalar / ((size - one) * (size - two)));
    let at = |of: &[S], i: usize, j: usize| of[i * n + j];
    let component = |(place, &whole): (usize, &S)| {
        let (a, b, c, d) = (place / n.pow(3), place / n.pow(2) % n, place / n % n, place % n);
        if a == b || c == d {
            return <S as Real>::zero();
        }
        let single = at(g, a, c) * at(r, b, d) - at(g, a, d) * at(r, b, c) - at(g, b, c) * at(r, a, d)
            + at(g, b, d) * at(r, a, c);
        let double = at(g, a, c) * at(g, b, d) - at(g, a, d) * at(g, b, c);
        whole - traces * single + trace * double
    };
    lowered.iter().enumerate().map(component).collect()
}

/// [`Curvature::kretschmann`]: `R^ab_cd R^cd_ab`, each pair of indices once.
fn kretschmann<S: Scalar>(metric: &Metric<S>, riemann: &[S]) -> S {
    let n = metric.coordinates();
    let mixed = move_second(n, &metric.inverse, riemann);
    let pairs = || (0..n).flat_map(|a| (a + 1..n).map(move |b| a * n + b));
    let product = |ab: usize| dot(pairs().map(|cd| mixed[ab * n * n + cd]), pairs().map(|cd| mixed[cd * n * n + ab]));
    let four = <S as Real>::two() * <S as Real>::two();
    four * pairs().fold(<S as Real>::zero(), |sum, ab| sum + product(ab))
}

/// `sum_k a_k b_k`.
pub(super) fn dot<S: Scalar>(a: impl IntoIterator<Item = S>, b: impl IntoIterator<Item = S>) -> S {
    a.into_iter().zip(b).fold(<S as Real>::zero(), |sum, (a, b)| sum + a * b)
}

/// `T^a_.. = h^ae T_e..` for the first of several indices, `h` `(n, n)`: raises with the inverse metric, lowers with the metric.
pub(super) fn move_first<S: Scalar>(n: usize, h: &[S], tensor: &[S]) -> Vec<S> {
    let size = tensor.len() / n;
    let mut moved = vec![<S as Real>::zero(); tensor.len()];
    for (out, row) in moved.chunks_exact_mut(size).zip(h.chunks_exact(n)) {
        for (part, &factor) in tensor.chunks_exact(size).zip(row) {
            // Diagonal metrics are common.
            if factor != <S as Real>::zero() {
                out.iter_mut().zip(part).for_each(|(out, &x)| *out += factor * x);
            }
        }
    }
    moved
}

/// [`move_first`] for the second index.
pub(super) fn move_second<S: Scalar>(n: usize, h: &[S], tensor: &[S]) -> Vec<S> {
    tensor.chunks_exact(tensor.len() / n).flat_map(|part| move_first(n, h, part)).collect()
}

/// The same numbers in another precision.
pub(super) fn rounded<S: Scalar, T: Scalar>(tensor: &[S]) -> Vec<T> {
    tensor.iter().map(|x| x.cast()).collect()
}
