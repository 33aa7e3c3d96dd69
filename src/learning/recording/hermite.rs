//! Motion between two samples whose positions and velocities are known.

/// Coefficients of cubic Hermite interpolation of the position, then of the velocity. They multiply `q`, `v` at the start and `q`, `v` at
/// the end of an interval of length `h`, at the relative time `fraction`; exact for cubic motion, error of order `h^4` in the position.
pub fn hermite(fraction: f64, h: f64) -> [[f64; 4]; 2] {
    let s = fraction;
    let (square, cube) = (s * s, s * s * s);
    let rise = 3.0 * square - 2.0 * cube;
    let slope = 6.0 * (s - square) / h;
    let position = [1.0 - rise, h * (s - 2.0 * square + cube), rise, h * (cube - square)];
    let velocity = [-slope, 1.0 - 4.0 * s + 3.0 * square, slope, 3.0 * square - 2.0 * s];
    [position, velocity]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubic_motion_is_met() {
        let q = |t: f64| 1.0 - 2.0 * t + 0.5 * t * t + 0.25 * t.powi(3);
        let v = |t: f64| -2.0 + t + 0.75 * t * t;
        let (start, h) = (0.3, 0.8);
        let known = [q(start), v(start), q(start + h), v(start + h)];
        for fraction in [0.0, 0.25, 0.5, 0.9, 1.0] {
            let t = start + fraction * h;
            let [position, velocity] =
                hermite(fraction, h).map(|f| f.iter().zip(known).map(|(f, x)| f * x).sum::<f64>());
            assert!((position - q(t)).abs() < 1e-15 && (velocity - v(t)).abs() < 2e-15, "{fraction}");
        }
    }
}
