//! Recorded programs of the equations of motion of a system: the terms needed to solve them, and their derivatives by state and parameters.
//!
//! The residual is `r = d/dt (dL/dv) - dL/dq + dD/dv - Q = M a - h - Q`. A change of any of its arguments at fixed `a` changes the
//! acceleration by `-M^-1 dr`.

use super::linearization::{ProgramSlopes, Rate, SlopePrograms, SparseRows, add};
use super::programs::derivatives;
use super::{
    ExpressionLagrangian, Lagrangian, LagrangianVisitor, Rayleigh, Request, RowEquations, Slopes, SystemInstance,
};
use crate::scalar::Real;
use crate::tape::{Program, ROWS, TapeError, Tracer};
use alloc::boxed::Box;
use alloc::collections::BTreeMap;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Equations of motion of `n` coordinates and `m` parameters.
#[derive(Clone, Debug)]
pub struct Equations {
    /// Number of coordinates.
    pub n: usize,
    /// Number of known functions of the time, which both programs take as their last inputs: the time itself, then the inputs of the
    /// system.
    pub known: usize,
    /// Program of `(q, v)`: the mass matrix `M`, `(n, n)`, and `h = dL/dq - (d2L/dv dq) v - dD/dv + Q`, `(n)`.
    pub motion: Arc<Program<f64>>,
    /// Program of `(q, v, a)`: `dr/dq`, `dr/dv`, then `dr/dp` by the chosen parameters, row by row, `(n, 2n + chosen)`.
    pub slopes: Arc<Program<f64>>,
    /// The active constraints, if there are any; `h` does not include their forces.
    pub rows: Option<RowEquations>,
}

impl Equations {
    /// Records the equations of a system with its active constraints, and derivatives by the parameters with these indices. Returns `None`
    /// for a system that is not in the catalogue.
    ///
    /// # Errors
    /// [`TapeError`] for a Lagrangian that branches on its data.
    pub fn record(
        instance: &SystemInstance<f64>,
        chosen: &[usize],
        acting: &[usize],
    ) -> Result<Option<Self>, TapeError> {
        let (n, count) = (instance.coordinates, instance.parameters.len());
        let visited = instance.visit_unconstrained(Value { parameters: count });
        let Some(value) = visited.transpose()? else { return Ok(None) };
        let mut parts = vec![EquationPart::of(value, false)?];
        if let Some(dissipation) = instance.dissipation() {
            parts.push(EquationPart::record(dissipation, count, true)?);
        }
        if let Some(forces) = instance.forces() {
            parts.push(EquationPart::Forces(forces.programs()?));
        }
        let rows = instance.constraints().filter(|_| !acting.is_empty());
        let rows = rows.map(|rows| RowEquations::record(rows, acting, (count, chosen))).transpose()?;
        Ok(Some(Self { rows, ..Self::of(n, count, &parts, (chosen, &[]))? }))
    }

    /// Records the equations of a sum of parts with `count` parameters, and derivatives by chosen parameters and by the coefficients of
    /// candidate `terms`. The time and inputs are coordinates of the parts, after `n` others.
    ///
    /// # Errors
    /// [`TapeError`] for parts that branch on their data.
    pub fn of(
        n: usize,
        count: usize,
        parts: &[EquationPart],
        (chosen, terms): (&[usize], &[EquationPart]),
    ) -> Result<Self, TapeError> {
        let all = parts.iter().find_map(EquationPart::coordinates).unwrap_or(n);
        let known = all - n;
        let motion = Program::record_within(ROWS, (2 * n + known, count), |x, p| {
            let zero = Tracer::zero();
            let state = with_known(x, (n, 2));
            let (mut mass_matrix, mut rest) = (vec![zero; n * n], vec![zero; n]);
            for part in parts {
                match part {
                    EquationPart::Dissipation { value, .. } => {
                        let first = value.derivatives(&state, p, None)?.first;
                        rest.iter_mut().zip(&first[all..]).for_each(|(rest, &force)| *rest -= force);
                    }
                    EquationPart::Forces(programs) => {
                        let inputs = [&state, p].concat();
                        for (i, program) in programs {
                            rest[*i] += program.interpret(&inputs, &[]).ok()?[0];
                        }
                    }
                    EquationPart::Lagrangian { value, .. } => {
                        let found = derivatives(value, &state, p, Request::ACCELERATION)?;
                        for (rest, (g, c)) in rest.iter_mut().zip(found.dl_dq.into_iter().zip(found.coriolis)) {
                            *rest += g - c;
                        }
                        for (i, row) in found.mass_matrix.into_iter().enumerate().take(n) {
                            for (j, m) in row.into_iter().filter(|(j, _)| *j < n) {
                                mass_matrix[i * n + j] += m;
                                if j < i {
                                    mass_matrix[j * n + i] += m;
                                }
                            }
                        }
                    }
                }
            }
            mass_matrix.extend(rest);
            Some(mass_matrix)
        })?;
        // The residual r is the negative of the equations f.
        let slopes = Program::record_within(ROWS, (3 * n + known, count), |x, p| {
            let mut rows = vec![BTreeMap::new(); all];
            let x = with_known(x, (n, 3));
            for part in parts {
                for (row, own) in rows.iter_mut().zip(part.slopes(&x, p, chosen)?) {
                    own.into_iter().for_each(|(column, f)| add(row, column, -f));
                }
            }
            let width = 2 * all + chosen.len();
            for (k, term) in terms.iter().enumerate() {
                let (EquationPart::Lagrangian { rate, .. } | EquationPart::Dissipation { rate, .. }) = term else {
                    continue;
                };
                let column = rate.equations(&x, p)?;
                rows.iter_mut().zip(column).for_each(|(row, f)| add(row, width + k, -f));
            }
            let element = |row: &BTreeMap<_, _>, column| row.get(&column).copied().unwrap_or_else(Tracer::zero);
            let columns = || (0..n).chain(all..all + n).chain(2 * all..width + terms.len());
            Some(rows[..n].iter().flat_map(|row| columns().map(move |column| element(row, column))).collect())
        })?;
        Ok(Self { n, known, motion: Arc::new(motion), slopes: Arc::new(slopes), rows: None })
    }
}

/// Extends the vectors `q`, `v` and possibly `a` of `n` coordinates by the time and the inputs, which come last in `x`. The extension of
/// `q` contains their values; that of the others contains their derivatives, which are 0 except for the time.
fn with_known<'a>(x: &[Tracer<'a, f64>], (n, vectors): (usize, usize)) -> Vec<Tracer<'a, f64>> {
    let (moving, known) = x.split_at(n * vectors);
    let last = |order: usize| -> Vec<Tracer<'a, f64>> {
        match order {
            0 => known.to_vec(),
            _ => (0..known.len()).map(|k| Tracer::constant(if order == 1 && k == 0 { 1.0 } else { 0.0 })).collect(),
        }
    };
    moving.chunks_exact(n).enumerate().flat_map(|(order, vector)| [vector, &last(order)].concat()).collect()
}

/// A recorded part of the equations of motion.
#[derive(Debug)]
pub enum EquationPart {
    /// A part of the Lagrangian as a function of state and parameters.
    Lagrangian {
        /// The value.
        value: Program<f64>,
        /// Its rate.
        rate: Rate<f64>,
    },
    /// A part of the dissipation function.
    Dissipation {
        /// The value.
        value: Program<f64>,
        /// Its rate.
        rate: Rate<f64>,
    },
    /// Coordinates and the generalized forces on them, as functions of state and parameters.
    Forces(Vec<(usize, Program<f64>)>),
}

impl EquationPart {
    /// Records a function of `parameters` parameters; with `friction` it is a part of the dissipation function.
    ///
    /// # Errors
    /// [`TapeError`] for a function that branches on its data.
    pub fn record(function: &impl Lagrangian, parameters: usize, friction: bool) -> Result<Self, TapeError> {
        Self::of(Value { parameters }.visit(function)?, friction)
    }

    fn of(value: Program<f64>, friction: bool) -> Result<Self, TapeError> {
        Ok(match friction {
            true => Self::Dissipation { rate: Rate::of_dissipation(&value)?, value },
            false => Self::Lagrangian { rate: Rate::of_lagrangian(&value)?, value },
        })
    }

    /// Returns the number of coordinates; `None` for forces.
    fn coordinates(&self) -> Option<usize> {
        match self {
            Self::Lagrangian { value, .. } | Self::Dissipation { value, .. } => Some(value.inputs() / 2),
            Self::Forces(_) => None,
        }
    }

    /// Returns the nonzero derivatives of the equations `f` by state and chosen parameters, row by row; `x` contains `q`, `v`, `a`.
    fn slopes<R: Real>(&self, x: &[R], p: &[R], chosen: &[usize]) -> Option<SparseRows<R>> {
        match self {
            Self::Lagrangian { rate, .. } | Self::Dissipation { rate, .. } => rate.slopes(x, p, chosen),
            Self::Forces(programs) => {
                let n = x.len() / 3;
                let inputs = [&x[..2 * n], p].concat();
                let mut rows = vec![BTreeMap::new(); n];
                for (i, program) in programs {
                    let first = program.derivatives(&inputs, &[], None)?.first;
                    let places = (0..2 * n).chain(chosen.iter().map(|k| 2 * n + k)).enumerate();
                    let elements = places.map(|(column, place)| (column, first[place]));
                    rows[*i].extend(elements.filter(|(_, x)| !x.is_exact_zero()));
                }
                Some(rows)
            }
        }
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
        Some(Box::new(ProgramSlopes::new(SlopePrograms::of(&Rate::of_dissipation(&value).ok()?)?, &self.parameters)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Description, EulerLagrange};
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
        let instance = SystemInstance::<f64>::new(Cow::Owned(description.system().unwrap()), &given).unwrap();
        let model = instance.build().unwrap();
        assert!(!model.conserves_energy());
        let a = model.acceleration(q, v).unwrap();
        let closed = instance.exact_acceleration(q, v).unwrap();
        assert!(a.iter().zip(&closed).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?} {closed:?}");
        a
    }

    /// Evaluates a program of `x` and parameters at one point, and returns the effect of a change of one of its inputs.
    fn evaluated(program: &Arc<Program<f64>>, fields: &[&[f64]], p: &[f64], size: usize) -> Vec<f64> {
        let mut out = vec![0.0; size];
        Replay::new(Arc::clone(program)).evaluate(1, fields, p, &mut [&mut out]).unwrap();
        out
    }

    #[test]
    fn equations_in_time_have_slopes_by_state_and_parameters() {
        let mut description = damped();
        let own = description.lagrangian.clone().unwrap();
        // Adds a mass, a rotational moment and a loss that change with the time.
        description.lagrangian = Some(format!("{own} + (1 + t^2/9)*a_dot^2/2 + t*a*b_dot"));
        description.dissipation = Some("(c + e*t)*(b_dot - a_dot)^2/2".to_string());
        let forces = [("a", "k*cos(m*t + a) - e*b_dot*abs(a_dot)"), ("b", "c*t^2")];
        description.forces = forces.map(|(name, text)| (name.to_string(), text.to_string())).into();
        let instance = SystemInstance::<f64>::new(Cow::Owned(description.system().unwrap()), &[]).unwrap();
        let p = instance.parameters.clone();
        let equations = Equations::record(&instance, &[4, 3, 0], &[]).unwrap().unwrap();
        assert!(equations.known == 1 && instance.is_timed());
        let (x, a, t) = ([0.3, 1.1, 0.7, -0.4], [0.2, -0.9], [2.5]);
        let residual = |x: &[f64], t: f64, p: &[f64]| -> Vec<f64> {
            let found = evaluated(&equations.motion, &[&x[..2], &x[2..], &[t]], p, 6);
            (0..2).map(|i| found[2 * i] * a[0] + found[2 * i + 1] * a[1] - found[4 + i]).collect()
        };
        // Without the time dependence the equations agree.
        let free = SystemInstance::<f64>::new(Cow::Owned(damped().system().unwrap()), &[]).unwrap();
        let free = Equations::record(&free, &[4, 3, 0], &[]).unwrap().unwrap();
        let [own, other] = [
            evaluated(&equations.motion, &[&x[..2], &x[2..], &t], &p, 6),
            evaluated(&free.motion, &[&x[..2], &x[2..]], &p, 6),
        ];
        let [c, e, _, k, m] = p[..] else { panic!("five parameters") };
        let (rate, dry) = (x[3] - x[2], e * x[2] / (x[2].powi(2) + 1e-4).sqrt());
        let q = [k * (m * t[0] + x[0]).cos() - e * x[3] * x[2].abs(), c * t[0].powi(2)];
        // d/dt of (1 + t^2/9) a_dot and of t a, minus t b_dot.
        let by_time =
            [e * t[0] * rate + dry - 2.0 * t[0] / 9.0 * x[2] + t[0] * x[3], -e * t[0] * rate - x[0] - t[0] * x[2]];
        for i in 0..2 {
            assert!((own[4 + i] - other[4 + i] - q[i] - by_time[i]).abs() < 1e-12, "{i} {own:?} {other:?}");
        }
        assert!((own[0] - other[0] - 1.0 - t[0].powi(2) / 9.0).abs() < 1e-12 && own[1..4] == other[1..4]);
        // The model gives the same result.
        let mut terms = crate::lagrangian::Terms::default();
        let model = instance.build().unwrap();
        model.terms_at(&t, &x[..2], &x[2..], Request::ACCELERATION, &mut terms).unwrap();
        assert!(residual(&x, t[0], &p).len() == 2 && free.known == 0 && !model.conserves_energy());
        for i in 0..2 {
            let lacking = own[2 * i] * terms.acceleration[0] + own[2 * i + 1] * terms.acceleration[1] - own[4 + i];
            assert!(lacking.abs() < 1e-12, "{lacking}");
        }
        let slopes = evaluated(&equations.slopes, &[&x[..2], &x[2..], &a, &t], &p, 14);
        const H: f64 = 1e-5;
        for column in 0..7 {
            let at = |h: f64| {
                let (mut x, mut p) = (x, p.clone());
                match column {
                    0..4 => x[column] += h,
                    _ => p[[4, 3, 0][column - 4]] += h,
                }
                residual(&x, t[0], &p)
            };
            let (up, down) = (at(H), at(-H));
            for i in 0..2 {
                let difference = (up[i] - down[i]) / (2.0 * H);
                assert!((difference - slopes[7 * i + column]).abs() < 1e-7, "{i} {column}: {difference} {slopes:?}");
            }
        }
        // A state without a time has no acceleration.
        let model = instance.build().unwrap();
        assert_eq!(model.acceleration(&x[..2], &x[2..]).unwrap_err(), crate::lagrangian::MechanicsError::Timed);
    }

    #[test]
    fn forces_of_the_state_are_part_of_the_model_and_of_its_linearization() {
        let mut description = damped();
        description.forces = [("b".to_string(), "-k*b_dot*abs(b_dot) + c*a^2".to_string())].into();
        let a = |p: &[(&str, f64)], q: &[f64], v: &[f64]| accelerations(&description, p, q, v);
        let instance = SystemInstance::<f64>::new(Cow::Owned(description.system().unwrap()), &[]).unwrap();
        let model = instance.build().unwrap();
        let (q, v) = ([0.3, 1.1], [0.7, -0.4]);
        let mut linearizer = crate::lagrangian::Linearizer::new(&*model);
        let found = linearizer.at(&q, &v).unwrap();
        const H: f64 = 1e-5;
        for k in 0..4 {
            let at = |h: f64| {
                let (mut q, mut v) = (q, v);
                if k < 2 {
                    q[k] += h
                } else {
                    v[k - 2] += h
                }
                a(&[], &q, &v)
            };
            let (up, down) = (at(H), at(-H));
            for i in 0..2 {
                let by = if k < 2 { found.by_q[2 * i + k] } else { found.by_v[2 * i + k - 2] };
                assert!(((up[i] - down[i]) / (2.0 * H) - by).abs() < 1e-7, "{i} {k}");
            }
        }
    }

    #[test]
    fn mistakes_in_forces_are_named() {
        let wrong = |name: &str, text: &str| {
            let mut description = damped();
            description.forces = [(name.to_string(), text.to_string())].into();
            description.system().unwrap_err().to_string()
        };
        assert!(wrong("aa", "1").starts_with("forces.aa: unknown coordinate \"aa\""), "{}", wrong("aa", "1"));
        assert!(wrong("a", "tt").starts_with("forces.a: column 1: unknown name \"tt\""), "{}", wrong("a", "tt"));
    }

    #[test]
    fn slopes_of_accelerations_are_those_of_differences() {
        let description = damped();
        let instance = SystemInstance::<f64>::new(Cow::Owned(description.system().unwrap()), &[]).unwrap();
        // Parameters are sorted by name: c, e, g, k, m.
        let names = ["c", "e", "g", "k", "m"];
        let values = instance.parameters.clone();
        let equations = Equations::record(&instance, &[4, 0, 1], &[]).unwrap().unwrap();
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
