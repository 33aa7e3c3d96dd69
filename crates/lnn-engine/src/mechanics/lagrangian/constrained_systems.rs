//! Systems with constraints, described by formulas: points in Cartesian coordinates, rigid bodies with rotation matrices, wheels, and
//! geodesics parametrized by coordinate time.

use super::description::Description;
use super::system::Range;
use super::system::System;
use crate::lagrangian::thresholds::{LISTED_BOBS, MOST_BOBS};
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Name of a chain without the number of its bobs.
const CHAIN: &str = "cartesian-chain-";

/// Returns the description of the system with a name, including chains that are too long for the list.
pub(super) fn constrained_description(name: &str) -> Option<Description> {
    let bobs = name.strip_prefix(CHAIN).and_then(|bobs| bobs.parse().ok());
    match bobs.filter(|bobs| (1..=MOST_BOBS).contains(bobs)).map(chain) {
        Some(chain) => Some(chain).filter(|chain| chain.name == name),
        None => constrained_descriptions().find(|description| description.name == name),
    }
}

/// Returns the descriptions of the listed systems.
pub(super) fn constrained_descriptions() -> impl Iterator<Item = Description> {
    let single = [
        on_surface("particle-on-sphere", "Heavy particle on a sphere", &["R"], "x^2 + y^2 + z^2 - R^2", 1.0),
        on_surface(
            "particle-on-ellipsoid",
            "Heavy particle on an ellipsoid",
            &["A", "B", "C"],
            "(x/A)^2 + (y/B)^2 + (z/C)^2 - 1",
            1.0,
        ),
        on_surface(
            "particle-on-torus",
            "Heavy particle on a torus around the vertical",
            &["R", "a"],
            "(x^2 + y^2 + z^2 + R^2 - a^2)^2 - 4*R^2*(x^2 + y^2)",
            1.5,
        ),
        on_ellipse(),
        body("rigid-body", "Free rigid body by its rotation matrix", false),
        body("heavy-top", "Heavy symmetric top by its rotation matrix", true),
        four_bar(),
        sleigh(),
        disk(),
        by_clock(
            "schwarzschild-by-clock",
            "Geodesic of Schwarzschild's metric by the time of a distant clock",
            &[
                ("r", (4.0, 12.0), (-0.3, 0.3)),
                ("theta", (0.7, 2.4), (-0.05, 0.05)),
                ("phi", (0.0, TAU), (-0.05, 0.05)),
            ],
            "M",
            "-(1 - 2*M/r)*t_dot^2 + r_dot^2/(1 - 2*M/r) + r^2*(theta_dot^2 + sin(theta)^2*phi_dot^2)",
        ),
        by_clock(
            "ads4-by-clock",
            "Geodesic of AdS4 in half-space coordinates by coordinate time",
            &[("x", (-1.0, 1.0), (-0.4, 0.4)), ("y", (-1.0, 1.0), (-0.4, 0.4)), ("z", (0.5, 2.0), (-0.4, 0.4))],
            "L",
            "(L/z)^2*(-t_dot^2 + x_dot^2 + y_dot^2 + z_dot^2)",
        ),
    ];
    single.into_iter().chain((1..=LISTED_BOBS).map(chain))
}

/// Builds the listed systems with constraints.
pub fn constrained_systems() -> Vec<System> {
    // These formulas always compile: a test checks that.
    constrained_descriptions().filter_map(|description| description.compile().ok()).collect()
}

/// A coordinate with its bounds and its velocity bounds.
type Bounded<'a> = (&'a str, (f64, f64), (f64, f64));

/// Assembles a description; the unit of a coordinate follows from its name, since angles have Greek letters.
fn described(
    (name, title, time_unit): (&str, &str, &str),
    lagrangian: String,
    coordinates: &[Bounded<'_>],
    parameters: &[(&str, &str, &str)],
    constraints: Vec<(String, String)>,
) -> Description {
    Description::of_parts(
        (name, title, time_unit),
        lagrangian,
        coordinates.iter().map(|&(name, bounds, speeds)| {
            let unit = match name {
                "theta" | "phi" => "rad",
                _ if name.starts_with('r') && name.len() == 3 => "1",
                _ => "m",
            };
            (name, unit, bounds, speeds)
        }),
        parameters.iter().map(|&(symbol, default, unit)| {
            let range = if symbol == "g" { Range::Any } else { Range::Positive };
            (symbol, default, unit, range)
        }),
        constraints.into_iter().collect::<BTreeMap<_, _>>(),
    )
}

/// Returns a list with one constraint.
fn one(name: &str, formula: impl Into<String>) -> Vec<(String, String)> {
    vec![(name.to_string(), formula.into())]
}

/// A point mass under gravity on a surface in space.
fn on_surface(name: &str, title: &str, lengths: &[&str], surface: &str, size: f64) -> Description {
    let side = (-size, size);
    let coordinates = ["x", "y", "z"].map(|name| (name, side, (-2.0, 2.0)));
    let defaults = match name {
        "particle-on-ellipsoid" => ["1.2", "1", "0.8"],
        "particle-on-torus" => ["1", "0.4", ""],
        _ => ["1", "", ""],
    };
    let mut parameters: Vec<_> =
        lengths.iter().zip(defaults).map(|(&symbol, default)| (symbol, default, "m")).collect();
    parameters.extend([("m", "1", "kg"), ("g", "9.81", "m/s^2")]);
    let lagrangian = "m*(x_dot^2 + y_dot^2 + z_dot^2)/2 - m*g*z".to_string();
    described((name, title, "s"), lagrangian, &coordinates, &parameters, one("surface", surface))
}

fn on_ellipse() -> Description {
    let coordinates = [("x", (-2.0, 2.0), (-2.0, 2.0)), ("y", (-1.0, 1.0), (-2.0, 2.0))];
    let parameters = [("A", "2", "m"), ("B", "1", "m"), ("m", "1", "kg"), ("g", "9.81", "m/s^2")];
    let lagrangian = "m*(x_dot^2 + y_dot^2)/2 - m*g*y".to_string();
    let title = "Heavy bead on an elliptic wire";
    described(
        ("particle-on-ellipse", title, "s"),
        lagrangian,
        &coordinates,
        &parameters,
        one("wire", "(x/A)^2 + (y/B)^2 - 1"),
    )
}

/// A chain of bobs on rods of equal length.
fn chain(bobs: usize) -> Description {
    let name = |axis: char, k: usize| format!("{axis}{k}");
    let names: Vec<String> = (1..=bobs).flat_map(|k| [name('x', k), name('y', k)]).collect();
    let reach = bobs as f64;
    let coordinates: Vec<_> = names.iter().map(|name| (name.as_str(), (-reach, reach), (-3.0, 3.0))).collect();
    let join = |part: &dyn Fn(usize) -> String, sign: &str| (1..=bobs).map(part).collect::<Vec<_>>().join(sign);
    let kinetic = join(&|k| format!("x{k}_dot^2 + y{k}_dot^2"), " + ");
    let heights = join(&|k| format!("y{k}"), " + ");
    let rod = |k: usize| match k {
        1 => "x1^2 + y1^2 - l^2".to_string(),
        _ => format!("(x{k} - x{})^2 + (y{k} - y{})^2 - l^2", k - 1, k - 1),
    };
    let digits = bobs.to_string().len().max(2);
    let rods = (1..=bobs).map(|k| (format!("rod {k:0digits$}"), rod(k))).collect();
    let parameters = [("l", "1", "m"), ("m", "1", "kg"), ("g", "9.81", "m/s^2")];
    described(
        (&format!("{CHAIN}{bobs}"), &format!("Chain of {bobs} pendula in Cartesian coordinates"), "s"),
        format!("m*({kinetic})/2 - m*g*({heights})"),
        &coordinates,
        &parameters,
        rods,
    )
}

/// A rigid body described by its rotation matrix, whose columns are the axes of the body: `T = sum_k j_k |d(column k)/dt|^2 / 2` with `j_1
/// = (I2 + I3 - I1)/2` and so on.
fn body(name: &str, title: &str, heavy: bool) -> Description {
    let names: Vec<String> = (1..=3).flat_map(|i| (1..=3).map(move |k| format!("r{i}{k}"))).collect();
    let coordinates: Vec<_> = names.iter().map(|name| (name.as_str(), (-1.0, 1.0), (-3.0, 3.0))).collect();
    let (moments, mut parameters): ([&str; 3], _) = if heavy {
        (
            ["I1", "I1", "I3"],
            vec![("I1", "0.5", "kg m^2"), ("I3", "0.3", "kg m^2"), ("m", "1", "kg"), ("l", "0.4", "m")],
        )
    } else {
        (["I1", "I2", "I3"], vec![("I1", "0.5", "kg m^2"), ("I2", "0.4", "kg m^2"), ("I3", "0.3", "kg m^2")])
    };
    let column = |k: usize| {
        let [a, b, c] = [moments[k % 3], moments[(k + 1) % 3], moments[(k + 2) % 3]];
        let k = k + 1;
        format!("({b} + {c} - {a})*(r1{k}_dot^2 + r2{k}_dot^2 + r3{k}_dot^2)/4")
    };
    let kinetic = (0..3).map(column).collect::<Vec<_>>().join(" + ");
    let lagrangian = if heavy {
        parameters.push(("g", "9.81", "m/s^2"));
        format!("{kinetic} - m*g*l*r33")
    } else {
        kinetic
    };
    let product = |a: usize, b: usize| {
        let terms = (1..=3).map(|i| format!("r{i}{a}*r{i}{b}")).collect::<Vec<_>>().join(" + ");
        (format!("axes {a} {b}"), if a == b { format!("{terms} - 1") } else { terms })
    };
    let constraints = [(1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)].map(|(a, b)| product(a, b)).to_vec();
    described((name, title, "s"), lagrangian, &coordinates, &parameters, constraints)
}

/// A four-bar linkage with masses at the two moving joints: crank, coupler and rocker; the fixed pivots are at `0` and `(d, 0)`.
fn four_bar() -> Description {
    let (near, far) = ((-1.0, 1.0), (-1.0, 4.0));
    let coordinates =
        [("x1", near, (-2.0, 2.0)), ("y1", near, (-2.0, 2.0)), ("x2", far, (-2.0, 2.0)), ("y2", far, (-2.0, 2.0))];
    let parameters = [
        ("a", "1", "m"),
        ("b", "2.5", "m"),
        ("c", "2", "m"),
        ("d", "3", "m"),
        ("m", "1", "kg"),
        ("g", "9.81", "m/s^2"),
    ];
    let constraints = [
        ("crank", "x1^2 + y1^2 - a^2"),
        ("coupler", "(x2 - x1)^2 + (y2 - y1)^2 - b^2"),
        ("rocker", "(x2 - d)^2 + y2^2 - c^2"),
    ];
    let constraints = constraints.map(|(name, formula)| (name.to_string(), formula.to_string())).to_vec();
    let lagrangian = "m*(x1_dot^2 + y1_dot^2 + x2_dot^2 + y2_dot^2)/2 - m*g*(y1 + y2)".to_string();
    described(("four-bar-linkage", "Four-bar linkage", "s"), lagrangian, &coordinates, &parameters, constraints)
}

/// Chaplygin's sleigh: a blade at `(x, y)` along `theta`, with the centre of mass a distance `a` ahead of it.
fn sleigh() -> Description {
    let coordinates =
        [("x", (-2.0, 2.0), (-2.0, 2.0)), ("y", (-2.0, 2.0), (-2.0, 2.0)), ("theta", (0.0, TAU), (-2.0, 2.0))];
    let parameters = [("a", "0.3", "m"), ("m", "1", "kg"), ("I", "0.2", "kg m^2")];
    let lagrangian =
        "m*((x_dot - a*theta_dot*sin(theta))^2 + (y_dot + a*theta_dot*cos(theta))^2)/2 + I*theta_dot^2/2".to_string();
    let blade = one("blade", "y_dot*cos(theta) - x_dot*sin(theta)");
    described(("chaplygin-sleigh", "Chaplygin's sleigh", "s"), lagrangian, &coordinates, &parameters, blade)
}

/// An upright disk that rolls on a plane with heading `theta` and rolling angle `phi`.
fn disk() -> Description {
    let place = (-2.0, 2.0);
    let coordinates =
        [("x", place, place), ("y", place, place), ("theta", (0.0, TAU), place), ("phi", (0.0, TAU), (-3.0, 3.0))];
    let parameters = [("R", "0.5", "m"), ("m", "1", "kg"), ("I", "0.1", "kg m^2"), ("J", "0.15", "kg m^2")];
    let constraints = [("rolling x", "x_dot - R*phi_dot*cos(theta)"), ("rolling y", "y_dot - R*phi_dot*sin(theta)")];
    let constraints = constraints.map(|(name, formula)| (name.to_string(), formula.to_string())).to_vec();
    let lagrangian = "m*(x_dot^2 + y_dot^2)/2 + I*theta_dot^2/2 + J*phi_dot^2/2".to_string();
    described(("rolling-disk", "Upright rolling disk", "s"), lagrangian, &coordinates, &parameters, constraints)
}

/// A geodesic with `t_dot = 1`: its evolution parameter is the coordinate time.
fn by_clock(name: &str, title: &str, space: &[Bounded<'_>], length: &str, metric: &str) -> Description {
    let coordinates: Vec<_> = [("t", (0.0, 10.0), (0.9, 1.1))].into_iter().chain(space.iter().copied()).collect();
    let lagrangian = format!("-sqrt(-({metric}))");
    described((name, title, "m"), lagrangian, &coordinates, &[(length, "1", "m")], one("clock", "t_dot - 1"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Accelerations, SystemInstance};
    use std::borrow::Cow;

    #[test]
    fn constraints_of_the_catalogue_are_independent() {
        for description in constrained_descriptions() {
            // The description is checked like one from a file.
            let system = description.system().unwrap();
            let model = SystemInstance::<f64>::new(Cow::Owned(system), &[]).unwrap().build().unwrap();
            let manifold = model.manifold().unwrap();
            assert!(manifold.redundant().is_empty() && manifold.names().len() < model.coordinates());
        }
    }

    #[test]
    fn long_chains_hang_still_and_fall_freely_where_nothing_pulls() {
        for bobs in [1, 20, 21, 150, MOST_BOBS] {
            let system = SystemInstance::<f64>::named(&format!("{CHAIN}{bobs}"), &[]).unwrap();
            let (model, n) = (system.build().unwrap(), 2 * bobs);
            let at = |x: f64, y: f64| -> Vec<f64> { (1..=bobs).flat_map(|k| [x * k as f64, y * k as f64]).collect() };
            let mut accelerations = Accelerations::new(model.as_ref());
            let mut a = vec![1.0; n];
            accelerations.at(&at(0.0, -1.0), &vec![0.0; n], &mut a).unwrap();
            assert!(a.iter().all(|a| a.abs() < 1e-9), "{bobs}");
            // Level rods exert no force, so every bob falls freely.
            accelerations.at(&at(1.0, 0.0), &vec![0.0; n], &mut a).unwrap();
            assert!(a.chunks_exact(2).all(|a| a[0].abs() < 1e-9 && (a[1] + 9.81).abs() < 1e-9), "{bobs}");
        }
        for name in ["cartesian-chain-0", "cartesian-chain-501", "cartesian-chain-01", "cartesian-chain-+1"] {
            assert!(SystemInstance::<f64>::named(name, &[]).is_err(), "{name}");
        }
    }
}
