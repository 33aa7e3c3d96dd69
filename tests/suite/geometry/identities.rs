//! Identities that every metric obeys, on random metrics: derivatives against nested forward numbers and differences, symmetries,
//! both Bianchi identities, invariance under a change of coordinates.

use super::spaces::dd;
use crate::common::properties;
use lnn::forward::HyperDual;
use lnn::geometry::Geometry;
use lnn::lagrangian::{EulerLagrange, Lagrangian, Mechanics, MechanicsError, Request, Terms};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::VectorFunction;
use proptest::prelude::*;

/// `L = v^T B eta B^T v / 2 - V(q)`, `B_ij = delta_ij + 0.4/n sin(q.w_ij)`, in coordinates `q_i = y_i + bend sin(y_i+1)/4`.
#[derive(Clone, Debug)]
struct Random {
    n: usize,
    lorentzian: bool,
    bend: f64,
    seed: f64,
}

impl Random {
    fn wave<R: Real>(&self, k: usize, q: &[R]) -> R {
        let weight = |i: usize| R::of((self.seed + 1.7 * (k * self.n + i) as f64).sin());
        q.iter().enumerate().fold(R::of(0.3 * k as f64), |sum, (i, &q)| sum + weight(i) * q)
    }
    /// The coordinates `q` and their velocities.
    fn unbent<R: Real>(&self, y: &[R], v: &[R]) -> (Vec<R>, Vec<R>) {
        let bend = R::of(self.bend / 4.0);
        let next = |i: usize| (i + 1) % self.n;
        let q = (0..self.n).map(|i| y[i] + bend * y[next(i)].sin()).collect();
        (q, (0..self.n).map(|i| v[i] + bend * y[next(i)].cos() * v[next(i)]).collect())
    }
}

impl Lagrangian for Random {
    fn coordinates(&self) -> usize {
        self.n
    }
    fn lagrangian<R: Real>(&self, _: &[R], y: &[R], v: &[R]) -> R {
        let ((q, v), n) = (self.unbent(y, v), self.n);
        let mut sum = -self.wave(n * n, &q).cos();
        for k in 0..n {
            let along = (0..n).fold(R::zero(), |sum, i| {
                let small = R::of(0.4 / n as f64) * self.wave(i * n + k, &q).sin();
                sum + v[i] * if i == k { R::one() + small } else { small }
            });
            let square = along * along * R::half();
            sum = if self.lorentzian && k == 0 { sum - square } else { sum + square };
        }
        sum
    }
}

fn point<S: Scalar>(n: usize, seed: f64) -> Vec<S> {
    (0..n).map(|i| S::of_f64((seed * 3.1 + 2.3 * i as f64).cos())).collect()
}

fn at(random: &Random, q: &[Dd]) -> Geometry<Dd> {
    let model = Mechanics::new(random.clone(), Vec::new());
    Geometry::of(&model, q, &vec![dd(0.0); q.len()]).unwrap().remove(0).unwrap()
}

/// Central difference of order 6 of several numbers along coordinate `k`, good to about 1e-20.
fn difference(q: &[Dd], k: usize, f: impl Fn(&[Dd]) -> Vec<Dd>) -> Vec<Dd> {
    let h = dd(1e-4);
    let moved = |steps: f64| {
        let mut q = q.to_vec();
        q[k] += dd(steps) * h;
        f(&q)
    };
    let odd = |steps: f64| moved(steps).into_iter().zip(moved(-steps)).map(|(a, b)| a - b).collect::<Vec<Dd>>();
    let [one, two, three] = [1.0, 2.0, 3.0].map(odd);
    (0..one.len()).map(|i| (one[i] * dd(45.0) - two[i] * dd(9.0) + three[i]) / (dd(60.0) * h)).collect()
}

fn any_metric() -> impl Strategy<Value = Random> {
    (1usize..=5, any::<bool>(), 0f64..6.0, any::<bool>()).prop_map(|(n, lorentzian, seed, bent)| Random {
        n,
        lorentzian,
        bend: if bent && n > 1 { 1.0 } else { 0.0 },
        seed,
    })
}

proptest! {
    #![proptest_config(properties(24))]

    /// `d4 L / dv_i dv_j dq_k dq_l` by numbers nested twice.
    #[test]
    fn jets_are_fourth_derivatives(random in any_metric()) {
        type Nested = HyperDual<HyperDual<f64>>;
        let n = random.n;
        let q: Vec<f64> = point(n, random.seed);
        let v: Vec<f64> = point(n, random.seed + 1.0);
        let model = Mechanics::new(random.clone(), Vec::new());
        let jet = &model.metric_jets(&q, &v).unwrap()[0];
        let zero = HyperDual::lift(0.0);
        let unit = |on: bool| if on { 1.0 } else { 0.0 };
        for (i, j, k, l) in [(0, 0, 0, 0), (n - 1, 0, 0, n - 1), (n / 2, n - 1, n / 2, n - 1), (0, n / 2, n - 1, n - 1)] {
            let velocity = |(m, &v): (usize, &f64)| {
                Nested::new(HyperDual::lift(v), HyperDual::lift(unit(m == i)), HyperDual::lift(unit(m == j)), zero)
            };
            let position = |(m, &q): (usize, &f64)| Nested::lift(HyperDual::new(q, unit(m == k), unit(m == l), 0.0));
            let (q, v): (Vec<Nested>, Vec<Nested>) =
                (q.iter().enumerate().map(position).collect(), v.iter().enumerate().map(velocity).collect());
            let exact = random.lagrangian(&[], &q, &v).st;
            let first = |m: usize| jet.first[(m * n + i) * n + j];
            let found = [jet.metric[i * n + j], first(k), first(l), jet.second[((k * n + l) * n + i) * n + j]];
            for (found, exact) in found.into_iter().zip([exact.value, exact.s, exact.t, exact.st]) {
                prop_assert!((found - exact).abs() < 1e-13, "{found} {exact}");
            }
        }
    }

    /// `R^a_bcd` by differences of the Christoffel symbols, these by the equation `d_k g_ij = G_ikj + G_jki`.
    #[test]
    fn curvature_is_that_of_the_connection(random in any_metric()) {
        let (n, q) = (random.n, point::<Dd>(random.n, random.seed));
        let found = at(&random, &q);
        let symbol = |a: usize, b: usize, c: usize| found.connection.symbols[(a * n + b) * n + c];
        let moved: Vec<Vec<Dd>> = (0..n).map(|k| difference(&q, k, |q| at(&random, q).connection.symbols)).collect();
        let metrics: Vec<Vec<Dd>> = (0..n).map(|k| difference(&q, k, |q| at(&random, q).metric.components)).collect();
        let down = |a: usize, b: usize, c: usize| found.connection.lowered[(a * n + b) * n + c];
        for place in 0..n.pow(4) {
            let (a, b, c, d) = (place / n.pow(3), place / n.pow(2) % n, place / n % n, place % n);
            let partial = moved[c][(a * n + b) * n + d] - moved[d][(a * n + b) * n + c];
            let exact = (0..n).fold(partial, |sum, e| {
                sum + symbol(a, c, e) * symbol(e, b, d) - symbol(a, d, e) * symbol(e, b, c)
            });
            prop_assert!((found.curvature.riemann[place] - exact).abs().to_f64() < 1e-18);
            let compatible = metrics[c][a * n + b] - down(a, c, b) - down(b, c, a);
            prop_assert!(compatible.abs().to_f64() < 1e-18);
        }
    }

    /// Symmetries to the bit, the first Bianchi identity to rounding, the contracted second one by differences.
    #[test]
    fn bianchis_identities_hold(random in any_metric()) {
        let (n, q) = (random.n, point::<Dd>(random.n, random.seed));
        let found = at(&random, &q);
        let r = |a: usize, b: usize, c: usize, d: usize| found.curvature.lowered[((a * n + b) * n + c) * n + d];
        for place in 0..n.pow(4) {
            let (a, b, c, d) = (place / n.pow(3), place / n.pow(2) % n, place / n % n, place % n);
            prop_assert_eq!(r(a, b, c, d), -r(b, a, c, d));
            prop_assert_eq!(r(a, b, c, d), -r(a, b, d, c));
            prop_assert_eq!(r(a, b, c, d), r(c, d, a, b));
            prop_assert!((r(a, b, c, d) + r(a, c, d, b) + r(a, d, b, c)).abs().to_f64() < 1e-29);
        }
        let mixed = |found: &Geometry<Dd>| -> Vec<Dd> {
            let einstein = &found.curvature.einstein;
            let row = |a: usize, b: usize| (0..n).fold(dd(0.0), |sum, c| sum + found.metric.inverse[a * n + c] * einstein[c * n + b]);
            (0..n * n).map(|ab| row(ab / n, ab % n)).collect()
        };
        let moved: Vec<Vec<Dd>> = (0..n).map(|k| difference(&q, k, |q| mixed(&at(&random, q)))).collect();
        let einstein = mixed(&found);
        let symbol = |a: usize, b: usize, c: usize| found.connection.symbols[(a * n + b) * n + c];
        for b in 0..n {
            let mut divergence = dd(0.0);
            for a in 0..n {
                divergence += moved[a][a * n + b];
                for c in 0..n {
                    divergence += symbol(a, a, c) * einstein[c * n + b] - symbol(c, a, b) * einstein[a * n + c];
                }
            }
            prop_assert!(divergence.abs().to_f64() < 1e-18, "{}", divergence);
        }
    }

    /// Weyl's tensor has no trace and is what a conformal factor leaves alone (with its first index up).
    #[test]
    fn weyls_tensor_is_free_of_traces(random in any_metric()) {
        let (n, q) = (random.n, point::<Dd>(random.n, random.seed));
        let found = at(&random, &q);
        let weyl = &found.curvature.weyl;
        let size = weyl.iter().map(|x| x.abs().to_f64()).fold(0.0, f64::max);
        prop_assert!((n > 3) == (size > 1e-6), "{n} {size}");
        for bd in 0..n * n {
            let trace = (0..n * n).fold(dd(0.0), |sum, ac| {
                sum + found.metric.inverse[ac] * weyl[((ac / n * n + bd / n) * n + ac % n) * n + bd % n]
            });
            prop_assert!(trace.abs().to_f64() < 1e-28, "{}", trace);
        }
    }

    /// The invariants at a point do not depend on the coordinates.
    #[test]
    fn invariants_do_not_see_the_coordinates(mut random in any_metric()) {
        random.bend = if random.n > 1 { 1.0 } else { 0.0 };
        let straight = Random { bend: 0.0, ..random.clone() };
        let y = point::<Dd>(random.n, random.seed);
        let (q, _) = random.unbent(&y, &y);
        let (bent, straight) = (at(&random, &y), at(&straight, &q));
        let invariants = |found: &Geometry<Dd>| [found.curvature.scalar, found.curvature.kretschmann];
        for (a, b) in invariants(&bent).into_iter().zip(invariants(&straight)) {
            prop_assert!((a - b).abs().to_f64() < 1e-26 * (1.0 + b.abs().to_f64()), "{} {}", a, b);
        }
        prop_assert_eq!(bent.metric.signature, straight.metric.signature);
    }
}

/// A field that is constant in Cartesian coordinates, in polar ones.
#[test]
fn a_constant_field_has_no_covariant_derivative() {
    struct Plane;
    impl Lagrangian for Plane {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            (v[0].sqr() + (q[0] * v[1]).sqr()) * R::half()
        }
    }
    struct Eastward;
    impl VectorFunction for Eastward {
        fn outputs(&self) -> usize {
            2
        }
        fn eval<R: Real>(&self, q: &[R], out: &mut [R]) {
            (out[0], out[1]) = (q[1].cos(), -q[1].sin() / q[0]);
        }
    }
    let q = [1.5, 0.7];
    let found = Geometry::of(&Mechanics::new(Plane, Vec::new()), &q, &[0.0; 2]).unwrap().remove(0).unwrap();
    let derivative = found.connection.covariant_derivative_of(&Eastward, &q).unwrap();
    assert!(derivative.iter().all(|x: &f64| x.abs() < 1e-15), "{derivative:?}");
    // Along the angle the plain components do change.
    let turned = found.connection.covariant_derivative(&[0.0, 1.0], &[0.0; 4]).unwrap();
    assert_eq!(turned, [0.0, -1.5, 1.0 / 1.5, 0.0]);
}

/// More velocities than are taken at a time.
#[test]
fn many_coordinates_are_taken_in_groups() {
    let random = Random { n: 11, lorentzian: true, bend: 1.0, seed: 0.3 };
    let (n, q) = (random.n, point::<f64>(11, 0.4));
    let model = Mechanics::new(random.clone(), Vec::new());
    let jet = &model.metric_jets(&q, &vec![0.0; n]).unwrap()[0];
    let mut terms = Terms::default();
    model.terms(&q, &vec![0.0; n], Request::MASS_MATRIX, &mut terms).unwrap();
    let close = |a: f64, b: f64| (a - b).abs() < 1e-13;
    assert!(jet.metric.iter().zip(&terms.mass_matrix).all(|(&a, &b)| close(a, b)));
    let wide: Vec<Dd> = q.iter().map(|&x| dd(x)).collect();
    let judge = Mechanics::new(random, Vec::new());
    let slope = difference(&wide, 9, |q| judge.metric_jets(q, &vec![dd(0.0); n]).unwrap().remove(0).first);
    for (k, slope) in slope.iter().enumerate() {
        assert!(close(jet.second[9 * n.pow(3) + k], slope.to_f64()), "{k}");
    }
}

/// A Lagrangian that is not quadratic has the metric of the velocity it is taken at; one that branches has none.
#[test]
fn velocities_and_branches() {
    struct Free;
    impl Lagrangian for Free {
        fn coordinates(&self) -> usize {
            1
        }
        /// `-sqrt(1 - v^2)`, `M = (1 - v^2)^(-3/2)`.
        fn lagrangian<R: Real>(&self, _: &[R], _: &[R], v: &[R]) -> R {
            -(R::one() - v[0].sqr()).sqrt()
        }
    }
    let free = Mechanics::new(Free, Vec::new());
    for (v, exact) in [(0.0, 1.0), (0.6, 0.8f64.powi(-3))] {
        let found = Geometry::of(&free, &[0.0], &[v]).unwrap().remove(0).unwrap();
        assert!((found.metric.components[0] - exact).abs() < 1e-15);
    }
    struct Branch;
    impl Lagrangian for Branch {
        fn coordinates(&self) -> usize {
            1
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            if q[0].primal() > R::Scalar::of_f64(0.0) { v[0].sqr() } else { v[0].sqr() * R::half() }
        }
    }
    let refused = Mechanics::new(Branch, Vec::new()).metric_jets(&[1.0f64], &[0.0]);
    assert!(matches!(refused, Err(MechanicsError::Derivatives { .. })));
}
