//! Correlated noise: its autocorrelation, estimated from the positions themselves.
//!
//! In fourth differences of samples `m` apart, the mean square of a smooth motion grows with `m^8`, that of white noise is the same at every
//! `m`, and that of noise with the autocorrelation `rho^k` is
//!
//! ```text
//! V(m) = gamma sum_j (-1)^j C(8, 4 + j) rho^(m |j|),    gamma the variance of the noise.
//! ```
//!
//! The distances `m` at which the noise is still visible separate the three.

use super::thresholds::{
    ALLOWED_MISFIT, COLOURED_MISFIT, COMPARED_DISTANCES, EXACT_ROUNDINGS, LEAST_DIFFERENCES, MOST_AUTOCORRELATION,
    MOST_MOTION_SQUARE,
};
use crate::recording::RecordedTrajectory;
use crate::recording::smooth::Noise;

/// Weights of a fourth difference, and the autocorrelations of its weights.
const DIFFERENCE: [f64; 5] = [1.0, -4.0, 6.0, -4.0, 1.0];
const PRODUCTS: [f64; 5] = [70.0, -56.0, 28.0, -8.0, 1.0];

/// Noise of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colour {
    /// Standard deviation.
    pub sigma: f64,
    /// Lag-1 autocorrelation.
    pub rho: f64,
    /// The largest variance that the differences allow, over the estimated one: at low frequencies, where the motion hides the noise, its
    /// spectrum is extrapolated from higher ones.
    pub slack: f64,
}

impl Default for Colour {
    fn default() -> Self {
        Self { sigma: 0.0, rho: 0.0, slack: 1.0 }
    }
}

impl Colour {
    /// Noise of coordinate `i`: white with the standard deviation of `white`, unless the differences clearly contradict that.
    pub fn of(tracks: &[RecordedTrajectory], n: usize, i: usize, white: Noise) -> Self {
        let plain = Self { sigma: white.sigma, ..Self::default() };
        let size = tracks
            .iter()
            .flat_map(|track| track.q.iter().skip(i).step_by(n))
            .fold(0.0, |most: f64, x| most.max(x.abs()));
        if !white.resolved || white.sigma <= EXACT_ROUNDINGS * f64::EPSILON * size {
            return plain;
        }
        let mut squares: Vec<(usize, f64, f64)> = Vec::new();
        for m in COMPARED_DISTANCES {
            let Some((square, count)) = differences(tracks, (n, i), m) else { break };
            if squares.first().is_some_and(|(_, first, _)| square > MOST_MOTION_SQUARE * first) {
                break;
            }
            squares.push((m, square, count));
        }
        if squares.len() < 3 {
            return plain;
        }
        let white_misfit = fitted(&squares, 0.0).0;
        let tried: Vec<(f64, f64, f64)> = (1..=(100.0 * MOST_AUTOCORRELATION) as u32)
            .map(|k| 0.01 * f64::from(k))
            .map(|rho| {
                let (misfit, gamma) = fitted(&squares, rho);
                (misfit, gamma, rho)
            })
            .collect();
        let Some(&(least, gamma, rho)) = tried.iter().min_by(|a, b| a.0.total_cmp(&b.0)) else { return plain };
        if white_misfit - least <= COLOURED_MISFIT || gamma.sqrt() <= white.sigma {
            return plain;
        }
        let most = tried
            .iter()
            .filter(|(misfit, ..)| *misfit <= least + ALLOWED_MISFIT)
            .fold(gamma, |most, tried| most.max(tried.1));
        Self { sigma: gamma.sqrt(), rho, slack: most / gamma }
    }

    /// Number of correlated samples that equal one independent sample in a mean square.
    pub fn shared(self) -> f64 {
        (1.0 + self.rho * self.rho) / (1.0 - self.rho * self.rho)
    }
}

/// Mean square of the fourth differences of samples `m` apart, and about how many of them are independent.
fn differences(tracks: &[RecordedTrajectory], (n, i): (usize, usize), m: usize) -> Option<(f64, f64)> {
    let (mut sum, mut count) = (0.0, 0);
    for track in tracks {
        for start in 0..track.len().saturating_sub(4 * m) {
            let x = |j: usize| track.q[(start + j * m) * n + i] - track.q[start * n + i];
            let difference: f64 = DIFFERENCE.iter().enumerate().map(|(j, weight)| weight * x(j)).sum();
            (sum, count) = (sum + difference * difference, count + 1);
        }
    }
    // White noise has differences whose squares are correlated over about three distances.
    (count >= LEAST_DIFFERENCES).then(|| (sum / count as f64, count as f64 / 3.0))
}

/// The misfit of the mean squares for noise with an autocorrelation plus a motion, in units of its standard deviation, and the variance.
fn fitted(squares: &[(usize, f64, f64)], rho: f64) -> (f64, f64) {
    let noise = |m: usize| {
        let far = (1..=4).map(|j| 2.0 * PRODUCTS[j] * rho.powi((m * j) as i32));
        PRODUCTS[0] + far.sum::<f64>()
    };
    let motion = |m: usize| (m as f64).powi(8);
    // Relative errors, by least squares in both variances, neither negative.
    let row = |&(m, square, count): &(usize, f64, f64)| {
        let unit = (0.5 * count).sqrt() / square;
        [noise(m) * unit, motion(m) * unit, square * unit]
    };
    let rows: Vec<[f64; 3]> = squares.iter().map(row).collect();
    let dot = |a: usize, b: usize| rows.iter().map(|row| row[a] * row[b]).sum::<f64>();
    let (aa, ab, bb, ay, by) = (dot(0, 0), dot(0, 1), dot(1, 1), dot(0, 2), dot(1, 2));
    let determinant = aa * bb - ab * ab;
    let both = ((ay * bb - by * ab) / determinant, (by * aa - ay * ab) / determinant);
    let (gamma, beta) = match both {
        (gamma, beta) if gamma > 0.0 && beta > 0.0 => (gamma, beta),
        _ if ay > 0.0 => (ay / aa, 0.0),
        _ => (0.0, by / bb),
    };
    let misfit = rows.iter().map(|row| (row[0] * gamma + row[1] * beta - row[2]).powi(2)).sum();
    (misfit, gamma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::smooth::noise as noise_alone;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn colour_is_seen_beside_motion_and_white_noise_has_none() {
        for seed in 0..4 {
            for rho in [0.0f64, 0.5, 0.9] {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
                let mut noise = normal();
                let tracks: Vec<RecordedTrajectory> = (0..10)
                    .map(|k| {
                        let times: Vec<f64> = (0..300).map(|j| 0.01 * f64::from(j)).collect();
                        let q = times.iter().map(|t| {
                            noise = rho * noise + (1.0 - rho * rho).sqrt() * normal();
                            (2.0 * t + f64::from(k)).sin() + 0.01 * noise
                        });
                        let q = q.collect();
                        RecordedTrajectory { name: String::new(), times, q, v: vec![], a: vec![], force: vec![] }
                    })
                    .collect();
                let white = noise_alone(tracks.iter().map(|t| (t.times.as_slice(), t.q.as_slice())), 1, 0);
                let found = Colour::of(&tracks, 1, 0, white);
                // Correlated noise is hidden by slow motion.
                assert!((found.rho - rho).abs() < 0.1 && found.slack.sqrt() * found.sigma > 0.0095, "{rho}: {found:?}");
                assert!(rho > 0.5 || (found.sigma / 0.01 - 1.0).abs() < 0.15, "{rho}: {found:?}");
                assert!(rho > 0.0 || found.slack == 1.0, "{rho}: {found:?}");
            }
        }
    }
}
