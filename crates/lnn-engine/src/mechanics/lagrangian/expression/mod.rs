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
//! [`Expression`] is a parsed text; [`Compiler`] resolves its names and shares common parts; [`Formula`] is the result, which can be
//! evaluated over any [`Real`](crate::scalar::Real): floats, forward-mode numbers, tracers of a tape. Decimal numbers are rounded only in
//! the precision of the evaluation.

mod compile;
mod parse;

pub(super) use compile::{Compiler, Formula, Meaning, Value};
pub(super) use parse::is_name;

use crate::lagrangian::Lagrangian;
use crate::ops::{Binary, Unary};
use crate::scalar::Real;
#[cfg(feature = "serde")]
use crate::scalar::Scalar;
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;

/// An error in the text of a formula.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExpressionError {
    /// Position of the error in the text: the number of the character, from 1.
    pub column: usize,
    /// The error, and what was expected.
    pub problem: String,
}

impl fmt::Display for ExpressionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { column, problem } = self;
        write!(f, "column {column}: {problem}")
    }
}

impl core::error::Error for ExpressionError {}

impl ExpressionError {
    pub(in crate::mechanics::lagrangian) fn new(column: usize, problem: impl Into<String>) -> Self {
        Self { column, problem: problem.into() }
    }
}

/// A node of a formula; its operands are earlier nodes.
#[derive(Clone, Debug, PartialEq)]
enum Node {
    /// A decimal number without a sign.
    Number(String),
    /// The constant pi.
    Pi,
    /// A name and its column.
    Name(String, usize),
    /// A function of one number, or a minus sign.
    Unary(Unary, u32),
    /// A function of two numbers, or an operator; `^` is [`Binary::Powf`].
    Binary(Binary, u32, u32),
}

/// A formula as a tree, such as `m*l^2*theta_dot^2/2`; [`fmt::Display`] writes text that parses to the same formula.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    /// Nodes in order, operands before operations; the last one is the whole formula.
    nodes: Vec<Node>,
}

impl Expression {
    /// Returns the names in the formula, in order and with repetitions.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.nodes.iter().filter_map(|node| match node {
            Node::Name(name, _) => Some(name.as_str()),
            _ => None,
        })
    }
}

/// Precedence of a node: sums, products, signs, powers, atoms.
const SUM: u8 = 0;
const PRODUCT: u8 = 1;
const SIGN: u8 = 2;
const POWER: u8 = 3;
const ATOM: u8 = 4;

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Every node is an operand exactly once, so its text can be moved.
        let mut texts: Vec<(String, u8)> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let mut operand = |index: u32, least: u8| {
                let (text, level) = core::mem::take(&mut texts[index as usize]);
                if level < least { format!("({text})") } else { text }
            };
            let joined = |a: String, sign: &str, b: String| format!("{a}{sign}{b}");
            let text = match node {
                Node::Number(text) => (text.clone(), ATOM),
                Node::Pi => (PI.to_string(), ATOM),
                Node::Name(name, _) => (name.clone(), ATOM),
                Node::Unary(Unary::Neg, a) => (format!("-{}", operand(*a, SIGN)), SIGN),
                Node::Unary(function, a) => {
                    (format!("{}({})", name_of(Function::One(*function)).unwrap_or("?"), operand(*a, SUM)), ATOM)
                }
                Node::Binary(Binary::Add, a, b) => (joined(operand(*a, SUM), " + ", operand(*b, PRODUCT)), SUM),
                Node::Binary(Binary::Sub, a, b) => (joined(operand(*a, SUM), " - ", operand(*b, PRODUCT)), SUM),
                Node::Binary(Binary::Mul, a, b) => (joined(operand(*a, PRODUCT), "*", operand(*b, SIGN)), PRODUCT),
                Node::Binary(Binary::Div, a, b) => (joined(operand(*a, PRODUCT), "/", operand(*b, SIGN)), PRODUCT),
                Node::Binary(Binary::Powf, a, b) => (joined(operand(*a, ATOM), "^", operand(*b, SIGN)), POWER),
                Node::Binary(function, a, b) => {
                    let name = name_of(Function::Two(*function)).unwrap_or("?");
                    (format!("{name}({}, {})", operand(*a, SUM), operand(*b, SUM)), ATOM)
                }
            };
            texts.push(text);
        }
        f.write_str(texts.last().map_or("", |(text, _)| text))
    }
}

/// A function by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Function {
    One(Unary),
    Two(Binary),
}

/// All functions; if a function has two names, the first one is written.
const FUNCTIONS: [(&str, Function); 26] = [
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

/// Name of the constant pi.
const PI: &str = "pi";

/// Returns the function with a name.
fn function(name: &str) -> Option<Function> {
    FUNCTIONS.iter().find(|(known, _)| *known == name).map(|(_, function)| *function)
}

/// Returns the name of a function; `None` for operators.
fn name_of(function: Function) -> Option<&'static str> {
    FUNCTIONS.iter().find(|(_, known)| *known == function).map(|(name, _)| *name)
}

/// Returns `true` if a name has a fixed meaning in every formula.
pub(super) fn is_reserved(name: &str) -> bool {
    name == PI || function(name).is_some()
}

/// Evaluates a decimal number or a formula of numbers, such as `2*pi`, in the precision of `S`.
///
/// # Errors
/// An error in the formula, with its column.
#[cfg(feature = "serde")]
pub fn quantity<S: Scalar>(text: &str) -> Result<S, ExpressionError> {
    if let Some(number) = S::parse(text.trim()) {
        return Ok(number);
    }
    let expression: Expression = text.parse()?;
    let mut compiler = Compiler::default();
    let value = compiler.add(&expression, &BTreeMap::new(), true)?;
    Ok(compiler.formula(value).evaluate::<S>(&[], &[], &[]))
}

/// A formula with named variables, such as `0.3*cos(1.2*t)` of the variable `t`.
#[derive(Clone, Debug)]
pub struct NamedFormula {
    /// Its variables, without repetitions.
    pub names: Vec<String>,
    formula: Arc<Formula>,
}

impl NamedFormula {
    /// Evaluates the formula for these values of its variables.
    pub fn value(&self, values: &[f64]) -> f64 {
        self.formula.evaluate(values, &[], &[])
    }
}

impl core::str::FromStr for NamedFormula {
    type Err = ExpressionError;

    fn from_str(text: &str) -> Result<Self, ExpressionError> {
        let expression: Expression = text.parse()?;
        let mut names: Vec<String> = expression.names().map(ToString::to_string).collect();
        names.sort();
        names.dedup();
        let scope = names.iter().enumerate().map(|(i, name)| (name.clone(), Meaning::Parameter(i))).collect();
        let mut compiler = Compiler::default();
        let value = compiler.add(&expression, &scope, false)?;
        Ok(Self { names, formula: Arc::new(compiler.formula(value)) })
    }
}

/// A Lagrangian `L(q, v; parameters)` given by a formula such as `m*l^2*theta_dot^2/2 + m*g*l*cos(theta)`.
///
/// ```
/// use lnn::lagrangian::{EulerLagrange, ExpressionLagrangian, Mechanics, Request, Terms};
///
/// let formula = "l^2*theta_dot^2/2 + g*l*cos(theta)";
/// let pendulum = ExpressionLagrangian::new(&["theta"], &["l", "g"], formula).unwrap();
/// let pendulum = Mechanics::new(pendulum, vec![2.0, 9.8]);
/// let mut terms = Terms::default();
/// pendulum.terms(&[0.5], &[1.0], Request::ALL, &mut terms).unwrap();
/// assert_eq!(format!("{:.6}", terms.acceleration[0]), "-2.349185");
/// ```
#[derive(Clone, Debug)]
pub struct ExpressionLagrangian {
    coordinates: usize,
    parameters: usize,
    value: Arc<Formula>,
}

impl ExpressionLagrangian {
    /// Compiles a formula of coordinates, their velocities `NAME_dot`, and parameters, which are given later in the same order.
    ///
    /// # Errors
    /// An error in the formula, with its column.
    pub fn new(coordinates: &[&str], parameters: &[&str], formula: &str) -> Result<Self, ExpressionError> {
        let expression: Expression = formula.parse()?;
        let positions = coordinates.iter().enumerate().map(|(i, name)| (name.to_string(), Meaning::Position(i)));
        let velocities = coordinates.iter().enumerate().map(|(i, name)| (format!("{name}_dot"), Meaning::Velocity(i)));
        let count = parameters.len();
        let parameters = parameters.iter().enumerate().map(|(i, name)| (name.to_string(), Meaning::Parameter(i)));
        let scope: BTreeMap<String, Meaning> = parameters.chain(velocities).chain(positions).collect();
        let mut compiler = Compiler::default();
        let value = compiler.add(&expression, &scope, false)?;
        Ok(Self::compiled((coordinates.len(), count), compiler.formula(value)))
    }

    /// Returns the Lagrangian of `n` coordinates with a compiled formula and a number of parameters.
    pub(in crate::mechanics::lagrangian) fn compiled(
        (coordinates, parameters): (usize, usize),
        value: Formula,
    ) -> Self {
        Self { coordinates, parameters, value: Arc::new(value) }
    }
}

impl Lagrangian for ExpressionLagrangian {
    fn coordinates(&self) -> usize {
        self.coordinates
    }
    fn parameter_count(&self) -> Option<usize> {
        Some(self.parameters)
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        self.value.evaluate(parameters, q, v)
    }
}

#[cfg(test)]
mod tests;
