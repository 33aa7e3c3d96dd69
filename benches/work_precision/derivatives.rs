//! Derivative engines on network Lagrangians: `M`, `c`, `a` and the parameter gradient.

use super::super::common::accuracy::cast;
use super::case::Case;
use super::differences::Order;
use super::engines::Bench;
use super::options::Options;
use super::output::{Section, Table, curve, level, short};
use super::timing::Timing;
use lnn::lagrangian::{EulerLagrange, Request, Terms};
use lnn::linalg::{Workspace, condition_number};
use lnn::scalar::{Dd, Scalar};

const TEXT: &str = "\
Networks of three hidden layers with GELU and the library's default weights, n coordinates; states within 10, scale 10. \
Weights, states and targets are f32 numbers, so that every precision evaluates the same function.
Error of motion: the largest of the relative errors of M, c and a in the maximum norm, worst state. Error of the gradient: \
maximum norm over all parameters, relative, of the paper's loss without penalty against random accelerations. Judge: the \
identities in double-double; their own errors are against nested forward numbers, and on the tape, in double-double.
Identity: the forward identity for motion, the adjoint identity for the gradient. Nested: forward numbers over the \
reference network, state by state. Tape: the scalar tape, reverse over forward; for the gradient nested forward numbers on \
it. Differences: central, of values in f64 alone, at the step with the least error; of the gradient for a few parameters, \
drawn at random, the time multiplied to all.
Floor: eps of the precision times the condition number of M, worst state.";

/// Measures every engine on every network.
///
/// # Errors
/// A network or dataset that cannot be made.
pub fn section(options: &Options) -> Result<Section, String> {
    let mut raw = Table::new(["quantity", "engine", "precision", "n", "width", "batch", "parameters", "step"]);
    raw.header.extend(["error_m", "error_c", "error_a", "error", "floor", "condition"].map(String::from));
    let times =
        |unit: &str| Timing::HEADER.map(|name| if name == "repeats" { name.into() } else { format!("{unit}_{name}") });
    raw.header.extend(times("ns_per_state"));
    raw.header.push("ns_per_state_and_parameter".into());
    let summary = Table::new([
        "quantity",
        "engine",
        "precision",
        "n",
        "width",
        "batch",
        "error",
        "floor",
        "ns per state",
        "per parameter",
    ]);
    let mut section = Section::new("derivatives", "Derivative engines", TEXT, raw, summary);
    let widths: &[usize] = options.choose(&[16], &[16, 128], &[16, 128, 500]);
    for &width in widths {
        for n in [2, 6] {
            for batch in [1, options.choose(8, 128, 128)] {
                measure(options, &Case::new(n, width, batch), &mut section)?;
            }
        }
    }
    Ok(section)
}

fn measure(options: &Options, case: &Case, section: &mut Section) -> Result<(), String> {
    let mut judge = Terms::default();
    let request = Request::ACCELERATION;
    if let Err(error) = case.network::<Dd>()?.terms(&cast(&case.q), &cast(&case.v), request, &mut judge) {
        section.failed(case.name(), error.to_string());
        return Ok(());
    }
    let size = case.n * case.n;
    let condition = judge.mass_matrix.chunks_exact(size).map(|m| condition_number(case.n, m, &mut Workspace::new()));
    let condition = condition.map(|c| c.unwrap_or(f64::NAN)).fold(1.0, f64::max);
    let slope = vec![Dd::of_f64(0.0); case.weights.len()];
    let (stopwatch, found, failures) = (options.stopwatch(), Vec::new(), Vec::new());
    let mut bench = Bench { case, stopwatch, judge, slope, condition, found, failures };
    bench.slope = bench.adjoint_identity::<Dd>()?;
    bench.forward_identity::<Dd>()?;
    bench.forward_identity::<f64>()?;
    bench.forward_identity::<f32>()?;
    bench.mixed()?;
    bench.adjoint_identity::<f64>()?;
    bench.adjoint_identity::<f32>()?;
    if case.batch == 1 {
        bench.nested::<f32>()?;
        bench.nested::<f64>()?;
        bench.nested::<Dd>()?;
        bench.tape::<f32>()?;
        bench.tape::<f64>()?;
        bench.tape::<Dd>()?;
        bench.gradients_on_the_tape(options)?;
    }
    for order in Order::ALL {
        bench.differences(order)?;
        bench.differences_of_the_loss(order, options.choose(2, 8, 8))?;
    }
    bench.judge_the_judges();
    report(&bench, section);
    Ok(())
}
/// Adds rows and diagrams of one case.
fn report(bench: &Bench<'_>, section: &mut Section) {
    let case = bench.case;
    let (states, parameters) = (case.batch as f64, case.weights.len() as f64);
    for m in &bench.found {
        let name = [m.quantity, m.engine, m.precision].map(String::from);
        let shape = [case.n, case.width, case.batch].map(|x| x.to_string());
        let per_state = m.time.median * 1e9 / states;
        let mut row = [&name[..], &shape].concat();
        row.extend([case.weights.len().to_string(), short(m.step)]);
        let parts = if m.quantity == "motion" { [0, 1, 2].map(|k| m.errors[k]) } else { [f64::NAN; 3] };
        row.extend(parts.map(short));
        row.extend([m.error(), m.floor, bench.condition].map(short));
        row.extend(m.time.cells(1e9 / states));
        row.push(format!("{:.4e}", per_state / parameters));
        section.raw.rows.push(row);
        let mut row = [&name[..], &shape].concat();
        row.extend([
            short(m.error()),
            short(m.floor),
            format!("{per_state:.0}"),
            format!("{:.2e}", per_state / parameters),
        ]);
        section.summary.rows.push(row);
    }
    for (case, reason) in &bench.failures {
        section.failed(case, reason);
    }
    for quantity in ["motion", "gradient"] {
        let mut engines: Vec<&str> = Vec::new();
        for m in bench.found.iter().filter(|m| m.quantity == quantity) {
            if !engines.contains(&m.engine) {
                engines.push(m.engine);
            }
        }
        let mut curves: Vec<_> = engines
            .iter()
            .map(|&engine| {
                let of = bench.found.iter().filter(|m| m.quantity == quantity && m.engine == engine);
                let mut points: Vec<(f64, f64)> = of.map(|m| (m.error(), m.time.median * 1e9 / states)).collect();
                points.sort_by(|a, b| b.0.total_cmp(&a.0));
                curve(engine, &points)
            })
            .collect();
        curves.push(level("eps (f64) x condition", f64::EPSILON * bench.condition, &curves));
        curves.push(level(
            "eps (f32) x condition",
            f64::from(f32::EPSILON) * bench.condition,
            &curves[..engines.len()],
        ));
        let title =
            format!("{} by precision, {}", if quantity == "motion" { "M, c, a" } else { "Gradient" }, case.name());
        let file = format!("{quantity}_n{}_w{}_b{}", case.n, case.width, case.batch);
        section.diagram(file, &title, "relative error", "time per state [ns]", curves);
    }
}
