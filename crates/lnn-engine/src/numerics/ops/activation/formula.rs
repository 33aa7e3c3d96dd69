//! Value and four derivatives of each activation: branch-free closed forms, relatively accurate in both tails.
//!
//! A caller that uses only the first entries pays only for those: the functions are inlined and the rest is dropped.

use crate::scalar::{Exponential, Real, Scalar};

/// `[f, f', f'', f''', f'''']` at one point.
pub(super) type Jet<S> = [S; 5];

#[inline(always)]
fn constant<S: Scalar>(value: f64) -> S {
    S::of_f64(value)
}
/// `magnitude`, negated where `x < 0`.
#[inline(always)]
fn signed<S: Scalar>(magnitude: S, x: S) -> S {
    if x < S::of_f64(0.0) { -magnitude } else { magnitude }
}
/// `max(x, 0)`; the other terms propagate `NaN`.
#[inline(always)]
fn positive_part<S: Scalar>(x: S) -> S {
    if x > S::of_f64(0.0) { x } else { S::of_f64(0.0) }
}
/// `min(|x|, bound)`, `NaN` passed on.
#[inline(always)]
fn bounded<S: Scalar>(x: S, bound: f64) -> S {
    let (magnitude, bound) = (Real::abs(x), S::of_f64(bound));
    if magnitude > bound { bound } else { magnitude }
}

/// `x Phi(x)`: `f' = Phi + x phi`, `f'' = phi (2 - x^2)`, `f''' = phi (x^3 - 4x)`, `f'''' = phi (-x^4 + 7x^2 - 4)`.
///
/// With `Phi(-a) = e^(-a^2/2) R(a)` the density and the distribution function share one exponential.
#[inline(always)]
pub(super) fn gelu<S: Scalar>(x: S) -> Jet<S> {
    let inverse_sqrt_two_pi = (constant::<S>(0.5) / S::pi()).sqrt();
    // Beyond 40 every tail is 0 in any precision.
    let a = bounded(x, 40.0);
    let square = a * a;
    let decay = (square * constant(-0.5)).lane_exp();
    // The rounding error of the square: e^(-(s + d)/2) = e^(-s/2) (1 - d/2).
    let rest = a.lane_fused(a, -square) * constant(-0.5);
    let m = rest.lane_fused(decay.mantissa, decay.mantissa);
    let density = m * inverse_sqrt_two_pi;
    let tail = a.lane_normal_tail();
    let value = positive_part(x) - decay.scale(a * (tail * m));
    let below = decay.scale(m * a.lane_fused(-inverse_sqrt_two_pi, tail));
    let first = if x < constant(0.0) { below } else { constant::<S>(1.0) - below };
    let second = decay.scale(density * a.lane_fused(-a, constant(2.0)));
    let third = decay.scale(density * signed(a, x) * a.lane_fused(a, constant(-4.0)));
    let fourth = decay.scale(density * (constant::<S>(7.0) - square).lane_fused(square, constant(-4.0)));
    [value, first, second, third, fourth]
}

/// `ln(1 + e^x)`: with `s` the logistic function `f' = s`, `f'' = s(x) s(-x)`, `f''' = -f'' tanh(x/2)`,
/// `f'''' = f'' (1 - 6 f'')`.
#[inline(always)]
pub(super) fn softplus<S: Scalar>(x: S) -> Jet<S> {
    let one = constant::<S>(1.0);
    let decay = (-Real::abs(x)).lane_exp();
    let e = decay.value();
    let r = one / (one + e);
    let value = positive_part(x) + decay.scale(decay.mantissa * e.lane_log1p_ratio());
    let first = if x < constant(0.0) { decay.scale(decay.mantissa * r) } else { r };
    let m = decay.mantissa * r * r;
    let second = decay.scale(m);
    let third = decay.scale(m * signed(decay.minus_one * r, x));
    let fourth = decay.scale(m * constant::<S>(-6.0).lane_fused(second, one));
    [value, first, second, third, fourth]
}

/// `tanh(a / 2)` and `sech^2(a / 2)` for `a >= 0`, the latter still in pieces: multiply, then scale.
#[inline(always)]
fn hyperbolic<S: Scalar>(a: S) -> (S, S, Exponential<S>) {
    let one = constant::<S>(1.0);
    let decay = (-a).lane_exp();
    let r = one / (one + decay.value());
    (-decay.minus_one * r, constant::<S>(4.0) * decay.mantissa * r * r, decay)
}

/// `t = tanh(x)`, `s = sech^2(x)`: `f' = s`, `f'' = -2 t s`, `f''' = s (4 t^2 - 2 s)`, `f'''' = 8 t s (2 s - t^2)`.
#[inline(always)]
pub(super) fn tanh<S: Scalar>(x: S) -> Jet<S> {
    let (t, m, decay) = hyperbolic(constant::<S>(2.0) * Real::abs(x));
    let s = decay.scale(m);
    let square = t * t;
    let t = signed(t, x);
    [
        t,
        s,
        decay.scale(m * t * constant(-2.0)),
        decay.scale(m * (square * constant(4.0) - s * constant(2.0))),
        decay.scale(m * t * constant(8.0) * (s * constant(2.0) - square)),
    ]
}

/// `x tanh(x/2)`: with `t = tanh(x/2)`, `s = sech^2(x/2)`, `y = x/2`: `f' = t + y s`, `f'' = s (1 - y t)`,
/// `f''' = s (-3 t + y (2 t^2 - s)) / 2`, `f'''' = s (2 t^2 - s + y t (2 s - t^2))`.
///
/// Where large terms nearly cancel, with `e = exp(-x)`, `r = 1/(1 + e)`: `1 - y t = r (1 - y + e (1 + y))`, and from
/// `x = 2` on `f''' = s r^2 (x - 3 + e (e (x + 3) - 4 x)) / 2`, whose differences are nearly exact.
#[inline(always)]
pub(super) fn x_tanh<S: Scalar>(x: S) -> Jet<S> {
    let magnitude = Real::abs(x);
    // Beyond 1600 every tail is 0 in any precision.
    let a = bounded(x, 1600.0);
    let (one, three) = (constant::<S>(1.0), constant::<S>(3.0));
    let y = a * constant(0.5);
    let (t, m, decay) = hyperbolic(a);
    let s = decay.scale(m);
    let e = decay.value();
    let r = one / (one + e);
    let square = t * t;
    let twice = constant::<S>(2.0) * square;
    let second = r * (one + y).lane_fused(e, one - y);
    let near = y.lane_fused(twice - s, -three * t);
    let far = r * r * e.lane_fused((a + three).lane_fused(e, constant::<S>(-4.0) * a), a - three);
    let third = if a < constant(2.0) { near } else { far };
    [
        magnitude * t,
        signed(t + decay.scale(y * m), x),
        decay.scale(m * second),
        decay.scale(m * signed(constant(0.5), x) * third),
        decay.scale(m * (y * t).lane_fused(constant::<S>(2.0) * s - square, twice - s)),
    ]
}

/// `x s(x)`, `s` the logistic function: `f' = s(x) (1 + x s(-x))`; from the second on half the derivatives of `x tanh(x/2)`, for
/// `f = (x + x tanh(x/2)) / 2`.
///
/// With `e = exp(-|x|)`, `r = 1/(1 + e)`: `f' = e r^2 (1 + e - |x|)` where `x < 0`, with the digits of its zero.
#[inline(always)]
pub(super) fn silu<S: Scalar>(x: S) -> Jet<S> {
    let (one, half) = (constant::<S>(1.0), constant::<S>(0.5));
    let a = bounded(x, 1600.0);
    let decay = (-a).lane_exp();
    let e = decay.value();
    let r = one / (one + e);
    let tail = decay.mantissa * r;
    let value = positive_part(x) - decay.scale(a * tail);
    let below = decay.scale(tail * r * (one + e - a));
    let first = if x < constant(0.0) { below } else { r + decay.scale(a * tail * r) };
    let [_, _, second, third, fourth] = x_tanh(x);
    [value, first, half * second, half * third, half * fourth]
}

/// `x^2`.
#[inline(always)]
pub(super) fn quadratic<S: Scalar>(x: S) -> Jet<S> {
    let zero = constant(0.0);
    [x * x, constant::<S>(2.0) * x, constant(2.0), zero, zero]
}

/// `x`.
#[inline(always)]
pub(super) fn identity<S: Scalar>(x: S) -> Jet<S> {
    let zero = constant(0.0);
    [x, constant(1.0), zero, zero, zero]
}
