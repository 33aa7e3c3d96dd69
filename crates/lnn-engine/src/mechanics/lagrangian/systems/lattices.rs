//! Masses with springs between neighbours, up to a thousand coordinates: the Fermi-Pasta-Ulam-Tsingou lattice in a line, and a hanging
//! cloth.

use super::{ACCELERATION_OF_GRAVITY, NOWHERE, length, mass};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, Coordinate, Layout, LearningAdvice, Parameter, PerSize, Plane, Range, Size, System,
    TrajectoryTest,
};
use crate::scalar::{Real, Scalar};
use alloc::borrow::Cow;
use alloc::vec::Vec;

/// `L = sum_i m v_i^2 / 2 - sum_i (k d_i^2 / 2 + beta d_i^4 / 4)` with the stretches `d_i = q_(i+1) - q_i` of the `n + 1` springs of `n`
/// masses between fixed ends, `q_0 = q_(n+1) = 0` (Fermi, Pasta, Ulam, Tsingou, "Studies of nonlinear problems", 1955).
#[derive(Clone, Copy, Debug)]
pub struct Lattice {
    /// Number of masses.
    pub n: usize,
}

static OF_LATTICE: [Parameter; 3] = [
    mass("m"),
    Parameter::new("k", "1", "N/m", Range::AtLeastZero),
    Parameter::new("beta", "0.25", "N/m^3", Range::Any),
];

/// Catalogue entry.
pub const LATTICE: System = System {
    name: Cow::Borrowed("lattice"),
    title: Cow::Borrowed("Line of masses with linear and cubic springs"),
    coordinates: PerSize::Rule(|n| (1..=n).map(|i| Coordinate::length(format!("q{i}"))).collect()),
    parameters: Cow::Borrowed(&OF_LATTICE),
    size: Size::Chosen { symbol: "n", default: 8, least: 1, most: 1000, layout: Layout::Line },
    time_unit: Cow::Borrowed("s"),
    time_like: None,
    constraint: None,
    training: PerSize::Rule(|n| Bounds::uniform(n, (-2.0, 2.0), (-2.0, 2.0))),
    validation: PerSize::Rule(|n| Bounds::uniform(n, (-2.0, 2.0), (-2.0, 2.0))),
    trajectory: PerSize::Rule(|n| TrajectoryTest {
        start: Bounds::uniform(n, (-1.0, 1.0), (-1.0, 1.0)),
        t_end: 50.0,
        dt: 0.1,
    }),
    domain: None,
    plane: Some(Plane {
        labels: ["displacement of the first mass [m]", "displacement of the last mass [m]"],
        point: |_, q| match *q {
            [first, .., last] => (first, last),
            _ => NOWHERE,
        },
    }),
    conserved: None,
    learning: LearningAdvice::NONE,
    described: None,
};

impl Lattice {
    /// Returns the stretches of the springs from one end to the other.
    fn stretches<R: Real>(q: &[R]) -> impl Iterator<Item = R> {
        let next = q.iter().copied().chain([R::zero()]);
        next.scan(R::zero(), |before, q| Some(q - core::mem::replace(before, q)))
    }
}

impl Lagrangian for Lattice {
    fn coordinates(&self) -> usize {
        self.n
    }
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [m, k, beta] = *parameters else { return R::constant(Scalar::nan()) };
        let squares = v.iter().fold(R::zero(), |sum, v| sum + v.sqr());
        let stored = Self::stretches(q).fold(R::zero(), |sum, d| {
            let square = d.sqr();
            sum + square * (k + R::half() * beta * square)
        });
        R::half() * (m * squares - stored)
    }
}

impl ClosedForm for Lattice {
    /// `m a_i = f_i - f_(i-1)` with the tensions `f = k d + beta d^3`.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], _v: &[R]) -> Vec<R> {
        let [m, k, beta] = *parameters else { return Vec::new() };
        let tensions: Vec<R> = Self::stretches(q).map(|d| d * (k + beta * d.sqr())).collect();
        tensions.windows(2).map(|f| (f[1] - f[0]) / m).collect()
    }
}

/// A square net of equal masses in space that hangs from a row of hooks. Springs connect each mass to its neighbours in its row and column,
/// and the first row to the hooks.
///
/// `L = sum m |v|^2 / 2 - sum k (|d|^2 - l^2)^2 / (8 l^2) - sum m g z` with the vectors `d` along the springs. A spring with Green's strain
/// `(|d|^2 - l^2) / (2 l^2)` has stiffness `k` at its rest length `l`, and its force remains smooth when its ends meet. Coordinates are
/// `x`, `y`, `z` of each mass, row by row from the top; hook `j` is at `(j l, 0, 0)`, with `j` from 0.
#[derive(Clone, Copy, Debug)]
pub struct Cloth {
    /// Number of masses per row, and of rows.
    pub side: usize,
}

static OF_CLOTH: [Parameter; 4] =
    [mass("m"), Parameter::new("k", "100", "N/m", Range::AtLeastZero), length("l"), ACCELERATION_OF_GRAVITY];

/// Catalogue entry.
pub const CLOTH: System = System {
    name: Cow::Borrowed("cloth"),
    title: Cow::Borrowed("Hanging cloth of n by n masses and springs"),
    coordinates: PerSize::Rule(|n| {
        let side = Layout::Net.chosen(n);
        let names = (0..n).map(|i| {
            let (axis, point) = (["x", "y", "z"][i % 3], i / 3);
            format!("{axis}{}_{}", point / side + 1, point % side + 1)
        });
        names.map(Coordinate::length).collect()
    }),
    parameters: Cow::Borrowed(&OF_CLOTH),
    size: Size::Chosen { symbol: "n", default: 2, least: 1, most: 18, layout: Layout::Net },
    time_unit: Cow::Borrowed("s"),
    time_like: None,
    constraint: None,
    training: PerSize::Rule(|n| around_rest(n, 0.4, 3.0)),
    validation: PerSize::Rule(|n| around_rest(n, 0.3, 2.0)),
    trajectory: PerSize::Rule(|n| TrajectoryTest { start: around_rest(n, 0.1, 0.5), t_end: 10.0, dt: 0.05 }),
    domain: None,
    plane: Some(Plane {
        labels: ["x of the last mass [m]", "z of the last mass [m]"],
        point: |_, q| match *q {
            [.., x, _, z] => (x, z),
            _ => NOWHERE,
        },
    }),
    conserved: None,
    learning: LearningAdvice::NONE,
    described: None,
};

/// Returns bounds around the positions of `n` coordinates in a flat cloth without weight, with springs of 1 m.
fn around_rest(n: usize, distance: f64, speed: f64) -> Bounds {
    let side = Layout::Net.chosen(n);
    let place = |i: usize| match (i % 3, i / 3) {
        (0, point) => (point % side) as f64,
        (1, _) => 0.0,
        (_, point) => -((point / side + 1) as f64),
    };
    let positions = (0..n).map(|i| (place(i) - distance, place(i) + distance)).collect();
    Bounds { positions, velocities: vec![(-speed, speed); n] }
}

impl Cloth {
    /// Calls `spring` for each spring with the indices of its masses, `None` for a hook, and the vector from the first to the second.
    fn springs<R: Real>(&self, l: R, q: &[R], mut spring: impl FnMut(Option<usize>, usize, [R; 3])) {
        let side = self.side;
        let place = |point: usize| [q[3 * point], q[3 * point + 1], q[3 * point + 2]];
        for point in 0..side * side {
            let (row, column, end) = (point / side, point % side, place(point));
            let hook = [R::of(column as f64) * l, R::zero(), R::zero()];
            let above = (row > 0).then(|| point - side);
            let start = above.map_or(hook, place);
            spring(above, point, [0, 1, 2].map(|i| end[i] - start[i]));
            if column > 0 {
                let start = place(point - 1);
                spring(Some(point - 1), point, [0, 1, 2].map(|i| end[i] - start[i]));
            }
        }
    }
}

/// `|d|^2 - l^2`.
fn stretch<R: Real>(l: R, d: [R; 3]) -> R {
    d[0].sqr() + d[1].sqr() + d[2].sqr() - l.sqr()
}

impl Lagrangian for Cloth {
    fn coordinates(&self) -> usize {
        3 * self.side * self.side
    }
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [m, k, l, g] = *parameters else { return R::constant(Scalar::nan()) };
        let squares = v.iter().fold(R::zero(), |sum, v| sum + v.sqr());
        let height = q.iter().skip(2).step_by(3).fold(R::zero(), |sum, &z| sum + z);
        let mut stored = R::zero();
        self.springs(l, q, |_, _, d| stored += stretch(l, d).sqr());
        m * (R::half() * squares - g * height) - k / (R::of(8.0) * l.sqr()) * stored
    }
}

impl ClosedForm for Cloth {
    /// Each spring pulls its second mass by `-k (|d|^2 - l^2) d / (2 l^2)`.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], _v: &[R]) -> Vec<R> {
        let [m, k, l, g] = *parameters else { return Vec::new() };
        let mut force = vec![R::zero(); q.len()];
        self.springs(l, q, |first, second, d| {
            let factor = k * stretch(l, d) / (R::two() * l.sqr());
            for i in 0..3 {
                let pull = factor * d[i];
                force[3 * second + i] -= pull;
                if let Some(first) = first {
                    force[3 * first + i] += pull;
                }
            }
        });
        let weight = |i: usize| if i % 3 == 2 { g } else { R::zero() };
        force.into_iter().enumerate().map(|(i, force)| force / m - weight(i)).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::lagrangian::{Accelerations, SystemInstance};

    fn sized(name: &str, n: usize) -> SystemInstance<f64> {
        SystemInstance::named(name, &[("n".to_string(), n.to_string())]).unwrap()
    }

    /// Returns a state within the validation bounds.
    fn state(instance: &SystemInstance<f64>) -> (Vec<f64>, Vec<f64>) {
        let bounds = instance.system.validation(instance.coordinates);
        let draw = |sides: &[(f64, f64)], by: f64| -> Vec<f64> {
            let part = |k: usize| 0.5 + 0.5 * (by * k as f64 + 0.3).sin();
            sides.iter().enumerate().map(|(k, b)| b.0 + (b.1 - b.0) * part(k)).collect()
        };
        (draw(&bounds.positions, 0.37), draw(&bounds.velocities, 0.71))
    }

    /// Returns the largest difference from the closed-form accelerations, relative to their maximum.
    fn error(name: &str, n: usize) -> f64 {
        let instance = sized(name, n);
        let (q, v) = state(&instance);
        let (model, mut a) = (instance.build().unwrap(), vec![0.0; q.len()]);
        Accelerations::new(model.as_ref()).at(&q, &v, &mut a).unwrap();
        let exact = instance.exact_acceleration(&q, &v).unwrap();
        assert_eq!(exact.len(), q.len());
        let size = exact.iter().fold(0f64, |most, x| most.max(x.abs()));
        a.iter().zip(&exact).fold(0f64, |most, (a, b)| most.max((a - b).abs())) / size
    }

    #[test]
    fn large_systems_move_as_their_closed_forms_say() {
        let cases = [("lattice", &[1, 2, 31, 1000][..]), ("cloth", &[1, 2, 5, 18]), ("n-pendulum", &[1, 2, 7, 20])];
        for (name, sizes) in cases {
            for &n in sizes {
                let error = error(name, n);
                assert!(error < 1e-11, "{name} of {n}: {error:e}");
            }
        }
    }

    #[test]
    fn a_thousand_pendula_that_hang_still_stay() {
        let model = sized("n-pendulum", 1000).build().unwrap();
        let mut a = vec![1.0; 1000];
        Accelerations::new(model.as_ref()).at(&[0.0; 1000], &[0.0; 1000], &mut a).unwrap();
        assert!(a.iter().all(|a| *a == 0.0));
    }

    #[test]
    fn sizes_are_kept_within_bounds() {
        assert_eq!((sized("cloth", 18).coordinates, sized("lattice", 1000).coordinates), (972, 1000));
        for (name, n) in [("cloth", "19"), ("cloth", "0"), ("lattice", "1001"), ("n-pendulum", "1001")] {
            assert!(SystemInstance::<f64>::named(name, &[("n".to_string(), n.to_string())]).is_err(), "{name} {n}");
        }
        let cloth = sized("cloth", 2);
        let names = cloth.system.columns(cloth.coordinates);
        assert_eq!((names[0].as_str(), names[11].as_str()), ("x1_1", "z2_2"));
    }
}
