//! Decimal text: exact reading, writing that reads back to the same number.

use super::{Dd, natural::Natural};
use crate::scalar::Scalar;

/// Significant digits that are read; more only matter as "not zero".
const DIGITS_READ: usize = 1600;

/// `mantissa 2^exponent = |x|` for a finite `x`.
fn binary(x: f64) -> (u64, i32) {
    let bits = x.abs().to_bits();
    let fraction = bits & ((1 << 52) - 1);
    match (bits >> 52) as i32 {
        0 => (fraction, -1074),
        biased => (fraction | 1 << 52, biased - 1075),
    }
}

/// Reads the grammar of Rust's `f64`: the leading part is the nearest `f64`, the trailing one the nearest `f64` to the
/// exact rest.
pub(super) fn parse(text: &str) -> Option<Dd> {
    let high: f64 = text.parse().ok()?;
    if high == 0.0 || !high.is_finite() {
        return Some(Dd::leading(high));
    }
    let (digits, mut exponent) = match text.find(['e', 'E']) {
        Some(at) => (&text[..at], text[at + 1..].parse::<i64>().ok()?),
        None => (text, 0),
    };
    // |value| = number 10^exponent
    let mut number = Natural::new(0);
    let (mut taken, mut after_point, mut more) = (0_usize, false, false);
    for c in digits.bytes() {
        match c {
            b'.' => after_point = true,
            b'0'..=b'9' => {
                exponent -= i64::from(after_point);
                if taken == 0 && c == b'0' {
                    continue;
                }
                if taken < DIGITS_READ {
                    number = number.multiply_add(10, u64::from(c - b'0'));
                    taken += 1;
                } else {
                    exponent += 1;
                    more |= c != b'0';
                }
            }
            _ => {}
        }
    }
    if more {
        number = number.multiply_add(10, 1);
        exponent -= 1;
    }
    // Finite and not zero: the exponent is bounded by the range of `f64` and the digits read.
    let exponent = i32::try_from(exponent).ok()?;
    let (mantissa, power) = binary(high);
    let positive = |k: i32| k.max(0).unsigned_abs();
    let denominator = Natural::new(1).times_power(10, positive(-exponent)).shifted_left(positive(-power));
    let whole = number.times_power(10, positive(exponent)).shifted_left(positive(-power));
    let rounded = Natural::new(mantissa).times_power(10, positive(-exponent)).shifted_left(positive(power));
    let rest = Natural::quotient(&whole.distance(&rounded), &denominator);
    let upwards = (whole >= rounded) == (high > 0.0);
    Some(Dd::new(high, if upwards { rest } else { -rest }))
}

/// The exact decimal digits of `|x|` and the power of ten of the first.
fn exact_digits(x: Dd) -> (Vec<u8>, i32) {
    let (high, high_power) = binary(x.high);
    let (low, low_power) = binary(x.low);
    let power = if low == 0 { high_power } else { high_power.min(low_power) };
    let lift = |mantissa: u64, from: i32| Natural::new(mantissa).shifted_left((from - power).max(0).unsigned_abs());
    let (high, low) = (lift(high, high_power), lift(low, if low == 0 { power } else { low_power }));
    let mantissa = if (x.high < 0.0) == (x.low < 0.0) || low.is_zero() { high.add(&low) } else { high.distance(&low) };
    // 2^-k = 5^k 10^-k
    let (scaled, decimal) = if power >= 0 {
        (mantissa.shifted_left(power.unsigned_abs()), 0)
    } else {
        (mantissa.times_power(5, power.unsigned_abs()), power)
    };
    let digits = scaled.decimal_digits();
    let first = digits.len() as i32 - 1 + decimal;
    (digits, first)
}

/// The first `count` digits, rounded, without trailing zeros.
fn rounded(digits: &[u8], first: i32, count: usize) -> (Vec<u8>, i32) {
    let mut kept = digits[..count.min(digits.len())].to_vec();
    let mut first = first;
    if digits.get(count).is_some_and(|&next| next >= 5) {
        let mut at = kept.len();
        loop {
            if at == 0 {
                kept.insert(0, 1);
                first += 1;
                break;
            }
            at -= 1;
            if kept[at] < 9 {
                kept[at] += 1;
                break;
            }
            kept[at] = 0;
        }
    }
    while kept.len() > 1 && kept.last() == Some(&0) {
        kept.pop();
    }
    (kept, first)
}

/// The shortest of a few lengths (from 32 digits up) that reads back to the same number.
pub(super) fn print(x: Dd) -> String {
    let short = format!("{:?}", x.high);
    if !x.is_finite() || x.high == 0.0 || parse(&short) == Some(x) {
        return short;
    }
    let (digits, first) = exact_digits(x);
    let sign = if x.high < 0.0 { "-" } else { "" };
    let text = |count: usize| {
        let (kept, first) = rounded(&digits, first, count);
        let mut text = String::from(sign);
        for (k, digit) in kept.iter().enumerate() {
            if k == 1 {
                text.push('.');
            }
            text.push(char::from(b'0' + digit));
        }
        if first != 0 {
            text.push_str(&format!("e{first}"));
        }
        text
    };
    [32, 33, 34, 40, 60, 120, 250, 500, 1000]
        .into_iter()
        .map(text)
        .find(|candidate| parse(candidate) == Some(x))
        .unwrap_or_else(|| text(digits.len()))
}
