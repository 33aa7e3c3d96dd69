//! Residuals: whether they are noise, and which samples stand out.

use super::follow::Segment;
use super::found::Outlier;

/// Residuals this many times the usual one stand out.
const FAR: f64 = 5.5;
/// Samples that stand out, listed at most.
const MOST_LISTED: usize = 100;
/// Correlation of neighbours below which residuals pass for white whatever their number.
const NEGLIGIBLE: f64 = 0.1;

/// Correlation of neighbours among the residuals of a coordinate, and whether that is noise. What starts and constants take away
/// makes neighbours differ a little more than noise does.
pub(super) fn whiteness(residuals: &[Vec<f64>], n: usize, coordinate: usize) -> (f64, bool) {
    let (mut products, mut squares, mut pairs, mut numbers) = (0.0, 0.0, 0.0, 0.0);
    for segment in residuals {
        let of: Vec<f64> = segment.iter().skip(coordinate).step_by(n).copied().collect();
        products += of.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>();
        squares += of.iter().map(|r| r * r).sum::<f64>();
        pairs += (of.len() - 1) as f64;
        numbers += of.len() as f64;
    }
    if squares <= 0.0 || pairs < 1.0 {
        return (0.0, true);
    }
    let correlation = products / pairs / (squares / numbers);
    // Each start takes two numbers of a coordinate.
    let taken = 2.0 * residuals.len() as f64 / numbers;
    let expected = -taken;
    (correlation, (correlation - expected).abs() <= (4.0 / pairs.sqrt()).max(NEGLIGIBLE) + taken)
}

/// Standard deviation of the residuals of a coordinate by the median of their size, which samples that stand out do not move.
pub(super) fn usual(residuals: &[Vec<f64>], n: usize, coordinate: usize) -> f64 {
    let own = residuals.iter().flat_map(|segment| segment.iter().skip(coordinate).step_by(n));
    let mut sizes: Vec<f64> = own.map(|r| r.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    // The median of the size of normal numbers is 0.6745 of their deviation.
    sizes.get(sizes.len() / 2).copied().unwrap_or(0.0) / 0.6745
}

/// Samples far from the motion, the farthest first, and the number of all of them.
pub(super) fn outliers(
    (segments, residuals): (&[Segment], &[Vec<f64>]),
    n: usize,
    describe: impl Fn(usize, usize, usize, f64) -> Outlier,
) -> (Vec<Outlier>, usize) {
    let mut found = Vec::new();
    for i in 0..n {
        let of = |segment: &Vec<f64>| segment.iter().skip(i).step_by(n).copied().collect::<Vec<_>>();
        let usual = usual(residuals, n, i);
        for (segment, residuals) in segments.iter().zip(residuals) {
            for (sample, r) in of(residuals).into_iter().enumerate().filter(|(_, r)| r.abs() > FAR * usual) {
                found.push((segment.track, segment.first + sample, i, r / usual.max(f64::MIN_POSITIVE)));
            }
        }
    }
    found.sort_by(|a, b| b.3.abs().total_cmp(&a.3.abs()));
    let count = found.len();
    (
        found.into_iter().take(MOST_LISTED).map(|(track, sample, i, size)| describe(track, sample, i, size)).collect(),
        count,
    )
}
