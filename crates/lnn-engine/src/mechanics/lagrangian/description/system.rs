//! Converts a description to a system: checks every name and formula, and compiles the Lagrangian.

use super::{Described, Description, DescriptionError, Quantity};
use crate::lagrangian::constraints::ExpressionConstraints;
use crate::lagrangian::expression::{Compiler, Expression, Meaning, Value, is_name, is_reserved};
use crate::lagrangian::formula_forces::FormulaForces;
use crate::lagrangian::system::{
    Bounds, Coordinate, LearningAdvice, Parameter, PerSize, Range, ShellAdvice, Size, System, TrajectoryTest,
};
use crate::lagrangian::thresholds::{MOST_COORDINATES, MOST_NAMES, SHOWN_NAMES};
use crate::lagrangian::{ExpressionLagrangian, constrained_description};
use crate::names::{taken_column, unknown};
use crate::ops::{Binary, Unary};
use crate::scalar::{Dd, Scalar};
use alloc::borrow::Cow;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::f64::consts::PI;

/// Number of constants of a link and its joint.
const CONSTANTS: usize = 13;

/// Name of the time in formulas.
const TIME: &str = "t";

type Outcome<T> = Result<T, DescriptionError>;

/// The condition of the mass shell in words.
const SHELL: &str = "from the mass shell g(v, v) = -1, to the future";

/// Rejects names that cannot be used in formulas.
fn check_name(key: String, name: &str) -> Outcome<()> {
    if !is_name(name) {
        let problem =
            format!("{name:?} is not a valid name: expected a letter or _, then letters, digits and _, 64 at most");
        return Err(DescriptionError::new(key, problem));
    }
    match is_reserved(name) {
        true => Err(DescriptionError::new(key, format!("`{name}` is a function or constant of formulas"))),
        false => Ok(()),
    }
}

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
        scope: &BTreeMap<String, Meaning>,
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

    /// Checks that displayed names and units are short and on one line.
    fn check_texts(&self) -> Outcome<()> {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        let name = &self.name;
        if name.is_empty() || name.len() > 64 || !name.chars().all(plain) || name.starts_with('-') {
            let problem = "expected a name of 1 to 64 letters, digits, `-` and `_`";
            return Err(DescriptionError::new("name", problem));
        }
        let inputs = self.inputs.iter().map(|(name, unit)| (format!("inputs.{name}"), unit));
        let measured = self.measured.iter().map(|(name, own)| (format!("measured.{name}.unit"), &own.unit));
        let units = self.coordinates.iter().enumerate().map(|(i, c)| (format!("coordinates[{i}].unit"), &c.unit));
        let parameters = self.parameters.iter().map(|(name, p)| (format!("parameters.{name}.unit"), &p.unit));
        let texts = self.title.iter().map(|title| ("title".to_string(), title));
        let texts = texts
            .chain(self.time_unit.iter().map(|unit| ("time_unit".to_string(), unit)))
            .chain(units)
            .chain(inputs)
            .chain(measured)
            .chain(parameters);
        for (key, text) in texts {
            if text.is_empty() || text.chars().count() > 100 || text.chars().any(char::is_control) {
                return Err(DescriptionError::new(key, "expected 1 to 100 characters on one line"));
            }
        }
        Ok(())
    }

    /// Checks the number of entries; the expanded constants of links are not counted.
    fn check_counts(&self, plain: &Self) -> Outcome<()> {
        let n = plain.coordinates.len();
        let of_links = self.links.len() * CONSTANTS;
        if n == 0 || n > MOST_COORDINATES {
            let problem = format!("expected 1 to {MOST_COORDINATES} tables [[coordinates]], found {n}");
            return Err(DescriptionError::new("coordinates", problem));
        }
        let counts = [
            ("parameters", self.parameters.len(), MOST_NAMES + of_links),
            ("definitions", self.definitions.len(), MOST_NAMES),
            ("inputs", self.inputs.len(), MOST_NAMES),
            ("constraints", self.constraints.len(), MOST_NAMES),
            ("events", self.events.len(), MOST_NAMES),
            ("measured", self.measured.len(), MOST_NAMES),
        ];
        for (key, count, most) in counts {
            if count > most {
                return Err(DescriptionError::new(key, format!("expected at most {most} names, found {count}")));
            }
        }
        Ok(())
    }

    /// Returns the meaning of the names of coordinates, velocities, parameters and the time `t`, unless something else has that name; also
    /// whether the equations of motion depend on the time.
    fn scope(&self) -> Outcome<(BTreeMap<String, Meaning>, bool)> {
        let mut scope = BTreeMap::new();
        let mut add = |key: String, name: &str, meaning: Meaning| {
            check_name(key.clone(), name)?;
            match scope.insert(name.to_string(), meaning) {
                Some(_) => Err(DescriptionError::new(key, format!("the name `{name}` is taken"))),
                None => Ok(()),
            }
        };
        let names: Vec<&str> = self.coordinates.iter().map(|coordinate| coordinate.name.as_str()).collect();
        if let Some((i, problem)) = taken_column(&names) {
            return Err(DescriptionError::new(format!("coordinates[{i}].name"), problem));
        }
        for (i, coordinate) in self.coordinates.iter().enumerate() {
            let key = || format!("coordinates[{i}].name");
            add(key(), &coordinate.name, Meaning::Position(i))?;
            add(key(), &format!("{}_dot", coordinate.name), Meaning::Velocity(i))?;
        }
        for (i, name) in self.parameters.keys().enumerate() {
            add(format!("parameters.{name}"), name, Meaning::Parameter(i))?;
        }
        let timed = self.is_timed();
        if !self.time_is_taken() {
            add("lagrangian".to_string(), TIME, Meaning::Position(self.coordinates.len()))?;
        }
        for (k, name) in self.inputs.keys().enumerate().filter(|(_, name)| self.marks.contains(*name)) {
            add(format!("inputs.{name}"), name, Meaning::Position(self.coordinates.len() + 1 + k))?;
        }
        // Reserve these names, although they have no meaning yet.
        for name in self.definitions.keys() {
            add(format!("definitions.{name}"), name, Meaning::Parameter(usize::MAX))?;
        }
        scope.retain(|name, _| !self.definitions.contains_key(name));
        Ok((scope, timed))
    }

    /// Compiles the definitions in order of dependence.
    fn define(&self, compiler: &mut Compiler, scope: &mut BTreeMap<String, Meaning>) -> Outcome<()> {
        let key = |name: &str| format!("definitions.{name}");
        let mut waiting: Vec<Waiting<'_>> = Vec::with_capacity(self.definitions.len());
        for (name, text) in &self.definitions {
            let expression: Expression = text.parse().map_err(DescriptionError::formula(key(name)))?;
            let needs = expression.names().filter_map(|used| Some(self.definitions.get_key_value(used)?.0.as_str()));
            waiting.push(Waiting { name, needs: needs.collect(), expression });
        }
        while !waiting.is_empty() {
            let before = waiting.len();
            let mut still = Vec::new();
            for definition in waiting {
                if definition.needs.iter().any(|used| !scope.contains_key(*used)) {
                    still.push(definition);
                    continue;
                }
                let Waiting { name, expression, .. } = definition;
                let value = compiler.add(&expression, scope, false).map_err(DescriptionError::formula(key(name)))?;
                scope.insert(name.to_string(), Meaning::Value(value));
            }
            if still.len() == before {
                let (name, circle) = circle(&still);
                return Err(DescriptionError::new(key(&name), format!("it depends on itself: {circle}")));
            }
            waiting = still;
        }
        Ok(())
    }

    /// Compiles the Lagrangian of the file.
    fn written(&self, text: &str, compiler: &mut Compiler, scope: &BTreeMap<String, Meaning>) -> Outcome<Value> {
        let expression: Expression = text.parse().map_err(DescriptionError::formula("lagrangian"))?;
        let value = compiler.add(&expression, scope, false).map_err(DescriptionError::formula("lagrangian"))?;
        let velocities = compiler.velocities(value);
        // Coordinates that follow from constraints need no inertia.
        for (i, coordinate) in self.coordinates.iter().enumerate().filter(|_| self.constraints.is_empty()) {
            if !velocities.contains(&i) {
                let name = &coordinate.name;
                let problem = format!(
                    "expected {name}_dot in it: without a kinetic energy {name} has no acceleration; motion of first \
                     order, as of tanks and circuits, has no Lagrangian here"
                );
                return Err(DescriptionError::new("lagrangian", problem));
            }
        }
        Ok(value)
    }

    /// Compiles the dissipation function, which must depend on a velocity to have an effect.
    fn friction(&self, compiler: &mut Compiler, scope: &BTreeMap<String, Meaning>) -> Outcome<Option<Value>> {
        let Some(text) = &self.dissipation else { return Ok(None) };
        let expression: Expression = text.parse().map_err(DescriptionError::formula("dissipation"))?;
        let value = compiler.add(&expression, scope, false).map_err(DescriptionError::formula("dissipation"))?;
        if compiler.velocities(value).is_empty() {
            return Err(DescriptionError::new("dissipation", "expected a velocity in it, such as theta_dot"));
        }
        Ok(Some(value))
    }

    /// Compiles the generalized forces as functions of the coordinates and parameters.
    fn forces(
        &self,
        compiler: &mut Compiler,
        scope: &BTreeMap<String, Meaning>,
        size: (usize, usize),
    ) -> Outcome<Option<FormulaForces>> {
        let mut formulas = Vec::new();
        let scope = &self.with_inputs(scope)?;
        for (name, text) in &self.forces {
            let key = format!("forces.{name}");
            let names = || self.coordinates.iter().map(|c| c.name.as_str());
            let place = names().position(|known| known == name);
            let place = place
                .ok_or_else(|| DescriptionError::new(&key, unknown("coordinate", name, names().collect::<Vec<_>>())))?;
            let expression: Expression = text.parse().map_err(DescriptionError::formula(&key))?;
            let value = compiler.add(&expression, scope, false).map_err(DescriptionError::formula(&key))?;
            formulas.push((place, compiler.formula(value)));
        }
        Ok((!formulas.is_empty()).then(|| FormulaForces::compiled(size, formulas)))
    }

    /// Extends the names by inputs, for formulas of forces.
    pub(super) fn with_inputs(&self, scope: &BTreeMap<String, Meaning>) -> Outcome<BTreeMap<String, Meaning>> {
        let mut scope = scope.clone();
        for (k, name) in self.inputs.keys().enumerate().filter(|(_, name)| !self.marks.contains(*name)) {
            let key = || format!("inputs.{name}");
            check_name(key(), name)?;
            if name == TIME || scope.insert(name.clone(), Meaning::Position(self.coordinates.len() + 1 + k)).is_some() {
                return Err(DescriptionError::new(key(), format!("the name `{name}` is taken")));
            }
            let is_used = |text: &String| {
                text.parse::<Expression>().is_ok_and(|formula| formula.names().any(|used| used == name))
            };
            if !self.forces.values().any(is_used) {
                return Err(DescriptionError::new(key(), "expected it in a formula of [forces]"));
            }
        }
        Ok(scope)
    }

    /// Returns `true` if there are inputs, or if the Lagrangian, the dissipation function or forces depend on the time `t`. Nothing else
    /// may then be called `t`.
    fn is_timed(&self) -> bool {
        let metric = self.metric.iter().flat_map(|entries| entries.values());
        let mut texts = self.lagrangian.iter().chain(&self.dissipation).chain(self.forces.values()).chain(metric);
        !self.inputs.is_empty() || !self.time_is_taken() && texts.any(|text| self.names_time(text))
    }

    /// Returns `true` if something else is called `t`.
    fn time_is_taken(&self) -> bool {
        let names = self.coordinates.iter().map(|coordinate| &coordinate.name);
        names.chain(self.parameters.keys()).chain(self.definitions.keys()).any(|name| name == TIME)
    }

    /// Returns `true` if a formula, or a definition that it uses, contains `t`.
    fn names_time(&self, text: &str) -> bool {
        let (mut texts, mut seen) = (vec![text], BTreeSet::new());
        while let Some(text) = texts.pop() {
            // Errors in it are reported when it is compiled.
            let Ok(expression) = text.parse::<Expression>() else { continue };
            for name in expression.names() {
                if name == TIME {
                    return true;
                }
                if let Some((name, text)) = self.definitions.get_key_value(name)
                    && seen.insert(name.as_str())
                {
                    texts.push(text);
                }
            }
        }
        false
    }

    /// Compiles the constraints.
    fn constraints(
        &self,
        compiler: &mut Compiler,
        scope: &BTreeMap<String, Meaning>,
    ) -> Outcome<Option<ExpressionConstraints>> {
        if self.constraints.is_empty() {
            return Ok(None);
        }
        for name in self.constraints.keys() {
            if name.is_empty() || name.chars().count() > 100 || name.chars().any(char::is_control) {
                return Err(DescriptionError::new("constraints", "expected names of 1 to 100 characters on one line"));
            }
        }
        if !self.time_is_taken()
            && let Some((name, _)) = self.constraints.iter().find(|(_, text)| self.names_time(text))
        {
            let problem = "expected a formula without the time `t`: put what moves by a known law into the Lagrangian";
            return Err(DescriptionError::new(format!("constraints.{name}"), problem));
        }
        let size = (self.coordinates.len(), self.parameters.len());
        let formulas = self.constraints.iter().map(|(name, text)| (name.as_str(), text.as_str()));
        let line = |name: &str| self.constraint_lines.0.get(name).copied().unwrap_or(usize::MAX);
        let compiled = ExpressionConstraints::compiled(size, formulas, compiler, scope).map(|rows| rows.in_order(line));
        let place = |(name, error)| DescriptionError::new(format!("constraints.{name}"), error);
        compiled.map(Some).map_err(place)
    }

    /// Parses the entries `(i, j)`, `i <= j`, of the metric.
    fn metric_entries(
        &self,
        entries: &BTreeMap<String, String>,
        compiler: &mut Compiler,
        scope: &BTreeMap<String, Meaning>,
    ) -> Outcome<BTreeMap<(usize, usize), Value>> {
        let mut metric = BTreeMap::new();
        for (pair, text) in entries {
            let key = format!("metric.{pair}");
            let index = |name: &str| {
                let names = self.coordinates.iter().map(|c| c.name.as_str());
                let problem = || unknown("coordinate", name, names.clone().collect::<Vec<_>>());
                names.clone().position(|known| known == name).ok_or_else(|| DescriptionError::new(&key, problem()))
            };
            let Some((a, b)) = pair.split_once(',') else {
                let problem = "expected two coordinates with a comma between them, such as \"t,t\"";
                return Err(DescriptionError::new(key, problem));
            };
            let (i, j) = (index(a.trim())?, index(b.trim())?);
            let expression: Expression = text.parse().map_err(DescriptionError::formula(&key))?;
            let value = compiler.add(&expression, scope, true).map_err(DescriptionError::formula(&key))?;
            if metric.insert((i.min(j), i.max(j)), value).is_some() {
                return Err(DescriptionError::new(key, "this entry is given twice: the metric is symmetric"));
            }
        }
        for (i, coordinate) in self.coordinates.iter().enumerate() {
            if !metric.keys().any(|(a, b)| *a == i || *b == i) {
                let name = &coordinate.name;
                return Err(DescriptionError::new(
                    "metric",
                    format!("expected an entry of {name}, such as \"{name},{name}\""),
                ));
            }
        }
        Ok(metric)
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

    /// Returns the bounds of the coordinates; a velocity that follows from the mass shell has none.
    fn base_bounds(&self, fixed: Option<usize>) -> Outcome<Bounds> {
        let mut bounds = Bounds { positions: Vec::new(), velocities: Vec::new() };
        for (i, coordinate) in self.coordinates.iter().enumerate() {
            let missing =
                |what: &str| DescriptionError::new(format!("coordinates[{i}]"), format!("missing key \"{what}\""));
            bounds.positions.push(match &coordinate.bounds {
                Some(pair) => ordered(&format!("coordinates[{i}].bounds"), pair)?,
                None if coordinate.periodic => (0.0, 2.0 * PI),
                None => return Err(missing("bounds")),
            });
            bounds.velocities.push(match &coordinate.velocity_bounds {
                Some(pair) => ordered(&format!("coordinates[{i}].velocity_bounds"), pair)?,
                None if fixed == Some(i) => (0.0, 0.0),
                None => return Err(missing("velocity_bounds")),
            });
        }
        Ok(bounds)
    }

    /// Returns a box of states, with the columns in a table replaced.
    fn bounds(&self, table: &str, given: &BTreeMap<String, [Quantity; 2]>, base: Bounds) -> Outcome<Bounds> {
        let mut bounds = base;
        for (column, pair) in given {
            let key = format!("{table}.{column}");
            let pair = ordered(&key, pair)?;
            let names = self.coordinates.iter().map(|c| c.name.clone());
            let columns: Vec<String> = names.clone().chain(names.map(|name| format!("{name}_dot"))).collect();
            let n = self.coordinates.len();
            match columns.iter().position(|known| known == column) {
                Some(i) if i < n => bounds.positions[i] = pair,
                Some(i) => bounds.velocities[i - n] = pair,
                None => {
                    return Err(DescriptionError::new(key, unknown("key", column, columns.iter().map(String::as_str))));
                }
            }
        }
        Ok(bounds)
    }

    /// Returns the shell of the training states; `time` is the time-like coordinate of the mass shell.
    fn shell_advice(&self, time: Option<usize>) -> Outcome<Option<ShellAdvice>> {
        let Some(shell) = &self.shell else { return Ok(None) };
        if time.is_none() {
            let problem = "expected a metric with a time_like coordinate that has no velocity_bounds";
            return Err(DescriptionError::new("shell", problem));
        }
        let names = || self.coordinates.iter().map(|c| c.name.as_str());
        let mut coordinates = Vec::with_capacity(shell.coordinates.len());
        for name in &shell.coordinates {
            match names().position(|known| known == name) {
                Some(i) if Some(i) != time && !coordinates.contains(&i) => coordinates.push(i),
                Some(_) => {
                    let problem = format!("expected coordinates of space, each once, found {name:?}");
                    return Err(DescriptionError::new("shell.coordinates", problem));
                }
                None => return Err(DescriptionError::new("shell.coordinates", unknown("coordinate", name, names()))),
            }
        }
        if coordinates.is_empty() {
            return Err(DescriptionError::new("shell.coordinates", "expected one name at least"));
        }
        let radius = ordered("shell.radius", &shell.radius)?;
        let rapidity = shell.rapidity.map_or(1.0, |rapidity| rapidity.0);
        if radius.0 <= 0.0 {
            return Err(DescriptionError::new(
                "shell.radius",
                format!("expected distances above 0, found {}", radius.0),
            ));
        }
        if !(rapidity.is_finite() && rapidity >= 0.0) {
            let problem = format!("expected a finite number, at least 0, found {rapidity}");
            return Err(DescriptionError::new("shell.rapidity", problem));
        }
        Ok(Some(ShellAdvice { coordinates: coordinates.into(), radius, rapidity }))
    }

    fn trajectory_test(&self, validation: &Bounds) -> Outcome<TrajectoryTest> {
        let positive = |key: &str, value: Option<Quantity>, usual: f64| match value {
            Some(Quantity(x)) if !(x.is_finite() && x > 0.0) => {
                Err(DescriptionError::new(key, format!("expected a finite number above 0, found {x}")))
            }
            other => Ok(other.map_or(usual, |x| x.0)),
        };
        let t_end = positive("trajectory.t_end", self.trajectory.t_end, 10.0)?;
        let dt = positive("trajectory.dt", self.trajectory.dt, t_end / 100.0)?;
        if t_end / dt > 1e6 {
            return Err(DescriptionError::new(
                "trajectory.dt",
                format!("expected at least a millionth of t_end = {t_end}"),
            ));
        }
        // A trajectory may start at any angle.
        let half = |&(low, high): &(f64, f64)| (0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high);
        let middle = Bounds {
            positions: validation
                .positions
                .iter()
                .zip(&self.coordinates)
                .map(|(b, c)| if c.periodic { *b } else { half(b) })
                .collect(),
            velocities: validation.velocities.iter().map(half).collect(),
        };
        let start = self.bounds("trajectory.start", &self.trajectory.start, middle)?;
        Ok(TrajectoryTest { start, t_end, dt })
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

/// Returns `true` if a name is valid for a coordinate and not reserved.
pub fn is_free_name(name: &str) -> bool {
    is_name(name) && !is_reserved(name)
}

fn coordinate(described: &super::CoordinateDescription) -> Coordinate {
    Coordinate {
        name: Cow::Owned(described.name.clone()),
        unit: Cow::Owned(described.unit.clone()),
        periodic: described.periodic,
    }
}

/// Checks that bounds are finite and in increasing order.
fn ordered(key: &str, &[Quantity(low), Quantity(high)]: &[Quantity; 2]) -> Outcome<(f64, f64)> {
    if low.is_finite() && high.is_finite() && low < high && (high - low).is_finite() {
        return Ok((low, high));
    }
    Err(DescriptionError::new(key, format!("expected [low, high], finite and in this order, found [{low}, {high}]")))
}

/// A definition that is not compiled yet.
struct Waiting<'a> {
    name: &'a str,
    /// Definitions that its formula uses.
    needs: BTreeSet<&'a str>,
    expression: Expression,
}

/// Finds definitions that depend on each other; returns the first of them and the cycle in words.
fn circle(waiting: &[Waiting<'_>]) -> (String, String) {
    let next = |name: &str| {
        let found = waiting.iter().find(|known| known.name == name)?;
        found.needs.iter().copied().find(|used| waiting.iter().any(|known| known.name == *used))
    };
    let mut way: Vec<&str> = waiting.first().map(|first| first.name).into_iter().collect();
    while let Some(name) = way.last().and_then(|name| next(name)) {
        if let Some(first) = way.iter().position(|known| *known == name) {
            way.drain(..first);
            way.push(name);
            break;
        }
        way.push(name);
    }
    let name = way.first().map(|name| name.to_string()).unwrap_or_default();
    let text = match way.len() {
        length if length > SHOWN_NAMES => format!("{} -> ..", way[..SHOWN_NAMES].join(" -> ")),
        _ => way.join(" -> "),
    };
    (name, text)
}

type Metric = BTreeMap<(usize, usize), Value>;

/// Computes `g_ij v_i v_j / 2`.
fn kinetic(compiler: &mut Compiler, metric: &Metric, n: usize) -> Value {
    let speeds: Vec<Value> = (0..n).map(|i| compiler.meaning(Meaning::Velocity(i))).collect();
    let half = compiler.constant(0.5);
    sum(compiler, metric.iter().map(|(&(i, j), &g)| (g, i, j)), |compiler, (g, i, j)| {
        let square = compiler.binary(Binary::Mul, speeds[i], speeds[j]);
        let term = compiler.binary(Binary::Mul, g, square);
        if i == j { compiler.binary(Binary::Mul, half, term) } else { term }
    })
}

/// Computes `v_t` with `g(v, v) = -1`: the root of `g_tt v_t^2 + 2 b v_t + c + 1 = 0` that points to the future, `-(b + sqrt(b^2 - g_tt (c
/// + 1))) / g_tt`, where `g_tt < 0`.
fn on_shell(compiler: &mut Compiler, metric: &Metric, t: usize, n: usize) -> Value {
    let speeds: Vec<Value> = (0..n).map(|i| compiler.meaning(Meaning::Velocity(i))).collect();
    let entries = || metric.iter().map(|(&(i, j), &g)| (g, i, j));
    let own = metric.get(&(t, t)).copied().unwrap_or_else(|| compiler.constant(0.0));
    let mixed = entries().filter(|(_, i, j)| (*i == t) != (*j == t));
    let b =
        sum(compiler, mixed, |compiler, (g, i, j)| compiler.binary(Binary::Mul, g, speeds[if i == t { j } else { i }]));
    let two = compiler.constant(2.0);
    let space = entries().filter(|(_, i, j)| *i != t && *j != t);
    let c = sum(compiler, space, |compiler, (g, i, j)| {
        let square = compiler.binary(Binary::Mul, speeds[i], speeds[j]);
        let term = compiler.binary(Binary::Mul, g, square);
        if i == j { term } else { compiler.binary(Binary::Mul, two, term) }
    });
    let one = compiler.constant(1.0);
    let shell = compiler.binary(Binary::Add, c, one);
    let product = compiler.binary(Binary::Mul, own, shell);
    let square = compiler.binary(Binary::Mul, b, b);
    let inside = compiler.binary(Binary::Sub, square, product);
    let root = compiler.unary(Unary::Sqrt, inside);
    let top = compiler.binary(Binary::Add, b, root);
    let quotient = compiler.binary(Binary::Div, top, own);
    compiler.unary(Unary::Neg, quotient)
}

/// Sums the terms; 0 without terms.
fn sum<T>(
    compiler: &mut Compiler,
    parts: impl Iterator<Item = T>,
    mut term: impl FnMut(&mut Compiler, T) -> Value,
) -> Value {
    let mut total = None;
    for part in parts {
        let value = term(compiler, part);
        total = Some(match total {
            Some(total) => compiler.binary(Binary::Add, total, value),
            None => value,
        });
    }
    total.unwrap_or_else(|| compiler.constant(0.0))
}
