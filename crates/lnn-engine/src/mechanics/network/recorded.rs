//! The Lagrangian of a network and its dissipation over [`Real`], evaluated directly with floats and forward-mode numbers, or recorded as
//! blocks on the tape; its input features; a known Lagrangian that is added to the network.
//!
//! Every coordinate contributes one input feature `q_i/s_i`, or for an embedded angle two, `sin q_i` and `cos q_i`; every velocity
//! contributes `v_i/s_i`. Cyclic coordinates contribute none. Those of a [`Radial`] group come last, with two features each.
//!
//! A known Lagrangian may have learned constants. A learned constant with a positive default `p0` and a nonnegative allowed range is `p0
//! e^theta`, any other one `p0 + theta`, where the parameter `theta` is initially 0.

use crate::lagrangian::system::{Parameter, Range, System};
use crate::lagrangian::{Description, Lagrangian};
use crate::network::structure::LagrangianInputs;
use crate::network::{Architecture, Layer, Layout, LinearMap, Radial};
use crate::scalar::{Real, Scalar};
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

impl Lagrangian for Architecture {
    fn coordinates(&self) -> usize {
        self.coordinates
    }

    /// Computes `L` of a state in physical units; `parameters` are the flat weights. Angles are not wrapped.
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let layout = Layout::new(self);
        let (positions, velocities) = (self.position_features_of(q), self.scaled_velocities(v));
        let outputs = |features: &[R]| {
            let mut branches = layout
                .branches
                .iter()
                .map(|branch| branch.layers.iter().fold(features.to_vec(), |h, layer| evaluate(layer, parameters, &h)));
            let first = branches.next().unwrap_or_default();
            branches.fold(first, |sum, more| sum.iter().zip(&more).map(|(&a, &b)| a + b).collect())
        };
        let state = LagrangianInputs {
            positions: &positions,
            velocities: &velocities,
            constants: &parameters[layout.constants.clone()],
            alpha: self.alpha,
            time_like: self.time_like,
        };
        let learned = self.form.lagrangian(outputs, state);
        let known = self.known_part(parameters, q, v, false);
        known.map_or(learned, |known| learned + known)
    }
}

impl Architecture {
    /// Computes the Rayleigh dissipation `D = sum_k softplus(gamma_k + w_k.f(q)) ln cosh(b_k.(v/s))` of a state in physical units, plus the
    /// [joint friction](super::JointFriction) and the friction of the known part; 0 without friction. Friction is the generalized force
    /// `-dD/dv`.
    ///
    /// `f(q)` are the input features computed from coordinates, and `parameters` the flat weights. The unit of `D` is that of `L` per unit
    /// of time. Angles are not wrapped.
    pub fn rayleigh_dissipation<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let layout = Layout::new(self);
        let (positions, velocities) = (self.position_features_of(q), self.scaled_velocities(v));
        let joints = &parameters[layout.joint_friction.clone()];
        let sizes = self.form.sizes.as_ref();
        let size = |i: usize| sizes.map_or(1.0, |sizes| sizes.friction[i]);
        let joint = (!joints.is_empty()).then(|| self.form.joint_friction.dissipation(joints, &velocities, size));
        let known = self.known_part(parameters, q, v, true);
        let [joint, known] = [joint, known].map(|part| part.unwrap_or(R::zero()));
        let Some(dissipation) = layout.dissipation else { return joint + known };
        let gamma = &parameters[dissipation.gamma_range()];
        let strength = R::affine(&parameters[dissipation.weight_range()], gamma, &positions);
        let along = R::affine(&parameters[dissipation.direction_range()], &[], &velocities);
        let (strength, along) = (strength.into_iter().map(R::softplus), along.into_iter().map(R::ln_cosh));
        let (strength, along): (Vec<R>, Vec<R>) = (strength.collect(), along.collect());
        strength.into_iter().zip(along).fold(joint + known, |sum, (strength, along)| sum + strength * along)
    }
}

/// Computes `act(W x + b)`.
fn evaluate<R: Real>(layer: &Layer, parameters: &[R], x: &[R]) -> Vec<R> {
    let (weights, bias) = (&parameters[layer.weight_range()], &parameters[layer.bias_range()]);
    let mut z: Vec<R> = match layer.map {
        LinearMap::Dense => R::affine(weights, bias, x),
        LinearMap::Diagonal => weights.iter().zip(x).map(|(&gamma, &x)| gamma * x).collect(),
        LinearMap::Scalar => x.iter().map(|&x| weights[0] * x).collect(),
    };
    if layer.map != LinearMap::Dense {
        z.iter_mut().zip(bias).for_each(|(z, &b)| *z += b);
    }
    z.into_iter().map(|z| layer.activation.apply(z)).collect()
}

impl Architecture {
    /// Returns the number of input features from coordinates: two per embedded angle and radial coordinate, one per other coordinate, none
    /// for cyclic ones.
    pub(crate) fn position_features(&self) -> usize {
        let seen = (0..self.coordinates).filter(|i| !self.form.cyclic.contains(i));
        seen.map(|i| if self.embeds(i) || self.form.is_radial(i) { 2 } else { 1 }).sum()
    }

    /// Returns `true` if the inputs contain the sine and cosine of coordinate `i`.
    pub fn embeds(&self, i: usize) -> bool {
        self.embed_periodic && self.periodic[i]
    }

    /// Computes the input features from the coordinates `q`, of length `n` in physical units.
    fn position_features_of<R: Real>(&self, q: &[R]) -> Vec<R> {
        let mut features = Vec::with_capacity(self.position_features() + self.coordinates);
        let single = |i: usize| !self.form.cyclic.contains(&i) && !self.form.is_radial(i);
        for (i, &q) in q.iter().enumerate().filter(|(i, _)| single(*i)) {
            if self.embeds(i) {
                let (sin, cos) = q.sin_cos();
                features.extend([sin, cos]);
            } else {
                features.push(q / R::of(self.scale[i]));
            }
        }
        self.form.radial.iter().for_each(|group| group.add_features(q, &mut features));
        features
    }

    /// Computes `v_i/s_i`.
    fn scaled_velocities<R: Real>(&self, v: &[R]) -> Vec<R> {
        v.iter().zip(&self.scale).map(|(&v, &s)| v / R::of(s)).collect()
    }
}

impl Radial {
    /// Adds `(x_i/R) ln(R/u)` and `u x_i/R^2` for every coordinate of the group.
    fn add_features<R: Real>(&self, q: &[R], features: &mut Vec<R>) {
        let unit = R::of(self.unit);
        let square = self.coordinates.iter().fold(R::zero(), |sum, &i| sum + q[i].sqr());
        let near = unit / square.sqrt();
        let far = -near.ln();
        for &i in &self.coordinates {
            let direction = q[i] / unit * near;
            features.extend([direction * far, direction * near]);
        }
    }
}

/// Builds the system that a known part describes.
pub(super) fn system(description: &Description, n: usize) -> Result<System, String> {
    let system = description.system().map_err(|error| error.to_string())?;
    if !description.forces.is_empty() || system.described.as_ref().is_some_and(|described| described.is_timed()) {
        let problem = "expected a system without `[forces]` and without the time `t`; `lnn identify` finds the constants of such a system";
        return Err(problem.to_string());
    }
    match description.coordinates.len() {
        found if found == n => Ok(system),
        found => Err(format!("expected {n} coordinates, found {found}")),
    }
}

/// Returns the value of a constant, given its learned parameter.
fn value<R: Real>(parameter: &Parameter, theta: Option<R>) -> R {
    let default = R::Scalar::parse(&parameter.default).unwrap_or(R::Scalar::nan());
    let positive = parameter.range != Range::Any && default > R::Scalar::of_f64(0.0);
    match theta {
        None => R::constant(default),
        Some(theta) if positive => R::constant(default) * theta.exp(),
        Some(theta) => R::constant(default) + theta,
    }
}

impl Architecture {
    /// Returns the values of all constants of the known part, sorted by name, given the flat parameters of the model; empty without a known
    /// part, or if its description is invalid.
    fn known_parameters<R: Real>(&self, parameters: &[R]) -> Vec<R> {
        let described = self.form.known.as_ref().and_then(|known| system(known, self.coordinates).ok());
        described.map_or_else(Vec::new, |system| self.constants(&system, parameters))
    }

    /// Returns these values by name, in double precision.
    pub fn known_constants<S: Scalar>(&self, parameters: &[S]) -> BTreeMap<String, f64> {
        let names = self.form.known.iter().flat_map(|known| known.parameters.keys().cloned());
        names.zip(self.known_parameters(parameters).into_iter().map(Scalar::to_f64)).collect()
    }

    fn constants<R: Real>(&self, system: &System, parameters: &[R]) -> Vec<R> {
        let mut next = Layout::new(self).known;
        let own = |parameter: &Parameter| {
            value(parameter, parameter.learn.then(|| next.next().map(|k| parameters[k])).flatten())
        };
        system.parameters.iter().map(own).collect()
    }

    /// Computes the known part of `L`, or with `friction` that of the dissipation function; `None` if there is none.
    fn known_part<R: Real>(&self, parameters: &[R], q: &[R], v: &[R], friction: bool) -> Option<R> {
        let known = self.form.known.as_ref()?;
        let described = system(known, self.coordinates).ok();
        let Some((system, described)) = described.and_then(|s| s.described.clone().map(|d| (s, d))) else {
            return Some(R::constant(R::Scalar::nan()));
        };
        let formula = if friction { described.dissipation.as_ref()? } else { &described.lagrangian };
        Some(formula.lagrangian(&self.constants(&system, parameters), q, v))
    }
}
