//! Geodesics of anti-de Sitter space of any dimension in half-space coordinates.

use super::{length, lengths};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, Conserved, LearningAdvice, PaperBudget, PaperPhase, Parameter, PerSize, Plane, Size,
    StateAdvice, System, TrajectoryTest,
};
use crate::scalar::Real;
use alloc::borrow::Cow;
use alloc::vec::Vec;

/// `Lagrangian = (L/z)^2 (-t'^2 + x'^2 + y'^2 + z'^2) / 2` over `(t, z)`, `(t, x, z)` or `(t, x, y, z)`, where `L` is the radius.
///
/// Here `' = d/dtau` with the proper time `tau`, in geometric units with `c = 1`: all coordinates, `tau` and `L` are in metres. The
/// geodesic equations are those of Hamzaogullari and Ozakin's appendix; the Euler-Lagrange equation of `z` confirms all signs printed
/// there.
#[derive(Clone, Copy, Debug)]
pub struct AdsGeodesic {
    /// Number of coordinates, 2 to 4.
    pub n: usize,
}

static PARAMETERS: [Parameter; 1] = [length("L")];

/// The bounds of the paper, the same for every dimension: for `t`, the coordinates in between, and `z`.
fn bounds(n: usize, t: (f64, f64), x: (f64, f64), z: (f64, f64), x_dot: (f64, f64), z_dot: (f64, f64)) -> Bounds {
    let list = |first, middle, last| {
        let mut list = vec![middle; n];
        (list[0], list[n - 1]) = (first, last);
        list
    };
    // The velocity of t follows from the mass shell.
    Bounds { positions: list(t, x, z), velocities: list((0.0, 0.0), x_dot, z_dot) }
}

fn states(n: usize) -> Bounds {
    bounds(n, (-5.0, 5.0), (-5.0, 5.0), (0.5, 6.0), (-1.0, 1.0), (-0.6, 0.6))
}

/// Catalogue entry of `n` coordinates.
pub const fn system(
    name: &'static str,
    title: &'static str,
    n: usize,
    constraint: &'static str,
    paper: Option<PaperBudget>,
) -> System {
    System {
        name: Cow::Borrowed(name),
        title: Cow::Borrowed(title),
        coordinates: PerSize::Rule(|n| match n {
            2 => lengths(&["t", "z"]),
            3 => lengths(&["t", "x", "z"]),
            _ => lengths(&["t", "x", "y", "z"]),
        }),
        parameters: Cow::Borrowed(&PARAMETERS),
        size: Size::Fixed(n),
        time_unit: Cow::Borrowed("m"),
        time_like: Some(0),
        constraint: Some(constraint),
        training: PerSize::Rule(states),
        validation: PerSize::Rule(states),
        trajectory: PerSize::Rule(|n| TrajectoryTest {
            start: bounds(n, (0.0, 0.0), (-1.0, 1.0), (0.5, 3.0), (-0.25, 0.25), (-0.25, 0.25)),
            t_end: 0.5,
            dt: 0.01,
        }),
        domain: Some(|_, q| if q.last().is_some_and(|&z| z > 0.0) { Ok(()) } else { Err("z must be positive") }),
        // With x the plane is in space, otherwise it is one of space and time.
        plane: Some(Plane {
            labels: [if n == 2 { "t [m]" } else { "x [m]" }, "z [m]"],
            point: |_, q| (q[usize::from(q.len() > 2)], q[q.len() - 1]),
        }),
        // The metric depends only on z.
        conserved: Some(Conserved {
            name: "momenta but that of z [1]",
            vector: |parameters, q, v| {
                let (&[radius], Some((z, _))) = (parameters, q.split_last()) else { return vec![f64::NAN] };
                let sign = |i: usize| if i == 0 { -1.0 } else { 1.0 };
                (0..q.len() - 1).map(|i| sign(i) * (radius / z).powi(2) * v[i]).collect()
            },
        }),
        learning: LearningAdvice {
            // From rest z = z_0 / cos(tau), so that everything falls towards the horizon faster and faster.
            states: Some(|bounds| {
                let n = bounds.positions.len();
                bounds.positions[n - 1].0 = 0.4;
                bounds.velocities[n - 1] = (-2.4, 2.4);
                StateAdvice {
                    log_uniform: (1..=n).map(|i| i == n).collect(),
                    acceleration_weighting: 1.0,
                    trajectory_fraction: 0.3,
                    shell: None,
                }
            }),
            paper,
            ..LearningAdvice::NONE
        },
        described: None,
    }
}

/// Computes the sum of squares.
fn squares<R: Real>(v: &[R]) -> R {
    v.iter().fold(R::zero(), |sum, &v| sum + v.sqr())
}

impl Lagrangian for AdsGeodesic {
    fn coordinates(&self) -> usize {
        self.n
    }
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [radius] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        R::half() * (radius / q[self.n - 1]).sqr() * (squares(&v[1..]) - v[0].sqr())
    }
}

impl ClosedForm for AdsGeodesic {
    /// `t'' = 2 t' z'/z`, likewise `x` and `y`; `z'' = (t'^2 - x'^2 - y'^2 + z'^2)/z`.
    fn acceleration<R: Real>(&self, _parameters: &[R], q: &[R], v: &[R]) -> Vec<R> {
        let last = self.n - 1;
        let (z, z_dot) = (q[last], v[last]);
        let mut a: Vec<R> = v[..last].iter().map(|&v| R::two() * v * (z_dot / z)).collect();
        a.push((v[0].sqr() - squares(&v[1..last]) + z_dot.sqr()) / z);
        a
    }

    /// `t' = sqrt(x'^2 + y'^2 + z'^2 + (z/L)^2)`.
    fn constrained_velocity<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Option<R> {
        let [radius] = *parameters else { return None };
        Some((squares(&v[1..]) + (q[self.n - 1] / radius).sqr()).sqrt())
    }
}

/// Catalogue entry.
pub const ADS2: System =
    system("ads2-geodesic", "Geodesic of AdS2 in half-space coordinates", 2, "t_dot = sqrt(z_dot^2 + (z/L)^2)", None);

/// Catalogue entry.
pub const ADS3: System = system(
    "ads3-geodesic",
    "Geodesic of AdS3 in half-space coordinates",
    3,
    "t_dot = sqrt(x_dot^2 + z_dot^2 + (z/L)^2)",
    None,
);

/// Catalogue entry.
pub const ADS4: System = system(
    "ads4-geodesic",
    "Geodesic of AdS4 in half-space coordinates",
    4,
    "t_dot = sqrt(x_dot^2 + y_dot^2 + z_dot^2 + (z/L)^2)",
    Some(PaperBudget { states: 120_000, hidden: &[500; 3], phases: &[PaperPhase::new(300, 1e-3, 1e-7)] }),
);
