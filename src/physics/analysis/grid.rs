//! A model over two components of its state, the others fixed; metric and curvature of geodesics over such a grid.

use super::AffineFit;
use super::statistics::quantile;
use super::terms::matrices_at_rest;
use super::thresholds::{METRIC_ROUNDING, MOST_AXIS_POINTS, POINTS_AT_ONCE};
use crate::geometry::{Geometry, at_once};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{Workspace, leading_minors};
use crate::scalar::Scalar;
use serde::Serialize;

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
    /// Values, `(y.len(), x.len())`; `NaN` where the model has none.
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

    /// Whether each value has another sign than that of `exact`; a value that is not finite has no sign. `None` at a point where `exact` is
    /// 0 or not finite; `None` altogether if the sizes differ.
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
            a if !(2..=MOST_AXIS_POINTS).contains(&a.points) => "needs 2 to 10,000 points",
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
        // Rows that fail are `NaN` or missing; the others are right whatever the call returns.
        let _ = model.terms(&q, &v, request, &mut terms);
        values.extend((0..x.len()).map(|row| value(&terms, row).filter(|z| z.is_finite()).unwrap_or(f64::NAN)));
    }
    Ok(Grid { x, y, values })
}

/// Values of a function over points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Median.
    pub median: f64,
    /// One value in a hundred is lower.
    pub low: f64,
    /// One value in a hundred is higher.
    pub high: f64,
    /// Points with a finite value.
    pub points: usize,
    /// Points without.
    pub failed: usize,
}

impl Spread {
    /// The range of the finite values among these.
    pub fn of(values: &[f64]) -> Self {
        let mut finite: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
        finite.sort_by(f64::total_cmp);
        let [low, median, high] = [0.01, 0.5, 0.99].map(|p| quantile(&finite, p));
        Self { median, low, high, points: finite.len(), failed: values.len() - finite.len() }
    }
}

/// `true` if `L` is a quadratic form of the velocity, as for geodesics, so that it equals the energy at the states `(states, n)`.
pub(crate) fn is_metric(model: &dyn EulerLagrange<f64>, q: &[f64], v: &[f64]) -> bool {
    let mut terms = Terms::default();
    if q.is_empty() || model.terms(q, v, Request::LAGRANGIAN | Request::ENERGY, &mut terms).is_err() {
        return false;
    }
    terms.lagrangian.iter().zip(&terms.energy).all(|(l, e)| (l - e).abs() <= METRIC_ROUNDING * (l.abs() + e.abs()))
}

/// Curvature scalar `R` of the mass matrix at rest, as a metric, at points `(points, n)`; `NaN` where there is none.
pub(crate) fn curvature_scalars(model: &dyn EulerLagrange<f64>, q: &[f64]) -> Vec<f64> {
    let n = model.coordinates();
    let rest = vec![0.0; n];
    let scalars = |points: &[f64]| -> Vec<f64> {
        match Geometry::of(model, points, &rest) {
            Ok(found) => found.iter().map(|point| point.as_ref().map_or(f64::NAN, |g| g.curvature.scalar)).collect(),
            Err(_) => vec![f64::NAN; points.len() / n],
        }
    };
    q.chunks(POINTS_AT_ONCE.min(at_once(n)) * n).flat_map(scalars).collect()
}

/// Values of the axes and points `(points, n)` over them, the other coordinates as at `point`.
pub(crate) fn grid_points(point: &[f64], axes: [Axis; 2]) -> ([Vec<f64>; 2], Vec<f64>) {
    let [x, y] = axes.map(|axis| axis.values());
    let mut q = Vec::with_capacity(x.len() * y.len() * point.len());
    let mut point_of_grid = point.to_vec();
    for second in &y {
        for first in &x {
            (point_of_grid[axes[0].component], point_of_grid[axes[1].component]) = (*first, *second);
            q.extend_from_slice(&point_of_grid);
        }
    }
    ([x, y], q)
}

/// The curvature scalar over two coordinates, the others as at `point`.
pub(crate) fn curvature_grid(model: &dyn EulerLagrange<f64>, point: &[f64], axes: [Axis; 2]) -> Grid {
    let ([x, y], q) = grid_points(point, axes);
    Grid { x, y, values: curvature_scalars(model, &q) }
}

/// Components of the mass matrix at rest over two coordinates, the others as at `point`, in the order of [`indices`].
pub(crate) fn metric_grids(model: &dyn EulerLagrange<f64>, point: &[f64], axes: [Axis; 2]) -> Vec<Grid> {
    let ([x, y], q) = grid_points(point, axes);
    let (n, matrices) = (point.len(), matrices_at_rest(model, &q));
    let grid = |[i, j]: [usize; 2]| Grid { x: x.clone(), y: y.clone(), values: component(n, &matrices, [i, j]) };
    indices(n).map(grid).collect()
}

/// Indices of the components of a symmetric matrix, the first not above the second.
fn indices(n: usize) -> impl Iterator<Item = [usize; 2]> {
    (0..n).flat_map(move |i| (i..n).map(move |j| [i, j]))
}

/// One component of matrices `(points, n, n)`, `(points)`.
fn component(n: usize, matrices: &[f64], [i, j]: [usize; 2]) -> Vec<f64> {
    matrices.iter().skip(i * n + j).step_by(n * n).copied().collect()
}

/// Component of a learned metric at rest, after the factor of a comparison, and of the exact one: root mean squares over points.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MetricComponent {
    /// Indices of the component, the first not above the second.
    pub indices: [usize; 2],
    /// Range of the learned component.
    pub learned: f64,
    /// Range of the exact component, if there is one.
    pub exact: Option<f64>,
    /// Range of the difference, if there is an exact component.
    pub error: Option<f64>,
}

/// Components of the mass matrix of a model at rest at points `(points, n)`, times `factor`, beside the exact ones.
pub(crate) fn metric_components(
    exact: Option<&dyn EulerLagrange<f64>>,
    learned: &dyn EulerLagrange<f64>,
    q: &[f64],
    factor: f64,
) -> Vec<MetricComponent> {
    let n = learned.coordinates();
    let learned: Vec<f64> = matrices_at_rest(learned, q).iter().map(|x| factor * x).collect();
    let exact = exact.map(|exact| matrices_at_rest(exact, q));
    let points = (q.len() / n.max(1)).max(1) as f64;
    let rms = |values: &mut dyn Iterator<Item = f64>| (values.map(|x| x * x).sum::<f64>() / points).sqrt();
    let compared = |at: [usize; 2]| {
        let (own, beside) = (component(n, &learned, at), exact.as_ref().map(|exact| component(n, exact, at)));
        MetricComponent {
            indices: at,
            learned: rms(&mut own.iter().copied()),
            exact: beside.as_ref().map(|beside| rms(&mut beside.iter().copied())),
            error: beside.as_ref().map(|beside| rms(&mut own.iter().zip(beside).map(|(a, b)| a - b))),
        }
    };
    indices(n).map(compared).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Lagrangian, Mechanics, SystemInstance};
    use crate::models::{PENDULUM, SINGULAR};
    use crate::scalar::Real;

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

    /// Sphere of radius `a`, `L = a^2 (v_0^2 + sin^2 q_0 v_1^2)/2 - b q_0`.
    struct Sphere;

    impl Lagrangian for Sphere {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
            p[0].sqr() * R::half() * (v[0].sqr() + (q[0].sin() * v[1]).sqr()) - p[1] * q[0]
        }
    }

    fn sphere(radius: f64, pull: f64) -> Mechanics<Sphere, f64> {
        Mechanics::new(Sphere, vec![radius, pull])
    }

    #[test]
    fn curvature_of_a_sphere_is_two_over_its_radius_squared() {
        let q = [0.5, 0.0, 1.0, 2.0, 2.5, 4.0, 0.0, 1.0];
        let scalars = curvature_scalars(&sphere(2.0, 0.0), &q);
        let found = Spread::of(&scalars);
        // The pole has no metric.
        assert!((found.points, found.failed) == (3, 1) && scalars[3].is_nan());
        assert!([found.low, found.median, found.high].iter().all(|r| (r - 0.5).abs() < 1e-12), "{found:?}");
        let axes = [(0, 0.5, 1.5, 3), (1, 0.0, 1.0, 2)].map(|(component, from, to, points)| Axis {
            component,
            from,
            to,
            points,
        });
        let grid = curvature_grid(&sphere(0.5, 0.0), &[0.0; 2], axes);
        assert!(grid.values.len() == 6 && grid.values.iter().all(|r| (r - 8.0).abs() < 1e-11));
    }

    #[test]
    fn maps_of_the_metric_are_those_of_its_components() {
        let axis = |component, from, to, points| Axis { component, from, to, points };
        let grids = metric_grids(&sphere(2.0, 0.0), &[0.0; 2], [axis(0, 0.5, 1.5, 3), axis(1, 0.0, 1.0, 2)]);
        assert_eq!((grids.len(), grids[0].x.len(), grids[0].y.len()), (3, 3, 2));
        assert!(grids[0].values.iter().all(|g| *g == 4.0) && grids[1].values.iter().all(|g| *g == 0.0));
        for (k, g) in grids[2].values.iter().enumerate() {
            assert!((g - 4.0 * grids[2].point(k).0.sin().powi(2)).abs() < 1e-15);
        }
    }

    #[test]
    fn geodesics_are_told_from_motion_under_a_force() {
        let (q, v) = ([0.5, 0.0, 1.0, 2.0], [1.0, 0.3, -0.2, 0.4]);
        assert!(is_metric(&sphere(1.0, 0.0), &q, &v) && !is_metric(&sphere(1.0, 0.1), &q, &v));
        for (name, metric) in [("ads4-geodesic", true), ("schwarzschild-geodesic", true), ("charged-particle", false)] {
            let system = SystemInstance::<f64>::named(name, &[]).unwrap();
            let model = system.build().unwrap();
            let n = system.coordinates;
            let q: Vec<f64> = (0..n).map(|i| 4.0 + 0.1 * i as f64).collect();
            assert_eq!(is_metric(model.as_ref(), &q, &vec![0.3; n]), metric, "{name}");
        }
        assert!(!is_metric(&sphere(1.0, 0.0), &[], &[]));
    }

    #[test]
    fn components_are_compared_after_the_factor() {
        let q = [0.5, 0.0, 1.0, 2.0];
        let found = metric_components(Some(&sphere(1.0, 0.0)), &sphere(2.0, 0.0), &q, 0.25);
        assert_eq!(found.iter().map(|c| c.indices).collect::<Vec<_>>(), [[0, 0], [0, 1], [1, 1]]);
        assert!(found.iter().all(|c| c.error.is_some_and(|error| error < 1e-15)));
        let expected = ((0.5f64.sin().powi(4) + 1.0f64.sin().powi(4)) / 2.0).sqrt();
        assert!((found[2].learned - expected).abs() < 1e-15 && (found[2].exact.unwrap() - expected).abs() < 1e-15);
        let found = metric_components(None, &sphere(2.0, 0.0), &q, 1.0);
        assert!(found[0].learned == 4.0 && found[0].exact.is_none() && found[0].error.is_none());
        let found = metric_components(Some(&sphere(1.0, 0.0)), &sphere(2.0, 0.0), &q, 0.5);
        assert!((found[0].error.unwrap() - 1.0).abs() < 1e-15);
    }
}
