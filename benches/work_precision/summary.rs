//! Orders, floors and the cost of a given error, from measured points.

/// Slope of the straight line closest to `(ln x, ln y)`; `NaN` for fewer than three points.
pub fn slope(points: &[(f64, f64)]) -> f64 {
    if points.len() < 3 {
        return f64::NAN;
    }
    let logs: Vec<(f64, f64)> = points.iter().map(|p| (p.0.ln(), p.1.ln())).collect();
    let mean = |f: fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / logs.len() as f64;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let products: f64 = logs.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    products / logs.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

/// Cost at which a curve of `(error, cost)`, in the order it was measured, first falls to an error: interpolated between
/// logarithms. `NaN` if it never does.
pub fn cost_of(points: &[(f64, f64)], error: f64) -> f64 {
    let mut before: Option<(f64, f64)> = None;
    for &(found, cost) in points {
        if found <= error {
            let Some((worse, cheaper)) = before.filter(|_| found > 0.0) else { return cost };
            let fraction = (worse / error).ln() / (worse / found).ln();
            return (cheaper.ln() + fraction * (cost / cheaper).ln()).exp();
        }
        before = Some((found, cost));
    }
    f64::NAN
}
