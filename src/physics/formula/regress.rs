//! Finds a formula from a Lagrangian that can be evaluated, learned or given.

use super::error::FormulaError;
use super::extent::{Extent, Friction};
use super::find::FormulaOptions;
use super::found::{FoundFormula, Verdict};
use super::library::{Library, Values};
use super::motion::Model;
use super::select::{Choice, Path, eliminate_backward, mean};
use super::thresholds::{
    LEAST_MODEL_STATES, MODEL_REFITS, MOST_MODEL_ERROR_RATIO, MOST_MODEL_RESIDUAL, MOST_MODEL_STATES, RIDGE,
    STATES_PER_HELD_OUT, UNDETERMINED_ERROR,
};
use super::weak::{State, Windows};
use crate::cancellation::Cancellation;
use crate::identification::linear::{inverse_with, times};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{self, Workspace, dot};
use crate::random::RngStream;
use rand::Rng;

/// A state with the mass matrix and the acceleration of a model.
struct ModelState {
    q: Vec<f64>,
    v: Vec<f64>,
    mass: Vec<f64>,
    acceleration: Vec<f64>,
}

impl FoundFormula {
    /// Finds a formula for a model by its equations of motion at states `(states, n)`: terms by `M (a - a(q, v))` at random accelerations `a`, or by
    /// `a(q, v)` alone if no formula has the mass matrix `M`; coefficients by `a(q, v)`.
    ///
    /// Structured models, black boxes and systems are evaluated in the same way. Total derivatives do not change the equations, so neither the
    /// model nor the formula needs a gauge.
    ///
    /// # Errors
    /// [`FormulaError`] for a model whose terms are not finite, for a library that is too large, and for invalid functions and terms.
    pub fn of_model(
        model: &dyn EulerLagrange<f64>,
        (names, periodic): (&[String], &[bool]),
        (q, v): (&[f64], &[f64]),
        options: &FormulaOptions,
    ) -> Result<Self, FormulaError> {
        let families = options.families.unwrap_or_default();
        let friction = if options.friction { Friction::Constant } else { Friction::None };
        let extent = Extent { families, gyroscopic: options.gyroscopic, friction, drive: None };
        let library = Library::new(names, periodic, extent, &options.functions)?;
        let n = library.n();
        let stop = &options.cancellation;
        stop.stage("states of the model");
        let rows: Vec<(&[f64], &[f64])> = q.chunks_exact(n).zip(v.chunks_exact(n)).take(MOST_MODEL_STATES).collect();
        let states = evaluated(model, &rows, stop)?;
        let scales = Scales::of(&states, n);
        let (kept, quotient) = library.independent(&scales.bounds, options.seed);
        let found = choose(&library, &kept, (&states, &scales), options)?;
        let ModelChoice { windows, path, choice } =
            found.ok_or_else(|| FormulaError::NotFinite { failed: rows.len() - states.len(), states: rows.len() })?;
        let covariance = covariance(&windows, &choice, &scales.sigma);
        let of = Model {
            terms: choice.set.iter().map(|&k| kept[k]).collect(),
            coefficients: choice.set.iter().map(|&k| choice.coefficients[k]).collect(),
            frequency: 0.0,
        };
        let residual = residual(&choice, n);
        let probability = probabilities(&windows, &choice, &path, &scales.sigma, options);
        let mut found = FoundFormula::new(&library, periodic, &of, (&covariance, &probability), options);
        found.verdict = if residual <= MOST_MODEL_RESIDUAL { Verdict::Found } else { Verdict::NotInLibrary };
        found.residual = residual;
        found.noise = scales.sigma;
        found.of_model = true;
        found.searched = (library.searched, quotient.removed);
        (found.basis, found.tried) = (families.to_string(), vec![families.to_string()]);
        (found.bounds, found.speeds) = (scales.bounds, scales.speeds);
        found.rescale(options.scale.as_ref())?;
        found.name_constants();
        stop.check()?;
        Ok(found)
    }
}

/// The states at which a model is finite, which must be at least half of them.
fn evaluated(
    model: &dyn EulerLagrange<f64>,
    rows: &[(&[f64], &[f64])],
    stop: &Cancellation,
) -> Result<Vec<ModelState>, FormulaError> {
    let mut terms = Terms::default();
    let mut found: Vec<ModelState> = Vec::new();
    for (q, v) in rows {
        stop.check()?;
        let fine = model.terms(q, v, Request::MASS_MATRIX | Request::ACCELERATION, &mut terms).is_ok();
        if fine && terms.acceleration.iter().chain(&terms.mass_matrix).all(|x| x.is_finite()) {
            let (mass, acceleration) = (terms.mass_matrix.clone(), terms.acceleration.clone());
            found.push(ModelState { q: q.to_vec(), v: v.to_vec(), mass, acceleration });
        }
    }
    let (states, failed) = (rows.len(), rows.len() - found.len());
    let enough = found.len() >= LEAST_MODEL_STATES && 2 * failed <= states;
    if enough { Ok(found) } else { Err(FormulaError::NotFinite { failed, states }) }
}

/// Typical accelerations and speeds of states, and the ranges of their coordinates.
struct Scales {
    sigma: Vec<f64>,
    speeds: Vec<f64>,
    bounds: Vec<[f64; 2]>,
}

impl Scales {
    fn of(states: &[ModelState], n: usize) -> Self {
        let count = states.len() as f64;
        let scale =
            |of: &dyn Fn(&ModelState) -> f64| (count / states.iter().map(of).sum::<f64>()).sqrt().recip().max(1e-9);
        let mut bounds = vec![[f64::INFINITY, f64::NEG_INFINITY]; n];
        for ModelState { q, .. } in states {
            bounds.iter_mut().zip(q).for_each(|(b, &x)| *b = [b[0].min(x), b[1].max(x)]);
        }
        Self {
            sigma: (0..n).map(|i| scale(&|s| s.acceleration[i].powi(2))).collect(),
            speeds: (0..n).map(|i| scale(&|s| s.v[i].powi(2))).collect(),
            bounds,
        }
    }
}

/// A choice of terms for a model, the equations of its own motion, and the elimination that led to the choice.
struct ModelChoice {
    windows: Windows,
    path: Path,
    choice: Choice,
}

/// Chooses terms by the mass matrix and the motion of a model, or by its motion alone if no formula has its mass matrix; `None` if there is no
/// choice.
fn choose(
    library: &Library,
    kept: &[usize],
    (states, scales): (&[ModelState], &Scales),
    options: &FormulaOptions,
) -> Result<Option<ModelChoice>, FormulaError> {
    let (n, sigma, stop) = (library.n(), &scales.sigma, &options.cancellation);
    let complexity: Vec<f64> = kept.iter().map(|&k| library.complexity(k)).collect();
    stop.stage("choice of terms");
    let all: Vec<usize> = (0..kept.len()).collect();
    let search = |windows: &Windows, start: &[f64]| {
        eliminate_backward(windows, (&all, start), (sigma, &complexity), &is_validation, stop)
    };
    let motion = Windows::of_states(library, kept, &unforced(states));
    let windows = Windows::of_states(library, kept, &forced(states, sigma, options.seed));
    let masses = mass_coefficients(library, kept, states);
    let start = masses.unwrap_or_else(|| windows.unit_mass(library, kept, &vec![1.0; n]));
    let mut path = search(&windows, &start);
    stop.check()?;
    let Some(first) = elbow(&path, n).cloned() else { return Ok(None) };
    let mut choice = refit((&motion, &windows), first, sigma);
    if residual(&choice, n) > MOST_MODEL_RESIDUAL {
        // No formula has the mass matrix of the model, though one may have its motion: a function of L has the motion of L.
        let alone = search(&motion, &choice.coefficients);
        let found = elbow(&alone, n).map(|found| refit((&motion, &windows), found.clone(), sigma));
        if let Some(found) = found.filter(|found| residual(found, n) < residual(&choice, n)) {
            (path, choice) = (alone, found);
        }
    }
    Ok(Some(ModelChoice { windows: motion, path, choice }))
}

/// The model's own motion, which contains the mass matrix only as far as it affects the motion.
fn unforced(states: &[ModelState]) -> Vec<State> {
    let of = |ModelState { q, v, acceleration, .. }: &ModelState| {
        let (q, v, a) = (q.clone(), v.clone(), acceleration.clone());
        State { q, v, a, equation: Vec::new() }
    };
    states.iter().map(of).collect()
}

/// Motion with random accelerations, and the forces that it takes by the model's mass matrix.
fn forced(states: &[ModelState], sigma: &[f64], seed: u64) -> Vec<State> {
    let (n, mut rng) = (sigma.len(), RngStream::Region.generator(seed));
    let of = |ModelState { q, v, mass, acceleration }: &ModelState| {
        let a: Vec<f64> = (0..n).map(|i| acceleration[i] + 2.0 * sigma[i] * (rng.random::<f64>() - 0.5)).collect();
        let difference: Vec<f64> = a.iter().zip(acceleration).map(|(a, own)| a - own).collect();
        State { equation: times(n, mass, &difference), q: q.clone(), v: v.clone(), a }
    };
    states.iter().map(of).collect()
}

/// Root mean square error of held-out accelerations, relative to their size.
fn residual(choice: &Choice, n: usize) -> f64 {
    (choice.held_out / n as f64).sqrt()
}

/// Covariance of the coefficients of a choice, with the common factor of each group fixed: the motion does not determine it.
fn covariance(windows: &Windows, choice: &Choice, sigma: &[f64]) -> Vec<f64> {
    let (n, m) = (sigma.len(), choice.set.len());
    let used = vec![true; windows.len()];
    let normal = windows.normal(&choice.coefficients, &choice.set, sigma, &used);
    let variance = choice.error * windows.len() as f64 / (windows.len() * n - m).max(1) as f64;
    let weight =
        (0..m).map(|k| normal.matrix[k * m + k] * choice.coefficients[choice.set[k]].powi(2)).fold(0.0, f64::max);
    let mut pinned = normal.matrix.clone();
    for group in windows.groups(&choice.set) {
        for &i in &group.places {
            group.places.iter().for_each(|&j| pinned[i * m + j] += weight * normal.size[i] * normal.size[j]);
        }
    }
    let covariance = inverse_with(m, &pinned, RIDGE).unwrap_or(vec![f64::NAN; m * m]);
    covariance.into_iter().map(|x| x * variance).collect()
}

/// Coefficients of kinetic terms that reproduce the mass matrices of a model, every element in units of its coordinates' typical values.
fn mass_coefficients(library: &Library, kept: &[usize], known: &[ModelState]) -> Option<Vec<f64>> {
    let n = library.n();
    let size = |i: usize| known.iter().map(|k| k.mass[i * n + i].abs()).sum::<f64>() / known.len() as f64;
    let sizes: Vec<f64> = (0..n).map(size).collect();
    let kinetic: Vec<(usize, (usize, usize), usize)> = (0..kept.len())
        .filter_map(|at| library.kinetic(kept[at]).map(|pair| (at, pair, library.terms[kept[at]].function)))
        .collect();
    let m = kinetic.len();
    let functions = library.functions_of(kept);
    let (mut values, mut matrix, mut right) = (Values::new(), vec![0.0; m * m], vec![0.0; m]);
    for ModelState { q, mass, .. } in known {
        library.evaluate(&functions, (q, 0.0), &mut values);
        for (k, &(_, (i, j), f)) in kinetic.iter().enumerate() {
            // An off-diagonal element appears twice in the matrix.
            let weight = if i == j { 4.0 } else { 2.0 } / (sizes[i] * sizes[j]);
            let value = weight * values[f].value;
            right[k] += value * mass[i * n + j] * if i == j { 0.5 } else { 1.0 };
            for (l, &(_, _, g)) in kinetic.iter().enumerate().filter(|(_, (_, pair, _))| *pair == (i, j)) {
                matrix[k * m + l] += value * values[g].value;
            }
        }
    }
    let inverse = inverse_with(m, &matrix, RIDGE)?;
    let mut coefficients = vec![0.0; kept.len()];
    kinetic.iter().zip(times(m, &inverse, &right)).for_each(|((at, ..), x)| coefficients[*at] = x);
    Some(coefficients)
}

/// `true` for a validation state.
fn is_validation(block: usize) -> bool {
    block.is_multiple_of(STATES_PER_HELD_OUT)
}

/// A choice of terms with coefficients from the motion of the model; in directions that the motion does not determine, the mass matrix decides.
fn refit((motion, windows): (&Windows, &Windows), mut choice: Choice, sigma: &[f64]) -> Choice {
    let held_out: Vec<bool> = motion.blocks.iter().map(|&block| is_validation(block)).collect();
    let learned: Vec<bool> = held_out.iter().map(|held| !held).collect();
    let (set, m) = (choice.set.clone(), choice.set.len());
    let principal = |matrix: &[f64]| {
        let (mut values, mut vectors) = (vec![0.0; m], vec![0.0; m * m]);
        let done = linalg::eigh(m, matrix, &mut values, &mut vectors, &mut Workspace::new());
        done.is_ok().then_some((values, vectors))
    };
    for _ in 0..MODEL_REFITS {
        let [of_motion, of_masses] = [motion, windows].map(|of| of.normal(&choice.coefficients, &set, sigma, &learned));
        // Directions in which the mass matrix changes equally.
        let Some((sizes, axes)) = principal(&of_masses.matrix) else { break };
        let least = RIDGE * sizes.iter().copied().fold(0.0, f64::max);
        let unit: Vec<f64> = (0..m * m).map(|at| axes[at] / sizes[at / m].max(least).sqrt()).collect();
        let of = |a: &[f64], b: &[f64]| dot(a, &times(m, &of_motion.matrix, b));
        let rows: Vec<&[f64]> = unit.chunks_exact(m).collect();
        let both: Vec<f64> = (0..m * m).map(|at| of(rows[at / m], rows[at % m])).collect();
        let Some((costs, turns)) = principal(&both) else { break };
        let open = UNDETERMINED_ERROR * costs[0].max(RIDGE);
        let mut x = vec![0.0; m];
        for (_, turn) in costs.iter().zip(turns.chunks_exact(m)).filter(|(cost, _)| **cost <= open) {
            let direction: Vec<f64> = (0..m).map(|k| (0..m).map(|i| turn[i] * rows[i][k]).sum()).collect();
            let share = dot(&direction, &of_masses.right);
            x.iter_mut().zip(&direction).for_each(|(x, d)| *x += share * d);
        }
        set.iter().zip(x).for_each(|(&k, x)| choice.coefficients[k] = x);
    }
    let errors = motion.errors(&choice.coefficients, sigma);
    (choice.error, choice.held_out) = (mean(&errors, &learned), mean(&errors, &held_out));
    choice
}

/// The choice of terms after which removing another one raises the error most.
fn elbow(path: &Path, n: usize) -> Option<&Choice> {
    let least = path.best.values().map(|choice| choice.held_out).fold(f64::INFINITY, f64::min);
    // Differences below rounding are not significant.
    let floor = least.max(1e-20);
    let near = || path.best.values().filter(|choice| choice.held_out <= MOST_MODEL_ERROR_RATIO * floor);
    let rise = |choice: &Choice| {
        let shorter = path.best.range(..choice.set.len()).next_back();
        // Without terms the error is the size of the accelerations.
        shorter.map_or(n as f64, |(_, shorter)| shorter.held_out) / choice.held_out.max(floor)
    };
    near().max_by(|a, b| rise(a).total_cmp(&rise(b)).then(b.set.len().cmp(&a.set.len())))
}

/// The share of random halves of the states in which each term survives.
fn probabilities(windows: &Windows, choice: &Choice, path: &Path, sigma: &[f64], options: &FormulaOptions) -> Vec<f64> {
    let mut rng = RngStream::Segments.generator(options.seed);
    let mut counts = vec![0.0; windows.terms];
    let mut all: Vec<usize> = path.order.iter().take(2 * choice.set.len() + 6).copied().collect();
    all.extend(choice.set.iter().filter(|k| !path.order.iter().take(2 * choice.set.len() + 6).any(|o| o == *k)));
    for _ in (0..options.bootstraps).take_while(|_| options.cancellation.go_on()) {
        let used: Vec<bool> = (0..windows.len()).map(|_| rng.random()).collect();
        let normal = windows.normal(&choice.coefficients, &all, sigma, &used);
        let mut places: Vec<usize> = (0..all.len()).collect();
        while places.len() > choice.set.len() {
            let left: Vec<usize> = places.iter().map(|&k| all[k]).collect();
            let Some(costs) = normal.of(&places).costs(&windows.groups(&left)) else { break };
            let gone = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
            places.remove(gone);
        }
        places.iter().for_each(|&k| counts[all[k]] += 1.0 / options.bootstraps as f64);
    }
    choice.set.iter().map(|&k| counts[k]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::SystemInstance;

    #[test]
    fn a_system_is_found_again() {
        let model = SystemInstance::<f64>::named("double-pendulum", &[("m2".to_string(), "0.5".to_string())])
            .unwrap()
            .build()
            .unwrap();
        let names = ["theta1", "theta2"].map(String::from);
        let mut rng = RngStream::Region.generator(3);
        let mut draw = |size: f64| (0..400).map(|_| size * (rng.random::<f64>() - 0.5)).collect::<Vec<f64>>();
        let (q, v) = (draw(6.0), draw(8.0));
        let found =
            FoundFormula::of_model(&*model, (&names, &[true, true]), (&q, &v), &FormulaOptions::default()).unwrap();
        assert_eq!(found.verdict, Verdict::Found);
        let texts: Vec<&str> = found.terms.iter().map(|t| t.term.as_str()).collect();
        assert_eq!(
            texts,
            [
                "theta1_dot^2",
                "theta2_dot^2",
                "theta1_dot*theta2_dot*cos(theta1 - theta2)",
                "cos(theta1)",
                "cos(theta2)"
            ]
        );
        // m1 + m2 = 1.5, m2 = 0.5: a third of theta1's.
        assert!((found.terms[1].coefficient - 0.5 / 3.0).abs() < 1e-8, "{:?}", found.terms);
        assert_eq!(found.terms[1].near.as_ref().map(|near| near.fraction.as_str()), Some("1/6"));
        let units: Vec<Option<&str>> = found.terms.iter().map(|t| t.unit.as_deref()).collect();
        assert_eq!(units, [Some("1"), Some("1"), Some("1"), Some("1/s^2"), Some("1/s^2")]);
    }

    #[test]
    fn equal_constants_have_one_name_and_a_unit() {
        let model = SystemInstance::<f64>::named("kepler", &[]).unwrap().build().unwrap();
        let names = ["x", "y"].map(String::from);
        let mut rng = RngStream::Region.generator(4);
        let mut draw =
            |low: f64, high: f64| (0..400).map(|_| low + (high - low) * rng.random::<f64>()).collect::<Vec<f64>>();
        let (q, v) = (draw(0.5, 2.0), draw(-1.0, 1.0));
        let families = Some("polynomial:1,radial:2".parse().unwrap());
        let options = FormulaOptions { families, units: vec!["m".to_string(); 2], ..FormulaOptions::default() };
        let found = FoundFormula::of_model(&*model, (&names, &[false; 2]), (&q, &v), &options).unwrap();
        let seen: Vec<(&str, &str, Option<&str>)> =
            found.terms.iter().map(|t| (t.term.as_str(), t.constant.as_str(), t.unit.as_deref())).collect();
        let kinetic = [("x_dot^2", "c1", Some("1")), ("y_dot^2", "c1", Some("1"))];
        assert_eq!(seen, [kinetic[0], kinetic[1], ("sqrt(x^2 + y^2)^(-1)", "c2", Some("m^3/s^2"))]);
        let file = found.system_file("kepler-found");
        assert!(file.contains("c1*x_dot^2 + c1*y_dot^2") && !file.contains("c3"), "{file}");
        // Constants with different units are never the same.
        let options = FormulaOptions { units: ["m", "A"].map(String::from).to_vec(), ..options };
        let found = FoundFormula::of_model(&*model, (&names, &[false; 2]), (&q, &v), &options).unwrap();
        assert_eq!([0, 1, 2].map(|k| found.terms[k].constant.as_str()), ["c1", "c2", "c3"]);
        // The distance of different lengths has no unit.
        assert_eq!(found.terms[2].unit, None);
    }
}
