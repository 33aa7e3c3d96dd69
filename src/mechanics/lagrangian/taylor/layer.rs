//! Dense layers with constant weights: one matrix product for all coefficients of all units.

use super::{Degrees, Place, Space, Taylor};
use crate::linalg::{MatMut, MatRef, gemm};
use crate::scalar::{Real, Scalar};

impl<S: Scalar> Space<S> {
    /// `W x + b` by the values of the constants `weights`, `(outputs, x.len())`, and `bias`, `(outputs)` or empty; `degrees` are
    /// at least those of every `x`.
    pub(super) fn layer<'a>(
        &'a self,
        degrees: Degrees,
        weights: &[Taylor<'a, S>],
        bias: &[Taylor<'a, S>],
        x: &[Taylor<'a, S>],
    ) -> Vec<Taylor<'a, S>> {
        let (size, inputs, outputs) = (self.variables.size(degrees), x.len(), weights.len() / x.len());
        let values = |numbers: &[Taylor<'a, S>]| -> Vec<S> { numbers.iter().map(|number| number.value).collect() };
        let mut numbers = self.numbers.borrow_mut();
        let start = numbers.len();
        let mut rows = vec![<S as Real>::zero(); inputs * size];
        for (row, x) in rows.chunks_exact_mut(size).zip(x) {
            match x.place {
                None => row[0] = x.value,
                Some(place) => {
                    self.variables.add_scaled(<S as Real>::one(), place.of(&numbers), (row, degrees));
                }
            }
        }
        numbers.resize(start + outputs * size, <S as Real>::zero());
        let out = &mut numbers[start..];
        let weights = values(weights);
        let weights = MatRef::new(&weights, outputs, inputs);
        gemm(MatMut::new(out, outputs, size), false, <S as Real>::one(), weights, MatRef::new(&rows, inputs, size));
        for (row, b) in out.chunks_exact_mut(size).zip(bias) {
            row[0] += b.value;
        }
        let unit = |(k, row): (usize, &[S])| Taylor {
            value: row[0],
            place: Some(Place { space: self, start: start + k * size, degrees }),
        };
        out.chunks_exact(size).enumerate().map(unit).collect()
    }
}
