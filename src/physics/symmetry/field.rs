//! A vector field over a basis, with its gauge function.

use super::basis::{Basis, Values};
use super::sample::Sample;

/// `xi = sum of coefficients * function * d_i` and the gauge function `F` that goes with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Coefficients, `(n, functions)`.
    pub coefficients: Vec<f64>,
    /// Coefficients of `F`, `(functions)`.
    pub gauge: Vec<f64>,
}

impl Field {
    /// Component `i` of the field from the values of the functions, or their derivatives.
    fn component(&self, i: usize, values: impl Iterator<Item = f64>) -> f64 {
        let functions = self.gauge.len();
        self.coefficients[i * functions..(i + 1) * functions].iter().zip(values).map(|(c, x)| c * x).sum()
    }

    /// `xi`, `(n)`, at a point.
    pub(crate) fn vector(&self, at: &Values, n: usize) -> Vec<f64> {
        (0..n).map(|i| self.component(i, at.value.iter().copied())).collect()
    }

    /// `d xi^i / dq^j`, `(n, n)`, at a point.
    pub(crate) fn derivative(&self, at: &Values, n: usize) -> Vec<f64> {
        (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| self.component(i, at.gradient.iter().skip(j).step_by(n).copied()))
            .collect()
    }

    /// Charge `p.xi - F` at a state with momentum `p`.
    pub(crate) fn charge(&self, at: &Values, p: &[f64]) -> f64 {
        let gauge: f64 = self.gauge.iter().zip(&at.value).map(|(c, x)| c * x).sum();
        self.vector(at, p.len()).iter().zip(p).map(|(x, p)| x * p).sum::<f64>() - gauge
    }

    /// `xi.dL/dq + (D xi v).dL/dv - dF/dt` at a state: what breaks the symmetry there, the rate of the charge.
    pub(crate) fn breaking(&self, at: &Values, v: &[f64], p: &[f64], g: &[f64]) -> f64 {
        let n = p.len();
        let pull: f64 = self.vector(at, n).iter().zip(g).map(|(x, g)| x * g).sum();
        let turn: f64 = self
            .derivative(at, n)
            .chunks_exact(n)
            .zip(p)
            .map(|(row, p)| p * row.iter().zip(v).map(|(d, v)| d * v).sum::<f64>())
            .sum();
        let along = |gradient: &[f64]| gradient.iter().zip(v).map(|(d, v)| d * v).sum::<f64>();
        let gauge: f64 = self.gauge.iter().zip(at.gradient.chunks_exact(n)).map(|(c, d)| c * along(d)).sum();
        pull + turn - gauge
    }

    /// Turns the field so that its last term has a positive factor: `-y d_x + x d_y`.
    pub(crate) fn turn(&mut self) {
        if self.coefficients.iter().rev().find(|c| **c != 0.0).is_some_and(|c| *c < 0.0) {
            self.coefficients.iter_mut().chain(&mut self.gauge).for_each(|c| *c = if *c == 0.0 { 0.0 } else { -*c });
        }
    }

    /// Drops what is noise of the gauge function, compared with the momentum along the field, and its constant.
    pub(crate) fn clean_gauge(&mut self, sample: &Sample, values: &[Vec<f64>], noise: f64) {
        let (n, functions, states) = (sample.n, self.gauge.len(), sample.len());
        let momentum = |k: usize| -> f64 {
            (0..n)
                .map(|i| {
                    let xi = (0..functions).map(|f| self.coefficients[i * functions + f] * values[f][k]).sum::<f64>();
                    (sample.p[k * n + i] * xi).abs()
                })
                .sum()
        };
        let size = (0..states).map(momentum).sum::<f64>() / states as f64;
        for (c, value) in self.gauge.iter_mut().zip(values) {
            let part = *c * value.iter().map(|x| x.abs()).sum::<f64>() / states as f64;
            if part.abs() < noise * size {
                *c = 0.0;
            }
        }
        // The first function is the constant.
        if let Some(constant) = self.gauge.first_mut() {
            *constant = 0.0;
        }
    }

    /// The field as a formula, such as `-y d_x + x d_y`.
    pub fn text(&self, basis: &Basis) -> String {
        let functions = self.gauge.len();
        let terms = self.coefficients.iter().enumerate().map(|(k, c)| {
            let (i, f) = (k / functions, k % functions);
            (*c, join(&basis.text(f), &format!("d_{}", basis.names()[i]), " "))
        });
        sum(terms)
    }

    /// The gauge function as a formula; `0` without one.
    pub fn gauge_text(&self, basis: &Basis) -> String {
        sum(self.gauge.iter().enumerate().map(|(f, c)| (*c, basis.text(f))))
    }
}

/// Two texts with a separator between them, if neither is empty.
pub(crate) fn join(a: &str, b: &str, separator: &str) -> String {
    if a.is_empty() || b.is_empty() { format!("{a}{b}") } else { format!("{a}{separator}{b}") }
}

/// A sum of terms with their factors, rounded to five digits; terms of factor 0 are left out.
pub(crate) fn sum(terms: impl Iterator<Item = (f64, String)>) -> String {
    let mut text = String::new();
    for (factor, term) in terms.filter(|(factor, _)| *factor != 0.0) {
        let (sign, size) = (if factor < 0.0 { "-" } else { "+" }, digits(factor.abs()));
        let one = match (size.as_str(), term.as_str()) {
            ("1", term) if !term.is_empty() => term.to_string(),
            (_, "") => size,
            (_, term) if term.starts_with("1/") => format!("{size}{}", &term[1..]),
            (_, term) if term.starts_with("d_") => format!("{size} {term}"),
            _ => format!("{size}*{term}"),
        };
        match (text.is_empty(), sign) {
            (true, "+") => text += &one,
            (true, _) => text += &format!("-{one}"),
            (false, sign) => text += &format!(" {sign} {one}"),
        }
    }
    if text.is_empty() { "0".to_string() } else { text }
}

/// Five significant digits, without zeros at the end.
fn digits(x: f64) -> String {
    let text = format!("{x:.4e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if !(-4..6).contains(&exponent) {
        return format!("{}e{exponent}", digits.trim_end_matches('0').trim_end_matches('.'));
    }
    let text = format!("{x:.*}", usize::try_from(4 - exponent).unwrap_or(0));
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_readable() {
        let terms = |list: &[(f64, &str)]| sum(list.iter().map(|(c, t)| (*c, t.to_string())));
        assert_eq!(terms(&[(-1.0, "y d_x"), (1.0, "x d_y")]), "-y d_x + x d_y");
        assert_eq!(terms(&[(0.5, ""), (-2.0, "1/r"), (0.0, "x"), (1.0 / 3.0, "x^2")]), "0.5 - 2/r + 0.33333*x^2");
        assert_eq!(terms(&[(3.0, "d_t")]), "3 d_t");
        assert_eq!(terms(&[]), "0");
        assert_eq!([1.0 - 1e-12, 1234.56, 1e-7, 2.5e9].map(digits), ["1", "1234.6", "1e-7", "2.5e9"]);
    }
}
