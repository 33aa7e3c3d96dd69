//! Circular functions and their inverses.

use super::Dd;
use super::reduction::{HALF_PI, quarter_turns};
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
    /// Quarter turn and the sine and cosine of what is left.
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
                () if start.abs() == std::f64::consts::PI => Self::pi().with_sign_of(start),
                () if start.abs() == std::f64::consts::FRAC_PI_2 => HALF_PI.with_sign_of(start),
                () if start.abs() == std::f64::consts::FRAC_PI_4 => (HALF_PI * Self::leading(0.5)).with_sign_of(start),
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
