//! Coordinates that do not move, that are copies of others, or that move uniformly.

use super::thresholds::{
    COPY_SAMPLES, GRID_ROUNDING, MOST_DECIMAL_PLACES, MOVING_SCATTER, ROUNDING_REMAINDER, SHOWN_TERM,
};
use crate::names::number;
use crate::recording::smooth::Smoothing;
use crate::recording::{RecordedTrajectory, Recording};

/// Why nothing can be learned about a coordinate.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Stillness {
    /// Its value is the same within every trajectory.
    Constant(f64),
    /// It scatters no more than its noise, of this standard deviation.
    Noise(f64),
    /// It equals this sum of other coordinates and a constant to within the noise.
    Copy(String),
}

impl std::fmt::Display for Stillness {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Constant(value) => write!(f, "does not move: it is {value} in every sample"),
            Self::Copy(sum) => write!(f, "follows from the other coordinates: it is {sum} plus a constant"),
            Self::Noise(sigma) if sigma.is_finite() => {
                write!(f, "does not move beyond its noise of {}", number(*sigma))
            }
            Self::Noise(_) => write!(f, "does not move beyond its noise"),
        }
    }
}

/// Returns the coordinates that do not move or are copies of others, in order, with the reasons.
pub fn stillness(recording: &Recording, smoothing: &Smoothing) -> Vec<(usize, Stillness)> {
    let alone = |i: usize| standing(recording, i, smoothing);
    let mut found: Vec<_> = (0..recording.n()).filter_map(|i| Some((i, alone(i)?))).collect();
    let moving: Vec<usize> = (0..recording.n()).filter(|i| found.iter().all(|(still, _)| still != i)).collect();
    found.extend(copies(recording, &moving, smoothing));
    found.sort_by_key(|(i, _)| *i);
    found
}

/// Tests whether coordinate `i` is motionless in all trajectories; `None` if it moves. Motion sampled too coarsely to be distinguished from
/// noise counts as motion.
fn standing(recording: &Recording, i: usize, smoothing: &Smoothing) -> Option<Stillness> {
    let n = recording.n();
    let values = |track: usize| recording.tracks[track].q.iter().skip(i).step_by(n);
    let tracks = 0..recording.tracks.len();
    let first = tracks.clone().find_map(|track| values(track).next())?;
    // A coordinate that changes only from one trajectory to the next does not move.
    if tracks.clone().all(|track| values(track).all(|x| Some(x) == values(track).next())) {
        return Some(Stillness::Constant(*first));
    }
    let noise = smoothing.coordinates.get(i)?.noise;
    // Overflowing squares cannot be compared.
    let still =
        noise.resolved && noise.sigma.is_finite() && scatter(recording, i, false) <= MOVING_SCATTER * noise.sigma;
    still.then_some(Stillness::Noise(noise.sigma))
}

/// `true` if coordinate `i` moves uniformly, or not at all, in every trajectory: it deviates from a straight line over time by no more
/// than its noise, or than the rounding of its digits.
pub fn is_uniform(recording: &Recording, i: usize, smoothing: &Smoothing) -> bool {
    let noise = smoothing.coordinates[i].noise;
    let noise = if noise.resolved { noise.sigma.max(rounding(recording, i)) } else { rounding(recording, i) };
    let deviation = scatter(recording, i, true);
    deviation <= MOVING_SCATTER * noise || deviation <= ROUNDING_REMAINDER * scatter(recording, i, false)
}

/// Standard deviation of the rounding of coordinate `i` to the digits after the point that all its values have; 0 of more than nine digits.
fn rounding(recording: &Recording, i: usize) -> f64 {
    let values = || recording.tracks.iter().flat_map(|track| track.q.iter().skip(i).step_by(recording.n()));
    let is_whole =
        |scale: f64| values().all(|x| (x * scale - (x * scale).round()).abs() <= GRID_ROUNDING * (x * scale).abs());
    let step = (0..=MOST_DECIMAL_PLACES).map(|digits| 10f64.powi(-digits)).find(|step| is_whole(step.recip()));
    step.map_or(0.0, |step| step / 12f64.sqrt())
}

/// Root mean square deviation of coordinate `i` from the mean of each trajectory, or from its regression line over time if `sloped`.
fn scatter(recording: &Recording, i: usize, sloped: bool) -> f64 {
    let (mut square, mut count) = (0.0, 0.0);
    for track in &recording.tracks {
        let samples = track.len() as f64;
        // Relative to the first sample, then to the mean, so that a large constant causes no rounding.
        let centred = |values: Vec<f64>| {
            let first = values.first().copied().unwrap_or_default();
            let mean = values.iter().map(|x| (x - first) / samples).sum::<f64>();
            values.into_iter().map(move |x| x - first - mean)
        };
        let values = track.q.iter().skip(i).step_by(recording.n()).copied().collect();
        let pairs: Vec<(f64, f64)> = centred(track.times.clone()).zip(centred(values)).collect();
        let (tx, tt) = pairs.iter().fold((0.0, 0.0), |(tx, tt), (t, x)| (tx + t * x, tt + t * t));
        let slope = if sloped && tt > 0.0 { tx / tt } else { 0.0 };
        square += pairs.iter().map(|(t, x)| (x - slope * t).powi(2)).sum::<f64>();
        count += samples;
    }
    (square / count).sqrt()
}

/// Coordinates among `moving` that are, up to a constant per trajectory and within the noise, linear functions of those before them:
/// found by modified Gram-Schmidt.
fn copies(recording: &Recording, moving: &[usize], smoothing: &Smoothing) -> Vec<(usize, Stillness)> {
    let n = recording.n();
    let stride = recording.samples().div_ceil(COPY_SAMPLES).max(1);
    let column = |i: usize| -> Vec<f64> {
        let centred = |track: &RecordedTrajectory| {
            let values: Vec<f64> = track.q.iter().skip(i).step_by(n * stride).copied().collect();
            let mean = values.iter().map(|x| x / values.len() as f64).sum::<f64>();
            values.into_iter().map(move |x| x - mean)
        };
        recording.tracks.iter().flat_map(centred).collect()
    };
    // Scaled by the largest value, so that no square overflows.
    let size = |values: &[f64]| {
        let most = values.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let mean = values.iter().map(|x| (x / most).powi(2)).sum::<f64>() / values.len() as f64;
        if most > 0.0 { most * mean.sqrt() } else { 0.0 }
    };
    // The residual of each coordinate, scaled by its size, and its coefficients over all coordinates.
    let mut kept: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    let mut found = Vec::new();
    for &i in moving {
        let (mut rest, mut coefficients) = (column(i), vec![0.0; n]);
        coefficients[i] = 1.0;
        let whole = size(&rest);
        for (other, combination) in &kept {
            let projection = rest.iter().zip(other).map(|(x, y)| x * y).sum::<f64>() / rest.len() as f64;
            rest.iter_mut().zip(other).for_each(|(x, y)| *x -= projection * y);
            coefficients.iter_mut().zip(combination).for_each(|(c, k)| *c -= projection * k);
        }
        let noises = coefficients.iter().zip(&smoothing.coordinates).filter(|(c, _)| **c != 0.0);
        let resolved = noises.clone().all(|(_, chosen)| chosen.noise.resolved);
        let noise = noises.map(|(c, chosen)| (c * chosen.noise.sigma).powi(2)).sum::<f64>().sqrt();
        let left = size(&rest);
        if left <= ROUNDING_REMAINDER * whole || (resolved && left <= MOVING_SCATTER * noise) {
            let terms = moving
                .iter()
                .filter(|k| **k != i && (coefficients[**k] * size(&column(**k))).abs() > SHOWN_TERM * whole);
            let terms: Vec<String> =
                terms.map(|k| format!("{} {}", number(-coefficients[*k]), recording.coordinates[*k])).collect();
            found.push((i, Stillness::Copy(terms.join(" + "))));
            continue;
        }
        rest.iter_mut().chain(&mut coefficients).for_each(|x| *x /= left);
        kept.push((rest, coefficients));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::smooth::SmoothOptions;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn both(motion: impl Fn(f64) -> f64, sigma: f64) -> (Option<Stillness>, bool) {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let times: Vec<f64> = (0..800).map(|k| 0.01 * f64::from(k)).collect();
        let q =
            times.iter().map(|t| motion(*t) + sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng)).collect();
        let track = RecordedTrajectory { name: "t".into(), times, q, v: vec![], a: vec![], force: vec![] };
        let recording = Recording { coordinates: vec!["x".into()], periodic: vec![false], tracks: vec![track] };
        let smoothing = Smoothing::choose(&recording, &SmoothOptions::default()).unwrap();
        (stillness(&recording, &smoothing).pop().map(|(_, how)| how), is_uniform(&recording, 0, &smoothing))
    }

    fn look(motion: impl Fn(f64) -> f64, sigma: f64) -> Option<Stillness> {
        both(motion, sigma).0
    }

    #[test]
    fn uniform_motion_differs_from_accelerated() {
        let uniform = |motion: fn(f64) -> f64, sigma: f64| both(motion, sigma).1;
        for sigma in [0.0, 1e-3] {
            assert!(uniform(|t| 0.3 - 0.7 * t, sigma) && uniform(|_| 0.3, sigma), "{sigma}");
            let accelerated: [fn(f64) -> f64; 3] =
                [|t| 0.01 * t * t, |t| (3.0 * t).sin(), |t| 2.0 * t + 0.02 * (20.0 * t).cos()];
            assert!(accelerated.iter().all(|motion| !uniform(*motion, sigma)), "{sigma}");
        }
        // Rounding to three digits, whose pattern repeats.
        let rounded = |motion: fn(f64) -> f64| both(move |t| (1e3 * motion(t)).round() / 1e3, 0.0).1;
        assert!(rounded(|t| 0.3 + 0.71 * t) && !rounded(|t| 0.3 + 0.71 * t + 0.01 * t * t));
        // Large noise does not hide larger motion, but all motion that is much smaller.
        assert!(!uniform(|t| (3.0 * t).sin(), 0.5) && uniform(|t| 1e-5 * t * t, 1e-3));
    }

    #[test]
    fn copies_are_found_in_any_combination_and_nothing_else_is() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut noise = |sigma: f64| sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng);
        let mut found = |sigma: f64, of: &dyn Fn(f64, usize) -> [f64; 4]| -> Vec<String> {
            let track = |k: usize| {
                let times: Vec<f64> = (0..600).map(|j| 0.01 * f64::from(j)).collect();
                let q = times.iter().flat_map(|t| of(*t, k)).map(|q| q + noise(sigma)).collect();
                RecordedTrajectory { name: k.to_string(), times, q, v: vec![], a: vec![], force: vec![] }
            };
            let tracks = (0..2).map(track).collect();
            let coordinates: Vec<String> = ["x", "y", "z", "w"].map(String::from).to_vec();
            let recording = Recording { coordinates, periodic: vec![false; 4], tracks };
            let smoothing = Smoothing::choose(&recording, &SmoothOptions::default()).unwrap();
            let still = stillness(&recording, &smoothing).into_iter();
            still.map(|(i, how)| format!("{}: {how}", recording.coordinates[i])).collect()
        };
        let wave = |t: f64, k: f64| (k * t).sin() + 0.3 * (1.7 * k * t).cos();
        for sigma in [0.0, 1e-3] {
            let [one] = &found(sigma, &|t, _| [wave(t, 3.0), 2.0 * wave(t, 3.0) + 1.0, wave(t, 2.0), wave(t, 4.0)])[..]
            else {
                panic!("one copy")
            };
            assert!(one.starts_with("y: ") && one.contains("2.00 x"), "{one}");
            // The sum of two others, with another constant in every trajectory.
            let sum =
                |t: f64, k: usize| [wave(t, 3.0), wave(t, 2.0), wave(t, 3.0) - wave(t, 2.0) + k as f64, wave(t, 4.0)];
            let [one] = &found(sigma, &sum)[..] else { panic!("one copy") };
            assert!(one.starts_with("z: ") && one.contains("1.00 x") && one.contains("-1.00 y"), "{one}");
            // Lines of other slopes in the other trajectory, and motion that comes from another by a curve.
            let free = |t: f64, k: usize| [t, (1.0 + k as f64) * t, wave(t, 3.0), wave(t, 3.0).sin()];
            assert_eq!(found(sigma, &free), [""; 0], "{sigma}");
        }
    }

    #[test]
    fn what_stands_still_is_told_from_what_moves() {
        assert_eq!(look(|_| 0.3, 0.0), Some(Stillness::Constant(0.3)));
        let Some(Stillness::Noise(sigma)) = look(|_| 5.0, 1e-3) else { panic!("noise moves nothing") };
        assert!((sigma / 1e-3 - 1.0).abs() < 0.1, "{sigma}");
        assert_eq!(look(|t| (3.0 * t).sin(), 0.1), None);
        assert_eq!(look(|t| 2e-3 * (3.0 * t).sin(), 1e-3), None);
        // Four samples a period.
        assert_eq!(look(|t| (157.0 * t).sin(), 0.0), None);
        assert_eq!(look(|t| 2.0 * t, 0.0), None);
    }
}
