//! Update rules of the weights, from Adam to SOAP, with weight decay and gradient clipping, one step at a time;
//! schedules of the learning rate.

mod soap;

pub(crate) use soap::Block;

use crate::learning::state::numbers;
use crate::scalar::{Real, Scalar, vectorized};
use serde::{Deserialize, Serialize};
use soap::{Eigenbasis, Step};

/// Traits that distinguish the update rules; all of them keep running means of the gradient and the squared gradient.
#[derive(Clone, Copy)]
struct Traits {
    /// Decay rates of the two means.
    decay: [f64; 2],
    /// `true` if the rule omits the second moment until its variance is tractable, then rectifies it (Liu et al. 2020).
    rectified: bool,
    /// `true` if the moments of weight matrices are taken in the eigenbases of Shampoo's preconditioner.
    eigenbases: bool,
    /// `true` if weights decay in addition to the step, by learning rate times decay, instead of through the gradient.
    decoupled: bool,
}

/// Traits of Adam.
const ADAM: Traits = Traits { decay: [0.9, 0.999], rectified: false, eigenbases: false, decoupled: false };

/// Builds the choice of update rules from rows `Name "name in configurations" "name in the literature" traits;`.
macro_rules! methods {
    ($($(#[$doc:meta])* $name:ident $text:literal $title:literal $traits:expr;)*) => {
        /// Update rule of the weights.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        #[non_exhaustive]
        pub enum Method {
            $($(#[$doc])* #[serde(rename = $text)] $name,)*
        }

        impl Method {
            /// All update rules.
            pub const ALL: [Self; [$($text),*].len()] = [$(Self::$name),*];
            /// The names in configurations, separated by commas.
            pub const NAMES: &'static str = methods!(@names $($text)*);

            /// Its name in the literature.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $title,)*
                }
            }

            fn traits(self) -> Traits {
                match self {
                    $(Self::$name => $traits,)*
                }
            }
        }
    };
    (@names $first:literal $($text:literal)*) => { concat!($first $(, ", ", $text)*) };
}

methods! {
    /// RAdam in the eigenbases of Shampoo's preconditioner (Vyas et al. 2024): fewer steps to the same loss, but each step costs four more
    /// products of the size of each weight matrix and two squares of it.
    Soap "soap" "SOAP" Traits { decay: [0.95, 0.99], rectified: true, eigenbases: true, ..ADAM };
    /// RAdam (Liu et al. 2020): omits the second moment until its variance is tractable, then rectifies it.
    Radam "radam" "RAdam" Traits { rectified: true, ..ADAM };
    /// Adam (Kingma, Ba 2015) with bias correction.
    Adam "adam" "Adam" ADAM;
    /// AdamW (Loshchilov, Hutter 2019): Adam whose weights shrink by the learning rate times the weight decay at every step, whatever
    /// the size of their gradients.
    AdamW "adamw" "AdamW" Traits { decoupled: true, ..ADAM };
}

/// Hyper-parameters of an update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// Update rule.
    pub method: Method,
    /// Learning rate.
    pub rate: f64,
    /// Weight decay: added to the gradient (L2), or applied separately if the method decouples it.
    pub weight_decay: f64,
    /// Number of leading parameters that decay; the physical constants after the weights do not.
    pub decaying: usize,
    /// Largest norm of the gradient; a longer gradient is scaled down to it. Infinity disables clipping.
    pub clip: f64,
}

/// Selects the matrices that get eigenbases; each is given by offset, rows and columns.
fn blocks(method: Method, matrices: impl IntoIterator<Item = (usize, usize, usize)>) -> Vec<Block> {
    if !method.traits().eigenbases {
        return Vec::new();
    }
    matrices.into_iter().map(|(start, rows, cols)| Block { start, rows, cols }).collect()
}

/// Counts the numbers that [`Moments::for_method`] stores besides two for each parameter: those in a checkpoint, and all of them; `None` if
/// the count overflows.
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "S: Scalar")]
pub struct Moments<S> {
    #[serde(with = "numbers")]
    first: Vec<S>,
    #[serde(with = "numbers")]
    second: Vec<S>,
    step: u32,
    bases: Vec<Eigenbasis<S>>,
}

impl<S: Scalar> Moments<S> {
    /// Creates zero moments for this many parameters.
    pub fn new(parameters: usize) -> Self {
        let zeros = vec![<S as Real>::zero(); parameters];
        Self { first: zeros.clone(), second: zeros, step: 0, bases: Vec::new() }
    }

    /// Creates zero moments. If the method uses eigenbases, `matrices` gets them; each is given by offset, rows and columns.
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

    /// `true` if the moments match this many parameters and their eigenbases are complete.
    pub(crate) fn fit(&self, parameters: usize) -> bool {
        let blocks: Vec<Block> = self.bases.iter().map(Eigenbasis::block).collect();
        [&self.first, &self.second].iter().all(|moments| moments.len() == parameters)
            && Block::fit(&blocks, parameters)
            && self.bases.iter().all(Eigenbasis::is_whole)
    }

    /// Updates `weights` in place and overwrites `gradient`; returns its norm before clipping.
    ///
    /// A gradient that is not finite changes nothing; its norm, infinite or `NaN`, is returned. All work is done on the
    /// caller's thread.
    pub fn update(&mut self, weights: &mut [S], gradient: &mut [S], update: &Update) -> f64 {
        self.update_on(None, weights, gradient, update)
    }

    /// Like [`Moments::update`], but updates the eigenbases on a thread pool; the result does not depend on the threads.
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
        let decaying = update.decaying.min(weights.len());
        let (decay, shrink) = match update.method.traits().decoupled {
            true => (0.0, update.rate * update.weight_decay),
            false => (update.weight_decay, 0.0),
        };
        if shrink != 0.0 {
            let keep = S::of_f64(1.0 - shrink);
            weights[..decaying].iter_mut().for_each(|w| *w *= keep);
        }
        let decay = S::of_f64(decay);
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
    /// Length of step number `step`, counted from 1, and the factor of the root of the second moment; `None` where RAdam omits the second
    /// moment.
    fn step_size(&self, step: u32) -> (f64, Option<f64>) {
        let t = f64::from(step);
        let Traits { decay: [b1, b2], rectified, .. } = self.method.traits();
        let (correction1, correction2) = (1.0 - b1.powf(t), 1.0 - b2.powf(t));
        let adam = self.rate / correction1;
        let second = Some(1.0 / correction2.sqrt());
        if !rectified {
            return (adam, second);
        }
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

/// Euclidean norm in double precision; partial sums are added in a fixed order.
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

/// Keeps a step finite if a second moment vanishes.
const EPSILON: f64 = 1e-8;

/// The rule of Adam at one step.
#[derive(Clone, Copy)]
struct Rule<S> {
    /// Decay factors of both moments, and the factors by which the gradient and its square are added to them.
    keep: [S; 2],
    take: [S; 2],
    /// Step length, and the factor of the root of the second moment; `None` where RAdam omits the second moment.
    length: S,
    scale: Option<S>,
    epsilon: S,
}

impl<S: Scalar> Rule<S> {
    /// Computes the rule at step number `step`, counted from 1.
    pub fn new(update: &Update, step: u32) -> Self {
        let (length, scale) = update.step_size(step);
        let decay = update.method.traits().decay;
        Self {
            keep: decay.map(S::of_f64),
            take: decay.map(|b| S::of_f64(1.0 - b)),
            length: S::of_f64(length),
            scale: scale.map(S::of_f64),
            epsilon: S::of_f64(EPSILON),
        }
    }

    /// Updates both moments of one parameter and returns its step.
    #[inline(always)]
    pub fn advance(&self, m: &mut S, v: &mut S, g: S) -> S {
        *m = self.keep[0] * *m + self.take[0] * g;
        *v = self.keep[1] * *v + self.take[1] * g * g;
        self.length
            * match self.scale {
                Some(scale) => *m / (v.sqrt() * scale + self.epsilon),
                None => *m,
            }
    }
}

/// A contiguous range of the parameters, from number `start` on, with gradients and moments.
struct Part<'a, S> {
    pub start: usize,
    pub weights: &'a mut [S],
    pub gradient: &'a mut [S],
    pub first: &'a mut [S],
    pub second: &'a mut [S],
}

impl<S: Scalar> Part<'_, S> {
    /// Splits the range before parameter number `at`.
    pub fn split(self, at: usize) -> (Self, Self) {
        let k = at - self.start;
        let (weights, gradient) = (self.weights.split_at_mut(k), self.gradient.split_at_mut(k));
        let (first, second) = (self.first.split_at_mut(k), self.second.split_at_mut(k));
        (
            Self { start: self.start, weights: weights.0, gradient: gradient.0, first: first.0, second: second.0 },
            Self { start: at, weights: weights.1, gradient: gradient.1, first: first.1, second: second.1 },
        )
    }

    /// Updates both moments and overwrites the gradient with the step.
    pub fn advance(&mut self, rule: &Rule<S>) {
        vectorized(
            #[inline(always)]
            || {
                let moments = self.first.iter_mut().zip(&mut *self.second);
                self.gradient.iter_mut().zip(moments).for_each(|(g, (m, v))| *g = rule.advance(m, v, *g));
            },
        );
    }

    /// Applies the step that replaced the gradient.
    pub fn apply(self) {
        vectorized(
            #[inline(always)]
            || self.weights.iter_mut().zip(&*self.gradient).for_each(|(w, &step)| *w -= step),
        );
    }
}

/// Schedule of the learning rate within a phase.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Schedule {
    /// The rate is constant.
    Constant,
    /// Half a cosine from the rate to `eta_min` over the whole phase.
    Cosine,
    /// Cosine annealing with period `2 t_max`: falls to `eta_min` in `t_max` epochs, rises again in the next `t_max`
    /// (the paper's schedule).
    CosineAnnealing,
}

impl Schedule {
    /// Learning rate after a fraction of the phase.
    ///
    /// `epoch` counts from 0 and may be fractional; `epochs` is the length of the phase.
    pub(crate) fn rate(self, rate: f64, eta_min: f64, t_max: f64, epoch: f64, epochs: f64) -> f64 {
        let cosine = |phase: f64| eta_min + 0.5 * (rate - eta_min) * (1.0 + (std::f64::consts::PI * phase).cos());
        match self {
            Self::Constant => rate,
            Self::Cosine => cosine((epoch / epochs).min(1.0)),
            Self::CosineAnnealing => cosine(epoch / t_max),
        }
    }
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

    /// A decay through the gradient is divided by the second moment; AdamW shrinks every weight by the same factor instead.
    #[test]
    fn a_decoupled_decay_does_not_depend_on_the_gradient() {
        let update = Update { weight_decay: 0.5, decaying: 2, ..plain(Method::AdamW, 0.1) };
        let mut weights = [1.0_f64, -2.0, 3.0];
        Moments::new(3).update(&mut weights, &mut [100.0, -1e-3, 1.0], &update);
        for (found, expected) in weights.iter().zip([0.95 - 0.1, -1.9 + 0.1, 3.0 - 0.1]) {
            assert!((found - expected).abs() < 1e-5, "{weights:?}");
        }
        let run = |method, weight_decay| {
            let mut weights = [1.0_f64, -2.0];
            let update = Update { weight_decay, ..plain(method, 0.1) };
            Moments::new(2).update(&mut weights, &mut [0.3, -4.0], &update);
            weights
        };
        assert_eq!(run(Method::AdamW, 0.0), run(Method::Adam, 0.0));
        assert_ne!(run(Method::AdamW, 0.5), run(Method::Adam, 0.5));
    }

    #[test]
    fn names_agree_with_serde() {
        let names = Method::ALL.map(|method| serde_json::to_value(method).unwrap().as_str().unwrap().to_string());
        assert_eq!(names.join(", "), Method::NAMES);
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

    #[test]
    fn the_annealed_rate_falls_and_rises_again() {
        let rate = |epoch| Schedule::CosineAnnealing.rate(1e-3, 1e-6, 30.0, epoch, 300.0);
        assert_eq!(rate(0.0), 1e-3);
        assert!((rate(30.0) - 1e-6).abs() < 1e-18);
        assert!((rate(15.0) - 0.5 * (1e-3 + 1e-6)).abs() < 1e-15);
        assert!((rate(60.0) - 1e-3).abs() < 1e-15);
    }

    #[test]
    fn the_plain_cosine_ends_at_its_minimum() {
        let rate = |epoch| Schedule::Cosine.rate(3e-3, 0.0, 1.0, epoch, 20.0);
        assert_eq!(rate(0.0), 3e-3);
        assert!(rate(20.0).abs() < 1e-18);
        assert!(rate(25.0).abs() < 1e-18);
        assert!((rate(10.0) - 1.5e-3).abs() < 1e-15);
    }
}
