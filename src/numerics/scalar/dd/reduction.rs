//! Angles of any size as quarter turns and a rest (M. H. Payne and R. N. Hanek, SIGNUM Newsletter 18, 1983).
//!
//! `x 2/pi mod 4` is computed as an integer with 382 binary places: the bits of `2/pi` that make whole turns with the last
//! bit of `x` are skipped. Cancellation near multiples of `pi/2` eats at most some 130 places of a double-double number.

use super::Dd;

/// A quarter turn.
pub(super) const HALF_PI: Dd = Dd { high: std::f64::consts::FRAC_PI_2, low: 6.123233995736766e-17 };

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
    std::array::from_fn(|k| match bit {
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
    std::array::from_fn(|k| match bits {
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
pub(super) fn quarter_turns(x: Dd) -> (u8, Dd) {
    if x.high.abs() <= std::f64::consts::FRAC_PI_4 {
        return (0, x);
    }
    let signed = |part: f64| if part < 0.0 { negated(turns(part)) } else { turns(part) };
    let sum = add(signed(x.high), signed(x.low));
    // Round to the nearest quarter; what is left is a signed fraction.
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
