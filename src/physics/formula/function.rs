//! Functions of the coordinates that terms of a Lagrangian are made of.

use crate::forward::HyperDual;
use crate::lagrangian::{ExpressionError, ExpressionLagrangian, Lagrangian};

/// Coordinates at most.
pub(super) const MOST_COORDINATES: usize = 8;

/// A factor of a function.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Factor {
    /// `q_i^k`.
    Power(usize, i32),
    /// `(q_i^2 + q_j^2 + ..)^(k/2)` over some coordinates.
    Radius(Vec<usize>, i32),
    /// `sin(m.q)` of whole numbers `m`, the first of them that is not 0 positive.
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

/// Value, gradient and Hessian of a function, the Hessian `(n, n)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taylor {
    pub value: f64,
    pub gradient: [f64; MOST_COORDINATES],
    pub hessian: [[f64; MOST_COORDINATES]; MOST_COORDINATES],
}

impl Taylor {
    fn constant(value: f64) -> Self {
        Self { value, gradient: [0.0; _], hessian: [[0.0; _]; _] }
    }

    /// `self` times a function with the value `value`, whose gradient and Hessian are given by entry.
    fn times(
        &mut self,
        n: usize,
        value: f64,
        gradient: &[f64; MOST_COORDINATES],
        hessian: impl Fn(usize, usize) -> f64,
    ) {
        for i in 0..n {
            for j in 0..n {
                self.hessian[i][j] = self.hessian[i][j] * value
                    + self.gradient[i] * gradient[j]
                    + gradient[i] * self.gradient[j]
                    + self.value * hessian(i, j);
            }
        }
        for i in 0..n {
            self.gradient[i] = self.gradient[i] * value + self.value * gradient[i];
        }
        self.value *= value;
    }

    /// `self` times `f(m.q)` with the derivatives of `f`.
    fn times_wave(&mut self, n: usize, harmonics: &[i32], [value, first, second]: [f64; 3]) {
        let m = |i: usize| f64::from(harmonics[i]);
        let mut gradient = [0.0; MOST_COORDINATES];
        (0..n).for_each(|i| gradient[i] = first * m(i));
        self.times(n, value, &gradient, |i, j| second * m(i) * m(j));
    }
}

impl Factor {
    fn multiply(&self, q: &[f64], into: &mut Taylor) {
        let n = q.len();
        match self {
            Self::Power(at, k) => {
                let (x, power) = (q[*at], f64::from(*k));
                let mut gradient = [0.0; MOST_COORDINATES];
                gradient[*at] = power * x.powi(k - 1);
                let second = if *k == 1 { 0.0 } else { power * (power - 1.0) * x.powi(k - 2) };
                into.times(n, x.powi(*k), &gradient, |i, j| if i == *at && j == *at { second } else { 0.0 });
            }
            Self::Radius(coordinates, k) => {
                let (square, power) = (coordinates.iter().map(|&i| q[i] * q[i]).sum::<f64>(), f64::from(*k));
                let value = square.powf(power / 2.0);
                let (first, second) = (power * value / square, power * (power - 2.0) * value / (square * square));
                let mut gradient = [0.0; MOST_COORDINATES];
                coordinates.iter().for_each(|&i| gradient[i] = first * q[i]);
                let inside = |i: usize| coordinates.contains(&i);
                into.times(n, value, &gradient, |i, j| {
                    let both = if inside(i) && inside(j) { second * q[i] * q[j] } else { 0.0 };
                    if i == j && inside(i) { both + first } else { both }
                });
            }
            Self::Sine(m) => {
                let (sine, cosine) = phase(m, q).sin_cos();
                into.times_wave(n, m, [sine, cosine, -sine]);
            }
            Self::Cosine(m) => {
                let (sine, cosine) = phase(m, q).sin_cos();
                into.times_wave(n, m, [cosine, -sine, -cosine]);
            }
        }
    }

    fn text(&self, names: &[String], exponent: i32) -> String {
        let power = |base: String, k: i32| if k == 1 { base } else { format!("{base}^{}", signed(k)) };
        match self {
            Self::Power(i, k) => power(names[*i].clone(), k * exponent),
            Self::Radius(list, k) => {
                let sum = list.iter().map(|&i| format!("{}^2", names[i])).collect::<Vec<_>>().join(" + ");
                match k * exponent {
                    k if k % 2 == 0 => power(format!("({sum})"), k / 2),
                    k => power(format!("sqrt({sum})"), k),
                }
            }
            Self::Sine(m) => power(format!("sin({})", angle(m, names, "*")), exponent),
            Self::Cosine(m) => power(format!("cos({})", angle(m, names, "*")), exponent),
        }
    }

    fn latex(&self, names: &[String], exponent: i32) -> String {
        let power = |base: String, k: i32| if k == 1 { base } else { format!("{base}^{{{k}}}") };
        match self {
            Self::Power(i, k) => power(names[*i].clone(), k * exponent),
            Self::Radius(list, k) => {
                let sum = list.iter().map(|&i| format!("{}^2", names[i])).collect::<Vec<_>>().join(" + ");
                match k * exponent {
                    k if k % 2 == 0 => power(format!("({sum})"), k / 2),
                    1 => format!("\\sqrt{{{sum}}}"),
                    k => format!("({sum})^{{{k}/2}}"),
                }
            }
            Self::Sine(m) if exponent == 1 => format!("\\sin({})", angle(m, names, "")),
            Self::Sine(m) => format!("\\sin^{{{exponent}}}({})", angle(m, names, "")),
            Self::Cosine(m) if exponent == 1 => format!("\\cos({})", angle(m, names, "")),
            Self::Cosine(m) => format!("\\cos^{{{exponent}}}({})", angle(m, names, "")),
        }
    }

    fn rust(&self, names: &[String], exponent: i32) -> String {
        let power = |base: String, k: i32| if k == 1 { base } else { format!("{base}.powi({k})") };
        match self {
            Self::Power(i, k) => power(names[*i].clone(), k * exponent),
            Self::Radius(list, k) => {
                let sum = list.iter().map(|&i| format!("{}.sqr()", names[i])).collect::<Vec<_>>().join(" + ");
                match k * exponent {
                    k if k % 2 == 0 => power(format!("({sum})"), k / 2),
                    k => power(format!("({sum}).sqrt()"), k),
                }
            }
            Self::Sine(m) => power(format!("({}).sin()", rust_angle(m, names)), exponent),
            Self::Cosine(m) => power(format!("({}).cos()", rust_angle(m, names)), exponent),
        }
    }

    /// How involved it is.
    fn complexity(&self) -> f64 {
        match self {
            Self::Power(_, k) => f64::from(k.abs()) + if *k < 0 { 0.5 } else { 0.0 },
            Self::Radius(_, k) => f64::from(k.abs()) + 0.6,
            Self::Sine(m) | Self::Cosine(m) => 0.5 + f64::from(m.iter().map(|m| m.abs()).sum::<i32>()),
        }
    }
}

fn signed(k: i32) -> String {
    if k < 0 { format!("({k})") } else { k.to_string() }
}

fn phase(harmonics: &[i32], q: &[f64]) -> f64 {
    harmonics.iter().zip(q).filter(|(m, _)| **m != 0).map(|(m, q)| f64::from(*m) * q).sum()
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

fn rust_angle(harmonics: &[i32], names: &[String]) -> String {
    let parts = harmonics.iter().zip(names).filter(|(m, _)| **m != 0);
    let parts = parts.map(|(m, name)| if *m == 1 { name.clone() } else { format!("{name} * R::of({m}.0)") });
    parts.collect::<Vec<_>>().join(" + ")
}

impl Function {
    /// A formula of coordinates.
    ///
    /// # Errors
    /// A mistake in it, with its column.
    pub fn formula(names: &[String], text: &str) -> Result<Self, ExpressionError> {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let compiled = ExpressionLagrangian::new(&names, &[], text)?;
        Ok(Self::Formula(text.to_string(), compiled))
    }

    /// Value and derivatives at `q`.
    pub fn taylor(&self, q: &[f64]) -> Taylor {
        let n = q.len();
        match self {
            Self::Product(factors) => {
                let mut product = Taylor::constant(1.0);
                factors.iter().for_each(|factor| factor.multiply(q, &mut product));
                product
            }
            Self::Formula(_, formula) => {
                let mut found = Taylor::constant(0.0);
                let mut point: Vec<HyperDual<f64>> = q.iter().map(|&q| HyperDual::lift(q)).collect();
                let still = vec![HyperDual::lift(0.0); n];
                for i in 0..n {
                    for j in i..n {
                        (point[i].s, point[j].t) = (1.0, 1.0);
                        let value = formula.lagrangian(&[], &point, &still);
                        (point[i].s, point[j].t) = (0.0, 0.0);
                        (found.value, found.gradient[i]) = (value.value, value.s);
                        (found.hessian[i][j], found.hessian[j][i]) = (value.st, value.st);
                    }
                }
                found
            }
        }
    }

    /// `true` for a formula that holds a velocity.
    pub fn moves(&self) -> bool {
        let Self::Formula(_, formula) = self else { return false };
        let n = formula.coordinates();
        let q: Vec<f64> = (0..n).map(|i| 0.37 + 0.11 * i as f64).collect();
        let at = |v: f64| formula.lagrangian(&[], &q, &vec![v; n]);
        at(0.3) != at(0.7) && !at(0.3).is_nan()
    }

    /// `true` for the function 1.
    pub fn is_one(&self) -> bool {
        matches!(self, Self::Product(factors) if factors.is_empty())
    }

    /// Product with another one.
    pub fn product(&self, other: &Self) -> Option<Self> {
        match (self, other) {
            (Self::Product(a), Self::Product(b)) => Some(Self::Product([a.clone(), b.clone()].concat())),
            _ => None,
        }
    }

    /// How involved it is.
    pub fn complexity(&self) -> f64 {
        match self {
            Self::Product(factors) => factors.iter().map(Factor::complexity).sum(),
            Self::Formula(..) => 1.5,
        }
    }

    fn written(&self, write: impl Fn(&Factor, i32) -> String, formula: impl Fn(&str) -> String) -> Vec<String> {
        match self {
            Self::Product(factors) => {
                let mut counted: Vec<(&Factor, i32)> = Vec::new();
                for factor in factors {
                    match counted.iter_mut().find(|(known, _)| *known == factor) {
                        Some((_, count)) => *count += 1,
                        None => counted.push((factor, 1)),
                    }
                }
                counted.into_iter().map(|(factor, count)| write(factor, count)).collect()
            }
            Self::Formula(text, _) => vec![formula(text)],
        }
    }

    /// Its factors in the grammar of system files.
    pub fn text(&self, names: &[String]) -> Vec<String> {
        self.written(|factor, k| factor.text(names, k), |text| format!("({text})"))
    }

    /// Its factors in LaTeX.
    pub fn latex(&self, names: &[String]) -> Vec<String> {
        self.written(|factor, k| factor.latex(names, k), |text| format!("\\left(\\mathtt{{{text}}}\\right)"))
    }

    /// Its factors in Rust over `Real`.
    pub fn rust(&self, names: &[String]) -> Vec<String> {
        self.written(|factor, k| factor.rust(names, k), |text| format!("({text})"))
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
            let at = function.taylor(&q);
            for i in 0..3 {
                let moved = |h: f64| {
                    let mut q = q;
                    q[i] += h;
                    function.taylor(&q)
                };
                let (up, down) = (moved(1e-5), moved(-1e-5));
                assert!(((up.value - down.value) / 2e-5 - at.gradient[i]).abs() < 1e-8, "{function:?}");
                for j in 0..3 {
                    let slope = (up.gradient[j] - down.gradient[j]) / 2e-5;
                    assert!((slope - at.hessian[i][j]).abs() < 1e-8, "{function:?} {i} {j}");
                }
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
        let text = function.text(&names()).join("*");
        let again = Function::formula(&names(), &text).unwrap();
        let q = [0.7, -1.1, 0.4];
        assert!((function.taylor(&q).value - again.taylor(&q).value).abs() < 1e-14, "{text}");
        assert_eq!(function.latex(&names())[2], "\\sin^{2}(2a)");
    }
}
