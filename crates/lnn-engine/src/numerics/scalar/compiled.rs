//! Code that is compiled once for each scalar.

use core::any::Any;

/// Code that a higher module compiles in this crate for each scalar: generic code takes it from here, so that no crate that calls such code
/// compiles it again.
pub trait Compiled<Module> {
    /// The routines of the module, a type of its own.
    fn routines() -> &'static dyn Any;
}

/// The evaluation of recorded Lagrangians.
pub enum Tapes {}
/// The terms of Lagrangians that are written down.
pub enum Lagrangians {}
/// The terms of networks.
pub enum Networks {}

/// Compiles the routines of a module, a `Copy` type with a constant `ALL` for each scalar, and returns them by its function `get`. What only
/// programs with a feature use is otherwise compiled where it is called.
macro_rules! compiled {
    ($module:ident, $routines:ident $(, $feature:literal)?) => {
        compiled!(@ $module, $routines, [$($feature)?], f32 f64 $crate::scalar::Dd);

        impl<F: $crate::scalar::Foreign> $crate::scalar::Compiled<$crate::scalar::$module> for $crate::scalar::AnyFloat<F> {
            fn routines() -> &'static dyn core::any::Any {
                &$routines::<Self>::ALL
            }
        }

        impl<S: $crate::scalar::Scalar> $routines<S> {
            fn get() -> Self {
                let routines = <S as $crate::scalar::Compiled<$crate::scalar::$module>>::routines();
                *routines.downcast_ref().expect("every scalar holds its own routines")
            }
        }
    };
    (@ $module:ident, $routines:ident, $feature:tt, $($scalar:ty)*) => {$(
        impl $crate::scalar::Compiled<$crate::scalar::$module> for $scalar {
            compiled!(@ $routines, $feature);
        }
    )*};
    // If these were inlined elsewhere, the routines would be compiled there as well.
    (@ $routines:ident, []) => {
        #[inline(never)]
        fn routines() -> &'static dyn core::any::Any {
            &$routines::<Self>::ALL
        }
    };
    (@ $routines:ident, [$feature:literal]) => {
        #[cfg_attr(feature = $feature, inline(never))]
        #[cfg_attr(not(feature = $feature), inline)]
        fn routines() -> &'static dyn core::any::Any {
            &$routines::<Self>::ALL
        }
    };
}
pub(crate) use compiled;
