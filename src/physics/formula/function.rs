//! Functions of the coordinates in the terms of a Lagrangian.

use super::thresholds::MOST_COORDINATES;
use crate::forward::Dual;
use crate::lagrangian::{ExpressionError, ExpressionLagrangian, Lagrangian};
use crate::scalar::Real;

/// A factor of a function.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Factor {
    /// `q_i^k`.
    Power(usize, i32),
    /// `(q_i^2 + q_j^2 + ..)^(k/2)` over some coordinates.
    Radius(Vec<usize>, i32),
    /// `sin(m.q)` with integers `m`, the first nonzero one positive.
    Sine(Vec<i32>),
    /// `cos(m.q)`.
    Cosine(Vec<i32>),
}

/// A function of the coordinates: a product of factors, or a formula.
#[derive(Clone, Debug)]
pub(super) enum Function {
    Product(Vec<Factor>),
    Formula(String, ExpressionLagrangian),
}

/// Value and gradient of a function.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Taylor {
    pub value: f64,
    pub gradient: [f64; MOST_COORDINATES],
}

impl PartialEq for Function {
    /// Compares formulas by their texts.
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Product(a), Self::Product(b)) => a == b,
            (Self::Formula(a, _), Self::Formula(b, _)) => a == b,
            _ => false,
        }
    }
}

impl Factor {
    fn value<R: Real>(&self, q: &[R]) -> R {
        match self {
            Self::Power(i, k) => q[*i].powi(*k),
            Self::Radius(list, k) => {
                let square = list.iter().fold(R::zero(), |sum, &i| sum + q[i] * q[i]);
                if k % 2 == 0 { square.powi(k / 2) } else { square.sqrt().powi(*k) }
            }
            Self::Sine(m) => phase(m, q).sin(),
            Self::Cosine(m) => phase(m, q).cos(),
        }
    }

    fn written(&self, names: &[String], exponent: i32, notation: Notation) -> String {
        match self {
            Self::Power(i, k) => notation.power(&names[*i], k * exponent),
            Self::Radius(list, k) => {
                let sum = list.iter().map(|&i| notation.power(&names[i], 2)).collect::<Vec<_>>().join(" + ");
                match k * exponent {
                    k if k % 2 == 0 => notation.power(&format!("({sum})"), k / 2),
                    k => notation.root(&sum, k),
                }
            }
            Self::Sine(m) => notation.call("sin", m, names, exponent),
            Self::Cosine(m) => notation.call("cos", m, names, exponent),
        }
    }

    /// Complexity, by which equally good terms are ranked.
    fn complexity(&self) -> f64 {
        match self {
            Self::Power(_, k) => f64::from(k.abs()) + if *k < 0 { 0.5 } else { 0.0 },
            Self::Radius(_, k) => f64::from(k.abs()) + 0.6,
            Self::Sine(m) | Self::Cosine(m) => 0.5 + f64::from(m.iter().map(|m| m.abs()).sum::<i32>()),
        }
    }
}

fn phase<R: Real>(harmonics: &[i32], q: &[R]) -> R {
    let parts = harmonics.iter().zip(q).filter(|(m, _)| **m != 0);
    parts.fold(R::zero(), |sum, (m, &q)| sum + if *m == 1 { q } else { R::of(f64::from(*m)) * q })
}

/// `2*q1 - q2`.
fn angle(harmonics: &[i32], names: &[String], product: &str) -> String {
    let mut text = String::new();
    for (&m, name) in harmonics.iter().zip(names).filter(|(m, _)| **m != 0) {
        let sign = match (text.is_empty(), m < 0) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        };
        let times = if m.abs() == 1 { String::new() } else { format!("{}{product}", m.abs()) };
        text += &format!("{sign}{times}{name}");
    }
    text
}

/// A notation for formulas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Notation {
    /// The grammar of system files.
    System,
    /// LaTeX.
    Latex,
    /// Rust over `Real`.
    Rust,
}

impl Notation {
    /// `base^k`.
    pub fn power(self, base: &str, k: i32) -> String {
        match (self, k) {
            (_, 1) => base.to_string(),
            (Self::System, 0..) => format!("{base}^{k}"),
            (Self::System, _) => format!("{base}^({k})"),
            (Self::Latex, _) => format!("{base}^{{{k}}}"),
            (Self::Rust, 2) => format!("{base}.sqr()"),
            (Self::Rust, _) => format!("{base}.powi({k})"),
        }
    }

    /// `sqrt(sum)^k`, `k` odd.
    fn root(self, sum: &str, k: i32) -> String {
        match (self, k) {
            (Self::System, _) => self.power(&format!("sqrt({sum})"), k),
            (Self::Latex, 1) => format!("\\sqrt{{{sum}}}"),
            (Self::Latex, _) => format!("({sum})^{{{k}/2}}"),
            (Self::Rust, _) => self.power(&format!("({sum}).sqrt()"), k),
        }
    }

    /// `f(m.q)^k`.
    fn call(self, f: &str, harmonics: &[i32], names: &[String], k: i32) -> String {
        match self {
            Self::System => self.power(&format!("{f}({})", angle(harmonics, names, "*")), k),
            Self::Latex => self.power(&format!("\\{f}"), k) + &format!("({})", angle(harmonics, names, "")),
            Self::Rust => {
                let parts = harmonics.iter().zip(names).filter(|(m, _)| **m != 0);
                let part = |(m, name): (&i32, &String)| match m {
                    1 => name.clone(),
                    m => format!("{name} * R::of({m}.0)"),
                };
                let sum = parts.map(part).collect::<Vec<_>>().join(" + ");
                self.power(&format!("({sum}).{f}()"), k)
            }
        }
    }

    /// The product of factors.
    pub fn product(self, factors: &[String]) -> String {
        factors.join(match self {
            Self::System => "*",
            Self::Latex => "\\,",
            Self::Rust => " * ",
        })
    }
}

impl Function {
    /// A formula of coordinates.
    ///
    /// # Errors
    /// A mistake in the formula, with its column.
    pub fn formula(names: &[String], text: &str) -> Result<Self, ExpressionError> {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let compiled = ExpressionLagrangian::new(&names, &[], text)?;
        Ok(Self::Formula(text.to_string(), compiled))
    }

    /// Value at `q`.
    pub fn value<R: Real>(&self, q: &[R]) -> R {
        match self {
            Self::Product(factors) => match factors.split_first() {
                Some((first, rest)) => rest.iter().fold(first.value(q), |product, factor| product * factor.value(q)),
                None => R::one(),
            },
            Self::Formula(_, formula) => {
                let n = formula.coordinates();
                formula.lagrangian(&[], &q[..n], &vec![R::zero(); n])
            }
        }
    }

    /// The coordinate `i` itself.
    pub fn coordinate(i: usize) -> Self {
        Self::Product(vec![Factor::Power(i, 1)])
    }

    /// Value at `q` and gradient with respect to the first `n` numbers; a phase may follow them.
    pub fn taylor(&self, q: &[f64], n: usize) -> Taylor {
        let mut found = Taylor::default();
        if self.is_one() {
            found.value = 1.0;
            return found;
        }
        let mut point = [Dual::lift(0.0); MOST_COORDINATES + 1];
        let point = &mut point[..q.len()];
        point.iter_mut().zip(q).for_each(|(point, &q)| point.value = q);
        for i in 0..n {
            point[i].tangent = 1.0;
            let at = self.value(point);
            point[i].tangent = 0.0;
            (found.value, found.gradient[i]) = (at.value, at.tangent);
        }
        found
    }

    /// `true` for a formula that contains a velocity.
    pub fn moves(&self) -> bool {
        let Self::Formula(_, formula) = self else { return false };
        let n = formula.coordinates();
        let q: Vec<f64> = (0..n).map(|i| 0.37 + 0.11 * i as f64).collect();
        let at = |v: f64| formula.lagrangian(&[], &q, &vec![v; n]);
        at(0.3) != at(0.7) && !at(0.3).is_nan()
    }

    /// Coordinates that it depends on, of `n`.
    pub fn coordinates(&self, n: usize) -> Vec<usize> {
        let q: Vec<f64> = (0..=n).map(|i| 0.37 + 0.11 * i as f64).collect();
        let slopes = self.taylor(&q, n).gradient;
        // Outside its domain a formula may depend on anything.
        (0..n).filter(|&i| slopes[i] != 0.0).collect()
    }

    /// `true` for the function 1.
    pub fn is_one(&self) -> bool {
        matches!(self, Self::Product(factors) if factors.is_empty())
    }

    /// `true` if it depends on the phase that follows `n` coordinates.
    pub fn has_phase(&self, n: usize) -> bool {
        let has = |factor: &Factor| matches!(factor, Factor::Sine(m) | Factor::Cosine(m) if m.get(n).is_some_and(|m| *m != 0));
        matches!(self, Self::Product(factors) if factors.iter().any(has))
    }

    /// `true` for products of powers, sines and cosines without a pole.
    pub fn is_smooth(&self) -> bool {
        let smooth = |factor: &Factor| match factor {
            Factor::Power(_, k) => *k > 0,
            Factor::Radius(..) => false,
            Factor::Sine(_) | Factor::Cosine(_) => true,
        };
        matches!(self, Self::Product(factors) if factors.iter().all(smooth))
    }

    /// Product with another function.
    pub fn product(&self, other: &Self) -> Option<Self> {
        match (self, other) {
            (Self::Product(a), Self::Product(b)) => Some(Self::Product([a.clone(), b.clone()].concat())),
            _ => None,
        }
    }

    /// Complexity, by which equally good terms are ranked.
    pub fn complexity(&self) -> f64 {
        match self {
            Self::Product(factors) => factors.iter().map(Factor::complexity).sum(),
            Self::Formula(..) => 1.5,
        }
    }

    /// Its factors as text.
    pub fn written(&self, names: &[String], notation: Notation) -> Vec<String> {
        match self {
            Self::Product(factors) => {
                let mut powers: Vec<(&Factor, i32)> = Vec::new();
                for factor in factors {
                    match powers.iter_mut().find(|(known, _)| *known == factor) {
                        Some((_, power)) => *power += 1,
                        None => powers.push((factor, 1)),
                    }
                }
                powers.into_iter().map(|(factor, power)| factor.written(names, power, notation)).collect()
            }
            Self::Formula(text, _) => vec![match notation {
                Notation::Latex => format!("\\left(\\mathtt{{{text}}}\\right)"),
                Notation::System | Notation::Rust => format!("({text})"),
            }],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names() -> Vec<String> {
        ["x", "y", "a"].map(String::from).to_vec()
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let functions = [
            Function::Product(vec![Factor::Power(0, 3), Factor::Sine(vec![0, 0, 2])]),
            Function::Product(vec![Factor::Radius(vec![0, 1], -3), Factor::Power(1, 1), Factor::Cosine(vec![0, 0, 1])]),
            Function::Product(vec![Factor::Sine(vec![0, 1, -1]), Factor::Sine(vec![0, 1, -1])]),
            Function::formula(&names(), "exp(-x*y) + cos(a)^2").unwrap(),
        ];
        let q = [0.7, -1.1, 0.4];
        for function in functions {
            let at = function.taylor(&q, 3);
            for i in 0..3 {
                let moved = |h: f64| {
                    let mut q = q;
                    q[i] += h;
                    function.taylor(&q, 3)
                };
                let (up, down) = (moved(1e-5), moved(-1e-5));
                assert!(((up.value - down.value) / 2e-5 - at.gradient[i]).abs() < 1e-8, "{function:?}");
            }
        }
    }

    #[test]
    fn texts_are_formulas_of_the_same_function() {
        let function = Function::Product(vec![
            Factor::Power(0, -2),
            Factor::Radius(vec![0, 1], 3),
            Factor::Sine(vec![0, 0, 2]),
            Factor::Sine(vec![0, 0, 2]),
        ]);
        let text = function.written(&names(), Notation::System).join("*");
        let again = Function::formula(&names(), &text).unwrap();
        let q = [0.7, -1.1, 0.4];
        assert!((function.taylor(&q, 3).value - again.taylor(&q, 3).value).abs() < 1e-14, "{text}");
        assert_eq!(function.written(&names(), Notation::Latex)[2], "\\sin^{2}(2a)");
    }
}
