//! Circular functions and their inverses.
//!
//! Angles of any size are reduced to quarter turns and a remainder (M. H. Payne and R. N. Hanek, SIGNUM Newsletter 18, 1983).
//!
//! `x 2/pi mod 4` is computed as an integer with 382 binary places: the bits of `2/pi` that make whole turns with the last
//! bit of `x` are skipped. Cancellation near multiples of `pi/2` eats at most some 130 places of a double-double number.

use super::Dd;
use crate::scalar::{Real, Scalar};

const ONE: Dd = Dd::leading(1.0);

/// `sum of (-z^2)^k / (first + 2k)!` relative to its first term 1, `|z| <= pi/4`.
fn alternating_series(z: Dd, first: i32) -> Dd {
    let square = -(z * z);
    (1..=14).rev().fold(ONE, |sum, k| {
        let n = f64::from(first + 2 * k);
        ONE + square.over(n * (n - 1.0)) * sum
    })
}

impl Dd {
    /// Quarter turn and the sine and cosine of the rest.
    fn reduced(self) -> (u8, Self, Self) {
        let (quarter, z) = quarter_turns(self);
        let sine = if z.high.abs() < 1e-150 { z } else { z * alternating_series(z, 1) };
        (quarter, sine, alternating_series(z, 0))
    }

    pub(super) fn sine_cosine(self) -> (Self, Self) {
        if !self.is_finite() {
            return (Self::nan(), Self::nan());
        }
        match self.reduced() {
            (0, s, c) => (s, c),
            (1, s, c) => (c, -s),
            (2, s, c) => (-s, -c),
            (_, s, c) => (-c, s),
        }
    }
    pub(super) fn sine(self) -> Self {
        self.sine_cosine().0
    }
    pub(super) fn cosine(self) -> Self {
        self.sine_cosine().1
    }
    pub(super) fn tangent(self) -> Self {
        let (s, c) = self.sine_cosine();
        s / c
    }

    pub(super) fn wrapped_angle(self) -> Self {
        if !self.is_finite() {
            return Self::nan();
        }
        let turn = Self::pi() + Self::pi();
        if self.high >= 0.0 && self < turn {
            return self;
        }
        let (quarter, z) = quarter_turns(self);
        let angle = z + HALF_PI * Self::leading(f64::from(quarter));
        let angle = if angle.high < 0.0 { angle + turn } else { angle };
        if angle >= turn { Self::leading(0.0) } else { angle }
    }

    /// The angle of the leading parts, corrected by the angle between the two directions.
    pub(super) fn arc_tangent_of(self, x: Self) -> Self {
        let y = self;
        let start = y.high.atan2(x.high);
        let special = y.high == 0.0 || x.high == 0.0 || !y.is_finite() || !x.is_finite();
        if special {
            return match () {
                () if start.abs() == core::f64::consts::PI => Self::pi().with_sign_of(start),
                () if start.abs() == core::f64::consts::FRAC_PI_2 => HALF_PI.with_sign_of(start),
                () if start.abs() == core::f64::consts::FRAC_PI_4 => (HALF_PI * Self::leading(0.5)).with_sign_of(start),
                () if start.abs() > 2.0 => (HALF_PI * Self::leading(1.5)).with_sign_of(start),
                () => Self::leading(start),
            };
        }
        // Neither overflow nor underflow of the products; a vanishing part cannot matter then.
        let shift = -y.high.ilogb().max(x.high.ilogb());
        let (scaled_y, scaled_x) = (y.ldexp(shift), x.ldexp(shift));
        if start.abs() < 1e-140 {
            return y / x;
        }
        let (s, c) = Self::leading(start).sine_cosine();
        let across = scaled_y * c - scaled_x * s;
        let along = scaled_x * c + scaled_y * s;
        Self::leading(start) + across / along
    }
    pub(super) fn arc_tangent(self) -> Self {
        self.arc_tangent_of(ONE)
    }
    pub(super) fn arc_sine(self) -> Self {
        self.arc_tangent_of(self.opposite_leg())
    }
    pub(super) fn arc_cosine(self) -> Self {
        self.opposite_leg().arc_tangent_of(self)
    }
    /// `sqrt(1 - self^2)`.
    fn opposite_leg(self) -> Self {
        ((ONE - self) * (ONE + self)).sqrt()
    }
    fn with_sign_of(self, sign: f64) -> Self {
        if sign.is_sign_negative() { -self } else { self }
    }
}

/// A quarter turn.
pub(super) const HALF_PI: Dd = Dd { high: core::f64::consts::FRAC_PI_2, low: 6.123233995736766e-17 };

/// Words of a window; the two leading bits are the quarter turn, the rest a fraction.
const WORDS: usize = 6;
type Fixed = [u64; WORDS];

/// The binary digits of `2/pi` after the point, most significant word first.
const TWO_OVER_PI: [u64; 22] = [
    0xa2f9836e4e441529,
    0xfc2757d1f534ddc0,
    0xdb6295993c439041,
    0xfe5163abdebbc561,
    0xb7246e3a424dd2e0,
    0x06492eea09d1921c,
    0xfe1deb1cb129a73e,
    0xe88235f52ebb4484,
    0xe99c7026b45f7e41,
    0x3991d639835339f4,
    0x9c845f8bbdf9283b,
    0x1ff897ffde05980f,
    0xef2f118b5a0a6d1f,
    0x6d367ecf27cb09b7,
    0x4f463f669e5fea2d,
    0x7527bac7ebe5f17b,
    0x3d0739f78a5292ea,
    0x6bfb5fb11f8d5d08,
    0x56033046fc7b6bab,
    0xf0cfbc209af4361d,
    0xa9e391615ee61b08,
    0x6599855f14a06840,
];

/// `WORDS` words of `2/pi` starting `skip` bits after the point.
fn window(skip: usize) -> Fixed {
    let (word, bit) = (skip / 64, (skip % 64) as u32);
    let at = |k: usize| TWO_OVER_PI.get(k).copied().unwrap_or(0);
    core::array::from_fn(|k| match bit {
        0 => at(word + k),
        _ => at(word + k) << bit | at(word + k + 1) >> (64 - bit),
    })
}

/// `|x| 2/pi mod 4` as a fixed-point number, `x` finite.
fn turns(x: f64) -> Fixed {
    let bits = x.abs().to_bits();
    let biased = (bits >> 52) as i32;
    let fraction = bits & ((1 << 52) - 1);
    // |x| = mantissa 2^exponent
    let (mantissa, exponent) = if biased == 0 { (fraction, -1074) } else { (fraction | 1 << 52, biased - 1075) };
    let skip = (exponent - 2).max(0);
    let mut carry = 0_u128;
    let mut product = window(skip as usize);
    for word in product.iter_mut().rev() {
        carry += u128::from(*word) * u128::from(mantissa);
        *word = carry as u64;
        carry >>= 64;
    }
    // Without whole turns to skip the product is larger than the format: shift it down, the carry included.
    let down = (skip - (exponent - 2)) as usize;
    if down == 0 {
        return product;
    }
    let (words, bits) = (down / 64, (down % 64) as u32);
    let at = |k: usize| match k.checked_sub(words) {
        None => 0,
        Some(0) => carry as u64,
        Some(k) => product.get(k - 1).copied().unwrap_or(0),
    };
    core::array::from_fn(|k| match bits {
        0 => at(k + 1),
        _ => at(k + 1) >> bits | at(k) << (64 - bits),
    })
}

fn negated(mut x: Fixed) -> Fixed {
    let mut carry = true;
    for word in x.iter_mut().rev() {
        (*word, carry) = (!*word).overflowing_add(u64::from(carry));
    }
    x
}

fn add(mut x: Fixed, y: Fixed) -> Fixed {
    let mut carry = 0_u128;
    for (a, b) in x.iter_mut().zip(y).rev() {
        carry += u128::from(*a) + u128::from(b);
        *a = carry as u64;
        carry >>= 64;
    }
    x
}

/// `(k, z)` with `x = (k + 4 m) pi/2 + z` for an integer `m`, `0 <= k < 4` and `|z| <= pi/4` up to rounding.
fn quarter_turns(x: Dd) -> (u8, Dd) {
    if x.high.abs() <= core::f64::consts::FRAC_PI_4 {
        return (0, x);
    }
    let signed = |part: f64| if part < 0.0 { negated(turns(part)) } else { turns(part) };
    let sum = add(signed(x.high), signed(x.low));
    // Round to the nearest quarter; the remainder is a signed fraction.
    let mut half = [0; WORDS];
    half[0] = 1 << 61;
    let quarter = (add(sum, half)[0] >> 62) as u8;
    let mut rest = sum;
    rest[0] = rest[0].wrapping_sub(u64::from(quarter) << 62);
    let negative = rest[0] >> 63 == 1;
    if negative {
        rest = negated(rest);
    }
    let z = leading_digits(rest) * HALF_PI;
    (quarter, if negative { -z } else { z })
}

/// The fixed-point number with two bits before the point, to the precision of `Dd`.
fn leading_digits(words: Fixed) -> Dd {
    let start = words.iter().position(|&w| w != 0).unwrap_or(WORDS);
    words.iter().enumerate().skip(start).take(4).rev().fold(Dd::leading(0.0), |sum, (k, &word)| {
        let unit = 2.0_f64.powi(-62 - 64 * k as i32);
        let (upper, lower) = ((word >> 32) as f64 * 4294967296.0, (word & 0xffff_ffff) as f64);
        sum + Dd::sum(upper * unit, lower * unit)
    })
}
