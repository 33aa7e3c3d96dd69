//! Metric, Levi-Civita connection and curvature at a point.

use super::GeometryError;
use crate::lagrangian::MetricJet;
use crate::linalg::{Inertia, LinalgError, Workspace, inertia, inverse, leading_minors};
use crate::scalar::{Real, Scalar};
use crate::tape::{VectorFunction, jacobian};
use alloc::vec::Vec;

/// Metric at a point, not degenerate.
#[derive(Clone, Debug, PartialEq)]
pub struct Metric<S> {
    n: usize,
    /// `g_ij`, `(n, n)`, symmetric.
    pub components: Vec<S>,
    /// `g^ij`, `(n, n)`, symmetric.
    pub inverse: Vec<S>,
    /// `det g`.
    pub determinant: S,
    /// Numbers of negative and positive eigenvalues; none is zero.
    pub signature: Inertia,
}

/// `det` of a symmetric `(n, n)` matrix; `NaN` of one that is not finite.
pub(super) fn determinant<S: Scalar>(n: usize, matrix: &[S]) -> S {
    let mut minors = Vec::with_capacity(n);
    match leading_minors(n, matrix, &mut minors, &mut Workspace::new()) {
        Ok(()) => minors.last().map_or_else(<S as Real>::one, |minor| minor.value()),
        Err(_) => S::nan(),
    }
}

impl<S: Scalar> Metric<S> {
    /// The metric of `n` coordinates by its components, `(n, n)`, symmetric.
    ///
    /// # Errors
    /// [`GeometryError::Shape`], [`GeometryError::NotFinite`]; [`GeometryError::Degenerate`] where it is singular to working
    /// precision in any units of the coordinates.
    pub fn new(n: usize, components: &[S]) -> Result<Self, GeometryError> {
        super::expect_length("metric", n * n, components.len())?;
        let mut found = vec![S::nan(); n * n];
        inverse(n, components, &mut found, &mut Workspace::new()).map_err(explain)?;
        let signature = inertia(n, components, &mut vec![S::nan(); n * n]).map_err(explain)?;
        if signature.zero > 0 {
            return Err(GeometryError::Degenerate { condition: f64::INFINITY });
        }
        let determinant = determinant(n, components);
        Ok(Self { n, components: components.to_vec(), inverse: found, determinant, signature })
    }

    /// The metric in another number type.
    pub(super) fn rounded<T: Scalar>(&self) -> Metric<T> {
        Metric {
            n: self.n,
            components: rounded(&self.components),
            inverse: rounded(&self.inverse),
            determinant: self.determinant.cast(),
            signature: self.signature,
        }
    }

    /// Number of coordinates `n`.
    pub(crate) fn coordinates(&self) -> usize {
        self.n
    }

    /// `u_i = g_ij u^j`, `(n)`.
    pub fn lower(&self, vector: &[S]) -> Vec<S> {
        self.components.chunks_exact(self.n).map(|row| dot(row.iter().copied(), vector.iter().copied())).collect()
    }

    /// `u^i = g^ij u_j`, `(n)`.
    pub fn raise(&self, covector: &[S]) -> Vec<S> {
        self.inverse.chunks_exact(self.n).map(|row| dot(row.iter().copied(), covector.iter().copied())).collect()
    }

    /// `g(u, w) = g_ij u^i w^j`.
    pub fn product(&self, u: &[S], w: &[S]) -> S {
        dot(u.iter().copied(), self.lower(w))
    }
}

fn explain(error: LinalgError) -> GeometryError {
    match error {
        LinalgError::Singular { condition, .. } => GeometryError::Degenerate { condition },
        LinalgError::NotFinite { .. } => GeometryError::NotFinite { what: "the metric" },
        LinalgError::Shape { what, expected, found } => GeometryError::Shape { what, expected, found },
    }
}

/// Christoffel symbols at a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Connection<S> {
    n: usize,
    /// `G_kij = (d_i g_kj + d_j g_ki - d_k g_ij)/2` at `[k][i][j]`, `(n, n, n)`, all indices down.
    pub lowered: Vec<S>,
    /// `G^k_ij = g^kl G_lij` at `[k][i][j]`, `(n, n, n)`, symmetric in `i`, `j`.
    pub symbols: Vec<S>,
}

impl<S: Scalar> Connection<S> {
    /// The connection of a metric with first derivatives.
    pub(crate) fn new(jet: &MetricJet<S>, metric: &Metric<S>) -> Self {
        let n = metric.coordinates();
        let d = |k: usize, i: usize, j: usize| jet.first[(k * n + i) * n + j];
        let mut lowered = vec![<S as Real>::zero(); n * n * n];
        for k in 0..n {
            for i in 0..n {
                for j in 0..=i {
                    let symbol = (d(i, k, j) + d(j, k, i) - d(k, i, j)) * <S as Real>::half();
                    (lowered[(k * n + i) * n + j], lowered[(k * n + j) * n + i]) = (symbol, symbol);
                }
            }
        }
        let symbols = move_first(n, &metric.inverse, &lowered);
        Self { n, lowered, symbols }
    }

    /// The connection in another number type.
    pub(super) fn rounded<T: Scalar>(&self) -> Connection<T> {
        Connection { n: self.n, lowered: rounded(&self.lowered), symbols: rounded(&self.symbols) }
    }

    /// Covariant derivative `V^a_;b = d_b V^a + G^a_bc V^c` at `[a][b]`, `(n, n)`, of a vector field with the components
    /// `vector`, `(n)`, and their partial derivatives `d_b V^a` at `[a][b]`, `(n, n)`.
    ///
    /// # Errors
    /// [`GeometryError::Shape`].
    pub fn covariant_derivative(&self, vector: &[S], partial: &[S]) -> Result<Vec<S>, GeometryError> {
        let n = self.n;
        super::expect_length("vector", n, vector.len())?;
        super::expect_length("partial derivatives", n * n, partial.len())?;
        let turned = self.symbols.chunks_exact(n).map(|row| dot(row.iter().copied(), vector.iter().copied()));
        Ok(partial.iter().zip(turned).map(|(&partial, turned)| partial + turned).collect())
    }

    /// Covariant derivative of a field given as a function of the coordinates, differentiated at `q`, `(n)`.
    ///
    /// # Errors
    /// [`GeometryError::Shape`] if the field has not `n` components or `q` not `n` numbers; [`GeometryError::NotFinite`] if it
    /// cannot be differentiated.
    pub fn covariant_derivative_of(&self, field: &impl VectorFunction, q: &[S]) -> Result<Vec<S>, GeometryError> {
        super::expect_length("coordinates", self.n, q.len())?;
        super::expect_length("vector field", self.n, field.outputs())?;
        let (vector, partial) =
            jacobian(field, q).map_err(|_| GeometryError::NotFinite { what: "the derivative of the field" })?;
        self.covariant_derivative(&vector, &partial)
    }
}

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

    /// The curvature in another number type.
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

    /// Sectional curvature `R_abcd u^a w^b u^c w^d / (g(u, u) g(w, w) - g(u, w)^2)` of the plane of `u` and `w`: 1 on the unit sphere.
    /// `NaN` or infinite for a null plane.
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
fn move_first<S: Scalar>(n: usize, h: &[S], tensor: &[S]) -> Vec<S> {
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
fn move_second<S: Scalar>(n: usize, h: &[S], tensor: &[S]) -> Vec<S> {
    tensor.chunks_exact(tensor.len() / n).flat_map(|part| move_first(n, h, part)).collect()
}

/// The same numbers in another precision.
pub(super) fn rounded<S: Scalar, T: Scalar>(tensor: &[S]) -> Vec<T> {
    tensor.iter().map(|x| x.cast()).collect()
}
