//! Branch-free pieces for `f32` and `f64`.

use super::{Exponential, Lanes};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// `even[0] + odd[0] x + even[1] x^2 + ...` by two interleaved Horner rules in `square = x^2`.
trait Polynomial: Sized {
    fn polynomial<const E: usize, const O: usize>(self, square: Self, even: [Self; E], odd: [Self; O]) -> Self;
    /// `c[0] + c[1] x + c[2] x^2 + ...` by Horner's rule.
    fn series<const N: usize>(self, c: [Self; N]) -> Self;
}

macro_rules! impl_pieces {
    (
        $float:ident, $bits:ident, limit: $limit:expr, ln2: ($ln2_high:expr, $ln2_low:expr),
        exp: ($exp_even:expr, $exp_odd:expr), log: ($log_even:expr, $log_odd:expr),
        tail: ($center:expr, $tail_even:expr, $tail_odd:expr),
        artanh: $artanh:expr, sin: $sin:expr, cos: $cos:expr,
        quarter: ($quarter_high:expr, $quarter_middle:expr, $quarter_low:expr), fast_angle: $fast_angle:expr
    ) => {
        impl Polynomial for $float {
            #[inline(always)]
            fn polynomial<const E: usize, const O: usize>(self, square: Self, even: [Self; E], odd: [Self; O]) -> Self {
                square.series(odd).mul_add(self, square.series(even))
            }
            // A loop, for it to be compiled into every kernel whatever the level of optimisation.
            #[inline(always)]
            fn series<const N: usize>(self, c: [Self; N]) -> Self {
                let mut sum = c[N - 1];
                let mut k = N - 1;
                while k > 0 {
                    k -= 1;
                    sum = sum.mul_add(self, c[k]);
                }
                sum
            }
        }

        impl Lanes for $float {
            #[inline(always)]
            fn lane_fused(self, factor: Self, summand: Self) -> Self {
                self.mul_add(factor, summand)
            }
            #[inline(always)]
            fn lane_exp(self) -> Exponential<Self> {
                const FRACTION: u32 = <$float>::MANTISSA_DIGITS - 1;
                const BIAS: $bits = (<$float>::MAX_EXP - 1) as $bits;
                // Adding it rounds to an integer, which is then in the lowest bits.
                const MAGIC: $float = 1.5 * ((1 as $bits) << FRACTION) as $float;
                const OFFSET: $bits = 1 << 11;
                let y = if self < -$limit { -$limit } else { self };
                let y = if y > $limit { $limit } else { y };
                let shifted = y.mul_add(core::$float::consts::LOG2_E, MAGIC);
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
            #[inline(always)]
            fn lane_ln(self) -> Self {
                const FRACTION: u32 = <$float>::MANTISSA_DIGITS - 1;
                const SQRT_HALF: $bits = core::$float::consts::FRAC_1_SQRT_2.to_bits();
                const ONE: $bits = (1.0 as $float).to_bits();
                // An integer added to the bits of this number is that integer added to its value.
                const INTEGER: $float = ((1 as $bits) << FRACTION) as $float;
                const LIFT: $float = 2.0 * INTEGER;
                let tiny = self < <$float>::MIN_POSITIVE;
                let x = if tiny { self * LIFT } else { self };
                let lifted = if tiny { (FRACTION + 1) as $float } else { 0.0 };
                // x = 2^k m with sqrt(1/2) <= m < sqrt(2)
                let offset = x.to_bits().wrapping_add(ONE - SQRT_HALF);
                let m = $float::from_bits((offset & (((1 as $bits) << FRACTION) - 1)).wrapping_add(SQRT_HALF));
                let biased = $float::from_bits((offset >> FRACTION) | INTEGER.to_bits()) - INTEGER;
                let k = biased - (<$float>::MAX_EXP - 1) as $float - lifted;
                // ln m = f - (f^2/2 - s (f^2/2 + R)) with s = f / (2 + f): as in FreeBSD's e_log.c.
                let f = m - 1.0;
                let s = f / (2.0 + f);
                let square = s * s;
                let half = 0.5 * f * f;
                let rest = square * square.series($artanh);
                let inner = half - k.mul_add($ln2_low, s * (half + rest));
                let value = k.mul_add($ln2_high, f - inner);
                let value = if self == <$float>::INFINITY { self } else { value };
                let value = if self == 0.0 { -<$float>::INFINITY } else { value };
                if self >= 0.0 { value } else { <$float>::NAN }
            }
            #[inline(always)]
            fn fast_angle() -> Self {
                $fast_angle
            }
            #[inline(always)]
            fn lane_sin_cos(self) -> (Self, Self) {
                const FRACTION: u32 = <$float>::MANTISSA_DIGITS - 1;
                const MAGIC: $float = 1.5 * ((1 as $bits) << FRACTION) as $float;
                let shifted = self.mul_add(core::$float::consts::FRAC_2_PI, MAGIC);
                let n = shifted - MAGIC;
                let r = n.mul_add(-$quarter_high, self);
                // r is exact. `lost` is the error of z = r - p, including the rounding of the product.
                let p = n * $quarter_middle;
                let z = r - p;
                let back = z - r;
                let lost = (r - (z - back)) - (p + back) - n.mul_add($quarter_middle, -p);
                let rest = n.mul_add(-$quarter_low, lost);
                let square = z * z;
                // sin(z + rest) and cos(z + rest)
                let sin = z + (square * z).mul_add(square.series($sin), rest);
                let half = 0.5 * square;
                let near = 1.0 - half;
                let cos = near + ((1.0 - near) - half + (square * square).mul_add(square.series($cos), -z * rest));
                let bits = shifted.to_bits();
                let (a, b) = if bits & 1 == 0 { (sin, cos) } else { (cos, sin) };
                let sign = |x: Self, bit: $bits| $float::from_bits(x.to_bits() ^ (bit & 2) << (<$bits>::BITS - 2));
                (sign(a, bits), sign(b, bits.wrapping_add(1)))
            }
        }
    };
}

impl_pieces! {
    f32, u32, limit: 150.0, ln2: (core::f32::consts::LN_2, -1.904_654_2e-9),
    exp: (
        [0.5, 1.0 / 24.0, 1.0 / 720.0],
        [1.0 / 6.0, 1.0 / 120.0, 1.0 / 5040.0]
    ),
    log: ([1.0, 0.199_993_48, 0.106_971_34], [0.333_333_4, 0.143_103_12, 0.122_047_015]),
    tail: (
        3.0,
        [0.729_083_66, 0.230_019_9, -0.010_484_374, 0.001_089_887_7, -0.000_281_760_76],
        [-0.509_332_06, -0.047_259_573, 0.006_937_723_6, -0.000_918_778_36]
    ),
    artanh: [0.666_666_6, 0.400_009_72, 0.284_987_87, 0.242_790_79],
    sin: [-1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0],
    cos: [1.0 / 24.0, -1.0 / 720.0, 1.0 / 40320.0, -1.0 / 3_628_800.0],
    quarter: (core::f32::consts::FRAC_PI_2, -4.371_139e-8, -1.715_124_5e-15), fast_angle: 8192.0
}

impl_pieces! {
    f64, u64, limit: 800.0, ln2: (core::f64::consts::LN_2, 2.3190468138462996e-17),
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
    ),
    artanh: [
        0.6666666666666735, 0.3999999999940942, 0.2857142874366239, 0.22222198432149784,
        0.1818357216161805, 0.15313837699209373, 0.14798198605116586
    ],
    sin: [
        -0.16666666666666632, 0.00833333333332249, -0.0001984126982985795,
        2.7557313707070068e-06, -2.5050760253406863e-08, 1.58969099521155e-10
    ],
    cos: [
        0.0416666666666666, -0.001388888888887411, 2.480158728947673e-05,
        -2.7557314351390663e-07, 2.087572321298175e-09, -1.1359647557788195e-11
    ],
    quarter: (core::f64::consts::FRAC_PI_2, 6.123233995736766e-17, -1.4973849048591698e-33), fast_angle: 1048576.0
}
