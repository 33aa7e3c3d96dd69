//! Terms of a library other than kinetic and potential ones: gyroscopic terms, friction and a drive.

use super::families::Families;
use super::function::{Factor, Function};
use super::library::{Kind, Library, Term};
use super::thresholds::{MOST_DRIVEN_COMPLEXITY, MOST_FRICTION_COMPLEXITY};
use crate::names::rounded;

/// Dissipation functions of a library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Friction {
    None,
    /// `v_i v_j`.
    Constant,
    /// `v_i v_j f(q)` with simple functions.
    OfPosition,
}

/// Kinds of terms in a library, besides `v_i v_j f(q)` and `f(q)`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Extent {
    pub families: Families,
    pub gyroscopic: bool,
    pub friction: Friction,
    /// A drive, for terms `f(q) cos(om t)` and `f(q) sin(om t)`.
    pub drive: Option<Drive>,
}

impl std::fmt::Display for Extent {
    /// The families, and what goes beyond them.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.families)?;
        if self.friction == Friction::OfPosition {
            f.write_str(" with friction of the position")?;
        }
        match &self.drive {
            Some(Drive { name, frequency }) => write!(f, " with a drive of {name} = {}", rounded(*frequency, 4)),
            None => Ok(()),
        }
    }
}

/// A periodic drive.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Drive {
    /// Name of its angular frequency.
    pub name: String,
    /// Angular frequency `om` in rad/s; a [`Model`](super::motion::Model) fits it.
    pub frequency: f64,
}

impl Library {
    /// Adds the terms of a dissipation function.
    pub(super) fn add_friction(&mut self, friction: Friction) {
        let n = self.n();
        let within = |f: &Function| match friction {
            Friction::None => false,
            Friction::Constant => f.is_one(),
            Friction::OfPosition => f.complexity() <= MOST_FRICTION_COMPLEXITY,
        };
        for function in (0..self.functions.len()).filter(|&k| within(&self.functions[k])) {
            let pairs = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
            self.terms.extend(pairs.map(|(i, j)| Term { kind: Kind::Dissipation(i, j), function }));
        }
    }

    /// Adds the terms of a drive: forces on the coordinates, `q_i cos(om t)`, and simple functions with an oscillating factor.
    pub(super) fn add_drive(&mut self) {
        if self.drive.is_none() {
            return;
        }
        let n = self.n();
        let mut phase = vec![0; n + 1];
        phase[n] = 1;
        for driven in self.driven() {
            for wave in [Factor::Cosine(phase.clone()), Factor::Sine(phase.clone())] {
                let Some(product) = driven.product(&Function::Product(vec![wave])) else { continue };
                self.terms.push(Term { kind: Kind::Potential, function: self.functions.len() });
                self.functions.push(product);
            }
        }
    }

    /// Functions that a drive may multiply.
    pub(super) fn driven(&self) -> Vec<Function> {
        let mut all: Vec<Function> = (0..self.n()).map(Function::coordinate).collect();
        let simple = |f: &&Function| f.is_smooth() && !f.is_one() && f.complexity() <= MOST_DRIVEN_COMPLEXITY;
        let others = self.functions.iter().filter(simple).filter(|f| !all.contains(f)).cloned().collect::<Vec<_>>();
        all.extend(others);
        all
    }
}

#[cfg(test)]
mod tests {
    use super::super::function::Notation;
    use super::super::library::Values;
    use super::*;
    use crate::tape::Replay;

    #[test]
    fn a_drive_is_a_function_of_the_time_with_slopes_by_its_frequency() {
        let drive = Some(Drive { name: "om".to_string(), frequency: 1.1 });
        let extent = Extent { families: Families::default(), gyroscopic: false, friction: Friction::OfPosition, drive };
        let library = Library::new(&["x".to_string()], &[false], extent, &[]).unwrap();
        let find = |text: &str| {
            let written = |k: &usize| library.written(*k, Notation::System) == text;
            (0..library.terms.len()).rev().find(written).unwrap()
        };
        let terms = ["x_dot^2", "x*cos(om*t)", "x^2*sin(om*t)", "x_dot^2*x"].map(find);
        assert_eq!(terms.map(|k| library.is_driven(k)), [false, true, true, false]);
        let masses = library.terms.iter().position(|term| term.kind == Kind::Kinetic(0, 0)).unwrap();
        let model = [masses, terms[1], terms[2], terms[3]];
        assert!(library.is_dissipation(terms[3]) && !library.is_dissipation(masses));
        // x'' = a cos(om t) + 2 b x sin(om t) - 2 c x x', by om and by c.
        let equations = library.equations(&model, 5, (&[4], &[terms[3]])).unwrap();
        assert_eq!(equations.known, 1);
        let ([x, v, t], [a, b, c, om]) = ([0.7, -0.4, 2.3], [0.3, -0.2, 0.1, 1.3]);
        let p = [0.5, a, b, c, om];
        let run = |program, fields: &[&[f64]], sizes: [usize; 2]| {
            let mut found = sizes.map(|size| vec![0.0; size]);
            let [first, second] = &mut found;
            let mut out: Vec<&mut [f64]> = vec![first];
            if sizes[1] > 0 {
                out.push(second);
            }
            Replay::new(program).evaluate(1, fields, &p, &mut out).unwrap();
            found.concat()
        };
        let motion = run(equations.motion, &[&[x], &[v], &[t]], [1, 1]);
        let force = a * (om * t).cos() + 2.0 * b * x * (om * t).sin() - 2.0 * c * x * v;
        assert!((motion[0] - 1.0).abs() < 1e-14 && (motion[1] - force).abs() < 1e-14, "{motion:?} {force}");
        let slopes = run(equations.slopes, &[&[x], &[v], &[0.2], &[t]], [4, 0]);
        let by_frequency = a * t * (om * t).sin() - 2.0 * b * x * t * (om * t).cos();
        assert!((slopes[2] - by_frequency).abs() < 1e-14 && (slopes[3] - 2.0 * x * v).abs() < 1e-14, "{slopes:?}");
        // The weak form has the frequency of the library.
        let mut values = Values::new();
        let function = library.terms[terms[1]].function;
        library.evaluate(&[function], (&[x], t), &mut values);
        assert!((values[function].gradient[0] - (1.1 * t).cos()).abs() < 1e-14);
    }
}
