//! Programs of constraints: sparse rows, the smallest corrections that project a state onto them, and a test of independence.

use super::Constraints;
use crate::forward::Dual;
use crate::lagrangian::accelerations::RecordMotion;
use crate::lagrangian::elimination::{Balance, Lists, eliminate};
use crate::lagrangian::linearization::{Rate, SparseRows, add};
use crate::lagrangian::thresholds::PRODUCTS_PER_ELEMENT;
use crate::platform::OnceLock;
use crate::scalar::{Real, Scalar};
use crate::tape::{Program, ROWS, Replay, Tracer};
use alloc::collections::BTreeMap;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Returns the largest number of products in an elimination of `rows` rows.
pub(super) fn most_products(rows: usize) -> usize {
    PRODUCTS_PER_ELEMENT * rows * rows
}

/// Constraints as recorded functions.
#[derive(Debug)]
pub(super) struct RecordedRows<S> {
    rate: Rate<S>,
    /// Programs of the values and rates at `q`, `v`.
    along: Program<S>,
}

/// Constraint rows at a traced state.
struct Rows<R> {
    matrix: Lists<R>,
    values: Vec<R>,
    rates: Vec<R>,
}

impl<S: Scalar> RecordedRows<S> {
    /// Records the constraint rows with these indices; returns `None` if they are too large or branch on their data.
    pub fn record(
        constraints: &impl Constraints,
        (all, kept): (usize, &[usize]),
        parameters: &[S],
    ) -> Option<Arc<Self>> {
        let n = constraints.coordinates();
        // Derivatives along the motion: value and rate of a function; the value of a velocity row already is its rate.
        let along = Program::record_within(ROWS, (2 * n, 0), |x, _| {
            let zero = Tracer::zero();
            let p: Vec<_> = parameters.iter().map(|&p| Dual::lift(Tracer::constant(p))).collect();
            let q: Vec<_> = (0..n).map(|i| Dual { value: x[i], tangent: x[n + i] }).collect();
            let v: Vec<_> = (0..n).map(|i| Dual::lift(x[n + i])).collect();
            let mut values = vec![Dual::lift(zero); all];
            constraints.values(&p, &q, &v, &mut values);
            let of = |row: usize| match constraints.is_holonomic(row) {
                true => [values[row].value, values[row].tangent],
                false => [zero, values[row].value],
            };
            let found: Vec<_> = kept.iter().map(|&row| of(row)).collect();
            Some((0..2).flat_map(|k| found.iter().map(move |of| of[k])).collect())
        });
        let rate = Rate::of_constraints(constraints, (all, kept), parameters, false);
        Some(Arc::new(Self { rate: rate.ok()?, along: along.ok()? }))
    }

    fn at<'t>(&self, state: &[Tracer<'t, S>]) -> Option<Rows<Tracer<'t, S>>> {
        let (matrix, _) = self.rate.rows(state)?;
        let mut values = self.along.interpret(state, &[]).ok()?;
        let rates = values.split_off(self.rate.size.1);
        Some(Rows { matrix, values, rates })
    }
}

/// The equations of motion of a model with constraints.
#[derive(Debug)]
pub(super) struct Under<S> {
    /// The equations of the model without constraints.
    pub beneath: Arc<dyn RecordMotion<S>>,
    pub rows: Arc<RecordedRows<S>>,
}

impl<S: Scalar> RecordMotion<S> for Under<S> {
    fn record<'t>(&self, state: &[Tracer<'t, S>], parameters: &[Tracer<'t, S>]) -> Option<Balance<Tracer<'t, S>>> {
        let mut balance = self.beneath.record(state, parameters)?;
        let n = balance.coordinates;
        // Only one of the nested models may contribute constraints.
        if balance.lower.len() > n {
            return None;
        }
        let (matrix, drift) = self.rows.rate.rows(state)?;
        for (c, mut row) in matrix.into_iter().enumerate() {
            row.push((n + c, Tracer::zero()));
            balance.lower.push(row);
        }
        balance.right.extend(drift.into_iter().map(|drift| -drift));
        Some(balance)
    }

    fn record_slopes<'t>(
        &self,
        x: &[Tracer<'t, S>],
        parameters: &[Tracer<'t, S>],
    ) -> Option<SparseRows<Tracer<'t, S>>> {
        let (n, _) = self.rows.rate.size;
        let mut rows = self.rows.rate.slopes(x, &[], &[])?;
        for (row, beneath) in rows.iter_mut().zip(self.beneath.record_slopes(&x[..3 * n], parameters)?) {
            beneath.into_iter().for_each(|(column, slope)| add(row, column, slope));
        }
        Some(rows)
    }

    fn linearized_up_to(&self) -> usize {
        self.beneath.linearized_up_to()
    }
}

/// Computes the lower triangle of `A A^T`; returns `None` if it needs too many products.
fn gram<R: Real>(matrix: &[Vec<(usize, R)>], most: usize) -> Option<Lists<R>> {
    let mut columns: BTreeMap<usize, Vec<(usize, R)>> = BTreeMap::new();
    for (c, row) in matrix.iter().enumerate() {
        row.iter().for_each(|&(i, a)| columns.entry(i).or_default().push((c, a)));
    }
    let products: usize = columns.values().map(|column| column.len() * (column.len() + 1) / 2).sum();
    if products > most {
        return None;
    }
    let mut lower: Vec<BTreeMap<usize, R>> = vec![BTreeMap::new(); matrix.len()];
    for column in columns.into_values() {
        for (at, &(c, a)) in column.iter().enumerate() {
            for &(d, b) in &column[..=at] {
                let term = if c == d { a.sqr() } else { a * b };
                lower[c].entry(d).and_modify(|sum| *sum += term).or_insert(term);
            }
        }
    }
    Some(lower.into_iter().map(|row| row.into_iter().collect()).collect())
}

/// Programs that are recorded on first use.
#[derive(Debug)]
pub struct RowPrograms<S> {
    rows: Arc<RecordedRows<S>>,
    holonomic: Vec<bool>,
    corrections: [OnceLock<Option<Arc<Program<S>>>>; 2],
    elements: OnceLock<Option<Elements<S>>>,
    shifted: OnceLock<Option<Arc<Program<S>>>>,
}

/// A program of the nonzero elements of `A`, row by row, and the offset of each row, with the total number last.
type Elements<S> = (Arc<Program<S>>, Vec<usize>);

impl<S: Scalar> RowPrograms<S> {
    pub(super) fn new(rows: Arc<RecordedRows<S>>, holonomic: Vec<bool>) -> Self {
        let corrections = [const { OnceLock::new() }; 2];
        Self { rows, holonomic, corrections, elements: OnceLock::new(), shifted: OnceLock::new() }
    }

    pub(super) fn rows(&self) -> &Arc<RecordedRows<S>> {
        &self.rows
    }

    /// Returns the program of the shortest `x` with `A x = d`, where `d` are the defects of the holonomic rows, or the rates of all rows.
    /// Its outputs are `x`, pairs of a diagonal element of `A A^T` and its pivot, `d`, and this diagonal.
    pub(super) fn correction(&self, of_rates: bool) -> Option<Replay<S>> {
        let (n, _) = self.rows.rate.size;
        let record = || {
            let program = Program::record_within(ROWS, (2 * n, 0), |x, _| {
                let rows = self.rows.at(x)?;
                let found = rows.matrix.into_iter().zip(if of_rates { rows.rates } else { rows.values });
                let acts = found.zip(&self.holonomic).filter(|(_, holonomic)| of_rates || **holonomic);
                let (matrix, right): (Vec<_>, Vec<_>) = acts.map(|(found, _)| found).unzip();
                let (m, most) = (matrix.len(), most_products(matrix.len()));
                let lower = gram(&matrix, most)?;
                let diagonal = lower.iter().map(|row| row.last().map(|(_, a)| *a)).collect::<Option<Vec<_>>>()?;
                let (weights, guards) = eliminate(Balance { coordinates: m, lower, right: right.clone() }, most)?;
                let mut outputs = vec![Tracer::zero(); n];
                for (row, weight) in matrix.into_iter().zip(weights) {
                    row.into_iter().for_each(|(i, a)| outputs[i] += weight * a);
                }
                outputs.extend(guards.into_iter().flatten());
                outputs.extend(right);
                outputs.extend(diagonal);
                Some(outputs)
            });
            program.ok().map(Arc::new)
        };
        self.corrections[usize::from(of_rates)].get_or_init(record).clone().map(Replay::new)
    }

    /// Returns the program of the nonzero elements of the rows, and the offset of each row among them.
    pub(crate) fn elements(&self) -> Option<(Replay<S>, &[usize])> {
        let (n, _) = self.rows.rate.size;
        let record = || {
            let mut starts = vec![0];
            let program = Program::record_within(ROWS, (2 * n, 0), |x, _| {
                let mut outputs = Vec::new();
                for row in self.rows.rate.rows(x)?.0 {
                    outputs.extend(row.into_iter().map(|(_, a)| a));
                    starts.push(outputs.len());
                }
                Some(outputs)
            });
            Some((Arc::new(program.ok()?), starts))
        };
        let (program, starts) = self.elements.get_or_init(record).as_ref()?;
        Some((Replay::new(Arc::clone(program)), starts))
    }

    /// Returns the program of the pivots of `U A A^T U - x`, whose inputs after the state are a diagonal matrix `U` and a number `x`. All
    /// pivots are positive if no eigenvalue of `U A A^T U` is below `x`.
    pub(crate) fn shifted(&self) -> Option<Replay<S>> {
        let (n, m) = self.rows.rate.size;
        let record = || {
            let program = Program::record_within(ROWS, (2 * n + m + 1, 0), |x, _| {
                let (mut matrix, most) = (self.rows.rate.rows(&x[..2 * n])?.0, most_products(m));
                for (row, &unit) in matrix.iter_mut().zip(&x[2 * n..]) {
                    row.iter_mut().for_each(|(_, a)| *a *= unit);
                }
                let mut lower = gram(&matrix, most)?;
                for row in &mut lower {
                    row.last_mut()?.1 -= x[2 * n + m];
                }
                let right = vec![Tracer::zero(); m];
                let (_, guards) = eliminate(Balance { coordinates: m, lower, right }, most)?;
                Some(guards.into_iter().map(|[_, pivot]| pivot).collect())
            });
            program.ok().map(Arc::new)
        };
        self.shifted.get_or_init(record).clone().map(Replay::new)
    }
}
