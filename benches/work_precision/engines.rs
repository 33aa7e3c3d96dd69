//! The derivative engines, each measured on one case.

use super::super::common::accuracy::cast;
use super::case::{Case, OfState, OfWeights};
use super::differences::{Differences, Displaced, Order};
use super::options::Options;
use super::timing::{Stopwatch, Timing};
use lnn::configuration::Penalty;
use lnn::lagrangian::{EulerLagrange, Mechanics, Request, Terms};
use lnn::linalg::Workspace;
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{gradient, hessian};
use lnn::training::Objective;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;

/// One engine at work.
pub struct Measured {
    pub quantity: &'static str,
    pub engine: &'static str,
    pub precision: &'static str,
    pub step: f64,
    /// Errors of `M`, `c`, `a` in turn, or of the gradient.
    pub errors: Vec<f64>,
    pub floor: f64,
    pub time: Timing,
}

impl Measured {
    pub fn error(&self) -> f64 {
        self.errors.iter().copied().fold(0.0, |m, e| if e.is_nan() { e } else { m.max(e) })
    }
}

/// What all engines of a case are measured with.
pub struct Bench<'a> {
    pub case: &'a Case,
    pub stopwatch: Stopwatch,
    /// Motion and gradient in double-double.
    pub judge: Terms<Dd>,
    pub slope: Vec<Dd>,
    pub condition: f64,
    pub found: Vec<Measured>,
    pub failures: Vec<(String, String)>,
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
impl Bench<'_> {
    fn add(&mut self, what: (&'static str, &'static str, &'static str), step: f64, errors: Vec<f64>, time: Timing) {
        let (quantity, engine, precision) = what;
        let eps = match precision {
            "f32" | "f32, solved in f64" => f64::from(f32::EPSILON),
            "dd" => Dd::epsilon().to_f64(),
            _ => f64::EPSILON,
        };
        let floor = eps * self.condition;
        self.found.push(Measured { quantity, engine, precision, step, errors, floor, time });
    }

    fn failed(&mut self, engine: &str, precision: &str, reason: String) {
        self.failures.push((format!("{engine}, {precision}, {}", self.case.name()), reason));
    }

    pub fn forward_identity<S: Scalar>(&mut self) -> Result<(), String> {
        self.motion::<S>("identity", &self.case.network::<S>()?);
        Ok(())
    }

    pub fn nested<S: Scalar>(&mut self) -> Result<(), String> {
        let weights = cast(&self.case.weights);
        self.motion::<S>("nested", &Mechanics::new(self.case.architecture.clone(), weights));
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

    /// Mixed precision: `M`, `c`, `g` of the forward identity in `f32`, the small systems solved in `f64`.
    pub fn mixed(&mut self) -> Result<(), String> {
        let case = self.case;
        let model = case.network::<f32>()?;
        let (v, mut terms, mut workspace) = (cast(&case.v), Terms::default(), Workspace::new());
        let mut run = || -> Result<Terms<f64>, String> {
            let products = Request::MASS_MATRIX | Request::CORIOLIS | Request::DL_DQ;
            model.terms(black_box(&case.q), &case.v, products, &mut terms).map_err(|e| e.to_string())?;
            let mut wide = Terms {
                dl_dq: cast(&terms.dl_dq),
                mass_matrix: cast(&terms.mass_matrix),
                coriolis: cast(&terms.coriolis),
                ..Terms::default()
            };
            wide.complete(case.n, &v, Request::ACCELERATION, &mut workspace).map_err(|e| e.to_string())?;
            Ok(wide)
        };
        let terms = run()?;
        let time = self.stopwatch.measure(|| {
            let _ = black_box(run());
        });
        self.add(("motion", "identity", "f32, solved in f64"), f64::NAN, errors(case.n, &terms, &self.judge), time);
        Ok(())
    }

    /// The Hessian of the Lagrangian by the scalar tape, reverse over forward.
    pub fn tape<S: Scalar>(&mut self) -> Result<(), String> {
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
    pub fn differences(&mut self, order: Order) -> Result<(), String> {
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
    pub fn adjoint_identity<S: Scalar>(&mut self) -> Result<Vec<Dd>, String> {
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
    pub fn gradients_on_the_tape(&mut self, options: &Options) -> Result<(), String> {
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
    pub fn differences_of_the_loss(&mut self, order: Order, count: usize) -> Result<(), String> {
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
    pub fn judge_the_judges(&mut self) {
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
}
