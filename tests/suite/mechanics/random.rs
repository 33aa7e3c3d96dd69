//! Random smooth Lagrangians, Riemannian and Lorentzian: closed forms, the energy identity, gauge invariance.

use crate::common::properties;
use lnn::forward::{Dual, HyperDual};
use lnn::lagrangian::{EulerLagrange, Lagrangian, Mechanics, Request, Terms};
use lnn::linalg::{self, Inertia, Workspace};
use lnn::scalar::{Dd, Real, Scalar};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// `L = s (v^T G(q) v / 2 + A(q).v - V(q) + quartic sum v_i^4) + d/dt sin(w.q)`, `G = B eta B^T`,
/// `B_ij = delta_ij + 0.3/n sin(b_ij.q + f_ij)`, `A_i = sin(a_i.q)`, `V = cos(u.q)`.
#[derive(Clone, Debug)]
struct Smooth {
    n: usize,
    lorentzian: bool,
    quartic: f64,
    scale: f64,
    gauge: bool,
    waves: Vec<f64>,
}

impl Smooth {
    fn new(n: usize, lorentzian: bool, quartic: f64, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let waves = (0..(n * n + n + 2) * (n + 1)).map(|_| rng.random_range(-1.0..1.0)).collect();
        Self { n, lorentzian, quartic, scale: 1.0, gauge: false, waves }
    }
    /// Phase of wave `k`.
    fn phase<R: Real>(&self, k: usize, q: &[R]) -> R {
        let wave = &self.waves[k * (self.n + 1)..];
        q.iter().zip(wave).fold(R::of(wave[self.n]), |sum, (&q, &w)| sum + R::of(w) * q)
    }
    fn eta<R: Real>(&self, k: usize) -> R {
        if self.lorentzian && k == 0 { -R::one() } else { R::one() }
    }
    fn frame<R: Real>(&self, q: &[R]) -> Vec<R> {
        let n = self.n;
        (0..n * n)
            .map(|k| {
                let small = R::of(0.3 / n as f64) * self.phase(k, q).sin();
                if k % (n + 1) == 0 { R::one() + small } else { small }
            })
            .collect()
    }
    /// `G` and its derivatives `dG/dq_k`, `(n, n, n)` with `k` first.
    fn metric<R: Real>(&self, q: &[R]) -> (Vec<R>, Vec<R>) {
        let n = self.n;
        let b = self.frame(q);
        let db = |k: usize, i: usize, j: usize| {
            let wave = R::of(0.3 / n as f64 * self.waves[(i * n + j) * (n + 1) + k]);
            wave * self.phase(i * n + j, q).cos()
        };
        let (mut g, mut dg) = (vec![R::zero(); n * n], vec![R::zero(); n * n * n]);
        for i in 0..n {
            for j in 0..n {
                for l in 0..n {
                    g[i * n + j] += self.eta::<R>(l) * b[i * n + l] * b[j * n + l];
                    for k in 0..n {
                        let change = db(k, i, l) * b[j * n + l] + b[i * n + l] * db(k, j, l);
                        dg[(k * n + i) * n + j] += self.eta::<R>(l) * change;
                    }
                }
            }
        }
        (g, dg)
    }
    /// `M`, `g`, `c` by formulas of its own.
    fn closed<R: Real>(&self, q: &[R], v: &[R]) -> (Vec<R>, Vec<R>, Vec<R>) {
        let n = self.n;
        let (mut m, dg) = self.metric(q);
        let wave = |k: usize, i: usize| R::of(self.waves[k * (n + 1) + i]);
        let (mut force, mut coriolis) = (vec![R::zero(); n], vec![R::zero(); n]);
        for k in 0..n {
            m[k * n + k] += R::of(12.0 * self.quartic) * v[k].sqr();
            force[k] += wave(n * n + n, k) * self.phase(n * n + n, q).sin();
            for i in 0..n {
                let slope = wave(n * n + i, k) * self.phase(n * n + i, q).cos();
                force[k] += slope * v[i];
                coriolis[i] += slope * v[k];
                for j in 0..n {
                    let term = dg[(k * n + i) * n + j] * v[j];
                    force[k] += R::half() * term * v[i];
                    coriolis[i] += term * v[k];
                }
            }
        }
        (m, force, coriolis)
    }
}

impl Lagrangian for Smooth {
    fn coordinates(&self) -> usize {
        self.n
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        let n = self.n;
        let b = self.frame(q);
        let mut sum = -self.phase(n * n + n, q).cos();
        for l in 0..n {
            let speed = (0..n).fold(R::zero(), |s, i| s + b[i * n + l] * v[i]);
            sum += R::half() * self.eta::<R>(l) * speed.sqr();
            sum += self.phase(n * n + l, q).sin() * v[l] + R::of(self.quartic) * v[l].sqr().sqr();
        }
        sum = R::of(self.scale) * sum;
        if self.gauge {
            let wave = &self.waves[(n * n + n + 1) * (n + 1)..];
            let rate = v.iter().zip(wave).fold(R::zero(), |s, (&v, &w)| s + R::of(w) * v);
            sum += self.phase(n * n + n + 1, q).cos() * rate;
        }
        sum
    }
}

fn state(n: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(!seed);
    let mut draw = || (0..n).map(|_| rng.random_range(-3.0..3.0)).collect();
    (draw(), draw())
}

fn terms<S: Scalar>(system: &Smooth, q: &[S], v: &[S]) -> Terms<S> {
    let mut terms = Terms::default();
    Mechanics::new(system.clone(), Vec::new()).terms(q, v, Request::ALL, &mut terms).unwrap();
    terms
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, x| m.max(x.abs()))
}

fn kappa(n: usize, m: &[f64]) -> f64 {
    linalg::condition_number(n, m, &mut Workspace::new()).unwrap()
}

proptest! {
    #![proptest_config(properties(96))]

    #[test]
    fn accelerations_agree_with_closed_forms(n in 1usize..=6, lorentzian: bool, quartic: bool, seed: u64) {
        let system = Smooth::new(n, lorentzian, if quartic && !lorentzian { 0.05 } else { 0.0 }, seed);
        let (q, v) = state(n, seed);
        let found = terms(&system, &q, &v);
        let wide = |x: &[f64]| -> Vec<Dd> { x.iter().map(|&x| Dd::of_f64(x)).collect() };
        let (m, g, c) = system.closed(&wide(&q), &wide(&v));
        let force: Vec<Dd> = g.iter().zip(&c).map(|(&g, &c)| g - c).collect();
        let mut a = force.clone();
        linalg::solve(n, &m, &force, &mut a, &mut Workspace::new()).unwrap();
        let narrow = |x: &[Dd]| -> Vec<f64> { x.iter().map(|x| x.to_f64()).collect() };
        let condition = kappa(n, &narrow(&m));
        // Sums of n^3 terms of size v^2 at most.
        let unit = f64::EPSILON * (n * n) as f64 * (1.0 + largest(&v).powi(2));
        for (name, x, y, unit) in [
            ("M", &found.mass_matrix, &narrow(&m), unit),
            ("g", &found.dl_dq, &narrow(&g), unit),
            ("c", &found.coriolis, &narrow(&c), unit),
            ("a", &found.acceleration, &narrow(&a), unit * condition * (1.0 + largest(&narrow(&a)))),
        ] {
            for (x, y) in x.iter().zip(y) {
                prop_assert!((x - y).abs() < 30.0 * unit, "{name}: {x} {y}");
            }
        }
        let inertia = linalg::inertia(n, &found.mass_matrix, &mut vec![0.0; n * n]).unwrap();
        let negative = usize::from(lorentzian);
        prop_assert_eq!(inertia, Inertia { positive: n - negative, zero: 0, negative });
    }

    #[test]
    fn energy_is_conserved(n in 1usize..=6, lorentzian: bool, quartic: bool, seed: u64) {
        let system = Smooth::new(n, lorentzian, if quartic && !lorentzian { 0.05 } else { 0.0 }, seed);
        let (q, v) = state(n, seed);
        let found = terms(&system, &q, &v);
        // dE/dt = sum_i v_i dp_i/dt - dL/dq . v, every derivative along (v, a) by forward numbers of its own.
        let flow: Vec<HyperDual<f64>> = q.iter().zip(&v).map(|(&q, &v)| HyperDual::new(q, 0.0, v, 0.0)).collect();
        let mut rate = 0.0;
        for i in 0..n {
            let speeds: Vec<HyperDual<f64>> = (0..n)
                .map(|j| HyperDual::new(v[j], f64::from(u8::from(i == j)), found.acceleration[j], 0.0))
                .collect();
            rate += v[i] * system.lagrangian(&[], &flow, &speeds).st;
        }
        let along: Vec<Dual<f64>> = q.iter().zip(&v).map(|(&q, &v)| Dual::new(q, v)).collect();
        let still: Vec<Dual<f64>> = v.iter().map(|&v| Dual::lift(v)).collect();
        rate -= system.lagrangian(&[], &along, &still).tangent;
        let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x * y).abs()).sum::<f64>();
        let scale = dot(&found.momentum, &found.acceleration) + dot(&found.dl_dq, &v) + found.energy[0].abs();
        prop_assert!(rate.abs() <= 100.0 * f64::EPSILON * kappa(n, &found.mass_matrix) * scale, "{rate:e} {scale}");
    }

    #[test]
    fn gauge_and_scale_change_no_acceleration(n in 1usize..=6, lorentzian: bool, scale in 0.1..10.0, seed: u64) {
        let system = Smooth::new(n, lorentzian, 0.0, seed);
        let (q, v) = state(n, seed);
        let plain = terms(&system, &q, &v);
        let changed = terms(&Smooth { scale, gauge: true, ..system }, &q, &v);
        let parts = largest(&changed.dl_dq) + largest(&changed.coriolis);
        let inverse = kappa(n, &changed.mass_matrix) / largest(&changed.mass_matrix);
        let unit = f64::EPSILON * kappa(n, &plain.mass_matrix) * (largest(&plain.acceleration) + parts * inverse);
        for (a, b) in plain.acceleration.iter().zip(&changed.acceleration) {
            prop_assert!((a - b).abs() <= 30.0 * n as f64 * unit, "{a} {b}");
        }
        prop_assert!(n == 1 || (plain.momentum[0] - changed.momentum[0]).abs() > 0.0, "p does change");
    }
}
