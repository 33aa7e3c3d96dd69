//! Grey boxes: a known Lagrangian, perhaps with constants to be learned, beside the network.
//!
//! A learned constant with a positive default `p0` of an allowed range that is not negative is `p0 e^theta`, any other one
//! `p0 + theta`; `theta` is the parameter, 0 at the start.

use crate::lagrangian::system::{Parameter, Range, System};
use crate::lagrangian::{Description, Lagrangian};
use crate::network::{Architecture, Layout};
use crate::scalar::{Real, Scalar};
use std::collections::BTreeMap;

/// The system that a known part describes.
pub(super) fn system(description: &Description, n: usize) -> Result<System, String> {
    let system = description.system().map_err(|error| error.to_string())?;
    if description.dissipation.is_some() {
        return Err(
            "dissipation: a grey box knows a Lagrangian alone; leave the key out, and learn friction beside it".into(),
        );
    }
    match description.coordinates.len() {
        found if found == n => Ok(system),
        found => Err(format!("expected {n} coordinates, found {found}")),
    }
}

/// A constant at its parameter.
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
    /// Values of all constants of the known part, in the order of their names, with the flat parameters of the model; empty
    /// without a known part, or with one that describes no system.
    pub(crate) fn known_parameters<R: Real>(&self, parameters: &[R]) -> Vec<R> {
        let described = self.form.known.as_ref().and_then(|known| system(known, self.coordinates).ok());
        described.map_or_else(Vec::new, |system| self.constants(&system, parameters))
    }

    /// The same by name, in double precision.
    pub(crate) fn known_constants<S: Scalar>(&self, parameters: &[S]) -> BTreeMap<String, f64> {
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

    /// The known part of `L`, 0 if there is none.
    pub(super) fn known_lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let Some(known) = &self.form.known else { return R::zero() };
        let described = system(known, self.coordinates).ok();
        let Some((system, described)) = described.and_then(|s| s.described.clone().map(|d| (s, d))) else {
            return R::constant(R::Scalar::nan());
        };
        described.lagrangian.lagrangian(&self.constants(&system, parameters), q, v)
    }
}
