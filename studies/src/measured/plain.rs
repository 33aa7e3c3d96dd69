//! A plain network for accelerations: no mechanics in it, the first thing that a user would try.

use lnn::data::Dataset;
use lnn::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use nalgebra::{DMatrix, DVector};
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Layers `(W, b)`, tanh between them; inputs `sin q`, `cos q`, `v/s`, outputs `a/s`.
pub struct Plain {
    layers: Vec<(DMatrix<f32>, DVector<f32>)>,
    scale: Vec<f32>,
}

/// States of a step.
const BATCH: usize = 128;

impl Plain {
    /// Adam with a rate falling to 0 by half a cosine, on the mean absolute error of scaled accelerations.
    pub fn learn(data: &Dataset<f32>, hidden: &[usize], epochs: usize, rate: f64, seed: u64) -> Self {
        let n = data.coordinates();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut widths = vec![3 * n];
        widths.extend(hidden);
        widths.push(n);
        let mut layer = |from: usize, to: usize| {
            let bound = (from as f32).powf(-0.5);
            let mut draw = || rng.random_range(-bound..bound);
            (DMatrix::from_fn(to, from, |_, _| draw()), DVector::from_fn(to, |_, _| draw()))
        };
        let layers: Vec<_> = widths.windows(2).map(|pair| layer(pair[0], pair[1])).collect();
        let scale = data.physical_scale().iter().map(|&s| s as f32).collect();
        let mut network = Self { layers, scale };
        let zero = |(w, b): &(DMatrix<f32>, DVector<f32>)| (w * 0.0, b * 0.0);
        let mut first: Vec<_> = network.layers.iter().map(zero).collect();
        let mut second = first.clone();
        let mut order: Vec<usize> = (0..data.len()).collect();
        let (mut step, steps) = (0, epochs * data.len().div_ceil(BATCH));
        for _ in 0..epochs {
            order.shuffle(&mut rng);
            for rows in order.chunks(BATCH) {
                let rate = rate * 0.5 * (1.0 + (std::f64::consts::PI * f64::from(step) / steps as f64).cos());
                step += 1;
                let gradient = network.gradient(data, rows);
                let correction = |decay: f64| 1.0 - decay.powi(step);
                let size = (rate * correction(0.999).sqrt() / correction(0.9)) as f32;
                for (k, (dw, db)) in gradient.into_iter().enumerate() {
                    let (w, b) = &mut network.layers[k];
                    adam(w.as_mut_slice(), dw.as_slice(), first[k].0.as_mut_slice(), second[k].0.as_mut_slice(), size);
                    adam(b.as_mut_slice(), db.as_slice(), first[k].1.as_mut_slice(), second[k].1.as_mut_slice(), size);
                }
            }
        }
        network
    }

    /// Features of states, one column each.
    fn features<'a>(&self, states: impl Iterator<Item = (&'a [f32], &'a [f32])>) -> DMatrix<f32> {
        let n = self.scale.len();
        let columns: Vec<f32> = states
            .flat_map(|(q, v)| {
                let velocities = v.iter().zip(&self.scale).map(|(v, s)| v / s);
                q.iter().map(|q| q.sin()).chain(q.iter().map(|q| q.cos())).chain(velocities).collect::<Vec<_>>()
            })
            .collect();
        DMatrix::from_column_slice(3 * n, columns.len() / (3 * n), &columns)
    }

    /// Activations of every layer, the inputs first.
    fn forward(&self, features: DMatrix<f32>) -> Vec<DMatrix<f32>> {
        let mut activations = vec![features];
        for (k, (w, b)) in self.layers.iter().enumerate() {
            let mut z = w * &activations[k];
            z.column_iter_mut().for_each(|mut column| column += b);
            if k + 1 < self.layers.len() {
                z.apply(|x| *x = x.tanh());
            }
            activations.push(z);
        }
        activations
    }

    fn gradient(&self, data: &Dataset<f32>, rows: &[usize]) -> Vec<(DMatrix<f32>, DVector<f32>)> {
        let n = self.scale.len();
        let row = |values: &'_ [f32], k: usize| -> std::ops::Range<usize> { k * n..((k + 1) * n).min(values.len()) };
        let states = rows.iter().map(|&k| (&data.q()[row(data.q(), k)], &data.v()[row(data.v(), k)]));
        let activations = self.forward(self.features(states));
        let output = &activations[self.layers.len()];
        let weight = 1.0 / (n * rows.len()) as f32;
        let mut adjoint = DMatrix::from_fn(n, rows.len(), |i, j| {
            let residual = output[(i, j)] - data.a()[rows[j] * n + i] / self.scale[i];
            if residual == 0.0 { 0.0 } else { weight.copysign(residual) }
        });
        let mut gradient = Vec::with_capacity(self.layers.len());
        for k in (0..self.layers.len()).rev() {
            gradient.push((&adjoint * activations[k].transpose(), adjoint.column_sum()));
            adjoint = self.layers[k].0.tr_mul(&adjoint);
            adjoint.zip_apply(&activations[k], |d, h| *d *= 1.0 - h * h);
        }
        gradient.reverse();
        gradient
    }
}

fn adam(w: &mut [f32], gradient: &[f32], first: &mut [f32], second: &mut [f32], size: f32) {
    for (((w, g), m), v) in w.iter_mut().zip(gradient).zip(first).zip(second) {
        *m = 0.9 * *m + 0.1 * g;
        *v = 0.999 * *v + 0.001 * g * g;
        *w -= size * *m / (v.sqrt() + 1e-8);
    }
}

/// Only so that the same integrator moves it: it has an acceleration and nothing else.
impl EulerLagrange<f64> for Plain {
    fn coordinates(&self) -> usize {
        self.scale.len()
    }

    fn terms(&self, q: &[f64], v: &[f64], _: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        let n = self.scale.len();
        let single = |x: &[f64]| x.iter().map(|&x| x as f32).collect::<Vec<f32>>();
        let (q, v) = (single(q), single(v));
        let activations = self.forward(self.features(q.chunks(n).zip(v.chunks(n))));
        let output = &activations[self.layers.len()];
        terms.clear();
        let scaled = |(k, a): (usize, &f32)| f64::from(*a * self.scale[k % n]);
        terms.acceleration.extend(output.iter().enumerate().map(scaled));
        Ok(())
    }
}
