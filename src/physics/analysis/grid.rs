//! A model over two components of its state, the others fixed.

use super::AffineFit;
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{Workspace, leading_minors};
use crate::scalar::Scalar;

/// One axis of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Component of `(q, v)`: coordinates `0..n`, velocities `n..2n`.
    pub component: usize,
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// Number of values, at least 2.
    pub points: usize,
}

impl Axis {
    /// The values, evenly spaced, both ends included.
    pub fn values(&self) -> Vec<f64> {
        let last = self.points.saturating_sub(1).max(1) as f64;
        (0..self.points).map(|k| self.from + (self.to - self.from) * (k as f64 / last)).collect()
    }
}

/// Values over a rectangle.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Values of the first axis.
    pub x: Vec<f64>,
    /// Values of the second axis.
    pub y: Vec<f64>,
    /// `(y.len(), x.len())`; `NaN` where the model gives none.
    pub values: Vec<f64>,
}

impl Grid {
    /// The same grid with `map` applied to each value.
    pub fn map(&self, map: impl Fn(f64) -> f64) -> Self {
        Self { values: self.values.iter().map(|&z| map(z)).collect(), ..self.clone() }
    }

    /// The same grid after an affine fit.
    pub fn fitted(&self, fit: &AffineFit) -> Self {
        self.map(|z| fit.apply(z))
    }

    /// Value by value difference `self - other`; `None` if the sizes differ.
    pub fn minus(&self, other: &Self) -> Option<Self> {
        if self.x.len() != other.x.len() || self.y.len() != other.y.len() {
            return None;
        }
        let values = self.values.iter().zip(&other.values).map(|(a, b)| a - b).collect();
        Some(Self { values, ..self.clone() })
    }

    /// Where the values have not the sign of `exact`, value by value; one that is not finite has no sign. `None` at a
    /// point where `exact` is 0 or not finite; `None` altogether if the sizes differ.
    pub fn wrong_signs(&self, exact: &Self) -> Option<Vec<Option<bool>>> {
        if self.x.len() != exact.x.len() || self.y.len() != exact.y.len() {
            return None;
        }
        let sign = |z: f64| if z.is_finite() { z.partial_cmp(&0.0).filter(|order| order.is_ne()) } else { None };
        let pairs = self.values.iter().zip(&exact.values);
        Some(pairs.map(|(&z, &exact)| sign(exact).map(|right| sign(z) != Some(right))).collect())
    }

    /// The point of a value's index.
    pub fn point(&self, index: usize) -> (f64, f64) {
        (self.x[index % self.x.len()], self.y[index / self.x.len()])
    }
}

/// Why a grid cannot be laid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GridError {
    /// The fixed state has the wrong length.
    #[error("fixed state: expected {expected} numbers, found {found}")]
    State {
        /// Numbers expected, `2n`.
        expected: usize,
        /// Numbers found.
        found: usize,
    },
    /// An axis names no component, has too few or too many points, or bounds that are not finite and different.
    #[error("axis {axis}: {problem}")]
    Axis {
        /// 0 or 1.
        axis: usize,
        /// The problem in words.
        problem: &'static str,
    },
}

/// `L` of `model` over two components; `state` fixes the others as `(q, v)`.
///
/// # Errors
/// [`GridError`] if the state or an axis does not fit the model.
pub fn lagrangian_grid<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    state: &[f64],
    axes: [Axis; 2],
) -> Result<Grid, GridError> {
    let value = |terms: &Terms<S>, row: usize| terms.lagrangian.get(row).map(|x| x.to_f64());
    evaluate(model, state, axes, Request::LAGRANGIAN, |_, _| {}, value)
}

/// `det M` of `model` over two components; `state` fixes the others as `(q, v)`, and `impose` may then change the
/// velocities of each point, given its coordinates (to put it on a mass shell).
///
/// # Errors
/// [`GridError`] if the state or an axis does not fit the model.
pub fn determinant_grid<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    state: &[f64],
    axes: [Axis; 2],
    impose: impl Fn(&[f64], &mut [f64]),
) -> Result<Grid, GridError> {
    let n = model.coordinates();
    let (mut minors, mut workspace) = (Vec::new(), Workspace::new());
    evaluate(model, state, axes, Request::MASS_MATRIX, impose, |terms, row| {
        let m = terms.mass_matrix.get(row * n * n..(row + 1) * n * n)?;
        leading_minors(n, m, &mut minors, &mut workspace).ok()?;
        minors.last().map(|det| det.value().to_f64())
    })
}

fn evaluate<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    state: &[f64],
    axes: [Axis; 2],
    request: Request,
    impose: impl Fn(&[f64], &mut [f64]),
    mut value: impl FnMut(&Terms<S>, usize) -> Option<f64>,
) -> Result<Grid, GridError> {
    let n = model.coordinates();
    if state.len() != 2 * n {
        return Err(GridError::State { expected: 2 * n, found: state.len() });
    }
    for (axis, a) in axes.iter().enumerate() {
        let problem = match a {
            a if a.component >= 2 * n => "names no component",
            a if !(2..=10_000).contains(&a.points) => "needs 2 to 10,000 points",
            a if !(a.from.is_finite() && a.to.is_finite() && a.from != a.to) => "needs two different finite bounds",
            _ if axes[0].component == axes[1].component => "both axes are the same component",
            _ => continue,
        };
        return Err(GridError::Axis { axis, problem });
    }
    let (x, y) = (axes[0].values(), axes[1].values());
    let mut values = Vec::with_capacity(x.len() * y.len());
    let (mut q, mut v, mut terms) = (Vec::new(), Vec::new(), Terms::default());
    let mut full = state.to_vec();
    for &second in &y {
        q.clear();
        v.clear();
        for &first in &x {
            full[axes[0].component] = first;
            full[axes[1].component] = second;
            let (position, velocity) = full.split_at_mut(n);
            impose(position, velocity);
            q.extend(full[..n].iter().map(|&z| S::of_f64(z)));
            v.extend(full[n..].iter().map(|&z| S::of_f64(z)));
        }
        // Rows that fail are `NaN` or missing; the others are right whatever the result says.
        let _ = model.terms(&q, &v, request, &mut terms);
        values.extend((0..x.len()).map(|row| value(&terms, row).filter(|z| z.is_finite()).unwrap_or(f64::NAN)));
    }
    Ok(Grid { x, y, values })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::models::{PENDULUM, SINGULAR};

    const AXES: [Axis; 2] =
        [Axis { component: 0, from: -2.0, to: 2.0, points: 5 }, Axis { component: 1, from: 0.0, to: 3.0, points: 4 }];

    #[test]
    fn lagrangian_over_the_plane() {
        let grid = lagrangian_grid::<f64>(&PENDULUM, &[0.0, 0.0], AXES).unwrap();
        assert_eq!((grid.x.len(), grid.y.len(), grid.values.len()), (5, 4, 20));
        for (j, v) in grid.y.iter().enumerate() {
            for (i, q) in grid.x.iter().enumerate() {
                assert!((grid.values[j * 5 + i] - (0.5 * v * v + q.cos())).abs() < 1e-15);
            }
        }
        assert!(grid.minus(&grid).unwrap().values.iter().all(|&z| z == 0.0));
        let ones = determinant_grid::<f64>(&PENDULUM, &[0.0, 0.0], AXES, |_, _| {}).unwrap();
        assert!(ones.values.iter().all(|&z| z == 1.0));
    }

    #[test]
    fn velocities_are_imposed_point_by_point() {
        use crate::lagrangian::{Lagrangian, Mechanics};
        use crate::scalar::Real;
        /// `L = v_0^4 / 12 + v_1^2 / 2`: `det M = v_0^2`.
        struct Quartic;
        impl Lagrangian for Quartic {
            fn coordinates(&self) -> usize {
                2
            }
            fn lagrangian<R: Real>(&self, _: &[R], _: &[R], v: &[R]) -> R {
                R::ratio(1, 12) * v[0].sqr().sqr() + R::half() * v[1].sqr()
            }
        }
        let model = Mechanics::<_, f64>::new(Quartic, vec![]);
        let grid = determinant_grid(&model, &[9.0; 4], AXES, |q, v| v[0] = q[0] + 2.0 * q[1]).unwrap();
        for (index, &det) in grid.values.iter().enumerate() {
            let (x, y) = grid.point(index);
            assert!((det - (x + 2.0 * y).powi(2)).abs() <= 4.0 * f64::EPSILON * det, "{det} at {x}, {y}");
        }
    }

    #[test]
    fn wrong_signs_are_found_where_there_is_a_sign() {
        let grid = |values: &[f64]| Grid { x: vec![0.0, 1.0, 2.0], y: vec![5.0, 6.0], values: values.to_vec() };
        let (nan, inf) = (f64::NAN, f64::INFINITY);
        let exact = grid(&[1.0, 2.0, -1.0, 0.0, nan, 3.0]);
        let found = grid(&[0.5, -2.0, -9.0, 1.0, 1.0, inf]).wrong_signs(&exact).unwrap();
        assert_eq!(found, [Some(false), Some(true), Some(false), None, None, Some(true)]);
        // A model without mass has no sign either.
        assert_eq!(grid(&[0.0; 6]).wrong_signs(&exact).unwrap()[..3], [Some(true); 3]);
        assert_eq!(exact.point(4), (1.0, 6.0));
        assert!(grid(&[0.0; 6]).wrong_signs(&Grid { x: vec![0.0], ..exact }).is_none());
    }

    #[test]
    fn failing_rows_are_gaps_and_bad_axes_errors() {
        let grid = determinant_grid::<f64>(&SINGULAR, &[0.0, 0.0], AXES, |_, _| {}).unwrap();
        assert_eq!(grid.values[0], 0.0);
        assert_eq!(grid.values[1], 1.0);
        assert!(matches!(lagrangian_grid::<f64>(&PENDULUM, &[0.0], AXES), Err(GridError::State { .. })));
        let mut bad = AXES;
        bad[1].component = 2;
        assert!(matches!(lagrangian_grid::<f64>(&PENDULUM, &[0.0; 2], bad), Err(GridError::Axis { axis: 1, .. })));
        bad[1] = AXES[0];
        assert!(lagrangian_grid::<f64>(&PENDULUM, &[0.0; 2], bad).is_err());
    }
}
