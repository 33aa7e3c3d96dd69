//! Double pendulum from noisy positions: supervised training on true and on smoothed accelerations against shooting.
//!
//! Takes minutes; run it by `cargo test --release --test shooting_noise -- --ignored --nocapture`. `SHOOTING` holds settings
//! to try, JSON objects separated by `;`, and `MODELS` a file that keeps the supervised models from run to run.

use lnn::analysis::acceleration_errors;
use lnn::lagrangian::{EulerLagrange, Request, Terms, configure};
use lnn::network::{Architecture, NetworkLagrangian};
use lnn::recording::Track;
use lnn::rollout::{Options, rollout};
use lnn::training::shooting::{Estimated, Noise, Shooting, Task, fit};
use lnn::training::{Config, Dataset, Datasets, Hooks, Preset, Progress, train};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const N: usize = 2;
const SAMPLES: usize = 500;
const DT: f64 = 0.01;

type Exact = Box<dyn EulerLagrange<f64>>;
/// Error, half window and `q`, `v`, `a` of every trajectory.
type Smoothing = (f64, usize, Vec<[Vec<f64>; 3]>);

/// Trajectories `(q, v)` from starts at moderate energy.
fn trajectories(exact: &Exact, count: usize, rng: &mut ChaCha8Rng) -> Vec<(Vec<f64>, Vec<f64>)> {
    let options = Options { energy: false, ..Options::reference(DT * (SAMPLES - 1) as f64, DT) };
    (0..count)
        .map(|_| {
            let mut draw = |size: f64| [0, 1].map(|_| rng.random_range(-size..size));
            let (q, v) = (draw(1.5), draw(1.0));
            let motion = rollout(&**exact, &q, &v, &options).complete().unwrap();
            assert_eq!(motion.len(), SAMPLES);
            (motion.q, motion.v)
        })
        .collect()
}

fn accelerations(exact: &Exact, q: &[f64], v: &[f64]) -> Vec<f64> {
    let mut terms = Terms::default();
    exact.terms(q, v, Request::ACCELERATION, &mut terms).unwrap();
    terms.acceleration
}

/// Local polynomials of degree 4 through `2 half + 1` samples, moved inwards at the ends: `q`, `v`, `a`.
fn smooth(q: &[f64], half: usize) -> [Vec<f64>; 3] {
    const TERMS: usize = 5;
    let width = 2 * half + 1;
    let mut out = [(); 3].map(|()| vec![0.0; q.len()]);
    for sample in 0..SAMPLES {
        let first = sample.saturating_sub(half).min(SAMPLES - width);
        let at = |k: usize| (first + k) as f64 / half as f64 - sample as f64 / half as f64;
        let powers = |k: usize| -> [f64; TERMS] { std::array::from_fn(|p| at(k).powi(p as i32)) };
        let mut matrix = vec![0.0; TERMS * TERMS];
        for k in 0..width {
            let x = powers(k);
            (0..TERMS * TERMS).for_each(|e| matrix[e] += x[e / TERMS] * x[e % TERMS]);
        }
        for i in 0..N {
            let mut right = vec![0.0; TERMS];
            for k in 0..width {
                let x = powers(k);
                (0..TERMS).for_each(|p| right[p] += x[p] * q[(first + k) * N + i]);
            }
            let mut c = vec![0.0; TERMS];
            lnn::linalg::solve(TERMS, &matrix, &right, &mut c, &mut lnn::linalg::Workspace::new()).unwrap();
            let unit = half as f64 * DT;
            let derivatives = [c[0], c[1] / unit, 2.0 * c[2] / unit.powi(2)];
            (0..3).for_each(|d| out[d][sample * N + i] = derivatives[d]);
        }
    }
    out
}

/// `mean |a - exact| / mean |exact|`.
fn relative(a: &[f64], exact: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(exact).map(|(a, b)| (a - b).abs()).sum();
    sum / exact.iter().map(|a| a.abs()).sum::<f64>()
}

/// Columns of several lists one after the other.
fn joined<'a>(parts: impl Iterator<Item = &'a Vec<f64>>) -> Vec<f64> {
    parts.flatten().copied().collect()
}

/// Error of learned accelerations on fresh states, and the paper's loss there.
fn judge(name: &str, exact: &Exact, architecture: &Architecture, weights: &[f32], fresh: &(Vec<f64>, Vec<f64>)) -> f64 {
    let weights: Vec<f64> = weights.iter().map(|&w| f64::from(w)).collect();
    let model = NetworkLagrangian::new(architecture.clone(), weights).unwrap();
    let (q, v) = fresh;
    let errors = acceleration_errors(&**exact, &model, q, v);
    let a = accelerations(exact, q, v);
    let size = a.iter().map(|a| a.abs()).sum::<f64>() / a.len() as f64;
    let relative = errors.iter().map(|e| e.mean).sum::<f64>() / N as f64 / size;
    let paper = errors.iter().zip(&architecture.scale).map(|(e, s)| e.mean / s).sum::<f64>() / (2 * N) as f64;
    let failed = errors[0].failed;
    println!("{name:34} relative error {:8.3} %   paper loss {paper:9.5}   failed {failed}", 100.0 * relative);
    relative
}

#[test]
#[ignore = "takes minutes"]
fn shooting_beats_smoothing() {
    let system = configure::<f64>("double-pendulum", &[]).unwrap();
    let exact = system.build().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let clean = trajectories(&exact, 50, &mut rng);
    let fresh = trajectories(&exact, 20, &mut rng);
    let tenth = |x: &Vec<f64>| -> Vec<f64> { x.chunks(N).step_by(10).flatten().copied().collect() };
    let fresh: (Vec<f64>, Vec<f64>) =
        (fresh.iter().flat_map(|f| tenth(&f.0)).collect(), fresh.iter().flat_map(|f| tenth(&f.1)).collect());
    // Noise of one percent of each coordinate's standard deviation.
    let sigma: Vec<f64> = (0..N)
        .map(|i| {
            let column: Vec<f64> = clean.iter().flat_map(|(q, _)| q.iter().skip(i).step_by(N).copied()).collect();
            let mean = column.iter().sum::<f64>() / column.len() as f64;
            0.01 * (column.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / column.len() as f64).sqrt()
        })
        .collect();
    let noisy: Vec<Vec<f64>> = clean
        .iter()
        .map(|(q, _)| {
            let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
            q.iter().enumerate().map(|(k, q)| q + sigma[k % N] * noise()).collect()
        })
        .collect();
    let truth: Vec<Vec<f64>> = clean.iter().map(|(q, v)| accelerations(&exact, q, v)).collect();
    let mut best: Option<Smoothing> = None;
    for half in [6, 8, 10, 12, 14, 17, 20, 25] {
        let smoothed: Vec<_> = noisy.iter().map(|q| smooth(q, half)).collect();
        let error = relative(&joined(smoothed.iter().map(|s| &s[2])), &joined(truth.iter()));
        if best.as_ref().is_none_or(|best| error < best.0) {
            best = Some((error, half, smoothed));
        }
    }
    let (error, half, smoothed) = best.unwrap();
    println!("sigma {sigma:?}; best window {} samples: accelerations err by {:.2} %", 2 * half + 1, 100.0 * error);

    // 40 trajectories to learn from, 10 to choose by.
    let set = |range: std::ops::Range<usize>, smooth: bool| -> Dataset<f64> {
        let pick = |d: usize| {
            joined(range.clone().map(|k| match (smooth, d) {
                (true, _) => &smoothed[k][d],
                (_, 0) => &clean[k].0,
                (_, 1) => &clean[k].1,
                _ => &truth[k],
            }))
        };
        Dataset::new(N, pick(0), pick(1), pick(2)).unwrap()
    };
    let mut config: Config = Preset::Quick.config(&system).unwrap();
    config.phases[0].epochs = 60;
    let scale = set(0..40, true).physical_scale();
    let architecture = config.architecture(&system, scale);
    let penalty = config.penalty().unwrap();
    let cache = std::env::var("MODELS").ok();
    let kept = cache.as_ref().and_then(|path| std::fs::read_to_string(path).ok());
    let models: Vec<Vec<f32>> = kept.map(|text| serde_json::from_str(&text).unwrap()).unwrap_or_else(|| {
        [false, true]
            .map(|smooth| {
                let (training, validation) = (set(0..40, smooth).cast(), set(40..50, smooth).cast());
                let data = Datasets { training: vec![training], test: Dataset::clone(&validation), validation };
                let trained = train::<f32>(&config, &architecture, penalty, data, 2, &Hooks::default()).unwrap();
                println!("supervised: {:.1} s", trained.seconds);
                trained.weights
            })
            .to_vec()
    });
    if let Some(path) = &cache {
        std::fs::write(path, serde_json::to_string(&models).unwrap()).unwrap();
    }
    judge("supervised, true accelerations", &exact, &architecture, &models[0], &fresh);
    let smoothing = judge("supervised, smoothed accelerations", &exact, &architecture, &models[1], &fresh);

    let times: Vec<f64> = (0..SAMPLES).map(|k| DT * k as f64).collect();
    let tracks: Vec<Track> = noisy
        .iter()
        .map(|q| {
            let (times, q) = (times.clone(), q.clone());
            Track { name: String::new(), times, q, v: vec![], a: vec![], force: vec![] }
        })
        .collect();
    let estimated: Vec<Estimated<'_>> =
        tracks.iter().zip(&smoothed).map(|(track, [q, v, _])| Estimated { track, q, v }).collect();
    let noise = Noise { q: sigma, v: vec![] };
    let settings = std::env::var("SHOOTING").unwrap_or("{}".to_string());
    let mut worst = 0.0_f64;
    for text in settings.split(';') {
        let settings: Shooting = serde_json::from_str(text).unwrap();
        let task = Task {
            architecture: &architecture,
            penalty,
            weights: models[1].clone(),
            training: &estimated[..40],
            validation: &estimated[40..],
            noise: &noise,
            seed: 0,
        };
        let quiet = std::env::var_os("QUIET").is_some();
        let hooks = Hooks {
            watcher: Some(std::sync::Arc::new(move |progress: Progress<'_>| {
                if let Progress::Epoch(e) = progress
                    && !quiet
                    && (e.epoch < 3 || e.epoch % 5 == 0)
                {
                    println!(
                        "  {:3} rate {:.1e} training {:.4} validation {:.4} |g| {:.2e} out {} skipped {} {:.0} s",
                        e.epoch,
                        e.rate,
                        e.training_loss,
                        e.validation_loss,
                        e.gradient_norm,
                        e.left_out,
                        e.skipped,
                        e.seconds
                    );
                }
            })),
            ..Hooks::default()
        };
        println!("{text}");
        let fitted = fit(&settings, task, 2, &hooks).unwrap();
        println!(
            "  {} segments, {} steps (error {:.4}), loss {:.4} -> {:.4}, {:.0} s",
            fitted.segments.0,
            fitted.steps,
            fitted.integration_error,
            fitted.start_loss,
            fitted.validation_loss,
            fitted.seconds
        );
        let shooting = judge("  shooting", &exact, &architecture, &fitted.weights, &fresh);
        worst = worst.max(shooting);
    }
    assert!(worst < smoothing);
}
