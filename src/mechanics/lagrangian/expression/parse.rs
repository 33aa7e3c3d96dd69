//! The grammar: recursive descent that writes operands before what is made of them.

use super::error::ExpressionError;
use super::token::Number;
use super::token::{Kind, Token, tokens};
use super::tree::{Expression, Node};
use super::tree::{FUNCTIONS, Function, PI, function};
use crate::names::nearest;
use crate::ops::{Binary, Unary};
use std::str::FromStr;

/// Deepest nesting of parentheses, signs and powers: far more than anybody writes, far less than the stack holds.
const MAX_DEPTH: usize = 100;

/// Reads a formula.
pub(super) fn parse(text: &str) -> Result<Expression, ExpressionError> {
    let mut parser = Parser { tokens: tokens(text)?, at: 0, depth: 0, nodes: Vec::new() };
    if parser.next().kind == Kind::End {
        return Err(ExpressionError::new(1, "expected a formula, found nothing"));
    }
    parser.sum()?;
    let rest = parser.next();
    match rest.kind {
        Kind::End => Ok(Expression { nodes: parser.nodes }),
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
    /// The token that comes next; the end comes again and again.
    fn next(&self) -> Token<'a> {
        self.tokens[self.at.min(self.tokens.len() - 1)]
    }
    fn advance(&mut self) {
        self.at += 1;
    }
    /// `true` if a sign comes next, which is taken then.
    fn takes(&mut self, sign: char) -> bool {
        let found = self.next().kind == Kind::Sign(sign);
        self.at += usize::from(found);
        found
    }
    fn push(&mut self, node: Node) -> u32 {
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }
    fn deeper(&mut self, inner: fn(&mut Self) -> Outcome) -> Outcome {
        if self.depth == MAX_DEPTH {
            let problem = format!("expected at most {MAX_DEPTH} parentheses, signs and powers within each other");
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
                Kind::Sign('+') => Binary::Add,
                Kind::Sign('-') => Binary::Sub,
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
                Kind::Sign('*') => Binary::Mul,
                Kind::Sign('/') => Binary::Div,
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
            Kind::Number(text) => {
                self.advance();
                self.number(text, token.column)
            }
            Kind::Name(name) => {
                self.advance();
                self.name(name, token.column)
            }
            Kind::Sign('(') => {
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
        let called = self.next().kind == Kind::Sign('(');
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
                return Err(ExpressionError::new(column, format!("`{shown}` is no function; {hint}")));
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
        if self.next().kind == Kind::Sign(',') {
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
                Kind::Name(_) | Kind::Number(_) | Kind::Sign('('),
                Some(Kind::Name(_) | Kind::Number(_) | Kind::Sign(')')),
            ) => "; a product needs a *",
            (Kind::Sign('*'), Some(Kind::Sign('*'))) => "; a power is written ^",
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
