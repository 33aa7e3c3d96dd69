//! The hand-written systems by name: description, Euler-Lagrange terms, closed-form acceleration.

use super::derivatives::{State, evaluate};
use super::equations::Friction;
use super::system::{ClosedForm, System};
use super::{
    Constrained, ConstraintError, EulerLagrange, ExpressionConstraints, ExpressionLagrangian, GeneralizedForce,
    Lagrangian, Mechanics, Rayleigh, Request, Terms, WithForces, constrained_descriptions,
};
use crate::linalg::Workspace;
use crate::names::unknown;
use crate::random::RngStream;
use crate::scalar::{Dd, Scalar};
use rand::Rng;
use std::any::Any;
use std::borrow::Cow;

/// Why a system could not be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SystemError {
    /// No system of this name.
    #[error("{}", unknown("system", name, known.iter().map(String::as_str)))]
    UnknownSystem {
        /// The name asked for.
        name: String,
        /// Names there are.
        known: Vec<String>,
    },
    /// No parameter of this symbol.
    #[error("{system}: {}", unknown("parameter", symbol, known.iter().map(String::as_str)))]
    UnknownParameter {
        /// The system.
        system: String,
        /// The symbol given.
        symbol: String,
        /// Symbols there are.
        known: Vec<String>,
    },
    /// A parameter given twice.
    #[error("parameter `{symbol}` is given twice")]
    Repeated {
        /// The symbol.
        symbol: String,
    },
    /// A value that is not a number or outside the allowed range.
    #[error("parameter `{symbol}` of {system} must be {demand}, found `{found}`")]
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
    /// Constraints that contradict each other or leave no motion.
    #[error("{system}: {problem}")]
    Constraints {
        /// The system.
        system: String,
        /// What is wrong with them.
        problem: String,
    },
    /// A state of the wrong length.
    #[error("{system}: expected {expected} coordinates and velocities, found {found}")]
    State {
        /// The system.
        system: String,
        /// Number of coordinates.
        expected: usize,
        /// Numbers found.
        found: usize,
    },
}

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

/// Something to do with the Lagrangian of a system, whatever its type is.
pub trait LagrangianVisitor {
    /// Result of the visit.
    type Output;

    /// Takes the Lagrangian; its parameters are [`SystemInstance::parameters`].
    fn visit<L: Lagrangian>(self, lagrangian: &L) -> Self::Output;
}

/// One line per system: its module and how it is made from the number of coordinates.
macro_rules! catalogue {
    ($($module:ident: $make:expr;)*) => {
        static SYSTEMS: &[System] = &[$(super::systems::$module::SYSTEM),*];

        /// Where each of them stands in [`SYSTEMS`].
        #[allow(non_camel_case_types)]
        enum Place { $($module),* }

        /// The Euler-Lagrange terms of a configured system.
        fn construct<S: Scalar>(configured: &SystemInstance<S>) -> Option<Box<dyn EulerLagrange<S>>> {
            let n = configured.coordinates;
            if let Some(described) = &configured.system.described {
                let parameters = configured.parameters.clone();
                return Some(Box::new(Mechanics::new(described.lagrangian.clone(), parameters)));
            }
            $(if configured.system.name == SYSTEMS[Place::$module as usize].name {
                let make: fn(usize) -> _ = $make;
                return Some(Box::new(Mechanics::new(make(n), configured.parameters.clone())));
            })*
            None
        }

        /// Shows a visitor the Lagrangian of a configured system.
        fn shown<S, V: LagrangianVisitor>(configured: &SystemInstance<S>, visitor: V) -> Option<V::Output> {
            let n = configured.coordinates;
            if let Some(described) = &configured.system.described {
                return Some(visitor.visit(&described.lagrangian));
            }
            $(if configured.system.name == SYSTEMS[Place::$module as usize].name {
                let make: fn(usize) -> _ = $make;
                return Some(visitor.visit(&make(n)));
            })*
            None
        }

        /// The closed-form acceleration of a configured system.
        fn closed<S: Scalar>(configured: &SystemInstance<S>, q: &[S], v: &[S]) -> Vec<S> {
            let n = configured.coordinates;
            $(if configured.system.name == SYSTEMS[Place::$module as usize].name {
                let make: fn(usize) -> _ = $make;
                return make(n).acceleration(&configured.parameters, q, v);
            })*
            vec![S::nan(); n]
        }

        /// The velocity of the time-like coordinate on the mass shell, if the system has one.
        fn constrained<S: Scalar>(configured: &SystemInstance<S>, q: &[S], v: &[S]) -> Option<S> {
            let n = configured.coordinates;
            $(if configured.system.name == SYSTEMS[Place::$module as usize].name {
                let make: fn(usize) -> _ = $make;
                return make(n).constrained_velocity(&configured.parameters, q, v);
            })*
            None
        }
    };
}

catalogue! {
    double_pendulum: |_| super::systems::double_pendulum::DoublePendulum;
    triple_pendulum: |_| super::systems::triple_pendulum::TriplePendulum;
    n_pendulum: |n| super::systems::n_pendulum::NPendulum { n };
    spring_pendulum: |_| super::systems::spring_pendulum::SpringPendulum;
    sphere_geodesic: |_| super::systems::sphere_geodesic::SphereGeodesic;
    constant_force: |_| super::systems::constant_force::ConstantForce;
    harmonic_oscillator: |_| super::systems::harmonic_oscillator::HarmonicOscillator;
    kepler: |_| super::systems::kepler::Kepler;
    henon_heiles: |_| super::systems::henon_heiles::HenonHeiles;
    charged_particle: |_| super::systems::charged_particle::ChargedParticle;
    ads2_geodesic: |n| super::systems::ads2_geodesic::AdsGeodesic { n };
    ads3_geodesic: |n| super::systems::ads3_geodesic::AdsGeodesic { n };
    ads4_geodesic: |n| super::systems::ads4_geodesic::AdsGeodesic { n };
    schwarzschild_geodesic: |_| super::systems::schwarzschild_geodesic::SchwarzschildGeodesic;
    schwarzschild_cartesian: |_| super::systems::schwarzschild_cartesian::KerrSchild::Schwarzschild;
    reissner_nordstrom_cartesian: |_| super::systems::reissner_nordstrom_cartesian::KerrSchild::ReissnerNordstrom;
    kerr_geodesic: |_| super::systems::kerr_geodesic::KerrGeodesic;
    kerr_cartesian: |_| super::systems::kerr_cartesian::KerrSchild::Kerr;
}

/// [`construct`], compiled in this crate once for each of its scalars instead of again in every crate that calls it: all
/// systems under all forward numbers are much code.
fn construct_once<S: Scalar>(configured: &SystemInstance<S>) -> Option<Box<dyn EulerLagrange<S>>> {
    fn single(configured: &SystemInstance<f32>) -> Option<Box<dyn EulerLagrange<f32>>> {
        construct(configured)
    }
    fn double(configured: &SystemInstance<f64>) -> Option<Box<dyn EulerLagrange<f64>>> {
        construct(configured)
    }
    fn double_double(configured: &SystemInstance<Dd>) -> Option<Box<dyn EulerLagrange<Dd>>> {
        construct(configured)
    }
    let configured: &dyn Any = configured;
    let built: Box<dyn Any> = if let Some(configured) = configured.downcast_ref() {
        Box::new(single(configured))
    } else if let Some(configured) = configured.downcast_ref() {
        Box::new(double(configured))
    } else {
        Box::new(double_double(configured.downcast_ref()?))
    };
    *built.downcast().ok()?
}

/// All systems whose coordinates are free; [`constrained_systems`](super::constrained_systems) are the others.
pub fn systems() -> &'static [System] {
    SYSTEMS
}

/// The system of a name.
///
/// # Errors
/// [`SystemError::UnknownSystem`] with the nearest name.
pub fn find(name: &str) -> Result<&'static System, SystemError> {
    SYSTEMS.iter().find(|system| system.name == name).ok_or_else(|| unknown_system(name))
}

/// The system of a name, one under constraints as well.
///
/// # Errors
/// As [`find`].
pub(crate) fn resolve(name: &str) -> Result<Cow<'static, System>, SystemError> {
    let constrained = || constrained_descriptions().find(|description| description.name == name)?.compile().ok();
    match find(name) {
        Ok(system) => Ok(Cow::Borrowed(system)),
        Err(unknown) => constrained().map(Cow::Owned).ok_or(unknown),
    }
}

impl<S: Scalar> SystemInstance<S> {
    /// As [`build`](super::build).
    ///
    /// # Errors
    /// [`SystemError::UnknownSystem`] if the description is not of the catalogue or the scalar is none of `f32`, `f64` and
    /// [`Dd`].
    pub fn build(&self) -> Result<Box<dyn EulerLagrange<S>>, SystemError> {
        let free = construct_once(self).ok_or_else(|| unknown_system(&self.system.name))?;
        self.constrain(match self.friction() {
            None => free,
            Some(friction) => Box::new(WithForces::new(free, Rayleigh(friction))),
        })
    }
    /// A model of the same coordinates, learned for instance, under the constraints of the system; without any, as it is.
    ///
    /// # Errors
    /// [`SystemError::Constraints`] for constraints that contradict each other or leave no motion, or a model of other coordinates.
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
        let (q, v) = self.anywhere();
        Ok(Box::new(model.independent(&q, &v).map_err(wrong)?))
    }
    /// The constraints of a system by its description.
    pub fn constraints(&self) -> Option<&ExpressionConstraints> {
        self.system.described.as_ref()?.constraints.as_ref()
    }
    /// The dissipation function of a system by its description; its parameters are the Lagrangian's.
    pub fn dissipation(&self) -> Option<&ExpressionLagrangian> {
        self.system.described.as_ref()?.dissipation.as_ref()
    }
    /// The same with the values of the parameters.
    fn friction(&self) -> Option<Friction<S>> {
        let function = self.dissipation()?.clone();
        Some(Friction { function, parameters: self.parameters.clone() })
    }
    /// States within the bounds of the validation, at which constraints are examined.
    fn anywhere(&self) -> (Vec<S>, Vec<S>) {
        const STATES: usize = 24;
        let (bounds, mut rng) = (self.system.validation(self.coordinates), RngStream::Region.generator(0));
        let mut draw = |sides: &[(f64, f64)]| -> Vec<S> {
            let all = (0..STATES).flat_map(|_| sides.iter());
            all.map(|&(low, high)| S::of_f64(low + (high - low) * rng.random::<f64>())).collect()
        };
        (draw(&bounds.positions), draw(&bounds.velocities))
    }
    /// Shows the Lagrangian to a visitor; `None` if the description is not of the catalogue, and of a system with constraints, whose
    /// Lagrangian alone does not tell its motion.
    pub(crate) fn visit<V: LagrangianVisitor>(&self, visitor: V) -> Option<V::Output> {
        if self.constraints().is_some() { None } else { shown(self, visitor) }
    }
    /// Acceleration of one state by the closed form, which shares nothing with the Lagrangian but the parameters; of a system by its
    /// description, for which no closed form is known, by differentiating its Lagrangian. `NaN` where the mass matrix is singular.
    ///
    /// # Errors
    /// [`SystemError::State`] for a state of the wrong length; [`SystemError::Constraints`] for a system that has some, whose motion
    /// [`SystemInstance::build`] gives.
    pub fn exact_acceleration(&self, q: &[S], v: &[S]) -> Result<Vec<S>, SystemError> {
        self.check_lengths(q, v)?;
        if self.constraints().is_some() {
            let (system, problem) =
                (self.system.name.to_string(), "under constraints no acceleration has a closed form");
            return Err(SystemError::Constraints { system, problem: problem.to_string() });
        }
        Ok(match &self.system.described {
            Some(described) => differentiated(&described.lagrangian, self.friction(), &self.parameters, q, v),
            None => closed(self, q, v),
        })
    }
    /// Index of the coordinate whose velocity the mass shell fixes.
    pub fn constrained_coordinate(&self) -> Option<usize> {
        self.system.time_like.filter(|_| self.system.constraint.is_some())
    }
    /// Puts one state on the mass shell `g(v, v) = -1` by the velocity of its time-like coordinate; systems without a
    /// constraint leave the state alone.
    ///
    /// Outside the domain the velocity becomes `NaN` or infinite.
    ///
    /// # Errors
    /// [`SystemError::State`] for a state of the wrong length.
    pub fn impose_constraint(&self, q: &[S], v: &mut [S]) -> Result<(), SystemError> {
        self.check_lengths(q, v)?;
        let velocity = match &self.system.described {
            Some(described) => described.constrained_velocity(&self.parameters, q, v),
            None => constrained(self, q, v),
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
    /// Refuses coordinates where the system's chart ends (`r <= 0`, a pole, a horizon); the text says what is demanded.
    ///
    /// # Errors
    /// The condition that the coordinates violate.
    pub fn check_domain(&self, q: &[S]) -> Result<(), &'static str> {
        self.system.domain.map_or(Ok(()), |domain| domain(&leading(&self.parameters), &leading(q)))
    }
    /// `(x, y)` of coordinates in the system's [`Plane`](super::system::Plane); `None` without a plane or for a wrong
    /// number of coordinates.
    pub(crate) fn position_in_plane(&self, q: &[S]) -> Option<(f64, f64)> {
        let plane = self.system.plane.filter(|_| q.len() == self.coordinates)?;
        Some((plane.point)(&leading(&self.parameters), &leading(q)))
    }
    /// The system's [`Conserved`](super::system::Conserved) vector at a state; `None` without one or for a state of the wrong
    /// length.
    pub(crate) fn conserved(&self, q: &[S], v: &[S]) -> Option<Vec<f64>> {
        let conserved = self.system.conserved.filter(|_| self.check_lengths(q, v).is_ok())?;
        Some((conserved.vector)(&leading(&self.parameters), &leading(q), &leading(v)))
    }
}

/// The acceleration of one state by the Euler-Lagrange equations of a Lagrangian.
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
        &mut State { lagrangian: value, momentum, dl_dq, mass_matrix, coriolis },
    );
    if let Some(friction) = friction {
        terms.force.resize(n, S::nan());
        Rayleigh(friction).force(q, v, &mut terms.force);
    }
    // A row that fails has the acceleration NaN, which is what there is to say of one state.
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

#[cfg(test)]
mod tests;
