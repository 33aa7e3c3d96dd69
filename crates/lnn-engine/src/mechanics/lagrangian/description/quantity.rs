//! Numbers of a description, written as numbers or as text.

use alloc::string::String;

#[cfg(feature = "serde")]
use serde::Serialize;

/// A bound or a time: a number, or a formula of numbers such as `"-pi/2"`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize), serde(transparent))]
pub struct Quantity(pub f64);

/// A parameter's value as decimal text, written as a number or as text; all digits are used if the precision allows.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize), serde(transparent))]
pub struct Decimal(pub String);
