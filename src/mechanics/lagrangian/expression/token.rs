//! A text cut into numbers, names and signs.

use super::error::ExpressionError;
use crate::scalar::{Dd, Scalar};

/// Most characters of a formula.
const MAX_CHARACTERS: usize = 1 << 16;

/// A piece of a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind<'a> {
    Number(&'a str),
    Name(&'a str),
    Sign(char),
    End,
}

/// A piece with its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Token<'a> {
    pub kind: Kind<'a>,
    /// Character, from 1.
    pub column: usize,
}

impl Token<'_> {
    /// The piece in a message.
    pub fn shown(&self) -> String {
        match self.kind {
            Kind::Number(text) | Kind::Name(text) => format!("`{}`", text.chars().take(40).collect::<String>()),
            Kind::Sign(c) => format!("`{c}`"),
            Kind::End => "the end".to_string(),
        }
    }
}

fn begins_name(c: char) -> bool {
    c.is_alphabetic() || c == '_'
}

fn continues_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// `true` if a text is one name: a letter or `_`, then letters, digits and `_`.
pub fn is_name(text: &str) -> bool {
    text.starts_with(begins_name) && text.chars().all(continues_name) && text.chars().count() <= 64
}

/// The pieces of a text, the end among them.
pub(super) fn tokens(text: &str) -> Result<Vec<Token<'_>>, ExpressionError> {
    if text.chars().nth(MAX_CHARACTERS).is_some() {
        return Err(ExpressionError::new(1, format!("expected a formula of at most {MAX_CHARACTERS} characters")));
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
            found.push(Token { kind: Kind::Name(piece), column });
        } else if c.is_ascii_digit() || (c == '.' && length > 1) {
            found.push(Token { kind: Kind::Number(piece), column });
        } else if "+-*/^(),".contains(c) {
            found.push(Token { kind: Kind::Sign(c), column });
        } else if !c.is_whitespace() {
            let shown = if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
            let problem = "expected a number, a name, an operator (+ - * / ^), a comma or a parenthesis";
            return Err(ExpressionError::new(column, format!("{problem}, found `{shown}`")));
        }
        (column, rest) = (column + piece.chars().count(), behind);
    }
    found.push(Token { kind: Kind::End, column });
    Ok(found)
}

/// Bytes of the number that a text begins with: digits, a point among them, and an exponent if there are digits in it.
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
    /// Reads decimal text that a scalar's own parser takes; `None` for what is not finite.
    pub fn parse(text: &str) -> Option<Self> {
        let (exact, single) = (Dd::parse(text)?, f32::parse(text)?);
        exact.is_finite().then_some(Self { exact, single })
    }
    /// A number that every precision has.
    pub fn exact(value: f64) -> Self {
        Self { exact: Dd::of_f64(value), single: value as f32 }
    }
    /// The number nearest to the decimal text.
    pub fn value<S: Scalar>(self) -> S {
        if S::NAME == f32::NAME { S::of_f64(f64::from(self.single)) } else { self.exact.cast() }
    }
    /// Its value if it is a whole one that is an exponent.
    pub fn integer(self) -> Option<i32> {
        let (high, low) = self.exact.parts();
        let whole = low == 0.0 && high.fract() == 0.0 && high.abs() <= f64::from(i32::MAX);
        whole.then_some(high as i32)
    }
    /// `1 / x` if that is exact in every precision: `x` a power of two of moderate size.
    pub fn exact_reciprocal(self) -> Option<Self> {
        let (high, low) = self.exact.parts();
        let power = low == 0.0 && high > 0.0 && high.log2().fract() == 0.0 && (-100.0..=100.0).contains(&high.log2());
        (power && high == 2f64.powi(high.log2() as i32)).then(|| Self::exact(1.0 / high))
    }
    /// `true` if it is this `f64`.
    pub fn is(self, value: f64) -> bool {
        self.exact.parts() == (value, 0.0)
    }
    /// Key that equal numbers share.
    pub fn bits(self) -> (u64, u64, u32) {
        let (high, low) = self.exact.parts();
        (high.to_bits(), low.to_bits(), self.single.to_bits())
    }
}
