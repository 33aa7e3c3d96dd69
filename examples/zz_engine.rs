use lnn::lagrangian::Lagrangian;
use lnn::network::*;
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{Evaluation, MixedDirections, Recorded};
use std::sync::Arc;
use std::time::Instant;
use rand::SeedableRng;

fn arch(n: usize, hidden: Vec<usize>, a: Nonlinearity, emb: bool, dyt: bool) -> Architecture {
    Architecture {
        coordinates: n, hidden, activation: a, alpha: 0.3, time_like: if n > 2 { Some(0) } else { None },
        scale: (0..n).map(|i| 1.0 + 0.5 * i as f64).collect(), periodic: vec![emb; n], embed_periodic: emb,
        input_layer: if dyt { InputLayer::Dyt } else { InputLayer::None }, dissipation: None,
    }
}
fn record<S: Scalar>(a: &Architecture) -> Arc<Recorded<S>> {
    let scale = a.scale.iter().map(|&s| S::of_f64(s)).collect();
    Arc::new(Recorded::new(scale, Layout::new(a).parameters, |p, q, v| a.lagrangian(p, q, v)).unwrap())
}
fn state<S: Scalar>(k: usize, seed: f64) -> Vec<S> {
    (0..k).map(|i| S::of_f64(((i as f64 * 1.7 + seed) * 1.3).sin() * 1.5)).collect()
}
fn diff<S: Scalar>(a: &[S], b: &[S]) -> f64 {
    assert_eq!(a.len(), b.len());
    let size = a.iter().map(|x| x.to_f64().abs()).fold(1e-300, f64::max);
    a.iter().zip(b).map(|(&x, &y)| (x - y).to_f64().abs()).fold(0.0, f64::max) / size
}
fn compare<S: Scalar>(a: &Architecture, batch: usize) {
    let n = a.coordinates;
    let w: Vec<S> = initial_weights(a, Initialization::Default, &mut rand_chacha::ChaCha8Rng::seed_from_u64(3));
    let (q, v) = (state::<S>(batch * n, 0.1), state::<S>(batch * n, 5.0));
    let mut chunk = Chunk::new(a);
    chunk.evaluate(&w, &q, &v, Depth::Training);
    let mut e = Evaluation::new(record::<S>(a));
    for d in [lnn::tape::Depth::Value, lnn::tape::Depth::Gradient, lnn::tape::Depth::MassMatrix, lnn::tape::Depth::Motion, lnn::tape::Depth::Training] {
        e.evaluate(&w, &q, &v, d);
        print!("{:?}: L {:.1e} ", d, diff(&chunk.lagrangian, &e.lagrangian));
        if d > lnn::tape::Depth::Value { print!("p {:.1e} g {:.1e} ", diff(&chunk.momentum, &e.momentum), diff(&chunk.dl_dq, &e.dl_dq)); }
        if d > lnn::tape::Depth::Gradient { print!("M {:.1e} ", diff(&chunk.mass_matrix, &e.mass_matrix)); }
        if d > lnn::tape::Depth::MassMatrix { print!("c {:.1e} ", diff(&chunk.coriolis, &e.coriolis)); }
    }
    let mut adj = Adjoint::new(&chunk);
    for moving in [true, false] {
        let jets = Jets { state: (0..batch).collect(), s: state(batch * n, 2.0), t: state(batch * n, 3.0), moving };
        let mut g = vec![S::of_f64(0.0); w.len()];
        let (mut dq, mut dv) = (vec![S::of_f64(0.0); batch * n], vec![S::of_f64(0.0); batch * n]);
        adj.add_gradient_and_inputs(&chunk, &w, &jets, &mut g, (&mut dq, &mut dv));
        let d = MixedDirections { s: jets.s.clone(), t: jets.t.clone(), moving };
        let mut g2 = vec![S::of_f64(0.0); w.len()];
        let (mut dq2, mut dv2) = (vec![S::of_f64(0.0); batch * n], vec![S::of_f64(0.0); batch * n]);
        e.add_gradient(&w, &d, &mut g2, Some((&mut dq2, &mut dv2)));
        let mut g3 = vec![S::of_f64(0.0); w.len()];
        e.add_gradient(&w, &d, &mut g3, None);
        print!(" grad {:.1e} {:.1e} dq {:.1e} dv {:.1e}", diff(&g, &g2), diff(&g, &g3), diff(&dq, &dq2), diff(&dv, &dv2));
    }
    println!();
}
fn bench<S: Scalar>(a: &Architecture, batch: usize) {
    let n = a.coordinates;
    let w: Vec<S> = initial_weights(a, Initialization::Default, &mut rand_chacha::ChaCha8Rng::seed_from_u64(3));
    let (q, v) = (state::<S>(batch * n, 0.1), state::<S>(batch * n, 5.0));
    let mut chunk = Chunk::new(a);
    let mut adj = Adjoint::new(&chunk);
    let mut e = Evaluation::new(record::<S>(a));
    let jets = Jets { state: (0..batch).collect(), s: state(batch * n, 2.0), t: state(batch * n, 3.0), moving: true };
    let d = MixedDirections { s: jets.s.clone(), t: jets.t.clone(), moving: true };
    let mut g = vec![S::of_f64(0.0); w.len()];
    let (mut best, mut motion) = ([f64::MAX; 2], [f64::MAX; 2]);
    let reps = (3e8 / (w.len() * batch * (n + 11)) as f64).max(1.0) as usize;
    for _ in 0..7 {
        for which in 0..2 {
            let t = Instant::now();
            for _ in 0..reps {
                if which == 0 { chunk.evaluate(&w, &q, &v, Depth::Training); adj.add_gradient(&chunk, &w, &jets, &mut g); }
                else { e.evaluate(&w, &q, &v, lnn::tape::Depth::Training); e.add_gradient(&w, &d, &mut g, None); }
            }
            best[which] = best[which].min(t.elapsed().as_secs_f64() / reps as f64);
            let t = Instant::now();
            for _ in 0..reps {
                if which == 0 { chunk.evaluate(&w, &q, &v, Depth::Motion); } else { e.evaluate(&w, &q, &v, lnn::tape::Depth::Motion); }
            }
            motion[which] = motion[which].min(t.elapsed().as_secs_f64() / reps as f64);
        }
    }
    println!("{} n={n} {:?} batch {batch}: step {:.1} -> {:.1} us ({:.3}); motion {:.2} -> {:.2} us ({:.3})", S::NAME, a.hidden,
        best[0] * 1e6, best[1] * 1e6, best[1] / best[0], motion[0] * 1e6, motion[1] * 1e6, motion[1] / motion[0]);
}
fn main() {
    if std::env::args().nth(1).is_some() {
        for n in [2, 4, 20] { for h in [128, 500] {
            let a = arch(n, vec![h; 3], Nonlinearity::Gelu, false, false);
            for b in [1, 8, 64] { bench::<f32>(&a, b); bench::<f64>(&a, b); }
        }}
        return;
    }
    for act in Nonlinearity::ALL {
        for (emb, dyt) in [(false, false), (true, false), (true, true)] {
            for n in [1, 2, 3] {
                let a = arch(n, vec![6, 4], act, emb, dyt);
                print!("{act} {emb} {dyt} {n} "); compare::<Dd>(&a, 3);
            }
        }
    }
    compare::<f64>(&arch(2, vec![32, 32], Nonlinearity::Gelu, true, false), 64);
}
