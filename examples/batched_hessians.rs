//! Mass matrices of batch after batch in a control loop: after the first round nothing is allocated.

// The tests run `main` in a program that has this allocator already.
#[cfg(test)]
use crate::counting;
use lnn::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use lnn::network::{ModelFile, NetworkLagrangian};
use std::path::Path;

#[cfg(not(test))]
#[path = "../tests/process/counting.rs"]
mod counting;

const BATCH: usize = 64;

/// Work of the loop's own: the states of round `k`, `(batch, n)` row-major.
fn observe(k: usize, q: &mut [f64], v: &mut [f64]) {
    for (i, (q, v)) in q.iter_mut().zip(v).enumerate() {
        let phase = 0.1 * k as f64 + i as f64;
        (*q, *v) = (phase.sin(), 0.1 * phase.cos());
    }
}

/// Sum of the determinants of all mass matrices of some rounds: a stand-in for what a controller makes of them.
fn rounds(
    model: &dyn EulerLagrange<f64>,
    rounds: std::ops::Range<usize>,
    state: &mut [Vec<f64>; 2],
    terms: &mut Terms<f64>,
) -> f64 {
    let [q, v] = state;
    let mut sum = 0.0;
    for k in rounds {
        observe(k, q, v);
        // d2L/dv dv, (batch, n, n), into the buffers of the round before.
        if model.terms(q, v, Request::MASS_MATRIX, terms).is_ok() {
            sum += terms.mass_matrix.chunks_exact(4).map(|m| m[0] * m[3] - m[1] * m[2]).sum::<f64>();
        }
    }
    sum
}

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/data/double_pendulum.safetensors");
    let ModelFile { header, weights } = ModelFile::<f64>::load(&path)?;
    let learned = NetworkLagrangian::new(header.architecture, weights)?;
    let written = SystemInstance::<f64>::named("double-pendulum", &[])?.build()?;
    let models: [(&str, &dyn EulerLagrange<f64>); 2] = [("hand-written", &*written), ("learned", &learned)];
    for (name, model) in models {
        let mut state = [vec![0.0; 2 * BATCH], vec![0.0; 2 * BATCH]];
        let mut terms = Terms::default();
        let first = rounds(model, 0..1, &mut state, &mut terms);
        let mut rest = 0.0;
        let allocations = counting::allocations(|| rest = rounds(model, 1..200, &mut state, &mut terms));
        println!("{name}: mean determinant {:.4}, {allocations} allocations", (first + rest) / (200 * BATCH) as f64);
        assert!(rest.is_finite() && rest != 0.0 && allocations == 0, "{name}: {allocations} allocations");
    }
    Ok(())
}
