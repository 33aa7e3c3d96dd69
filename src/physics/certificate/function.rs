//! Enclosures of functions of one number and of their first six derivatives.

use super::interval::Interval;
use crate::ops::Unary;

/// A function and its derivatives up to the sixth.
pub type Derivatives = [Interval; 7];

/// A function of one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Function {
    /// A row of the table of operations.
    Table(Unary),
    /// `x^p`, of positive numbers.
    Power(f64),
}

impl Function {
    /// Derivatives at `centre`, and over all numbers that are at most `distance` away from it; everything where one is not defined, as at the
    /// kink of `|x|`.
    pub fn about(self, centre: f64, distance: f64) -> (Derivatives, Derivatives) {
        let at = self.formulas(Interval::point(centre));
        let bounds = if let Self::Table(f) = self { smooth_bounds(f) } else { None };
        let over = match bounds {
            _ if distance == 0.0 => at,
            Some(bounds) => expanded(&at, distance, &bounds),
            None => self.formulas(Interval::outward(centre - distance, centre + distance)),
        };
        (at, over)
    }

    /// An interval of all values for the numbers of `x`.
    pub fn value(self, x: Interval) -> Interval {
        self.formulas(x)[0]
    }

    /// The closed forms, evaluated in intervals: sharp for a point.
    fn formulas(self, x: Interval) -> Derivatives {
        match self {
            Self::Table(f) => formulas(f, x),
            Self::Power(p) => real_power(x, p),
        }
    }
}

fn number(x: f64) -> Interval {
    Interval::point(x)
}

/// The closed forms, evaluated in intervals: sharp for a point.
pub(super) fn formulas(f: Unary, x: Interval) -> Derivatives {
    let (zero, one, two) = (Interval::ZERO, number(1.0), number(2.0));
    match f {
        Unary::Neg => [-x, -one, zero, zero, zero, zero, zero],
        Unary::Abs if x.low > 0.0 => [x, one, zero, zero, zero, zero, zero],
        Unary::Abs if x.high < 0.0 => [-x, -one, zero, zero, zero, zero, zero],
        Unary::Abs => following(x.abs(), [Interval::ENTIRE; 7]),
        Unary::Recip => powers(x, [-1, -2, -3, -4, -5, -6, -7], [1.0, -1.0, 2.0, -6.0, 24.0, -120.0, 720.0]),
        Unary::Powi(n) => integer_power(x, i64::from(n)),
        Unary::Sqrt => {
            let mut found = real_power(x, 0.5);
            found[0] = x.sqrt();
            found
        }
        Unary::Exp => [x.exp(); 7],
        Unary::ExpM1 => following(x.exp_m1(), [x.exp(); 7]),
        Unary::Ln => following(x.ln(), formulas(Unary::Recip, x)),
        Unary::Ln1p => following(x.ln_1p(), formulas(Unary::Recip, one + x)),
        Unary::Sin => {
            let (sin, cos) = x.sin_cos();
            [sin, cos, -sin, -cos, sin, cos, -sin]
        }
        Unary::Cos => {
            let (sin, cos) = x.sin_cos();
            [cos, -sin, -cos, sin, cos, -sin, -cos]
        }
        Unary::Sinh => {
            let (sinh, cosh) = (x.sinh(), x.cosh());
            [sinh, cosh, sinh, cosh, sinh, cosh, sinh]
        }
        Unary::Cosh => {
            let (sinh, cosh) = (x.sinh(), x.cosh());
            [cosh, sinh, cosh, sinh, cosh, sinh, cosh]
        }
        Unary::Tan => tangent(x),
        Unary::Asin => arcsine(x),
        Unary::Acos => {
            let arcsine = arcsine(x);
            std::array::from_fn(|k| if k == 0 { x.acos() } else { -arcsine[k] })
        }
        Unary::Atan => arctangent(x),
        Unary::Erfc => complementary_error(x),
        Unary::Gelu => gelu(x),
        Unary::Softplus => following(x.softplus(), logistic(x)),
        Unary::Logistic => logistic(x),
        // tanh x = 2 s(2 x) - 1, s the logistic function.
        Unary::Tanh => {
            let s = logistic(two * x);
            std::array::from_fn(|k| if k == 0 { x.tanh() } else { number(f64::from(1 << (k + 1))) * s[k] })
        }
        // ln cosh x = softplus(2 x) - x - ln 2.
        Unary::LnCosh => following((two * x).softplus() - x - two.ln(), formulas(Unary::Tanh, x)),
        Unary::XTanh => x_tanh(x),
        // Numbers enclose such functions through the operations that they consist of.
        _ => [Interval::ENTIRE; 7],
    }
}

/// `x^n` with an integer `n`.
fn integer_power(x: Interval, n: i64) -> Derivatives {
    let (zero, one) = (Interval::ZERO, number(1.0));
    let exponents = [0, 1, 2, 3, 4, 5, 6].map(|k| (n - k).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32);
    let mut factor = one;
    let mut found = [one; 7];
    for (k, (found, exponent)) in found.iter_mut().zip(exponents).enumerate() {
        *found = if factor == zero { zero } else { factor * x.power(exponent) };
        factor *= number((n - k as i64) as f64);
    }
    found
}

/// The tangent: polynomials in the tangent `t` and its square `u`, each the derivative of the previous one, times `1 + u = 1 + t^2`.
fn tangent(x: Interval) -> Derivatives {
    let (one, t) = (number(1.0), x.tan());
    let (u, first) = (t.square(), one + t.square());
    let times = |factor: Interval, c: &[f64]| factor * first * polynomial(u, c);
    [
        t,
        first,
        times(t, &[2.0]),
        times(one, &[2.0, 6.0]),
        times(t, &[16.0, 24.0]),
        times(one, &[16.0, 120.0, 120.0]),
        times(t, &[272.0, 960.0, 720.0]),
    ]
}

/// The arcsine: with `g = 1/sqrt(1 - x^2)`, polynomials in `x^2 g^2 = g^2 - 1` whose coefficients are all positive.
fn arcsine(x: Interval) -> Derivatives {
    let (one, square) = (number(1.0), x.square());
    let g = one / ((one - x) * (one + x)).sqrt();
    let part = |power: i32, c: &[f64]| g.power(power) * polynomial(square * g.square(), c);
    [
        x.asin(),
        g,
        x * g.power(3),
        part(3, &[1.0, 3.0]),
        x * part(5, &[9.0, 15.0]),
        part(5, &[9.0, 90.0, 105.0]),
        x * part(7, &[225.0, 1050.0, 945.0]),
    ]
}

/// The arctangent: polynomials in `x^2` times powers of `g = 1/(1 + x^2)`.
fn arctangent(x: Interval) -> Derivatives {
    let (one, u) = (number(1.0), x.square());
    let g = one / (one + u);
    let part = |power: i32, c: &[f64]| polynomial(u, c) * g.power(power);
    [
        x.atan(),
        g,
        x * part(2, &[-2.0]),
        part(3, &[-2.0, 6.0]),
        x * part(4, &[24.0, -24.0]),
        part(5, &[24.0, -240.0, 120.0]),
        x * part(6, &[-720.0, 2400.0, -720.0]),
    ]
}

/// `x g(x)` with `g = tanh(x/2) = 2 s(x) - 1`, `s` the logistic function: the k-th derivative is `x g^(k) + k g^(k-1)`.
fn x_tanh(x: Interval) -> Derivatives {
    let mut g = logistic(x).map(|d| number(2.0) * d);
    g[0] = (x * number(0.5)).tanh();
    std::array::from_fn(|k| if k == 0 { x * g[0] } else { x * g[k] + number(k as f64) * g[k - 1] })
}

/// The complementary error function: Hermite polynomials times its first derivative.
fn complementary_error(x: Interval) -> Derivatives {
    let u = x.square();
    let first = -(number(2.0) / Interval::pi().sqrt()) * (-u).exp();
    let part = |c: &[f64]| first * polynomial(u, c);
    [
        x.erfc(),
        first,
        x * part(&[-2.0]),
        part(&[-2.0, 4.0]),
        x * part(&[12.0, -8.0]),
        part(&[12.0, -48.0, 16.0]),
        x * part(&[-120.0, 160.0, -32.0]),
    ]
}

/// A function with this value whose derivative is another function, given with its derivatives.
fn following(value: Interval, derivatives: Derivatives) -> Derivatives {
    std::array::from_fn(|k| if k == 0 { value } else { derivatives[k - 1] })
}

/// `c_0 + c_1 u + ..`.
fn polynomial(u: Interval, c: &[f64]) -> Interval {
    c.iter().rev().map(|&c| number(c)).reduce(|sum, c| sum * u + c).unwrap_or(Interval::ZERO)
}

/// `c_k x^(n_k)`.
fn powers(x: Interval, exponents: [i32; 7], factors: [f64; 7]) -> Derivatives {
    std::array::from_fn(|k| number(factors[k]) * x.power(exponents[k]))
}

/// `x^p` of positive numbers and its derivatives; everything if it reaches 0.
pub fn real_power(x: Interval, p: f64) -> Derivatives {
    let mut factor = number(1.0);
    std::array::from_fn(|k| {
        let exponent = number(p) - number(k as f64);
        // The exponent p - k may be rounded: x^e is monotonic in e, so its ends give the ends.
        let found = factor * x.real_power(exponent.low).hull(x.real_power(exponent.high));
        factor *= exponent;
        found
    })
}

/// The logistic function `s`, with `p = s(x) s(-x)` and `d = s(-x) - s(x)`; `p' = p d` and `d' = -2 p`.
fn logistic(x: Interval) -> Derivatives {
    let (s, t) = (x.logistic(), (-x).logistic());
    let (p, d) = (s * t, t - s);
    let part = |c: &[f64]| p * polynomial(p, c);
    [
        s,
        p,
        p * d,
        part(&[1.0, -6.0]),
        d * part(&[1.0, -12.0]),
        part(&[1.0, -30.0, 120.0]),
        d * part(&[1.0, -60.0, 360.0]),
    ]
}

/// `x Phi(x)`: polynomials times the density `phi`.
fn gelu(x: Interval) -> Derivatives {
    let (two, half) = (number(2.0), number(0.5));
    let u = x.square();
    let distribution = half * (-(x * half.sqrt())).erfc();
    let density = (-(u * half)).exp() / (two * Interval::pi()).sqrt();
    let part = |c: &[f64]| density * polynomial(u, c);
    [
        x * distribution,
        distribution + x * density,
        part(&[2.0, -1.0]),
        x * part(&[-4.0, 1.0]),
        part(&[-4.0, 7.0, -1.0]),
        x * part(&[18.0, -11.0, 1.0]),
        part(&[18.0, -51.0, 16.0, -1.0]),
    ]
}

/// Suprema over the whole line of `|f|` and of the absolute values of seven derivatives, for functions whose closed forms are not
/// sharp over an interval; proven by a test.
pub(super) fn smooth_bounds(f: Unary) -> Option<[f64; 8]> {
    const NONE: f64 = f64::INFINITY;
    Some(match f {
        Unary::Logistic => [1.0, 0.250_001, 0.096_226, 0.125_001, 0.127_685, 0.250_001, 0.408_33, 1.062_51],
        Unary::Softplus => [NONE, 1.0, 0.250_001, 0.096_226, 0.125_001, 0.127_685, 0.250_001, 0.408_33],
        Unary::Tanh => [1.0, 1.000_001, 0.769_801, 2.000_001, 4.085_887, 16.000_01, 52.266, 272.001],
        Unary::LnCosh => [NONE, 1.0, 1.000_001, 0.769_801, 2.000_001, 4.085_887, 16.000_01, 52.266],
        Unary::XTanh => [NONE, 1.199_68, 1.000_001, 0.616_365, 1.000_001, 1.316_06, 3.000_01, 5.817_13],
        Unary::Gelu => [NONE, 1.128_906, 0.797_886, 0.778_771, 1.595_771, 2.842_53, 7.180_97, 16.447_56],
        Unary::Erfc => [2.0, 1.128_381, 0.967_885, 2.256_76, 4.404_71, 13.540_6, 36.913_8, 135.405_6],
        _ => return None,
    })
}

/// Derivatives over all numbers at most `distance` away from where they are `at`, by Taylor's formula, the seventh derivative bounded by its
/// supremum.
fn expanded(at: &Derivatives, distance: f64, bounds: &[f64; 8]) -> Derivatives {
    // Powers of the distance over factorials, d^k / k!.
    let r = number(distance);
    let mut powers = [number(1.0); 8];
    let mut factorial = 1.0;
    for (k, power) in powers.iter_mut().enumerate().skip(1) {
        factorial *= k as f64;
        let high = r.power(k as i32).high;
        let range = if k % 2 == 0 { Interval::new(0.0, high) } else { Interval::symmetric(high) };
        *power = range / number(factorial);
    }
    std::array::from_fn(|k| {
        let rest = Interval::symmetric(bounds[7]) * powers[7 - k];
        let sum = (k..7).fold(rest, |sum, j| sum + at[j] * powers[j - k]);
        sum.meet(Interval::symmetric(bounds[k]))
    })
}
