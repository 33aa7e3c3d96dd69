//! Systems with their formulas, and motion made of them.

use lnn::formula::{Families, FormulaOptions};
use lnn::lagrangian::{Dissipation, EulerLagrange, ExpressionLagrangian, Lagrangian, Mechanics, Rayleigh, WithForces};
use lnn::recording::{RecordedTrajectory, Recording};
use lnn::rollout::{RolloutOptions, rollout_many};
use lnn::scalar::Real;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A system that motion is made of.
#[derive(Clone)]
pub struct Case {
    pub name: &'static str,
    pub coordinates: &'static [&'static str],
    pub periodic: &'static [bool],
    pub lagrangian: &'static str,
    /// Rayleigh's function of coordinates and velocities; empty without friction.
    pub dissipation: &'static str,
    /// Terms with their coefficients, those of the dissipation function with `D:` before them.
    pub truth: &'static [(&'static str, f64)],
    /// Lowest and highest start of coordinates, then of velocities.
    pub starts: &'static [[f64; 2]],
    /// Families of functions; the usual ones if empty.
    pub basis: &'static str,
}

/// How motion is recorded.
#[derive(Clone, Copy)]
pub struct Recorded {
    pub runs: usize,
    pub seconds: f64,
    pub rate: f64,
    /// Noise of every coordinate.
    pub sigma: f64,
    pub seed: u64,
    /// Known sinusoidal forces of this size on every coordinate.
    pub force: f64,
}

struct Friction(ExpressionLagrangian);

impl Dissipation for Friction {
    fn dissipation<R: Real>(&self, q: &[R], v: &[R]) -> R {
        self.0.lagrangian(&[], q, v)
    }
}

impl Case {
    fn model(&self) -> Box<dyn EulerLagrange<f64>> {
        let formula = |text: &str| ExpressionLagrangian::new(self.coordinates, &[], text).expect("a formula");
        let model = Mechanics::new(formula(self.lagrangian), Vec::<f64>::new());
        match self.dissipation {
            "" => Box::new(model),
            text => Box::new(WithForces::new(model, Rayleigh(Friction(formula(text))))),
        }
    }

    /// Positions alone, with independent noise.
    pub fn record(&self, how: Recorded) -> Recording {
        let n = self.coordinates.len();
        let mut rng = ChaCha8Rng::seed_from_u64(how.seed);
        let model = self.model();
        let mut draw = |bounds: &[f64; 2]| bounds[0] + (bounds[1] - bounds[0]) * rng.random::<f64>();
        let starts: Vec<(Vec<f64>, Vec<f64>)> = (0..how.runs)
            .map(|_| {
                let state: Vec<f64> = self.starts.iter().map(&mut draw).collect();
                (state[..n].to_vec(), state[n..].to_vec())
            })
            .collect();
        let step = 1.0 / how.rate;
        let tracks = if how.force > 0.0 {
            let made = starts.iter().map(|start| self.driven(&*model, start, how, &mut rng));
            made.collect()
        } else {
            let options = RolloutOptions::reference(how.seconds, step).energy(false);
            let motions = rollout_many(&*model, &starts, &options, 2);
            let tracks = motions.into_iter().enumerate().map(|(k, motion)| {
                let motion = motion.trajectory;
                RecordedTrajectory {
                    name: k.to_string(),
                    times: motion.t,
                    q: motion.q,
                    v: vec![],
                    a: vec![],
                    force: vec![],
                }
            });
            tracks.collect::<Vec<_>>()
        };
        let mut tracks: Vec<RecordedTrajectory> = tracks;
        for x in tracks.iter_mut().flat_map(|track| &mut track.q) {
            let noise: f64 = StandardNormal.sample(&mut rng);
            *x += how.sigma * noise;
        }
        let coordinates = self.coordinates.iter().map(ToString::to_string).collect();
        Recording { coordinates, periodic: self.periodic.to_vec(), tracks }
    }

    /// A motion under a force that is a sum of three waves per coordinate.
    fn driven(
        &self,
        model: &dyn EulerLagrange<f64>,
        (q, v): &(Vec<f64>, Vec<f64>),
        how: Recorded,
        rng: &mut ChaCha8Rng,
    ) -> RecordedTrajectory {
        let n = q.len();
        let waves: Vec<[f64; 3]> = (0..3 * n)
            .map(|_| [how.force * rng.random_range(-1.0..1.0), rng.random_range(1.0..8.0), rng.random_range(0.0..6.3)])
            .collect();
        let force =
            |t: f64, i: usize| waves[3 * i..3 * i + 3].iter().map(|[a, w, p]| a * (w * t + p).sin()).sum::<f64>();
        let step = 1.0 / how.rate;
        let samples = (how.seconds * how.rate).round() as usize + 1;
        let (mut q, mut v) = (q.clone(), v.clone());
        let mut track =
            RecordedTrajectory { name: "driven".into(), times: vec![], q: vec![], v: vec![], a: vec![], force: vec![] };
        let slope = |t: f64, q: &[f64], v: &[f64]| {
            let mut terms = lnn::lagrangian::Terms::default();
            let request = lnn::lagrangian::Request::MASS_MATRIX | lnn::lagrangian::Request::ACCELERATION;
            model.terms(q, v, request, &mut terms).expect("a regular state");
            let mut extra: Vec<f64> = (0..n).map(|i| force(t, i)).collect();
            let mut workspace = lnn::linalg::Workspace::new();
            let right = extra.clone();
            lnn::linalg::solve(n, &terms.mass_matrix, &right, &mut extra, &mut workspace).expect("a regular matrix");
            terms.acceleration.iter().zip(&extra).map(|(a, e)| a + e).collect::<Vec<f64>>()
        };
        let moved = |x: &[f64], h: f64, d: &[f64]| x.iter().zip(d).map(|(x, d)| x + h * d).collect::<Vec<f64>>();
        const PARTS: usize = 4;
        for sample in 0..samples {
            let t = sample as f64 * step;
            track.times.push(t);
            track.q.extend(&q);
            track.force.extend((0..n).map(|i| force(t, i)));
            let h = step / PARTS as f64;
            for part in 0..PARTS {
                let t = t + part as f64 * h;
                let a1 = slope(t, &q, &v);
                let (q2, v2) = (moved(&q, h / 2.0, &v), moved(&v, h / 2.0, &a1));
                let a2 = slope(t + h / 2.0, &q2, &v2);
                let (q3, v3) = (moved(&q, h / 2.0, &v2), moved(&v, h / 2.0, &a2));
                let a3 = slope(t + h / 2.0, &q3, &v3);
                let (q4, v4) = (moved(&q, h, &v3), moved(&v, h, &a3));
                let a4 = slope(t + h, &q4, &v4);
                for i in 0..n {
                    q[i] += h / 6.0 * (v[i] + 2.0 * v2[i] + 2.0 * v3[i] + v4[i]);
                    v[i] += h / 6.0 * (a1[i] + 2.0 * a2[i] + 2.0 * a3[i] + a4[i]);
                }
            }
        }
        track
    }

    pub fn options(&self, seed: u64) -> FormulaOptions {
        let families =
            Some(if self.basis.is_empty() { Families::default() } else { self.basis.parse().expect("families") });
        FormulaOptions {
            families,
            friction: !self.dissipation.is_empty(),
            seed,
            threads: 2,
            ..FormulaOptions::default()
        }
    }
}

const PI: f64 = std::f64::consts::PI;
const TURN: [f64; 2] = [-PI, PI];
const REST: [f64; 2] = [0.0, 0.0];

pub const PENDULUM: Case = Case {
    name: "pendulum",
    coordinates: &["a"],
    periodic: &[true],
    lagrangian: "a_dot^2/2 + 9.81*cos(a)",
    dissipation: "",
    truth: &[("a_dot^2", 0.5), ("cos(a)", 9.81)],
    starts: &[TURN, REST],
    basis: "",
};

pub const CART: Case = Case {
    name: "cart-pendulum",
    coordinates: &["x", "a"],
    periodic: &[false, true],
    lagrangian: "x_dot^2 + x_dot*a_dot*cos(a) + a_dot^2/2 + 9.81*cos(a)",
    dissipation: "",
    truth: &[("x_dot^2", 1.0), ("a_dot^2", 0.5), ("x_dot*a_dot*cos(a)", 1.0), ("cos(a)", 9.81)],
    starts: &[[-1.0, 1.0], TURN, REST, REST],
    basis: "",
};

pub const DOUBLE: Case = Case {
    name: "double pendulum",
    coordinates: &["a", "b"],
    periodic: &[true, true],
    lagrangian: "a_dot^2 + b_dot^2/2 + a_dot*b_dot*cos(a - b) + 19.62*cos(a) + 9.81*cos(b)",
    dissipation: "",
    truth: &[("a_dot^2", 1.0), ("b_dot^2", 0.5), ("a_dot*b_dot*cos(a - b)", 1.0), ("cos(a)", 19.62), ("cos(b)", 9.81)],
    starts: &[TURN, TURN, REST, REST],
    basis: "",
};

pub const SPHERICAL: Case = Case {
    name: "spherical pendulum",
    coordinates: &["a", "b"],
    periodic: &[true, true],
    lagrangian: "a_dot^2/2 + sin(a)^2*b_dot^2/2 + 9.81*cos(a)",
    dissipation: "",
    truth: &[("a_dot^2", 0.5), ("b_dot^2*sin(a)^2", 0.5), ("cos(a)", 9.81)],
    starts: &[[PI / 3.0, PI / 2.0], TURN, REST, [2.0, 4.0]],
    basis: "",
};

/// What positions alone must show, with the noise in rad and m.
pub const POSITIONS: [(Case, f64); 5] =
    [(PENDULUM, 0.06), (CART, 0.04), (DOUBLE, 0.06), (DOUBLE, 0.1), (SPHERICAL, 0.02)];

/// The same with friction in the joints.
pub const FRICTION: [(Case, f64); 4] = [
    (
        Case {
            dissipation: "0.1*a_dot^2",
            truth: &[("a_dot^2", 0.5), ("cos(a)", 9.81), ("D:a_dot^2", 0.1)],
            ..PENDULUM
        },
        0.03,
    ),
    (
        Case {
            dissipation: "0.2*x_dot^2 + 0.1*a_dot^2",
            truth: &[
                ("x_dot^2", 1.0),
                ("a_dot^2", 0.5),
                ("x_dot*a_dot*cos(a)", 1.0),
                ("cos(a)", 9.81),
                ("D:x_dot^2", 0.2),
                ("D:a_dot^2", 0.1),
            ],
            ..CART
        },
        0.02,
    ),
    (
        Case {
            dissipation: "0.1*a_dot^2 + 0.1*(b_dot - a_dot)^2",
            truth: &[
                ("a_dot^2", 1.0),
                ("b_dot^2", 0.5),
                ("a_dot*b_dot*cos(a - b)", 1.0),
                ("cos(a)", 19.62),
                ("cos(b)", 9.81),
                ("D:a_dot^2", 0.2),
                ("D:a_dot*b_dot", -0.2),
                ("D:b_dot^2", 0.1),
            ],
            ..DOUBLE
        },
        0.03,
    ),
    (
        Case {
            dissipation: "0.05*a_dot^2",
            truth: &[("a_dot^2", 0.5), ("b_dot^2*sin(a)^2", 0.5), ("cos(a)", 9.81), ("D:a_dot^2", 0.05)],
            ..SPHERICAL
        },
        0.01,
    ),
];

/// Systems that the library holds, from clean states and at a noise of 1e-3.
pub const CLEAN: [Case; 6] = [
    Case {
        name: "triple pendulum",
        coordinates: &["a", "b", "c"],
        periodic: &[true, true, true],
        lagrangian: "1.5*a_dot^2 + b_dot^2 + c_dot^2/2 + 2*a_dot*b_dot*cos(a - b) + a_dot*c_dot*cos(a - c) + b_dot*c_dot*cos(b - c) + 29.43*cos(a) + 19.62*cos(b) + 9.81*cos(c)",
        dissipation: "",
        truth: &[
            ("a_dot^2", 1.5),
            ("b_dot^2", 1.0),
            ("c_dot^2", 0.5),
            ("a_dot*b_dot*cos(a - b)", 2.0),
            ("a_dot*c_dot*cos(a - c)", 1.0),
            ("b_dot*c_dot*cos(b - c)", 1.0),
            ("cos(a)", 29.43),
            ("cos(b)", 19.62),
            ("cos(c)", 9.81),
        ],
        starts: &[TURN, TURN, TURN, REST, REST, REST],
        basis: "",
    },
    Case {
        name: "Kepler",
        coordinates: &["x", "y"],
        periodic: &[false, false],
        lagrangian: "(x_dot^2 + y_dot^2)/2 + 1/sqrt(x^2 + y^2)",
        dissipation: "",
        truth: &[("x_dot^2", 0.5), ("y_dot^2", 0.5), ("sqrt(x^2 + y^2)^(-1)", 1.0)],
        starts: &[[0.8, 1.2], [-0.2, 0.2], [-0.2, 0.2], [0.8, 1.1]],
        basis: "polynomial:2,radial:3",
    },
    Case {
        name: "Henon-Heiles",
        coordinates: &["x", "y"],
        periodic: &[false, false],
        lagrangian: "(x_dot^2 + y_dot^2 - x^2 - y^2)/2 - x^2*y + y^3/3",
        dissipation: "",
        truth: &[("x_dot^2", 0.5), ("y_dot^2", 0.5), ("x^2", -0.5), ("y^2", -0.5), ("x^2*y", -1.0), ("y^3", 1.0 / 3.0)],
        starts: &[[-0.3, 0.3], [-0.3, 0.3], [-0.3, 0.3], [-0.3, 0.3]],
        basis: "polynomial:3",
    },
    Case {
        name: "charged particle",
        coordinates: &["x", "y"],
        periodic: &[false, false],
        lagrangian: "(x_dot^2 + y_dot^2)/2 + (x*y_dot - y*x_dot)/2 + 0.3*x",
        dissipation: "",
        truth: &[("x_dot^2", 0.5), ("y_dot^2", 0.5), ("x_dot*y", -1.0), ("x", 0.3)],
        starts: &[[-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0]],
        basis: "",
    },
    Case {
        name: "spring pendulum",
        coordinates: &["r", "a"],
        periodic: &[false, true],
        lagrangian: "(r_dot^2 + r^2*a_dot^2)/2 - 20*(r - 1)^2 + 9.81*r*cos(a)",
        dissipation: "",
        truth: &[("r_dot^2", 0.5), ("a_dot^2*r^2", 0.5), ("r", 40.0), ("r^2", -20.0), ("r*cos(a)", 9.81)],
        starts: &[[1.0, 1.5], [-1.0, 1.0], REST, [-1.0, 1.0]],
        basis: "",
    },
    Case {
        name: "bead on a hoop",
        coordinates: &["a"],
        periodic: &[true],
        lagrangian: "a_dot^2/2 + 8*sin(a)^2 + 9.81*cos(a)",
        dissipation: "",
        truth: &[("a_dot^2", 0.5), ("cos(a)", 9.81), ("cos(2*a)", -4.0)],
        starts: &[TURN, REST],
        basis: "",
    },
];

/// A cart with two damped pendula side by side.
pub const CART_POLES: Case = Case {
    name: "damped double cart-pole",
    coordinates: &["x", "a", "b"],
    periodic: &[false, true, true],
    lagrangian: "1.5*x_dot^2 + a_dot^2/2 + b_dot^2/4 + x_dot*a_dot*cos(a) + 0.7*x_dot*b_dot*cos(b) + 9.81*cos(a) + 6.87*cos(b)",
    dissipation: "0.3*x_dot^2 + 0.05*a_dot^2 + 0.05*b_dot^2",
    truth: &[
        ("x_dot^2", 1.5),
        ("a_dot^2", 0.5),
        ("b_dot^2", 0.25),
        ("x_dot*a_dot*cos(a)", 1.0),
        ("x_dot*b_dot*cos(b)", 0.7),
        ("cos(a)", 9.81),
        ("cos(b)", 6.87),
        ("D:x_dot^2", 0.3),
        ("D:a_dot^2", 0.05),
        ("D:b_dot^2", 0.05),
    ],
    starts: &[[-1.0, 1.0], TURN, TURN, REST, REST, REST],
    basis: "",
};

const fn outside(
    name: &'static str,
    coordinates: &'static [&'static str],
    periodic: &'static [bool],
    lagrangian: &'static str,
    starts: &'static [[f64; 2]],
) -> Case {
    Case { name, coordinates, periodic, lagrangian, dissipation: "", truth: &[], starts, basis: "" }
}

const WIDE: [f64; 2] = [-2.0, 2.0];

/// Systems that the usual library does not hold.
pub const OUTSIDE: [Case; 10] = [
    outside("quartic well", &["x"], &[false], "x_dot^2/2 + x^2 - x^4/4", &[WIDE, WIDE]),
    outside("Morse oscillator", &["x"], &[false], "x_dot^2/2 - 2*(1 - exp(-x))^2", &[[-0.5, 1.0], [-0.5, 0.5]]),
    outside(
        "Kepler, without radial functions",
        &["x", "y"],
        &[false, false],
        "(x_dot^2 + y_dot^2)/2 + 1/sqrt(x^2 + y^2)",
        &[[0.8, 1.2], [-0.2, 0.2], [-0.2, 0.2], [0.8, 1.1]],
    ),
    outside("third harmonic", &["a"], &[true], "a_dot^2/2 + 5*cos(a) + 3*cos(3*a)", &[TURN, REST]),
    outside("wave on a line", &["x"], &[false], "x_dot^2/2 + 3*cos(3*x)", &[WIDE, WIDE]),
    outside("position-dependent mass", &["x"], &[false], "x_dot^2/(2*(1 + x^2)) - x^2", &[WIDE, REST]),
    outside("relativistic oscillator", &["x"], &[false], "-sqrt(1 - x_dot^2) - x^2/2", &[[-1.5, 1.5], REST]),
    outside(
        "bead in a Gaussian well",
        &["x", "y"],
        &[false, false],
        "(x_dot^2 + y_dot^2)/2 + 3*exp(-x^2 - 2*y^2)",
        &[[-1.0, 1.0], [-1.0, 1.0], REST, REST],
    ),
    outside(
        "Toda chain",
        &["x", "y"],
        &[false, false],
        "(x_dot^2 + y_dot^2)/2 - exp(x - y) - exp(y) - exp(-x)",
        &[WIDE, WIDE, REST, REST],
    ),
    outside("quartic velocity", &["x"], &[false], "x_dot^2/2 + x_dot^4/10 - x^2", &[WIDE, REST]),
];

/// A metric that is known, and how its formula is looked for.
pub struct Metric {
    /// Name of the system.
    pub name: &'static str,
    pub basis: &'static str,
    pub functions: &'static [&'static str],
    pub truth: &'static [(&'static str, f64)],
}

/// Metrics of a sphere and of spacetimes; a mass inside a function is given.
pub const METRICS: [Metric; 4] = [
    Metric {
        name: "sphere-geodesic",
        basis: "trigonometric:2",
        functions: &["sin(theta)^2"],
        truth: &[("theta_dot^2", 0.5), ("phi_dot^2*(sin(theta)^2)", 0.5)],
    },
    Metric {
        name: "ads4-geodesic",
        basis: "polynomial:2",
        functions: &["1/z", "1/z^2", "1/z^3"],
        truth: &[
            ("t_dot^2*(1/z^2)", -0.5),
            ("x_dot^2*(1/z^2)", 0.5),
            ("y_dot^2*(1/z^2)", 0.5),
            ("z_dot^2*(1/z^2)", 0.5),
        ],
    },
    Metric {
        name: "schwarzschild-geodesic",
        basis: "polynomial:0",
        functions: &["1/r", "r", "r^2", "r^2*sin(theta)^2", "r/(r - 2)", "sin(theta)^2"],
        truth: &[
            ("t_dot^2", -0.5),
            ("t_dot^2*(1/r)", 1.0),
            ("r_dot^2*(r/(r - 2))", 0.5),
            ("theta_dot^2*(r^2)", 0.5),
            ("phi_dot^2*(r^2*sin(theta)^2)", 0.5),
        ],
    },
    // Of z^2/r^3 the sum of the squares makes 1/r.
    Metric {
        name: "schwarzschild-cartesian",
        basis: "polynomial:0",
        functions: &[
            "1/sqrt(x^2 + y^2 + z^2)",
            "x/(x^2 + y^2 + z^2)",
            "y/(x^2 + y^2 + z^2)",
            "z/(x^2 + y^2 + z^2)",
            "x^2/sqrt(x^2 + y^2 + z^2)^3",
            "y^2/sqrt(x^2 + y^2 + z^2)^3",
            "x*y/sqrt(x^2 + y^2 + z^2)^3",
            "x*z/sqrt(x^2 + y^2 + z^2)^3",
            "y*z/sqrt(x^2 + y^2 + z^2)^3",
        ],
        truth: &[
            ("t_dot^2", -0.5),
            ("x_dot^2", 0.5),
            ("y_dot^2", 0.5),
            ("z_dot^2", 0.5),
            ("t_dot^2*(1/sqrt(x^2 + y^2 + z^2))", 1.0),
            ("t_dot*x_dot*(x/(x^2 + y^2 + z^2))", 2.0),
            ("t_dot*y_dot*(y/(x^2 + y^2 + z^2))", 2.0),
            ("t_dot*z_dot*(z/(x^2 + y^2 + z^2))", 2.0),
            ("x_dot^2*(x^2/sqrt(x^2 + y^2 + z^2)^3)", 1.0),
            ("y_dot^2*(y^2/sqrt(x^2 + y^2 + z^2)^3)", 1.0),
            ("x_dot*y_dot*(x*y/sqrt(x^2 + y^2 + z^2)^3)", 2.0),
            ("x_dot*z_dot*(x*z/sqrt(x^2 + y^2 + z^2)^3)", 2.0),
            ("y_dot*z_dot*(y*z/sqrt(x^2 + y^2 + z^2)^3)", 2.0),
            ("z_dot^2*(1/sqrt(x^2 + y^2 + z^2))", 1.0),
            ("z_dot^2*(x^2/sqrt(x^2 + y^2 + z^2)^3)", -1.0),
            ("z_dot^2*(y^2/sqrt(x^2 + y^2 + z^2)^3)", -1.0),
        ],
    },
];
