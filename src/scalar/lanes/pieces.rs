//! Branch-free pieces for `f32` and `f64`.

use super::{Exponential, Lanes};

/// `even[0] + odd[0] x + even[1] x^2 + ...` by two interleaved Horner rules in `square = x^2`.
trait Polynomial: Sized {
    fn polynomial<const E: usize, const O: usize>(self, square: Self, even: [Self; E], odd: [Self; O]) -> Self;
}

macro_rules! impl_pieces {
    (
        $float:ident, $bits:ident, lowest: $lowest:expr, ln2: ($ln2_high:expr, $ln2_low:expr),
        exp: ($exp_even:expr, $exp_odd:expr), log: ($log_even:expr, $log_odd:expr),
        tail: ($center:expr, $tail_even:expr, $tail_odd:expr)
    ) => {
        impl Polynomial for $float {
            #[inline(always)]
            fn polynomial<const E: usize, const O: usize>(self, square: Self, even: [Self; E], odd: [Self; O]) -> Self {
                let horner = |sum: Self, &c: &Self| sum.mul_add(square, c);
                let even_part = even[..E - 1].iter().rev().fold(even[E - 1], horner);
                let odd_part = odd[..O - 1].iter().rev().fold(odd[O - 1], horner);
                odd_part.mul_add(self, even_part)
            }
        }

        impl Lanes for $float {
            #[inline(always)]
            fn lane_fused(self, factor: Self, summand: Self) -> Self {
                self.mul_add(factor, summand)
            }
            #[inline(always)]
            fn lane_decay(self) -> Exponential<Self> {
                const FRACTION: u32 = <$float>::MANTISSA_DIGITS - 1;
                const BIAS: $bits = (<$float>::MAX_EXP - 1) as $bits;
                // Adding it rounds to an integer, which then stands in the lowest bits.
                const MAGIC: $float = 1.5 * ((1 as $bits) << FRACTION) as $float;
                const OFFSET: $bits = 1 << 11;
                let y = if self < $lowest { $lowest } else { self };
                let shifted = y.mul_add(std::$float::consts::LOG2_E, MAGIC);
                let n = shifted - MAGIC;
                let r = n.mul_add(-$ln2_low, n.mul_add(-$ln2_high, y));
                let square = r * r;
                // e^r - 1 = r + r^2 (1/2! + r/3! + ...)
                let tail = r.polynomial(square, $exp_even, $exp_odd);
                let small = square.mul_add(tail, r);
                // 2^n as the product of 2^floor(n/2) and the rest: neither under- nor overflows.
                let n = shifted.to_bits().wrapping_sub(MAGIC.to_bits()).wrapping_add(OFFSET);
                let half = n >> 1;
                let power = |k: $bits| $float::from_bits(k.wrapping_add(BIAS.wrapping_sub(OFFSET / 2)) << FRACTION);
                let (first, second) = (power(half), power(n.wrapping_sub(half)));
                let whole = first * second;
                Exponential { mantissa: 1.0 + small, first, second, minus_one: whole.mul_add(small, whole - 1.0) }
            }
            #[inline(always)]
            fn lane_log1p_ratio(self) -> Self {
                // ln(1 + e) = 2 artanh(e / (2 + e))
                let inverse = 1.0 / (2.0 + self);
                let u = self * inverse;
                let v = u * u;
                2.0 * inverse * v.polynomial(v * v, $log_even, $log_odd)
            }
            #[inline(always)]
            fn lane_normal_tail(self) -> Self {
                let t = 1.0 / (self + $center);
                let s = (self - $center) * t;
                t * s.polynomial(s * s, $tail_even, $tail_odd)
            }
        }
    };
}

impl_pieces! {
    f32, u32, lowest: -150.0, ln2: (std::f32::consts::LN_2, -1.904_654_2e-9),
    exp: (
        [0.5, 1.0 / 24.0, 1.0 / 720.0],
        [1.0 / 6.0, 1.0 / 120.0, 1.0 / 5040.0]
    ),
    log: ([1.0, 0.199_993_48, 0.106_971_34], [0.333_333_4, 0.143_103_12, 0.122_047_015]),
    tail: (
        3.0,
        [0.729_083_66, 0.230_019_9, -0.010_484_374, 0.001_089_887_7, -0.000_281_760_76],
        [-0.509_332_06, -0.047_259_573, 0.006_937_723_6, -0.000_918_778_36]
    )
}

impl_pieces! {
    f64, u64, lowest: -800.0, ln2: (std::f64::consts::LN_2, 2.3190468138462996e-17),
    exp: (
        [0.5, 1.0 / 24.0, 1.0 / 720.0, 1.0 / 40320.0, 1.0 / 3628800.0, 1.0 / 479001600.0],
        [1.0 / 6.0, 1.0 / 120.0, 1.0 / 5040.0, 1.0 / 362880.0, 1.0 / 39916800.0, 1.0 / 6227020800.0]
    ),
    log: (
        [1.0, 0.20000000000094656, 0.11111112052466518, 0.07693315371624586, 0.060558960079100006, 0.08528287251473514],
        [0.3333333333333307, 0.14285714272520955, 0.09090870008906127, 0.06650081100282697, 0.041588104702145766]
    ),
    tail: (
        5.0,
        [
            0.769193049750063, 0.4953056159699761, 0.16502036617040672, 0.020795066799274252, -0.0007978693895287212,
            -5.9375805162372396e-05, 1.6681627096615133e-05, -2.770675979392515e-06, 4.361932993734973e-07,
            -7.000693181525342e-08, 1.0694609407999257e-08, -1.1275686584114748e-09
        ],
        [
            -0.6653825028900568, -0.313533156671288, -0.06911863870685948, -0.002993376762154176, 0.0005448989951556222,
            -4.976246819752703e-05, 3.979842167870731e-06, -3.346442375826221e-07, 4.025216079941169e-08,
            -8.5852629726266e-09, 2.207298117618302e-09, -3.6917135362496476e-10
        ]
    )
}
