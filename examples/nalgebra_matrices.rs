//! States from nalgebra, mass matrices to nalgebra.
//!
//! A batch is row-major, `(batch, n)`; a nalgebra matrix is column-major. A matrix with one state per column therefore is
//! a batch as it lies in memory, and a symmetric mass matrix is the same in both orders: nothing is transposed.

use lnn::lagrangian::{Request, SystemInstance, Terms};
use nalgebra::{DMatrix, DMatrixView, SMatrix, SVector};

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let [m1, m2, l1, l2]: [f64; 4] = [1.2, 0.7, 0.9, 1.1];
    let values = [("m1", m1), ("m2", m2), ("l1", l1), ("l2", l2), ("g", 9.81)];
    let model = SystemInstance::<f64>::named(
        "double-pendulum",
        &values.map(|(name, value)| (name.to_string(), value.to_string())),
    )?
    .build()?;
    let mut terms = Terms::default();

    // One state of fixed size: M, and the acceleration by nalgebra's own solver.
    let (q, v) = (SVector::from([0.4, -1.3]), SVector::from([2.0, 0.5]));
    model.terms(q.as_slice(), v.as_slice(), Request::ALL, &mut terms)?;
    let mass = SMatrix::<f64, 2, 2>::from_column_slice(&terms.mass_matrix);
    let force = SVector::<f64, 2>::from_column_slice(&terms.dl_dq) - SVector::from_column_slice(&terms.coriolis);
    let acceleration = mass.cholesky().ok_or("M is not positive definite")?.solve(&force);
    let difference = (acceleration - SVector::<f64, 2>::from_column_slice(&terms.acceleration)).norm();
    println!("a = {:.6?}, by nalgebra within {difference:.1e}", terms.acceleration);
    assert!(difference < 1e-13 * acceleration.norm(), "M is well-conditioned: some roundings are allowed");

    // A batch of any size, one state per column; kinetic energy v.M v/2 and eigenvalues of M.
    let q = DMatrix::from_fn(2, 500, |i, k| 0.01 * k as f64 * (1.0 + i as f64));
    let v = DMatrix::from_fn(2, 500, |i, k| (0.3 * k as f64 + i as f64).sin());
    model.terms(q.as_slice(), v.as_slice(), Request::MASS_MATRIX | Request::MOMENTUM, &mut terms)?;
    let momenta = DMatrixView::from_slice(&terms.momentum, 2, 500);
    let mut worst = 0.0_f64;
    for (k, mass) in terms.mass_matrix.chunks_exact(4).enumerate() {
        let mass = DMatrix::from_column_slice(2, 2, mass);
        // The kinetic energy is quadratic in v: p = M v.
        worst = worst.max((&mass * v.column(k) - momenta.column(k)).norm());
        let eigenvalues = mass.symmetric_eigen().eigenvalues;
        let determinant = m2 * (l1 * l2).powi(2) * (m1 + m2 * (q[(0, k)] - q[(1, k)]).sin().powi(2));
        worst = worst.max((eigenvalues.product() / determinant - 1.0).abs());
        assert!(eigenvalues.min() > 0.0);
    }
    println!("500 mass matrices: p = M v and det M within {worst:.1e}");
    assert!(worst < 1e-13, "p = M v or the determinant is wrong");
    Ok(())
}
