//! Adam, RAdam and SOAP with L2 weight decay and gradient clipping, one step at a time.

mod eigenvectors;
mod orthonormal;
mod part;
mod schedule;
mod soap;

pub use schedule::Schedule;
pub(crate) use soap::Block;

use crate::scalar::{Real, Scalar, vectorized};
use part::Part;
use serde::{Deserialize, Serialize};
use soap::{Eigenbasis, Step};

/// Which update rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Method {
    /// Adam (Kingma, Ba 2015) with bias correction.
    Adam,
    /// RAdam (Liu et al. 2020): no second moment until its variance is tractable, then rectified.
    Radam,
    /// RAdam in the eigenbases of Shampoo's preconditioner (Vyas et al. 2024): fewer steps to the same loss, each of them
    /// dearer by four products of the size of each weight matrix and two squares of it.
    Soap,
}

impl Method {
    /// Its name in the literature.
    pub fn name(self) -> &'static str {
        match self {
            Self::Adam => "Adam",
            Self::Radam => "RAdam",
            Self::Soap => "SOAP",
        }
    }

    /// Decay of the running means of gradient and squared gradient.
    fn decay(self) -> [f64; 2] {
        match self {
            Self::Adam | Self::Radam => [0.9, 0.999],
            Self::Soap => [0.95, 0.99],
        }
    }
}

/// Moments as a checkpoint keeps them.
pub(crate) struct Stored<'a, S> {
    /// First moments.
    pub first: &'a [S],
    /// Second moments.
    pub second: &'a [S],
    /// Steps they are made of.
    pub step: u32,
    /// Weight matrices that have eigenbases.
    pub blocks: Vec<Block>,
    /// Their eigenbases, one after the other.
    pub bases: Vec<S>,
}

/// Hyper-parameters of an update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// Update rule.
    pub method: Method,
    /// Learning rate.
    pub rate: f64,
    /// L2 weight decay, added to the gradient.
    pub weight_decay: f64,
    /// Parameters that decay, the first ones: constants of nature behind the weights do not.
    pub decaying: usize,
    /// The gradient's norm is cut to this; infinity leaves it.
    pub clip: f64,
}

/// The matrices that have eigenbases, out of offset, rows and columns of each.
fn blocks(method: Method, matrices: impl IntoIterator<Item = (usize, usize, usize)>) -> Vec<Block> {
    if method != Method::Soap {
        return Vec::new();
    }
    matrices.into_iter().map(|(start, rows, cols)| Block { start, rows, cols }).collect()
}

/// Numbers that [`Moments::for_method`] keeps beside two for each parameter: what a checkpoint holds of them, and all;
/// `None` if they cannot be counted.
pub(crate) fn eigenbasis_numbers(
    method: Method,
    matrices: impl IntoIterator<Item = (usize, usize, usize)>,
) -> Option<(usize, usize)> {
    let blocks = blocks(method, matrices);
    let kept = Block::numbers(&blocks)?;
    let matrices = blocks.iter().try_fold(0_usize, |sum, b| sum.checked_add(b.rows.checked_mul(b.cols)?))?;
    Some((kept, kept.checked_mul(2)?.checked_add(matrices)?))
}

/// First and second moments of the gradient, and the eigenbases they are taken in.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments<S> {
    first: Vec<S>,
    second: Vec<S>,
    step: u32,
    bases: Vec<Eigenbasis<S>>,
}

impl<S: Scalar> Moments<S> {
    /// Zero moments for this many parameters.
    pub fn new(parameters: usize) -> Self {
        let zeros = vec![<S as Real>::zero(); parameters];
        Self { first: zeros.clone(), second: zeros, step: 0, bases: Vec::new() }
    }

    /// Zero moments, taken in eigenbases of `matrices`, offset, rows and columns of each, if the method has such.
    ///
    /// # Panics
    /// If the matrices overlap or end past the parameters.
    pub fn for_method(
        method: Method,
        parameters: usize,
        matrices: impl IntoIterator<Item = (usize, usize, usize)>,
    ) -> Self {
        let blocks = blocks(method, matrices);
        assert!(Block::fit(&blocks, parameters), "weight matrices lie side by side within the parameters");
        Self { bases: blocks.into_iter().map(Eigenbasis::new).collect(), ..Self::new(parameters) }
    }

    /// State of the optimiser as a checkpoint keeps it.
    pub(crate) fn stored(&self) -> Stored<'_, S> {
        let mut bases = Vec::new();
        self.bases.iter().for_each(|basis| basis.store(&mut bases));
        let blocks = self.bases.iter().map(Eigenbasis::block).collect();
        Stored { first: &self.first, second: &self.second, step: self.step, blocks, bases }
    }

    /// Moments from what [`Moments::stored`] gave: `None` if `blocks` and `bases` do not fit.
    pub(crate) fn restore(first: Vec<S>, second: Vec<S>, step: u32, blocks: &[Block], bases: &[S]) -> Option<Self> {
        if !Block::fit(blocks, first.len()) || Block::numbers(blocks)? != bases.len() {
            return None;
        }
        let mut eigenbases: Vec<_> = blocks.iter().map(|&block| Eigenbasis::new(block)).collect();
        eigenbases.iter_mut().fold(bases, |numbers, basis| basis.load(numbers));
        Some(Self { first, second, step, bases: eigenbases })
    }

    /// Updates `weights` in place and uses `gradient` up; returns its norm before clipping.
    ///
    /// A gradient that is not finite changes nothing; its norm, infinite or `NaN`, is returned. All work is done on the
    /// caller's thread.
    pub fn update(&mut self, weights: &mut [S], gradient: &mut [S], update: &Update) -> f64 {
        self.update_on(None, weights, gradient, update)
    }

    /// [`Moments::update`] with the eigenbases shared out over the threads of a pool; the result does not depend on them.
    pub(crate) fn update_on(
        &mut self,
        pool: soap::Threads<'_>,
        weights: &mut [S],
        gradient: &mut [S],
        update: &Update,
    ) -> f64 {
        let norm = norm(gradient);
        if !norm.is_finite() {
            return norm;
        }
        self.step += 1;
        let clip = S::of_f64(if norm > update.clip { update.clip / norm } else { 1.0 });
        let decay = S::of_f64(update.weight_decay);
        let decaying = update.decaying.min(weights.len());
        vectorized(
            #[inline(always)]
            || {
                let (of_weights, constants) = gradient.split_at_mut(decaying);
                of_weights.iter_mut().zip(&*weights).for_each(|(g, &w)| *g = *g * clip + decay * w);
                constants.iter_mut().for_each(|g| *g *= clip);
            },
        );
        let step = Step::new(update, self.step);
        let (bases, first, second) = (&mut self.bases[..], &mut self.first[..], &mut self.second[..]);
        let part = Part { start: 0, weights, gradient, first, second };
        match pool {
            Some(pool) if !bases.is_empty() => pool.install(|| step.take(part, bases, true)),
            _ => step.take(part, bases, false),
        }
        norm
    }
}

impl Update {
    /// Length of step `step`, counted from 1, and the factor of the second moment's root; no factor where RAdam does
    /// without the second moment.
    fn step_size(&self, step: u32) -> (f64, Option<f64>) {
        let t = f64::from(step);
        let [b1, b2] = self.method.decay();
        let (correction1, correction2) = (1.0 - b1.powf(t), 1.0 - b2.powf(t));
        let adam = self.rate / correction1;
        let second = Some(1.0 / correction2.sqrt());
        match self.method {
            Method::Adam => (adam, second),
            Method::Radam | Method::Soap => {
                let limit = 2.0 / (1.0 - b2) - 1.0;
                let length = limit - 2.0 * t * b2.powf(t) / correction2;
                if length <= 5.0 {
                    return (adam, None);
                }
                let numerator = (length - 4.0) * (length - 2.0) * limit;
                let denominator = (limit - 4.0) * (limit - 2.0) * length;
                (adam * (numerator / denominator).sqrt(), second)
            }
        }
    }
}

/// Euclidean norm in double precision, partial sums in a fixed order.
fn norm<S: Scalar>(gradient: &[S]) -> f64 {
    const LANES: usize = 16;
    let mut sums = [0.0; LANES];
    vectorized(
        #[inline(always)]
        || {
            for part in gradient.chunks(LANES) {
                for (sum, &g) in sums.iter_mut().zip(part) {
                    let g = g.to_f64();
                    *sum += g * g;
                }
            }
        },
    );
    sums.iter().sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(method: Method, rate: f64) -> Update {
        Update { method, rate, weight_decay: 0.0, decaying: usize::MAX, clip: f64::INFINITY }
    }

    #[test]
    fn adam_takes_its_first_step_along_the_sign() {
        let mut weights = [1.0_f64, -2.0];
        Moments::new(2).update(&mut weights, &mut [0.3, -4.0], &plain(Method::Adam, 0.1));
        assert!((weights[0] - 0.9).abs() < 1e-8 && (weights[1] + 1.9).abs() < 1e-8);
    }

    #[test]
    fn radam_starts_as_momentum_and_is_then_rectified() {
        let mut weights = [0.0_f64];
        let mut moments = Moments::new(1);
        let update = plain(Method::Radam, 0.1);
        for t in 1..=5 {
            // Constant gradient: the corrected first moment is the gradient itself.
            moments.update(&mut weights, &mut [2.0], &update);
            assert!((weights[0] + 0.2 * f64::from(t)).abs() < 1e-12, "step {t}: {}", weights[0]);
        }
        let before = weights[0];
        moments.update(&mut weights, &mut [2.0], &update);
        // Length of the approximated moving average at step 6 of beta2 = 0.999.
        let limit = 1999.0;
        let length = limit - 12.0 * 0.999_f64.powi(6) / (1.0 - 0.999_f64.powi(6));
        let r = ((length - 4.0) * (length - 2.0) * limit / ((limit - 4.0) * (limit - 2.0) * length)).sqrt();
        assert!((before - weights[0] - 0.1 * r).abs() < 1e-8);
    }

    #[test]
    fn clipping_keeps_the_direction_and_decay_adds_the_weight() {
        let mut moments = Moments::<f64>::new(2);
        let mut weights = [1.0, 1.0];
        let update = Update { weight_decay: 0.5, clip: 1.0, ..plain(Method::Radam, 1.0) };
        let norm = moments.update(&mut weights, &mut [30.0, 40.0], &update);
        assert_eq!(norm, 50.0);
        assert!((weights[0] - (1.0 - 0.6 - 0.5)).abs() < 1e-12 && (weights[1] - (1.0 - 0.8 - 0.5)).abs() < 1e-12);
    }

    #[test]
    fn a_gradient_that_is_not_finite_changes_nothing() {
        for bad in [f32::NAN, f32::INFINITY] {
            let mut moments = Moments::<f32>::new(2);
            let mut weights = [1.0, 2.0];
            assert!(!moments.update(&mut weights, &mut [0.0, bad], &plain(Method::Adam, 0.1)).is_finite());
            assert_eq!((weights, &moments), ([1.0, 2.0], &Moments::new(2)));
        }
    }
}
