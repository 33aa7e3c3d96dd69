//! Natural numbers of any size, as far as exact decimal conversion needs them.

use std::cmp::Ordering;

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
    pub(super) fn times_power(mut self, base: u64, mut exponent: u32) -> Self {
        while exponent > 0 {
            let step = exponent.min(16);
            self = self.multiply_add(base.pow(step), 0);
            exponent -= step;
        }
        self
    }
    pub(super) fn shifted_left(&self, by: u32) -> Self {
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
    pub(super) fn decimal_digits(mut self) -> Vec<u8> {
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
        // Scaled so that the quotient has 63 or 64 bits; the last one also tells of everything below.
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
