//! Spaces whose curvature is known, as text files, with their invariants written down.

use lnn::geometry::Geometry;
use lnn::lagrangian::{EulerLagrange, SystemInstance};
use lnn::pipeline::parse_system;
use lnn::scalar::{Dd, Real, Scalar};
use std::borrow::Cow;

/// Curvature scalar and Kretschmann's scalar at a point.
pub type Invariants = fn(q: &[Dd]) -> (Dd, Dd);

/// A metric by its file, points, and what is known of it.
pub struct Space {
    pub name: &'static str,
    pub coordinates: &'static [&'static str],
    /// The rest of the file.
    pub body: &'static str,
    pub points: &'static [&'static [f64]],
    pub invariants: Invariants,
    /// Constant sectional curvature, if that is so.
    pub constant: Option<f64>,
    /// `true` if Ricci's tensor vanishes.
    pub vacuum: bool,
}

pub fn dd(x: f64) -> Dd {
    Dd::of_f64(x)
}

impl Space {
    /// The file that describes it.
    pub fn file(&self) -> String {
        let coordinate = |name: &&str| {
            format!("[[coordinates]]\nname = \"{name}\"\nunit = \"m\"\nbounds = [-1, 1]\nvelocity_bounds = [-1, 1]\n\n")
        };
        let coordinates: String = self.coordinates.iter().map(coordinate).collect();
        let trajectory = "\n[trajectory]\nt_end = 1\ndt = 0.1\n";
        format!(
            "name = \"{}\"\ntitle = \"A space\"\ntime_unit = \"m\"\n\n{coordinates}{}{trajectory}",
            self.name, self.body
        )
    }

    pub fn model<S: Scalar>(&self) -> Box<dyn EulerLagrange<S>> {
        let system = parse_system(&self.file()).unwrap_or_else(|error| panic!("{}: {error:?}", self.name));
        SystemInstance::new(Cow::Owned(system), &[]).unwrap().build().unwrap()
    }

    pub fn at<S: Scalar>(&self, q: &[f64]) -> Geometry<S> {
        let q: Vec<S> = q.iter().map(|&x| S::of_f64(x)).collect();
        let rest = vec![S::of_f64(0.0); q.len()];
        Geometry::of(&*self.model::<S>(), &q, &rest).unwrap().remove(0).unwrap()
    }
}

fn flat(_: &[Dd]) -> (Dd, Dd) {
    (dd(0.0), dd(0.0))
}

/// `48 M^2/r^6`, `M = 1`.
fn schwarzschild(q: &[Dd]) -> (Dd, Dd) {
    (dd(0.0), dd(48.0) / q[1].powi(6))
}

/// `48 M^2 (r^2 - x^2) ((r^2 + x^2)^2 - 16 r^2 x^2)/(r^2 + x^2)^6`, `x = a cos theta`, `M = 1` (Henry 2000).
fn spinning(r: Dd, x: Dd) -> Dd {
    let (r, x) = (r.sqr(), x.sqr());
    dd(48.0) * (r - x) * ((r + x).sqr() - dd(16.0) * r * x) / (r + x).powi(6)
}

fn kerr(q: &[Dd]) -> (Dd, Dd) {
    (dd(0.0), spinning(q[1], dd(0.5) * q[2].cos()))
}

/// `r` of `(x^2 + y^2)/(r^2 + a^2) + z^2/r^2 = 1`, `cos theta = z/r`.
fn kerr_schild(q: &[Dd]) -> (Dd, Dd) {
    let (a, z) = (dd(0.5), q[3]);
    let rest = q[1].sqr() + q[2].sqr() + z.sqr() - a.sqr();
    let square = (rest + (rest.sqr() + dd(4.0) * (a * z).sqr()).sqrt()) * dd(0.5);
    let r = square.sqrt();
    (dd(0.0), spinning(r, a * z / r))
}

/// `48 M^2/r^6 - 96 M Q^2/r^7 + 56 Q^4/r^8`, `M = 1`, `Q^2 = 1/2`.
fn charged(q: &[Dd]) -> (Dd, Dd) {
    let (r, square) = (q[1], dd(0.5));
    let invariant = dd(48.0) / r.powi(6) - dd(96.0) * square / r.powi(7) + dd(56.0) * square.sqr() / r.powi(8);
    (dd(0.0), invariant)
}

/// `a = t^p`, `p = 2/3` and curved space, `k = 1`: `R = 6 (a''/a + (a'^2 + k)/a^2)`,
/// `K = 12 ((a''/a)^2 + ((a'^2 + k)/a^2)^2)`.
fn friedmann(q: &[Dd]) -> (Dd, Dd) {
    let (p, t) = (dd(2.0) / dd(3.0), q[0]);
    let accelerated = p * (p - dd(1.0)) / t.sqr();
    let expanded = p.sqr() / t.sqr() + t.powf(dd(-2.0) * p);
    (dd(6.0) * (accelerated + expanded), dd(12.0) * (accelerated.sqr() + expanded.sqr()))
}

/// `R = -1/a^2`, `K = 3/a^4`, `a = 2`.
fn goedel(_: &[Dd]) -> (Dd, Dd) {
    (dd(-0.25), dd(3.0) / dd(16.0))
}

/// All of them.
pub const SPACES: &[Space] = &[
    Space {
        name: "sphere",
        coordinates: &["theta", "phi"],
        body: "[metric]\n\"theta,theta\" = \"9\"\n\"phi,phi\" = \"9*sin(theta)^2\"\n",
        points: &[&[0.4, 1.0], &[1.5, -2.0], &[2.8, 7.0]],
        invariants: |_| (dd(2.0) / dd(9.0), dd(4.0) / dd(81.0)),
        constant: Some(1.0 / 9.0),
        vacuum: false,
    },
    Space {
        name: "line",
        coordinates: &["x"],
        body: "[metric]\n\"x,x\" = \"1 + x^2\"\n",
        points: &[&[0.4]],
        invariants: flat,
        constant: Some(0.0),
        vacuum: true,
    },
    Space {
        name: "de-sitter",
        coordinates: &["t", "r", "theta", "phi"],
        body: "[metric]\n\"t,t\" = \"-(1 - r^2/16)\"\n\"r,r\" = \"1/(1 - r^2/16)\"\n\"theta,theta\" = \"r^2\"\n\"phi,phi\" = \"r^2*sin(theta)^2\"\n",
        points: &[&[0.4, 1.5, 0.7, 2.0], &[0.4, 3.5, 2.0, 2.0], &[0.0, 5.0, 1.0, 0.0]],
        invariants: |_| (dd(12.0) / dd(16.0), dd(24.0) / dd(256.0)),
        constant: Some(1.0 / 16.0),
        vacuum: false,
    },
    Space {
        name: "anti-de-sitter-five",
        coordinates: &["t", "x", "y", "w", "z"],
        body: "[metric]\n\"t,t\" = \"-1/z^2\"\n\"x,x\" = \"1/z^2\"\n\"y,y\" = \"1/z^2\"\n\"w,w\" = \"1/z^2\"\n\"z,z\" = \"1/z^2\"\n",
        points: &[&[0.4, 1.5, 0.7, 2.0, 0.75], &[0.4, 1.5, 0.7, 2.0, 6.0]],
        invariants: |_| (dd(-20.0), dd(40.0)),
        constant: Some(-1.0),
        vacuum: false,
    },
    Space {
        name: "schwarzschild",
        coordinates: &["t", "r", "theta", "phi"],
        body: "[metric]\n\"t,t\" = \"-(1 - 2/r)\"\n\"r,r\" = \"1/(1 - 2/r)\"\n\"theta,theta\" = \"r^2\"\n\"phi,phi\" = \"r^2*sin(theta)^2\"\n",
        points: &[&[0.0, 2.125, 1.0, 0.0], &[3.0, 7.0, 2.0, 1.0], &[0.0, 1.0, 0.5, 0.0], &[0.0, 50.0, 0.5, 0.0]],
        invariants: schwarzschild,
        constant: None,
        vacuum: true,
    },
    Space {
        name: "kerr",
        coordinates: &["t", "r", "theta", "phi"],
        body: "[definitions]\nSigma = \"r^2 + 0.25*cos(theta)^2\"\nDelta = \"r^2 - 2*r + 0.25\"\ndrag = \"r*sin(theta)^2/Sigma\"\n\n[metric]\n\"t,t\" = \"-(1 - 2*r/Sigma)\"\n\"t,phi\" = \"-drag\"\n\"r,r\" = \"Sigma/Delta\"\n\"theta,theta\" = \"Sigma\"\n\"phi,phi\" = \"(r^2 + 0.25 + drag*0.5)*sin(theta)^2\"\n",
        points: &[&[0.0, 3.0, 1.0, 0.0], &[1.0, 1.9, 0.6, 2.0], &[0.0, 12.0, 2.5, 0.0], &[0.0, 0.75, 1.25, 0.0]],
        invariants: kerr,
        constant: None,
        vacuum: true,
    },
    Space {
        name: "kerr-schild",
        coordinates: &["t", "x", "y", "z"],
        body: "[definitions]\nrest = \"x^2 + y^2 + z^2 - 0.25\"\nr2 = \"(rest + sqrt(rest^2 + z^2))/2\"\nr = \"sqrt(r2)\"\nf = \"2*r^3/(r2^2 + 0.25*z^2)\"\nlx = \"(r*x + 0.5*y)/(r2 + 0.25)\"\nly = \"(r*y - 0.5*x)/(r2 + 0.25)\"\nlz = \"z/r\"\n\n[metric]\n\"t,t\" = \"-1 + f\"\n\"t,x\" = \"f*lx\"\n\"t,y\" = \"f*ly\"\n\"t,z\" = \"f*lz\"\n\"x,x\" = \"1 + f*lx^2\"\n\"x,y\" = \"f*lx*ly\"\n\"x,z\" = \"f*lx*lz\"\n\"y,y\" = \"1 + f*ly^2\"\n\"y,z\" = \"f*ly*lz\"\n\"z,z\" = \"1 + f*lz^2\"\n",
        points: &[&[0.0, 3.0, 1.0, 0.5], &[1.0, 0.5, -1.0, 1.25], &[0.0, -4.0, 3.0, -6.0]],
        invariants: kerr_schild,
        constant: None,
        vacuum: true,
    },
    Space {
        name: "reissner-nordstroem",
        coordinates: &["t", "r", "theta", "phi"],
        body: "[definitions]\nf = \"1 - 2/r + 0.5/r^2\"\n\n[metric]\n\"t,t\" = \"-f\"\n\"r,r\" = \"1/f\"\n\"theta,theta\" = \"r^2\"\n\"phi,phi\" = \"r^2*sin(theta)^2\"\n",
        points: &[&[0.0, 2.5, 1.0, 0.0], &[0.0, 9.0, 2.0, 0.0], &[0.0, 1.0, 2.0, 0.0]],
        invariants: charged,
        constant: None,
        vacuum: false,
    },
    Space {
        name: "friedmann",
        coordinates: &["t", "chi", "theta", "phi"],
        body: "[definitions]\na2 = \"t^(4/3)\"\n\n[metric]\n\"t,t\" = \"-1\"\n\"chi,chi\" = \"a2\"\n\"theta,theta\" = \"a2*sin(chi)^2\"\n\"phi,phi\" = \"a2*sin(chi)^2*sin(theta)^2\"\n",
        points: &[&[0.5, 1.0, 1.0, 0.0], &[4.0, 2.0, 2.0, 0.0]],
        invariants: friedmann,
        constant: None,
        vacuum: false,
    },
    Space {
        name: "goedel",
        coordinates: &["t", "x", "y", "z"],
        body: "[metric]\n\"t,t\" = \"-4\"\n\"t,y\" = \"-4*exp(x)\"\n\"x,x\" = \"4\"\n\"y,y\" = \"-2*exp(2*x)\"\n\"z,z\" = \"4\"\n",
        points: &[&[0.5, 1.0, 1.0, 0.0], &[4.0, -2.0, 2.0, 0.0]],
        invariants: goedel,
        constant: None,
        vacuum: false,
    },
    Space {
        name: "plane-wave",
        coordinates: &["u", "s", "x", "y"],
        body: "[metric]\n\"u,u\" = \"sin(u)*(x^2 - y^2) + cos(u)*x*y\"\n\"u,s\" = \"1\"\n\"x,x\" = \"1\"\n\"y,y\" = \"1\"\n",
        points: &[&[0.5, 1.0, 1.0, 0.5], &[4.0, -2.0, 2.0, -1.0]],
        invariants: flat,
        constant: None,
        vacuum: true,
    },
];
