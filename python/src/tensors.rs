//! Metric, connection and curvature at many points, field by field.

use crate::attend::whole;
use crate::errors::value;
use crate::subject::Subject;
use lnn::geometry::{Geometry, GeometryError};
use pyo3::prelude::*;
use std::sync::atomic::Ordering;

/// Points whose geometry is computed at a time.
const CHUNK: usize = 256;

/// Components of Riemann tensors at once, at most: with all that stands beside them about 1 GB.
const MOST_NUMBERS: usize = 1 << 25;

/// What a geometry has of numbers at a point, by name and number of indices.
pub const FIELDS: [(&str, u32); 10] = [
    ("metric", 2),
    ("inverse", 2),
    ("christoffel", 3),
    ("riemann", 4),
    ("ricci", 2),
    ("einstein", 2),
    ("weyl", 4),
    ("determinant", 0),
    ("scalar", 0),
    ("kretschmann", 0),
];

/// Geometries of points, field by field; `NaN` at the points that fail.
#[derive(Default)]
pub struct Geometries {
    pub numbers: [Vec<f64>; FIELDS.len()],
    pub signatures: Vec<i64>,
    pub failures: Vec<(usize, String)>,
}

impl Geometries {
    /// Geometries of the points `(b, n)`; `velocity` is the one at which the mass matrix is taken.
    ///
    /// # Errors
    /// `ValueError` for too many points, and what [`Geometry::of`] refuses.
    pub fn of(py: Python<'_>, subject: &Subject, points: &[f64], velocity: &[f64]) -> PyResult<Self> {
        let n = subject.n();
        let most = MOST_NUMBERS / n.pow(4).max(1);
        if points.len() / n > most {
            return Err(value(format_args!("q: expected at most {most} points, found {}", points.len() / n)));
        }
        let model = subject.moving();
        whole(py, None, |watch| {
            let mut found = Self::default();
            let chunks = points.chunks(CHUNK * n);
            for points in chunks.take_while(|_| !watch.interrupt.load(Ordering::Relaxed)) {
                Geometry::of(model, points, velocity)?.into_iter().for_each(|one| found.push(n, one));
            }
            Ok::<_, GeometryError>(found)
        })?
        .map_err(value)
    }

    fn push(&mut self, n: usize, found: Result<Geometry<f64>, GeometryError>) {
        let parts = match found {
            Ok(Geometry { metric, connection, curvature }) => {
                self.signatures.extend([metric.signature.positive as i64, metric.signature.negative as i64]);
                let tensors =
                    [metric.components, metric.inverse, connection.symbols, curvature.riemann, curvature.ricci];
                let more = [curvature.einstein, curvature.weyl];
                let scalars = [metric.determinant, curvature.scalar, curvature.kretschmann].map(|x| vec![x]);
                tensors.into_iter().chain(more).chain(scalars).collect::<Vec<_>>()
            }
            Err(error) => {
                self.failures.push((self.signatures.len() / 2, error.to_string()));
                self.signatures.extend([0, 0]);
                FIELDS.iter().map(|(_, rank)| vec![f64::NAN; n.pow(*rank)]).collect()
            }
        };
        self.numbers.iter_mut().zip(parts).for_each(|(all, part)| all.extend(part));
    }
}
