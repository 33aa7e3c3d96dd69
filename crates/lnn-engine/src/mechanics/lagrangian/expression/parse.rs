//! Parses a text into a tree: a tokenizer, then recursive descent that writes operands before operations.

use super::{Expression, ExpressionError, FUNCTIONS, Function, Node, PI, function};
use crate::lagrangian::thresholds::{MOST_CHARACTERS, MOST_NESTING};
use crate::names::nearest;
use crate::ops::{Binary, Unary};
use crate::scalar::{Dd, Scalar};
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::str::FromStr;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Parses a formula.
pub(super) fn parse(text: &str) -> Result<Expression, ExpressionError> {
    let mut parser = Parser { tokens: tokens(text)?, at: 0, depth: 0, nodes: Vec::new() };
    if parser.next().kind == Lexeme::End {
        return Err(ExpressionError::new(1, "expected a formula, found nothing"));
    }
    parser.sum()?;
    let rest = parser.next();
    match rest.kind {
        Lexeme::End => Ok(Expression { nodes: parser.nodes }),
        _ => Err(parser.unexpected("an operator or the end", rest)),
    }
}

struct Parser<'a> {
    tokens: Vec<Token<'a>>,
    at: usize,
    depth: usize,
    nodes: Vec<Node>,
}

type Outcome = Result<u32, ExpressionError>;

impl<'a> Parser<'a> {
    /// Returns the next token; after the last one, always the end.
    fn next(&self) -> Token<'a> {
        self.tokens[self.at.min(self.tokens.len() - 1)]
    }
    fn advance(&mut self) {
        self.at += 1;
    }
    /// Consumes the next token and returns `true` if it is this sign.
    fn takes(&mut self, sign: char) -> bool {
        let found = self.next().kind == Lexeme::Sign(sign);
        self.at += usize::from(found);
        found
    }
    fn push(&mut self, node: Node) -> u32 {
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }
    fn deeper(&mut self, inner: fn(&mut Self) -> Outcome) -> Outcome {
        if self.depth == MOST_NESTING {
            let problem = format!("expected at most {MOST_NESTING} parentheses, signs and powers within each other");
            return Err(ExpressionError::new(self.next().column, problem));
        }
        self.depth += 1;
        let outcome = inner(self);
        self.depth -= 1;
        outcome
    }

    fn sum(&mut self) -> Outcome {
        let mut left = self.product()?;
        loop {
            let operation = match self.next().kind {
                Lexeme::Sign('+') => Binary::Add,
                Lexeme::Sign('-') => Binary::Sub,
                _ => return Ok(left),
            };
            self.advance();
            let right = self.product()?;
            left = self.push(Node::Binary(operation, left, right));
        }
    }

    fn product(&mut self) -> Outcome {
        let mut left = self.sign()?;
        loop {
            let operation = match self.next().kind {
                Lexeme::Sign('*') => Binary::Mul,
                Lexeme::Sign('/') => Binary::Div,
                _ => return Ok(left),
            };
            self.advance();
            let right = self.sign()?;
            left = self.push(Node::Binary(operation, left, right));
        }
    }

    fn sign(&mut self) -> Outcome {
        if self.takes('-') {
            let operand = self.deeper(Self::sign)?;
            return Ok(self.push(Node::Unary(Unary::Neg, operand)));
        }
        self.power()
    }

    fn power(&mut self) -> Outcome {
        let base = self.atom()?;
        if self.takes('^') {
            let exponent = self.deeper(Self::sign)?;
            return Ok(self.push(Node::Binary(Binary::Powf, base, exponent)));
        }
        Ok(base)
    }

    fn atom(&mut self) -> Outcome {
        let token = self.next();
        match token.kind {
            Lexeme::Number(text) => {
                self.advance();
                self.number(text, token.column)
            }
            Lexeme::Name(name) => {
                self.advance();
                self.name(name, token.column)
            }
            Lexeme::Sign('(') => {
                self.advance();
                let inner = self.deeper(Self::sum)?;
                self.close(token.column)?;
                Ok(inner)
            }
            _ => Err(self.unexpected("a number, a name or a parenthesis", token)),
        }
    }

    fn number(&mut self, text: &str, column: usize) -> Outcome {
        let zero = text.bytes().take_while(|b| !matches!(b, b'e' | b'E')).all(|b| matches!(b, b'0' | b'.'));
        match Number::parse(text) {
            Some(number) if zero || !number.is(0.0) => Ok(self.push(Node::Number(text.to_string()))),
            _ => Err(ExpressionError::new(column, "expected a number from about 1e-307 to 1e308")),
        }
    }

    fn name(&mut self, name: &str, column: usize) -> Outcome {
        let called = self.next().kind == Lexeme::Sign('(');
        let found = match (function(name), called) {
            (Some(found), true) => found,
            (Some(_), false) => {
                let problem = format!("expected `(` behind the function `{name}`, found {}", self.next().shown());
                return Err(ExpressionError::new(self.next().column, problem));
            }
            (None, false) if name == PI => return Ok(self.push(Node::Pi)),
            (None, false) => return Ok(self.push(Node::Name(name.to_string(), column))),
            (None, true) => {
                let known = FUNCTIONS.iter().map(|(name, _)| *name);
                let hint = match nearest(name, known) {
                    Some(near) => format!("did you mean {near:?}?"),
                    None => "a product needs a *, as in 2*(a + b)".to_string(),
                };
                let shown: String = name.chars().take(40).collect();
                return Err(ExpressionError::new(column, format!("`{shown}` is not a function; {hint}")));
            }
        };
        let open = self.next().column;
        self.advance();
        let first = self.deeper(Self::sum)?;
        let node = match found {
            Function::One(function) => Node::Unary(function, first),
            Function::Two(function) => {
                if !self.takes(',') {
                    return Err(self.unexpected(&format!("a comma: `{name}` takes two numbers"), self.next()));
                }
                Node::Binary(function, first, self.deeper(Self::sum)?)
            }
        };
        if self.next().kind == Lexeme::Sign(',') {
            let count = if matches!(found, Function::One(_)) { "one number" } else { "two numbers" };
            return Err(self.unexpected(&format!("`)`: `{name}` takes {count}"), self.next()));
        }
        self.close(open)?;
        Ok(self.push(node))
    }

    fn close(&mut self, open: usize) -> Result<(), ExpressionError> {
        if self.takes(')') {
            return Ok(());
        }
        Err(self.unexpected(&format!("an operator or `)` for the `(` of column {open}"), self.next()))
    }

    fn unexpected(&self, expected: &str, found: Token<'_>) -> ExpressionError {
        let before = self.at.checked_sub(1).and_then(|at| self.tokens.get(at)).map(|token| token.kind);
        let hint = match (found.kind, before) {
            (
                Lexeme::Name(_) | Lexeme::Number(_) | Lexeme::Sign('('),
                Some(Lexeme::Name(_) | Lexeme::Number(_) | Lexeme::Sign(')')),
            ) => "; a product needs a *",
            (Lexeme::Sign('*'), Some(Lexeme::Sign('*'))) => "; a power is written ^",
            _ => "",
        };
        ExpressionError::new(found.column, format!("expected {expected}, found {}{hint}", found.shown()))
    }
}

impl FromStr for Expression {
    type Err = ExpressionError;

    fn from_str(text: &str) -> Result<Self, ExpressionError> {
        parse(text)
    }
}

/// A lexeme of a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lexeme<'a> {
    Number(&'a str),
    Name(&'a str),
    Sign(char),
    End,
}

/// A lexeme with its position.
#[derive(Clone, Copy, Debug)]
struct Token<'a> {
    pub kind: Lexeme<'a>,
    /// Number of the character, from 1.
    pub column: usize,
}

impl Token<'_> {
    /// Returns the lexeme for a message.
    pub fn shown(&self) -> String {
        match self.kind {
            Lexeme::Number(text) | Lexeme::Name(text) => format!("`{}`", text.chars().take(40).collect::<String>()),
            Lexeme::Sign(c) => format!("`{c}`"),
            Lexeme::End => "the end".to_string(),
        }
    }
}

fn begins_name(c: char) -> bool {
    c.is_alphabetic() || c == '_'
}

fn continues_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Returns `true` if a text is one name: a letter or `_`, then letters, digits and `_`.
pub fn is_name(text: &str) -> bool {
    text.starts_with(begins_name) && text.chars().all(continues_name) && text.chars().count() <= 64
}

/// Splits a text into tokens, including the end.
fn tokens(text: &str) -> Result<Vec<Token<'_>>, ExpressionError> {
    if text.chars().nth(MOST_CHARACTERS).is_some() {
        return Err(ExpressionError::new(1, format!("expected a formula of at most {MOST_CHARACTERS} characters")));
    }
    let (mut found, mut rest, mut column) = (Vec::new(), text, 1);
    while let Some(c) = rest.chars().next() {
        let length = if begins_name(c) {
            rest.find(|c| !continues_name(c)).unwrap_or(rest.len())
        } else if c.is_ascii_digit() || c == '.' {
            number_length(rest)
        } else {
            c.len_utf8()
        };
        let (piece, behind) = rest.split_at(length);
        if begins_name(c) {
            found.push(Token { kind: Lexeme::Name(piece), column });
        } else if c.is_ascii_digit() || (c == '.' && length > 1) {
            found.push(Token { kind: Lexeme::Number(piece), column });
        } else if "+-*/^(),".contains(c) {
            found.push(Token { kind: Lexeme::Sign(c), column });
        } else if !c.is_whitespace() {
            let shown = if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
            let problem = "expected a number, a name, an operator (+ - * / ^), a comma or a parenthesis";
            return Err(ExpressionError::new(column, format!("{problem}, found `{shown}`")));
        }
        (column, rest) = (column + piece.chars().count(), behind);
    }
    found.push(Token { kind: Lexeme::End, column });
    Ok(found)
}

/// Returns the length in bytes of the number at the start of a text: digits with an optional point, and an exponent if it has digits.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let whole = digits(0);
    let mut length = whole;
    if bytes.get(whole) == Some(&b'.') {
        let fraction = digits(whole + 1);
        length += 1 + fraction;
        if whole + fraction == 0 {
            return 1;
        }
    }
    if matches!(bytes.get(length), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(length + 1), Some(b'+' | b'-')));
        let exponent = digits((length + 1 + sign).min(bytes.len()));
        if exponent > 0 {
            length += 1 + sign + exponent;
        }
    }
    length
}

/// A decimal number: the nearest `f32` and the nearest [`Dd`], whose leading part is the nearest `f64`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Number {
    exact: Dd,
    single: f32,
}

impl Number {
    /// Parses decimal text in the syntax of the scalars; returns `None` if it is not finite.
    pub fn parse(text: &str) -> Option<Self> {
        let (exact, single) = (Dd::parse(text)?, f32::parse(text)?);
        exact.is_finite().then_some(Self { exact, single })
    }
    /// Returns a number that is exact in every precision.
    pub fn exact(value: f64) -> Self {
        Self { exact: Dd::of_f64(value), single: value as f32 }
    }
    /// Returns the number nearest to the decimal text.
    pub fn value<S: Scalar>(self) -> S {
        if S::NAME == f32::NAME { S::of_f64(f64::from(self.single)) } else { self.exact.cast() }
    }
    /// Returns its value if it is an integer that can be an exponent.
    pub fn integer(self) -> Option<i32> {
        let (high, low) = self.exact.parts();
        let whole = low == 0.0 && high.fract() == 0.0 && high.abs() <= f64::from(i32::MAX);
        whole.then_some(high as i32)
    }
    /// Returns `1 / x` if that is exact in every precision, that is, for a power of two of moderate size.
    pub fn exact_reciprocal(self) -> Option<Self> {
        let (high, low) = self.exact.parts();
        let power = low == 0.0 && high > 0.0 && high.log2().fract() == 0.0 && (-100.0..=100.0).contains(&high.log2());
        (power && high == 2f64.powi(high.log2() as i32)).then(|| Self::exact(1.0 / high))
    }
    /// Returns `true` if it equals this `f64`.
    pub fn is(self, value: f64) -> bool {
        self.exact.parts() == (value, 0.0)
    }
    /// Returns a key that equal numbers share.
    pub fn bits(self) -> (u64, u64, u32) {
        let (high, low) = self.exact.parts();
        (high.to_bits(), low.to_bits(), self.single.to_bits())
    }
}
