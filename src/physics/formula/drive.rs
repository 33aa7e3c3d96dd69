//! Frequencies of a periodic drive, found in the residuals of libraries without one.
//!
//! The weak form of a library leaves a mean acceleration in every window. A drive shows in the residuals as a spectral line: as a force on
//! a coordinate, `cos(om t)`, or as a factor of a function of the coordinates. Its power is compared with that of the neighbouring
//! frequencies, so that a continuous spectrum, of noise or of missing terms, has no line.

use super::find::{WeakForm, best};
use super::function::Function;
use super::library::{Kind, Library};
use super::prepared::Prepared;
use super::thresholds::{
    BACKGROUND_RANGE, EXPLAINING_SHARE, FREQUENCIES_PER_RESOLUTION, INDEPENDENT_FREQUENCIES, LEAST_BACKGROUND,
    LEAST_DRIVE_PERIODS, MOST_DRIVE_FREQUENCIES, MOST_FALSE_ALARMS, MOST_FREQUENCIES, MOST_REMOVED_EFFECTS,
    MOST_WINDOW_PHASE, REFINED_PEAKS,
};
use crate::cancellation::Cancellation;
use crate::linalg::dot;
use crate::recording::RecordedTrajectory;
use std::collections::BTreeSet;
use std::f64::consts::{LN_2, PI, TAU};

/// Residuals of a library by window.
pub(super) struct Residuals {
    /// Times of the windows, in s.
    times: Vec<f64>,
    /// Everything that a drive may multiply.
    driven: Vec<Driven>,
    /// Lowest and highest frequency, in rad/s.
    band: [f64; 2],
    /// Resolution of the longest trajectory, and of the whole recording.
    resolution: [f64; 2],
    /// Sum of the squared residuals.
    total: f64,
}

/// The accelerations per unit amplitude of a drive, by window: their square, their product with the residuals, and with each of the
/// orthonormal effects of other terms, which are no longer in the residuals.
struct Driven {
    squares: Vec<f64>,
    products: Vec<f64>,
    others: Vec<Vec<f64>>,
}

impl Driven {
    /// Computes it from effects and errors, `(windows, n)`.
    fn new(effect: &[f64], errors: &[f64], others: &[Vec<f64>], n: usize) -> Self {
        let by = |other: &[f64]| effect.chunks_exact(n).zip(other.chunks_exact(n)).map(|(a, b)| dot(a, b)).collect();
        let others = others.iter().map(|other| by(other)).collect();
        Self { squares: by(effect), products: by(errors), others }
    }

    /// Reduction of the sum of squares by a drive with these sines and cosines, all other terms refitted.
    fn power(&self, sines: &[f64], cosines: &[f64]) -> f64 {
        let sum =
            |a: &[f64], b: &[f64]| self.squares.iter().zip(a.iter().zip(b)).map(|(x, (a, b))| x * a * b).sum::<f64>();
        let [whole_cc, mut cs, whole_ss] = [sum(cosines, cosines), sum(cosines, sines), sum(sines, sines)];
        let [ce, se] = [dot(&self.products, cosines), dot(&self.products, sines)];
        let (mut cc, mut ss) = (whole_cc, whole_ss);
        for other in &self.others {
            let [c, s] = [dot(other, cosines), dot(other, sines)];
            cc -= c * c;
            cs -= c * s;
            ss -= s * s;
        }
        let determinant = cc * ss - cs * cs;
        // Near frequency 0 the sine and the cosine are the same function, and other terms may explain both.
        if determinant <= 1e-9 * whole_cc * whole_ss {
            return 0.0;
        }
        (ss * ce * ce - 2.0 * cs * ce * se + cc * se * se) / determinant
    }
}

/// A line of the spectrum.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// Its angular frequency, in rad/s.
    pub frequency: f64,
    /// Share of the squared residuals that a drive of this frequency explains.
    pub share: f64,
}

/// Time from the first to the last sample of the longest trajectory.
pub(super) fn longest(data: &Prepared<'_>) -> f64 {
    data.recording.tracks.iter().map(RecordedTrajectory::span).fold(0.0, f64::max)
}

impl Residuals {
    /// The residuals in the windows that are not held out, once with unit masses, and once with the mass matrix of the best choice of
    /// terms, which a drive may bias.
    pub fn of(weak: &WeakForm, data: &Prepared<'_>, held: &BTreeSet<usize>) -> Vec<Self> {
        let units = weak.windows.unit_mass(&weak.library, &weak.quotient.kept, &data.speeds);
        let masses = [Some(&units), best(&weak.path).map(|choice| &choice.coefficients)];
        masses.into_iter().flatten().map(|mass| Self::with_mass(weak, mass, data, held)).collect()
    }

    fn with_mass(weak: &WeakForm, coefficients: &[f64], data: &Prepared<'_>, held: &BTreeSet<usize>) -> Self {
        let WeakForm { library, quotient, windows, path } = weak;
        let set: Vec<usize> = (0..coefficients.len()).filter(|&at| coefficients[at] != 0.0).collect();
        let kept = |at: &usize| quotient.kept[*at];
        let still = |at: &usize| library.kinetic(kept(at)).is_none();
        let mut removed: Vec<usize> = path.order.iter().copied().filter(still).take(MOST_REMOVED_EFFECTS).collect();
        removed.extend(set.iter().filter(|at| still(at) && !path.order.contains(at)));
        let potentials: Vec<usize> = library
            .driven()
            .iter()
            .skip(library.n())
            .filter_map(|f| (0..quotient.kept.len()).find(|at| is_potential(library, kept(at), f)))
            .collect();
        let of = |set: &[usize]| windows.columns(coefficients, set, &data.sigma);
        let [own, units] = of(&set);
        let mut errors = vec![0.0; windows.len() * data.n];
        own.iter().zip(&set).for_each(|(column, &at)| add(&mut errors, coefficients[at], column));
        for (j, unit) in units.iter().enumerate().filter(|_| windows.driven()) {
            let of = |at: usize| windows.forces[at / data.n * data.n + j];
            errors.iter_mut().zip(unit).enumerate().for_each(|(at, (e, u))| *e -= of(at) * u);
        }
        let used: Vec<usize> = (0..windows.len()).filter(|&w| !held.contains(&windows.blocks[w])).collect();
        let training = |column: &[f64]| -> Vec<f64> {
            used.iter().flat_map(|w| &column[w * data.n..(w + 1) * data.n]).copied().collect()
        };
        let mut errors = training(&errors);
        let others = remove(&mut errors, of(&removed)[0].iter().map(|column| training(column)));
        let effects = of(&potentials);
        let effects = units.iter().chain(&effects[0]).map(|effect| training(effect));
        let driven = effects.map(|effect| Driven::new(&effect, &errors, &others, data.n)).collect();
        let times: Vec<f64> = used.iter().map(|&w| windows.centres[w]).collect();
        let ends = [times.iter().copied().fold(f64::INFINITY, f64::min), times.iter().copied().fold(0.0, f64::max)];
        let steps = times.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
        let (longest, apart) = (longest(data), steps.fold(f64::INFINITY, f64::min));
        let band = [TAU * LEAST_DRIVE_PERIODS / longest, (MOST_WINDOW_PHASE / data.width().0).min(PI / apart)];
        let resolution = [TAU / longest, TAU / (ends[1] - ends[0]).max(longest)];
        Self { times, driven, band, resolution, total: dot(&errors, &errors) }
    }

    /// The lines of several spectra, those that explain most first; lines closer than the resolution are returned once.
    pub fn lines<'a>(rests: impl Iterator<Item = &'a Self>, stop: &Cancellation) -> Vec<Line> {
        let mut lines: Vec<(Line, f64)> =
            rests.filter_map(|rest| Some((rest.line(stop)?, rest.resolution[0] / 2.0))).collect();
        lines.sort_by(|(a, _), (b, _)| b.share.total_cmp(&a.share));
        let mut apart: Vec<Line> = Vec::new();
        for (line, width) in lines {
            if apart.len() < MOST_DRIVE_FREQUENCIES
                && apart.iter().all(|own| (own.frequency - line.frequency).abs() >= width)
            {
                apart.push(line);
            }
        }
        apart
    }

    /// The line that explains most, among those that are significant or explain nearly everything, if enough neighbouring frequencies show the
    /// background.
    fn line(&self, stop: &Cancellation) -> Option<Line> {
        let [low, high] = self.band;
        let step = self.resolution[1] / FREQUENCIES_PER_RESOLUTION;
        let count = (high - low) / step;
        if !(2.0..MOST_FREQUENCIES).contains(&count) {
            return None;
        }
        let grid: Vec<f64> = (0..=count as usize).map(|k| low + k as f64 * step).collect();
        let powers: Vec<Vec<f64>> = grid.iter().take_while(|_| stop.go_on()).map(|om| self.powers(*om)).collect();
        if powers.len() < grid.len() {
            return None;
        }
        let tests = INDEPENDENT_FREQUENCIES * (high - low) / self.resolution[1] * self.driven.len() as f64;
        let of = |k: usize| {
            let own: Vec<f64> = powers.iter().map(|powers| powers[k]).collect();
            let (peak, frequency, power) = self.highest(k, &grid, &own).filter(|_| stop.go_on())?;
            let alarms = tests * self.chance(&grid, &own, peak)?;
            let share = power / self.total;
            tracing::debug!(k, frequency, alarms, share, "line");
            (alarms < MOST_FALSE_ALARMS || share > EXPLAINING_SHARE).then_some(Line { frequency, share })
        };
        let lines = (0..self.driven.len()).filter_map(of);
        lines.max_by(|a, b| a.share.total_cmp(&b.share))
    }

    /// The sine and the cosine of a frequency in every window.
    fn waves(&self, frequency: f64) -> (Vec<f64>, Vec<f64>) {
        self.times.iter().map(|t| (frequency * t).sin_cos()).unzip()
    }

    /// Reduction of the sum of squares by a drive of each kind at a frequency.
    fn powers(&self, frequency: f64) -> Vec<f64> {
        let (sines, cosines) = self.waves(frequency);
        self.driven.iter().map(|driven| driven.power(&sines, &cosines)).collect()
    }

    /// Probability of a power as large as that at a peak, from the median of `k` powers beside it: `(1 + z/k)^-k` for a power of `z` times
    /// their mean, if all are exponentially distributed. `None` if there are too few.
    fn chance(&self, grid: &[f64], powers: &[f64], peak: usize) -> Option<f64> {
        let [from, to] = BACKGROUND_RANGE.map(|units| units * self.resolution[0]);
        let is_beside = |om: &f64| (from..to).contains(&(om - grid[peak]).abs());
        let mut beside: Vec<f64> = grid.iter().zip(powers).filter(|(om, _)| is_beside(om)).map(|(_, p)| *p).collect();
        beside.sort_by(f64::total_cmp);
        let count = beside.len() as f64 * (grid[1] - grid[0]) / self.resolution[0];
        let mean = beside.get(beside.len() / 2).filter(|_| count >= LEAST_BACKGROUND)? / LN_2;
        Some((-count * (powers[peak] / mean / count).ln_1p()).exp())
    }

    /// The highest peak: its index on the grid, its frequency and its power. The grid is too coarse to compare peaks that are nearly equal, so
    /// the frequencies of several are refined first.
    fn highest(&self, k: usize, grid: &[f64], own: &[f64]) -> Option<(usize, f64, f64)> {
        let is_peak =
            |&at: &usize| (at == 0 || own[at - 1] <= own[at]) && own.get(at + 1).is_none_or(|next| *next <= own[at]);
        let mut peaks: Vec<usize> = (0..own.len()).filter(is_peak).collect();
        peaks.sort_by(|&a, &b| own[b].total_cmp(&own[a]));
        let step = grid[1] - grid[0];
        let refined = peaks.into_iter().take(REFINED_PEAKS).map(|peak| {
            let (frequency, power) = self.refined(k, [grid[peak] - step, grid[peak] + step]);
            (peak, frequency, power)
        });
        refined.max_by(|a, b| a.2.total_cmp(&b.2))
    }

    /// The frequency of the largest power between two, and its power.
    fn refined(&self, k: usize, [mut low, mut high]: [f64; 2]) -> (f64, f64) {
        let power = |om: f64| {
            let (sines, cosines) = self.waves(om);
            self.driven[k].power(&sines, &cosines)
        };
        for _ in 0..12 {
            let [a, b] = [low + 0.382 * (high - low), low + 0.618 * (high - low)];
            if power(a) > power(b) { high = b } else { low = a }
        }
        let frequency = (low + high) / 2.0;
        (frequency, power(frequency))
    }
}

/// `true` for the function `f` as a term of `L`.
fn is_potential(library: &Library, k: usize, f: &Function) -> bool {
    library.terms[k].kind == Kind::Potential && library.functions[library.terms[k].function] == *f
}

fn add(to: &mut [f64], factor: f64, column: &[f64]) {
    to.iter_mut().zip(column).for_each(|(to, x)| *to += factor * x);
}

/// Removes the projection on other columns from a column; returns orthonormal directions of those columns.
fn remove(from: &mut [f64], columns: impl Iterator<Item = Vec<f64>>) -> Vec<Vec<f64>> {
    let mut directions: Vec<Vec<f64>> = Vec::new();
    for mut column in columns {
        let before = dot(&column, &column);
        for _ in 0..2 {
            for direction in &directions {
                let own = dot(direction, &column);
                add(&mut column, -own, direction);
            }
        }
        let size = dot(&column, &column);
        if size > 1e-16 * before {
            column.iter_mut().for_each(|x| *x /= size.sqrt());
            let own = dot(&column, from);
            add(from, -own, &column);
            directions.push(column);
        }
    }
    directions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RngStream;
    use rand_distr::{Distribution, StandardNormal};

    /// Errors of 400 windows, 0.25 s apart, of one coordinate that a force and a factor of a function may drive.
    fn residuals(seed: u64, mut error: impl FnMut(f64, f64) -> f64) -> Residuals {
        let mut rng = RngStream::Trajectories.generator(seed);
        let mut draw = || <StandardNormal as Distribution<f64>>::sample(&StandardNormal, &mut rng);
        let times: Vec<f64> = (0..400).map(|k| 0.25 * f64::from(k)).collect();
        let function: Vec<f64> = times.iter().map(|t| (0.7 * t + (0.31 * t).sin()).cos()).collect();
        let errors: Vec<f64> = times.iter().map(|t| error(*t, draw())).collect();
        let (span, force, total) = (100.0, vec![1.0; times.len()], dot(&errors, &errors));
        let resolution = [TAU / span; 2];
        let driven = [force, function].map(|effect| Driven::new(&effect, &errors, &[], 1)).into();
        Residuals { times, driven, band: [3.0 * TAU / span, 10.0], resolution, total }
    }

    fn line(rest: &Residuals) -> Option<Line> {
        rest.line(&Cancellation::default())
    }

    #[test]
    fn a_line_is_found_at_its_frequency() {
        for seed in 0..20 {
            let found = line(&residuals(seed, |t, noise| (2.3 * t + 0.4).cos() + noise)).unwrap();
            // The standard error is sqrt(24 / 400) / 100.
            assert!((found.frequency - 2.3).abs() < 4.0 * 2.5e-3, "{seed} {found:?}");
            let shaken = |t: f64| (0.7 * t + (0.31 * t).sin()).cos() * (5.1 * t + 1.0).sin();
            let found = line(&residuals(seed, |t, noise| 2.0 * shaken(t) + noise)).unwrap();
            assert!((found.frequency - 5.1).abs() < 0.02, "{seed} {found:?}");
        }
    }

    #[test]
    fn continuous_spectra_have_no_line() {
        let seeds = 60;
        let alarms = |make: &dyn Fn(u64) -> Residuals| (0..seeds).filter(|&seed| line(&make(seed)).is_some()).count();
        assert!(alarms(&|seed| residuals(seed, |_, noise| noise)) <= 1);
        // Correlated over 1 s.
        let red = |seed| {
            let mut last = 0.0;
            residuals(seed, move |_, noise| {
                last = 0.78 * last + noise;
                last
            })
        };
        assert!(alarms(&red) <= 1);
        // A sign that changes at random.
        let jumps = |seed| {
            let mut sign = 1.0;
            residuals(seed, move |_, noise| {
                sign *= if noise > 1.0 { -1.0 } else { 1.0 };
                sign + 0.1 * noise
            })
        };
        assert!(alarms(&jumps) <= 1);
    }

    #[test]
    fn a_line_is_found_though_its_neighbours_explain_the_residuals_too() {
        // A drive whose effect decays within two periods: its line is as wide as the background that it is compared with.
        let effect = |t: f64| (-t / 6.0).exp();
        let mut decaying = residuals(0, |t, _| effect(t) * (1.3 * t + 0.4).cos());
        let errors: Vec<f64> = decaying.times.iter().map(|t| effect(*t) * (1.3 * t + 0.4).cos()).collect();
        let effects: Vec<f64> = decaying.times.iter().map(|t| effect(*t)).collect();
        assert!(line(&decaying).is_none());
        decaying.driven = vec![Driven::new(&effects, &errors, &[], 1)];
        let found = line(&decaying).unwrap();
        assert!((found.frequency - 1.3).abs() < 1e-3 && found.share > 0.99, "{found:?}");
    }

    #[test]
    fn nearly_equal_peaks_are_compared_between_the_frequencies_of_the_grid() {
        // The stronger line lies halfway between two frequencies of the grid, the weaker one on it.
        let step = TAU / 100.0 / FREQUENCIES_PER_RESOLUTION;
        let low = 3.0 * TAU / 100.0;
        let [halfway, upon] = [low + 60.5 * step, low + 140.0 * step];
        let found = line(&residuals(1, |t, _| 1.01 * (halfway * t).cos() + (upon * t).cos())).unwrap();
        assert!((found.frequency - halfway).abs() < step / 4.0, "{found:?} {halfway} {upon}");
    }

    #[test]
    fn a_band_without_neighbours_has_no_line() {
        let few = |high: f64| Residuals { band: [1.0, high], ..residuals(3, |t, noise| 5.0 * (1.2 * t).cos() + noise) };
        assert!(line(&few(1.0 + 5.0 * TAU / 100.0)).is_none() && line(&few(10.0)).is_some());
    }

    #[test]
    fn what_others_explain_is_removed() {
        let wave = |om: f64| (0..50).map(|k| (om * f64::from(k)).cos()).collect::<Vec<f64>>();
        let (a, b) = (wave(0.3), wave(0.8));
        let mut left: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 2.0 * a - 3.0 * b).collect();
        // The third column depends on the first two.
        let sum = a.iter().zip(&b).map(|(a, b)| a + b).collect();
        let directions = remove(&mut left, [a, b, sum].into_iter());
        assert!(directions.len() == 2 && left.iter().all(|x| x.abs() < 1e-12), "{left:?}");
    }

    #[test]
    fn a_line_that_another_term_hides_is_found() {
        // The term contains the drive and two oscillations; removing it leaves a part of each.
        let times: Vec<f64> = (0..400).map(|k| 0.25 * f64::from(k)).collect();
        let wave = |om: f64, size: f64| times.iter().map(|t| size * (om * t).cos()).collect::<Vec<f64>>();
        let (drive, others) = (wave(1.3, 1.0), [wave(1.9, 1.2), wave(2.7, 0.8)]);
        let term: Vec<f64> = (0..times.len()).map(|k| drive[k] + others[0][k] + others[1][k]).collect();
        let mut errors = drive.clone();
        let others = remove(&mut errors, [term].into_iter());
        let driven = vec![Driven::new(&vec![1.0; times.len()], &errors, &others, 1)];
        let total = dot(&errors, &errors);
        let rest = Residuals { times, driven, band: [0.2, 10.0], resolution: [TAU / 100.0; 2], total };
        assert!((line(&rest).unwrap().frequency - 1.3).abs() < 2e-3);
    }
}
