//! Metrics that are the same at all times.

use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};

/// Later and earlier times at which a metric is looked at, in parts of the span that matters.
const TIMES: [f64; 3] = [0.31, -0.57, 1.0];
/// Differences of the components, over the largest of them, that are rounding.
const ROUNDING: f64 = 1e-9;

/// `true` if the metric of some point is another one at another time: a span of it, a part of it later or earlier. `points` are
/// `(points, n)`, `time` is the index of the time.
///
/// # Errors
/// What the model refuses other than single states, which are passed over.
pub(crate) fn depends_on_time(
    model: &dyn EulerLagrange<f64>,
    time: usize,
    points: &[f64],
    span: f64,
) -> Result<bool, MechanicsError> {
    let n = model.coordinates();
    let mut terms = Terms::default();
    let mut velocity = vec![0.0; n];
    velocity[time] = 1.0;
    for point in points.chunks_exact(n) {
        let mut q = point.repeat(1 + TIMES.len());
        q.iter_mut().skip(n + time).step_by(n).zip(TIMES).for_each(|(t, part)| *t += part * span);
        match model.terms(&q, &velocity.repeat(1 + TIMES.len()), Request::MASS_MATRIX, &mut terms) {
            Ok(()) | Err(MechanicsError::Singular { .. } | MechanicsError::NotFinite { .. }) => {}
            Err(error) => return Err(error),
        }
        let (now, then) = terms.mass_matrix.split_at(n * n);
        let most = now.iter().fold(0.0_f64, |most, g| most.max(g.abs()));
        // Where the metric is none there is nothing to compare; where it is one, it must be one at all times.
        if now.iter().all(|g| g.is_finite())
            && then.chunks_exact(n * n).flat_map(|g| g.iter().zip(now)).any(|(g, now)| {
                let difference = (g - now).abs();
                difference.is_nan() || difference > ROUNDING * most
            })
        {
            return Ok(true);
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Lagrangian, Mechanics, build};
    use crate::scalar::Real;

    /// `a(t)^2 dx^2 - dt^2`, `a = 1 + rate sin t`.
    struct Breathing(f64);

    impl Lagrangian for Breathing {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            let scale = (R::one() + R::of(self.0) * q[0].sin()) * v[1];
            (scale.sqr() - v[0].sqr()) * R::half()
        }
    }

    #[test]
    fn time_is_told_from_place() {
        let points = [0.0, 1.0, 0.0, 30.0];
        let of = |rate: f64| depends_on_time(&Mechanics::<_, f64>::new(Breathing(rate), vec![]), 0, &points, 7.0);
        assert_eq!([of(0.0), of(1e-12), of(1e-6), of(0.5)], [Ok(false), Ok(false), Ok(true), Ok(true)]);
        // Of a place it may depend.
        let hole = build::<f64>("schwarzschild-cartesian", &[]).unwrap();
        let points = [0.0, 8.0, 0.0, 0.0, 0.0, 0.0, -3.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(depends_on_time(&*hole, 0, &points, 100.0), Ok(false));
        assert_eq!(depends_on_time(&*hole, 1, &points, 1.0), Ok(true));
    }
}
