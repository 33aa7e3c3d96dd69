//! Mean squares of combinations of terms, and the contribution of noise to them.

use super::MotionSamples;
use super::features::Features;
use super::thresholds::ROUNDING_SHARE;
use crate::linalg::{Workspace, dot, eigh};

/// Means of products of terms, of their noise, and of products of their means along trajectories.
#[derive(Clone, Debug)]
struct Fold {
    samples: f64,
    gram: Vec<f64>,
    noise: Vec<f64>,
    between: Vec<f64>,
}

/// Moments of several parts of the data, so that each can be left out.
#[derive(Clone, Debug)]
pub struct Moments {
    terms: usize,
    folds: Vec<Fold>,
    /// Root mean square of each term.
    pub scale: Vec<f64>,
}

/// Sums of the two forms over data, with terms scaled to unit size.
#[derive(Clone, Debug)]
pub struct Pencil {
    terms: usize,
    gram: Vec<f64>,
    noise: Vec<f64>,
}

impl Moments {
    /// Moments of all samples, in `folds` parts; trajectories stay whole if there are enough of them.
    pub fn of(samples: &MotionSamples, features: &Features, folds: usize) -> Self {
        let p = features.len();
        let empty = Fold { samples: 0.0, gram: vec![0.0; p * p], noise: vec![0.0; p * p], between: vec![0.0; p * p] };
        let mut parts = vec![empty; folds];
        let whole = samples.trajectories() >= folds;
        let pieces = samples.tracks().enumerate().flat_map(|(t, track)| {
            let count = if whole { 1 } else { folds };
            let (start, length) = (track.start, track.len());
            let piece = move |k: usize| start + k * length / count..start + (k + 1) * length / count;
            (0..count).map(move |k| (if whole { t % folds } else { k }, piece(k)))
        });
        let (mut values, mut slopes, mut mean) = (Vec::new(), Vec::new(), vec![0.0; p]);
        for (part, piece) in pieces {
            let (fold, length) = (&mut parts[part], piece.len().max(1));
            mean.fill(0.0);
            for at in piece {
                // The sums so far are finite, but useless.
                if fold.samples > 0.0 && !samples.cancellation.go_on() {
                    break;
                }
                features.evaluate(samples, at, &mut values, &mut slopes);
                fold.samples += 1.0;
                for i in 0..p {
                    mean[i] += values[i];
                    let row = &mut fold.gram[i * p..(i + 1) * p];
                    row[i..].iter_mut().zip(&values[i..]).for_each(|(sum, x)| *sum += values[i] * x);
                }
                slopes.sort_unstable_by_key(|&(component, term, _)| (component, term));
                // Sine and cosine of one angle may occur in one term.
                slopes.dedup_by(|next, first| {
                    let same = (next.0, next.1) == (first.0, first.1);
                    first.2 += if same { next.2 } else { 0.0 };
                    same
                });
                for same in slopes.chunk_by(|a, b| a.0 == b.0) {
                    let variance = samples.noise(at, same[0].0).powi(2);
                    for (k, &(_, i, a)) in same.iter().enumerate() {
                        for &(_, j, b) in &same[k..] {
                            fold.noise[i * p + j] += variance * a * b;
                        }
                    }
                }
            }
            for i in 0..p {
                for j in i..p {
                    fold.between[i * p + j] += mean[i] * mean[j] / length as f64;
                }
            }
        }
        for fold in &mut parts {
            for form in [&mut fold.gram, &mut fold.noise, &mut fold.between] {
                for i in 0..p {
                    for j in 0..i {
                        form[i * p + j] = form[j * p + i];
                    }
                }
            }
        }
        let total: f64 = parts.iter().map(|fold| fold.samples).sum();
        let scale = (0..p).map(|i| {
            let square: f64 = parts.iter().map(|fold| fold.gram[i * p + i]).sum();
            let size = (square / total).sqrt();
            if size > 0.0 { size } else { 1.0 }
        });
        let scale = scale.collect();
        Self { terms: p, folds: parts, scale }
    }

    /// Number of parts.
    pub fn folds(&self) -> usize {
        self.folds.len()
    }

    /// The forms over the chosen parts, of the terms or, if `centred`, of their deviations from their mean along each trajectory.
    pub fn pencil(&self, centred: bool, taken: impl Fn(usize) -> bool) -> Pencil {
        let p = self.terms;
        let (mut gram, mut noise, mut samples) = (vec![0.0; p * p], vec![0.0; p * p], 0.0);
        for (_, fold) in self.folds.iter().enumerate().filter(|(part, _)| taken(*part)) {
            samples += fold.samples;
            for k in 0..p * p {
                gram[k] += fold.gram[k] - if centred { fold.between[k] } else { 0.0 };
                noise[k] += fold.noise[k];
            }
        }
        for i in 0..p {
            for j in 0..p {
                let unit = (self.scale[i] * self.scale[j] * samples).recip();
                gram[i * p + j] *= unit;
                noise[i * p + j] *= unit;
            }
            noise[i * p + i] += ROUNDING_SHARE * ROUNDING_SHARE;
        }
        Pencil { terms: p, gram, noise }
    }
}

impl Pencil {
    /// The forms of some of the terms.
    pub fn on(&self, support: &[usize]) -> Self {
        let pick = |form: &[f64]| {
            support.iter().flat_map(|&i| support.iter().map(move |&j| form[i * self.terms + j])).collect()
        };
        Self { terms: support.len(), gram: pick(&self.gram), noise: pick(&self.noise) }
    }

    /// `c.G c / c.N c` of a combination.
    pub fn ratio(&self, c: &[f64]) -> f64 {
        let form =
            |matrix: &[f64]| -> f64 { matrix.chunks_exact(self.terms).zip(c).map(|(row, ci)| ci * dot(row, c)).sum() };
        form(&self.gram) / form(&self.noise)
    }

    /// Stationary values of the ratio, ascending, with their combinations, row by row; empty if numbers are not finite.
    pub fn solve(&self) -> (Vec<f64>, Vec<f64>) {
        let p = self.terms;
        if p == 0 {
            return (Vec::new(), Vec::new());
        }
        let both: Vec<f64> = self.gram.iter().zip(&self.noise).map(|(g, n)| g + n).collect();
        let (mut values, mut vectors, mut workspace) = (vec![0.0; p], vec![0.0; p * p], Workspace::new());
        if eigh(p, &both, &mut values, &mut vectors, &mut workspace).is_err() {
            return (Vec::new(), Vec::new());
        }
        // Rows of the inverse root of G + N.
        let least = values.last().map_or(0.0, |most| most * 1e-18);
        for (row, &value) in vectors.chunks_exact_mut(p).zip(&values) {
            let unit = value.max(least).sqrt().recip();
            row.iter_mut().for_each(|x| *x *= unit);
        }
        let white = vectors;
        let mut inside = vec![0.0; p * p];
        for (i, a) in white.chunks_exact(p).enumerate() {
            let image: Vec<f64> = self.noise.chunks_exact(p).map(|row| dot(row, a)).collect();
            for (j, b) in white.chunks_exact(p).enumerate() {
                inside[i * p + j] = dot(&image, b);
            }
        }
        let mut turned = vec![0.0; p * p];
        if eigh(p, &inside, &mut values, &mut turned, &mut workspace).is_err() {
            return (Vec::new(), Vec::new());
        }
        let mut combinations = Vec::with_capacity(p * p);
        for row in turned.chunks_exact(p).rev() {
            let mut c = vec![0.0; p];
            for (&weight, a) in row.iter().zip(white.chunks_exact(p)) {
                c.iter_mut().zip(a).for_each(|(c, a)| *c += weight * a);
            }
            combinations.extend(c);
        }
        let ratios = values.iter().rev().map(|&share| ((1.0 - share) / share.max(1e-300)).max(0.0)).collect();
        (ratios, combinations)
    }
}
