use lnn::network::*;
use lnn::training::*;
use rand::*;
use rand_chacha::ChaCha8Rng;
fn data(m: usize, rng: &mut ChaCha8Rng, lo: f64, hi: f64) -> Dataset<f32> {
    let (mut q, mut v, mut a) = (vec![], vec![], vec![]);
    for _ in 0..m {
        let (t1, t2) = (rng.random_range(lo..hi), rng.random_range(lo..hi));
        let (w1, w2): (f64, f64) = (rng.random_range(-10.0..10.0), rng.random_range(-10.0..10.0));
        let g = 9.8;
        let d: f64 = t1 - t2;
        let a1 = 0.5 * d.cos();
        let a2 = d.cos();
        let f1 = -0.5 * w2 * w2 * d.sin() - g * t1.sin();
        let f2 = w1 * w1 * d.sin() - g * t2.sin();
        let den = 1.0 - a1 * a2;
        q.extend([t1, t2]);
        v.extend([w1, w2]);
        a.extend([(f1 - a1 * f2) / den, (f2 - a2 * f1) / den]);
    }
    Dataset::new(2, q, v, a).unwrap().cast()
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let get = |k: &str, d: f64| -> f64 {
        a.iter().find_map(|x| x.strip_prefix(&format!("{k}="))).map(|x| x.parse().unwrap()).unwrap_or(d)
    };
    let w = get("w", 128.0) as usize;
    let n = 2;
    let layers = get("l", 3.0) as usize;
    let pi = std::f64::consts::PI;
    let phase = Phase {
        epochs: get("epochs", 20.0) as usize,
        rate: get("lr", 3e-3),
        eta_min: 0.0,
        schedule: Schedule::Cosine,
        t_max: 30.0,
        position: vec![],
        velocity: vec![],
    };
    let config = Config {
        system: "x".into(),
        seed: get("seed", 0.0) as u64,
        precision: Precision::F32,
        parameters: Default::default(),
        data: Data { training: 0, validation: 0, test: 0, validation_position: vec![], validation_velocity: vec![] },
        network: Network {
            hidden: vec![w; layers],
            activation: Activation::Gelu,
            alpha: get("alpha", 1.0),
            scaling: Scaling::Physical,
            embed_periodic: true,
            initialization: Initialization::Default,
        },
        penalty: Penalty::Eigenvalue { lambda: get("lambda", 100.0) },
        optimizer: Optimizer {
            method: Method::Radam,
            batch: get("batch", 128.0) as usize,
            weight_decay: get("wd", 1e-6),
            clip: get("clip", 1.0),
            averaging: get("ema", 0.0),
            on_failure: OnFailure::Skip,
        },
        phases: vec![phase],
    };
    let m = get("m", 60000.0) as usize;
    let seed = get("dseed", get("seed", 0.0)) as u64;
    let datasets = Datasets {
        training: vec![data(m, &mut ChaCha8Rng::seed_from_u64(100 + seed), 0.0, 2.0 * pi)],
        validation: data(12000, &mut ChaCha8Rng::seed_from_u64(200 + seed), 0.0, 2.0 * pi),
        test: data(12000, &mut ChaCha8Rng::seed_from_u64(300 + seed), 0.0, 2.0 * pi),
    };
    let arch = Architecture {
        coordinates: n,
        hidden: vec![w; layers],
        activation: Activation::Gelu,
        alpha: get("alpha", 1.0),
        scale: vec![10.0; n],
        periodic: vec![true; n],
        embed_periodic: true,
    };
    let hooks = Hooks {
        watcher: Some(std::sync::Arc::new(|p: Progress<'_>| {
            if let Progress::Epoch(e) = p {
                eprintln!(
                    "{:3} lr {:.2e} train {:.5} pen {:.4} act {:.4} val {:.5} |g| {:.3} sing {} skip {} {:.1}s",
                    e.epoch,
                    e.rate,
                    e.training_loss,
                    e.penalty,
                    e.penalised,
                    e.validation_loss,
                    e.gradient_norm,
                    e.left_out,
                    e.skipped,
                    e.seconds
                )
            }
        })),
        interrupt: Default::default(),
    };
    let t = train(&config, &arch, datasets, get("threads", 2.0) as usize, &hooks);
    match t {
        Ok(t) => println!(
            "{:?} best val {:.6} test {:.6} {:.1}s {:?}",
            a[1..].join(" "),
            t.validation_loss,
            t.test.loss,
            t.seconds,
            t.stop
        ),
        Err(e) => println!("{e}"),
    }
}
