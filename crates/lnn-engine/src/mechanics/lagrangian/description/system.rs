//! Converts a description to a system: checks every name and formula, and compiles the Lagrangian.

use super::metric::{kinetic, on_shell};
use super::scope::Scope;
use super::{Described, Description, DescriptionError};
use crate::lagrangian::expression::{Compiler, Value};
use crate::lagrangian::system::{Coordinate, LearningAdvice, Parameter, PerSize, Range, Size, System};
use crate::lagrangian::{ExpressionLagrangian, constrained_description};
use crate::scalar::{Dd, Scalar};
use alloc::borrow::Cow;
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;

type Outcome<T> = Result<T, DescriptionError>;

/// The condition of the mass shell in words.
const SHELL: &str = "from the mass shell g(v, v) = -1, to the future";

impl Description {
    /// Builds the system, with its Lagrangian compiled.
    ///
    /// # Errors
    /// The first invalid key and the problem.
    pub fn system(&self) -> Outcome<System> {
        let taken = constrained_description(&self.name);
        if System::unconstrained().iter().any(|system| system.name == self.name)
            || taken.is_some_and(|description| description != *self)
        {
            let problem = format!("{} is a system of the catalogue, expected another name", self.name);
            return Err(DescriptionError::new("name", problem));
        }
        self.unfolded()?.compile_plain(self, false)
    }

    /// Compiles a description of the catalogue, which may be larger than one in a file and whose constraints are independent.
    ///
    /// # Errors
    /// The first invalid key and the problem.
    pub(in crate::mechanics::lagrangian) fn compile(&self) -> Outcome<System> {
        self.unfolded()?.compile_plain(self, true)
    }

    /// Compiles a description whose links are expanded; `written` is the original, and `catalogued` tells whether it is in the catalogue.
    fn compile_plain(self, written: &Self, catalogued: bool) -> Outcome<System> {
        let chain = written.shape(&self.parameters).map(Arc::new);
        self.check_texts()?;
        if !catalogued {
            written.check_counts(&self)?;
        }
        let written = (self != *written).then(|| written.clone());
        let n = self.coordinates.len();
        let mut compiler = Compiler::default();
        let (mut scope, timed) = self.scope()?;
        self.define(&mut compiler, &mut scope)?;
        let size = (n + if timed { 1 + self.inputs.len() } else { 0 }, self.parameters.len());
        let time_like = self.time_like()?;
        let (value, shell) = self.lagrangian_and_shell(&mut compiler, &scope, time_like)?;
        let dissipation = self.friction(&mut compiler, &scope)?;
        let forces = self.forces(&mut compiler, &scope, size)?;
        let events = self.compiled_events(&mut compiler, &scope)?.into();
        let readings = self.compiled_readings(&mut compiler, &scope)?.into();
        let constraints = self.constraints(&mut compiler, &scope)?;
        let base = self.base_bounds(shell.and(time_like))?;
        let training = self.bounds("training", &self.training, base.clone())?;
        let validation = self.bounds("validation", &self.validation, base)?;
        let trajectory = self.trajectory_test(&validation)?;
        let around_centre = self.shell_advice(shell.and(time_like))?;
        Ok(System {
            name: Cow::Owned(self.name.clone()),
            title: Cow::Owned(self.title.clone().unwrap_or_else(|| self.name.clone())),
            size: Size::Fixed(n),
            coordinates: PerSize::Given(self.coordinates.iter().map(coordinate).collect()),
            parameters: Cow::Owned(self.checked_parameters()?),
            time_unit: self.unit_of_time(time_like.is_some()),
            time_like,
            constraint: shell.map(|_| SHELL),
            training: PerSize::Given(training),
            validation: PerSize::Given(validation),
            trajectory: PerSize::Given(trajectory),
            domain: None,
            plane: None,
            conserved: None,
            learning: LearningAdvice::NONE,
            described: Some(Arc::new(Described {
                description: self.clone(),
                written,
                lagrangian: ExpressionLagrangian::compiled(size, compiler.formula(value)),
                dissipation: dissipation.map(|value| ExpressionLagrangian::compiled(size, compiler.formula(value))),
                forces,
                events,
                readings,
                constraints,
                independent: catalogued,
                chain,
                shell: shell.map(|shell| compiler.formula(shell)),
                around_centre,
            })),
        })
    }

    /// Returns the Lagrangian, and for a metric the velocity of the time-like coordinate on the mass shell.
    fn lagrangian_and_shell(
        &self,
        compiler: &mut Compiler,
        scope: &Scope,
        time_like: Option<usize>,
    ) -> Outcome<(Value, Option<Value>)> {
        match (&self.lagrangian, &self.metric) {
            (Some(text), None) => Ok((self.written(text, compiler, scope)?, None)),
            (None, Some(entries)) => {
                let n = self.coordinates.len();
                let metric = self.metric_entries(entries, compiler, scope)?;
                let shell = time_like.filter(|i| self.coordinates[*i].velocity_bounds.is_none());
                let shell = shell.map(|i| on_shell(compiler, &metric, i, n));
                Ok((kinetic(compiler, &metric, n), shell))
            }
            (Some(_), Some(_)) => {
                Err(DescriptionError::new("metric", "expected `lagrangian` or `[metric]`, found both"))
            }
            (None, None) => {
                let problem =
                    "expected `lagrangian = \"..\"`, or a table `[metric]` of its coefficients, found neither";
                Err(DescriptionError::new("", problem))
            }
        }
    }

    /// Returns the given unit of time; by default seconds, or none for proper time.
    fn unit_of_time(&self, is_proper: bool) -> Cow<'static, str> {
        match &self.time_unit {
            Some(unit) => Cow::Owned(unit.clone()),
            None => Cow::Borrowed(if is_proper { "1" } else { "s" }),
        }
    }

    /// Returns the index of the time-like coordinate.
    fn time_like(&self) -> Outcome<Option<usize>> {
        let mut times = self.coordinates.iter().enumerate().filter(|(_, c)| c.time_like).map(|(i, _)| i);
        let (first, second) = (times.next(), times.next());
        match second {
            Some(i) => {
                Err(DescriptionError::new(format!("coordinates[{i}].time_like"), "there is a time-like one before"))
            }
            None => Ok(first),
        }
    }

    fn checked_parameters(&self) -> Outcome<Vec<Parameter>> {
        let parameter = |(name, p): (&String, &super::ParameterDescription)| {
            let text = p.default.0.trim();
            let zero = Dd::of_f64(0.0);
            let allowed = |x: &Dd| {
                x.is_finite()
                    && match p.range {
                        Range::Any => true,
                        Range::AtLeastZero => *x >= zero,
                        Range::Positive => *x > zero,
                    }
            };
            if Dd::parse(text).filter(allowed).is_none() {
                let shown: String = text.chars().take(40).collect();
                let problem = format!("expected a decimal number, {}, found {shown:?}", p.range.text());
                return Err(DescriptionError::new(format!("parameters.{name}.default"), problem));
            }
            Ok(Parameter {
                symbol: Cow::Owned(name.clone()),
                default: Cow::Owned(text.to_string()),
                unit: Cow::Owned(p.unit.clone()),
                range: p.range,
                learn: p.learn,
            })
        };
        self.parameters.iter().map(parameter).collect()
    }
}

fn coordinate(described: &super::CoordinateDescription) -> Coordinate {
    Coordinate {
        name: Cow::Owned(described.name.clone()),
        unit: Cow::Owned(described.unit.clone()),
        periodic: described.periodic,
    }
}
