//! The rate along the motion: its derivatives give all equations of motion.
//!
//! For a Lagrangian the rate is `w.dL/dq + a.dL/dv`, with `w = v`. Including a dissipation function `D`, the rows `A` of constraints, their
//! multipliers `lambda` and weights `y` of their second derivatives, it is
//!
//! ```text
//! R(q, v, w, a, lambda, y) = w.dL/dq + a.dL/dv + D + lambda.(A w) - y.(A a + gamma)
//! ```
//!
//! which contains the equations
//!
//! ```text
//! g - c - M a - dD/dv + A^T lambda = dR/dw - dR/dv,    -(A a + gamma) = dR/dy.
//! ```
//!
//! All their derivatives are therefore second derivatives of `R`. The Lagrangian, the friction and the constraints each have a rate, and
//! the rates add up.

use crate::forward::{Dual, HyperDual};
use crate::lagrangian::Constraints;
use crate::lagrangian::elimination::Lists;
use crate::scalar::{Real, Scalar};
use crate::tape::{Directions, Program, ROWS, TANGENTS, TapeError, Tracer};
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// The rate of a part as a program of `q`, `v`, `w`, `a`, `lambda`, `y` and parameters.
#[derive(Debug)]
pub struct Rate<S> {
    program: Program<S>,
    /// Numbers of coordinates and of constraints in this part.
    pub size: (usize, usize),
    /// `true` if `d2R/dw dq` is known to be symmetric.
    symmetric: bool,
}

/// The kind of an input of a rate.
enum Input {
    Position(usize),
    Velocity(usize),
    /// A component of `w`.
    Speed(usize),
    Acceleration,
    Multiplier,
    /// A component of `y`.
    Weight(usize),
    Parameter(usize),
}

/// Sparse rows by column; missing elements are zero.
pub(crate) type SparseRows<R> = Vec<BTreeMap<usize, R>>;

impl<S: Scalar> Rate<S> {
    /// Records the rate of the Lagrangian with this value.
    ///
    /// # Errors
    /// [`TapeError::Full`], as for the functions below.
    pub fn of_lagrangian(value: &Program<S>) -> Result<Self, TapeError> {
        let (n, k) = (value.inputs() / 2, value.parameters());
        let program = Program::record_within(ROWS, (4 * n + k, 0), |x, _| {
            // The coordinates move along `w`, and the velocities along `a`.
            let moving = x[..2 * n].iter().zip(&x[2 * n..]).map(|(&value, &tangent)| Dual { value, tangent });
            let parameters: Vec<_> = x[4 * n..].iter().map(|&p| Dual::lift(p)).collect();
            Some(vec![value.interpret(&moving.collect::<Vec<_>>(), &parameters).ok()?[0].tangent])
        });
        Ok(Self { program: program?, size: (n, 0), symmetric: true })
    }

    /// Records the rate of the dissipation function with this value.
    pub fn of_dissipation(value: &Program<S>) -> Result<Self, TapeError> {
        let (n, k) = (value.inputs() / 2, value.parameters());
        let program =
            Program::record_within(ROWS, (4 * n + k, 0), |x, _| value.interpret(&x[..2 * n], &x[4 * n..]).ok());
        Ok(Self { program: program?, size: (n, 0), symmetric: true })
    }

    /// Records the rate of the constraint rows with these indices; `shared` if they take the parameters of the Lagrangian.
    pub fn of_constraints(
        constraints: &impl Constraints,
        (all, kept): (usize, &[usize]),
        parameters: &[S],
        shared: bool,
    ) -> Result<Self, TapeError> {
        let (n, m) = (constraints.coordinates(), kept.len());
        let (before, k) = (4 * n + 2 * m, if shared { parameters.len() } else { 0 });
        let program = Program::record_within(ROWS, (before + k, 0), |x, _| {
            let own: Vec<_> = match shared {
                true => x[before..].to_vec(),
                false => parameters.iter().map(|&p| Tracer::constant(p)).collect(),
            };
            let (zero, at) = (Tracer::zero(), |field: usize, i: usize| x[field * n + i]);
            let p: Vec<_> = own.iter().map(|&p| Dual::lift(p)).collect();
            let mut sum = zero;
            // The row of a function is its gradient by the coordinates; that of a constraint linear in the velocities is its gradient by
            // the velocities.
            for holonomic in [true, false] {
                let along = |field: usize, moves: bool| -> Vec<_> {
                    let tangent = |i: usize| if moves { at(2, i) } else { zero };
                    (0..n).map(|i| Dual { value: at(field, i), tangent: tangent(i) }).collect()
                };
                let (q, v) = (along(0, holonomic), along(1, !holonomic));
                let mut values = vec![Dual::lift(zero); all];
                constraints.values(&p, &q, &v, &mut values);
                for (c, &row) in kept.iter().enumerate().filter(|(_, row)| constraints.is_holonomic(**row) == holonomic)
                {
                    sum += x[4 * n + c] * values[row].tangent;
                }
            }
            let p: Vec<_> = own.iter().map(|&p| HyperDual::new(p, zero, zero, zero)).collect();
            let q: Vec<_> = (0..n).map(|i| HyperDual::new(at(0, i), at(1, i), at(1, i), at(3, i))).collect();
            let v: Vec<_> = (0..n).map(|i| HyperDual::new(at(1, i), at(3, i), zero, zero)).collect();
            let mut values = vec![HyperDual::new(zero, zero, zero, zero); all];
            constraints.values(&p, &q, &v, &mut values);
            for (c, &row) in kept.iter().enumerate() {
                let second = if constraints.is_holonomic(row) { values[row].st } else { values[row].s };
                sum -= x[4 * n + m + c] * second;
            }
            Some(vec![sum])
        });
        let symmetric = kept.iter().all(|&row| constraints.is_holonomic(row));
        Ok(Self { program: program?, size: (n, m), symmetric })
    }

    /// Returns the kind of this input.
    fn input(&self, k: usize) -> Input {
        let (n, m) = self.size;
        match k.checked_sub(4 * n) {
            None if k < n => Input::Position(k),
            None if k < 2 * n => Input::Velocity(k - n),
            None if k < 3 * n => Input::Speed(k - 2 * n),
            None => Input::Acceleration,
            Some(k) if k < m => Input::Multiplier,
            Some(k) if k < 2 * m => Input::Weight(k - m),
            Some(k) => Input::Parameter(k - 2 * m),
        }
    }

    /// Returns the number of parameters.
    pub fn parameters(&self) -> usize {
        let (n, m) = self.size;
        self.program.inputs() - 4 * n - 2 * m
    }

    /// Returns the inputs for actual motion: `x` contains `q`, `v`, `a`, `lambda`, `w` equals `v`, and `y` is zero.
    fn at_motion<R: Real>(&self, x: &[R], parameters: &[R]) -> Vec<R> {
        let (n, m) = self.size;
        [&x[..2 * n], &x[n..3 * n + m], &vec![R::zero(); m], parameters].concat()
    }

    /// Returns the `n + m` equations `f` at `x`, which contains `q`, `v`, `a`, `lambda`.
    pub fn equations<R: Real>(&self, x: &[R], parameters: &[R]) -> Option<Vec<R>> {
        let (n, m) = self.size;
        let by = self.program.derivatives(&self.at_motion(x, parameters), &[], None)?.first;
        let of_motion = (0..n).map(|i| by[2 * n + i] - by[n + i]);
        Some(of_motion.chain(by[4 * n + m..4 * n + 2 * m].iter().copied()).collect())
    }

    /// Returns the nonzero elements of the constraint rows `A`, by increasing column, and their drift `gamma`, at a state `q`, `v`; for
    /// constraints whose parameters are constants.
    pub fn rows<R: Real>(&self, state: &[R]) -> Option<(Lists<R>, Vec<R>)> {
        let (n, m) = self.size;
        // The derivatives by `w` and `lambda` are the elements of `A`, whatever the values of `w` and `lambda`.
        let inputs = [state, &vec![R::zero(); 2 * n + 2 * m]].concat();
        let seed = |k: usize| match self.input(k) {
            Input::Speed(i) => vec![(i as u32, R::one())],
            _ => Vec::new(),
        };
        let directions = Directions {
            seeds: (0..inputs.len()).map(seed).collect(),
            rows: (0..inputs.len()).map(|k| matches!(self.input(k), Input::Multiplier).then_some(0)).collect(),
            shared: 0,
            budget: TANGENTS,
        };
        let found = self.program.derivatives(&inputs, &[], Some(&directions))?;
        let columns = |row: Vec<(u32, R)>| row.into_iter().map(|(i, a)| (i as usize, a)).collect();
        let matrix = found.second.into_iter().skip(4 * n).take(m).map(columns).collect();
        Some((matrix, found.first[4 * n + m..].iter().map(|&by| -by).collect()))
    }

    /// Returns the nonzero elements of `df/d(q, v)`, `n + m` rows and `2 n` columns, followed by the derivatives by chosen parameters.
    pub fn slopes<R: Real>(&self, x: &[R], parameters: &[R], chosen: &[usize]) -> Option<SparseRows<R>> {
        let ((n, m), count) = (self.size, self.program.inputs());
        // The first directions move the velocities, the next ones the coordinates, and the others the parameters.
        let direction = |k: usize| match self.input(k) {
            Input::Velocity(i) => Some(i),
            Input::Position(i) => Some(n + i),
            Input::Parameter(k) => chosen.iter().position(|&of| of == k).map(|place| 2 * n + place),
            _ => None,
        };
        // The last direction for an input: symmetric blocks need only their lower triangle.
        let last = |k: usize| match self.input(k) {
            Input::Velocity(i) => Some(i),
            Input::Position(_) => Some(n - 1),
            Input::Speed(i) if self.symmetric => Some(n + i),
            Input::Speed(_) | Input::Weight(_) => Some(2 * n - 1),
            _ => None,
        };
        let directions = Directions {
            seeds: (0..count).map(|k| direction(k).map(|at| (at as u32, R::one())).into_iter().collect()).collect(),
            rows: (0..count).map(|k| last(k).map(|last| last as u32)).collect(),
            shared: 2 * n as u32,
            budget: TANGENTS,
        };
        let second = self.program.derivatives(&self.at_motion(x, parameters), &[], Some(&directions))?.second;
        let mut rows: SparseRows<R> = vec![BTreeMap::new(); n + m];
        let mut put = |i: usize, column: usize, x: R| add(&mut rows[i], column, x);
        for (k, elements) in second.into_iter().enumerate() {
            for (direction, x) in elements {
                let (direction, j) = (direction as usize, direction as usize % n);
                let by_velocity = direction < n;
                // The equations are dR/dw - dR/dv and dR/dy, where w equals v.
                match self.input(k) {
                    Input::Velocity(i) if direction >= 2 * n => put(i, direction, -x),
                    Input::Speed(i) if direction >= 2 * n => put(i, direction, x),
                    Input::Weight(c) if direction >= 2 * n => put(n + c, direction, x),
                    Input::Weight(c) => put(n + c, if by_velocity { n + j } else { j }, x),
                    Input::Position(i) if by_velocity => put(j, i, -x),
                    Input::Velocity(i) => {
                        put(i, n + j, -x);
                        if j < i {
                            put(j, n + i, -x);
                        }
                    }
                    Input::Speed(i) if by_velocity => {
                        put(i, n + j, x);
                        put(j, n + i, -x);
                    }
                    Input::Speed(i) => {
                        put(i, j, x);
                        if self.symmetric && j < i {
                            put(j, i, x);
                        }
                    }
                    _ => {}
                }
            }
        }
        rows.iter_mut().for_each(|row| row.retain(|_, x| !x.is_exact_zero()));
        Some(rows)
    }
}

/// Adds to an element of a row.
pub(crate) fn add<R: Real>(row: &mut BTreeMap<usize, R>, column: usize, x: R) {
    row.entry(column).and_modify(|sum| *sum += x).or_insert(x);
}
