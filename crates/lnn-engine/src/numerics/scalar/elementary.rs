//! Functions of one number, for the chain rule.

use super::Real;

/// An elementary function of one number with its derivatives.
pub trait Elementary: Copy + 'static {
    /// `f(x)`.
    fn value<R: Real>(self, x: R) -> R;
    /// `(f(x), f'(x))`.
    fn value_first<R: Real>(self, x: R) -> (R, R);
    /// `(f(x), f'(x), f''(x))`.
    fn jet<R: Real>(self, x: R) -> (R, R, R);
}
