use lnn::network::*;
use lnn::training::*;
use rand::*;
use rand_chacha::ChaCha8Rng;
fn main() {
    let args: Vec<usize> = std::env::args().skip(1).map(|x| x.parse().unwrap()).collect();
    let (w, threads) = (args[0], args[1]);
    let n = 2;
    let arch = Architecture {
        coordinates: n,
        hidden: vec![w; 3],
        activation: Activation::Gelu,
        alpha: 1.0,
        scale: vec![10.0; n],
        periodic: vec![true; n],
        embed_periodic: true,
    };
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut weights: Vec<f32> = initial_weights(&arch, Initialization::Default, &mut rng);
    let m = 4096;
    let mut r = |s: f32| -> Vec<f32> { (0..m * n).map(|_| rng.random_range(-s..s)).collect() };
    let data = Dataset::new(n, r(6.0), r(10.0), r(20.0)).unwrap();
    let mut obj = Objective::new(&arch, Penalty::Eigenvalue { lambda: 1.0 }, threads).unwrap();
    let mut g = vec![0f32; weights.len()];
    let rows: Vec<u32> = (0..128).collect();
    let mut mom = Moments::new(weights.len());
    let up = Update { method: Method::Radam, rate: 1e-4, weight_decay: 1e-6, clip: 1.0 };
    for _ in 0..20 {
        obj.step(&weights, &data, &rows, &mut g);
    }
    let mut best = f64::MAX;
    let mut ob = f64::MAX;
    for _ in 0..200 {
        let t = std::time::Instant::now();
        obj.step(&weights, &data, &rows, &mut g);
        best = best.min(t.elapsed().as_secs_f64());
        let t = std::time::Instant::now();
        mom.update(&mut weights, &g, &up);
        ob = ob.min(t.elapsed().as_secs_f64());
    }
    let t = std::time::Instant::now();
    let rep = obj.loss(&weights, &data);
    let ev = t.elapsed().as_secs_f64() / m as f64;
    println!(
        "width {w} threads {threads}: step {:.3} ms, optimizer {:.3} ms, eval {:.3} us/state  {:?}",
        best * 1e3,
        ob * 1e3,
        ev * 1e6,
        rep
    );
}
