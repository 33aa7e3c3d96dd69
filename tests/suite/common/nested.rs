//! Euler-Lagrange terms of a network by nested forward numbers over any number type.

use lnn::forward::HyperDual;
use lnn::lagrangian::Lagrangian;
use lnn::network::Architecture;
use lnn::scalar::Real;

/// `L`, `p`, `g`, `M`, `c` by nested forward numbers, in scaled coordinates.
pub struct Reference<T> {
    pub lagrangian: T,
    pub p: Vec<T>,
    pub g: Vec<T>,
    pub m: Vec<T>,
    pub c: Vec<T>,
}

/// The terms of a network at one state, `q` and `v` in physical units.
pub fn reference<T: Real>(architecture: &Architecture, weights: &[T], q: &[T], v: &[T]) -> Reference<T> {
    reference_of(architecture, &architecture.scale, weights, q, v)
}

/// The terms of any Lagrangian at one state, `q` and `v` in physical units.
pub fn reference_of<T: Real>(system: &impl Lagrangian, scale: &[f64], weights: &[T], q: &[T], v: &[T]) -> Reference<T> {
    let n = scale.len();
    let weights: Vec<HyperDual<T>> = weights.iter().map(|&w| HyperDual::lift(w)).collect();
    let scale = |i: usize| T::of(scale[i]);
    // Second derivative along two scaled directions, each a list of (index in (q, v), component).
    let jet = |s: &[(usize, T)], t: &[(usize, T)]| -> HyperDual<T> {
        let part = |direction: &[(usize, T)], k: usize| {
            direction.iter().filter(|d| d.0 == k).fold(T::zero(), |sum, d| sum + d.1) * scale(k % n)
        };
        let x: Vec<HyperDual<T>> = (0..2 * n)
            .map(|k| HyperDual::new(if k < n { q[k] } else { v[k - n] }, part(s, k), part(t, k), T::zero()))
            .collect();
        system.lagrangian(&weights, &x[..n], &x[n..])
    };
    let along: Vec<(usize, T)> = (0..n).map(|i| (i, v[i] / scale(i))).collect();
    let one = T::one();
    let mut out = Reference { lagrangian: T::zero(), p: vec![], g: vec![], m: vec![], c: vec![] };
    for i in 0..n {
        let moving = jet(&[(n + i, one)], &along);
        out.lagrangian = moving.value;
        out.p.push(moving.s);
        out.c.push(moving.st);
        out.g.push(jet(&[(i, one)], &[]).s);
        for j in 0..n {
            out.m.push(jet(&[(n + i, one)], &[(n + j, one)]).st);
        }
    }
    out
}
