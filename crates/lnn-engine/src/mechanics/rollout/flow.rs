//! The final state of a motion as a function of its initial state, of a force, and of parameters.

use crate::lagrangian::{Accelerations, EulerLagrange, Linearizer, MechanicsError, Request, Terms};
use crate::linalg::Workspace;
use crate::scalar::{Real, Scalar, update};

/// Coefficients of the method of Dormand and Prince of order 5 (1980), as numerators and denominators, and its weights.
const STAGES: [&[(f64, f64)]; 6] = [
    &[],
    &[(1.0, 5.0)],
    &[(3.0, 40.0), (9.0, 40.0)],
    &[(44.0, 45.0), (-56.0, 15.0), (32.0, 9.0)],
    &[(19372.0, 6561.0), (-25360.0, 2187.0), (64448.0, 6561.0), (-212.0, 729.0)],
    &[(9017.0, 3168.0), (-355.0, 33.0), (46732.0, 5247.0), (49.0, 176.0), (-5103.0, 18656.0)],
];
const WEIGHTS: [(f64, f64); 6] =
    [(35.0, 384.0), (0.0, 1.0), (500.0, 1113.0), (125.0, 192.0), (-2187.0, 6784.0), (11.0, 84.0)];

/// The final state `y(T) = (q, v)` of a motion and its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct FlowJacobian<S> {
    /// `y(T)`, `2 n` numbers.
    pub end: Vec<S>,
    /// `dy(T)/dy(0)`, `(2 n, 2 n)` row by row.
    pub by_start: Vec<S>,
    /// Derivatives of `y(T)` by a generalized force that is constant in time, `(2 n, n)` row by row.
    pub by_force: Vec<S>,
}

/// Derivatives of `w.y(T)`.
#[derive(Clone, Debug, PartialEq)]
pub struct FlowGradient<S> {
    /// `y(T)`, `2 n` numbers.
    pub end: Vec<S>,
    /// Derivatives by the initial state, `2 n` numbers.
    pub by_start: Vec<S>,
    /// Derivatives by the parameters, as in [`Gradient::by_parameters`](crate::lagrangian::Gradient::by_parameters).
    pub by_parameters: Vec<S>,
}

/// Maps the initial state of a motion to its final state, with a fixed number of Dormand-Prince steps of order 5, and provides the exact
/// derivatives of these steps, for a fit, a filter, or a controller.
///
/// ```
/// use lnn::lagrangian::SystemInstance;
/// use lnn::rollout::Flow;
///
/// // A quarter of a period turns an oscillator: q(T) = v(0), v(T) = -q(0).
/// let oscillator = SystemInstance::<f64>::named("harmonic-oscillator", &[])?.build()?;
/// let quarter = Flow::new(&*oscillator, std::f64::consts::FRAC_PI_2, 200);
/// let turned = quarter.jacobian(&[1.0], &[0.0], None)?;
/// let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-11);
/// assert!(near(&turned.end, &[0.0, -1.0]) && near(&turned.by_start, &[0.0, 1.0, -1.0, 0.0]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Flow<'a, S: Scalar> {
    model: &'a dyn EulerLagrange<S>,
    step: S,
    steps: usize,
}

impl<'a, S: Scalar> Flow<'a, S> {
    /// Defines the flow over a time `duration`, which may be negative, with this number of steps.
    pub fn new(model: &'a dyn EulerLagrange<S>, duration: S, steps: usize) -> Self {
        let steps = steps.max(1);
        Self { model, step: duration / S::of_f64(steps as f64), steps }
    }

    /// Computes the final state of the motion from `(q, v)`, with an optional generalized force that is constant in time.
    ///
    /// # Errors
    /// A state cannot be evaluated, or `q`, `v` or the force has the wrong length.
    pub fn end(&self, q: &[S], v: &[S], force: Option<&[S]>) -> Result<Vec<S>, MechanicsError> {
        let mut y = self.start(q, v)?;
        let Some(force) = force else {
            let mut accelerations = Accelerations::new(self.model);
            self.visit(&mut y, &mut |q, v, a| accelerations.at(q, v, a), |_| ())?;
            return Ok(y);
        };
        let (mut terms, mut workspace) = (Terms::default(), Workspace::new());
        let mut accelerate = |q: &[S], v: &[S], a: &mut [S]| {
            self.model.terms(q, v, Request::ACCELERATION, &mut terms)?;
            terms.add_force(q.len(), v, force, &mut workspace)?;
            a.copy_from_slice(&terms.acceleration);
            Ok(())
        };
        self.visit(&mut y, &mut accelerate, |_| ())?;
        Ok(y)
    }

    /// Computes the final state and all its derivatives by the initial state and by a constant force, by default 0.
    ///
    /// # Errors
    /// Those of [`Flow::end`].
    pub fn jacobian(&self, q: &[S], v: &[S], force: Option<&[S]>) -> Result<FlowJacobian<S>, MechanicsError> {
        let (n, zero, one) = (self.model.coordinates(), <S as Real>::zero(), <S as Real>::one());
        let mut y = self.start(q, v)?;
        let mut linearizer = Linearizer::new(self.model);
        // Rows are components of the state; columns are the initial state and the force.
        let width = 3 * n;
        let mut tangents = vec![zero; 2 * n * width];
        (0..2 * n).for_each(|i| tangents[i * width + i] = one);
        let (mut slopes, mut moved) = (vec![vec![zero; 2 * n]; 6], vec![vec![zero; 2 * n * width]; 6]);
        for _ in 0..self.steps {
            for stage in 0..6 {
                let at = self.combined(&y, STAGES[stage], &slopes);
                let by = self.combined(&tangents, STAGES[stage], &moved);
                let found = linearizer.under(&at[..n], &at[n..], force)?;
                slopes[stage][..n].copy_from_slice(&at[n..]);
                slopes[stage][n..].copy_from_slice(&found.acceleration);
                let moved = &mut moved[stage];
                moved[..n * width].copy_from_slice(&by[n * width..]);
                for i in 0..n {
                    let row = &mut moved[(n + i) * width..][..width];
                    row.fill(zero);
                    row[2 * n..].copy_from_slice(&found.by_force[i * n..][..n]);
                    for j in 0..2 * n {
                        let factor = if j < n { found.by_q[i * n + j] } else { found.by_v[i * n + j - n] };
                        update(row, &by[j * width..][..width], |sum, x| *sum += factor * x);
                    }
                }
            }
            y = self.combined(&y, &WEIGHTS, &slopes);
            tangents = self.combined(&tangents, &WEIGHTS, &moved);
        }
        let part = |columns: std::ops::Range<usize>| -> Vec<S> {
            tangents.chunks_exact(width.max(1)).flat_map(|row| row[columns.clone()].iter().copied()).collect()
        };
        Ok(FlowJacobian { end: y, by_start: part(0..2 * n), by_force: part(2 * n..width) })
    }

    /// Computes the final state and the derivatives of `w.y(T)`, with `w` of `2 n` numbers, by the initial state and by all parameters, in
    /// one backward sweep over the stored states of the steps.
    ///
    /// # Errors
    /// Those of [`Flow::end`]; also if `w` has the wrong length.
    pub fn gradient(&self, q: &[S], v: &[S], w: &[S]) -> Result<FlowGradient<S>, MechanicsError> {
        let (n, zero) = (self.model.coordinates(), <S as Real>::zero());
        if w.len() != 2 * n {
            return Err(MechanicsError::Shape { what: "weights", expected: 2 * n, found: w.len() });
        }
        let mut y = self.start(q, v)?;
        let mut before = Vec::with_capacity(self.steps);
        let (mut linearizer, mut accelerations) = (Linearizer::new(self.model), Accelerations::new(self.model));
        self.visit(&mut y, &mut |q, v, a| accelerations.at(q, v, a), |state| before.push(state.to_vec()))?;
        let (mut weights, mut by_parameters) = (w.to_vec(), Vec::new());
        for state in before.iter().rev() {
            let (stages, _) = self.stages(state, &mut |q, v, a| accelerations.at(q, v, a))?;
            // Adjoints of the stage states, starting with the last stage.
            let mut adjoints: Vec<Vec<S>> = vec![vec![zero; 2 * n]; 6];
            for stage in (0..6).rev() {
                let mut slope = vec![zero; 2 * n];
                let own = self.step * ratio(WEIGHTS[stage]);
                update(&mut slope, &weights, |sum, x| *sum += own * x);
                for later in stage + 1..6 {
                    let factor = self.step * ratio(STAGES[later][stage]);
                    update(&mut slope, &adjoints[later], |sum, x| *sum += factor * x);
                }
                let (by_speed, by_a) = slope.split_at(n);
                let found = linearizer.gradient(&stages[stage][..n], &stages[stage][n..], by_a)?;
                adjoints[stage][..n].copy_from_slice(&found.by_q);
                adjoints[stage][n..].copy_from_slice(by_speed);
                update(&mut adjoints[stage][n..], &found.by_v, |sum, x| *sum += x);
                by_parameters.resize(found.by_parameters.len(), zero);
                update(&mut by_parameters, &found.by_parameters, |sum, x| *sum += x);
            }
            adjoints.iter().for_each(|adjoint| update(&mut weights, adjoint, |sum, x| *sum += x));
        }
        Ok(FlowGradient { end: y, by_start: weights, by_parameters })
    }

    /// Assembles the initial state.
    fn start(&self, q: &[S], v: &[S]) -> Result<Vec<S>, MechanicsError> {
        let expected = self.model.coordinates();
        for (what, found) in [("coordinates", q.len()), ("velocities", v.len())] {
            if found != expected {
                return Err(MechanicsError::Shape { what, expected, found });
            }
        }
        Ok([q, v].concat())
    }

    /// Integrates a state to the end, and passes it to a function before every step.
    fn visit(
        &self,
        y: &mut Vec<S>,
        accelerate: &mut Accelerate<'_, S>,
        mut show: impl FnMut(&[S]),
    ) -> Result<(), MechanicsError> {
        for _ in 0..self.steps {
            show(y);
            let (_, slopes) = self.stages(y, accelerate)?;
            *y = self.combined(y, &WEIGHTS, &slopes);
        }
        Ok(())
    }

    /// Computes the stage states of a step and their slopes.
    fn stages(&self, y: &[S], accelerate: &mut Accelerate<'_, S>) -> Result<Stages<S>, MechanicsError> {
        let n = self.model.coordinates();
        let mut slopes: Vec<Vec<S>> = Vec::with_capacity(6);
        let mut states = Vec::with_capacity(6);
        for stage in STAGES {
            let at = self.combined(y, stage, &slopes);
            let mut slope = at[n..].to_vec();
            slope.resize(2 * n, <S as Real>::zero());
            accelerate(&at[..n], &at[n..], &mut slope[n..])?;
            slopes.push(slope);
            states.push(at);
        }
        Ok((states, slopes))
    }

    /// Returns `y` plus the step size times a combination of slopes.
    fn combined(&self, y: &[S], factors: &[(f64, f64)], slopes: &[Vec<S>]) -> Vec<S> {
        let mut sum = y.to_vec();
        for (&factor, slope) in factors.iter().zip(slopes) {
            let factor = self.step * ratio(factor);
            update(&mut sum, slope, |sum, x| *sum += factor * x);
        }
        sum
    }
}

/// Computes the accelerations of a state.
type Accelerate<'a, S> = dyn FnMut(&[S], &[S], &mut [S]) -> Result<(), MechanicsError> + 'a;
type Stages<S> = (Vec<Vec<S>>, Vec<Vec<S>>);

fn ratio<S: Scalar>((numerator, denominator): (f64, f64)) -> S {
    S::of_f64(numerator) / S::of_f64(denominator)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::SystemInstance;
    use crate::rollout::{RolloutOptions, rollout};
    use crate::scalar::Dd;

    fn arm<S: Scalar>(changed: Option<(usize, S)>) -> Box<dyn EulerLagrange<S>> {
        let mut configured = SystemInstance::<S>::named("double-pendulum", &[]).unwrap();
        if let Some((k, by)) = changed {
            configured.parameters[k] += by;
        }
        configured.build().unwrap()
    }

    /// Compares derivatives of the steps with differences of the same steps in double-double precision.
    #[test]
    fn derivatives_are_those_of_the_steps() {
        let (q, v, w) = ([1.1, -0.4], [0.3, 0.8], [0.4, -1.0, 0.7, 0.2]);
        let (model, wide) = (arm::<f64>(None), arm::<Dd>(None));
        let flow = Flow::new(&*model, 1.5, 40);
        let found = flow.jacobian(&q, &v, None).unwrap();
        let gradient = flow.gradient(&q, &v, &w).unwrap();
        assert_eq!(gradient.end, flow.end(&q, &v, None).unwrap());
        let lift = |x: &[f64]| x.iter().map(|&x| Dd::of_f64(x)).collect::<Vec<_>>();
        let (duration, h) = (Dd::of_f64(1.5), Dd::of_f64(1e-9));
        let slope = |end: &dyn Fn(Dd) -> Vec<Dd>| -> Vec<f64> {
            end(h).iter().zip(end(-h)).map(|(&a, b)| ((a - b) / (h + h)).to_f64()).collect()
        };
        let near = |x: f64, exact: f64| assert!((x - exact).abs() < 1e-11 * (1.0 + exact.abs()), "{x} for {exact}");
        (0..4).for_each(|i| near(found.end[i], gradient.end[i]));
        for j in 0..4 {
            let exact = slope(&|h| {
                let mut y = lift(&[q, v].concat());
                y[j] += h;
                Flow::new(&*wide, duration, 40).end(&y[..2], &y[2..], None).unwrap()
            });
            (0..4).for_each(|i| near(found.by_start[i * 4 + j], exact[i]));
            near(gradient.by_start[j], exact.iter().zip(w).map(|(x, w)| x * w).sum());
        }
        for j in 0..2 {
            let exact = slope(&|h| {
                let mut force = [Dd::of_f64(0.0); 2];
                force[j] = h;
                Flow::new(&*wide, duration, 40).end(&lift(&q), &lift(&v), Some(&force)).unwrap()
            });
            (0..4).for_each(|i| near(found.by_force[i * 2 + j], exact[i]));
        }
        for k in 0..5 {
            let exact =
                slope(&|h| Flow::new(&*arm(Some((k, h))), duration, 40).end(&lift(&q), &lift(&v), None).unwrap());
            near(gradient.by_parameters[k], exact.iter().zip(w).map(|(x, w)| x * w).sum());
        }
    }

    #[test]
    fn the_end_is_that_of_the_motion_to_the_fifth_order() {
        let (q, v, model) = ([1.1, -0.4], [0.3, 0.8], arm::<f64>(None));
        let options = RolloutOptions { rtol: 1e-12, atol: 1e-12, ..RolloutOptions::new(1.0, 1.0) };
        let exact = rollout(&*model, &q, &v, &options).complete().unwrap();
        let miss = |steps: usize| {
            let end = Flow::new(&*model, 1.0, steps).end(&q, &v, None).unwrap();
            exact.q[2..].iter().chain(&exact.v[2..]).zip(&end).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let (coarse, fine) = (miss(100), miss(200));
        assert!(fine < 1e-9 && (24.0..40.0).contains(&(coarse / fine)), "{coarse:e}, {fine:e}");
        let flow = Flow::new(&*model, 1.0, 0);
        assert!(matches!(flow.end(&q[..1], &v, None), Err(MechanicsError::Shape { .. })));
        assert!(matches!(flow.gradient(&q, &v, &q), Err(MechanicsError::Shape { .. })));
        assert!(flow.jacobian(&q, &v, Some(&[1.0])).is_err());
    }
}
