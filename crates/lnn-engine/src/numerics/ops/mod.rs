//! The one table of operations: values and partial derivatives.
//!
//! Every operation occurs once, in [`table`](self) form, with its value and its first and second partial derivatives written over
//! [`Real`](crate::scalar::Real): the same lines serve floats, nested forward numbers and tapes, forward and reverse. Types that carry
//! derivatives generate their methods from the table.
//!
//! Kinks: the derivative of `|x|` at `x = +-0` is 0, and everything else follows from it: `max` and `min` give half to each side at a tie,
//! `relu'(0) = 0` (it is a [`select`](crate::scalar::Real::select) on `x > 0`). `NaN` never vanishes: if the argument is `NaN`, so are
//! value and derivatives.

mod activation;
mod binary;
mod unary;

pub use activation::Activation;
pub(crate) use activation::activations;
pub use binary::Binary;
pub use unary::Unary;
pub(crate) use unary::unary_methods;
