//! Roll-outs: error at fixed output times against wall time and evaluations of the right-hand side.

use super::options::Options as Arguments;
use super::output::{Section, Table, curve, level, short};
use super::problems::{LEARNED, Problem, TAUGHT_BY, problems};
use super::reference::{Reference, distance, reference};
use super::summary::{cost_of, slope};
use super::timing::Timing;
use lnn::rollout::{Integrator, Rollout, RolloutOptions, Trajectory, rollout};
use lnn::scalar::{Dd, Scalar};
use std::hint::black_box;
use std::time::Instant;

const METHODS: [(Integrator, &str); 6] = [
    (Integrator::Dopri5, "Dopri5"),
    (Integrator::Dop853, "Dop853"),
    (Integrator::Midpoint, "midpoint"),
    (Integrator::Variational, "variational"),
    (Integrator::Gauss4, "Gauss-4"),
    (Integrator::Gauss6, "Gauss-6"),
];

const TEXT: &str = "\
Error: largest over the output times of the largest component of |y - y*|, relative to the largest component of any y*; \
final_error: the same at the last time alone; energy_error: largest |E - E(0)| relative to the largest |p.v|, E evaluated \
in double-double at the states found. Interpolation to the output times is part of the adaptive methods.
Settings: rtol = atol for Dopri5 and Dop853, the step for the others. Arithmetic is f64. Evaluations: accelerations for \
the adaptive methods, momenta and forces for the others, states of a batch counted singly.
Reference y*: Gauss collocation of order 6 in double-double at h, h/2, .., extrapolated in even powers of h; \
reference_bound is the relative difference of the last two columns and bounds its error. A learned model is compared with its own motion in double-double.
Amplification: what a relative error of the start grows to at worst, relative to the largest component.";

/// One measured run.
struct Point {
    setting: f64,
    error: f64,
    final_error: f64,
    energy_error: f64,
    evaluations: usize,
    time: Timing,
}

/// Measures every method on every problem.
///
/// # Errors
/// A learned model that cannot be read, trained or written.
pub fn section(arguments: &Arguments) -> Result<Section, String> {
    let list = problems(arguments)?;
    let target = arguments.choose(1e-14, 1e-17, 1e-18);
    // A network takes milliseconds per state in double-double.
    let (learned, exact) = arguments.choose((4, 4), (4, 6), (5, 7));
    let levels = |problem: &Problem| if problem.name == LEARNED { learned } else { exact };
    let refer = |problem: &Problem| {
        let begun = Instant::now();
        let found = reference(problem, target, levels(problem));
        eprintln!("reference of the {}: {:.1} s", problem.name, begun.elapsed().as_secs_f64());
        found
    };
    let references: Vec<Result<Reference, String>> = std::thread::scope(|scope| {
        let running: Vec<_> = list.iter().map(|problem| scope.spawn(|| refer(problem))).collect();
        running.into_iter().map(|r| r.join().unwrap_or_else(|_| Err("reference: panicked".into()))).collect()
    });
    let mut raw = Table::new(["problem", "method", "kind", "setting", "error", "final_error", "energy_error"]);
    raw.header.extend(["evaluations", "iterations", "accepted", "rejected"].map(String::from));
    raw.header
        .extend(Timing::HEADER.map(|name| if name == "repeats" { name.into() } else { format!("seconds_{name}") }));
    raw.header.extend(["reference_bound", "reference_step", "amplification"].map(String::from));
    let summary = Table::new([
        "problem",
        "method",
        "order",
        "least error",
        "ms at 1e-6",
        "ms at 1e-9",
        "calls at 1e-6",
        "calls at 1e-9",
        "least energy error",
        "amplification",
        "reference within",
    ]);
    let mut section = Section::new("rollouts", "Roll-outs", TEXT, raw, summary);
    for (problem, reference) in list.iter().zip(&references) {
        match reference {
            Ok(reference) => measure(arguments, problem, reference, &mut section),
            Err(error) => section.failed(problem.name, error),
        }
    }
    let of = |name: &str| list.iter().zip(&references).find(|(p, _)| p.name == name).and_then(|(_, r)| r.as_ref().ok());
    if let (Some(learned), Some(exact)) = (of(LEARNED), of(TAUGHT_BY)) {
        let error = distance(&learned.states, &exact.states).0 / exact.size;
        section.method.push_str(&format!("\nModel error of the {LEARNED} against the exact one: {error:.3e}."));
    }
    Ok(section)
}

fn measure(arguments: &Arguments, problem: &Problem, reference: &Reference, section: &mut Section) {
    let mut curves = [Vec::new(), Vec::new(), Vec::new()];
    for (method, name) in METHODS {
        let points = points(arguments, (problem, reference), (method, name), section);
        let cost = |p: &Point| p.time.median * 1e3;
        let pairs = |x: fn(&Point) -> f64, y: &dyn Fn(&Point) -> f64| -> Vec<(f64, f64)> {
            points.iter().map(|p| (x(p), y(p))).collect()
        };
        let calls = |p: &Point| p.evaluations as f64;
        let (by_time, by_calls) = (pairs(|p| p.error, &cost), pairs(|p| p.error, &calls));
        let regular: Vec<(f64, f64)> =
            points.iter().filter(|p| (1e-11..1e-2).contains(&p.error)).map(|p| (p.setting, p.error)).collect();
        let least = |x: fn(&Point) -> f64| points.iter().map(x).fold(f64::NAN, f64::min);
        let numbers = [
            slope(&regular),
            least(|p| p.error),
            cost_of(&by_time, 1e-6),
            cost_of(&by_time, 1e-9),
            cost_of(&by_calls, 1e-6),
            cost_of(&by_calls, 1e-9),
            least(|p| p.energy_error),
            reference.amplification,
            reference.bound,
        ];
        let mut row = vec![problem.name.to_string(), name.to_string()];
        row.extend(numbers.iter().enumerate().map(|(k, &x)| match k {
            0 if !x.is_nan() => format!("{x:.2}"),
            4 | 5 if !x.is_nan() => format!("{x:.0}"),
            _ => short(x),
        }));
        section.summary.rows.push(row);
        curves[0].push(curve(name, &by_time));
        curves[1].push(curve(name, &by_calls));
        curves[2].push(curve(name, &pairs(|p| p.energy_error, &cost)));
    }
    let file = problem.name.to_lowercase().replace(' ', "-");
    let floor = reference.amplification * f64::EPSILON;
    let what = [
        ("time", "error", "wall time per motion [ms]"),
        ("calls", "error", "evaluations of the right-hand side"),
        ("energy", "energy error", "wall time per motion [ms]"),
    ];
    for ((suffix, x, y), mut curves) in what.into_iter().zip(curves) {
        if suffix != "energy" {
            curves.push(level("eps x amplification", floor, &curves));
        }
        let span = format!("{}, t = 0 to {}", problem.name, problem.t_end);
        section.diagram(format!("{file}_{suffix}"), &span, &format!("relative {x}"), y, curves);
    }
}

/// Measures one method at every setting that is affordable.
fn points(
    arguments: &Arguments,
    (problem, reference): (&Problem, &Reference),
    (method, name): (Integrator, &str),
    section: &mut Section,
) -> Vec<Point> {
    // A network is slower, and its longer runs are what there is to see.
    let patience = if problem.name == LEARNED { arguments.choose(1.0, 8.0, 4.0) } else { 1.0 };
    let longest = patience * arguments.choose(0.002, 0.01, 0.06);
    let stopwatch = arguments.stopwatch();
    let fixed = method.is_structure_preserving();
    let settings: Vec<f64> = if fixed {
        (0..arguments.choose(5, 14, 20)).map(|k| problem.dt / f64::from(1u32 << k)).collect()
    } else {
        (3..=13).step_by(arguments.choose(5, 1, 1)).map(|k| 10f64.powi(-k)).collect()
    };
    let kind = if fixed { "step" } else { "rtol" };
    let mut points: Vec<Point> = Vec::new();
    for setting in settings {
        let case = || format!("{}, {name}, {kind} {setting:.3e}", problem.name);
        // Half the step takes about twice the time.
        if let Some(last) = points.last().filter(|last| fixed && 2.0 * last.time.median > longest) {
            let estimate = 2e3 * last.time.median;
            section.failed(case(), format!("this and smaller steps left out: a motion takes about {estimate:.1} ms"));
            break;
        }
        if at_floor(&points) {
            section.failed(case(), "this and finer settings left out: the error no longer falls (rounding floor)");
            break;
        }
        let base = RolloutOptions::new(problem.t_end, problem.dt).method(method).energy(false).max_steps(10_000_000);
        let options = if fixed { base.step(setting) } else { base.tolerances(setting, setting) };
        let run = || rollout(&*problem.model, black_box(&problem.q), &problem.v, &options);
        let Rollout { trajectory, statistics, stop, .. } = run();
        if let Some(stop) = stop {
            section.failed(case(), stop.to_string());
            continue;
        }
        let time = stopwatch.measure(|| {
            black_box(run());
        });
        let wide: Trajectory<Dd> = trajectory.cast();
        let (error, final_error) = distance(&wide, &reference.states);
        let energy = wide.energy_by(&*problem.wide);
        let drift = energy.iter().fold(0.0, |m: f64, &e| m.max((e - energy[0]).to_f64().abs()));
        let point = Point {
            setting,
            error: error / reference.size,
            final_error: final_error / reference.size,
            energy_error: drift / reference.energy_scale,
            evaluations: statistics.evaluations,
            time,
        };
        let mut row = vec![problem.name.to_string(), name.to_string(), kind.to_string()];
        row.extend([setting, point.error, point.final_error, point.energy_error].map(|x| format!("{x:.6e}")));
        let counts = [statistics.evaluations, statistics.iterations, statistics.accepted, statistics.rejected];
        row.extend(counts.map(|count| count.to_string()));
        row.extend(time.cells(1.0));
        row.extend([reference.bound, reference.step, reference.amplification].map(|x| format!("{x:.3e}")));
        section.raw.rows.push(row);
        points.push(point);
    }
    points
}

/// Whether the last two points gained nothing below an error of 1e-10.
fn at_floor(points: &[Point]) -> bool {
    let Some([a, b, c]) = points.last_chunk::<3>() else { return false };
    a.error < 1e-10 && b.error > 0.5 * a.error && c.error > 0.5 * a.error
}
