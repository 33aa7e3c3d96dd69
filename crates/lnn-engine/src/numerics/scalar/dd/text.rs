//! Decimal text: exact reading, writing that reads back to the same number.

use super::Dd;
use crate::scalar::Scalar;
use alloc::string::String;
use alloc::vec::Vec;
use core::cmp::Ordering;

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

/// Reads the grammar of Rust's `f64`: the leading part is the nearest `f64`, the trailing one the `f64` nearest to the exact remainder.
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

/// Little-endian words without leading zeros.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Natural(Vec<u64>);

impl Natural {
    pub(super) fn new(value: u64) -> Self {
        Self(vec![value]).trimmed()
    }
    fn trimmed(mut self) -> Self {
        while self.0.last() == Some(&0) {
            self.0.pop();
        }
        self
    }
    pub(super) fn is_zero(&self) -> bool {
        self.0.is_empty()
    }
    /// Number of binary digits.
    pub(super) fn bits(&self) -> i64 {
        self.0.last().map_or(0, |top| 64 * self.0.len() as i64 - i64::from(top.leading_zeros()))
    }
    /// `self * factor + summand`.
    pub(super) fn multiply_add(mut self, factor: u64, summand: u64) -> Self {
        let mut carry = u128::from(summand);
        for word in &mut self.0 {
            carry += u128::from(*word) * u128::from(factor);
            *word = carry as u64;
            carry >>= 64;
        }
        self.0.push(carry as u64);
        self.trimmed()
    }
    /// `self * base^exponent`, `base` below `2^4`.
    fn times_power(mut self, base: u64, mut exponent: u32) -> Self {
        while exponent > 0 {
            let step = exponent.min(16);
            self = self.multiply_add(base.pow(step), 0);
            exponent -= step;
        }
        self
    }
    fn shifted_left(&self, by: u32) -> Self {
        let mut words = vec![0; (by / 64) as usize];
        let bits = by % 64;
        let mut carry = 0;
        for &word in &self.0 {
            words.push(word << bits | carry);
            carry = if bits == 0 { 0 } else { word >> (64 - bits) };
        }
        words.push(carry);
        Self(words).trimmed()
    }
    pub(super) fn add(&self, other: &Self) -> Self {
        let mut carry = 0_u128;
        let at = |x: &Self, k: usize| u128::from(x.0.get(k).copied().unwrap_or(0));
        let words = (0..=self.0.len().max(other.0.len()))
            .map(|k| {
                carry += at(self, k) + at(other, k);
                let word = carry as u64;
                carry >>= 64;
                word
            })
            .collect();
        Self(words).trimmed()
    }
    /// `|self - other|`.
    pub(super) fn distance(&self, other: &Self) -> Self {
        let (large, small) = if self >= other { (self, other) } else { (other, self) };
        let mut borrow = false;
        let words = large
            .0
            .iter()
            .enumerate()
            .map(|(k, &word)| {
                let (word, first) = word.overflowing_sub(small.0.get(k).copied().unwrap_or(0));
                let (word, second) = word.overflowing_sub(u64::from(borrow));
                borrow = first || second;
                word
            })
            .collect();
        Self(words).trimmed()
    }
    /// Divides by `10^16` in place and returns the remainder.
    fn take_sixteen_digits(&mut self) -> u64 {
        const UNIT: u128 = 10_000_000_000_000_000;
        let mut rest = 0_u128;
        for word in self.0.iter_mut().rev() {
            let value = rest << 64 | u128::from(*word);
            *word = (value / UNIT) as u64;
            rest = value % UNIT;
        }
        while self.0.last() == Some(&0) {
            self.0.pop();
        }
        rest as u64
    }
    /// Decimal digits, most significant first; empty for zero.
    fn decimal_digits(mut self) -> Vec<u8> {
        let mut reversed = Vec::new();
        while !self.is_zero() {
            let mut group = self.take_sixteen_digits();
            for _ in 0..16 {
                reversed.push((group % 10) as u8);
                group /= 10;
            }
        }
        while reversed.last() == Some(&0) {
            reversed.pop();
        }
        reversed.reverse();
        reversed
    }
    /// `numerator / denominator`, correctly rounded where the result is a normal number; the denominator is not zero.
    pub(super) fn quotient(numerator: &Self, denominator: &Self) -> f64 {
        if numerator.is_zero() {
            return 0.0;
        }
        // Scaled so that the quotient has 63 or 64 bits; the last bit also reflects everything below.
        let shift = 64 - (numerator.bits() - denominator.bits());
        let lift = |x: &Self, by: i64| x.shifted_left(by.max(0) as u32);
        let (mut rest, mut divisor) = (lift(numerator, shift), lift(denominator, -shift));
        // Now 2^63 < rest / divisor < 2^65: subtract divisor 2^k from the top.
        let mut quotient = 0_u128;
        divisor = divisor.shifted_left(64);
        for _ in 0..=64 {
            quotient <<= 1;
            if rest >= divisor {
                rest = rest.distance(&divisor);
                quotient |= 1;
            }
            rest = rest.shifted_left(1);
        }
        // The steps doubled the remainder instead of halving the divisor: 65 binary digits are known.
        let sticky = u128::from(!rest.is_zero());
        let value = (quotient << 1 | sticky) as f64;
        libm::scalbn(value, -(shift as i32) - 1)
    }
}

impl PartialOrd for Natural {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Natural {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.len().cmp(&other.0.len()).then_with(|| self.0.iter().rev().cmp(other.0.iter().rev()))
    }
}
