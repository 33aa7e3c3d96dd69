//! Functions of several numbers that are recorded once and evaluated at many points.

use super::program::{Directions, Program, Replay, Tracer};
use super::{TapeError, check_length};
use crate::scalar::{Real, Scalar};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Rows of a program at most: about 150 bytes each while it is recorded, some tens afterwards.
pub const ROWS: u32 = 1 << 20;
/// Numbers of tangents at most while second derivatives are recorded, 32 bytes each.
pub const TANGENTS: usize = 3_000_000;

/// A function `f: R^n -> R` that was recorded once: values, gradients, Hessians and their products with vectors, for single points and
/// batches.
///
/// The derivatives are programs too, recorded on first use from the rules of each operation. They contain no zeros, and constants take no
/// time: if each term of a function joins few numbers, its Hessian costs as much as it has entries. Points are `(batch, n)`. After the
/// first call of a kind nothing is allocated. A clone shares the recording and has buffers of its own, one for each thread.
///
/// ```
/// use lnn::scalar::Real;
/// use lnn::tape::{Function, TapeError};
///
/// // Rosenbrock's function of three numbers.
/// let mut f = Function::<f64>::record(3, |x| {
///     x.windows(2).fold(0.0 * x[0], |f, x| f + (1.0 - x[0]).sqr() + 100.0 * (x[1] - x[0].sqr()).sqr())
/// })?;
/// let (mut value, mut gradient, mut hessian) = ([0.0], [0.0; 3], [0.0; 9]);
/// f.hessians(&[1.0, 1.0, 2.0], &mut value, &mut gradient, &mut hessian)?;
/// assert_eq!((value, gradient), ([100.0], [0.0, -400.0, 200.0]));
/// assert_eq!(hessian, [802.0, -400.0, 0.0, -400.0, 602.0, -400.0, 0.0, -400.0, 200.0]);
/// // The same by its pattern: the entries of the lower triangle that are not zero.
/// assert_eq!(f.pattern()?, [(0, 0), (1, 0), (1, 1), (2, 1), (2, 2)]);
/// # Ok::<(), TapeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Function<S: Scalar> {
    value: Arc<Program<S>>,
    parameters: Vec<S>,
    values: Option<Replay<S>>,
    gradients: Option<Replay<S>>,
    by_parameters: Option<Replay<S>>,
    entries: Option<Entries<S>>,
    /// Entries of the Hessians that are made dense.
    buffer: Vec<S>,
    products: Option<Replay<S>>,
}

/// The entries of the lower triangle of Hessians that are not zero, and their places.
#[derive(Clone, Debug)]
struct Entries<S: Scalar> {
    replay: Replay<S>,
    places: Arc<[(usize, usize)]>,
}

impl<S: Scalar> Function<S> {
    /// Records `f` of `n` numbers.
    ///
    /// # Errors
    /// [`TapeError::DataDependentBranch`] if `f` reads a value, [`TapeError::MixedTapes`] if it uses numbers of another recording,
    /// [`TapeError::Full`] if it has too many operations.
    pub fn record<F>(n: usize, f: F) -> Result<Self, TapeError>
    where
        F: for<'t> FnOnce(&[Tracer<'t, S>]) -> Tracer<'t, S>,
    {
        Self::with_parameters(n, Vec::new(), |x, _| f(x))
    }

    /// Records `f(x, parameters)` of `n` numbers and parameters, which are the same for all points of a batch and have these values.
    ///
    /// # Errors
    /// The errors of [`Function::record`].
    pub fn with_parameters<F>(n: usize, parameters: Vec<S>, f: F) -> Result<Self, TapeError>
    where
        F: for<'t> FnOnce(&[Tracer<'t, S>], &[Tracer<'t, S>]) -> Tracer<'t, S>,
    {
        let value = Program::record_within(ROWS, (n, parameters.len()), |x, p| Some(vec![f(x, p)]))?;
        Ok(Self {
            value: Arc::new(value),
            parameters,
            values: None,
            gradients: None,
            by_parameters: None,
            buffer: Vec::new(),
            entries: None,
            products: None,
        })
    }

    /// Number of variables `n`.
    pub fn variables(&self) -> usize {
        self.value.inputs()
    }

    /// The values of the parameters.
    pub fn parameters(&self) -> &[S] {
        &self.parameters
    }

    /// Sets new values of the parameters.
    ///
    /// # Errors
    /// [`TapeError::Shape`].
    pub fn set_parameters(&mut self, parameters: &[S]) -> Result<(), TapeError> {
        check_length("parameters", self.parameters.len(), parameters.len())?;
        self.parameters.copy_from_slice(parameters);
        Ok(())
    }

    /// `f(x)` of points `(batch, n)`, `(batch)`.
    ///
    /// # Errors
    /// [`TapeError::Shape`].
    pub fn values(&mut self, x: &[S], values: &mut [S]) -> Result<(), TapeError> {
        let replay = self.values.get_or_insert_with(|| Replay::new(Arc::clone(&self.value)));
        replay.evaluate(values.len(), &[x], &self.parameters, &mut [values])
    }

    /// Values, `(batch)`, and gradients `df/dx`, `(batch, n)`.
    ///
    /// # Errors
    /// [`TapeError::Shape`], [`TapeError::Full`].
    pub fn gradients(&mut self, x: &[S], values: &mut [S], gradients: &mut [S]) -> Result<(), TapeError> {
        let first = || {
            recorded(self.value.inputs(), &self.value, |x, p| {
                let found = self.value.derivatives(x, p, None)?;
                Some([vec![found.value], found.first].concat())
            })
        };
        let replay = filled(&mut self.gradients, first)?;
        replay.evaluate(values.len(), &[x], &self.parameters, &mut [values, gradients])
    }

    /// Derivatives by the parameters, `(batch, parameters)`.
    ///
    /// # Errors
    /// [`TapeError::Shape`], [`TapeError::Full`].
    pub fn parameter_gradients(&mut self, x: &[S], gradients: &mut [S]) -> Result<(), TapeError> {
        let (n, count) = (self.value.inputs(), self.parameters.len());
        check_length("derivatives by parameters", x.len() / n.max(1) * count, gradients.len())?;
        let by = || {
            // The parameters as variables behind the others.
            let all =
                Program::<S>::record_within(ROWS, (n + count, 0), |x, _| self.value.interpret(&x[..n], &x[n..]).ok())?;
            Program::record_within(ROWS, (n, count), |x, p| {
                let found = all.derivatives(&[x, p].concat(), &[], None)?;
                Some(found.first[n..].to_vec())
            })
        };
        if count == 0 {
            return Ok(());
        }
        let replay = filled(&mut self.by_parameters, by)?;
        replay.evaluate(gradients.len() / count, &[x], &self.parameters, &mut [gradients])
    }

    /// Values, `(batch)`, gradients, `(batch, n)`, and Hessians `d2f/dx dx`, `(batch, n, n)`, symmetric to the bit.
    ///
    /// # Errors
    /// [`TapeError::Shape`], [`TapeError::Full`].
    pub fn hessians(
        &mut self,
        x: &[S],
        values: &mut [S],
        gradients: &mut [S],
        hessians: &mut [S],
    ) -> Result<(), TapeError> {
        let (n, batch) = (self.value.inputs(), values.len());
        check_length("Hessians", batch * n * n, hessians.len())?;
        let width = self.pattern()?.len();
        let mut entries = core::mem::take(&mut self.buffer);
        entries.resize(batch * width, S::nan());
        let outcome = self.sparse_hessians(x, values, gradients, &mut entries);
        hessians.fill(<S as Real>::zero());
        let places = self.pattern()?;
        for (k, hessian) in hessians.chunks_exact_mut((n * n).max(1)).enumerate() {
            for (&(i, j), &entry) in places.iter().zip(&entries[k * width..]) {
                (hessian[i * n + j], hessian[j * n + i]) = (entry, entry);
            }
        }
        self.buffer = entries;
        outcome
    }

    /// Row and column of every entry of the lower triangle of the Hessian that is not identically zero, row by row.
    ///
    /// # Errors
    /// [`TapeError::Full`].
    pub fn pattern(&mut self) -> Result<&[(usize, usize)], TapeError> {
        Ok(&self.by_pattern()?.places)
    }

    /// Values, `(batch)`, gradients, `(batch, n)`, and the entries of the Hessians in the order of the [pattern](Self::pattern), `(batch,
    /// entries)`: bit for bit those of [`Function::hessians`].
    ///
    /// # Errors
    /// [`TapeError::Shape`], [`TapeError::Full`].
    pub fn sparse_hessians(
        &mut self,
        x: &[S],
        values: &mut [S],
        gradients: &mut [S],
        entries: &mut [S],
    ) -> Result<(), TapeError> {
        self.by_pattern()?;
        let Some(Entries { replay, .. }) = &mut self.entries else { return Ok(()) };
        replay.evaluate(values.len(), &[x], &self.parameters, &mut [values, gradients, entries])
    }

    fn by_pattern(&mut self) -> Result<&Entries<S>, TapeError> {
        if self.entries.is_none() {
            let n = self.value.inputs();
            let mut places = Vec::new();
            let program = recorded(n, &self.value, |x, p| {
                let found = self.value.derivatives(x, p, Some(&every_direction(n)))?;
                let mut outputs = [vec![found.value], found.first].concat();
                for (i, row) in found.second.iter().enumerate() {
                    places.extend(row.iter().map(|(j, _)| (i, *j as usize)));
                    outputs.extend(row.iter().map(|(_, entry)| *entry));
                }
                Some(outputs)
            })?;
            self.entries = Some(Entries { replay: Replay::new(Arc::new(program)), places: places.into() });
        }
        self.entries.as_ref().ok_or(TapeError::Full { limit: ROWS })
    }

    /// Products of the Hessians with vectors `u`, both `(batch, n)`: two times the operations of a gradient, whatever `n` is.
    ///
    /// # Errors
    /// [`TapeError::Shape`], [`TapeError::Full`].
    pub fn hessian_vectors(&mut self, x: &[S], u: &[S], products: &mut [S]) -> Result<(), TapeError> {
        let n = self.value.inputs();
        check_length("vectors", x.len(), u.len())?;
        let along = || {
            recorded(2 * n, &self.value, |x, p| {
                let (x, u) = x.split_at(n);
                let directions = Directions {
                    seeds: u.iter().map(|&u| vec![(0, u)]).collect(),
                    rows: vec![Some(0); n],
                    shared: 0,
                    budget: TANGENTS,
                };
                let found = self.value.derivatives(x, p, Some(&directions))?;
                Some(
                    found
                        .second
                        .iter()
                        .map(|row| row.first().map_or(Tracer::zero(), |(_, product)| *product))
                        .collect(),
                )
            })
        };
        let replay = filled(&mut self.products, along)?;
        replay.evaluate(products.len() / n.max(1), &[x, u], &self.parameters, &mut [products])
    }
}

/// Seeds every variable with a separate direction.
fn every_direction<R: Real>(n: usize) -> Directions<R> {
    Directions {
        seeds: (0..n as u32).map(|i| vec![(i, R::one())]).collect(),
        rows: (0..n as u32).map(Some).collect(),
        shared: n as u32,
        budget: TANGENTS,
    }
}

/// A program of derivatives of a function with this many inputs.
fn recorded<S: Scalar, F>(inputs: usize, value: &Program<S>, f: F) -> Result<Program<S>, TapeError>
where
    F: for<'t> FnOnce(&[Tracer<'t, S>], &[Tracer<'t, S>]) -> Option<Vec<Tracer<'t, S>>>,
{
    Program::record_within(ROWS, (inputs, value.parameters()), f)
}

/// The content of a place, recorded now if it is empty.
fn filled<S: Scalar>(
    place: &mut Option<Replay<S>>,
    record: impl FnOnce() -> Result<Program<S>, TapeError>,
) -> Result<&mut Replay<S>, TapeError> {
    let replay = match place.take() {
        Some(replay) => replay,
        None => Replay::new(Arc::new(record()?)),
    };
    Ok(place.insert(replay))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dd;
    use crate::tape::{ScalarFunction, hessian};

    /// Every kind of operation, terms that join few variables.
    struct Assorted;

    impl ScalarFunction for Assorted {
        fn eval<R: Real>(&self, x: &[R]) -> R {
            let pairs = x.windows(2).fold(R::zero(), |sum, x| sum + (x[0] * x[1]).sin() / (R::two() + x[0].cos()));
            let ends = (x[0].sqr() + R::one()).sqrt().powf(x[1]) + x[2].atan2(x[0] + R::of(3.0)).exp();
            pairs + ends + x[3].select(x[3].sqr() * x[0], x[3].tanh() * x[1]) + x[4].max(x[2]).abs() - x[4].recip()
        }
    }

    fn points(batch: usize) -> Vec<f64> {
        (0..6 * batch).map(|k| 1.5 * (0.7 * k as f64 + 0.2).sin()).collect()
    }

    #[test]
    fn derivatives_are_those_of_the_eager_tape_in_wider_numbers() {
        let mut f = Function::<f64>::record(6, |x| Assorted.eval(x)).unwrap();
        let (x, batch) = (points(75), 75);
        let (mut values, mut gradients) = (vec![0.0; batch], vec![0.0; 6 * batch]);
        let mut hessians = vec![0.0; 36 * batch];
        f.hessians(&x, &mut values, &mut gradients, &mut hessians).unwrap();
        for (row, x) in x.chunks_exact(6).enumerate() {
            let wide: Vec<Dd> = x.iter().map(|&x| Dd::of_f64(x)).collect();
            let (value, gradient, matrix) = hessian(&Assorted, &wide).unwrap();
            let close =
                |a: f64, b: Dd| assert!((a - b.to_f64()).abs() <= 1e-14 * (1.0 + b.to_f64().abs()), "{a} {b:?}");
            close(values[row], value);
            (0..6).for_each(|i| close(gradients[row * 6 + i], gradient[i]));
            (0..36).for_each(|k| close(hessians[row * 36 + k], matrix[k]));
        }
    }

    #[test]
    fn dense_and_sparse_hessians_and_products_agree() {
        let mut f = Function::<f64>::record(6, |x| Assorted.eval(x)).unwrap();
        let pattern = f.pattern().unwrap().to_vec();
        assert!(pattern.len() < 21 && pattern.is_sorted() && pattern.iter().all(|(i, j)| j <= i));
        for batch in [1, 5, 75] {
            let x = points(batch);
            let (mut values, mut gradients) = (vec![0.0; batch], vec![0.0; 6 * batch]);
            let (mut dense, mut entries) = (vec![0.0; 36 * batch], vec![0.0; pattern.len() * batch]);
            f.hessians(&x, &mut values, &mut gradients, &mut dense).unwrap();
            let mut again = (values.clone(), gradients.clone());
            f.sparse_hessians(&x, &mut again.0, &mut again.1, &mut entries).unwrap();
            assert_eq!(again, (values.clone(), gradients.clone()));
            f.gradients(&x, &mut again.0, &mut again.1).unwrap();
            assert_eq!(again.0, values);
            f.values(&x, &mut again.0).unwrap();
            assert_eq!(again.0, values);
            let (u, mut products) = (points(batch + 1)[6..].to_vec(), vec![0.0; 6 * batch]);
            f.hessian_vectors(&x, &u, &mut products).unwrap();
            for row in 0..batch {
                let dense = &dense[36 * row..][..36];
                let mut expanded = [0.0; 36];
                for (&(i, j), &entry) in pattern.iter().zip(&entries[pattern.len() * row..]) {
                    (expanded[i * 6 + j], expanded[j * 6 + i]) = (entry, entry);
                }
                assert_eq!(expanded, dense);
                for i in 0..6 {
                    let product: f64 = (0..6).map(|j| dense[i * 6 + j] * u[row * 6 + j]).sum();
                    assert!((product - products[row * 6 + i]).abs() < 1e-12 * (1.0 + product.abs()));
                }
            }
        }
    }

    #[test]
    fn parameters_have_gradients_and_other_values() {
        let mut f =
            Function::with_parameters(2, vec![2.0, 3.0], |x, p| p[0] * x[0].sqr() + (p[1] * x[1]).sin()).unwrap();
        let (mut value, mut gradient) = ([0.0; 2], [0.0; 4]);
        let x = [1.0, 0.0, 2.0, 0.5];
        f.parameter_gradients(&x, &mut gradient).unwrap();
        assert_eq!(gradient, [1.0, 0.0, 4.0, 0.5 * 1.5_f64.cos()]);
        f.values(&x, &mut value).unwrap();
        assert_eq!(value[0], 2.0);
        f.set_parameters(&[5.0, 0.0]).unwrap();
        f.values(&x, &mut value).unwrap();
        assert_eq!((value, f.parameters()), ([5.0, 20.0], &[5.0, 0.0][..]));
        assert!(matches!(f.set_parameters(&[1.0]), Err(TapeError::Shape { .. })));
        assert!(matches!(f.values(&x[..3], &mut value), Err(TapeError::Shape { .. })));
    }

    #[test]
    fn a_branch_and_a_function_that_is_too_large_are_refused() {
        let branch = Function::<f64>::record(1, |x| if x[0].primal() > 0.0 { x[0] } else { -x[0] });
        assert!(matches!(branch, Err(TapeError::DataDependentBranch)));
        // All pairs of 2500 numbers: three million entries.
        let mut f = Function::<f64>::record(2500, |x| x.iter().fold(0.0 * x[0], |sum, &x| sum + x).exp()).unwrap();
        assert!(matches!(f.pattern(), Err(TapeError::Full { .. })));
    }
}
