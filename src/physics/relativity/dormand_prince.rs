//! Coefficients of the embedded Runge-Kutta method 5(4) of Dormand and Prince.
//!
//! Source: Dormand and Prince, J. Comput. Appl. Math. 6, 19 (1980), table 2; the last stage is the first of the next step.

/// Number of stages.
pub(super) const STAGES: usize = 7;

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
pub(super) const ERROR: [f64; STAGES] =
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
