//! The equations of motion of a system as recorded programs: what they need to be solved, and their slopes by state and parameters.
//!
//! With the residual `r = d/dt (dL/dv) - dL/dq + dD/dv - Q = M a - h - Q` a change of anything that it depends on, `a` held fixed,
//! changes the acceleration by `-M^-1 dr`: one reverse sweep per coordinate gives all slopes, however many parameters there are.

use super::derivatives::{StateTerms, evaluate};
use super::linearization::{ProgramSlopes, SlopePrograms};
use super::mechanics::RecordedValue;
use super::{ExpressionLagrangian, Lagrangian, LagrangianVisitor, Rayleigh, Request, Slopes, SystemInstance};
use crate::forward::HyperDual;
use crate::scalar::Real;
use crate::tape::{Program, TapeError, Tracer, VectorFunction, jacobian};
use std::sync::Arc;

/// Equations of motion of `n` coordinates and `m` parameters.
#[derive(Clone, Debug)]
pub struct Equations {
    /// Number of coordinates.
    pub n: usize,
    /// Of `(q, v)`: the mass matrix `M`, `(n, n)`, and `h = dL/dq - (d2L/dv dq) v - dD/dv`, `(n)`.
    pub motion: Arc<Program<f64>>,
    /// Of `(q, v, a)`: `dr/dq`, `dr/dv`, then `dr/dp` by the chosen parameters, row by row, `(n, 2n + chosen)`.
    pub slopes: Arc<Program<f64>>,
}

impl Equations {
    /// Records the equations of a system, with slopes by the parameters of these indices; `None` under constraints.
    ///
    /// # Errors
    /// [`TapeError`] for a Lagrangian that branches on its data.
    pub fn record(instance: &SystemInstance<f64>, chosen: &[usize]) -> Result<Option<Self>, TapeError> {
        let (n, count) = (instance.coordinates, instance.parameters.len());
        let Some(value) = instance.visit(Value { parameters: count }).transpose()? else { return Ok(None) };
        let mut parts = vec![EquationPart { value: RecordedValue { value }, friction: false }];
        if let Some(dissipation) = instance.dissipation() {
            parts.push(EquationPart::record(dissipation, count, true)?);
        }
        Self::of(n, count, &parts, (chosen, &[])).map(Some)
    }

    /// Records the equations of a sum of parts of `count` parameters, with slopes by chosen parameters and then by the factors of
    /// `terms` that the sum may get.
    ///
    /// # Errors
    /// [`TapeError`] for parts that branch on their data.
    pub fn of(
        n: usize,
        count: usize,
        parts: &[EquationPart],
        (chosen, terms): (&[usize], &[EquationPart]),
    ) -> Result<Self, TapeError> {
        let motion = Program::record(2 * n, count, |x, p| {
            let (q, v) = x.split_at(n);
            let zero = Tracer::zero();
            let (mut mass_matrix, mut coriolis) = (vec![zero; n * n], vec![zero; n]);
            let (mut rest, mut friction) = (vec![zero; n], vec![zero; n]);
            for part in parts {
                let (need, mut state) = if part.friction {
                    let nothing = StateTerms {
                        lagrangian: &mut [],
                        momentum: &mut friction,
                        dl_dq: &mut [],
                        mass_matrix: &mut [],
                        coriolis: &mut [],
                    };
                    (Request::MOMENTUM, nothing)
                } else {
                    let all = StateTerms {
                        lagrangian: &mut [],
                        momentum: &mut [],
                        dl_dq: &mut rest,
                        mass_matrix: &mut mass_matrix,
                        coriolis: &mut coriolis,
                    };
                    (Request::MASS_MATRIX | Request::CORIOLIS | Request::DL_DQ, all)
                };
                evaluate(&part.value, p, q, v, need, &mut state);
            }
            for (rest, (c, f)) in rest.iter_mut().zip(coriolis.into_iter().zip(friction)) {
                *rest = *rest - c - f;
            }
            mass_matrix.into_iter().chain(rest).collect()
        })?;
        let mut failure = None;
        let slopes = Program::record(3 * n, count, |x, p| {
            let all = [x, p].concat();
            let width = all.len();
            let single = terms.iter().map(|term| {
                let mut column = vec![Tracer::zero(); n];
                Equation { n, parts: std::slice::from_ref(term) }.eval(&all, &mut column);
                column
            });
            let single: Vec<Vec<_>> = single.collect();
            match jacobian(&Equation { n, parts }, &all) {
                Ok((_, matrix)) => {
                    let columns = || (0..2 * n).chain(chosen.iter().map(|k| 3 * n + k));
                    let row = |i: usize| columns().map(move |k| i * width + k);
                    let of = |i: usize| {
                        row(i).map(|at| matrix[at]).chain(single.iter().map(|column| column[i])).collect::<Vec<_>>()
                    };
                    (0..n).flat_map(of).collect()
                }
                Err(error) => {
                    failure = Some(error);
                    Vec::new()
                }
            }
        })?;
        match failure {
            Some(error) => Err(error),
            None => Ok(Self { n, motion: Arc::new(motion), slopes: Arc::new(slopes) }),
        }
    }
}

/// A recorded function of state and parameters: a part of the Lagrangian, or of the dissipation function.
#[derive(Debug)]
pub struct EquationPart {
    value: RecordedValue<f64>,
    friction: bool,
}

impl EquationPart {
    /// Records a function of `parameters` parameters, a part of the dissipation function if it is `friction`.
    ///
    /// # Errors
    /// [`TapeError`] for one that branches on its data.
    pub fn record(function: &impl Lagrangian, parameters: usize, friction: bool) -> Result<Self, TapeError> {
        Ok(Self { value: RecordedValue { value: Value { parameters }.visit(function)? }, friction })
    }
}

/// Records the value of a Lagrangian.
struct Value {
    parameters: usize,
}

impl LagrangianVisitor for Value {
    type Output = Result<Program<f64>, TapeError>;
    fn visit<L: Lagrangian>(self, lagrangian: &L) -> Self::Output {
        let n = lagrangian.coordinates();
        Program::record(2 * n, self.parameters, |x, p| vec![lagrangian.lagrangian(p, &x[..n], &x[n..])])
    }
}

/// The residual `r` without `Q`, a function of `(q, v, a, p)`.
struct Equation<'a> {
    n: usize,
    parts: &'a [EquationPart],
}

impl VectorFunction for Equation<'_> {
    fn outputs(&self) -> usize {
        self.n
    }

    /// `d/dt (dL/dv_i)` is the mixed second derivative of `L` along `(0, e_i)` and `(v, a)`.
    fn eval<R: Real>(&self, x: &[R], out: &mut [R]) {
        let n = self.n;
        let (q, v, a, p) = (&x[..n], &x[n..2 * n], &x[2 * n..3 * n], &x[3 * n..]);
        let still = |x: &[R]| x.iter().map(|&x| HyperDual::lift(x)).collect::<Vec<_>>();
        let moving = |x: &[R], by: &[R]| {
            let pairs = x.iter().zip(by);
            pairs.map(|(&x, &by)| HyperDual::new(x, R::zero(), by, R::zero())).collect::<Vec<_>>()
        };
        let p = still(p);
        let (moving_q, mut moving_v) = (moving(q, v), moving(v, a));
        let (mut still_q, mut still_v) = (still(q), still(v));
        for (i, out) in out.iter_mut().enumerate() {
            *out = R::zero();
            for EquationPart { value, friction } in self.parts {
                if *friction {
                    still_v[i].s = R::one();
                    *out += value.lagrangian(&p, &still_q, &still_v).s;
                    still_v[i].s = R::zero();
                    continue;
                }
                moving_v[i].s = R::one();
                *out += value.lagrangian(&p, &moving_q, &moving_v).st;
                moving_v[i].s = R::zero();
                still_q[i].s = R::one();
                *out -= value.lagrangian(&p, &still_q, &still_v).s;
                still_q[i].s = R::zero();
            }
        }
    }
}

/// A dissipation function with values of its parameters.
#[derive(Clone, Debug)]
pub(super) struct Friction<S> {
    pub function: ExpressionLagrangian,
    pub parameters: Vec<S>,
}

impl<S: crate::scalar::Scalar> super::Dissipation for Friction<S> {
    fn dissipation<R: Real>(&self, q: &[R], v: &[R]) -> R {
        let parameters: Vec<R> = self.parameters.iter().map(|p| R::constant(p.cast())).collect();
        self.function.lagrangian(&parameters, q, v)
    }
}

/// The parameters are those of the Lagrangian, in the same order.
impl<S: crate::scalar::Scalar> super::GeneralizedForce<S> for Friction<S> {
    fn force(&self, q: &[S], v: &[S], force: &mut [S]) {
        Rayleigh(self).force(q, v, force);
    }

    fn slopes(&self, n: usize) -> Option<Box<dyn Slopes<S> + '_>> {
        let k = self.parameters.len();
        let value = Program::record(2 * n, k, |x, p| vec![self.function.lagrangian(p, &x[..n], &x[n..])]).ok()?;
        Some(Box::new(ProgramSlopes::new(SlopePrograms::of_dissipation(&value)?, &self.parameters)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Description, EulerLagrange, configure_system};
    use crate::linalg::{Workspace, inverse};
    use crate::tape::Replay;
    use std::borrow::Cow;

    fn damped() -> Description {
        let text = r#"{"name": "arm", "dissipation": "c*(b_dot - a_dot)^2/2 + e*sqrt(a_dot^2 + 1e-4)",
            "lagrangian": "m*a_dot^2/2 + k*cos(a - b)*a_dot*b_dot + b_dot^2*(1 + a^2) + g*cos(a) + m*sin(b)",
            "coordinates": [{"name": "a", "periodic": true, "velocity_bounds": [-1, 1]},
                {"name": "b", "periodic": true, "velocity_bounds": [-1, 1]}],
            "parameters": {"m": 3, "k": 0.4, "g": 9.8, "c": 0.2, "e": 0.3}}"#;
        serde_json::from_str(text).unwrap()
    }

    fn accelerations(description: &Description, p: &[(&str, f64)], q: &[f64], v: &[f64]) -> Vec<f64> {
        let given: Vec<(String, String)> = p.iter().map(|(k, x)| (k.to_string(), x.to_string())).collect();
        let instance = configure_system::<f64>(Cow::Owned(description.system().unwrap()), &given).unwrap();
        let model = instance.build().unwrap();
        assert!(!model.conserves_energy());
        let a = model.acceleration(q, v).unwrap();
        let closed = instance.exact_acceleration(q, v).unwrap();
        assert!(a.iter().zip(&closed).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?} {closed:?}");
        a
    }

    #[test]
    fn slopes_of_accelerations_are_those_of_differences() {
        let description = damped();
        let instance = configure_system::<f64>(Cow::Owned(description.system().unwrap()), &[]).unwrap();
        // Parameters stand in the order of their names: c, e, g, k, m.
        let names = ["c", "e", "g", "k", "m"];
        let values = instance.parameters.clone();
        let equations = Equations::record(&instance, &[4, 0, 1]).unwrap().unwrap();
        let (q, v) = ([0.3, 1.1], [0.7, -0.4]);
        let a = accelerations(&description, &[], &q, &v);
        let (mut mass, mut rest) = ([0.0; 4], [0.0; 2]);
        let mut replay = Replay::new(Arc::clone(&equations.motion));
        replay.evaluate(1, &[&q, &v], &values, &mut [&mut mass, &mut rest]).unwrap();
        for i in 0..2 {
            let left = mass[2 * i] * a[0] + mass[2 * i + 1] * a[1];
            assert!((left - rest[i]).abs() < 1e-12);
        }
        let mut slopes = [0.0; 2 * 7];
        let mut replay = Replay::new(Arc::clone(&equations.slopes));
        replay.evaluate(1, &[&q, &v, &a], &values, &mut [&mut slopes]).unwrap();
        let mut inverted = [0.0; 4];
        inverse(2, &mass, &mut inverted, &mut Workspace::new()).unwrap();
        let slope = |i: usize, k: usize| -(inverted[2 * i] * slopes[k] + inverted[2 * i + 1] * slopes[7 + k]);
        const H: f64 = 1e-5;
        for k in 0..7 {
            let at = |h: f64| {
                let (mut q, mut v, mut p) = (q, v, Vec::new());
                match k {
                    0 | 1 => q[k] += h,
                    2 | 3 => v[k - 2] += h,
                    _ => {
                        let which = [4, 0, 1][k - 4];
                        p.push((names[which], values[which] + h));
                    }
                }
                accelerations(&description, &p, &q, &v)
            };
            let (up, down) = (at(H), at(-H));
            for i in 0..2 {
                let difference = (up[i] - down[i]) / (2.0 * H);
                assert!((difference - slope(i, k)).abs() < 1e-7, "{i} {k}: {difference} {}", slope(i, k));
            }
        }
    }
}
