//! Distance of two trajectories over time.

use crate::rollout::Trajectory;
use crate::scalar::Scalar;

/// Absolute errors of coordinates over the times that both trajectories reach.
#[derive(Clone, Debug, PartialEq)]
pub struct CoordinateError {
    /// Number of coordinates `n`.
    pub coordinates: usize,
    /// Times.
    pub t: Vec<f64>,
    /// `|q_learned - q_exact|` per coordinate, `(len, n)`; angles modulo `2 pi`, at most `pi`.
    pub per_coordinate: Vec<f64>,
}

impl CoordinateError {
    /// Largest error over some coordinates, which have one unit, at every time; `NaN` where one is.
    pub fn largest(&self, coordinates: &[usize]) -> Vec<f64> {
        let rows = self.per_coordinate.chunks_exact(self.coordinates.max(1));
        let worst = |row: &[f64]| {
            let errors = coordinates.iter().filter_map(|&i| row.get(i).copied());
            errors.fold(0.0, |worst: f64, error| if error <= worst || worst.is_nan() { worst } else { error })
        };
        rows.map(worst).collect()
    }
}

/// Distance of two angles on the circle, in `[0, pi]`.
pub fn angle_difference<S: Scalar>(a: S, b: S) -> S {
    let turn = S::pi() + S::pi();
    let difference = (a - b).abs().wrap_angle();
    S::min(difference, turn - difference)
}

/// Errors of `learned` against `exact`, sample by sample, as far as both go; `periodic[i]` marks angles.
///
/// Samples are matched by their place: both trajectories must come from the same sample times. A `periodic` shorter than
/// `n` leaves the remaining coordinates plain.
pub fn coordinate_error<S: Scalar>(
    exact: &Trajectory<S>,
    learned: &Trajectory<S>,
    periodic: &[bool],
) -> CoordinateError {
    let n = exact.coordinates.min(learned.coordinates);
    let len = exact.len().min(learned.len());
    let mut result = CoordinateError {
        coordinates: n,
        t: exact.t[..len].iter().map(|t| t.to_f64()).collect(),
        per_coordinate: Vec::with_capacity(len * n),
    };
    for k in 0..len {
        let (a, b) = (exact.state(k).0, learned.state(k).0);
        for i in 0..n {
            let angle = periodic.get(i).copied().unwrap_or(false);
            let error = if angle { angle_difference(a[i], b[i]) } else { (a[i] - b[i]).abs() }.to_f64();
            result.per_coordinate.push(error);
        }
    }
    result
}

/// `|v_learned - v_exact|` per coordinate, `(len, n)`, as far as both go; samples are matched as by [`coordinate_error`].
pub fn velocity_error<S: Scalar>(exact: &Trajectory<S>, learned: &Trajectory<S>) -> Vec<f64> {
    exact.v.iter().zip(&learned.v).map(|(&a, &b)| (a - b).abs().to_f64()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn trajectory(q: &[f64]) -> Trajectory<f64> {
        Trajectory { coordinates: 2, t: vec![0.0, 1.0], q: q.to_vec(), v: vec![0.0; 4], energy: None }
    }

    #[test]
    fn velocities_are_compared_as_far_as_both_go() {
        let exact = Trajectory { v: vec![1.0, -2.0, 3.0, 4.0], ..trajectory(&[0.0; 4]) };
        let learned = Trajectory { t: vec![0.0], q: vec![0.0; 2], v: vec![1.5, 2.0], ..trajectory(&[]) };
        assert_eq!(velocity_error(&exact, &learned), [0.5, 4.0]);
    }

    #[test]
    fn angles_go_round() {
        let (a, b) = (trajectory(&[0.1, 0.0, 1.0, 0.0]), trajectory(&[2.0 * PI - 0.1, 0.5, 1.0 + 6.0 * PI, 7.0]));
        let error = coordinate_error(&a, &b, &[true]);
        assert!((error.per_coordinate[0] - 0.2).abs() < 1e-14);
        assert_eq!(error.per_coordinate[1], 0.5);
        assert!(error.per_coordinate[2] < 1e-14);
        assert_eq!((error.largest(&[0, 1]), error.largest(&[1])), (vec![0.5, 7.0], vec![0.5, 7.0]));
        assert!(error.largest(&[0])[1] < 1e-14);
        let lost = CoordinateError { per_coordinate: vec![f64::NAN, 1.0, 2.0, 1.0], ..error };
        assert!(lost.largest(&[0, 1])[0].is_nan() && lost.largest(&[0, 1])[1] == 2.0);
        assert!((angle_difference(0.0_f64, PI) - PI).abs() < 1e-15);
        assert_eq!(angle_difference(3.0_f64, 3.0), 0.0);
    }

    #[test]
    fn the_shorter_one_decides() {
        let mut short = trajectory(&[0.0; 4]);
        short.t.pop();
        short.q.truncate(2);
        short.v.truncate(2);
        assert_eq!(coordinate_error(&trajectory(&[1.0; 4]), &short, &[]).per_coordinate, [1.0; 2]);
    }
}
