//! A learned Lagrangian in another crate's solver: the Dop853 of the crate `differential-equations`.
//!
//! Whatever a network has learned, its motion keeps the energy of what it has learned.

use differential_equations::prelude::{ExplicitRungeKutta, IVP, ODE};
use lnn::lagrangian::{EulerLagrange, Request, RightHandSide, Terms};
use lnn::network::{ModelFile, NetworkLagrangian};
use std::path::Path;

struct Motion<'a>(RightHandSide<'a, f64>);

impl ODE<f64, [f64; 4]> for Motion<'_> {
    fn diff(&self, _t: f64, x: &[f64; 4], dx: &mut [f64; 4]) {
        self.0.evaluate(x, dx);
    }
}

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/data/double_pendulum.safetensors");
    // Weights of a file in single precision, widened: the arithmetic is in double precision.
    let ModelFile { header, weights } = ModelFile::<f64>::load(&path)?;
    let model = NetworkLagrangian::new(header.architecture, weights)?;
    let motion = Motion(model.rhs());
    let solver = ExplicitRungeKutta::dop853().rtol(1e-11).atol(1e-11);
    let solution = IVP::ode(&motion, 0.0, 5.0, [0.6, 1.1, 0.0, 0.0]).method(solver).solve();
    motion.0.outcome()?;
    let solution = solution.map_err(|error| format!("{error:?}"))?;

    // The energies after all steps at once; between steps the solver interpolates, to fewer digits.
    let (q, v): (Vec<_>, Vec<_>) = solution.y.iter().map(|x| ([x[0], x[1]], [x[2], x[3]])).unzip();
    let mut terms = Terms::default();
    model.terms(q.as_flattened(), v.as_flattened(), Request::ENERGY, &mut terms)?;
    let (low, high) = terms.energy.iter().fold((f64::MAX, f64::MIN), |(low, high), &e| (low.min(e), high.max(e)));
    let kinetic = terms.momentum.chunks(2).zip(&v).map(|(p, v)| (p[0] * v[0] + p[1] * v[1]) / 2.0);
    let scale = kinetic.fold(0.0, f64::max);
    let drift = (high - low) / scale;
    println!("{} steps, energy constant to {drift:.1e} of the largest kinetic energy", q.len());
    // 145 steps, each allowed an error of 1e-11 (1 + |x|).
    assert!(q.len() > 50 && scale > 0.0 && drift < 1e-7, "not conserved");
    Ok(())
}
