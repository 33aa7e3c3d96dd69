//! Formulas as text: `m*l^2*theta_dot^2/2 + m*g*l*cos(theta)`.
//!
//! ```text
//! sum     = product { ("+" | "-") product }
//! product = sign { ("*" | "/") sign }
//! sign    = "-" sign | power
//! power   = atom [ "^" sign ]                     a^b^c = a^(b^c), -a^2 = -(a^2)
//! atom    = number | "pi" | name | function "(" sum { "," sum } ")" | "(" sum ")"
//! ```
//!
//! [`Expression`] is what a text says; [`Compiler`] gives its names a meaning and shares what occurs twice; [`Formula`] is
//! the result, evaluated over any [`Real`](crate::scalar::Real): floats, forward numbers, tracers of a tape. Numbers keep their decimal text's
//! value in the precision they are evaluated in.

mod compile;
mod error;
mod formula;
mod parse;
#[cfg(test)]
mod tests;
mod token;
mod tree;

pub(super) use compile::{Compiler, Meaning, Value};
pub use error::ExpressionError;
pub(super) use formula::Formula;
pub(super) use token::is_name;
pub use tree::Expression;
pub(super) use tree::is_reserved;
