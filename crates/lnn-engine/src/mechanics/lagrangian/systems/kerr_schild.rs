//! Free fall in the field of a black hole, with or without spin and charge, in Cartesian Kerr-Schild coordinates.

use super::{length, lengths};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, Conserved, LearningAdvice, Parameter, PerSize, Plane, Range, ShellAdvice, Size, StateAdvice,
    System, TrajectoryTest,
};
use crate::scalar::{Real, Scalar};
use alloc::borrow::Cow;
use alloc::vec::Vec;

/// `L = (-t'^2 + x'^2 + y'^2 + z'^2 + f (t' + l.v)^2)/2`, `f = (2 M r - Q^2)/Sigma`, per unit of mass.
///
/// Here `l = ((r x + a y)/(r^2 + a^2), (r y - a x)/(r^2 + a^2), z/r)`, `r` is the root of `(x^2 + y^2)/(r^2 + a^2) + z^2/r^2 = 1`, and
/// `Sigma = r^2 + a^2 z^2/r^2`. The covector `(1, l)` is null and points inward, so that nothing is singular on a horizon or an axis. `' =
/// d/dtau` with the proper time `tau`; in geometric units with `G = c = 1` everything is in metres.
///
/// Source: Kerr and Schild, Proc. Symp. Appl. Math. 17, 199 (1965); Visser, arXiv:0706.0622, eq. (32)-(35).
#[derive(Clone, Copy, Debug)]
pub enum KerrSchild {
    /// Mass `M`.
    Schwarzschild,
    /// Mass `M` and angular momentum per mass `a` along `z`.
    Kerr,
    /// Mass `M` and charge `Q`; the falling matter has no charge.
    ReissnerNordstrom,
}

const MASS: Parameter = length("M");
const SPIN: Parameter = Parameter::new("a", "0.9", "m", Range::Any);
const CHARGE: Parameter = Parameter::new("Q", "0.5", "m", Range::Any);

static OF_SCHWARZSCHILD: [Parameter; 1] = [MASS];
static OF_KERR: [Parameter; 2] = [MASS, SPIN];
static OF_REISSNER_NORDSTROM: [Parameter; 2] = [MASS, CHARGE];

const CONSTRAINT: &str = "t_dot = C/(sqrt(b^2 + (1 - f) C) - b), b = f l.v, C = 1 + v^2 + f (l.v)^2";

fn bounds(positions: [(f64, f64); 4], velocity: (f64, f64)) -> Bounds {
    // The velocity of t follows from the mass shell.
    Bounds { positions: positions.to_vec(), velocities: vec![(0.0, 0.0), velocity, velocity, velocity] }
}

fn states(_: usize) -> Bounds {
    bounds([(-10.0, 10.0), (3.0, 15.0), (-8.0, 8.0), (-8.0, 8.0)], (-0.5, 0.5))
}

/// Catalogue entry.
pub const fn system(hole: KerrSchild) -> System {
    let (name, title, parameters): (_, _, &'static [Parameter]) = match hole {
        KerrSchild::Schwarzschild => {
            ("schwarzschild-cartesian", "Geodesic of the Schwarzschild metric, Cartesian", &OF_SCHWARZSCHILD)
        }
        KerrSchild::Kerr => ("kerr-cartesian", "Geodesic of the Kerr metric, Cartesian", &OF_KERR),
        KerrSchild::ReissnerNordstrom => (
            "reissner-nordstrom-cartesian",
            "Geodesic of the Reissner-Nordstrom metric, Cartesian",
            &OF_REISSNER_NORDSTROM,
        ),
    };
    System {
        name: Cow::Borrowed(name),
        title: Cow::Borrowed(title),
        coordinates: PerSize::Rule(|_| lengths(&["t", "x", "y", "z"])),
        parameters: Cow::Borrowed(parameters),
        size: Size::Fixed(4),
        time_unit: Cow::Borrowed("m"),
        time_like: Some(0),
        constraint: Some(CONSTRAINT),
        training: PerSize::Rule(states),
        validation: PerSize::Rule(states),
        trajectory: PerSize::Rule(|_| TrajectoryTest {
            start: bounds([(0.0, 0.0), (6.0, 12.0), (-2.0, 2.0), (-2.0, 2.0)], (-0.1, 0.1)),
            t_end: 5.0,
            dt: 0.05,
        }),
        domain: Some(match hole {
            KerrSchild::Schwarzschild => |parameters, q| away(KerrSchild::Schwarzschild, parameters, q),
            KerrSchild::Kerr => |parameters, q| away(KerrSchild::Kerr, parameters, q),
            KerrSchild::ReissnerNordstrom => |parameters, q| away(KerrSchild::ReissnerNordstrom, parameters, q),
        }),
        plane: Some(Plane { labels: ["x [m]", "y [m]"], point: |_, q| (q[1], q[2]) }),
        conserved: Some(match hole {
            KerrSchild::Schwarzschild => Conserved {
                name: TURNING,
                vector: |parameters, q, v| KerrSchild::Schwarzschild.turning(parameters, q, v),
            },
            KerrSchild::ReissnerNordstrom => Conserved {
                name: TURNING,
                vector: |parameters, q, v| KerrSchild::ReissnerNordstrom.turning(parameters, q, v),
            },
            KerrSchild::Kerr => Conserved {
                name: "energy, angular momentum about z and root of Carter's constant K per mass [1, m, m]",
                vector: |parameters, q, v| {
                    let momenta = KerrSchild::Kerr.turning(parameters, q, v);
                    let carter = KerrSchild::Kerr.carter(parameters, q, v).unwrap_or(f64::NAN);
                    vec![momenta[0], momenta.last().copied().unwrap_or(f64::NAN), carter.max(0.0).sqrt()]
                },
            },
        }),
        learning: LearningAdvice {
            states: Some(match hole {
                // The ring singularity of a spinning hole lies at R = a.
                KerrSchild::Kerr => |_| around(1.35),
                KerrSchild::Schwarzschild | KerrSchild::ReissnerNordstrom => |_| around(1.2),
            }),
            ..LearningAdvice::NONE
        },
        described: None,
    }
}

/// States from inside the horizon out to where the periastron advance is small.
fn around(low: f64) -> StateAdvice {
    StateAdvice {
        log_uniform: Vec::new(),
        acceleration_weighting: 1.0,
        trajectory_fraction: 0.0,
        shell: Some(ShellAdvice { coordinates: Cow::Borrowed(&[1, 2, 3]), radius: (low, 110.0), rapidity: 1.2 }),
    }
}

const TURNING: &str = "energy and angular momentum per mass [1, m]";

/// Rejects the ring singularity, `r = 0`.
fn away(hole: KerrSchild, parameters: &[f64], q: &[f64]) -> Result<(), &'static str> {
    match hole.field(parameters, q) {
        Some(field) if field.r > 0.0 && field.sigma > 0.0 => Ok(()),
        _ => Err("x, y and z must keep away from the ring r = 0"),
    }
}

/// The field of the black hole at a position.
struct Field<R> {
    mass: R,
    spin: R,
    charge: R,
    /// `r`.
    r: R,
    /// `Sigma`.
    sigma: R,
    /// `f`.
    f: R,
    /// `l_x`, `l_y`, `l_z`.
    l: [R; 3],
}

fn dot<R: Real>(a: [R; 3], b: [R; 3]) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the last three of four numbers.
fn space<R: Real>(x: &[R]) -> [R; 3] {
    [x[1], x[2], x[3]]
}

impl KerrSchild {
    fn constants<R: Real>(self, parameters: &[R]) -> Option<(R, R, R)> {
        match (self, parameters) {
            (Self::Schwarzschild, &[mass]) => Some((mass, R::zero(), R::zero())),
            (Self::Kerr, &[mass, spin]) => Some((mass, spin, R::zero())),
            (Self::ReissnerNordstrom, &[mass, charge]) => Some((mass, R::zero(), charge)),
            _ => None,
        }
    }

    fn field<R: Real>(self, parameters: &[R], q: &[R]) -> Option<Field<R>> {
        let (mass, spin, charge) = self.constants(parameters)?;
        let [x, y, z] = space(q);
        let square = x.sqr() + y.sqr() + z.sqr();
        let (r, sigma, l) = match self {
            Self::Kerr => {
                let height = spin * z;
                let w = square - spin.sqr();
                let sigma = (w.sqr() + (height + height).sqr()).sqrt();
                let r = ((w + sigma) * R::half()).sqrt();
                let h = r.sqr() + spin.sqr();
                (r, sigma, [(r * x + spin * y) / h, (r * y - spin * x) / h, z / r])
            }
            Self::Schwarzschild | Self::ReissnerNordstrom => {
                let r = square.sqrt();
                (r, square, [x / r, y / r, z / r])
            }
        };
        let f = (R::two() * mass * r - charge.sqr()) / sigma;
        Some(Field { mass, spin, charge, r, sigma, f, l })
    }

    /// Returns `-p_t` and `x * p`, with the momenta of `L`.
    fn turning(self, parameters: &[f64], q: &[f64], v: &[f64]) -> Vec<f64> {
        let Some(Field { f, l, .. }) = self.field(parameters, q) else { return vec![f64::NAN] };
        let ([x, y, z], u) = (space(q), space(v));
        let along = f * (v[0] + dot(l, u));
        let [p, s, k] = [u[0] + along * l[0], u[1] + along * l[1], u[2] + along * l[2]];
        vec![v[0] - along, y * k - z * s, z * p - x * k, x * s - y * p]
    }

    /// Carter's constant `K = (l.v) (Delta (l.v) - 2 Sigma r') + r^2 g(v, v)` with `l.v = t' + l_x x' + ..` and
    /// `Delta = r^2 - 2 M r + a^2 + Q^2`. It is never negative for free fall slower than light, and `(L_z - a E)^2` in the equatorial plane.
    /// Returns `None` for a wrong number of parameters.
    ///
    /// Source: Walker and Penrose, Commun. Math. Phys. 18, 265 (1970).
    pub fn carter<R: Real>(self, parameters: &[R], q: &[R], v: &[R]) -> Option<R> {
        let field = self.field(parameters, q)?;
        let Field { mass, spin, charge, r, sigma, f, l } = field;
        let u = space(v);
        let along = v[0] + dot(l, u);
        let interval = dot(u, u) - v[0].sqr() + f * along.sqr();
        let delta = r.sqr() - R::two() * mass * r + spin.sqr() + charge.sqr();
        let outward = dot(field.slope(q), u);
        Some(along * (delta * along - R::two() * sigma * outward) + r.sqr() * interval)
    }
}

impl<R: Real> Field<R> {
    /// `dr/dx = r x/Sigma`, `dr/dy = r y/Sigma`, `dr/dz = (r^2 + a^2) z/(r Sigma)`.
    fn slope(&self, q: &[R]) -> [R; 3] {
        let [x, y, z] = space(q);
        let Self { spin, r, sigma, .. } = *self;
        [r * x / sigma, r * y / sigma, (r.sqr() + spin.sqr()) * z / (r * sigma)]
    }

    /// `df/dx_k` and `dl_i/dx_k` at `[i][k]`.
    fn slopes(&self, q: &[R]) -> ([R; 3], [[R; 3]; 3]) {
        let x = space(q);
        let Self { mass, spin, r, sigma, f, l, .. } = *self;
        let (slope, zero) = (self.slope(q), R::zero());
        let h = r.sqr() + spin.sqr();
        let f_slope = [0, 1, 2].map(|k| {
            let of_sigma = R::two() * (R::two() * r * slope[k] - x[k]);
            (R::two() * mass * slope[k] - f * of_sigma) / sigma
        });
        // d(r x + a y) and d(r y - a x) without the part from dr.
        let own = [[r, spin, zero], [-spin, r, zero]];
        let across = |i: usize| [0, 1, 2].map(|k| (slope[k] * (x[i] - R::two() * r * l[i]) + own[i][k]) / h);
        let along = [0, 1, 2].map(|k| {
            let direct = if k == 2 { R::one() } else { zero };
            (direct - l[2] * slope[k]) / r
        });
        (f_slope, [across(0), across(1), along])
    }
}

impl Lagrangian for KerrSchild {
    const COORDINATES: Option<usize> = Some(4);

    fn coordinates(&self) -> usize {
        4
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let Some(Field { f, l, .. }) = self.field(parameters, q) else { return R::constant(Scalar::nan()) };
        let u = space(v);
        R::half() * (dot(u, u) - v[0].sqr() + f * (v[0] + dot(l, u)).sqr())
    }
}

impl ClosedForm for KerrSchild {
    /// `a = eta^-1 b - f l^# (l^#.b)` with `l^# = eta^-1 l`, that is, the inverse of `eta + f l l` applied to `b_k = w^2 f_k/2 + f w
    /// (l_k.v) - (f' w + f l'.v) l_k - f w l_k'`, `w = l.v`, `_k = d/dx_k`.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R> {
        let Some(field) = self.field(parameters, q) else { return Vec::new() };
        let (f, l, u) = (field.f, field.l, space(v));
        let (f_slope, l_slope) = field.slopes(q);
        let w = v[0] + dot(l, u);
        let f_rate = dot(f_slope, u);
        let l_rate = l_slope.map(|row| dot(row, u));
        let common = f_rate * w + f * dot(l_rate, u);
        let b = [0, 1, 2].map(|k| {
            let column = [l_slope[0][k], l_slope[1][k], l_slope[2][k]];
            R::half() * w.sqr() * f_slope[k] + f * w * (dot(column, u) - l_rate[k]) - common * l[k]
        });
        let b_t = -common;
        let along = f * (dot(l, b) - b_t);
        vec![along - b_t, b[0] - along * l[0], b[1] - along * l[1], b[2] - along * l[2]]
    }

    /// Let `s = sqrt(b^2 + (1 - f) C)`, `b = f (l.v)`, `C = 1 + v^2 + f (l.v)^2`. Outside a horizon the result is the larger root `t' = (b
    /// + s)/(1 - f) = C/(s - b)`. Inside, where `f > 1`, it is the smaller root if the motion falls inward, and `NaN` otherwise.
    fn constrained_velocity<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Option<R> {
        let Field { f, l, .. } = self.field(parameters, q)?;
        let u = space(v);
        let along = dot(l, u);
        let (b, c) = (f * along, R::one() + dot(u, u) + f * along.sqr());
        let root = (b.sqr() + (R::one() - f) * c).sqrt();
        let found = b.select((b + root) / (R::one() - f), c / (root - b));
        Some(found.select(found, R::constant(Scalar::nan())))
    }
}

/// Catalogue entry.
pub const SCHWARZSCHILD_CARTESIAN: crate::lagrangian::system::System = system(KerrSchild::Schwarzschild);

/// Catalogue entry.
pub const KERR_CARTESIAN: crate::lagrangian::system::System = system(KerrSchild::Kerr);

/// Catalogue entry.
pub const REISSNER_NORDSTROM_CARTESIAN: crate::lagrangian::system::System = system(KerrSchild::ReissnerNordstrom);
