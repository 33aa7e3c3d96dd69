//! Functions as lists of operations, dense layers among them, for readers in other languages.

use super::{Node, Recorder, Tracer};
use crate::scalar::Scalar;
use crate::tape::error::TapeError;

/// An operation; operands are rows, numbered in the order of the operations that fill them.
#[derive(Clone, Debug, PartialEq)]
pub enum Operation {
    /// Input by its index.
    Input(u32),
    /// Parameter by its index.
    Parameter(u32),
    /// A number.
    Constant(f64),
    /// A function of the operands, by its name in the table of operations, `Sin`, or `Powi(3)`; `SinCos` fills two rows.
    Function(String, Vec<u32>),
    /// `W x + b`: rows of `x`, number of outputs, first parameters of `W`, row-major, and of `b`.
    Dense(Vec<u32>, usize, usize, Option<usize>),
}

/// A recorded function of inputs and parameters with one result.
#[derive(Clone, Debug, PartialEq)]
pub struct Listing {
    /// Operations, each behind its operands.
    pub operations: Vec<Operation>,
    /// Row of the result.
    pub result: u32,
}

impl Listing {
    /// Records `f(inputs, parameters)`.
    ///
    /// # Errors
    /// As of [`Program::record`](super::Program::record).
    pub fn record<S: Scalar, F>(inputs: usize, parameters: usize, f: F) -> Result<Self, TapeError>
    where
        F: for<'t> FnOnce(&[Tracer<'t, S>], &[Tracer<'t, S>]) -> Tracer<'t, S>,
    {
        let recorder = Recorder::new(true);
        let result = {
            let (x, p) = (recorder.inputs(0, inputs), recorder.parameters(parameters));
            recorder.row_of(f(&x, &p))
        };
        let operations = recorder.finish()?.nodes.into_iter().map(|node| match node {
            Node::Input(index) => Operation::Input(index),
            Node::Parameter(index) => Operation::Parameter(index),
            Node::Constant(value) => Operation::Constant(value.to_f64()),
            Node::Unary(f, a) => Operation::Function(format!("{f:?}"), vec![a]),
            Node::SinCos(a) => Operation::Function("SinCos".to_string(), vec![a]),
            Node::Binary(f, a, b) => Operation::Function(format!("{f:?}"), vec![a, b]),
            Node::Select(c, a, b) => Operation::Function("Select".to_string(), vec![c, a, b]),
            Node::Dense(dense) => Operation::Dense(dense.inputs, dense.outputs, dense.weights, dense.bias),
        });
        Ok(Self { operations: operations.collect(), result })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Real;

    #[test]
    fn a_function_is_listed_with_its_layers() {
        let listing = Listing::record::<f64, _>(2, 4, |x, p| {
            let h = Real::affine(&p[..2], &p[2..3], x);
            h[0].powi(3) * p[3] + x[0].sin()
        });
        let Listing { operations, result } = listing.unwrap();
        assert_eq!(operations[..2], [Operation::Input(0), Operation::Input(1)]);
        assert!(operations.contains(&Operation::Dense(vec![0, 1], 1, 0, Some(2))), "{operations:?}");
        assert!(operations.contains(&Operation::Function("Powi(3)".to_string(), vec![2])), "{operations:?}");
        assert!(operations.contains(&Operation::Parameter(3)) && result as usize >= operations.len() - 1);
    }
}
