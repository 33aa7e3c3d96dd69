//! Slices by their concrete type, for kernels that exist per type (matrix products, vector functions).

/// A slice of scalars whose type is known where it is `f32` or `f64`.
#[derive(Clone, Copy, Debug)]
pub enum Slice<'a, S> {
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
    /// Any other scalar.
    Other(&'a [S]),
}

/// A mutable slice of scalars whose type is known where it is `f32` or `f64`.
#[derive(Debug)]
pub enum SliceMut<'a, S> {
    /// Single precision.
    F32(&'a mut [f32]),
    /// Double precision.
    F64(&'a mut [f64]),
    /// Any other scalar.
    Other(&'a mut [S]),
}

macro_rules! impl_from {
    ($($float:ident $variant:ident;)*) => {$(
        impl<'a> From<&'a [$float]> for Slice<'a, $float> {
            #[inline(always)]
            fn from(values: &'a [$float]) -> Self {
                Self::$variant(values)
            }
        }
        impl<'a> From<&'a mut [$float]> for SliceMut<'a, $float> {
            #[inline(always)]
            fn from(values: &'a mut [$float]) -> Self {
                Self::$variant(values)
            }
        }
    )*};
}
impl_from! { f32 F32; f64 F64; }
