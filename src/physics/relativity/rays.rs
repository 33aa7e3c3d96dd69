//! Null geodesics in batches: each ray has its own steps, and one call per stage evaluates all rays of a batch.
//!
//! The steps are those of the embedded Runge-Kutta method 5(4) of Dormand and Prince. Source: Dormand and Prince, J. Comput. Appl. Math. 6, 19 (1980), table 2; the last stage is the first of the next step.

use super::camera::Camera;
use super::coordinates::Chart;
use super::orbits::{along, dot, norm, scaled};
use super::thresholds::{
    BEYOND_SKY, BLOCK_SIZES, FIRST_RAY_STEP, LONGEST_RAY_STEP, RAY_BLOCKS, SHORTEST_RAY_STEP, STEP_CHANGES,
    STEP_SAFETY, TOLERANCES,
};
use super::two_sided::beyond;
use super::{RelativityError, expect};
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use crate::storage::in_order;

/// End of a ray that was followed backwards in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RayOutcome {
    /// It piled up at a horizon: no light comes this way.
    Captured,
    /// It came from far away: the place on the sky, a unit vector of space.
    Escaped([f64; 3]),
    /// It came from far away in the second region of a metric with [two sides](super::TwoSided): the place on the sky there.
    Crossed([f64; 3]),
    /// It did not end within the allowed steps, or it reached a point where the metric is invalid.
    Unfinished,
}

impl RayOutcome {
    /// The point of the sky that a ray comes from, with the index of the sky: 0, or 1 for that of the second region.
    pub(super) fn sky(self) -> Option<(usize, [f64; 3])> {
        match self {
            Self::Escaped(place) => Some((0, place)),
            Self::Crossed(place) => Some((1, place)),
            Self::Captured | Self::Unfinished => None,
        }
    }
}

/// A ray that has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// How the ray ended.
    pub fate: RayOutcome,
    /// Steps taken, rejected ones included.
    pub steps: usize,
    /// `g(k, k)` at the end over the sum of the sizes of its terms; 0 of a light ray.
    pub drift: f64,
}

/// Choices of ray tracing.
///
/// | name | default | purpose | range |
/// |---|---|---|---|
/// | `tolerance` | 1e-6 | relative error of place and tangent in a step | 1e-12 to 0.01 |
/// | `far` | twice the distance of the camera | distance from which on a ray that leaves has escaped | above 0 |
/// | `second` | 0 | distance from the origin within which a ray that approaches it has escaped to the second region; 0: there is none | at least 0 |
/// | `capture` | 0 | distance within which a ray is captured in any case | at least 0 |
/// | `growth` | 1e5 | growth of the Euclidean length of `k` at which a ray is captured | above 1 |
/// | `most_steps` | 2000 | steps after which a ray is left unfinished | above 0 |
/// | `threads` | 1 | threads; no result depends on them | above 0 |
///
/// A ray that is followed backwards to a future horizon does not reach it: in coordinates that are regular there, those of Kerr and Schild,
/// it comes nearer and nearer while `dt` grows beyond all bounds within a finite affine parameter, `|k|` as the inverse of the distance
/// from the horizon. A ray that turns around does so outside the orbit of light, with a growth of a few, and of more the nearer that orbit
/// is to the horizon: close to the largest spins the edge of the shadow needs a larger `growth`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracing {
    /// Relative error of a step.
    pub tolerance: f64,
    /// Distance of the sky.
    pub far: f64,
    /// Distance of the second sky from the origin.
    pub second: f64,
    /// Distance of capture.
    pub capture: f64,
    /// Growth of `|k|` at capture.
    pub growth: f64,
    /// Most steps.
    pub most_steps: usize,
    /// Threads.
    pub threads: usize,
}

impl Tracing {
    /// The defaults for a camera, with the sky of a [learned](Camera::sky_of_learned) metric.
    pub fn of(camera: &Camera) -> Self {
        let far = camera.sky_of_learned();
        Self { tolerance: 1e-6, far, second: 0.0, capture: 0.0, growth: 1e5, most_steps: 2000, threads: 1 }
    }

    /// Refuses numbers out of range. Rounding dominates finer steps, and coarser ones do not follow geodesics.
    fn check(&self) -> Result<(), RelativityError> {
        let finite_above = |x: f64, least: f64| x.is_finite() && x > least;
        let (least, most) = TOLERANCES;
        expect((least..=most).contains(&self.tolerance), "tolerance", "1e-12 to 0.01", self.tolerance)?;
        expect(finite_above(self.far, 0.0), "far distance", "a finite number above 0", self.far)?;
        expect(self.second >= 0.0, "distance of the second sky", "at least 0", self.second)?;
        expect(self.capture >= 0.0, "distance of capture", "at least 0", self.capture)?;
        expect(self.growth > 1.0, "growth at capture", "above 1", self.growth)
    }
}

/// Follows rays from events with tangents `k`, `(4)` each, along which the affine parameter grows; the order is kept.
///
/// `progress` receives the number of rays of every finished block, from any thread. Rays that had not ended when the model was interrupted
/// are unfinished.
///
/// # Errors
/// [`RelativityError`] for choices out of range and for refusals of the model other than for single states.
pub fn trace(
    model: &dyn EulerLagrange<f64>,
    chart: &Chart,
    starts: &[([f64; 4], [f64; 4])],
    tracing: &Tracing,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Ray>, RelativityError> {
    trace_each(model, chart, starts.len(), &|k| starts[k], tracing, progress)
}

/// [`trace`] of starts that are made when they are needed.
pub(super) fn trace_each(
    model: &dyn EulerLagrange<f64>,
    chart: &Chart,
    count: usize,
    start: &(dyn Fn(usize) -> ([f64; 4], [f64; 4]) + Sync),
    tracing: &Tracing,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Ray>, RelativityError> {
    tracing.check()?;
    chart.check(model.coordinates())?;
    let block = count.div_ceil(RAY_BLOCKS).clamp(BLOCK_SIZES.0, BLOCK_SIZES.1);
    let blocks: Vec<usize> = (0..count).step_by(block).collect();
    let traced = in_order(&blocks, tracing.threads, |&first| {
        let starts: Vec<_> = (first..count.min(first + block)).map(start).collect();
        let rays = Batch { model, chart, tracing, terms: Terms::default() }.trace(&starts);
        progress(starts.len());
        rays
    });
    let mut rays = Vec::with_capacity(count);
    for block in traced {
        rays.extend(block?);
    }
    Ok(rays)
}

/// A ray that is still followed.
#[derive(Clone, Copy)]
struct ActiveRay {
    /// Place in the batch.
    index: usize,
    q: [f64; 4],
    k: [f64; 4],
    /// Derivative of `k` by the affine parameter.
    a: [f64; 4],
    step: f64,
    /// `|k|` at the start.
    size: f64,
    steps: usize,
    /// `true` after a step that was refused.
    refused: bool,
}

/// A ray that has ended, with its last state.
#[derive(Clone, Copy)]
struct FinishedRay {
    fate: RayOutcome,
    steps: usize,
    q: [f64; 4],
    k: [f64; 4],
}

/// Rays that share their calls of the model.
struct Batch<'a> {
    model: &'a dyn EulerLagrange<f64>,
    chart: &'a Chart,
    tracing: &'a Tracing,
    terms: Terms<f64>,
}

impl Batch<'_> {
    /// Accelerations of states, each `NaN` where the metric is invalid.
    fn accelerations(&mut self, q: &[[f64; 4]], k: &[[f64; 4]], to: &mut Vec<[f64; 4]>) -> Result<(), RelativityError> {
        let outcome = self.model.terms(q.as_flattened(), k.as_flattened(), Request::ACCELERATION, &mut self.terms);
        let (found, []) = self.terms.acceleration.as_chunks::<4>() else { return Err(no_accelerations(outcome)) };
        match outcome {
            Ok(()) | Err(MechanicsError::Singular { .. } | MechanicsError::NotFinite { .. })
                if found.len() == q.len() =>
            {
                to.clear();
                to.extend_from_slice(found);
                Ok(())
            }
            other => Err(no_accelerations(other)),
        }
    }

    fn trace(mut self, starts: &[([f64; 4], [f64; 4])]) -> Result<Vec<Ray>, RelativityError> {
        let nowhere = FinishedRay { fate: RayOutcome::Unfinished, steps: 0, q: [f64::NAN; 4], k: [f64::NAN; 4] };
        let mut ended = vec![nowhere; starts.len()];
        match self.follow(starts, &mut ended) {
            // The rays that have ended are there, the others are unfinished.
            Ok(()) | Err(RelativityError::Mechanics(MechanicsError::Interrupted)) => self.finish(&ended),
            Err(error) => Err(error),
        }
    }

    fn follow(&mut self, starts: &[([f64; 4], [f64; 4])], ended: &mut [FinishedRay]) -> Result<(), RelativityError> {
        let (mut q, mut k): (Vec<_>, Vec<_>) = starts.iter().copied().unzip();
        let (mut places, mut tangents) = (Vec::new(), vec![Vec::new(); STAGES]);
        let mut slopes: Vec<Vec<[f64; 4]>> = vec![Vec::new(); STAGES];
        self.accelerations(&q, &k, &mut slopes[0])?;
        let mut active: Vec<ActiveRay> = Vec::with_capacity(starts.len());
        for (index, ((&q, &k), &a)) in q.iter().zip(&k).zip(&slopes[0]).enumerate() {
            let distance = norm(self.chart.space_of(q));
            let step = FIRST_RAY_STEP * distance / norm(self.chart.space_of(k));
            active.push(ActiveRay { index, q, k, a, step, size: norm(k), steps: 0, refused: false });
        }
        self.move_finished(&mut active, ended);
        while !active.is_empty() {
            active.iter_mut().for_each(|ray| ray.step = ray.step.min(self.longest(ray)));
            tangents[0].clear();
            tangents[0].extend(active.iter().map(|ray| ray.k));
            slopes[0].clear();
            slopes[0].extend(active.iter().map(|ray| ray.a));
            for (stage, row) in A.iter().enumerate() {
                q.clear();
                k.clear();
                for (at, ray) in active.iter().enumerate() {
                    let (mut place, mut tangent) = (ray.q, ray.k);
                    for (j, a) in row[..=stage].iter().enumerate().filter(|(_, a)| **a != 0.0) {
                        place = along(place, ray.step * a, tangents[j][at]);
                        tangent = along(tangent, ray.step * a, slopes[j][at]);
                    }
                    q.push(place);
                    k.push(tangent);
                }
                self.accelerations(&q, &k, &mut slopes[stage + 1])?;
                tangents[stage + 1].clone_from(&k);
            }
            places.clone_from(&q);
            for (at, ray) in active.iter_mut().enumerate() {
                let of = |from: &[Vec<[f64; 4]>]| {
                    ERROR.iter().zip(from).fold([0.0; 4], |sum, (e, stage)| along(sum, ray.step * e, stage[at]))
                };
                let (place, tangent) = (of(&tangents), of(&slopes));
                let distance = norm(self.chart.space_of(ray.q)).max(norm(self.chart.space_of(places[at])));
                let size = norm(ray.k).max(norm(k[at]));
                let error =
                    (norm(self.chart.space_of(place)) / distance).max(norm(tangent) / size) / self.tracing.tolerance;
                let fine = error.is_finite() && distance.is_finite() && size.is_finite();
                let change = if fine { STEP_SAFETY * error.powf(-0.2) } else { STEP_CHANGES.0 };
                ray.steps += 1;
                if fine && error <= 1.0 {
                    (ray.q, ray.k, ray.a) = (places[at], k[at], slopes[STAGES - 1][at]);
                    ray.step *= change.clamp(STEP_CHANGES.0, if ray.refused { 1.0 } else { STEP_CHANGES.1 });
                } else {
                    ray.step *= change.clamp(STEP_CHANGES.0, STEP_SAFETY);
                }
                ray.refused = !(fine && error <= 1.0);
            }
            self.move_finished(&mut active, ended);
        }
        Ok(())
    }

    /// Longest step: in proportion to the distance from the centre, and hardly beyond the distance of the sky.
    fn longest(&self, ray: &ActiveRay) -> f64 {
        let (place, tangent) = (self.chart.space_of(ray.q), self.chart.space_of(ray.k));
        let (distance, speed, far) = (norm(place), norm(tangent), self.tracing.far);
        let toward = dot(place, tangent) / speed;
        let room = toward * toward + far * far - distance * distance;
        let most =
            if distance < far { (room.sqrt() - toward) * (1.0 + BEYOND_SKY) + BEYOND_SKY * far } else { f64::INFINITY };
        most.min(LONGEST_RAY_STEP * distance) / speed
    }

    /// Moves the rays that have ended from `active` to `ended`.
    fn move_finished(&self, active: &mut Vec<ActiveRay>, ended: &mut [FinishedRay]) {
        active.retain(|ray| {
            let Some(fate) = self.fate(ray) else { return true };
            ended[ray.index] = FinishedRay { fate, steps: ray.steps, q: ray.q, k: ray.k };
            false
        });
    }

    /// How the ray ended, if it has.
    fn fate(&self, ray: &ActiveRay) -> Option<RayOutcome> {
        let (place, tangent) = (self.chart.space_of(ray.q), self.chart.space_of(ray.k));
        let (distance, speed) = (norm(place), norm(tangent));
        if distance < self.tracing.capture || norm(ray.k) > self.tracing.growth * ray.size {
            return Some(RayOutcome::Captured);
        }
        if distance >= self.tracing.far && dot(place, tangent) > 0.0 {
            return Some(RayOutcome::Escaped(scaled(speed.recip(), tangent)));
        }
        if distance <= self.tracing.second && dot(place, tangent) < 0.0 {
            return Some(RayOutcome::Crossed(beyond(place, tangent)));
        }
        let stuck = ray.step * speed < SHORTEST_RAY_STEP * distance
            || !ray.step.is_finite()
            || ray.a.iter().any(|a| !a.is_finite());
        (stuck || ray.steps >= self.tracing.most_steps).then_some(RayOutcome::Unfinished)
    }

    /// The rays, each with the drift of `g(k, k)`.
    fn finish(mut self, ended: &[FinishedRay]) -> Result<Vec<Ray>, RelativityError> {
        let (q, k): (Vec<_>, Vec<_>) = ended.iter().map(|ray| (ray.q, ray.k)).unzip();
        match self.model.terms(q.as_flattened(), k.as_flattened(), Request::MASS_MATRIX, &mut self.terms) {
            Ok(()) => {}
            Err(MechanicsError::Singular { .. } | MechanicsError::NotFinite { .. } | MechanicsError::Interrupted) => {}
            Err(error) => return Err(error.into()),
        }
        let metrics = self.terms.mass_matrix.chunks_exact(16).map(Some).chain(std::iter::repeat(None));
        let drift = |metric: &[f64], k: [f64; 4]| {
            let terms = || (0..16).map(|at| metric[at] * k[at / 4] * k[at % 4]);
            terms().sum::<f64>().abs() / terms().map(f64::abs).sum::<f64>()
        };
        let ray = |(ray, metric): (&FinishedRay, Option<&[f64]>)| Ray {
            fate: ray.fate,
            steps: ray.steps,
            drift: metric.map_or(f64::NAN, |metric| drift(metric, ray.k)),
        };
        Ok(ended.iter().zip(metrics).map(ray).collect())
    }
}

/// The model's refusal, or one for accelerations that it did not give.
fn no_accelerations(outcome: Result<(), MechanicsError>) -> RelativityError {
    match outcome {
        Err(error) => error.into(),
        Ok(()) => MechanicsError::NotFinite { row: 0, what: "acceleration" }.into(),
    }
}

/// Number of stages.
const STAGES: usize = 7;

/// `a_ij`, row by row from the second stage on; the last row has the weights of order 5.
pub(super) const A: [[f64; STAGES - 1]; STAGES - 1] = [
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];

/// Weights of order 5 less those of order 4.
const ERROR: [f64; STAGES] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];

#[cfg(test)]
mod tests {
    use super::*;

    /// Row sums are the nodes, the weights integrate powers up to the fourth, and the error is 0 up to the third, not beyond.
    #[test]
    fn the_table_is_of_its_order() {
        let nodes: Vec<f64> = [0.0].into_iter().chain(A.iter().map(|row| row.iter().sum())).collect();
        for (found, exact) in nodes.iter().zip([0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0]) {
            assert!((found - exact).abs() < 1e-14);
        }
        for power in 0..5 {
            let moment = |weights: &[f64]| -> f64 { weights.iter().zip(&nodes).map(|(b, c)| b * c.powi(power)).sum() };
            assert!((moment(&A[5]) - 1.0 / f64::from(power + 1)).abs() < 1e-14, "{power}");
            let error = moment(&ERROR);
            assert!(if power < 4 { error.abs() < 1e-15 } else { error.abs() > 1e-4 }, "{power}: {error}");
        }
    }
}
