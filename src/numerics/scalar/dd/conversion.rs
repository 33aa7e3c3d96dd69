//! The traits of `num-traits` that make sense for a number type of the library.

use super::{Dd, elementary::LN_2, reduction::HALF_PI};
use crate::scalar::Scalar;
use num_traits::{FloatConst, FromPrimitive, Num, NumCast, One, ToPrimitive, Zero};

impl Zero for Dd {
    fn zero() -> Self {
        Self::leading(0.0)
    }
    fn is_zero(&self) -> bool {
        self.high == 0.0
    }
}
impl One for Dd {
    fn one() -> Self {
        Self::leading(1.0)
    }
}

impl Num for Dd {
    type FromStrRadixErr = UnreadableNumber;

    /// Radix 10 only.
    fn from_str_radix(text: &str, radix: u32) -> Result<Self, UnreadableNumber> {
        let number = if radix == 10 { Self::parse(text) } else { None };
        number.ok_or(UnreadableNumber)
    }
}

/// A text that is no decimal number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("not a decimal number")]
pub struct UnreadableNumber;

impl std::str::FromStr for Dd {
    type Err = UnreadableNumber;

    fn from_str(text: &str) -> Result<Self, UnreadableNumber> {
        Self::parse(text).ok_or(UnreadableNumber)
    }
}

impl From<f64> for Dd {
    fn from(value: f64) -> Self {
        Self::leading(value)
    }
}

impl FromPrimitive for Dd {
    fn from_i64(value: i64) -> Option<Self> {
        Self::from_i128(value.into())
    }
    fn from_u64(value: u64) -> Option<Self> {
        Self::from_i128(value.into())
    }
    /// Exact below `2^106`, then rounded.
    fn from_i128(value: i128) -> Option<Self> {
        let high = value as f64;
        // The rest is small: the leading part is the nearest `f64` (one step down where it left the integer type).
        let rest = value.wrapping_sub(if high >= 2.0_f64.powi(127) { i128::MIN } else { high as i128 });
        Some(Self::new(high, rest as f64))
    }
    fn from_f64(value: f64) -> Option<Self> {
        Some(Self::leading(value))
    }
}

impl ToPrimitive for Dd {
    fn to_i64(&self) -> Option<i64> {
        self.to_i128().and_then(|value| i64::try_from(value).ok())
    }
    fn to_u64(&self) -> Option<u64> {
        self.to_i128().and_then(|value| u64::try_from(value).ok())
    }
    /// Rounded towards zero; `None` outside the range.
    fn to_i128(&self) -> Option<i128> {
        let whole = if self.high < 0.0 { -(-*self).floor() } else { self.floor() };
        // Strictly inside the range, so that the sum of the parts cannot leave it.
        (whole.high.abs() < 2.0_f64.powi(126)).then(|| whole.high as i128 + whole.low as i128)
    }
    fn to_f64(&self) -> Option<f64> {
        Some(self.high)
    }
}

impl NumCast for Dd {
    fn from<T: ToPrimitive>(value: T) -> Option<Self> {
        value.to_f64().map(Self::leading)
    }
}

macro_rules! constants {
    ($($name:ident = $value:expr;)*) => {$(
        fn $name() -> Self {
            $value
        }
    )*};
}

const fn pair(high: f64, low: f64) -> Dd {
    Dd { high, low }
}

#[allow(non_snake_case, clippy::approx_constant)]
impl FloatConst for Dd {
    constants! {
        E = pair(std::f64::consts::E, 1.4456468917292502e-16);
        PI = <Self as Scalar>::pi();
        TAU = <Self as Scalar>::pi().ldexp(1);
        FRAC_PI_2 = HALF_PI;
        FRAC_PI_3 = pair(std::f64::consts::FRAC_PI_3, -1.072081766451091e-16);
        FRAC_PI_4 = HALF_PI.ldexp(-1);
        FRAC_PI_6 = pair(std::f64::consts::FRAC_PI_6, -5.360408832255455e-17);
        FRAC_PI_8 = HALF_PI.ldexp(-2);
        FRAC_1_PI = pair(std::f64::consts::FRAC_1_PI, -1.9678676675182486e-17);
        FRAC_2_PI = pair(std::f64::consts::FRAC_2_PI, -3.935735335036497e-17);
        FRAC_2_SQRT_PI = pair(std::f64::consts::FRAC_2_SQRT_PI, 1.533545961316588e-17);
        FRAC_1_SQRT_2 = Self::SQRT_HALF;
        SQRT_2 = Self::SQRT_HALF.ldexp(1);
        LN_2 = LN_2;
        LN_10 = pair(std::f64::consts::LN_10, -2.1707562233822494e-16);
        LOG2_E = pair(std::f64::consts::LOG2_E, 2.0355273740931033e-17);
        LOG10_E = pair(std::f64::consts::LOG10_E, 1.098319650216765e-17);
        LOG2_10 = pair(std::f64::consts::LOG2_10, 1.661617516973592e-16);
        LOG10_2 = pair(std::f64::consts::LOG10_2, -2.8037281277851704e-18);
    }
}
