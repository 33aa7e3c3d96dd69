//! Fits constants to known forces, by least squares on the force residuals of the smoothed motion.
//!
//! The residual is `r = M a + c - dL/dq + dD/dv - Q`. It does not solve for accelerations, so the mass matrix may be singular during the search.
//! The weight of a coordinate is the inverse of the size of its residuals. If the equations are linear in the constants, a single step suffices
//! for given weights.
//!
//! Under constraints the residual is the part that no force of constraint can balance. Of its `n` numbers, `n - m` are independent, and it counts
//! as `n - m` numbers.

use super::IdentifyError;
use super::bootstrap::{self, Copies};
use super::covariance::Root;
use super::driven::Segment;
use super::fitted::Fitted;
use super::follow::Follower;
use super::found::{Identified, Outlier, Residual, ResidualPath};
use super::quality::{Evidence, correlation, mean_eigenvalue, outliers, over_noise, tail, typical_size};
use super::smoothed::{Quantity, States};
use super::solve::{Normal, Problem};
use super::thresholds::{
    COPIES, DRIFT_BLOCKS, LANES, LEAST_FORCE_RESIDUAL, LEAST_FORCE_UNIT, OUTLIER, SIGNIFICANCE, SLOPE_ROUNDING,
    WEIGHT_CHANGE, WEIGHT_UPDATES, WINDOW_OVER_HALF_WIDTH,
};
use super::unknowns::unknowns;
use crate::lagrangian::SystemInstance;
use crate::recording::smooth::{Smoothed, Smoothing, noise};
use crate::recording::{RecordedTrajectory, Recording, deviation, quantile, rms};

/// Identifies the constants of `problem` from the known forces; the search begins at `x`.
pub(super) fn identify(
    instance: &SystemInstance<f64>,
    problem: &Problem<'_>,
    smoothing: &Smoothing,
    (mut x, segments): (Vec<f64>, Vec<Segment>),
) -> Result<Identified, IdentifyError> {
    let recording = problem.driven.recording;
    let start = x.clone();
    let (mut states, smoothings) = smoothed_states(problem, smoothing)?;
    check_constraints(instance, problem, &x, &states)?;
    let (sigma, scales) = Scales::of(&states, problem.driven.equations.n);
    if problem.driven.equations.rows.is_some() {
        states.units = units(problem, &states, &x, &scales.least);
    }
    let normal = weighted_fit(problem, (&mut states, &mut x), (sigma, &scales.least))?;
    let residuals = ForceResiduals::of(problem, &states, &x, &scales.least);
    let copies = simulated(problem, smoothings, (&states, &x), (&residuals.raw, &scales.least));
    let (by_coordinate, probabilities) = by_coordinate(recording, (&states, &scales), &residuals, copies.as_ref());
    let (outliers, outlier_count) = residuals.outliers(recording, &states.places);
    let verdict = Evidence {
        converged: normal.converged,
        residuals: &by_coordinate,
        sizes: by_coordinate.iter().map(|r| r.rms).collect(),
        exact: scales.least.clone(),
        probabilities,
        outliers: outlier_count as f64 / states.q.len() as f64,
        agreement: 1.0,
        continuation: (1.0, 0.0),
    }
    .verdict();
    let over_noise = over_noise(&by_coordinate);
    let (normal, inflation) = match &copies {
        Some(copies) => without_bias(problem, &mut x, normal, (copies, over_noise)),
        None => (normal, 1.0),
    };
    let fitted = Fitted { x, segments, normal: normal.with_held(), substeps: 0 };
    let normal_at = |x: &[f64]| states.normal(problem, x, Quantity::Forces);
    problem.cancellation.check()?;
    Ok(Identified {
        converged: fitted.normal.converged,
        decrement: fitted.normal.decrement,
        explained: verdict.explains(),
        verdict,
        residuals: by_coordinate,
        over_noise,
        outliers,
        outlier_count,
        paths: paths(recording, &states.places, &residuals.raw),
        inflation,
        samples: states.places.len(),
        ..unknowns(instance, problem, &fitted, (&start, 1.0), (Quantity::Forces, &normal_at))
    })
}

/// Smoothings of a recording: the one that is fitted, and a wider one that gives the motion of simulated copies, if there is one.
struct Smoothings {
    sharper: Smoothing,
    wider: Option<Smoothing>,
}

/// The smoothed states at which the forces are fitted.
fn smoothed_states(problem: &Problem<'_>, smoothing: &Smoothing) -> Result<(States, Smoothings), IdentifyError> {
    let recording = problem.driven.recording;
    let sharper = smoothing.sharper();
    let smoothed: Vec<Option<Smoothed>> = recording.tracks.iter().map(|track| sharper.apply(track).ok()).collect();
    let mut states = States::new(problem, &smoothed);
    problem.cancellation.check()?;
    let wider = bootstrap::wider_smoothing(recording, smoothing);
    if wider.is_some() {
        let window: usize = smoothing.coordinates.iter().map(|chosen| chosen.quality.window).sum();
        states.averaged = window / (WINDOW_OVER_HALF_WIDTH * problem.driven.equations.n * states.stride);
    }
    if states.places.is_empty() {
        return Err(IdentifyError::Lost);
    }
    Ok((states, Smoothings { sharper, wider }))
}

/// Rejects states off the constraints, and unknown constants that move constraints.
fn check_constraints(
    instance: &SystemInstance<f64>,
    problem: &Problem<'_>,
    x: &[f64],
    states: &States,
) -> Result<(), IdentifyError> {
    problem.require_constraints(x, (&states.q, &states.v))?;
    let moving = problem.moves_constraints(x, (&states.q, &states.v));
    if moving.is_empty() {
        return Ok(());
    }
    let symbol = |k: usize| instance.system.parameters[problem.chosen[k]].symbol.to_string();
    Err(IdentifyError::MovesConstraints { symbols: moving.into_iter().map(symbol).collect() })
}

/// Scales of the forces on every coordinate.
struct Scales {
    /// Standard deviation of the known force.
    spread: Vec<f64>,
    /// Smallest residual that is assumed.
    least: Vec<f64>,
}

impl Scales {
    /// Computes the scales, and the residuals that the first weights assume.
    fn of(states: &States, n: usize) -> (Vec<f64>, Self) {
        let spread: Vec<f64> = (0..n).map(|i| deviation(states.force.iter().skip(i).step_by(n))).collect();
        // A coordinate without a force gets the weight of the others.
        let most = spread.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let sigma: Vec<f64> = spread.iter().map(|s| if *s > 0.0 { *s } else { most }).collect();
        let least = sigma.iter().map(|sigma| LEAST_FORCE_RESIDUAL * sigma).collect();
        (sigma, Self { spread, least })
    }
}

/// Fits of simulated copies of the recording; `None` if these cannot be made.
fn simulated(
    problem: &Problem<'_>,
    Smoothings { sharper, wider }: Smoothings,
    (states, x): (&States, &[f64]),
    (raw, least): (&Vec<f64>, &[f64]),
) -> Option<Copies> {
    let (n, wider) = (least.len(), wider?);
    let sizes: Vec<f64> = (0..n).map(|i| typical_size(std::slice::from_ref(raw), n, i).max(least[i])).collect();
    let shares = |states: &States| shares(&errors(problem, states, x, least), n);
    bootstrap::copies(problem, [&sharper, &wider], (states, x, &sizes), &shares)
}

/// The residual of every coordinate, and the probability that the residuals of a right model vary as slowly.
fn by_coordinate(
    recording: &Recording,
    (states, scales): (&States, &Scales),
    residuals: &ForceResiduals,
    copies: Option<&Copies>,
) -> (Vec<Residual>, Vec<f64>) {
    let (n, places, least) = (scales.least.len(), &states.places, &scales.least);
    let expected: Vec<Vec<f64>> = match copies {
        Some(copies) => (0..n).map(|i| copies.squares(places, (n, i))).collect(),
        None => (0..n).map(|i| column(&residuals.errors, (n, i)).iter().map(|error| error * error).collect()).collect(),
    };
    let over = |residuals: &[f64], i: usize| {
        let of = |(r, square): (&f64, &f64)| if *square > 0.0 { r / square.sqrt().max(least[i]) } else { f64::NAN };
        residuals.iter().zip(&expected[i]).map(of).collect::<Vec<f64>>()
    };
    let of = |i: usize| {
        // Averages in units of their standard errors.
        let scaled = over(&column(&residuals.averages, (n, i)), i);
        let far = OUTLIER * typical_size(std::slice::from_ref(&scaled), 1, 0);
        let size = rms(scaled.iter().copied().filter(|z| z.abs() <= far));
        let probability = copies.map_or(1.0, |copies| {
            let others = (0..COPIES).map(|copy| over(&copies.residuals(copy, places, (n, i)), i));
            drift_probability(&scaled, &others.collect::<Vec<_>>(), places)
        });
        let probability = (n as f64 * probability).min(1.0);
        let noise = quantile(&mut expected[i].clone(), 0.5).sqrt().max(least[i]);
        // Computed from single equations, because neighbouring averages overlap.
        let autocorrelation = correlation(&[column(&residuals.scaled, (n, i))]).at_lag_one;
        let (coordinate, white) = (recording.coordinates[i].clone(), probability >= SIGNIFICANCE);
        let spread = scales.spread[i];
        (Residual { coordinate, rms: size * noise, noise, spread, autocorrelation, white }, probability)
    };
    (0..n).map(of).unzip()
}

/// Removes the bias that the copies show from the constants. Returns normal equations with the covariance of the copies, and the factor by which
/// it exceeds that of independent residuals.
fn without_bias(
    problem: &Problem<'_>,
    x: &mut Vec<f64>,
    normal: Normal,
    (copies, over_noise): (&Copies, f64),
) -> (Normal, f64) {
    let root = Root::of(x.len(), &normal.matrix);
    let (bias, mut covariance) = copies.bias(&root, x);
    let change: Vec<f64> = bias.iter().map(|bias| -bias).collect();
    *x = problem.stepped(x, &change, &normal);
    // Residuals larger than those of the copies imply larger standard errors.
    covariance.iter_mut().for_each(|c| *c *= over_noise.max(1.0).powi(2));
    let inflation = mean_eigenvalue(&covariance, root.forward.len());
    (root.with_covariance(&normal, &covariance, f64::MIN_POSITIVE), inflation)
}

/// Known forces at successive places of each trajectory, and their residuals `(states, n)`.
fn paths(recording: &Recording, places: &[(usize, usize)], residuals: &[f64]) -> Vec<ResidualPath> {
    let n = recording.n();
    let rows: Vec<(usize, usize, &[f64])> =
        places.iter().zip(residuals.chunks_exact(n)).map(|(&(track, sample), r)| (track, sample, r)).collect();
    let path = |rows: &[(usize, usize, &[f64])]| {
        let mut path = ResidualPath::default();
        for &(track, sample, residuals) in rows {
            let RecordedTrajectory { times, force, .. } = &recording.tracks[track];
            path.times.push(times[sample]);
            // Without a known force, the friction and the terms of L balance to zero.
            path.measured.extend((0..n).map(|i| force.get(sample * n + i).copied().unwrap_or(0.0)));
            path.residuals.extend(residuals);
        }
        path
    };
    rows.chunk_by(|a, b| a.0 == b.0).map(path).collect()
}

/// Fits the constants and updates the weights of the coordinates by the sizes of their averaged residuals, until the weights converge. Returns the
/// normal equations at the end.
fn weighted_fit(
    problem: &Problem<'_>,
    (states, x): (&mut States, &mut Vec<f64>),
    (mut sigma, least): (Vec<f64>, &[f64]),
) -> Result<Normal, IdentifyError> {
    let n = sigma.len();
    // Constraints leave fewer independent equations.
    let rows = problem.driven.equations.rows.as_ref().map_or(0, |rows| rows.names.len());
    let counts = ((n - rows) as f64 / n as f64).sqrt();
    let weights = |states: &States, sigma: &[f64]| (0..states.q.len()).map(|at| counts / sigma[at % n]).collect();
    let mut search = Normal::default();
    for _ in 0..WEIGHT_UPDATES {
        states.weight = weights(states, &sigma);
        problem.cancellation.check()?;
        let fitted = states.fit(problem, x, Quantity::Forces);
        problem.cancellation.check()?;
        search = fitted.ok_or(IdentifyError::Singular)?;
        let ForceResiduals { averages, errors, scaled, .. } = ForceResiduals::of(problem, states, x, least);
        states.share = shares(&errors, n);
        let [averages, scaled] = [[averages], [scaled]];
        let far: Vec<f64> = (0..n).map(|i| OUTLIER * typical_size(&scaled, n, i)).collect();
        let stands_out = scaled[0].iter().enumerate().filter(|(at, z)| z.abs() > far[at % n]);
        stands_out.for_each(|(at, _)| states.share[at] = 0.0);
        let residual: Vec<f64> = (0..n).map(|i| typical_size(&averages, n, i).max(least[i])).collect();
        let converged = residual.iter().zip(&sigma).all(|(r, sigma)| (r / sigma - 1.0).abs() < WEIGHT_CHANGE);
        sigma = residual;
        tracing::debug!(?sigma, "residuals of force");
        search.converged &= converged;
        if converged {
            break;
        }
    }
    states.weight = weights(states, &sigma);
    let normal = states.normal(problem, x, Quantity::Forces);
    problem.cancellation.check()?;
    let normal = normal.ok_or(IdentifyError::Singular)?;
    Ok(Normal { converged: search.converged, decrement: search.decrement, held: search.held, ..normal })
}

/// Residuals of the force equations, `(states, n)`.
struct ForceResiduals {
    /// Residuals of single equations.
    raw: Vec<f64>,
    /// Residuals of averages over neighbouring equations.
    averages: Vec<f64>,
    /// Standard errors of single equations.
    errors: Vec<f64>,
    /// Residuals of single equations in units of these errors.
    scaled: Vec<f64>,
}

impl ForceResiduals {
    fn of(problem: &Problem<'_>, states: &States, x: &[f64], least: &[f64]) -> Self {
        let [raw, averages] = states.force_residuals(problem, x);
        let errors = errors(problem, states, x, least);
        let scaled = raw.iter().zip(&errors).map(|(r, error)| r / error).collect();
        Self { raw, averages, errors, scaled }
    }

    /// Outliers, the largest first, and their number.
    fn outliers(&self, recording: &Recording, places: &[(usize, usize)]) -> (Vec<Outlier>, usize) {
        let whole = Segment { track: 0, first: 0, samples: places.len(), start: Vec::new() };
        outliers(recording, (&[whole], std::slice::from_ref(&self.scaled)), |_, state| places[state])
    }
}

/// Column `i` of `(states, n)`.
fn column(values: &[f64], (n, i): (usize, usize)) -> Vec<f64> {
    values.iter().skip(i).step_by(n).copied().collect()
}

/// Probability that the residuals of a right model vary as slowly: the logarithms of their squared sums over blocks are compared with those of the
/// copies by a t test.
fn drift_probability(residuals: &[f64], copies: &[Vec<f64>], places: &[(usize, usize)]) -> f64 {
    let slow = |values: &[f64], block: usize| {
        let mut square = f64::MIN_POSITIVE;
        for (part, places) in values.chunks(block).zip(places.chunks(block)) {
            let whole = part.len() == block && places[0].0 == places[block - 1].0;
            let known = part.iter().filter(|z| z.is_finite());
            if whole {
                square += known.clone().sum::<f64>().powi(2) / (known.count() as f64).max(1.0);
            }
        }
        square.ln()
    };
    let count = copies.len() as f64;
    let of = |block: &usize| {
        let others: Vec<f64> = copies.iter().map(|copy| slow(copy, *block)).collect();
        let mean = others.iter().sum::<f64>() / count;
        let scatter = others.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0) * (1.0 + 1.0 / count);
        let t = (slow(residuals, *block) - mean) / scatter.sqrt().max(f64::MIN_POSITIVE);
        if t > 0.0 { tail(t * t, 1.0, count - 1.0) / 2.0 } else { 1.0 }
    };
    (DRIFT_BLOCKS.iter().map(of).fold(1.0, f64::min) * DRIFT_BLOCKS.len() as f64).min(1.0)
}

/// Weights of equations by their errors: 1 for the typical error or a smaller one.
fn shares(errors: &[f64], n: usize) -> Vec<f64> {
    let typical: Vec<f64> = (0..n).map(|i| quantile(&mut column(errors, (n, i)), 0.5)).collect();
    errors.iter().enumerate().map(|(at, error)| (typical[at % n] / error).powi(2).min(1.0)).collect()
}

/// Standard error of every force equation, `(states, n)`: the noise of the force, and the mass matrix times the errors of the accelerations.
fn errors(problem: &Problem<'_>, states: &States, x: &[f64], least: &[f64]) -> Vec<f64> {
    let n = problem.driven.equations.n;
    let tracks =
        || problem.driven.recording.tracks.iter().map(|track| (track.times.as_slice(), track.force.as_slice()));
    let of_force: Vec<f64> = (0..n).map(|i| noise(tracks(), n, i).sigma).collect();
    let mut all = vec![0.0; states.q.len()];
    states.batches(problem, x, |follower, range, _| {
        let (all, of_acceleration) = (&mut all[range.clone()], &states.a_error[range]);
        let rows = follower.mass().chunks_exact(n).zip(&mut *all).enumerate();
        for (at, (row, error)) in rows {
            let first = at / n * n;
            let square: f64 = row.iter().zip(&of_acceleration[first..first + n]).map(|(m, e)| (m * e).powi(2)).sum();
            *error = of_force[at % n].hypot(square.sqrt()).max(least[at % n]);
        }
        states.with_free_part(follower, |free| {
            let of_states = follower.mass().chunks_exact(n * n).zip(of_acceleration.chunks_exact(n));
            for (state, ((mass, of_acceleration), all)) in of_states.zip(all.chunks_exact_mut(n)).enumerate() {
                let found = free.errors(state, mass, (of_acceleration, &of_force));
                all.iter_mut().zip(found).zip(least).for_each(|((all, found), least)| *all = found.max(*least));
            }
        });
    });
    all
}

/// Units in which forces under constraints are compared, `(n)`: the typical errors of the unconstrained equations.
fn units(problem: &Problem<'_>, states: &States, x: &[f64], least: &[f64]) -> Vec<f64> {
    let n = least.len();
    let errors = errors(problem, states, x, least);
    let typical: Vec<f64> = (0..n).map(|i| quantile(&mut column(&errors, (n, i)), 0.5)).collect();
    let most = typical.iter().copied().filter(|unit| unit.is_finite()).fold(f64::MIN_POSITIVE, f64::max);
    typical.into_iter().map(|unit| if unit.is_finite() { unit.max(LEAST_FORCE_UNIT * most) } else { most }).collect()
}

impl Problem<'_> {
    /// `true` if the equations are linear in all unknown constants together, as tested at the initial states of segments.
    pub(super) fn is_linear(&self, segments: &[Segment]) -> bool {
        let (n, m) = (self.driven.equations.n, self.chosen.len());
        let stride = segments.len().div_ceil(LANES).max(1);
        let starts = || segments.iter().step_by(stride).map(|segment| segment.start.split_at(n));
        let q: Vec<f64> = starts().flat_map(|(q, _)| q.to_vec()).collect();
        let v: Vec<f64> = starts().flat_map(|(_, v)| v.to_vec()).collect();
        let slopes = |factor: f64| {
            let x: Vec<f64> = (0..m).map(|k| factor * (1.0 + k as f64 / m as f64)).collect();
            // Linearity can be tested at any accelerations.
            Follower::new(&self.driven).force_slopes(&self.parameters(&x), (&q, &v, &q)).to_vec()
        };
        let (one, other) = (slopes(1.0), slopes(1.7));
        let rows = one.chunks_exact(2 * n + m).zip(other.chunks_exact(2 * n + m));
        rows.into_iter().all(|(one, other)| {
            one[2 * n..].iter().zip(&other[2 * n..]).all(|(a, b)| (a - b).abs() <= SLOPE_ROUNDING * a.abs().max(1.0))
        })
    }
}
