//! Metric and curvature of geodesics: learned against exact.

use super::grid::{Axis, Grid};
use super::mass_matrix::matrices_at_rest;
use super::summary::quantile;
use crate::geometry::{at_once, geometries};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use serde::Serialize;

/// Values of a function over points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Median.
    pub median: f64,
    /// One value in a hundred is below.
    pub low: f64,
    /// One value in a hundred is above.
    pub high: f64,
    /// Points with a finite value.
    pub points: usize,
    /// Points without.
    pub failed: usize,
}

impl Spread {
    /// Of the finite ones among these values.
    pub fn of(values: &[f64]) -> Self {
        let mut finite: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
        finite.sort_by(f64::total_cmp);
        let [low, median, high] = [0.01, 0.5, 0.99].map(|p| quantile(&finite, p));
        Self { median, low, high, points: finite.len(), failed: values.len() - finite.len() }
    }
}

/// `true` if `L` is a quadratic form of the velocity, that of geodesics: then it is the energy, at the states `(states, n)`.
pub(crate) fn is_metric(model: &dyn EulerLagrange<f64>, q: &[f64], v: &[f64]) -> bool {
    let mut terms = Terms::default();
    if q.is_empty() || model.terms(q, v, Request::LAGRANGIAN | Request::ENERGY, &mut terms).is_err() {
        return false;
    }
    terms.lagrangian.iter().zip(&terms.energy).all(|(l, e)| (l - e).abs() <= 1e-9 * (l.abs() + e.abs()))
}

/// Points whose geometry is computed at once, at most.
const CHUNK: usize = 64;

/// Curvature scalar `R` of the mass matrix at rest, as a metric, at points `(points, n)`; `NaN` where there is none.
pub(crate) fn curvature_scalars(model: &dyn EulerLagrange<f64>, q: &[f64]) -> Vec<f64> {
    let n = model.coordinates();
    let rest = vec![0.0; n];
    let scalars = |points: &[f64]| -> Vec<f64> {
        match geometries(model, points, &rest) {
            Ok(found) => found.iter().map(|point| point.as_ref().map_or(f64::NAN, |g| g.curvature.scalar)).collect(),
            Err(_) => vec![f64::NAN; points.len() / n],
        }
    };
    q.chunks(CHUNK.min(at_once(n)) * n).flat_map(scalars).collect()
}

/// Values of the axes and points `(points, n)` over them, the other coordinates as at `point`.
pub(crate) fn grid_points(point: &[f64], axes: [Axis; 2]) -> ([Vec<f64>; 2], Vec<f64>) {
    let [x, y] = axes.map(|axis| axis.values());
    let mut q = Vec::with_capacity(x.len() * y.len() * point.len());
    let mut moved = point.to_vec();
    for second in &y {
        for first in &x {
            (moved[axes[0].component], moved[axes[1].component]) = (*first, *second);
            q.extend_from_slice(&moved);
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
    /// Of the learned component.
    pub learned: f64,
    /// Of the exact one, if there is one.
    pub exact: Option<f64>,
    /// Of the difference, if there is one.
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
    use crate::lagrangian::{Lagrangian, Mechanics, configure};
    use crate::scalar::Real;

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
            let system = configure::<f64>(name, &[]).unwrap();
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
