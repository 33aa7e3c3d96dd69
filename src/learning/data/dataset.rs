//! States with their accelerations, from which a network learns, and weights by the size of the accelerations, so that a few large ones do
//! not outweigh the others.

use super::thresholds::{STATES_PER_DISTANCE, WIDENED_RANGE};
use crate::lagrangian::{Manifold, ManifoldRows, project, project_acceleration};
use crate::network::file::StoredPrecision;
use crate::recording::RecordedTrajectory;
use crate::rollout::{Between, SampledForce};
use crate::scalar::{Real, Scalar};
use crate::storage::container::checksum;
use thiserror::Error;

/// States and accelerations in physical units, all `(states, n)` row-major, perhaps with known external forces.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset<S> {
    coordinates: usize,
    q: Vec<S>,
    v: Vec<S>,
    a: Vec<S>,
    /// Empty if there are none.
    force: Vec<S>,
    /// Empty if all are 1.
    weight: Vec<S>,
    /// Rows `A` of constraints, `(states, m, n)`, and their drift `gamma`, `(states, m)`; empty if there are none.
    rows: Vec<S>,
    drift: Vec<S>,
    /// Sizes of the residuals of force, `(n)`; empty if residuals are those of accelerations.
    force_scale: Vec<S>,
}

/// Why numbers do not form a valid dataset.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// Lengths disagree.
    #[error("{what}: expected {expected} numbers, found {found}")]
    Shape {
        /// Name of the array.
        what: &'static str,
        /// Expected number of values.
        expected: usize,
        /// Actual number of values.
        found: usize,
    },
    /// A number is infinite or `NaN`.
    #[error("{what} {column} of state {row} is not finite")]
    NotFinite {
        /// Name of the array.
        what: &'static str,
        /// Index of the state, from 0.
        row: usize,
        /// Index of the coordinate, from 0.
        column: usize,
    },
    /// A scale is not positive.
    #[error("{what} {column} is not above 0")]
    NotPositive {
        /// Name of the array.
        what: &'static str,
        /// Index of the coordinate, from 0.
        column: usize,
    },
    /// The dataset has no states.
    #[error("a dataset needs at least one state")]
    Empty,
    /// A state could not be projected onto a constraint.
    #[error("state {row} cannot be projected onto the constraint `{constraint}`")]
    Unreachable {
        /// State, from 0.
        row: usize,
        /// Name of the constraint with the largest violation.
        constraint: String,
    },
}

/// Checks the length of an array and that it is finite.
fn check<S: Scalar>(what: &'static str, values: &[S], expected: usize, n: usize) -> Result<(), DatasetError> {
    if values.len() != expected {
        return Err(DatasetError::Shape { what, expected, found: values.len() });
    }
    match values.iter().position(|x| !x.is_finite()) {
        Some(k) => Err(DatasetError::NotFinite { what, row: k / n, column: k % n }),
        None => Ok(()),
    }
}

impl<S: Scalar> Dataset<S> {
    /// Checks shapes and finiteness.
    ///
    /// # Errors
    /// [`DatasetError`] naming the first offending array, row and column.
    pub fn new(coordinates: usize, q: Vec<S>, v: Vec<S>, a: Vec<S>) -> Result<Self, DatasetError> {
        if coordinates == 0 || q.is_empty() {
            return Err(DatasetError::Empty);
        }
        let expected = q.len() / coordinates * coordinates;
        for (what, values) in [("coordinate", &q), ("velocity", &v), ("acceleration", &a)] {
            check(what, values, expected, coordinates)?;
        }
        let none = Vec::new;
        let (force, weight, rows, drift, force_scale) = (none(), none(), none(), none(), none());
        Ok(Self { coordinates, q, v, a, force, weight, rows, drift, force_scale })
    }

    /// Adds known external generalized forces `Q`, `(states, n)` in physical units (N, N m), conjugate to the coordinates: `Q.dq` is work
    /// in J.
    ///
    /// Accelerations alone leave the unit of `L` free. Forces fix it: with `M_ij` in scaled coordinates `s_i s_j` times
    /// that in physical ones, `M a = g - c - dD/dv + Q` takes the force `s_i Q_i` in J, so that `L` comes out in J and the
    /// dissipated power in W.
    ///
    /// # Errors
    /// [`DatasetError`] naming the first offending row and column.
    pub fn with_forces(self, force: Vec<S>) -> Result<Self, DatasetError> {
        check("force", &force, self.q.len(), self.coordinates)?;
        Ok(Self { force, ..self })
    }

    /// Replaces the residuals of the accelerations by residuals of the force, `M a + c - g + dD/dv - Q`, each divided by its `scale`, `(n)`
    /// in physical units. The loss then solves no linear system, so the mass matrix may be singular.
    ///
    /// # Errors
    /// [`DatasetError`] for a scale that is not a positive number, and for states without forces or under constraints, whose forces are
    /// not known.
    pub fn with_force_residuals(self, scale: Vec<S>) -> Result<Self, DatasetError> {
        check("scale of a force", &scale, self.coordinates, self.coordinates)?;
        check("force", &self.force, self.q.len(), self.coordinates)?;
        check("constraint row", &self.rows, 0, self.coordinates)?;
        match scale.iter().position(|scale| *scale <= <S as Real>::zero()) {
            Some(column) => Err(DatasetError::NotPositive { what: "scale of a force", column }),
            None => Ok(Self { force_scale: scale, ..self }),
        }
    }

    /// Adds constraints `A a = -gamma`, with rows `A` `(states, m, n)` and `gamma` `(states, m)` in physical units: a network then learns
    /// the motion `M a = g - c + Q + A^T lambda`.
    ///
    /// # Errors
    /// [`DatasetError`] naming the first offending row.
    pub fn with_constraints(self, rows: Vec<S>, drift: Vec<S>) -> Result<Self, DatasetError> {
        let m = drift.len() / self.len();
        check("constraint drift", &drift, self.len() * m, m.max(1))?;
        check("constraint row", &rows, self.q.len() * m, self.coordinates)?;
        Ok(Self { rows, drift, ..self })
    }

    /// Adds the constraints of a manifold.
    ///
    /// # Errors
    /// As [`Dataset::with_constraints`], where a constraint is not finite.
    pub fn on(self, manifold: &dyn Manifold<S>) -> Result<Self, DatasetError> {
        let (mut rows, mut matrix, mut drift) = (ManifoldRows::default(), Vec::new(), Vec::new());
        for (q, v) in self.q.chunks_exact(self.coordinates).zip(self.v.chunks_exact(self.coordinates)) {
            manifold.rows(q, v, &mut rows);
            matrix.extend_from_slice(&rows.matrix);
            drift.extend_from_slice(&rows.drift);
        }
        self.with_constraints(matrix, drift)
    }

    /// Projects positions, then velocities and accelerations, onto a manifold and adds its constraints; also returns the root mean square
    /// distance by which the positions moved.
    ///
    /// # Errors
    /// [`DatasetError::Unreachable`] where the projection fails; those of [`Dataset::on`].
    pub fn brought_to(mut self, manifold: &dyn Manifold<S>) -> Result<(Self, f64), DatasetError> {
        let n = self.coordinates;
        let mut square = 0.0;
        let states = self.q.chunks_exact_mut(n).zip(self.v.chunks_exact_mut(n)).zip(self.a.chunks_exact_mut(n));
        for (row, ((q, v), a)) in states.enumerate() {
            let [distance, _] = project(manifold, q, v).map_err(|off| DatasetError::Unreachable {
                row,
                constraint: manifold.names().get(off.row).cloned().unwrap_or_default(),
            })?;
            project_acceleration(manifold, q, v, a);
            square += distance * distance;
        }
        let states = self.len() as f64;
        Ok((self.on(manifold)?, (square / states).sqrt()))
    }

    /// Sets the weights, `(states)`, by which the residuals of the states are multiplied in the loss.
    ///
    /// # Errors
    /// [`DatasetError`] for a wrong number of weights or one that is not finite.
    pub fn with_weights(self, weight: Vec<S>) -> Result<Self, DatasetError> {
        check("weight", &weight, self.len(), 1)?;
        Ok(Self { weight, ..self })
    }

    /// Number of coordinates `n`.
    pub fn coordinates(&self) -> usize {
        self.coordinates
    }
    /// Number of states.
    pub fn len(&self) -> usize {
        self.q.len() / self.coordinates
    }
    /// Always `false`, because a dataset has at least one state.
    pub fn is_empty(&self) -> bool {
        self.q.is_empty()
    }
    /// Coordinates `(states, n)`.
    pub fn q(&self) -> &[S] {
        &self.q
    }
    /// Velocities `(states, n)`.
    pub fn v(&self) -> &[S] {
        &self.v
    }
    /// Accelerations `(states, n)`.
    pub fn a(&self) -> &[S] {
        &self.a
    }

    /// Known external generalized forces `(states, n)`; empty if there are none.
    pub fn force(&self) -> &[S] {
        &self.force
    }

    /// Sizes of the residuals of force, `(n)` in physical units; empty if residuals are those of accelerations.
    pub(crate) fn force_scale(&self) -> &[S] {
        &self.force_scale
    }

    /// Number of constraints `m` of every state.
    pub fn constraints(&self) -> usize {
        self.drift.len() / self.len()
    }

    /// Rows `A`, `(m, n)`, and drift `gamma`, `(m)`, of the constraints of a state.
    pub fn constraint(&self, state: usize) -> (&[S], &[S]) {
        let m = self.constraints();
        let rows = state * m * self.coordinates..(state + 1) * m * self.coordinates;
        (&self.rows[rows], &self.drift[state * m..(state + 1) * m])
    }

    /// Weight of a state's residuals in the loss.
    pub fn weight(&self, state: usize) -> S {
        self.weight.get(state).copied().unwrap_or(<S as Real>::one())
    }

    /// Selects states by index, in this order.
    pub(crate) fn rows(&self, rows: &[usize]) -> Self {
        let pick = |values: &[S], width: usize| {
            let row = |&row: &usize| values.get(row * width..(row + 1) * width).unwrap_or_default();
            rows.iter().flat_map(row).copied().collect()
        };
        let (n, m) = (self.coordinates, self.constraints());
        Self {
            coordinates: n,
            q: pick(&self.q, n),
            v: pick(&self.v, n),
            a: pick(&self.a, n),
            force: pick(&self.force, n),
            weight: pick(&self.weight, 1),
            rows: pick(&self.rows, m * n),
            drift: pick(&self.drift, m),
            force_scale: self.force_scale.clone(),
        }
    }

    /// Replays a state `u` times as fast, backwards if `u` is negative: `v -> u v`, `a -> u^2 a`.
    pub(crate) fn rescale_time(&mut self, state: usize, u: S) {
        let range = state * self.coordinates..(state + 1) * self.coordinates;
        self.v[range.clone()].iter_mut().for_each(|v| *v = u * *v);
        self.a[range].iter_mut().for_each(|a| *a = u * u * *a);
        let m = self.constraints();
        self.drift[state * m..(state + 1) * m].iter_mut().for_each(|drift| *drift = u * u * *drift);
    }

    /// One scale per coordinate: the largest of `|q_i|` and `|v_i|` over all states, 1 where both vanish.
    pub fn physical_scale(&self) -> Vec<f64> {
        let n = self.coordinates;
        (0..n)
            .map(|i| {
                let largest = |x: &[S]| x.iter().skip(i).step_by(n).fold(0.0_f64, |m, x| m.max(x.to_f64().abs()));
                let scale = largest(&self.q).max(largest(&self.v));
                if scale > 0.0 { scale } else { 1.0 }
            })
            .collect()
    }

    /// Smallest and largest value of every coordinate and of every velocity, slightly widened under constraints, where a range may be as
    /// narrow as rounding.
    pub(crate) fn ranges(&self) -> [Vec<[f64; 2]>; 2] {
        let (n, more) = (self.coordinates, if self.constraints() > 0 { WIDENED_RANGE } else { 0.0 });
        [&self.q, &self.v].map(|values| {
            let range = |i: usize| {
                let all = values.iter().skip(i).step_by(n).map(|x| x.to_f64());
                let [low, high] =
                    all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
                let more = more * low.abs().max(high.abs());
                [low - more, high + more]
            };
            (0..n).map(range).collect()
        })
    }

    /// CRC-32 of coordinates, velocities, accelerations, forces, weights, constraints and scales of forces in double precision.
    pub fn checksum(&self) -> u32 {
        let all = self.q.iter().chain(&self.v).chain(&self.a).chain(&self.force).chain(&self.weight);
        checksum(all.chain(&self.rows).chain(&self.drift).chain(&self.force_scale), StoredPrecision::F64)
    }

    /// Converts the states to another precision.
    pub fn cast<T: Scalar>(&self) -> Dataset<T> {
        let cast = |x: &[S]| x.iter().map(|&x| x.cast()).collect();
        Dataset {
            coordinates: self.coordinates,
            q: cast(&self.q),
            v: cast(&self.v),
            a: cast(&self.a),
            force: cast(&self.force),
            weight: cast(&self.weight),
            rows: cast(&self.rows),
            drift: cast(&self.drift),
            force_scale: cast(&self.force_scale),
        }
    }
}

/// A recorded trajectory with the states that were estimated from it, by smoothing for instance.
#[derive(Clone, Copy, Debug)]
pub struct StateEstimate<'a> {
    /// Measured values.
    pub track: &'a RecordedTrajectory,
    /// Estimated positions, `(samples, n)` in physical units, unwrapped as in the track.
    pub q: &'a [f64],
    /// Estimated velocities, `(samples, n)`.
    pub v: &'a [f64],
    /// Known forces between the samples.
    pub between: Between,
}

impl StateEstimate<'_> {
    /// The known forces as a function of time; none if there were none.
    pub(crate) fn force(&self) -> Option<SampledForce<f64>> {
        self.track.sampled_force().map(|force| force.between(self.between))
    }
}

/// Standard deviations of the measurement noise, in physical units.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Noise of each position, `(n)`; positive.
    pub q: Vec<f64>,
    /// Noise of each velocity, `(n)`, positive; empty if velocities were not measured or are not used.
    pub v: Vec<f64>,
}

/// Datasets of a run, in the precision of training.
#[derive(Clone, Debug)]
pub struct Datasets<S> {
    /// Training states of each phase.
    pub training: Vec<Dataset<S>>,
    /// Validation states.
    pub validation: Dataset<S>,
    /// Fresh states for the final error.
    pub test: Dataset<S>,
}

impl<S: Scalar> Datasets<S> {
    /// Name and checksum of each set: training of every phase, validation, test.
    pub fn checksums(&self) -> Vec<(String, u32)> {
        let training =
            self.training.iter().enumerate().map(|(k, set)| (format!("training states of phase {}", k + 1), set));
        let others = [("validation states".to_string(), &self.validation), ("test states".to_string(), &self.test)];
        training.chain(others).map(|(name, set)| (name, set.checksum())).collect()
    }
}

/// Parameters that weight states by the size of their accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Weighting<'a> {
    /// Fraction of the typical size below which accelerations count equally,
    /// [`Data::acceleration_weighting`](crate::configuration::Data::acceleration_weighting).
    pub floor: f64,
    /// Scales of the coordinates.
    pub scale: &'a [f64],
    /// Standard errors of the accelerations, `(states, n)`; empty for exact ones.
    pub errors: &'a [f64],
}

impl Weighting<'_> {
    /// Mean magnitude of the scaled components for every state.
    fn sizes<'a, S: Scalar>(&'a self, values: &'a [S]) -> impl Iterator<Item = f64> + 'a {
        let size = |a: &[S]| a.iter().zip(self.scale).map(|(a, s)| (a.to_f64() / s).abs()).sum::<f64>();
        values.chunks_exact(self.scale.len()).map(move |a| size(a) / self.scale.len() as f64)
    }

    /// Mean magnitude of the acceleration for every state, without and with its standard error.
    fn of<S: Scalar>(&self, set: &Dataset<S>) -> (Vec<f64>, Vec<f64>) {
        let sizes: Vec<f64> = self.sizes(set.a()).collect();
        let mut uncertain = sizes.clone();
        uncertain.iter_mut().zip(self.sizes(self.errors)).for_each(|(size, error)| *size += error);
        (sizes, uncertain)
    }

    /// Weights the states by `f m/(f m + |a| + e)`, where `m` is the mean of `|a|` and `e` the standard error; no change for `f = 0`.
    pub fn relative<S: Scalar>(&self, set: Dataset<S>) -> Result<Dataset<S>, DatasetError> {
        if self.floor == 0.0 {
            return Ok(set);
        }
        let (sizes, uncertain) = self.of(&set);
        let floor = self.floor * sizes.iter().sum::<f64>() / sizes.len() as f64;
        // If all accelerations vanish, every state has the same weight.
        let weight = |size: f64| S::of_f64(if floor > 0.0 { floor / (floor + size) } else { 1.0 });
        set.with_weights(uncertain.into_iter().map(weight).collect())
    }

    /// Weights the states by `1/(|a| + f m + e)`, where `m` is the median of `|a|` among [`STATES_PER_DISTANCE`] states at a similar
    /// distance from the centre of the coordinates `around`; no change for `f = 0`.
    pub fn by_distance<S: Scalar>(&self, set: Dataset<S>, around: &[usize]) -> Result<Dataset<S>, DatasetError> {
        if self.floor == 0.0 {
            return Ok(set);
        }
        let n = self.scale.len();
        let (sizes, uncertain) = self.of(&set);
        let distance = |k: usize| around.iter().map(|&i| set.q()[k * n + i].to_f64().powi(2)).sum::<f64>();
        let mut order: Vec<usize> = (0..set.len()).collect();
        order.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        let mut weights = vec![S::of_f64(1.0); set.len()];
        for group in order.chunks(STATES_PER_DISTANCE) {
            let mut alike: Vec<f64> = group.iter().map(|&k| sizes[k]).collect();
            alike.sort_by(f64::total_cmp);
            let floor = self.floor * alike[alike.len() / 2];
            // If all accelerations vanish, every state has the same weight.
            let weight = |size: f64| S::of_f64(if floor > 0.0 { (size + floor).recip() } else { 1.0 });
            group.iter().for_each(|&k| weights[k] = weight(uncertain[k]));
        }
        set.with_weights(weights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offending_numbers_are_named() {
        let bad = Dataset::new(2, vec![0.0; 4], vec![0.0, 0.0, 0.0, f64::NAN], vec![0.0; 4]);
        assert_eq!(bad, Err(DatasetError::NotFinite { what: "velocity", row: 1, column: 1 }));
        let short = Dataset::new(2, vec![0.0; 4], vec![0.0; 2], vec![0.0; 4]);
        assert_eq!(short, Err(DatasetError::Shape { what: "velocity", expected: 4, found: 2 }));
        assert_eq!(Dataset::<f64>::new(2, vec![], vec![], vec![]), Err(DatasetError::Empty));
        let good = Dataset::new(2, vec![0.0; 4], vec![0.0; 4], vec![0.0; 4]).unwrap();
        let bad = good.clone().with_forces(vec![0.0, f64::INFINITY, 0.0, 0.0]);
        assert_eq!(bad, Err(DatasetError::NotFinite { what: "force", row: 0, column: 1 }));
        let forced = good.clone().with_forces(vec![1.0; 4]).unwrap();
        assert!(forced.checksum() != good.checksum() && forced.cast::<f32>().force() == [1.0; 4]);
        assert_eq!(good.with_forces(vec![]), Err(DatasetError::Shape { what: "force", expected: 4, found: 0 }));
    }

    #[test]
    fn the_scale_is_the_largest_of_coordinate_and_velocity() {
        let data = Dataset::new(2, vec![1.0, -3.0, 0.5, 0.0], vec![-2.0, 1.0, 0.0, 0.0], vec![9.0; 4]).unwrap();
        assert_eq!(data.physical_scale(), vec![2.0, 3.0]);
        assert_eq!(data.ranges()[1], [[-2.0, 0.0], [0.0, 1.0]]);
    }

    /// 400 states whose accelerations fall with the square of the distance.
    fn falling() -> Dataset<f64> {
        let q: Vec<f64> = (0..400).flat_map(|k| [0.02 * f64::from(k) + 1.0, 7.0]).collect();
        let a = q.chunks(2).flat_map(|q| [q[0].powi(-2), 0.0]).collect();
        Dataset::new(2, q.clone(), vec![0.0; q.len()], a).unwrap()
    }

    #[test]
    fn near_and_far_count_alike_and_uncertain_ones_less() {
        let set = falling();
        let size = |k: usize| 0.5 * set.a()[2 * k];
        let plain = Weighting { floor: 1.0, scale: &[1.0; 2], errors: &[] };
        let even = plain.by_distance(set.clone(), &[0]).unwrap();
        // Close to the median of each half, by distance.
        let usual = |k: usize| size(if k < 200 { 99 } else { 299 });
        assert!((0..400).all(|k| (even.weight(k) * (size(k) + usual(k)) - 1.0).abs() < 1e-14));
        for half in [0..200, 200..400] {
            let share = half.map(|k| even.weight(k) * size(k)).sum::<f64>() / 200.0;
            assert!((share - 0.5).abs() < 0.05, "{share}");
        }
        let relative = plain.relative(set.clone()).unwrap();
        let mean = (0..400).map(size).sum::<f64>() / 400.0;
        assert!((relative.weight(7) - mean / (mean + size(7))).abs() < 1e-15);
        // A standard error equal to acceleration plus floor halves the weight.
        let mut errors = vec![0.0; 800];
        errors[2 * 7 + 1] = 2.0 / even.weight(7);
        let uncertain = Weighting { errors: &errors, ..plain }.by_distance(set.clone(), &[0]).unwrap();
        assert!((uncertain.weight(7) - 0.5 * even.weight(7)).abs() < 1e-12);
        assert_eq!(uncertain.weight(8), even.weight(8));
        errors[2 * 7 + 1] = 2.0 * (mean + size(7));
        let uncertain = Weighting { errors: &errors, ..plain }.relative(set).unwrap();
        assert!((uncertain.weight(7) - 0.5 * relative.weight(7)).abs() < 1e-12);
    }

    #[test]
    fn states_at_rest_count_the_same() {
        let still = Dataset::new(1, vec![1.0, 2.0], vec![0.0; 2], vec![0.0; 2]).unwrap();
        let weighting = Weighting { floor: 1.0, scale: &[1.0], errors: &[] };
        for set in [weighting.relative(still.clone()).unwrap(), weighting.by_distance(still, &[0]).unwrap()] {
            assert_eq!((set.weight(0), set.weight(1)), (1.0, 1.0));
        }
    }
}
