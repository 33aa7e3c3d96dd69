//! Enclosures of functions of one number and of their first four derivatives.

use super::interval::Interval;
use crate::ops::Unary;

/// `[f, f', f'', f''', f'''']`.
pub type Derivatives = [Interval; 5];

/// Derivatives of `f` over all numbers of `x`; everything where one is not defined, as at the kink of `|x|`.
pub fn derivatives(f: Unary, x: Interval) -> Derivatives {
    match smooth_bounds(f) {
        Some(bounds) if !x.is_point() => expanded(f, x, &bounds),
        _ => formulas(f, x),
    }
}

fn number(x: f64) -> Interval {
    Interval::point(x)
}

/// The closed forms, evaluated in intervals: sharp for a point.
pub(super) fn formulas(f: Unary, x: Interval) -> Derivatives {
    let (zero, one, two) = (Interval::ZERO, number(1.0), number(2.0));
    match f {
        Unary::Neg => [-x, -one, zero, zero, zero],
        Unary::Abs if x.low > 0.0 => [x, one, zero, zero, zero],
        Unary::Abs if x.high < 0.0 => [-x, -one, zero, zero, zero],
        Unary::Abs => [x.abs(), Interval::ENTIRE, Interval::ENTIRE, Interval::ENTIRE, Interval::ENTIRE],
        Unary::Recip => powers(x, [-1, -2, -3, -4, -5], [1.0, -1.0, 2.0, -6.0, 24.0]),
        Unary::Powi(n) => {
            let n = i64::from(n);
            let exponents = [0, 1, 2, 3, 4].map(|k| (n - k).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32);
            let mut factor = one;
            let mut found = [one; 5];
            for (k, (found, exponent)) in found.iter_mut().zip(exponents).enumerate() {
                *found = if factor == zero { zero } else { factor * x.power(exponent) };
                factor *= number((n - k as i64) as f64);
            }
            found
        }
        Unary::Sqrt => {
            let found = real_power(x, 0.5);
            [x.sqrt(), found[1], found[2], found[3], found[4]]
        }
        Unary::Exp => [x.exp(); 5],
        Unary::ExpM1 => {
            let y = x.exp();
            [x.exp_m1(), y, y, y, y]
        }
        Unary::Ln => {
            let [first, second, third, fourth, _] = formulas(Unary::Recip, x);
            [x.ln(), first, second, third, fourth]
        }
        Unary::Ln1p => {
            let [first, second, third, fourth, _] = formulas(Unary::Recip, one + x);
            [x.ln_1p(), first, second, third, fourth]
        }
        Unary::Sin => {
            let (sin, cos) = x.sin_cos();
            [sin, cos, -sin, -cos, sin]
        }
        Unary::Cos => {
            let (sin, cos) = x.sin_cos();
            [cos, -sin, -cos, sin, cos]
        }
        Unary::Sinh => {
            let (sinh, cosh) = (x.sinh(), x.cosh());
            [sinh, cosh, sinh, cosh, sinh]
        }
        Unary::Cosh => {
            let (sinh, cosh) = (x.sinh(), x.cosh());
            [cosh, sinh, cosh, sinh, cosh]
        }
        // In the tangent t: 1 + t^2, 2 t (1 + t^2), (2 + 6 t^2)(1 + t^2), t (16 + 24 t^2)(1 + t^2).
        Unary::Tan => {
            let t = x.tan();
            let square = t.square();
            let first = one + square;
            let third = (two + number(6.0) * square) * first;
            let fourth = t * (number(16.0) + number(24.0) * square) * first;
            [t, first, two * t * first, third, fourth]
        }
        // With g = 1/sqrt(1 - x^2): g, x g^3, g^3 + 3 x^2 g^5, 9 x g^5 + 15 x^3 g^7.
        Unary::Asin | Unary::Acos => {
            let square = x.square();
            let g = one / ((one - x) * (one + x)).sqrt();
            let (cube, fifth) = (g.power(3), g.power(5));
            let third = cube + number(3.0) * square * fifth;
            let fourth = x * (number(9.0) * fifth + number(15.0) * square * g.power(7));
            match f {
                Unary::Asin => [x.asin(), g, x * cube, third, fourth],
                _ => [x.acos(), -g, -(x * cube), -third, -fourth],
            }
        }
        // With g = 1/(1 + x^2): g, -2 x g^2, (6 x^2 - 2) g^3, 24 x (1 - x^2) g^4.
        Unary::Atan => {
            let square = x.square();
            let g = one / (one + square);
            let third = (number(6.0) * square - two) * g.power(3);
            [x.atan(), g, -(two * x * g.square()), third, number(24.0) * x * (one - square) * g.power(4)]
        }
        Unary::Erfc => {
            let square = x.square();
            let first = -(two / Interval::pi().sqrt()) * (-square).exp();
            let second = -(two * x * first);
            let third = first * (number(4.0) * square - two);
            [x.erfc(), first, second, third, first * x * (number(12.0) - number(8.0) * square)]
        }
        Unary::Gelu => gelu(x),
        Unary::Softplus => {
            let [first, second, third, fourth, _] = logistic(x);
            [x.softplus(), first, second, third, fourth]
        }
        Unary::Logistic => logistic(x),
        // tanh x = 2 s(2 x) - 1, s the logistic function.
        Unary::Tanh => {
            let [_, first, second, third, fourth] = logistic(two * x);
            [x.tanh(), number(4.0) * first, number(8.0) * second, number(16.0) * third, number(32.0) * fourth]
        }
        // ln cosh x = softplus(2 x) - x - ln 2.
        Unary::LnCosh => {
            let [_, tanh, second, third, fourth] = {
                let [first, second, third, fourth, _] = formulas(Unary::Tanh, x);
                [zero, first, second, third, fourth]
            };
            [(two * x).softplus() - x - two.ln(), tanh, second, third, fourth]
        }
        // x g(x), g = tanh(x/2) = 2 s(x) - 1: the k-th derivative is x g^(k) + k g^(k-1).
        Unary::XTanh => {
            let [_, first, second, third, fourth] = logistic(x).map(|d| two * d);
            let g = (x * number(0.5)).tanh();
            [
                x * g,
                g + x * first,
                two * first + x * second,
                number(3.0) * second + x * third,
                number(4.0) * third + x * fourth,
            ]
        }
    }
}

/// `c_k x^(n_k)`.
fn powers(x: Interval, exponents: [i32; 5], factors: [f64; 5]) -> Derivatives {
    std::array::from_fn(|k| number(factors[k]) * x.power(exponents[k]))
}

/// `x^p` of positive numbers and its derivatives; everything if it reaches 0.
pub fn real_power(x: Interval, p: f64) -> Derivatives {
    let mut factor = number(1.0);
    std::array::from_fn(|k| {
        let exponent = number(p) - number(k as f64);
        // The exponent p - k may be rounded: x^e increases or decreases in e, its ends give the ends.
        let found = factor * x.real_power(exponent.low).hull(x.real_power(exponent.high));
        factor *= exponent;
        found
    })
}

/// The logistic function `s`: with `p = s(x) s(-x)` and `d = s(-x) - s(x)`: `p`, `p d`, `p (1 - 6 p)`, `p d (1 - 12 p)`.
fn logistic(x: Interval) -> Derivatives {
    let (s, t) = (x.logistic(), (-x).logistic());
    let (p, d, one) = (s * t, t - s, number(1.0));
    let second = p * d;
    [s, p, second, p * (one - number(6.0) * p), second * (one - number(12.0) * p)]
}

/// `x Phi(x)`, with the density `phi`: `Phi + x phi`, `phi (2 - x^2)`, `phi (x^3 - 4 x)`, `phi (-x^4 + 7 x^2 - 4)`.
fn gelu(x: Interval) -> Derivatives {
    let (two, four, half) = (number(2.0), number(4.0), number(0.5));
    let square = x.square();
    let distribution = half * (-(x * half.sqrt())).erfc();
    let density = (-(square * half)).exp() / (two * Interval::pi()).sqrt();
    let fourth = (number(7.0) - square) * square - four;
    [
        x * distribution,
        distribution + x * density,
        density * (two - square),
        density * x * (square - four),
        density * fourth,
    ]
}

/// Suprema over the whole line of `|f|` and of the absolute values of five derivatives, for functions whose closed forms are not
/// sharp over an interval; proven by a test.
pub(super) fn smooth_bounds(f: Unary) -> Option<[f64; 6]> {
    const NONE: f64 = f64::INFINITY;
    Some(match f {
        Unary::Logistic => [1.0, 0.250_001, 0.096_226, 0.125_001, 0.127_685, 0.250_001],
        Unary::Softplus => [NONE, 1.0, 0.250_001, 0.096_226, 0.125_001, 0.127_685],
        Unary::Tanh => [1.0, 1.000_001, 0.769_801, 2.000_001, 4.085_887, 16.000_01],
        Unary::LnCosh => [NONE, 1.0, 1.000_001, 0.769_801, 2.000_001, 4.085_887],
        Unary::XTanh => [NONE, 1.199_68, 1.000_001, 0.616_365, 1.000_001, 1.316_06],
        Unary::Gelu => [NONE, 1.128_906, 0.797_886, 0.778_771, 1.595_771, 2.842_53],
        Unary::Erfc => [2.0, 1.128_381, 0.967_885, 2.256_76, 4.404_71, 13.540_6],
        _ => return None,
    })
}

/// Derivatives over an interval by Taylor's formula about its middle, the fifth derivative bounded by its supremum.
fn expanded(f: Unary, x: Interval, bounds: &[f64; 6]) -> Derivatives {
    let at = formulas(f, number(x.middle()));
    let r = number(x.radius());
    let (odd, even) = (Interval::symmetric(r.high), Interval::new(0.0, r.square().high));
    // Powers of the distance over factorials: d, d^2/2, d^3/6, d^4/24, d^5/120.
    let powers = [
        number(1.0),
        odd,
        even * number(0.5),
        odd * even / number(6.0),
        even.square() / number(24.0),
        odd * even.square() / number(120.0),
    ];
    std::array::from_fn(|k| {
        let rest = Interval::symmetric(bounds[5]) * powers[5 - k];
        let sum = (k..5).fold(rest, |sum, j| sum + at[j] * powers[j - k]);
        sum.meet(Interval::symmetric(bounds[k]))
    })
}
