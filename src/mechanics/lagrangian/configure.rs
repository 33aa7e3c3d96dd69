//! Systems with the values of their parameters, as text or as numbers.

use super::EulerLagrange;
use super::catalogue::{Given, SystemError, SystemInstance, resolve};
use super::system::Range;
use super::system::{Size, System};
use crate::scalar::Scalar;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Reads the parameters of a system in the working precision; those not given take their defaults.
///
/// # Errors
/// [`SystemError`] for an unknown name or symbol, a repeated symbol, a value that is no number or out of range.
pub fn configure<S: Scalar>(name: &str, given: &Given) -> Result<SystemInstance<S>, SystemError> {
    configure_system(resolve(name)?, given)
}

/// [`configure`] for a given system: one of the catalogue, or one made from a [description](super::Description).
///
/// # Errors
/// [`SystemError`] for an unknown or repeated symbol, a value that is no number or out of range.
pub fn configure_system<S: Scalar>(
    system: Cow<'static, System>,
    given: &Given,
) -> Result<SystemInstance<S>, SystemError> {
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

/// As [`configure_system`], of values that are numbers already.
///
/// # Errors
/// [`SystemError`] for an unknown symbol or a value out of range.
pub fn configure_values<S: Scalar>(
    system: Cow<'static, System>,
    values: &BTreeMap<String, f64>,
) -> Result<SystemInstance<S>, SystemError> {
    values.keys().try_for_each(|symbol| require_symbol(&system, symbol))?;
    let whole = |x: f64| (x >= 0.0 && x.fract() == 0.0).then_some(x as usize);
    assemble(
        system,
        |symbol| values.get(symbol).map(|&x| (whole(x), x.to_string())),
        |symbol| values.get(symbol).map(|&x| (Some(S::of_f64(x)), x.to_string())),
    )
}

/// The Euler-Lagrange terms of a system with the given parameters.
///
/// # Errors
/// As [`configure`].
pub fn build<S: Scalar>(name: &str, given: &Given) -> Result<Box<dyn EulerLagrange<S>>, SystemError> {
    configure(name, given)?.build()
}

/// Refuses a symbol that the system does not have.
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

/// A system of the size and the values that are found by symbol, each with its text; those not found take their defaults.
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
        Size::Chosen { symbol, default, least, most } => match size(symbol) {
            None => default,
            Some((found, text)) => found
                .filter(|n| (least..=most).contains(n))
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
    use crate::lagrangian::find;

    #[test]
    fn numbers_and_their_texts_configure_the_same() {
        let system = || Cow::Borrowed(find("n-pendulum").unwrap());
        let text =
            |n: &str, g: &str| configure_system::<f64>(system(), &[("n".into(), n.into()), ("g".into(), g.into())]);
        let number = |n: f64, g: f64| configure_values::<f64>(system(), &[("n".into(), n), ("g".into(), g)].into());
        let (a, b) = (text("3", "0.1").unwrap(), number(3.0, 0.1).unwrap());
        assert_eq!((a.coordinates, &a.parameters), (b.coordinates, &b.parameters));
        for (n, g) in [(2.5, 9.81), (-1.0, 9.81), (1e9, 9.81), (2.0, f64::NAN)] {
            assert_eq!(text(&n.to_string(), &g.to_string()).unwrap_err(), number(n, g).unwrap_err());
        }
        let other = configure_values::<f64>(system(), &[("mass".to_string(), 1.0)].into());
        assert!(matches!(other, Err(SystemError::UnknownParameter { .. })));
    }
}
