//! Vectors and matrices in three dimensions.

use crate::scalar::Real;

/// A vector in space.
pub type Vector<R> = [R; 3];
/// A three-by-three matrix, by rows.
pub type Matrix<R> = [Vector<R>; 3];

pub(super) fn add<R: Real>(a: Vector<R>, b: Vector<R>) -> Vector<R> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn scaled<R: Real>(factor: R, a: Vector<R>) -> Vector<R> {
    a.map(|a| factor * a)
}

/// `a x b`.
pub fn cross<R: Real>(a: Vector<R>, b: Vector<R>) -> Vector<R> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `a b^T`.
pub(super) fn outer<R: Real>(a: Vector<R>, b: Vector<R>) -> Matrix<R> {
    a.map(|a| scaled(a, b))
}

pub(super) fn sum<R: Real>(a: &Matrix<R>, b: &Matrix<R>) -> Matrix<R> {
    [add(a[0], b[0]), add(a[1], b[1]), add(a[2], b[2])]
}

/// `m^T`.
pub fn transposed<R: Real>(m: Matrix<R>) -> Matrix<R> {
    [0, 1, 2].map(|k| [m[0][k], m[1][k], m[2][k]])
}

/// Completes a symmetric matrix from its upper triangle.
pub(super) fn symmetric<R: Real>(m: Matrix<R>) -> Matrix<R> {
    [m[0], [m[0][1], m[1][1], m[1][2]], [m[0][2], m[1][2], m[2][2]]]
}

/// `M a`.
pub fn applied<R: Real>(m: &Matrix<R>, a: Vector<R>) -> Vector<R> {
    m.map(|row| row[0] * a[0] + row[1] * a[1] + row[2] * a[2])
}

/// `A B`.
pub fn product<R: Real>(a: &Matrix<R>, b: &Matrix<R>) -> Matrix<R> {
    let columns = transposed(*b);
    a.map(|row| applied(&columns, row))
}
