//! Adam and RAdam with L2 weight decay and gradient clipping, one step at a time.

use crate::scalar::{Real, Scalar, vectorized};
use serde::{Deserialize, Serialize};

/// Which update rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Adam (Kingma, Ba 2015) with bias correction.
    Adam,
    /// RAdam (Liu et al. 2020): no second moment until its variance is tractable, then rectified.
    Radam,
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
    /// The gradient's norm is cut to this; infinity leaves it.
    pub clip: f64,
}

const BETA: [f64; 2] = [0.9, 0.999];
const EPSILON: f64 = 1e-8;

/// First and second moments of the gradient.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments<S> {
    first: Vec<S>,
    second: Vec<S>,
    step: u32,
}

impl<S: Scalar> Moments<S> {
    /// Zero moments for this many parameters.
    pub fn new(parameters: usize) -> Self {
        let zeros = vec![<S as Real>::zero(); parameters];
        Self { first: zeros.clone(), second: zeros, step: 0 }
    }

    /// First moments, second moments and the steps they are made of.
    pub(super) fn parts(&self) -> (&[S], &[S], u32) {
        (&self.first, &self.second, self.step)
    }

    /// Moments from their [parts](Moments::parts).
    pub(super) fn from_parts(first: Vec<S>, second: Vec<S>, step: u32) -> Self {
        Self { first, second, step }
    }

    /// Updates `weights` in place; returns the gradient's norm before clipping.
    ///
    /// A gradient that is not finite changes nothing; its norm, infinite or `NaN`, is returned.
    pub fn update(&mut self, weights: &mut [S], gradient: &[S], update: &Update) -> f64 {
        let norm = norm(gradient);
        if !norm.is_finite() {
            return norm;
        }
        self.step += 1;
        let clip = if norm > update.clip { update.clip / norm } else { 1.0 };
        let (step, scale) = self.step_size(update);
        let [b1, b2] = BETA.map(S::of_f64);
        let [c1, c2] = BETA.map(|b| S::of_f64(1.0 - b));
        let (clip, decay) = (S::of_f64(clip), S::of_f64(update.weight_decay));
        let step = S::of_f64(step);
        let epsilon = S::of_f64(EPSILON);
        let moments = self.first.iter_mut().zip(self.second.iter_mut());
        vectorized(
            #[inline(always)]
            move || {
                for ((w, &g), (m, v)) in weights.iter_mut().zip(gradient).zip(moments) {
                    let g = g * clip + decay * *w;
                    *m = b1 * *m + c1 * g;
                    *v = b2 * *v + c2 * g * g;
                    let direction = match scale {
                        Some(scale) => *m / (v.sqrt() * S::of_f64(scale) + epsilon),
                        None => *m,
                    };
                    *w -= step * direction;
                }
            },
        );
        norm
    }

    /// Step length and the factor of the second moment's root; no factor where RAdam does without the second moment.
    fn step_size(&self, update: &Update) -> (f64, Option<f64>) {
        let t = f64::from(self.step);
        let [b1, b2] = BETA;
        let (correction1, correction2) = (1.0 - b1.powf(t), 1.0 - b2.powf(t));
        let adam = update.rate / correction1;
        let second = Some(1.0 / correction2.sqrt());
        match update.method {
            Method::Adam => (adam, second),
            Method::Radam => {
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
        Update { method, rate, weight_decay: 0.0, clip: f64::INFINITY }
    }

    #[test]
    fn adam_takes_its_first_step_along_the_sign() {
        let mut weights = [1.0_f64, -2.0];
        Moments::new(2).update(&mut weights, &[0.3, -4.0], &plain(Method::Adam, 0.1));
        assert!((weights[0] - 0.9).abs() < 1e-8 && (weights[1] + 1.9).abs() < 1e-8);
    }

    #[test]
    fn radam_starts_as_momentum_and_is_then_rectified() {
        let mut weights = [0.0_f64];
        let mut moments = Moments::new(1);
        let update = plain(Method::Radam, 0.1);
        for t in 1..=5 {
            // Constant gradient: the corrected first moment is the gradient itself.
            moments.update(&mut weights, &[2.0], &update);
            assert!((weights[0] + 0.2 * f64::from(t)).abs() < 1e-12, "step {t}: {}", weights[0]);
        }
        let before = weights[0];
        moments.update(&mut weights, &[2.0], &update);
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
        let norm = moments.update(&mut weights, &[30.0, 40.0], &update);
        assert_eq!(norm, 50.0);
        assert!((weights[0] - (1.0 - 0.6 - 0.5)).abs() < 1e-12 && (weights[1] - (1.0 - 0.8 - 0.5)).abs() < 1e-12);
    }

    #[test]
    fn a_gradient_that_is_not_finite_changes_nothing() {
        for bad in [f32::NAN, f32::INFINITY] {
            let mut moments = Moments::<f32>::new(2);
            let mut weights = [1.0, 2.0];
            assert!(!moments.update(&mut weights, &[0.0, bad], &plain(Method::Adam, 0.1)).is_finite());
            assert_eq!((weights, &moments), ([1.0, 2.0], &Moments::new(2)));
        }
    }
}
