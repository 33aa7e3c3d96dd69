//! Forward numbers: values with directional derivatives.
