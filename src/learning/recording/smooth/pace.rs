//! Windows that vary along a trajectory: shorter where the motion is fast, longer where it is slow.

use super::thresholds::{
    HOPELESS_SQUARED_ERROR, INDEPENDENT_PLACES, KEPT_SQUARED_ERROR, PLACES_PER_WINDOW, WINDOW_FACTORS,
};
use crate::recording::smooth::signal::{Fits, Signal};
use crate::recording::smooth::window::BiasBound;

/// A coordinate of one trajectory with its typical window in samples.
pub struct Typical<'a> {
    /// The coordinate on this trajectory, the only one of the signal.
    pub signal: Signal<'a>,
    /// Noise at every sample.
    pub sigmas: Vec<f64>,
    /// Length of the typical window in samples.
    pub window: usize,
    /// Root mean square error of its accelerations, the unit in which coordinates are compared.
    pub error: f64,
}

/// Window of `2^(k/3)` times the typical length, rounded to an odd number.
fn scaled(window: usize, k: f64) -> usize {
    ((window as f64 * (k / 3.0).exp2()).round() as usize) | 1
}

/// Errors of the accelerations for one window length, at places along the trajectory.
struct TriedWindow {
    first: usize,
    stride: usize,
    /// Variance, squared bias, and variance of the estimated change, at every place.
    squares: Vec<[f64; 3]>,
}

impl TriedWindow {
    /// Tries a window at evenly spaced samples; none if it is longer than half the trajectory, or too short for the polynomials.
    fn new(Typical { signal, sigmas, .. }: &Typical<'_>, window: usize) -> Option<Self> {
        let track = &signal.tracks[0];
        if window > track.len() / 2 || window < signal.degree + 3 {
            return None;
        }
        let (half, stride) = (window / 2, (window / PLACES_PER_WINDOW).max(1));
        let mut fits = Fits::default();
        let (mut excess, mut variance) = (Vec::new(), Vec::new());
        for at in (half..track.len() - half).step_by(stride) {
            let range = signal.window(0, at, window);
            let fit = signal.fit(&mut fits, 0, range.clone(), (at, window));
            let change = signal.estimate(fit, 0, range, at).changes[2];
            let noise = sigmas[at] * sigmas[at];
            excess.push(change * change - noise * fit.change_variance[2]);
            variance.push([fit.variance[2], fit.change_variance[2]].map(|variance| noise * variance));
        }
        // The change at one place is a single number, so it is averaged over a window on either side.
        let near = window / stride;
        let squares = (0..excess.len()).map(|k| {
            let part = &excess[k.saturating_sub(near)..(k + near + 1).min(excess.len())];
            let [noise, change] = variance[k];
            [noise, part.iter().sum::<f64>() / part.len() as f64, change]
        });
        Some(Self { first: half, stride, squares: squares.collect() })
    }

    /// Variance, squared bias, and variance of the estimated change, at the nearest place.
    fn at(&self, sample: usize) -> [f64; 3] {
        let place = sample.saturating_sub(self.first) / self.stride;
        self.squares[place.min(self.squares.len() - 1)]
    }
}

/// Windows of every coordinate at every sample of a trajectory, in samples, `(coordinates, samples)`.
///
/// At a sample all coordinates have their usual windows times one factor: the one whose accelerations have the least squared bias and
/// variance together there, a window to either side, coordinates in units of their usual error (the local choice of Fan and Gijbels, Local
/// Polynomial Modelling, 1996, section 4.3). Where the usual windows are nearly as good they are kept, so that motion of even pace has one
/// length. Factors are averaged over a quarter of the window to either side.
pub fn windows(usual: &[Typical<'_>]) -> Vec<Vec<usize>> {
    let Some(first) = usual.first() else { return Vec::new() };
    let track = &first.signal.tracks[0];
    let (length, least) = (track.len(), (first.signal.degree + 3) | 1);
    let most = (length - (length + 1) % 2).max(least);
    let of = |u: &Typical<'_>, k: f64| scaled(u.window, k).clamp(least, most);
    let compared: Vec<&Typical<'_>> = usual.iter().filter(|u| u.error > 0.0).collect();
    let tried: Vec<(i32, Vec<TriedWindow>)> = (WINDOW_FACTORS[0]..=WINDOW_FACTORS[1])
        .filter_map(|k| {
            // Windows are clamped to the smallest one; factors for which all would be below it are skipped.
            let shortest = compared.iter().any(|u| scaled(u.window, f64::from(k)) >= least);
            let all = compared.iter().map(|u| TriedWindow::new(u, of(u, f64::from(k)))).collect::<Option<Vec<_>>>()?;
            (shortest && !all.is_empty()).then_some((k, all))
        })
        .collect();
    let grid = (first.window / (4 * PLACES_PER_WINDOW)).max(1);
    let chosen: Vec<i32> = (0..length.div_ceil(grid)).map(|place| choose(&tried, &compared, place * grid)).collect();
    let factors: Vec<i32> = (0..length)
        .map(|sample| {
            let place = sample / grid;
            let reach = of(first, f64::from(chosen[place])) / (4 * grid);
            let near = &chosen[place.saturating_sub(reach)..(place + reach + 1).min(chosen.len())];
            // Rounded to half steps, so that only a few different windows are computed.
            (2.0 * near.iter().map(|&k| f64::from(k)).sum::<f64>() / near.len() as f64).round() as i32
        })
        .collect();
    usual.iter().map(|u| factors.iter().map(|&k| of(u, 0.5 * f64::from(k))).collect()).collect()
}

/// The factor at a sample.
fn choose(tried: &[(i32, Vec<TriedWindow>)], compared: &[&Typical<'_>], sample: usize) -> i32 {
    let mut squares: Vec<(i32, f64)> = Vec::with_capacity(tried.len());
    let mut best = f64::INFINITY;
    let mut bound = vec![BiasBound::default(); compared.len()];
    for (k, all) in tried {
        let errors = all.iter().zip(compared).zip(&mut bound).map(|((tried, usual), bound)| {
            let [variance, bias, change] = tried.at(sample);
            (variance + bound.bias([variance, bias], change, INDEPENDENT_PLACES)) / (usual.error * usual.error)
        });
        let square: f64 = errors.sum();
        if square > HOPELESS_SQUARED_ERROR * best {
            break;
        }
        best = best.min(square);
        squares.push((*k, square));
    }
    let of = |wanted: i32| squares.iter().find(|(k, _)| *k == wanted).map(|(_, square)| *square);
    if of(0).is_some_and(|square| square <= KEPT_SQUARED_ERROR * best) {
        return 0;
    }
    squares.iter().find(|(_, square)| *square == best).map_or(0, |(k, _)| *k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::RecordedTrajectory;
    use crate::recording::clock::Clock;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Windows of two coordinates at equal steps, `sin` and `2 cos` of a phase, with noise of 0.002 and 0.004.
    fn of_phase(phase: impl Fn(f64) -> f64, usual: usize) -> Vec<Vec<usize>> {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let times: Vec<f64> = (0..4000).map(|k| 0.01 * f64::from(k)).collect();
        let q = times.iter().flat_map(|t| [phase(*t).sin(), 2.0 * phase(*t).cos()]);
        let q: Vec<f64> = q.enumerate().map(|(k, x)| x + [0.002, 0.004][k % 2] * normal()).collect();
        let length = times.len();
        let track = RecordedTrajectory { name: "waves".into(), times, q, v: vec![], a: vec![], force: vec![] };
        let clocks = [Clock::of(&track.times)];
        let of = |i: usize| {
            let sigma = [0.002, 0.004][i];
            let tracks = std::slice::from_ref(&track);
            let signal = Signal { tracks, clocks: &clocks, n: 2, i, sigma, ratio: None, degree: 4 };
            Typical { signal, sigmas: vec![sigma; length], window: usual, error: 10.0 * sigma }
        };
        windows(&[of(0), of(1)])
    }

    #[test]
    fn windows_are_shorter_where_the_motion_is_faster() {
        // The pace grows from 1 to 9 per s.
        let found = of_phase(|t| t + 0.1 * t * t, 101);
        assert_eq!(found[0], found[1]);
        let middle = |range: std::ops::Range<usize>| {
            let mut part = found[0][range].to_vec();
            part.sort_unstable();
            part[part.len() / 2]
        };
        let (slow, fast) = (middle(200..800), middle(3200..3800));
        assert!(slow > 2 * fast && fast < 80, "{slow} {fast}");
        assert!(found[0].iter().all(|w| w % 2 == 1 && *w >= 7));
    }
}
