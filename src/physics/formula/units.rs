//! Units of constants, from those of their terms.

use super::function::Function;
use super::library::{Kind, Library};
use std::collections::BTreeMap;

/// A product of powers of units; plane angles have none.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Dimension(BTreeMap<String, f64>);

impl Dimension {
    /// The dimension of a unit such as `kg*m^2/s`.
    pub fn of(text: &str) -> Self {
        let mut dimension = Self::default();
        let mut sign = 1.0;
        for (k, part) in text.split('/').enumerate() {
            if k > 0 {
                sign = -1.0;
            }
            for factor in part.split(['*', ' ']).map(str::trim).filter(|f| !["", "1", "rad"].contains(f)) {
                let power = factor.split_once('^').and_then(|(base, power)| Some((base, power.parse::<f64>().ok()?)));
                let (base, power) = power.unwrap_or((factor, 1.0));
                dimension = dimension.times(&Self(BTreeMap::from([(base.to_string(), sign * power)])), 1.0);
            }
        }
        dimension
    }

    /// Product with a power of another one.
    fn times(&self, other: &Self, power: f64) -> Self {
        let mut product = self.0.clone();
        for (base, exponent) in &other.0 {
            *product.entry(base.clone()).or_default() += power * exponent;
        }
        product.retain(|_, exponent| *exponent != 0.0);
        Self(product)
    }

    /// `kg*m^2/s^2`, `1` for a number.
    pub fn written(&self) -> String {
        let one = |(base, exponent): (&String, f64)| match exponent {
            1.0 => base.clone(),
            exponent => format!("{base}^{exponent}"),
        };
        let up = self.0.iter().filter(|(_, e)| **e > 0.0).map(|(base, e)| one((base, *e))).collect::<Vec<_>>();
        let down = self.0.iter().filter(|(_, e)| **e < 0.0).map(|(base, e)| one((base, -e)));
        let top = if up.is_empty() { "1".to_string() } else { up.join("*") };
        down.fold(top, |text, below| format!("{text}/{below}"))
    }
}

/// Units of the coordinates and of time.
pub(super) struct Units {
    coordinates: Vec<Dimension>,
    time: Dimension,
}

/// Default unit of coordinates that are not angles.
const UNKNOWN: &str = "[q]";

impl Units {
    /// Parses units. Coordinates without a unit are angles, or share one unknown unit.
    pub fn new(texts: &[String], time: &str, periodic: &[bool]) -> Self {
        let of = |(i, periodic): (usize, &bool)| match texts.get(i).filter(|text| !text.is_empty()) {
            Some(text) => Dimension::of(text),
            None => Dimension::of(if *periodic { "rad" } else { UNKNOWN }),
        };
        Self { coordinates: periodic.iter().enumerate().map(of).collect(), time: Dimension::of(time) }
    }

    /// Scaling of a function of the coordinates when all lengths are scaled; none if it is not a power, as for `exp(-x)`, which contains a
    /// constant with a unit.
    fn of_function(&self, function: &Function) -> Option<Dimension> {
        let n = self.coordinates.len();
        let mut bases: Vec<&String> = self.coordinates.iter().flat_map(|unit| unit.0.keys()).collect();
        bases.sort();
        bases.dedup();
        let mut dimension = Dimension::default();
        for base in bases {
            let power = |factor: f64, shift: f64| {
                // The last one is the phase of a drive.
                let q: Vec<f64> = (0..=n).map(|i| 0.37 + shift + 0.11 * i as f64).collect();
                let power = |i: usize| self.coordinates[i].0.get(base).copied().unwrap_or(0.0);
                let scaled: Vec<f64> =
                    (0..=n).map(|i| if i < n { q[i] * factor.powf(power(i)) } else { q[i] }).collect();
                (function.value(&scaled) / function.value(&q)).ln() / factor.ln()
            };
            let found = [power(1.3, 0.0), power(0.6, 0.0), power(1.3, 0.23)];
            // Halves, for square roots.
            let exponent = (2.0 * found[0]).round() / 2.0;
            if !found.iter().all(|x| (x - exponent).abs() < 1e-9) {
                return None;
            }
            dimension = dimension.times(&Dimension(BTreeMap::from([(base.clone(), exponent)])), 1.0);
        }
        Some(dimension)
    }

    /// Unit of a term without its coefficient, for a dissipation function times the unit of time: all terms with their coefficients have the
    /// unit of `L`.
    pub fn of_term(&self, library: &Library, k: usize) -> Option<Dimension> {
        let term = library.terms[k];
        let function = self.of_function(&library.functions[term.function])?;
        let speed = |i: usize| self.coordinates[i].times(&self.time, -1.0);
        Some(match term.kind {
            Kind::Potential => function,
            Kind::Gyroscopic(i) => function.times(&speed(i), 1.0),
            Kind::Kinetic(i, j) => function.times(&speed(i), 1.0).times(&speed(j), 1.0),
            Kind::Dissipation(i, j) => function.times(&speed(i), 1.0).times(&speed(j), 1.0).times(&self.time, 1.0),
        })
    }
}

/// Unit of the coefficient of a term, for an `L` in joules or one with the unit of a term.
pub(super) fn of_coefficient(term: Option<&Dimension>, reference: Option<&Dimension>) -> Option<String> {
    let whole = reference.cloned().unwrap_or_else(|| Dimension::of("kg*m^2/s^2"));
    Some(whole.times(term?, -1.0).written())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_products_of_powers() {
        for (text, written) in
            [("kg*m^2/s^2", "kg*m^2/s^2"), ("m/s/s", "m/s^2"), ("rad", "1"), ("1/m", "1/m"), ("m rad/m", "1")]
        {
            assert_eq!(Dimension::of(text).written(), written);
        }
    }

    #[test]
    fn a_function_has_a_unit_only_if_it_grows_as_a_power() {
        let names = ["x", "y", "a"].map(String::from);
        let units = Units::new(&["m", "m", ""].map(String::from), "s", &[false, false, true]);
        let of = |text: &str| units.of_function(&Function::formula(&names, text).unwrap()).map(|unit| unit.written());
        assert_eq!(of("x*cos(a)").as_deref(), Some("m"));
        assert_eq!(of("1/sqrt(x^2 + y^2)^3").as_deref(), Some("1/m^3"));
        assert_eq!(of("sqrt(x)*sin(2*a)").as_deref(), Some("m^0.5"));
        assert_eq!([of("exp(-x)"), of("x + y^2"), of("x/(x - 2)")], [None, None, None]);
    }
}
