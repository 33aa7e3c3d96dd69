//! Frames, and bodies by their ten constants about the origin of a frame.

use crate::lagrangian::{Matrix, Vector, applied, product, transposed};
use crate::linalg::{Workspace, inverse, is_positive_definite};

const SAME: Matrix<f64> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The place of a frame in another one: `x' = R x + p`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub turn: Matrix<f64>,
    pub at: Vector<f64>,
}

impl Place {
    pub const HERE: Self = Self { turn: SAME, at: [0.0; 3] };

    /// Composes this place with one that is relative to it.
    pub fn then(&self, next: &Self) -> Self {
        let at = applied(&self.turn, next.at);
        Self { turn: product(&self.turn, &next.turn), at: std::array::from_fn(|i| self.at[i] + at[i]) }
    }

    /// Roll, pitch and yaw, `R = Rot_z(yaw) Rot_y(pitch) Rot_x(roll)`.
    pub fn angles(&self) -> [f64; 3] {
        let r = &self.turn;
        let level = r[0][0].hypot(r[1][0]);
        let pitch = (-r[2][0]).atan2(level);
        // Where the x axis points up or down, roll and yaw are the same rotation.
        match level > f64::EPSILON {
            true => [r[2][1].atan2(r[2][2]), pitch, r[1][0].atan2(r[0][0])],
            false => [0.0, pitch, (-r[0][1]).atan2(r[1][1])],
        }
    }
}

/// Mass, first moments and inertia about the origin of a frame: `m`, `mx`, `my`, `mz`, `Ixx`, `Ixy`, `Ixz`, `Iyy`, `Iyz`, `Izz`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Body(pub [f64; 10]);

/// Difference between the inertia about the origin and the inertia about the centre of mass (Steiner): `m (c^2 - c c^T)`.
fn shifted(mass: f64, c: Vector<f64>) -> Matrix<f64> {
    let square: f64 = c.iter().map(|c| c * c).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| mass * (f64::from(u8::from(i == j)) * square - c[i] * c[j])))
}

fn sum(a: &Matrix<f64>, b: &Matrix<f64>, factor: f64) -> Matrix<f64> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + factor * b[i][j]))
}

impl Body {
    /// Creates a body from its mass, its centre of mass and the inertia about that.
    pub fn about(mass: f64, centre: Vector<f64>, inertia: &Matrix<f64>) -> Self {
        let i = sum(inertia, &shifted(mass, centre), 1.0);
        let [x, y, z] = centre.map(|c| mass * c);
        Self([mass, x, y, z, i[0][0], i[0][1], i[0][2], i[1][1], i[1][2], i[2][2]])
    }

    /// Mass, centre of mass and inertia about it; for a massless body only the inertia can differ from 0.
    pub fn central(&self) -> (f64, Vector<f64>, Matrix<f64>) {
        let [m, x, y, z, xx, xy, xz, yy, yz, zz] = self.0;
        let about_origin = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        if m == 0.0 {
            return (m, [0.0; 3], about_origin);
        }
        let centre = [x, y, z].map(|h| h / m);
        (m, centre, sum(&about_origin, &shifted(m, centre), -1.0))
    }

    /// Transforms the body from its own frame, which has this place, to the surrounding frame.
    pub fn seen(&self, place: &Place) -> Self {
        let (mass, centre, inertia) = self.central();
        let at = place.then(&Place { turn: SAME, at: centre }).at;
        Self::about(mass, at, &turned(&place.turn, &inertia))
    }

    pub fn plus(&self, other: &Self, factor: f64) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + factor * other.0[i]))
    }
}

/// `R I R^T`.
pub(super) fn turned(turn: &Matrix<f64>, inertia: &Matrix<f64>) -> Matrix<f64> {
    product(&product(turn, inertia), &transposed(*turn))
}

/// Inverse rotation.
pub(super) fn back(turn: &Matrix<f64>) -> Matrix<f64> {
    transposed(*turn)
}

type Square = [f64; 16];

impl Body {
    /// The pseudo-inertia `[[tr(I)/2 E - I, h], [h', m]]`; it is positive definite for a physical body that extends in all directions.
    fn moments(&self) -> Square {
        let [m, x, y, z, xx, xy, xz, yy, yz, zz] = self.0;
        let half = (xx + yy + zz) / 2.0;
        [half - xx, -xy, -xz, x, -xy, half - yy, -yz, y, -xz, -yz, half - zz, z, x, y, z, m]
    }

    fn of_moments(p: &Square) -> Self {
        let [xx, yy, zz] = [p[0], p[5], p[10]];
        Self([p[15], p[3], p[7], p[11], yy + zz, -p[1], -p[2], xx + zz, -p[6], xx + yy])
    }

    /// Cholesky factor `C` of `P = C C^T`; `None` if no physical body that extends in all directions has these constants.
    fn factor(&self) -> Option<Square> {
        let mut pivots = [0.0; 16];
        is_positive_definite(4, &self.moments(), &mut pivots).then(|| {
            let entry = |at: usize| if at % 4 > at / 4 { 0.0 } else { pivots[at] / pivots[at % 4 * 5].sqrt() };
            std::array::from_fn(entry)
        })
    }

    /// `true` if a physical body that extends in all directions has these constants.
    pub fn exists(&self) -> bool {
        self.factor().is_some()
    }

    /// Transforms bodies by the linear map of space that turns their sum into `whole`. It transforms all mass equally, so physical parts
    /// remain physical. `None` if there is no such map.
    pub fn stretched(parts: &[Self], whole: &Self) -> Option<Vec<Self>> {
        let sum = parts.iter().fold(Self::default(), |sum, part| sum.plus(part, 1.0));
        let (mut inverted, to) = ([0.0; 16], whole.factor()?);
        inverse(4, &sum.moments(), &mut inverted, &mut Workspace::new()).ok()?;
        // The inverse of a factor of `P = C C^T` is `C^T P^-1`.
        let map = product4(&to, &product4(&transposed4(&sum.factor()?), &inverted));
        let back = transposed4(&map);
        Some(parts.iter().map(|part| Self::of_moments(&product4(&product4(&map, &part.moments()), &back))).collect())
    }
}

fn transposed4(a: &Square) -> Square {
    std::array::from_fn(|at| a[at % 4 * 4 + at / 4])
}

fn product4(a: &Square, b: &Square) -> Square {
    std::array::from_fn(|at| (0..4).map(|k| a[at / 4 * 4 + k] * b[4 * k + at % 4]).sum())
}
