//! Free motion on a sphere in polar angle and azimuth.

use super::{NOWHERE, angular_velocity, length, mass};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, Conserved, Coordinate, LearningAdvice, PaperBudget, PaperPhase, Parameter, PerSize, Plane,
    Size, StateAdvice, System, TrajectoryTest,
};
use crate::scalar::Real;
use alloc::borrow::Cow;
use alloc::vec::Vec;
use core::f64::consts::PI;

/// `L = m R^2 (v_theta^2 + sin^2 theta v_phi^2) / 2`.
#[derive(Clone, Copy, Debug)]
pub struct SphereGeodesic;

static PARAMETERS: [Parameter; 2] = [mass("m"), length("R")];

/// Catalogue entry.
pub const SPHERE: System = System {
    name: Cow::Borrowed("sphere-geodesic"),
    title: Cow::Borrowed("Geodesic on a sphere"),
    coordinates: PerSize::Rule(|_| {
        vec![Coordinate { periodic: false, ..Coordinate::angle("theta") }, Coordinate::angle("phi")]
    }),
    parameters: Cow::Borrowed(&PARAMETERS),
    size: Size::Fixed(2),
    time_unit: Cow::Borrowed("s"),
    time_like: None,
    constraint: None,
    training: PerSize::Rule(|_| Bounds {
        positions: vec![(0.1 * PI, 0.9 * PI), (-0.5 * PI, 2.5 * PI)],
        velocities: vec![(-5.0, 5.0), (-5.0, 5.0)],
    }),
    validation: PerSize::Rule(|_| Bounds {
        positions: vec![(0.1 * PI, 0.9 * PI), (0.0, 2.0 * PI)],
        velocities: vec![(-5.0, 5.0), (-5.0, 5.0)],
    }),
    trajectory: PerSize::Rule(|_| TrajectoryTest {
        start: Bounds {
            positions: vec![(0.25 * PI, 0.75 * PI), (0.0, 2.0 * PI)],
            velocities: vec![(-2.0, 2.0), (-2.0, 2.0)],
        },
        t_end: 20.0,
        dt: 0.05,
    }),
    domain: Some(|_, q| if q[0].sin() != 0.0 { Ok(()) } else { Err("theta must keep away from the poles") }),
    // Seen from the side, from far along the negative y axis.
    plane: Some(Plane {
        labels: ["x [m]", "z [m]"],
        point: |parameters, q| match *parameters {
            [_, radius] => (radius * q[0].sin() * q[1].cos(), radius * q[0].cos()),
            _ => NOWHERE,
        },
    }),
    // A relative error d of this vector bounds the angle between motion and great circle, and the relative error of the speed.
    conserved: Some(Conserved {
        name: "angular momentum [kg m^2/s]",
        vector: |parameters, q, v| {
            let &[m, radius] = parameters else { return vec![f64::NAN] };
            angular_velocity([q[0], q[1]], [v[0], v[1]]).map(|x| m * radius * radius * x).to_vec()
        },
    }),
    learning: LearningAdvice {
        // Near the poles the azimuth changes fast, and most great circles of the test are slower than states in the box.
        states: Some(|bounds| {
            bounds.velocities[1] = (-6.5, 6.5);
            StateAdvice { log_uniform: Vec::new(), acceleration_weighting: 0.3, trajectory_fraction: 0.5, shell: None }
        }),
        paper: Some(PaperBudget { states: 50_000, hidden: &[500; 3], phases: &[PaperPhase::new(50, 1e-3, 1e-6)] }),
        ..LearningAdvice::NONE
    },
    described: None,
};

impl Lagrangian for SphereGeodesic {
    const COORDINATES: Option<usize> = Some(2);

    fn coordinates(&self) -> usize {
        2
    }
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [m, radius] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        R::half() * m * radius.sqr() * (v[0].sqr() + (q[0].sin() * v[1]).sqr())
    }
}

impl ClosedForm for SphereGeodesic {
    fn acceleration<R: Real>(&self, _parameters: &[R], q: &[R], v: &[R]) -> Vec<R> {
        let (sin, cos) = q[0].sin_cos();
        vec![sin * cos * v[1].sqr(), -R::two() * (cos / sin) * v[0] * v[1]]
    }
}
