//! Numbers of formulas, in every precision they may be evaluated in.

use crate::scalar::{Dd, Scalar};

/// A decimal number: the nearest `f32` and the nearest [`Dd`], whose leading part is the nearest `f64`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Number {
    exact: Dd,
    single: f32,
}

impl Number {
    /// Reads decimal text that a scalar's own parser takes; `None` for what is not finite.
    pub fn parse(text: &str) -> Option<Self> {
        let (exact, single) = (Dd::parse(text)?, f32::parse(text)?);
        exact.is_finite().then_some(Self { exact, single })
    }
    /// A number that every precision has.
    pub fn exact(value: f64) -> Self {
        Self { exact: Dd::of_f64(value), single: value as f32 }
    }
    /// The number nearest to the decimal text.
    pub fn value<S: Scalar>(self) -> S {
        if S::NAME == f32::NAME { S::of_f64(f64::from(self.single)) } else { self.exact.cast() }
    }
    /// Its value if it is a whole one that is an exponent.
    pub fn integer(self) -> Option<i32> {
        let (high, low) = self.exact.parts();
        let whole = low == 0.0 && high.fract() == 0.0 && high.abs() <= f64::from(i32::MAX);
        whole.then_some(high as i32)
    }
    /// `1 / x` if that is exact in every precision: `x` a power of two of moderate size.
    pub fn exact_reciprocal(self) -> Option<Self> {
        let (high, low) = self.exact.parts();
        let power = low == 0.0 && high > 0.0 && high.log2().fract() == 0.0 && (-100.0..=100.0).contains(&high.log2());
        (power && high == 2f64.powi(high.log2() as i32)).then(|| Self::exact(1.0 / high))
    }
    /// `true` if it is this `f64`.
    pub fn is(self, value: f64) -> bool {
        self.exact.parts() == (value, 0.0)
    }
    /// Key that equal numbers share.
    pub fn bits(self) -> (u64, u64, u32) {
        let (high, low) = self.exact.parts();
        (high.to_bits(), low.to_bits(), self.single.to_bits())
    }
}
