//! Activation functions and their derivatives.

mod formula;

use crate::ops::Unary;
use crate::scalar::{Real, Scalar, vectorized};
use formula::Jet;

/// Builds the enum and all functions of activations from rows `Name "name" formula (operation);`: the name in configurations and files, the
/// closed forms of [`formula`], and the corresponding row of the table of operations.
macro_rules! table {
    ($($(#[$($doc:tt)*])* $name:ident $text:literal $formula:ident ($($operation:tt)*);)*) => {
        /// Elementwise function that ends a layer.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum Activation {
            $($(#[$($doc)*])* $name,)*
            /// `x`, of linear layers.
            Identity,
        }

        impl Activation {
            /// Every activation.
            pub const ALL: [Self; [$($text),*].len() + 1] = [$(Self::$name,)* Self::Identity];

            /// The operation of this activation; `None` for the identity.
            fn operation(self) -> Option<Unary> {
                match self {
                    $(Self::$name => Some($($operation)*),)*
                    Self::Identity => None,
                }
            }

            /// The activation whose vectorised closed forms serve an operation.
            pub(crate) fn of(operation: Unary) -> Option<Self> {
                match operation {
                    $($($operation)* => Some(Self::$name),)*
                    _ => None,
                }
            }

            /// The name, as in configuration files.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $text,)*
                    Self::Identity => "identity",
                }
            }
        }

        /// Runs one loop per activation; the formula is inlined into each.
        macro_rules! each_activation {
            ($activation:expr, $jet:ident => $body:expr) => {
                match $activation {
                    $(Activation::$name => each_activation!(@one $formula, $jet => $body),)*
                    Activation::Identity => each_activation!(@one identity, $jet => $body),
                }
            };
            (@one $one:ident, $jet:ident => $body:expr) => {{
                use formula::$one as $jet;
                vectorized(
                    #[inline(always)]
                    || $body,
                )
            }};
        }

        /// Calls back with documentation and name of every row.
        macro_rules! activations {
            ($callback:ident) => { $callback! { $($(#[$($doc)*])* $name $text;)* } };
        }
        pub(crate) use activations;
    };
}

table! {
    /// `x Phi(x)`, exact (error function).
    Gelu "gelu" gelu (Unary::Gelu);
    /// `ln(1 + e^x)`.
    Softplus "softplus" softplus (Unary::Softplus);
    /// `x tanh(x / 2)`.
    XTanh "x-tanh" x_tanh (Unary::XTanh);
    /// `tanh(x)`.
    Tanh "tanh" tanh (Unary::Tanh);
    /// `x^2`.
    Quadratic "quadratic" quadratic (Unary::Powi(2));
    /// `x / (1 + e^-x)`, also called swish.
    Silu "silu" silu (Unary::Silu);
}

impl Activation {
    /// The activation of any kind of real number.
    pub fn apply<R: Real>(self, x: R) -> R {
        self.operation().map_or(x, |operation| operation.evaluate(x))
    }
}

impl core::fmt::Display for Activation {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests;

impl Activation {
    /// `1 / sqrt(E[act'(Z)^2])` for a standard normal `Z`: the gain of weights drawn with standard deviation
    /// `gain / sqrt(fan_in)`, which keep the variance of the gradients between layers of one width.
    ///
    /// Trapezoidal rule with step 1/16 on `[-14, 14]`; accurate to `1e-12`, for the integrand is analytic in a strip of
    /// half-width `pi/2` or wider, where the rule converges like `e^(-2 pi (pi/2) 16)`.
    pub(crate) fn variance_gain(self) -> f64 {
        const STEP: f64 = 1.0 / 16.0;
        let mean: f64 = (-224..=224)
            .map(|k| {
                let z = f64::from(k) * STEP;
                let slope = self.derivatives(z)[1];
                slope * slope * (-0.5 * z * z).exp()
            })
            .sum();
        let mean = mean * STEP / (2.0 * core::f64::consts::PI).sqrt();
        mean.sqrt().recip()
    }

    /// Value and four derivatives at `x`: `[f, f', f'', f''', f'''']`.
    ///
    /// Closed forms, each accurate to a few units of rounding times its own condition number `1 + |x f^(k+1) / f^(k)|`,
    /// into the tails until underflow; finite for every finite `x` but the value of the quadratic.
    pub fn derivatives<S: Scalar>(self, x: S) -> Jet<S> {
        each_activation!(self, jet => jet(x))
    }

    /// `f = act(z)` elementwise. All slices have the same length.
    pub fn value<S: Scalar>(self, z: &[S], f: &mut [S]) {
        each_activation!(self, jet => {
            let n = z.len();
            let f = &mut f[..n];
            for k in 0..n {
                f[k] = jet(z[k])[0];
            }
        });
    }

    /// Value and first derivative, elementwise. All slices have the same length.
    pub fn jet1<S: Scalar>(self, z: &[S], f: &mut [S], d1: &mut [S]) {
        each_activation!(self, jet => {
            let n = z.len();
            let (f, d1) = (&mut f[..n], &mut d1[..n]);
            for k in 0..n {
                [f[k], d1[k], ..] = jet(z[k]);
            }
        });
    }

    /// Value and two derivatives, elementwise. All slices have the same length.
    pub fn jet2<S: Scalar>(self, z: &[S], f: &mut [S], d1: &mut [S], d2: &mut [S]) {
        each_activation!(self, jet => {
            let n = z.len();
            let (f, d1, d2) = (&mut f[..n], &mut d1[..n], &mut d2[..n]);
            for k in 0..n {
                [f[k], d1[k], d2[k], ..] = jet(z[k]);
            }
        });
    }

    /// Value and three derivatives, elementwise. All slices have the same length.
    pub fn jet3<S: Scalar>(self, z: &[S], f: &mut [S], d1: &mut [S], d2: &mut [S], d3: &mut [S]) {
        each_activation!(self, jet => {
            let n = z.len();
            let (f, d1, d2, d3) = (&mut f[..n], &mut d1[..n], &mut d2[..n], &mut d3[..n]);
            for k in 0..n {
                [f[k], d1[k], d2[k], d3[k], _] = jet(z[k]);
            }
        });
    }
}
