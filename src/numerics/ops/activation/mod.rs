//! Activation functions and their derivatives.

mod formula;
mod gain;
mod jets;

use crate::ops::Unary;
use crate::scalar::Real;

/// Builds the enum and all that belongs to an activation from rows `Name "name" formula (operation);`: the name in configurations and
/// files, the closed forms of [`formula`], and the row of the table of operations that it is.
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
        use each_activation;

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

impl std::fmt::Display for Activation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests;
