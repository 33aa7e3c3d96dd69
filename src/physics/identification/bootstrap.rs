//! Standard errors of constants that are fitted to forces, by a parametric bootstrap.
//!
//! Neighbouring smoothed accelerations have correlated errors and are regressors themselves, so that the standard errors of least squares are
//! several times too small, and some bias remains. The recording is therefore simulated. Polynomials of a higher degree give the true motion, and
//! the fitted constants the true forces along it. New noise of encoders and forces is drawn, and every copy is smoothed and fitted again. The mean
//! change of the constants is their bias, which is subtracted; their scatter is the standard error (Efron and Tibshirani, An Introduction to the
//! Bootstrap, 1993, sections 6.5 and 10.2). The residuals of the copies show how large the residuals of a right model are at every sample.

use super::covariance::Root;
use super::follow::Follower;
use super::smoothed::{Quantity, States};
use super::solve::Problem;
use super::thresholds::{COPIES, LANES, MORE_DEGREES, MOST_DRIFT};
use crate::linalg::dot;
use crate::random::{RandomGenerator, RngStream};
use crate::recording::smooth::{SmoothOptions, Smoothed, Smoothing, noise};
use crate::recording::{RecordedTrajectory, Recording, deviation, marks, rms};
use rand_distr::{Distribution, StandardNormal};

/// Results of fitting simulated copies of the recording.
pub(super) struct Copies {
    /// Constants fitted to each copy.
    constants: Vec<Vec<f64>>,
    /// Force residuals of each copy at each sample, `(samples, n)` per trajectory; `NaN` at samples that are not fitted.
    residuals: Vec<Vec<Vec<f64>>>,
}

/// The smoothing that gives the motion of the copies; `None` if the recording cannot be smoothed by polynomials of a higher degree.
pub(super) fn wider_smoothing(recording: &Recording, smoothing: &Smoothing) -> Option<Smoothing> {
    let given = smoothing.coordinates.iter().map(|chosen| chosen.noise.sigma).collect();
    let options =
        SmoothOptions { degree: smoothing.degree + MORE_DEGREES, noise: Some(given), ..SmoothOptions::default() };
    Smoothing::choose(recording, &options).ok()
}

/// Simulates and fits copies of the recording; `None` if one of them fails.
///
/// `sizes` are the sizes of the residuals, which bound the noise of the forces. `share` gives the weights of equations in averages.
pub(super) fn copies(
    problem: &Problem<'_>,
    [smoothing, wider]: [&Smoothing; 2],
    (states, x, sizes): (&States, &[f64], &[f64]),
    share: &(impl Fn(&States) -> Vec<f64> + Sync),
) -> Option<Copies> {
    let recording = problem.driven.recording;
    let n = recording.n();
    let tracks = || recording.tracks.iter().map(|track| (track.times.as_slice(), track.force.as_slice()));
    let of_force: Vec<f64> = (0..n).map(|i| noise(tracks(), n, i).sigma.min(sizes[i])).collect();
    let truth: Vec<Option<(Smoothed, Vec<f64>)>> = recording
        .tracks
        .iter()
        .enumerate()
        .map(|(at, track)| {
            let mut motion = wider.apply(track).ok()?;
            integrate(&mut motion, n);
            let force = required_forces(problem, (states, x), (at, &motion));
            Some((motion, force))
        })
        .collect();
    let marks: Vec<Option<f64>> = (0..n).map(|i| marks(recording, i)).collect();
    let one = |copy: usize| {
        let mut rng = RngStream::Copies.generator(copy as u64);
        let again = |(track, truth): (&RecordedTrajectory, &Option<(Smoothed, Vec<f64>)>)| match truth {
            Some((motion, force)) => with_new_noise(track, motion, force, (smoothing, &of_force, &marks), &mut rng),
            None => track.clone(),
        };
        let tracks = recording.tracks.iter().zip(&truth).map(again).collect();
        let copied = Recording { tracks, ..recording.clone() };
        let smooth = |(track, truth): (&RecordedTrajectory, &Option<_>)| {
            truth.as_ref().and_then(|_| smoothing.apply(track).ok())
        };
        let smoothed: Vec<Option<Smoothed>> = copied.tracks.iter().zip(&truth).map(smooth).collect();
        let mut driven = problem.driven.clone();
        driven.recording = &copied;
        let problem = Problem { driven, ..problem.clone() };
        let (averaged, units) = (states.averaged, states.units.clone());
        let mut own = States { averaged, units, ..States::new(&problem, &smoothed) };
        own.share = share(&own);
        let weights = states.weight.iter().take(n).copied().collect::<Vec<_>>();
        own.weight = (0..own.places.len() * n).map(|at| weights[at % n]).collect();
        let mut constants = x.to_vec();
        own.fit(&problem, &mut constants, Quantity::Forces);
        let mut residuals: Vec<Vec<f64>> = recording.tracks.iter().map(|t| vec![f64::NAN; t.len() * n]).collect();
        let [_, found] = own.force_residuals(&problem, &constants);
        for ((track, sample), row) in own.places.iter().zip(found.chunks_exact(n)) {
            residuals[*track][sample * n..(sample + 1) * n].copy_from_slice(row);
        }
        (constants, residuals)
    };
    let numbers: Vec<usize> = (0..COPIES).collect();
    let share = COPIES.div_ceil(problem.threads.max(1));
    let found: Vec<(Vec<f64>, Vec<Vec<f64>>)> = std::thread::scope(|scope| {
        let one = &one;
        let parts: Vec<_> = numbers
            .chunks(share)
            .map(|part| scope.spawn(move || part.iter().map(|&k| one(k)).collect::<Vec<_>>()))
            .collect();
        parts.into_iter().flat_map(|part| part.join().unwrap_or_default()).collect()
    });
    let (constants, residuals): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    (constants.len() == COPIES).then_some(Copies { constants, residuals })
}

/// Replaces velocities and positions by integrals of the accelerations, which are interpolated linearly between the samples. Without this they
/// would not be consistent, because derivatives by local polynomials are not the derivatives of the smoothed positions. The initial state is the
/// one that fits the positions best. A coordinate whose integral drifts too far stays unchanged.
fn integrate(motion: &mut Smoothed, n: usize) {
    let count = motion.times.len();
    for i in 0..n {
        let (mut q, mut v) = (vec![0.0; count], vec![0.0; count]);
        for k in 1..count {
            let h = motion.times[k] - motion.times[k - 1];
            let [before, after] = [k - 1, k].map(|k| motion.a[k * n + i]);
            v[k] = v[k - 1] + h * (before + after) / 2.0;
            q[k] = q[k - 1] + h * v[k - 1] + h * h * (2.0 * before + after) / 6.0;
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / count as f64;
        let positions: Vec<f64> = motion.q.iter().skip(i).step_by(n).copied().collect();
        let off: Vec<f64> = positions.iter().zip(&q).map(|(position, q)| position - q).collect();
        let (middle, level) = (mean(&motion.times), mean(&off));
        let times = || motion.times.iter().map(|t| t - middle);
        let slope = times().zip(&off).map(|(t, off)| t * off).sum::<f64>() / times().map(|t| t * t).sum::<f64>();
        let drift = rms(times().zip(&off).map(|(t, off)| off - level - slope * t));
        if drift > MOST_DRIFT * deviation(positions.iter()) {
            continue;
        }
        let lines: Vec<f64> = times().map(|t| level + slope * t).collect();
        for (k, ((q, v), line)) in q.iter().zip(&v).zip(&lines).enumerate() {
            motion.q[k * n + i] = q + line;
            motion.v[k * n + i] = v + slope;
        }
    }
}

/// The forces that a motion requires, `(samples, n)`; under constraints, the part that the constraints cannot balance.
fn required_forces(
    problem: &Problem<'_>,
    (states, x): (&States, &[f64]),
    (track, motion): (usize, &Smoothed),
) -> Vec<f64> {
    let (n, values) = (problem.driven.equations.n, problem.parameters(x));
    let mut follower = Follower::new(&problem.driven);
    let mut force = vec![0.0; motion.q.len()];
    let mut scratch = vec![0.0; LANES * n];
    for first in (0..force.len()).step_by(LANES * n) {
        let range = first..(first + LANES * n).min(force.len());
        follower.at(motion.times[first / n..range.end / n].iter().map(|t| (track, *t)));
        follower.accelerate(
            &values,
            (&motion.q[range.clone()], &motion.v[range.clone()]),
            &[],
            &mut scratch[..range.len()],
        );
        let found = &mut force[range.clone()];
        follower.unbalanced_forces(&motion.a[range], found);
        states.with_free_part(&follower, |free| free.project_all(found, 1));
    }
    // Without known forces, the residual is the required force with the opposite sign.
    force.iter_mut().for_each(|f| *f = -*f);
    force
}

/// A trajectory with new noise.
fn with_new_noise(
    track: &RecordedTrajectory,
    motion: &Smoothed,
    force: &[f64],
    (smoothing, of_force, marks): (&Smoothing, &[f64], &[Option<f64>]),
    rng: &mut RandomGenerator,
) -> RecordedTrajectory {
    let n = of_force.len();
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let mut copy = track.clone();
    for at in 0..track.q.len() {
        let chosen = &smoothing.coordinates[at % n];
        let mut noise = |sigma: f64| sigma * normal();
        copy.q[at] = match marks[at % n] {
            // Quantization is part of the noise, and contributes little if the motion is slow.
            Some(mark) => {
                let other = (chosen.noise.sigma.powi(2) - mark * mark / 12.0).max(0.0).sqrt();
                mark * ((motion.q[at] + noise(other)) / mark).round()
            }
            None => motion.q[at] + noise(chosen.noise.sigma),
        };
        if let (Some(noise), Some(v)) = (chosen.velocity_noise, copy.v.get_mut(at)) {
            *v = motion.v[at] + noise.sigma * normal();
        }
        if let Some(f) = copy.force.get_mut(at) {
            *f = force[at] + of_force[at % n] * normal();
        }
    }
    copy
}

impl Copies {
    /// The bias of the constants, and their covariance in the directions of the root of the normal matrix.
    pub fn bias(&self, root: &Root, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (m, count, copies) = (x.len(), root.forward.len(), self.constants.len() as f64);
        let change = |constants: &Vec<f64>| {
            let change: Vec<f64> = constants.iter().zip(x).map(|(a, b)| a - b).collect();
            root.forward.iter().map(|row| dot(row, &change)).collect::<Vec<f64>>()
        };
        let changes: Vec<Vec<f64>> = self.constants.iter().map(change).collect();
        let mean: Vec<f64> = (0..count).map(|k| changes.iter().map(|c| c[k]).sum::<f64>() / copies).collect();
        // The variance of a new draw about the mean of a few copies, estimated from a few copies.
        let factor = (1.0 + 1.0 / copies) / (copies - 3.0);
        // A few copies do not determine the correlations of many constants, which are therefore shrunk.
        let kept = copies / (copies + count as f64);
        let covariance = |at: usize| {
            let (i, j) = (at / count, at % count);
            let sum: f64 = changes.iter().map(|c| (c[i] - mean[i]) * (c[j] - mean[j])).sum();
            factor * sum * if i == j { 1.0 } else { kept }
        };
        let bias = (0..m).map(|k| root.back.iter().zip(&mean).map(|(row, x)| x * row[k]).sum()).collect();
        (bias, (0..count * count).map(covariance).collect())
    }

    /// Mean square of the residual of coordinate `i` at every place, `(places)`; 0 if too few copies have a residual there.
    pub fn squares(&self, places: &[(usize, usize)], (n, i): (usize, usize)) -> Vec<f64> {
        let at = |&(track, sample): &(usize, usize)| {
            let own = self.residuals.iter().map(|copy| copy[track][sample * n + i]).filter(|r| r.is_finite());
            let (sum, count) = own.fold((0.0, 0.0), |(sum, count), r| (sum + r * r, count + 1.0));
            // The expected inverse of a mean square of a few numbers is larger than the inverse of its expectation.
            if count > 2.0 { sum / (count - 2.0) } else { 0.0 }
        };
        places.iter().map(at).collect()
    }

    /// Residuals of coordinate `i` of one copy at every place.
    pub fn residuals(&self, copy: usize, places: &[(usize, usize)], (n, i): (usize, usize)) -> Vec<f64> {
        places.iter().map(|&(track, sample)| self.residuals[copy][track][sample * n + i]).collect()
    }
}
