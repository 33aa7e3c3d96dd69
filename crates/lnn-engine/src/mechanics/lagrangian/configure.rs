//! Systems by name, with the values of their parameters as text or as numbers: description, Euler-Lagrange terms, closed-
//! form acceleration.

use super::derivatives::{StateTerms, evaluate};
use super::equations::Friction;
use super::formula_events::GivenEvent;
use super::formula_forces::{FormulaForces, GivenForces};
use super::recursion::Recursive;
use super::system::{Range, Size, System};
use super::systems::{SYSTEMS, closed_acceleration, constrained_velocity, unconstrained, visit_lagrangian};
use super::{
    Constrained, ConstraintError, EulerLagrange, ExpressionConstraints, ExpressionLagrangian, GeneralizedForce, InTime,
    Inputs, Lagrangian, MechanicsError, Rayleigh, Request, Terms, WithForces, constrained_description,
    constrained_descriptions,
};
use crate::lagrangian::thresholds::EXAMINED_STATES;
use crate::linalg::Workspace;
use crate::names::unknown;
use crate::random::RngStream;
use crate::scalar::{Real, Scalar};
use crate::tape;
use alloc::borrow::Cow;
use alloc::boxed::Box;
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;
use rand::Rng;

/// The reason why a system could not be built.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SystemError {
    /// There is no system with this name.
    UnknownSystem {
        /// The requested name.
        name: String,
        /// All known names.
        known: Vec<String>,
    },
    /// The system has no parameter with this symbol.
    UnknownParameter {
        /// The system.
        system: String,
        /// The symbol given.
        symbol: String,
        /// All symbols of the system.
        known: Vec<String>,
    },
    /// A parameter given twice.
    Repeated {
        /// The symbol.
        symbol: String,
    },
    /// A value that is not a number or outside the allowed range.
    Value {
        /// The system.
        system: String,
        /// The symbol.
        symbol: String,
        /// The values allowed.
        demand: String,
        /// The text given.
        found: String,
    },
    /// The system depends on the time, but the call needs a system whose state alone determines the motion.
    Timed {
        /// The system.
        system: String,
    },
    /// The constraints contradict each other or leave no motion.
    Constraints {
        /// The system.
        system: String,
        /// What is wrong with them.
        problem: String,
    },
    /// A state of the wrong length.
    State {
        /// The system.
        system: String,
        /// Number of coordinates.
        expected: usize,
        /// Numbers found.
        found: usize,
    },
}

impl core::fmt::Display for SystemError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::UnknownSystem { name, known } => {
                f.write_str(&unknown("system", name, known.iter().map(String::as_str)))
            }
            Self::UnknownParameter { system, symbol, known } => {
                write!(f, "{system}: {}", unknown("parameter", symbol, known.iter().map(String::as_str)))
            }
            Self::Repeated { symbol } => write!(f, "parameter `{symbol}` is given twice"),
            Self::Value { system, symbol, demand, found } => {
                write!(f, "parameter `{symbol}` of {system} must be {demand}, found `{found}`")
            }
            Self::Timed { system } => write!(f, "{system}: {}", MechanicsError::Timed),
            Self::Constraints { system, problem } => write!(f, "{system}: {problem}"),
            Self::State { system, expected, found } => {
                write!(f, "{system}: expected {expected} coordinates and velocities, found {found}")
            }
        }
    }
}

impl core::error::Error for SystemError {}

/// Parameters as given: symbol and decimal text.
pub type Given = [(String, String)];

/// A system with its size and the values of its parameters.
#[derive(Clone, Debug)]
pub struct SystemInstance<S> {
    /// Description.
    pub system: Cow<'static, System>,
    /// Number of coordinates.
    pub coordinates: usize,
    /// Values in the order of [`System::parameters`].
    pub parameters: Vec<S>,
}

/// A function that accepts the Lagrangian of any system, generic in its type.
pub trait LagrangianVisitor {
    /// Result of the visit.
    type Output;

    /// Receives the Lagrangian; its parameters are [`SystemInstance::parameters`].
    fn visit<L: Lagrangian>(self, lagrangian: &L) -> Self::Output;
}

impl System {
    /// Returns all systems without constraints; `constrained_systems` returns the others.
    pub fn unconstrained() -> &'static [System] {
        SYSTEMS
    }

    /// Returns the system with a name.
    ///
    /// # Errors
    /// [`SystemError::UnknownSystem`], which suggests the nearest name.
    pub fn named(name: &str) -> Result<&'static Self, SystemError> {
        SYSTEMS.iter().find(|system| system.name == name).ok_or_else(|| unknown_system(name))
    }
}

/// Returns the system with a name, including those with constraints.
///
/// # Errors
/// As [`System::named`].
pub fn resolve(name: &str) -> Result<Cow<'static, System>, SystemError> {
    match System::named(name) {
        Ok(system) => Ok(Cow::Borrowed(system)),
        Err(unknown) => {
            let constrained = constrained_description(name).and_then(|description| description.compile().ok());
            constrained.map(Cow::Owned).ok_or(unknown)
        }
    }
}

impl<S: Scalar> SystemInstance<S> {
    /// Builds the model, as [`SystemInstance::build`](super::SystemInstance::build) does.
    ///
    /// # Errors
    /// [`SystemError::UnknownSystem`] if the description is not in the catalogue or the scalar is not one of `f32`, `f64` and
    /// [`Dd`](crate::scalar::Dd).
    pub fn build(&self) -> Result<Box<dyn EulerLagrange<S>>, SystemError> {
        let count = self.inputs().count();
        self.build_with(Box::new((count, |_: S, values: &mut [S]| values.fill(<S as Real>::zero()))))
    }
    /// Builds the model as [`SystemInstance::build`](Self::build) does, with values for the inputs, which are otherwise 0.
    ///
    /// # Errors
    /// Those of [`SystemInstance::build`](Self::build).
    pub fn build_with(&self, inputs: Box<dyn Inputs<S>>) -> Result<Box<dyn EulerLagrange<S>>, SystemError> {
        let mut model = unconstrained(self).ok_or_else(|| unknown_system(&self.system.name))?;
        if let Some(forces) = self.forces() {
            let given = GivenForces { forces: forces.clone(), parameters: self.parameters.clone() };
            model = Box::new(WithForces::new(model, given));
        }
        self.constrain(if self.is_timed() { Box::new(InTime::with_inputs(model, inputs)) } else { model })
    }
    /// Returns `true` if the forces depend on measured inputs.
    pub fn has_inputs(&self) -> bool {
        self.system.description().is_some_and(|own| own.inputs.len() > own.marks())
    }
    /// Names of the inputs of its forces.
    pub fn inputs(&self) -> impl Iterator<Item = &str> {
        self.system.description().into_iter().flat_map(|own| own.inputs.keys().map(String::as_str))
    }
    /// Rejects a system whose accelerations depend on more than the state.
    ///
    /// # Errors
    /// [`SystemError::Timed`].
    pub fn require_states(&self) -> Result<(), SystemError> {
        if self.is_timed() { Err(SystemError::Timed { system: self.system.name.to_string() }) } else { Ok(()) }
    }
    /// Returns `true` if the Lagrangian or the forces of the description depend on the time or on inputs, which are then the last
    /// coordinates.
    pub fn is_timed(&self) -> bool {
        self.system.described.as_ref().is_some_and(|described| described.is_timed())
    }
    /// Returns the generalized forces of the description; they take the same parameters as the Lagrangian.
    #[doc(hidden)]
    pub fn forces(&self) -> Option<&FormulaForces> {
        self.system.described.as_ref()?.forces.as_ref()
    }
    /// Returns the events of the description, sorted by name.
    pub fn events(&self) -> Vec<GivenEvent<S>> {
        let events = self.system.described.as_ref().map_or(&[][..], |described| &described.events);
        events.iter().map(|event| GivenEvent::new(event.clone(), self.parameters.clone())).collect()
    }
    /// Adds friction to the model of the Lagrangian; for a chain of links, uses the recursive algorithms.
    pub(super) fn with_friction(&self, free: Box<dyn EulerLagrange<S>>) -> Box<dyn EulerLagrange<S>> {
        let model = match self.friction() {
            None => free,
            Some((friction, false)) => Box::new(WithForces::new(free, friction)),
            Some((friction, true)) => Box::new(WithForces::vanishing(free, friction)),
        };
        let chain = self.system.described.as_ref().and_then(|described| described.chain.as_ref());
        // The recursion stores the geometry of a chain in double precision.
        match chain.filter(|_| S::epsilon().to_f64() >= f64::EPSILON && !self.is_timed()) {
            Some(shape) => Box::new(Recursive::new(model, shape, &self.parameters)),
            None => model,
        }
    }
    /// Applies the constraints of the system to a model of the same coordinates, such as a learned one; without constraints the model is
    /// unchanged.
    ///
    /// # Errors
    /// [`SystemError::Constraints`] if the constraints contradict each other or leave no motion, or if the model has other coordinates.
    #[doc(hidden)]
    pub fn constrain<'a>(
        &self,
        model: Box<dyn EulerLagrange<S> + 'a>,
    ) -> Result<Box<dyn EulerLagrange<S> + 'a>, SystemError> {
        let Some(constraints) = self.constraints() else { return Ok(model) };
        let wrong = |error: ConstraintError| SystemError::Constraints {
            system: self.system.name.to_string(),
            problem: error.to_string(),
        };
        let model = Constrained::new(model, constraints.clone(), self.parameters.clone()).map_err(wrong)?;
        let model = model.with_parameters_of_model();
        if self.system.described.as_ref().is_some_and(|described| described.independent) {
            return Ok(Box::new(model));
        }
        let (q, v) = self.anywhere();
        Ok(Box::new(model.independent(&q, &v).map_err(wrong)?))
    }
    /// Returns the constraints of the description.
    #[doc(hidden)]
    pub fn constraints(&self) -> Option<&ExpressionConstraints> {
        self.system.described.as_ref()?.constraints.as_ref()
    }
    /// Returns the indices of the active constraints, without redundant ones.
    ///
    /// # Errors
    /// [`SystemError::Constraints`] if the constraints contradict each other or leave no motion.
    pub fn acting_constraints(&self) -> Result<Vec<usize>, SystemError> {
        use super::Constraints;
        let Some(constraints) = self.constraints() else { return Ok(Vec::new()) };
        let model = self.build()?;
        let acting = model.manifold().map_or(&[][..], |manifold| manifold.names());
        let all = constraints.names().into_iter().enumerate();
        Ok(all.filter(|(_, name)| acting.contains(name)).map(|(row, _)| row).collect())
    }
    /// Returns the dissipation function of the description; it takes the same parameters as the Lagrangian.
    pub fn dissipation(&self) -> Option<&ExpressionLagrangian> {
        self.system.described.as_ref()?.dissipation.as_ref()
    }
    /// Returns the friction with the values of its parameters, and `true` if it is zero for these values.
    fn friction(&self) -> Option<(Friction<S>, bool)> {
        let (function, mut vanishes) = (self.dissipation()?, false);
        let n = function.coordinates();
        // For a tracer, a product with a constant 0 is 0.
        let _ = tape::Program::<S>::record(2 * n, 0, |x, _| {
            let values: Vec<_> = self.parameters.iter().map(|value| tape::Tracer::constant(*value)).collect();
            let lost = function.lagrangian(&values, &x[..n], &x[n..]);
            vanishes = lost.is_exact_zero();
            vec![lost]
        });
        let parameters = self.parameters.clone();
        Some((Friction { function: function.clone(), parameters }, vanishes))
    }
    /// Returns states within the validation bounds, at which the constraints are examined.
    fn anywhere(&self) -> (Vec<S>, Vec<S>) {
        let (bounds, mut rng) = (self.system.validation(self.coordinates), RngStream::Region.generator(0));
        let mut draw = |sides: &[(f64, f64)]| -> Vec<S> {
            let all = (0..EXAMINED_STATES).flat_map(|_| sides.iter());
            all.map(|&(low, high)| S::of_f64(low + (high - low) * rng.random::<f64>())).collect()
        };
        (draw(&bounds.positions), draw(&bounds.velocities))
    }
    /// Passes the Lagrangian to a visitor, with the time as its last coordinate if the system depends on it. Returns `None` if the
    /// description is not in the catalogue, and for a system with constraints, whose Lagrangian alone does not determine its motion.
    #[doc(hidden)]
    pub fn visit<V: LagrangianVisitor>(&self, visitor: V) -> Option<V::Output> {
        if self.constraints().is_some() { None } else { self.visit_unconstrained(visitor) }
    }
    /// As [`visit`](Self::visit), including systems with constraints.
    #[doc(hidden)]
    pub fn visit_unconstrained<V: LagrangianVisitor>(&self, visitor: V) -> Option<V::Output> {
        visit_lagrangian(self, visitor)
    }
    /// Computes the acceleration at one state from the closed form, which shares only the parameters with the Lagrangian. A system from a
    /// description has no closed form; its Lagrangian is differentiated instead. The result is `NaN` where the mass matrix is singular.
    ///
    /// # Errors
    /// [`SystemError::State`] for a state of the wrong length; [`SystemError::Constraints`] for a system with constraints: use
    /// [`SystemInstance::build`] for its motion.
    pub fn exact_acceleration(&self, q: &[S], v: &[S]) -> Result<Vec<S>, SystemError> {
        self.check_lengths(q, v)?;
        if self.forces().is_some() || self.is_timed() {
            return Ok(self.build()?.acceleration(q, v).unwrap_or_else(|_| vec![S::nan(); q.len()]));
        }
        if self.constraints().is_some() {
            let (system, problem) =
                (self.system.name.to_string(), "the acceleration under constraints has no closed form");
            return Err(SystemError::Constraints { system, problem: problem.to_string() });
        }
        Ok(match &self.system.described {
            Some(described) => differentiated(
                &described.lagrangian,
                self.friction().map(|(friction, _)| friction),
                &self.parameters,
                q,
                v,
            ),
            None => closed_acceleration(self, q, v),
        })
    }
    /// Returns the index of the coordinate whose velocity follows from the mass shell.
    pub fn constrained_coordinate(&self) -> Option<usize> {
        self.system.time_like.filter(|_| self.system.constraint.is_some())
    }
    /// Puts a state on the mass shell `g(v, v) = -1` by setting the velocity of the time-like coordinate. Without a mass shell the state is
    /// unchanged.
    ///
    /// Outside the domain the velocity becomes `NaN` or infinite.
    ///
    /// # Errors
    /// [`SystemError::State`] for a state of the wrong length.
    pub fn impose_constraint(&self, q: &[S], v: &mut [S]) -> Result<(), SystemError> {
        self.check_lengths(q, v)?;
        let velocity = match &self.system.described {
            Some(described) => described.constrained_velocity(&self.parameters, q, v),
            None => constrained_velocity(self, q, v),
        };
        if let (Some(i), Some(velocity)) = (self.constrained_coordinate(), velocity) {
            v[i] = velocity;
        }
        Ok(())
    }
    fn check_lengths(&self, q: &[S], v: &[S]) -> Result<(), SystemError> {
        let expected = self.coordinates;
        match [q, v].into_iter().find(|x| x.len() != expected) {
            Some(x) => Err(SystemError::State { system: self.system.name.to_string(), expected, found: x.len() }),
            None => Ok(()),
        }
    }
    /// Rejects coordinates outside the system's chart (`r <= 0`, a pole, a horizon).
    ///
    /// # Errors
    /// A text that states the condition that the coordinates violate.
    pub fn check_domain(&self, q: &[S]) -> Result<(), &'static str> {
        self.system.domain.map_or(Ok(()), |domain| domain(&leading(&self.parameters), &leading(q)))
    }
    /// Returns `(x, y)` of coordinates in the system's [`Plane`](super::system::Plane); `None` without a plane or for a wrong number of
    /// coordinates.
    pub fn position_in_plane(&self, q: &[S]) -> Option<(f64, f64)> {
        let plane = self.system.plane.filter(|_| q.len() == self.coordinates)?;
        Some((plane.point)(&leading(&self.parameters), &leading(q)))
    }
    /// Computes the system's [`Conserved`](super::system::Conserved) vector at a state; `None` if it has none or the state has the wrong
    /// length.
    pub fn conserved(&self, q: &[S], v: &[S]) -> Option<Vec<f64>> {
        let conserved = self.system.conserved.filter(|_| self.check_lengths(q, v).is_ok())?;
        Some((conserved.vector)(&leading(&self.parameters), &leading(q), &leading(v)))
    }
}

/// Computes the acceleration at one state from the Euler-Lagrange equations of a Lagrangian.
fn differentiated<S: Scalar>(
    lagrangian: &ExpressionLagrangian,
    friction: Option<Friction<S>>,
    parameters: &[S],
    q: &[S],
    v: &[S],
) -> Vec<S> {
    let mut terms = Terms::default();
    let (n, need) = (q.len(), Request::ACCELERATION);
    let Terms { lagrangian: value, momentum, dl_dq, mass_matrix, coriolis, .. } = &mut terms;
    for (field, size) in [(&mut *dl_dq, n), (&mut *mass_matrix, n * n), (&mut *coriolis, n)] {
        field.resize(size, S::nan());
    }
    evaluate(
        lagrangian,
        parameters,
        q,
        v,
        need,
        &mut StateTerms { lagrangian: value, momentum, dl_dq, mass_matrix, coriolis },
    );
    if let Some(friction) = friction {
        terms.force.resize(n, S::nan());
        Rayleigh(friction).force(q, v, &mut terms.force);
    }
    // If the solution fails, the acceleration is NaN, which is the only report that a single state needs.
    let _ = terms.complete(q.len(), v, Request::ACCELERATION, &mut Workspace::new());
    terms.acceleration
}

fn leading<S: Scalar>(x: &[S]) -> Vec<f64> {
    x.iter().map(|x| x.to_f64()).collect()
}

fn unknown_system(name: &str) -> SystemError {
    SystemError::UnknownSystem {
        name: name.into(),
        known: {
            let constrained = constrained_descriptions().map(|description| description.name);
            SYSTEMS.iter().map(|system| system.name.to_string()).chain(constrained).collect()
        },
    }
}

impl<S: Scalar> SystemInstance<S> {
    /// Parses the parameters of a system in the working precision; missing ones take their defaults.
    ///
    /// # Errors
    /// [`SystemError`] for an unknown name or symbol, a repeated symbol, or a value that is not a number or out of range.
    pub fn named(name: &str, given: &Given) -> Result<Self, SystemError> {
        Self::new(resolve(name)?, given)
    }

    /// Does the same as [`SystemInstance::named`] for a given system, either from the catalogue or from a [description](super::Description).
    ///
    /// # Errors
    /// [`SystemError`] for an unknown or repeated symbol, or a value that is not a number or out of range.
    pub fn new(system: Cow<'static, System>, given: &Given) -> Result<Self, SystemError> {
        for (i, (symbol, _)) in given.iter().enumerate() {
            require_symbol(&system, symbol)?;
            if given[..i].iter().any(|(earlier, _)| earlier == symbol) {
                return Err(SystemError::Repeated { symbol: symbol.clone() });
            }
        }
        let text = |symbol: &str| given.iter().find(|(s, _)| s == symbol).map(|(_, text)| text.trim());
        assemble(
            system,
            |symbol| text(symbol).map(|text| (text.parse().ok(), text.to_string())),
            |symbol| text(symbol).map(|text| (S::parse(text), text.to_string())),
        )
    }

    /// Does the same as [`SystemInstance::new`] for values that are already numbers.
    ///
    /// # Errors
    /// [`SystemError`] for an unknown symbol or a value out of range.
    pub fn with_values(system: Cow<'static, System>, values: &BTreeMap<String, f64>) -> Result<Self, SystemError> {
        values.keys().try_for_each(|symbol| require_symbol(&system, symbol))?;
        let whole = |x: f64| (x >= 0.0 && x.fract() == 0.0).then_some(x as usize);
        assemble(
            system,
            |symbol| values.get(symbol).map(|&x| (whole(x), x.to_string())),
            |symbol| values.get(symbol).map(|&x| (Some(S::of_f64(x)), x.to_string())),
        )
    }
}

/// Rejects a symbol that the system does not have.
fn require_symbol(system: &System, symbol: &str) -> Result<(), SystemError> {
    let count = match system.size {
        Size::Fixed(_) => None,
        Size::Chosen { symbol, .. } => Some(symbol),
    };
    let known = system.parameters.iter().map(|p| p.symbol.as_ref()).chain(count);
    if known.clone().any(|k| k == symbol) {
        return Ok(());
    }
    let (system, known) = (system.name.to_string(), known.map(String::from).collect());
    Err(SystemError::UnknownParameter { system, symbol: symbol.to_string(), known })
}

/// Assembles a system of this size. `find` returns the value of a symbol together with its text; missing values take their defaults.
fn assemble<S: Scalar>(
    system: Cow<'static, System>,
    size: impl Fn(&str) -> Option<(Option<usize>, String)>,
    value: impl Fn(&str) -> Option<(Option<S>, String)>,
) -> Result<SystemInstance<S>, SystemError> {
    let refused = |symbol: &str, demand: String, found: String| SystemError::Value {
        system: system.name.to_string(),
        symbol: symbol.to_string(),
        demand,
        found,
    };
    let coordinates = match system.size {
        Size::Fixed(n) => n,
        Size::Chosen { symbol, least, most, .. } => match size(symbol) {
            None => system.size.default(),
            Some((found, text)) => found
                .filter(|n| (least..=most).contains(n))
                .map(|n| system.size.coordinates(n))
                .ok_or_else(|| refused(symbol, format!("an integer from {least} to {most}"), text))?,
        },
    };
    let mut parameters = Vec::with_capacity(system.parameters.len());
    for parameter in system.parameters.iter() {
        let default = || (S::parse(&parameter.default), parameter.default.to_string());
        let (found, text) = value(&parameter.symbol).unwrap_or_else(default);
        let zero = S::of_f64(0.0);
        let allowed = |value: &S| {
            value.is_finite()
                && match parameter.range {
                    Range::Any => true,
                    Range::AtLeastZero => *value >= zero,
                    Range::Positive => *value > zero,
                }
        };
        let demand = || parameter.range.text().to_string();
        parameters.push(found.filter(allowed).ok_or_else(|| refused(&parameter.symbol, demand(), text))?);
    }
    Ok(SystemInstance { system, coordinates, parameters })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::SystemInstance;
    use crate::scalar::Dd;

    fn given(list: &[(&str, &str)]) -> Vec<(String, String)> {
        list.iter().map(|&(s, t)| (s.into(), t.into())).collect()
    }

    #[test]
    fn every_entry_is_complete() {
        for system in System::unconstrained() {
            let n = system.size.default();
            let configured = SystemInstance::<f64>::named(&system.name, &[]).unwrap();
            assert_eq!(configured.build().unwrap().coordinates(), n);
            assert_eq!(system.coordinates(n).len(), n);
            assert_eq!((system.columns(n).len(), system.units(n).len()), (2 * n, 2 * n));
            let start = system.trajectory(n).start;
            assert_eq!((start.positions.len(), start.velocities.len()), (n, n));
            assert!(start.positions.iter().chain(&start.velocities).all(|b| b.0 <= b.1));
            let fixed = configured.constrained_coordinate();
            for bounds in [system.training(n), system.validation(n)] {
                assert_eq!((bounds.positions.len(), bounds.velocities.len()), (n, n));
                assert!(bounds.positions.iter().all(|b| b.0 < b.1), "{}", system.name);
                assert!(bounds.velocities.iter().enumerate().all(|(i, b)| b.0 < b.1 || fixed == Some(i)));
            }
            let mut v: Vec<f64> = (0..n).map(|i| 0.1 * i as f64).collect();
            let q: Vec<f64> = start.positions.iter().map(|b| 0.4 * b.0 + 0.6 * b.1).collect();
            let before = v.clone();
            configured.impose_constraint(&q, &mut v).unwrap();
            match fixed {
                None => assert_eq!((v, system.constraint), (before, None)),
                Some(i) => {
                    assert!(v[i] > 0.0 && (0..n).all(|k| k == i || v[k] == before[k]));
                    assert!(system.constraint.unwrap().starts_with(&format!("{} = ", system.columns(n)[n + i])));
                }
            }
            let middle: Vec<f64> = system.training(n).positions.iter().map(|b| 0.4 * b.0 + 0.6 * b.1).collect();
            assert_eq!(configured.check_domain(&middle), Ok(()));
        }
        let pendulum = System::named("double-pendulum").unwrap();
        assert_eq!(pendulum.columns(2), ["theta1", "theta2", "theta1_dot", "theta2_dot"]);
        assert_eq!(pendulum.labels(2)[1..3], ["theta2 [rad]", "theta1_dot [rad/s]"]);
        assert_eq!(System::named("sphere-geodesic").unwrap().columns(2), ["theta", "phi", "theta_dot", "phi_dot"]);
        assert!(SystemInstance::<f64>::named("spring-pendulum", &[]).unwrap().check_domain(&[0.0, 1.0]).is_err());
        assert!(SystemInstance::<f64>::named("sphere-geodesic", &[]).unwrap().check_domain(&[0.0, 1.0]).is_err());
        assert!(SystemInstance::<f64>::named("kepler", &[]).unwrap().check_domain(&[0.0, 0.0]).is_err());
        assert!(SystemInstance::<f64>::named("ads2-geodesic", &[]).unwrap().check_domain(&[1.0, -1.0]).is_err());
        // The horizon scales with the mass.
        let hole = |mass: &str| SystemInstance::<f64>::named("schwarzschild-geodesic", &given(&[("M", mass)])).unwrap();
        assert_eq!(hole("1").check_domain(&[0.0, 3.0, 1.0, 0.0]), Ok(()));
        assert!(hole("1.5").check_domain(&[0.0, 3.0, 1.0, 0.0]).is_err());
        assert!(hole("1").check_domain(&[0.0, 3.0, 0.0, 0.0]).is_err());
        assert!(hole("1").impose_constraint(&[0.0, 3.0, 1.0], &mut [0.0; 4]).is_err());
    }

    #[test]
    fn systems_are_where_they_should_be() {
        let place = |name: &str, list: &[(&str, &str)], q: &[f64]| {
            SystemInstance::<f64>::named(name, &given(list)).unwrap().position_in_plane(q).unwrap()
        };
        let near = |(x, y): (f64, f64), (a, b): (f64, f64), size: f64| {
            // Sine and cosine are accurate to half a unit in the last place, and angles are as accurate as pi.
            assert!((x - a).abs().max((y - b).abs()) <= 4.0 * f64::EPSILON * size, "({x}, {y}) for ({a}, {b})");
        };
        use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_6, PI};
        let root = 0.75f64.sqrt();
        // First one rod points to the right and one up; then both hang; then three rods, the last of which points up at an angle.
        near(place("double-pendulum", &[("l1", "2"), ("l2", "0.5")], &[FRAC_PI_2, PI]), (2.0, 0.5), 2.5);
        near(place("double-pendulum", &[], &[0.0, 0.0]), (0.0, -2.0), 2.0);
        let rods = [("l1", "1"), ("l2", "2"), ("l3", "4")];
        near(place("triple-pendulum", &rods, &[0.0, FRAC_PI_2, PI - FRAC_PI_6]), (4.0, 4.0 * root - 1.0), 7.0);
        near(place("n-pendulum", &[("n", "5"), ("l", "2")], &[FRAC_PI_6; 5]), (5.0, -10.0 * root), 10.0);
        near(place("n-pendulum", &[("n", "1")], &[-FRAC_PI_2]), (-1.0, 0.0), 1.0);
        near(place("spring-pendulum", &[], &[3.0, FRAC_PI_3]), (3.0 * root, -1.5), 3.0);
        near(place("sphere-geodesic", &[("R", "2")], &[FRAC_PI_3, PI]), (-2.0 * root, 1.0), 2.0);
        near(place("schwarzschild-geodesic", &[], &[7.0, 4.0, 1.0, FRAC_PI_6]), (4.0 * root, 2.0), 4.0);
        near(place("kerr-geodesic", &[], &[7.0, 4.0, 1.0, FRAC_PI_6]), (4.0 * root, 2.0), 4.0);
        assert_eq!(place("kerr-cartesian", &[], &[7.0, 4.0, 1.0, 2.0]), (4.0, 1.0));
        assert_eq!(place("kepler", &[], &[1.5, -2.0]), (1.5, -2.0));
        assert_eq!(place("henon-heiles", &[], &[0.25, 0.5]), (0.25, 0.5));
        assert_eq!(place("charged-particle", &[], &[1.0, 2.0, 3.0]), (1.0, 2.0));
        assert_eq!(place("ads2-geodesic", &[], &[1.0, 2.0]), (1.0, 2.0));
        assert_eq!(place("ads3-geodesic", &[], &[1.0, 2.0, 3.0]), (2.0, 3.0));
        assert_eq!(place("ads4-geodesic", &[], &[1.0, 2.0, 3.0, 4.0]), (2.0, 4.0));
        assert_eq!(SystemInstance::<f64>::named("kepler", &[]).unwrap().position_in_plane(&[1.0]), None);
    }

    #[test]
    fn places_are_finite_and_no_larger_than_the_system() {
        for system in System::unconstrained() {
            let n = system.size.default();
            let configured = SystemInstance::<f64>::named(&system.name, &[]).unwrap();
            let bounds = system.training(n).positions;
            let Some(plane) = system.plane else {
                assert_eq!((n, configured.position_in_plane(&[0.5])), (1, None), "{}", system.name);
                continue;
            };
            assert!(plane.labels.iter().all(|label| label.ends_with(" [m]")), "{}", system.name);
            let size = match system.name.as_ref() {
                "sphere-geodesic" => 1.0,
                "double-pendulum" | "triple-pendulum" | "n-pendulum" => n as f64,
                _ => f64::INFINITY,
            };
            for k in 0..1000 {
                // A different fraction of each coordinate's range in every state.
                let part = |i: usize| (0.618_034 * f64::from(k) * (1.0 + i as f64).sqrt()).fract();
                let q: Vec<f64> = bounds.iter().enumerate().map(|(i, b)| b.0 + (b.1 - b.0) * part(i)).collect();
                let (x, y) = configured.position_in_plane(&q).unwrap();
                assert!(x.is_finite() && y.is_finite() && x.hypot(y) <= size * (1.0 + 1e-15 * n as f64), "{q:?}");
            }
        }
    }

    #[test]
    fn parameters_are_read_and_refused() {
        let configured =
            SystemInstance::<Dd>::named("double-pendulum", &given(&[("l2", " 0.5 "), ("g", "0")])).unwrap();
        let expected: Vec<Dd> = ["1", "1", "1", "0.5", "0"].iter().map(|t| Dd::parse(t).unwrap()).collect();
        assert_eq!(configured.parameters, expected);
        assert_eq!(SystemInstance::<f32>::named("n-pendulum", &given(&[("n", "7")])).unwrap().coordinates, 7);
        let error = |name: &str, list: &[(&str, &str)]| SystemInstance::<f64>::named(name, &given(list)).unwrap_err();
        let text = error("duble-pendulum", &[]).to_string();
        assert_eq!(text, "unknown system \"duble-pendulum\", did you mean \"double-pendulum\"?");
        let text = error("spring-pendulum", &[("L0", "1")]).to_string();
        assert_eq!(text, "spring-pendulum: unknown parameter \"L0\", did you mean \"l0\"?");
        assert!(matches!(error("n-pendulum", &[("N", "3")]), SystemError::UnknownParameter { .. }));
        assert!(matches!(error("double-pendulum", &[("g", "1"), ("g", "2")]), SystemError::Repeated { .. }));
        for bad in ["0", "-1", "nan", "inf", "1e999", "one", ""] {
            assert!(
                matches!(error("double-pendulum", &[("m1", bad)]), SystemError::Value { symbol, .. } if symbol == "m1")
            );
        }
        for bad in ["0", "1001", "-1", "2.5", "18446744073709551616"] {
            assert!(matches!(error("n-pendulum", &[("n", bad)]), SystemError::Value { symbol, .. } if symbol == "n"));
        }
        assert!(matches!(
            SystemInstance::<f64>::named("double-pendulum", &[]).unwrap().exact_acceleration(&[1.0], &[1.0, 2.0]),
            Err(SystemError::State { expected: 2, found: 1, .. })
        ));
    }

    #[test]
    fn numbers_and_their_texts_configure_the_same() {
        let system = || Cow::Borrowed(System::named("n-pendulum").unwrap());
        let text =
            |n: &str, g: &str| SystemInstance::<f64>::new(system(), &[("n".into(), n.into()), ("g".into(), g.into())]);
        let number =
            |n: f64, g: f64| SystemInstance::<f64>::with_values(system(), &[("n".into(), n), ("g".into(), g)].into());
        let (a, b) = (text("3", "0.1").unwrap(), number(3.0, 0.1).unwrap());
        assert_eq!((a.coordinates, &a.parameters), (b.coordinates, &b.parameters));
        for (n, g) in [(2.5, 9.81), (-1.0, 9.81), (1e9, 9.81), (2.0, f64::NAN)] {
            assert_eq!(text(&n.to_string(), &g.to_string()).unwrap_err(), number(n, g).unwrap_err());
        }
        let other = SystemInstance::<f64>::with_values(system(), &[("mass".to_string(), 1.0)].into());
        assert!(matches!(other, Err(SystemError::UnknownParameter { .. })));
    }
}
