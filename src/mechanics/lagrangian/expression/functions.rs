//! Names of the functions of formulas: rows of the table of operations.

use crate::ops::{Binary, Unary};

/// A function by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    One(Unary),
    Two(Binary),
}

/// All functions; of two names for the same one the first is written.
pub(super) const FUNCTIONS: [(&str, Function); 26] = [
    ("sqrt", Function::One(Unary::Sqrt)),
    ("exp", Function::One(Unary::Exp)),
    ("expm1", Function::One(Unary::ExpM1)),
    ("ln", Function::One(Unary::Ln)),
    ("log", Function::One(Unary::Ln)),
    ("ln1p", Function::One(Unary::Ln1p)),
    ("sin", Function::One(Unary::Sin)),
    ("cos", Function::One(Unary::Cos)),
    ("tan", Function::One(Unary::Tan)),
    ("asin", Function::One(Unary::Asin)),
    ("acos", Function::One(Unary::Acos)),
    ("atan", Function::One(Unary::Atan)),
    ("sinh", Function::One(Unary::Sinh)),
    ("cosh", Function::One(Unary::Cosh)),
    ("tanh", Function::One(Unary::Tanh)),
    ("erfc", Function::One(Unary::Erfc)),
    ("logistic", Function::One(Unary::Logistic)),
    ("softplus", Function::One(Unary::Softplus)),
    ("abs", Function::One(Unary::Abs)),
    ("recip", Function::One(Unary::Recip)),
    ("arcsin", Function::One(Unary::Asin)),
    ("arccos", Function::One(Unary::Acos)),
    ("arctan", Function::One(Unary::Atan)),
    ("atan2", Function::Two(Binary::Atan2)),
    ("max", Function::Two(Binary::Max)),
    ("min", Function::Two(Binary::Min)),
];

/// The circle constant.
pub(super) const PI: &str = "pi";

/// The function of a name.
pub(super) fn function(name: &str) -> Option<Function> {
    FUNCTIONS.iter().find(|(known, _)| *known == name).map(|(_, function)| *function)
}

/// The name of a function, which the operators do not have.
pub(super) fn name_of(function: Function) -> Option<&'static str> {
    FUNCTIONS.iter().find(|(_, known)| *known == function).map(|(name, _)| *name)
}

/// `true` if a name means something in every formula.
pub fn is_reserved(name: &str) -> bool {
    name == PI || function(name).is_some()
}
