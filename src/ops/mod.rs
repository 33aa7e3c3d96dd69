//! The one table of operations: values and partial derivatives.
