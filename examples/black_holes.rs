//! Reads a black hole off free fall alone: trains the metric of a hole on time-like states and prints what no state showed, beside the
//! closed forms.
//!
//! `cargo run --release --example black_holes -- kerr-cartesian quick 0`: system, preset, seed; further arguments change epochs, rate,
//! optimizer and precision.

use lnn::configuration::Precision;
use lnn::geometry::{CircularOrbit, Equator, Sense, Turn, geometries};
use lnn::lagrangian::{Configured, EulerLagrange, Request, Terms, configure};
use lnn::network::NetworkLagrangian;
use lnn::optimizers::Method;
use lnn::presets::Preset;
use lnn::training::{Hooks, run};
use std::error::Error;

/// Error of metric components over their size, of points at a distance: median and 99 % of the directions.
fn metric_error(
    (exact, learned): (&dyn EulerLagrange<f64>, &dyn EulerLagrange<f64>),
    factor: f64,
    (low, high): (f64, f64),
) -> Result<[f64; 2], Box<dyn Error>> {
    let mut errors = Vec::new();
    const POINTS: usize = 4000;
    for k in 0..POINTS {
        // Directions of a Fibonacci sphere, distances uniform in their logarithm.
        let part = (k as f64 + 0.5) / POINTS as f64;
        let radius = low * (high / low).powf((k as f64 * 0.754_877_666).fract());
        let (z, angle) = (1.0 - 2.0 * part, 2.399_963_229_728_653 * k as f64);
        let across = (1.0 - z * z).sqrt();
        let q = [0.0, radius * across * angle.cos(), radius * across * angle.sin(), radius * z];
        let of = |model: &dyn EulerLagrange<f64>| -> Result<Vec<f64>, Box<dyn Error>> {
            let mut terms = Terms::default();
            model.terms(&q, &[0.0; 4], Request::MASS_MATRIX, &mut terms)?;
            Ok(terms.mass_matrix)
        };
        let (a, b) = (of(exact)?, of(learned)?);
        let size = a.iter().map(|x| x * x).sum::<f64>().sqrt();
        errors.push(a.iter().zip(&b).map(|(a, b)| (a - b / factor).powi(2)).sum::<f64>().sqrt() / size);
    }
    errors.sort_by(f64::total_cmp);
    Ok([errors[POINTS / 2], errors[POINTS * 99 / 100]])
}

/// `g(v, v)` over that of the exact metric, the mean over states on the mass shell.
fn factor(learned: &dyn EulerLagrange<f64>, q: &[f64], v: &[f64]) -> Result<f64, Box<dyn Error>> {
    let mut terms = Terms::default();
    learned.terms(q, v, Request::LAGRANGIAN, &mut terms)?;
    let mut shells: Vec<f64> = terms.lagrangian.iter().map(|l| -2.0 * l).collect();
    shells.sort_by(f64::total_cmp);
    Ok(shells[shells.len() / 2])
}

/// Quantities by name, nothing where the metric has none.
type Figures = Vec<(&'static str, Option<f64>)>;

/// What a metric says of its equator.
fn equator(model: &dyn EulerLagrange<f64>) -> Result<Figures, Box<dyn Error>> {
    let ray = Equator { model, time: 0, radius: 1, turn: Turn::Across(2), point: &[0.0; 4] };
    let (outside, through) = ((1.3, 20.0), (1.25, 20.0));
    let radius = |orbit: Option<CircularOrbit<f64>>| orbit.map(|orbit| orbit.radius);
    let impact = |orbit: Option<CircularOrbit<f64>>| orbit.map(|orbit| orbit.impact_parameter());
    let light = |sense| ray.light(outside, sense);
    let stable = |sense| ray.innermost_stable(outside, sense);
    Ok(vec![
        ("innermost stable orbit, forward", radius(stable(Sense::Forward)?)),
        ("innermost stable orbit, backward", radius(stable(Sense::Backward)?)),
        ("orbit of light, forward", radius(light(Sense::Forward)?)),
        ("orbit of light, backward", radius(light(Sense::Backward)?)),
        ("impact parameter, forward", impact(light(Sense::Forward)?)),
        ("impact parameter, backward", impact(light(Sense::Backward)?)),
        ("horizon", ray.horizon(through)?),
        ("ergosurface", ray.ergosurface(through)?),
        ("dragging of frames at R = 4", Some(ray.at(4.0)?.dragging())),
    ])
}

/// Ricci over the parts it is made of, and Kretschmann's scalar over the exact one, the largest of points at a distance.
fn curvature(
    exact: &dyn EulerLagrange<f64>,
    learned: &dyn EulerLagrange<f64>,
    factor: f64,
    radius: f64,
) -> Result<[f64; 2], Box<dyn Error>> {
    let mut worst = [0.0_f64; 2];
    for k in 0..12 {
        let (z, angle) = (1.0 - (2.0 * k as f64 + 1.0) / 12.0, 2.399_963_229_728_653 * k as f64);
        let across = (1.0 - z * z).sqrt();
        let q = [0.0, radius * across * angle.cos(), radius * across * angle.sin(), radius * z];
        let [a, b] = [exact, learned].map(|model| geometries(model, &q, &[0.0; 4]));
        let (a, b) = (a?.remove(0)?, b?.remove(0)?);
        let size = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        worst[0] = worst[0].max(size(&b.curvature.ricci) / size(&b.curvature.riemann));
        let ratio = b.curvature.kretschmann * factor * factor / a.curvature.kretschmann;
        worst[1] = worst[1].max((ratio - 1.0).abs());
    }
    Ok(worst)
}

fn show(
    hole: &Configured<f64>,
    learned: &NetworkLagrangian<f64>,
    test: (&[f64], &[f64]),
) -> Result<(), Box<dyn Error>> {
    let exact = hole.build()?;
    let factor = factor(learned, test.0, test.1)?;
    println!("metric error, median and 99 %, by R:");
    for range in [(1.25, 1.5), (1.5, 2.0), (2.0, 4.0), (4.0, 10.0), (10.0, 30.0), (1.5, 20.0)] {
        let [median, most] = metric_error((&*exact, learned), factor, range)?;
        println!("  {:5.2} to {:5.2}  {:8.4} %  {:8.4} %", range.0, range.1, 100.0 * median, 100.0 * most);
    }
    println!("{:34} {:>11} {:>11} {:>9}", "in the equator", "learned", "exact", "error");
    for ((name, found), (_, truth)) in equator(learned)?.into_iter().zip(equator(&*exact)?) {
        match (found, truth) {
            (Some(found), Some(truth)) => {
                println!("{name:34} {found:11.6} {truth:11.6} {:7.3} %", 100.0 * (found / truth - 1.0).abs());
            }
            (found, truth) => println!("{name:34} {found:?} {truth:?}"),
        }
    }
    for radius in [3.0, 6.0, 10.0] {
        let [ricci, kretschmann] = curvature(&*exact, learned, factor, radius)?;
        println!("R = {radius:4}: Ricci/Riemann {:.2} %, Kretschmann {:.2} %", 100.0 * ricci, 100.0 * kretschmann);
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let argument = |k: usize, default: &str| arguments.get(k).cloned().unwrap_or(default.to_string());
    let hole = configure::<f64>(&argument(0, "schwarzschild-cartesian"), &[])?;
    let preset = if argument(1, "quick") == "best" { Preset::Best } else { Preset::Quick };
    let mut config = preset.config(&hole).ok_or("no such preset")?;
    config.seed = argument(2, "0").parse()?;
    for change in arguments.iter().skip(3) {
        match change.split_once('=').ok_or("expected KEY=VALUE")? {
            ("epochs", n) => (config.phases[0].epochs, config.phases[0].t_max) = (n.parse()?, n.parse()?),
            ("rate", rate) => config.phases[0].rate = rate.parse()?,
            ("batch", batch) => config.optimizer.batch = batch.parse()?,
            ("clip", clip) => config.optimizer.clip = clip.parse()?,
            ("states", states) => config.data.training = states.parse()?,
            ("width", width) => config.network.hidden = vec![width.parse()?; 3],
            ("averaging", averaging) => config.optimizer.averaging = averaging.parse()?,
            ("decay", decay) => config.optimizer.weight_decay = decay.parse()?,
            ("method", "adam") => config.optimizer.method = Method::Adam,
            ("method", "radam") => config.optimizer.method = Method::Radam,
            ("method", "soap") => config.optimizer.method = Method::Soap,
            ("precision", "f64") => config.precision = Precision::F64,
            (key, _) => return Err(format!("no key {key}").into()),
        }
    }
    let began = std::time::Instant::now();
    let model = match config.precision {
        Precision::F32 => run::<f32>(&config, 1, &Hooks::default())?.model.cast::<f64>(),
        Precision::F64 => run::<f64>(&config, 1, &Hooks::default())?.model,
    };
    println!("{} {}: trained in {:.0} s", hole.system.name, config.seed, began.elapsed().as_secs_f64());
    // Other states than any that was learned from.
    config.seed += 1000;
    (config.data.training, config.data.validation, config.data.test) = (1, 1, 2000);
    let (fresh, _) = lnn::data::sample_all::<f64>(&config, &hole)?;
    show(&hole, &model, (fresh.test.q(), fresh.test.v()))
}
