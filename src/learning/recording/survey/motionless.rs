//! Coordinates that stand still.

use crate::names::number;
use crate::recording::Recording;
use crate::recording::smooth::Smoothing;

/// Samples scatter by so many standard deviations of the noise at least where something moves.
const MOVES: f64 = 1.2;

/// Way in which a coordinate stands still.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Stillness {
    /// It keeps one value in every trajectory.
    Constant(f64),
    /// It does not scatter more than its noise, of this standard deviation.
    Noise(f64),
}

impl std::fmt::Display for Stillness {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Constant(value) => write!(f, "does not move: it is {value} in every sample"),
            Self::Noise(sigma) => write!(f, "does not move beyond its noise of {}", number(*sigma)),
        }
    }
}

/// Stillness of coordinate `i` in all trajectories; none if it moves. Motion sampled too coarsely to be told from noise may
/// move.
pub fn stillness(recording: &Recording, i: usize, smoothing: &Smoothing) -> Option<Stillness> {
    let n = recording.n();
    let values = |track: usize| recording.tracks[track].q.iter().skip(i).step_by(n);
    let tracks = 0..recording.tracks.len();
    let first = tracks.clone().find_map(|track| values(track).next())?;
    // A coordinate that differs from one trajectory to the next moves in none of them.
    if tracks.clone().all(|track| values(track).all(|x| Some(x) == values(track).next())) {
        return Some(Stillness::Constant(*first));
    }
    let noise = smoothing.coordinates.get(i)?.noise;
    let (mut square, mut count) = (0.0, 0.0);
    for track in tracks {
        let samples = values(track).count() as f64;
        let mean = values(track).map(|x| x / samples).sum::<f64>();
        square += values(track).map(|x| (x - mean).powi(2)).sum::<f64>();
        count += samples;
    }
    let still = noise.resolved && (square / count).sqrt() <= MOVES * noise.sigma;
    still.then_some(Stillness::Noise(noise.sigma))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::RecordedTrajectory;
    use crate::recording::smooth::SmoothOptions;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn look(motion: impl Fn(f64) -> f64, sigma: f64) -> Option<Stillness> {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let times: Vec<f64> = (0..800).map(|k| 0.01 * f64::from(k)).collect();
        let q =
            times.iter().map(|t| motion(*t) + sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng)).collect();
        let track = RecordedTrajectory { name: "t".into(), times, q, v: vec![], a: vec![], force: vec![] };
        let recording = Recording { coordinates: vec!["x".into()], periodic: vec![false], tracks: vec![track] };
        let smoothing = Smoothing::choose(&recording, &SmoothOptions::default()).unwrap();
        stillness(&recording, 0, &smoothing)
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
