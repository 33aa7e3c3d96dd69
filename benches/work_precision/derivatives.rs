//! Derivative engines on network Lagrangians: `M`, `c`, `a` and the parameter gradient.

use super::differences::{Differences, Displaced, Order};
use super::options::Options;
use super::output::{Section, Table, curve, level, short};
use super::timing::{Stopwatch, Timing};
use crate::common::nested::reference;
use crate::common::{accuracy::cast, of_scalar, solve};
use lnn::lagrangian::{EulerLagrange, HandWritten, Lagrangian, Request, Terms};
use lnn::linalg::{Workspace, condition_number};
use lnn::network::{Architecture, Initialization, InputLayer, NetworkLagrangian, Nonlinearity, initial_weights};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{ScalarFunction, gradient, hessian};
use lnn::training::{Dataset, Objective, Penalty};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;

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

/// States and accelerations beyond this reach do not occur.
const REACH: f64 = 10.0;

/// A network, states and targets, all exact in `f32`.
struct Case {
    n: usize,
    width: usize,
    batch: usize,
    architecture: Architecture,
    weights: Vec<f32>,
    q: Vec<f32>,
    v: Vec<f32>,
    targets: Vec<f32>,
}

impl Case {
    fn new(n: usize, width: usize, batch: usize) -> Self {
        let architecture = Architecture {
            coordinates: n,
            hidden: vec![width; 3],
            activation: Nonlinearity::Gelu,
            alpha: 1.0,
            scale: vec![REACH; n],
            periodic: vec![false; n],
            embed_periodic: false,
            input_layer: InputLayer::None,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let weights = initial_weights(&architecture, Initialization::Default, &mut rng);
        let mut draw = || (0..batch * n).map(|_| rng.random_range(-REACH..REACH) as f32).collect();
        let (q, v, targets) = (draw(), draw(), draw());
        Self { n, width, batch, architecture, weights, q, v, targets }
    }

    fn network<S: Scalar>(&self) -> Result<NetworkLagrangian<S>, String> {
        NetworkLagrangian::new(self.architecture.clone(), cast(&self.weights)).map_err(|e| e.to_string())
    }

    fn data<S: Scalar>(&self) -> Result<Dataset<S>, String> {
        Dataset::new(self.n, cast(&self.q), cast(&self.v), cast(&self.targets)).map_err(|e| e.to_string())
    }

    fn name(&self) -> String {
        format!("n = {}, width {}, batch {}", self.n, self.width, self.batch)
    }
}

/// One engine at work.
struct Measured {
    quantity: &'static str,
    engine: &'static str,
    precision: &'static str,
    step: f64,
    /// Errors of `M`, `c`, `a` in turn, or of the gradient.
    errors: Vec<f64>,
    floor: f64,
    time: Timing,
}

impl Measured {
    fn error(&self) -> f64 {
        self.errors.iter().copied().fold(0.0, |m, e| if e.is_nan() { e } else { m.max(e) })
    }
}

/// What all engines of a case are measured with.
struct Bench<'a> {
    case: &'a Case,
    stopwatch: Stopwatch,
    /// Motion and gradient in double-double.
    judge: Terms<Dd>,
    slope: Vec<Dd>,
    condition: f64,
    found: Vec<Measured>,
    failures: Vec<(String, String)>,
}

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
    bench.report(section);
    Ok(())
}

/// Largest difference over the largest magnitude.
fn relative<S: Scalar>(found: &[S], exact: &[Dd]) -> f64 {
    let largest = |m: f64, x: f64| if x.is_nan() { x } else { m.max(x.abs()) };
    let error = found.iter().zip(exact).map(|(x, &y)| (x.cast::<Dd>() - y).to_f64()).fold(0.0, largest);
    error / exact.iter().map(|x| x.to_f64()).fold(0.0, largest)
}

/// Relative errors of `M`, `c`, `a`, the worst state of each.
fn errors<S: Scalar>(n: usize, found: &Terms<S>, exact: &Terms<Dd>) -> Vec<f64> {
    let worst = |found: &[S], exact: &[Dd], size: usize| {
        found
            .chunks_exact(size)
            .zip(exact.chunks_exact(size))
            .map(|(f, e)| relative(f, e))
            .fold(0.0, |m: f64, e| if e.is_nan() { e } else { m.max(e) })
    };
    vec![
        worst(&found.mass_matrix, &exact.mass_matrix, n * n),
        worst(&found.coriolis, &exact.coriolis, n),
        worst(&found.acceleration, &exact.acceleration, n),
    ]
}

/// A Lagrangian as a function of the state `(q, v)`.
struct OfState<'a, S> {
    architecture: &'a Architecture,
    weights: &'a [S],
}

impl<S: Scalar> ScalarFunction for OfState<'_, S> {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let weights: Vec<R> = self.weights.iter().map(|&w| of_scalar(w)).collect();
        self.architecture.lagrangian(&weights, &x[..x.len() / 2], &x[x.len() / 2..])
    }
}

/// The paper's loss of the states of a case as a function of the weights.
struct OfWeights<'a>(&'a Case);

impl ScalarFunction for OfWeights<'_> {
    fn eval<R: Real>(&self, weights: &[R]) -> R {
        let case = self.0;
        let n = case.n;
        let constant = |x: &[f32]| -> Vec<R> { x.iter().map(|&x| of_scalar(x)).collect() };
        let states = case.q.chunks_exact(n).zip(case.v.chunks_exact(n)).zip(case.targets.chunks_exact(n));
        let total = states.fold(R::zero(), |total, ((q, v), target)| {
            let terms = reference(&case.architecture, weights, &constant(q), &constant(v));
            let force: Vec<R> = terms.g.iter().zip(&terms.c).map(|(&g, &c)| g - c).collect();
            let scaled = constant(target).into_iter().map(|t| t / R::from_f64(REACH));
            solve(n, &terms.m, &force).into_iter().zip(scaled).fold(total, |sum, (a, t)| sum + (a - t).abs())
        });
        total / R::from_f64((2 * n * case.batch) as f64)
    }
}

impl Bench<'_> {
    fn add(&mut self, what: (&'static str, &'static str, &'static str), step: f64, errors: Vec<f64>, time: Timing) {
        let (quantity, engine, precision) = what;
        let eps = match precision {
            "f32" => f64::from(f32::EPSILON),
            "dd" => Dd::EPSILON.to_f64(),
            _ => f64::EPSILON,
        };
        let floor = eps * self.condition;
        self.found.push(Measured { quantity, engine, precision, step, errors, floor, time });
    }

    fn failed(&mut self, engine: &str, precision: &str, reason: String) {
        self.failures.push((format!("{engine}, {precision}, {}", self.case.name()), reason));
    }

    fn forward_identity<S: Scalar>(&mut self) -> Result<(), String> {
        self.motion::<S>("identity", &self.case.network::<S>()?);
        Ok(())
    }

    fn nested<S: Scalar>(&mut self) -> Result<(), String> {
        let weights = cast(&self.case.weights);
        self.motion::<S>("nested", &HandWritten::new(self.case.architecture.clone(), weights));
        Ok(())
    }

    /// Times a source of Euler-Lagrange terms.
    fn motion<S: Scalar>(&mut self, engine: &'static str, model: &dyn EulerLagrange<S>) {
        let (q, v): (Vec<S>, Vec<S>) = (cast(&self.case.q), cast(&self.case.v));
        let (mut terms, mut outcome) = (Terms::default(), Ok(()));
        let time = self.stopwatch.measure(|| {
            outcome = black_box(model.terms(black_box(&q), &v, Request::ACCELERATION, &mut terms));
        });
        match outcome {
            Ok(()) => self.add(("motion", engine, S::NAME), f64::NAN, errors(self.case.n, &terms, &self.judge), time),
            Err(error) => self.failed(engine, S::NAME, error.to_string()),
        }
    }

    /// The Hessian of the Lagrangian by the scalar tape, reverse over forward.
    fn tape<S: Scalar>(&mut self) -> Result<(), String> {
        let (case, n) = (self.case, self.case.n);
        let weights: Vec<S> = cast(&case.weights);
        let f = OfState { architecture: &case.architecture, weights: &weights };
        let (x, v): (Vec<S>, Vec<S>) = (cast(&[&*case.q, &*case.v].concat()), cast(&case.v));
        let mut workspace = Workspace::new();
        let mut run = || -> Result<Terms<S>, String> {
            let (_, first, second) = hessian(&f, black_box(&x)).map_err(|e| e.to_string())?;
            let block = |i: usize, from: usize| second[(n + i) * 2 * n + from..][..n].iter().copied();
            let along = |i| block(i, 0).zip(&v).fold(<S as Real>::zero(), |sum, (h, &v)| sum + h * v);
            let mut terms = Terms {
                dl_dq: first[..n].to_vec(),
                mass_matrix: (0..n).flat_map(|i| block(i, n)).collect(),
                coriolis: (0..n).map(along).collect(),
                ..Terms::default()
            };
            terms.complete(n, &v, Request::ACCELERATION, &mut workspace).map_err(|e| e.to_string())?;
            Ok(terms)
        };
        match run() {
            Err(error) => self.failed("tape", S::NAME, error),
            Ok(terms) => {
                let time = self.stopwatch.measure(|| {
                    let _ = black_box(run());
                });
                self.add(("motion", "tape", S::NAME), f64::NAN, errors(n, &terms, &self.judge), time);
            }
        }
        Ok(())
    }

    /// Central differences of the Lagrangian at their best step.
    fn differences(&mut self, order: Order) -> Result<(), String> {
        let case = self.case;
        let network = case.network::<f64>()?;
        let model = Differences { model: &network, scale: &case.architecture.scale, order };
        let (q, v): (Vec<f64>, Vec<f64>) = (cast(&case.q), cast(&case.v));
        let (mut buffers, mut terms) = (Displaced::default(), Terms::default());
        // The step is chosen on a few states.
        let few = case.batch.min(4) * case.n;
        let mut best = (f64::INFINITY, 0.0, None);
        for k in 1..=18 {
            let h = 0.5f64.powi(k);
            match model.terms((&q[..few], &v[..few]), h, &mut buffers, &mut terms) {
                Ok(()) => {
                    let error = errors(case.n, &terms, &self.judge).into_iter().fold(0.0, f64::max);
                    if error < best.0 {
                        best = (error, h, None);
                    }
                }
                Err(error) => best.2 = Some(error.to_string()),
            }
        }
        let (least, h, failure) = best;
        if least.is_infinite() {
            self.failed(order.name(), "f64", failure.unwrap_or_else(|| "no finite result at any step".into()));
            return Ok(());
        }
        if let Err(error) = model.terms((&q, &v), h, &mut buffers, &mut terms) {
            self.failed(order.name(), "f64", error.to_string());
            return Ok(());
        }
        let errors = errors(case.n, &terms, &self.judge);
        let time = self.stopwatch.measure(|| {
            let _ = black_box(model.terms((black_box(&q), &v), h, &mut buffers, &mut terms));
        });
        self.add(("motion", order.name(), "f64"), h, errors, time);
        Ok(())
    }

    /// The gradient by the adjoint identity; returns it.
    fn adjoint_identity<S: Scalar>(&mut self) -> Result<Vec<Dd>, String> {
        let data = self.case.data::<S>()?;
        let weights: Vec<S> = cast(&self.case.weights);
        let rows: Vec<u32> = (0..self.case.batch as u32).collect();
        let mut objective = Objective::new(&self.case.architecture, Penalty::None, 1).map_err(|e| e.to_string())?;
        let mut slope = weights.clone();
        let mut failure = None;
        let time = self.stopwatch.measure(|| {
            failure = black_box(objective.step(black_box(&weights), &data, &rows, &mut slope)).failure;
        });
        if let Some(failure) = failure {
            self.failed("identity", S::NAME, failure.to_string());
        }
        self.add(("gradient", "identity", S::NAME), f64::NAN, vec![relative(&slope, &self.slope)], time);
        Ok(cast(&slope))
    }

    /// The gradient by reverse mode over nested forward numbers, where the tape fits into memory.
    fn gradients_on_the_tape(&mut self, options: &Options) -> Result<(), String> {
        let (case, parameters) = (self.case, self.case.weights.len());
        // About ten nodes per weight and nested evaluation, of which there are n (n + 2).
        let nodes = 10.0 * (parameters * case.n * (case.n + 2)) as f64;
        let most = options.choose(1e6, 4e6, 2e7);
        if nodes > most {
            let reason = format!("left out: about {nodes:.0e} nodes, more than {most:.0e}");
            self.failed("gradient on the tape", "every precision", reason);
            return Ok(());
        }
        self.gradient_on_the_tape::<f32>();
        self.gradient_on_the_tape::<f64>();
        self.gradient_on_the_tape::<Dd>();
        Ok(())
    }

    fn gradient_on_the_tape<S: Scalar>(&mut self) {
        let weights: Vec<S> = cast(&self.case.weights);
        let f = OfWeights(self.case);
        match gradient(&f, &weights) {
            Err(error) => self.failed("gradient on the tape", S::NAME, error.to_string()),
            Ok((_, slope)) => {
                let errors = vec![relative(&slope, &self.slope)];
                let time = self.stopwatch.measure(|| {
                    let _ = black_box(gradient(&f, black_box(&weights)));
                });
                self.add(("gradient", "tape", S::NAME), f64::NAN, errors, time);
            }
        }
    }

    /// Central differences of the loss along `count` parameters at their best common step.
    fn differences_of_the_loss(&mut self, order: Order, count: usize) -> Result<(), String> {
        let data = self.case.data::<f64>()?;
        let mut weights: Vec<f64> = cast(&self.case.weights);
        let mut objective = Objective::new(&self.case.architecture, Penalty::None, 1).map_err(|e| e.to_string())?;
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let chosen: Vec<usize> = (0..count).map(|_| rng.random_range(0..weights.len())).collect();
        let largest = self.slope.iter().fold(0.0, |m: f64, s| m.max(s.to_f64().abs()));
        let mut slope = |at: usize, h: f64| {
            let here = weights[at];
            let slope = order.first(h, |d| {
                weights[at] = here + d;
                objective.loss(&weights, &data).loss
            });
            weights[at] = here;
            slope
        };
        let mut best = (f64::INFINITY, 0.0);
        for k in (3..=21).step_by(2) {
            let h = 0.5f64.powi(k);
            let worst = chosen.iter().map(|&at| (slope(at, h) - self.slope[at].to_f64()).abs()).fold(0.0, f64::max);
            if worst / largest < best.0 {
                best = (worst / largest, h);
            }
        }
        let (error, h) = best;
        if error.is_infinite() {
            self.failed(order.name(), "f64", "no finite gradient at any step".into());
            return Ok(());
        }
        let mut time = self.stopwatch.measure(|| {
            black_box(slope(chosen[0], h));
        });
        for seconds in [&mut time.min, &mut time.lower, &mut time.median, &mut time.upper] {
            *seconds *= self.slope.len() as f64;
        }
        self.add(("gradient", order.name(), "f64"), h, vec![error], time);
        Ok(())
    }

    /// The identities in double-double were compared with themselves: they take the difference to the nested numbers.
    fn judge_the_judges(&mut self) {
        for (quantity, other) in [("motion", "nested"), ("gradient", "tape")] {
            let dd = |m: &&Measured, engine| m.quantity == quantity && m.precision == "dd" && m.engine == engine;
            let independent = self.found.iter().find(|m| dd(m, other)).map(|m| m.errors.clone());
            let own = self.found.iter_mut().find(|m| dd(&&**m, "identity"));
            let Some(own) = own else { continue };
            own.errors = independent.unwrap_or_else(|| vec![f64::NAN; own.errors.len()]);
            if own.errors[0].is_nan() {
                let reason = format!("error unknown: no {other} numbers in double-double to compare with");
                self.failures.push((format!("{quantity} by the identity, dd, {}", self.case.name()), reason));
            }
        }
    }

    fn report(self, section: &mut Section) {
        let case = self.case;
        let (states, parameters) = (case.batch as f64, case.weights.len() as f64);
        for m in &self.found {
            let name = [m.quantity, m.engine, m.precision].map(String::from);
            let shape = [case.n, case.width, case.batch].map(|x| x.to_string());
            let per_state = m.time.median * 1e9 / states;
            let mut row = [&name[..], &shape].concat();
            row.extend([case.weights.len().to_string(), short(m.step)]);
            let parts = if m.quantity == "motion" { [0, 1, 2].map(|k| m.errors[k]) } else { [f64::NAN; 3] };
            row.extend(parts.map(short));
            row.extend([m.error(), m.floor, self.condition].map(short));
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
        for (case, reason) in &self.failures {
            section.failed(case, reason);
        }
        for quantity in ["motion", "gradient"] {
            let mut engines: Vec<&str> = Vec::new();
            for m in self.found.iter().filter(|m| m.quantity == quantity) {
                if !engines.contains(&m.engine) {
                    engines.push(m.engine);
                }
            }
            let mut curves: Vec<_> = engines
                .iter()
                .map(|&engine| {
                    let of = self.found.iter().filter(|m| m.quantity == quantity && m.engine == engine);
                    let mut points: Vec<(f64, f64)> = of.map(|m| (m.error(), m.time.median * 1e9 / states)).collect();
                    points.sort_by(|a, b| b.0.total_cmp(&a.0));
                    curve(engine, &points)
                })
                .collect();
            curves.push(level("eps (f64) x condition", f64::EPSILON * self.condition, &curves));
            curves.push(level(
                "eps (f32) x condition",
                f64::from(f32::EPSILON) * self.condition,
                &curves[..engines.len()],
            ));
            let title =
                format!("{} by precision, {}", if quantity == "motion" { "M, c, a" } else { "Gradient" }, case.name());
            let file = format!("{quantity}_n{}_w{}_b{}", case.n, case.width, case.batch);
            section.diagram(file, &title, "relative error", "time per state [ns]", curves);
        }
    }
}
