//! Surfaces where a metric changes its character: ergosurfaces, horizons, changes of signature.

use super::GeometryError;
use super::tensors::determinant;
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use crate::linalg::{Inertia, inertia};
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// Character of a metric at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Character<S> {
    /// `det g`; `NaN` where the metric is not finite.
    pub determinant: S,
    /// Numbers of negative, zero and positive eigenvalues; `None` where the metric is not finite.
    pub signature: Option<Inertia>,
}

/// Behaviour of a determinant where it changes its sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// It vanishes.
    Zero,
    /// It is infinite.
    Pole,
}

/// Point of a surface on a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface<S> {
    /// Coordinates `(n)`, to the precision of the numbers.
    pub point: Vec<S>,
    /// Behaviour of the determinant there.
    pub change: Change,
}

/// Metrics of points `(batch, n)` with the same velocity, `(batch, n, n)`.
fn metrics<S: Scalar>(model: &dyn EulerLagrange<S>, points: &[S], velocity: &[S]) -> Result<Vec<S>, GeometryError> {
    let n = model.coordinates();
    super::expect_length("velocity", n, velocity.len())?;
    let mut terms = Terms::default();
    match model.terms(points, &velocity.repeat(points.len() / n.max(1)), Request::MASS_MATRIX, &mut terms) {
        // Metrics are filled where they are not finite too: on a horizon, at a pole.
        Ok(()) | Err(MechanicsError::NotFinite { .. }) => Ok(terms.mass_matrix),
        Err(error) => Err(error.into()),
    }
}

/// The character of the metric at points `(batch, n)`, such as those of a [`grid`], at a velocity `(n)`.
///
/// # Errors
/// [`GeometryError::Shape`] and the model's own.
pub fn characters<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    points: &[S],
    velocity: &[S],
) -> Result<Vec<Character<S>>, GeometryError> {
    let n = model.coordinates();
    let mut scratch = vec![S::nan(); n * n];
    let character = |metric: &[S]| Character {
        determinant: determinant(n, metric),
        signature: inertia(n, metric, &mut scratch).ok(),
    };
    Ok(metrics(model, points, velocity)?.chunks_exact((n * n).max(1)).map(character).collect())
}

/// Points `(batch, n)` over the values of some coordinates, the others as in `base`: the last axis runs fastest.
///
/// Axes of coordinates that `base` does not have are left out.
pub fn grid<S: Scalar>(base: &[S], axes: &[(usize, Vec<S>)]) -> Vec<S> {
    let mut points = vec![base.to_vec()];
    for (i, values) in axes.iter().filter(|(i, _)| *i < base.len()) {
        let along = |point: Vec<S>| {
            values.iter().map(move |&value| {
                let mut point = point.clone();
                point[*i] = value;
                point
            })
        };
        points = points.into_iter().flat_map(along).collect();
    }
    points.concat()
}

/// Places of a line whose metrics are held at a time.
const PLACES: usize = 1024;

/// `true` if the sign differs at the ends of a piece, or the piece ends with an exact zero.
fn changes<S: Scalar>(low: S, high: S) -> bool {
    let zero = <S as Real>::zero();
    high == zero || (low < zero && high > zero) || (low > zero && high < zero)
}

impl<S: Scalar> Surface<S> {
    /// Where the determinant of a block of the metric changes its sign on the straight line of coordinates from `from` to `to`, both
    /// `(n)`, at a velocity `(n)`.
    ///
    /// | block | surface |
    /// |---|---|
    /// | the time | ergosurface, where `g_tt = 0` (of a static metric also its horizon) |
    /// | time and the angle of a symmetry axis | horizon of a rotating black hole: no observer can stay at its place |
    /// | all coordinates but one | where the surfaces on which that one is constant become null: a horizon in coordinates that are regular there |
    /// | all coordinates | the signature changes |
    ///
    /// The line is cut into `steps` equal pieces; every piece whose ends differ in sign is halved until its ends are neighbours. Two surfaces
    /// within a piece, and determinants that touch zero, are not seen. Points where the metric is not finite are skipped.
    ///
    /// # Errors
    /// [`GeometryError::Shape`] for slices of the wrong length, or a block that is empty or names a coordinate that does not exist; the model's
    /// own.
    pub fn find(
        model: &dyn EulerLagrange<S>,
        block: &[usize],
        (from, to): (&[S], &[S]),
        velocity: &[S],
        steps: usize,
    ) -> Result<Vec<Self>, GeometryError> {
        let n = model.coordinates();
        for (what, end) in [("start of the line", from), ("end of the line", to)] {
            super::expect_length(what, n, end.len())?;
        }
        if let Some(found) = block.iter().copied().find(|&i| i >= n).or(block.is_empty().then_some(0)) {
            return Err(GeometryError::Shape { what: "block of the metric", expected: n, found });
        }
        let line = Line { model, block, from, to, velocity };
        let mut found = Vec::new();
        for piece in line.sign_changes(steps.max(1))? {
            found.extend(line.surface(piece)?);
        }
        Ok(found)
    }
}

/// A straight line of coordinates along which the determinant of a block of the metric is examined. Places on it are numbers from 0 to 1.
struct Line<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    block: &'a [usize],
    from: &'a [S],
    to: &'a [S],
    velocity: &'a [S],
}

impl<S: Scalar> Line<'_, S> {
    /// The coordinates of a place.
    fn point(&self, place: S) -> Vec<S> {
        self.from.iter().zip(self.to).map(|(&a, &b)| a + place * (b - a)).collect()
    }

    /// The determinant of the block of a metric.
    fn determinant(&self, metric: &[S]) -> S {
        let (n, block) = (self.model.coordinates(), self.block);
        let part: Vec<S> = block.iter().flat_map(|&i| block.iter().map(move |&j| metric[i * n + j])).collect();
        determinant(block.len(), &part)
    }

    /// Pieces of the line, of `steps` equal ones, whose determinants differ in sign at their ends: place and determinant of both ends.
    fn sign_changes(&self, steps: usize) -> Result<Vec<[(S, S); 2]>, GeometryError> {
        let n = self.model.coordinates();
        let place = |k: usize| S::of_f64(k as f64) / S::of_f64(steps as f64);
        // The last point where the metric is finite: its index and the value there.
        let mut last: Option<(usize, S)> = None;
        let mut pieces = Vec::new();
        for start in (0..=steps).step_by(PLACES) {
            let end = steps.min(start.saturating_add(PLACES - 1));
            let points: Vec<S> = (start..=end).flat_map(|k| self.point(place(k))).collect();
            let metrics = metrics(self.model, &points, self.velocity)?;
            for (k, metric) in (start..=end).zip(metrics.chunks_exact(n * n)) {
                let value = self.determinant(metric);
                if !value.is_finite() {
                    continue;
                }
                // A single point where the metric is not finite, such as one exactly on a horizon, does not hide a change of sign.
                let before = last.replace((k, value)).filter(|(before, at)| k - before <= 2 && changes(*at, value));
                pieces.extend(before.map(|(before, at)| [(place(before), at), (place(k), value)]));
            }
        }
        Ok(pieces)
    }

    /// The surface in a piece, by halving; `None` if the piece has no metric inside.
    fn surface(
        &self,
        [(mut low, mut at_low), (mut high, mut at_high)]: [(S, S); 2],
    ) -> Result<Option<Surface<S>>, GeometryError> {
        let zero = <S as Real>::zero();
        // An exact zero belongs to the piece that ends with it.
        if at_high == zero {
            return Ok(Some(Surface { point: self.point(high), change: Change::Zero }));
        }
        let outside = at_low.abs().max(at_high.abs());
        while let Some((inside, at_inside)) = self.inside(low, high)? {
            if at_inside == zero {
                (low, high, at_low, at_high) = (inside, inside, zero, zero);
                break;
            }
            if (at_inside > zero) == (at_low > zero) {
                (low, at_low) = (inside, at_inside);
            } else {
                (high, at_high) = (inside, at_inside);
            }
        }
        // A stretch without a metric has no surface that can be named.
        if high - low > S::epsilon().ldexp(8) {
            return Ok(None);
        }
        let change = if at_low.abs().min(at_high.abs()) > outside { Change::Pole } else { Change::Zero };
        Ok(Some(Surface { point: self.point((low + high) * <S as Real>::half()), change }))
    }

    /// A place near the middle of two others and the determinant there; `None` if the two are neighbours or no such place has a metric.
    fn inside(&self, low: S, high: S) -> Result<Option<(S, S)>, GeometryError> {
        let within = |part: f64| Some(low + S::of_f64(part) * (high - low)).filter(|s| *s > low && *s < high);
        // The metric may be singular on the surface itself but not next to it.
        for place in [0.5, 0.375, 0.625].into_iter().filter_map(within) {
            let value = self.determinant(&metrics(self.model, &self.point(place), self.velocity)?);
            if value.is_finite() {
                return Ok(Some((place, value)));
            }
        }
        Ok(None)
    }
}
