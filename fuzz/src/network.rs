//! A small network of random shape, weights and state: the batched derivatives in `f64` against nested forward numbers
//! in double-double; weights of any bits are answered with finite terms or a typed error.

use super::accuracy::{apart, cast, finite, largest};
use super::bytes::{Bytes, Random};
use super::nested::{Reference, reference};
use lnn::lagrangian::{EulerLagrange, Request, Terms};
use lnn::network::{ActivationChoice, Architecture, Form, InputLayer, Layout, NetworkLagrangian};
use lnn::scalar::{Dd, Scalar};
use lnn::tape::{Depth, Evaluation};

/// Most roundings that an error may have, in units of the condition.
const R: f64 = 30.0;
/// Relative perturbation of weights and states that measures the condition.
const STEP: f64 = 1.0 / (1u64 << 40) as f64;
/// States of a chunk.
const STATES: usize = 2;

fn architecture(bytes: &mut Bytes<'_>) -> Architecture {
    let coordinates = 1 + bytes.below(3);
    let activation = ActivationChoice::ALL[bytes.below(ActivationChoice::ALL.len())];
    let layers = 1 + bytes.below(3);
    Architecture {
        coordinates,
        hidden: (0..layers).map(|_| (1 + bytes.below(5)) * activation.branches().len()).collect(),
        activation,
        alpha: bytes.small(),
        time_like: None,
        scale: (0..coordinates).map(|_| (1 + bytes.below(32)) as f64 / 8.0).collect(),
        periodic: (0..coordinates).map(|_| bytes.flag()).collect(),
        embed_periodic: bytes.flag(),
        input_layer: if bytes.flag() { InputLayer::Dyt } else { InputLayer::None },
        dissipation: None,
        form: Form::default(),
    }
}

/// Evaluates the network both ways.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let wild = bytes.below(4) == 0;
    let architecture = architecture(&mut bytes);
    let n = architecture.coordinates;
    let mut random = Random(bytes.any().to_bits());
    let mut number = |factor: f64| {
        if wild && !bytes.is_empty() {
            return bytes.any();
        }
        factor * if bytes.is_empty() { random.sign() } else { bytes.small() }
    };
    let weights: Vec<f64> = (0..Layout::new(&architecture).parameters).map(|_| number(0.25)).collect();
    let q: Vec<f64> = (0..STATES * n).map(|_| number(0.5)).collect();
    let v: Vec<f64> = (0..STATES * n).map(|_| number(0.5)).collect();
    contract(&architecture, &weights, &q, &v);
    if !wild {
        derivatives(&architecture, &weights, &q, &v);
    }
}

/// An answer is finite or an error, whatever the numbers.
fn contract(architecture: &Architecture, weights: &[f64], q: &[f64], v: &[f64]) {
    let network = NetworkLagrangian::new(architecture.clone(), weights.to_vec()).expect("the weights fit");
    let mut terms = Terms::default();
    if network.terms(q, v, Request::ALL, &mut terms).is_ok() {
        for field in [&terms.momentum, &terms.dl_dq, &terms.mass_matrix, &terms.coriolis, &terms.acceleration] {
            assert!(finite(field), "{terms:?} of {architecture:?} {weights:?} {q:?} {v:?}");
        }
        assert!(finite(&terms.lagrangian) && finite(&terms.energy), "{terms:?}");
    }
}

fn fields(r: Reference<Dd>) -> [Vec<Dd>; 5] {
    [vec![r.lagrangian], r.p, r.g, r.m, r.c]
}

fn derivatives(architecture: &Architecture, weights: &[f64], q: &[f64], v: &[f64]) {
    let n = architecture.coordinates;
    let mut chunk = Evaluation::new(architecture.model().lagrangian().clone());
    chunk.evaluate(weights, q, v, Depth::Motion);
    for state in 0..STATES {
        let row = state * n..(state + 1) * n;
        let inputs: [Vec<Dd>; 3] = [cast(weights), cast(&q[row.clone()]), cast(&v[row.clone()])];
        let at = |[w, q, v]: &[Vec<Dd>; 3]| fields(reference(architecture, w, q, v));
        let exact = at(&inputs);
        let mut condition = exact.each_ref().map(|x| largest(x));
        for pattern in 0..6 {
            let mut random = Random(pattern);
            let moved = at(&inputs
                .each_ref()
                .map(|x| x.iter().map(|&x| x + x * Dd::of_f64(STEP * random.sign())).collect::<Vec<Dd>>()));
            for k in 0..5 {
                condition[k] = condition[k].max(apart(&moved[k], &exact[k]) / STEP);
            }
        }
        let found = [
            &chunk.lagrangian[state..=state],
            &chunk.momentum[row.clone()],
            &chunk.dl_dq[row.clone()],
            &chunk.mass_matrix[state * n * n..(state + 1) * n * n],
            &chunk.coriolis[row],
        ];
        for (k, name) in ["L", "p", "g", "M", "c"].into_iter().enumerate() {
            let error = apart(&cast(found[k]), &exact[k]);
            // Below the normal numbers digits are lost one by one.
            let bound = R * f64::EPSILON * condition[k] + f64::MIN_POSITIVE;
            assert!(error <= bound, "{name}: {error:e} > {bound:e} of {architecture:?} {weights:?} {q:?} {v:?}");
        }
    }
}
