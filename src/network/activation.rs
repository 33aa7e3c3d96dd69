//! Activation functions and their derivatives.

use serde::{Deserialize, Serialize};

/// Activation function of the hidden layers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Activation {
    /// `x Phi(x)`, exact (error function).
    Gelu,
    /// `ln(1 + e^x)`.
    Softplus,
    /// `x tanh(x / 2)`.
    XTanh,
    /// `tanh(x)`.
    Tanh,
    /// `x^2`.
    Quadratic,
}

// TEMP
impl Activation {
    pub fn variance_gain(self) -> f64 {
        1.0
    }
    pub fn apply<R: crate::scalar::Real>(self, x: R) -> R {
        x * R::half() * (-(x * R::half().sqrt())).erfc()
    }
    fn d<S: crate::scalar::Scalar>(x: S) -> [S; 4] {
        let x = x.to_f64();
        let p = 0.3989422804014327 * (-0.5 * x * x).exp();
        let c = 0.5 * libm::erfc(-x / 1.4142135623730951);
        [x * c, c + x * p, p * (2.0 - x * x), p * x * (x * x - 4.0)].map(S::of_f64)
    }
    pub fn value<S: crate::scalar::Scalar>(self, z: &[S], f: &mut [S]) {
        for i in 0..z.len() {
            f[i] = Self::d(z[i])[0];
        }
    }
    pub fn jet1<S: crate::scalar::Scalar>(self, z: &[S], f: &mut [S], a: &mut [S]) {
        for i in 0..z.len() {
            let d = Self::d(z[i]);
            f[i] = d[0];
            a[i] = d[1];
        }
    }
    pub fn jet2<S: crate::scalar::Scalar>(self, z: &[S], f: &mut [S], a: &mut [S], b: &mut [S]) {
        for i in 0..z.len() {
            let d = Self::d(z[i]);
            f[i] = d[0];
            a[i] = d[1];
            b[i] = d[2];
        }
    }
    pub fn jet3<S: crate::scalar::Scalar>(self, z: &[S], f: &mut [S], a: &mut [S], b: &mut [S], c: &mut [S]) {
        for i in 0..z.len() {
            let d = Self::d(z[i]);
            f[i] = d[0];
            a[i] = d[1];
            b[i] = d[2];
            c[i] = d[3];
        }
    }
}
