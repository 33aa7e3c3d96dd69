//! Possible changes of `L` and of the friction.
//!
//! A change of `L` is `f(q)` times a product of velocities: none (a potential), two (a mass matrix) or four; a change of the dissipation
//! `D` is `f(q) v_i^2/2` (viscous) or `w_i^2 ln cosh(v_i/w_i)` (dry beyond `w_i`). The equations of motion are linear in each change.

use crate::analysis::thresholds::{
    CHANGE_DEGREE, DRY_KNEE, MOST_CHANGES, MOST_DEPENDENT_COORDINATES, MOST_QUARTIC_COORDINATES, PRIOR_SIZE,
};

/// The factor of a function of the coordinates.
#[derive(Clone, Debug, PartialEq)]
enum VelocityFactor {
    /// The velocities of these coordinates, repeated ones to their power: part of `L`.
    Product(Vec<usize>),
    /// `v_i^2/2`: part of `D`.
    Viscous(usize),
    /// `w^2 ln cosh(v_i/w)`: part of `D`.
    Dry(usize, f64),
}

/// One change.
#[derive(Clone, Debug)]
struct Change {
    kind: VelocityFactor,
    function: usize,
    /// Its typical size, before the data are considered.
    size: f64,
}

/// Typical sizes, taken from the learned model itself, so that a change of size 1 makes it a different model.
#[derive(Clone, Debug)]
pub struct Typical {
    /// `|M_ii|`, mean over the states.
    pub mass: Vec<f64>,
    /// Root mean square of every velocity.
    pub velocity: Vec<f64>,
    /// Root mean square of every acceleration.
    pub acceleration: Vec<f64>,
}

/// All changes that are considered.
#[derive(Clone, Debug)]
pub struct Changes {
    n: usize,
    functions: Functions,
    all: Vec<Change>,
}

/// Values of all changes at one state.
#[derive(Clone, Debug, Default)]
pub struct Row {
    values: Values,
    /// `d/dt dL/dv - dL/dq + dD/dv`, `(n, changes)`.
    pub equation: Vec<f64>,
    /// `M`, `(n, n, changes)`, symmetric.
    pub mass: Vec<f64>,
    /// `dD/dv`, `(n, changes)`.
    pub friction: Vec<f64>,
    /// `E`, `(changes)`.
    pub energy: Vec<f64>,
}

impl Changes {
    /// Changes for coordinates that are angles or lie in `range`, including changes of the friction if `friction`. The functions have the
    /// highest degree that their number allows; `None` if even constants are too many.
    pub fn new(periodic: &[bool], range: &[[f64; 2]], usual: &Typical, friction: bool) -> Option<Self> {
        (0..=CHANGE_DEGREE).rev().find_map(|degree| Self::of_degree(periodic, range, usual, friction, degree))
    }

    fn of_degree(
        periodic: &[bool],
        range: &[[f64; 2]],
        usual: &Typical,
        friction: bool,
        degree: usize,
    ) -> Option<Self> {
        let n = periodic.len();
        let pairs: Vec<[usize; 2]> = (0..n).flat_map(|i| (i..n).map(move |j| [i, j])).collect();
        // The number of changes by constants. Lists of higher degree grow as a power of `n` and are not built merely to be counted.
        if pairs.len() + 2 * n > MOST_CHANGES || (degree > 0 && n > MOST_DEPENDENT_COORDINATES) {
            return None;
        }
        let changes = Self::listed(periodic, range, usual, friction, (degree, &pairs));
        (changes.len() <= MOST_CHANGES).then_some(changes)
    }

    fn listed(
        periodic: &[bool],
        range: &[[f64; 2]],
        usual: &Typical,
        friction: bool,
        (degree, pairs): (usize, &[[usize; 2]]),
    ) -> Self {
        let n = periodic.len();
        let functions = Functions::new(periodic, range, degree);
        let Typical { mass, velocity, acceleration } = usual;
        let inertia = |[i, j]: [usize; 2]| (mass[i] * mass[j]).sqrt();
        let kinetic: f64 = (0..n).map(|i| mass[i] * velocity[i] * velocity[i]).sum();
        let mut all = Vec::new();
        let mut add = |kind: VelocityFactor, function: usize, size: f64| all.push(Change { kind, function, size });
        for function in 0..functions.len() {
            for &[i, j] in pairs {
                // The kinetic energy contains half of v_i^2.
                let size = if i == j { 0.5 } else { 1.0 } * inertia([i, j]);
                add(VelocityFactor::Product(vec![i, j]), function, size);
            }
            if function > 0 {
                add(VelocityFactor::Product(Vec::new()), function, PRIOR_SIZE * kinetic);
            }
        }
        if n <= MOST_QUARTIC_COORDINATES {
            for (k, &[i, j]) in pairs.iter().enumerate() {
                for &[a, b] in &pairs[k..] {
                    let size = 0.25 * inertia([i, j]) / (velocity[a] * velocity[b]);
                    let mut product = vec![i, j, a, b];
                    product.sort_unstable();
                    if size.is_finite() && !contains_product(&all, &product) {
                        all.push(Change { kind: VelocityFactor::Product(product), function: 0, size });
                    }
                }
            }
        }
        if friction {
            for i in 0..n {
                let size = PRIOR_SIZE * mass[i] * acceleration[i] / velocity[i];
                let all_of = (0..functions.up_to(1)).map(|function| (VelocityFactor::Viscous(i), function));
                let knee = DRY_KNEE * velocity[i];
                let all_of = all_of.chain([(VelocityFactor::Dry(i, knee), 0)]);
                let sized = all_of.map(|(kind, function)| Change { kind, function, size });
                all.extend(sized.filter(|change| change.size.is_finite()));
            }
        }
        Self { n, functions, all }
    }

    /// Number of changes.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Values of all changes, each of its usual size, at a state with this acceleration.
    pub fn evaluate(&self, q: &[f64], v: &[f64], a: &[f64], row: &mut Row) {
        let (n, count) = (self.n, self.all.len());
        for (values, size) in [
            (&mut row.equation, n * count),
            (&mut row.mass, n * n * count),
            (&mut row.friction, n * count),
            (&mut row.energy, count),
        ] {
            values.clear();
            values.resize(size, 0.0);
        }
        self.functions.evaluate(q, &mut row.values);
        for (k, Change { kind, function, size }) in self.all.iter().enumerate() {
            let f = size * row.values.value[*function];
            match kind {
                VelocityFactor::Product(product) => {
                    let gradient = &row.values.gradient[function * n..(function + 1) * n];
                    let along = size * gradient.iter().zip(v).map(|(g, v)| g * v).sum::<f64>();
                    let whole: f64 = product.iter().map(|&i| v[i]).product();
                    row.energy[k] = (product.len() as f64 - 1.0) * f * whole;
                    for i in 0..n {
                        row.equation[i * count + k] -= size * gradient[i] * whole;
                    }
                    // Derivatives of the product by one and by two of its factors.
                    for (at, &i) in product.iter().enumerate() {
                        let rest = |without: usize| -> f64 {
                            let others = product.iter().enumerate().filter(|(j, _)| *j != at && *j != without);
                            others.map(|(_, &i)| v[i]).product()
                        };
                        row.equation[i * count + k] += along * rest(at);
                        for (other, &j) in product.iter().enumerate().filter(|(other, _)| *other != at) {
                            let element = f * rest(other);
                            row.mass[(i * n + j) * count + k] += element;
                            row.equation[i * count + k] += element * a[j];
                        }
                    }
                }
                VelocityFactor::Viscous(i) => row.friction[i * count + k] = f * v[*i],
                VelocityFactor::Dry(i, knee) => row.friction[i * count + k] = f * knee * (v[*i] / knee).tanh(),
            }
        }
        row.equation.iter_mut().zip(&row.friction).for_each(|(sum, friction)| *sum += friction);
    }
}

fn contains_product(all: &[Change], product: &[usize]) -> bool {
    all.iter().any(|change| change.function == 0 && matches!(&change.kind, VelocityFactor::Product(p) if p == product))
}

/// A product of one factor per coordinate; 0 is the constant. For an angle `2k - 1` and `2k` are `cos k q`, `sin k q`, for
/// another coordinate `k` is the Chebyshev polynomial of degree `k` over its range.
type Factors = Vec<usize>;

/// All products up to a degree, on the box of the coordinates.
#[derive(Clone, Debug)]
pub struct Functions {
    periodic: Vec<bool>,
    range: Vec<[f64; 2]>,
    all: Vec<Factors>,
}

/// Values `(functions)` and gradients `(functions, n)` at one place.
#[derive(Clone, Debug, Default)]
pub struct Values {
    pub value: Vec<f64>,
    pub gradient: Vec<f64>,
    /// Values and derivatives of the factors of every coordinate.
    factors: Vec<Vec<[f64; 2]>>,
}

impl Functions {
    /// Products of degree `degree` at most, for coordinates that are angles or range over `range`.
    pub fn new(periodic: &[bool], range: &[[f64; 2]], degree: usize) -> Self {
        let mut all: Vec<(Factors, usize)> = vec![(Vec::new(), 0)];
        for &angle in periodic {
            let longer = all.iter().flat_map(|(factors, used)| {
                let kinds = if angle { 2 * (degree - used) } else { degree - used };
                (0..=kinds).map(move |kind| {
                    let grade = if angle { kind.div_ceil(2) } else { kind };
                    ([factors.as_slice(), &[kind]].concat(), used + grade)
                })
            });
            all = longer.collect();
        }
        all.sort_by_key(|(_, grade)| *grade);
        let all = all.into_iter().map(|(factors, _)| factors).collect();
        Self { periodic: periodic.to_vec(), range: range.to_vec(), all }
    }

    /// Number of functions; the first is the constant 1.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Functions of degree `degree` at most, which come first.
    pub fn up_to(&self, degree: usize) -> usize {
        self.all.iter().take_while(|factors| self.degree(factors) <= degree).count()
    }

    fn degree(&self, factors: &[usize]) -> usize {
        factors.iter().zip(&self.periodic).map(|(&kind, &angle)| if angle { kind.div_ceil(2) } else { kind }).sum()
    }

    /// Values and gradients at `q`.
    pub fn evaluate(&self, q: &[f64], values: &mut Values) {
        let n = q.len();
        let most = self.all.iter().flatten().copied().max().unwrap_or(0);
        values.factors.resize_with(n, Vec::new);
        for (i, factors) in values.factors.iter_mut().enumerate() {
            factors.clear();
            if self.periodic[i] {
                harmonics(q[i], most, factors);
            } else {
                chebyshev(q[i], self.range[i], most, factors);
            }
        }
        values.value.clear();
        values.gradient.clear();
        for kinds in &self.all {
            let factor = |i: usize| values.factors[i][kinds[i]];
            values.value.push((0..n).map(|i| factor(i)[0]).product());
            values
                .gradient
                .extend((0..n).map(|along| (0..n).map(|i| factor(i)[usize::from(i == along)]).product::<f64>()));
        }
    }
}

/// 1, cos q, sin q, cos 2q, ... with their derivatives.
fn harmonics(q: f64, most: usize, out: &mut Vec<[f64; 2]>) {
    out.push([1.0, 0.0]);
    for k in 1..=most.div_ceil(2) {
        let frequency = k as f64;
        let (sin, cos) = (frequency * q).sin_cos();
        out.extend([[cos, -frequency * sin], [sin, frequency * cos]]);
    }
}

/// Chebyshev polynomials over a range with their derivatives by `q`.
fn chebyshev(q: f64, [low, high]: [f64; 2], most: usize, out: &mut Vec<[f64; 2]>) {
    let half = (0.5 * (high - low)).max(f64::MIN_POSITIVE);
    let x = (q - 0.5 * (low + high)) / half;
    out.push([1.0, 0.0]);
    out.push([x, 1.0]);
    for k in 2..=most {
        let ([a, da], [b, db]) = (out[k - 1], out[k - 2]);
        out.push([2.0 * x * a - b, 2.0 * (a + x * da) - db]);
    }
    out.iter_mut().for_each(|[_, slope]| *slope /= half);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{EulerLagrange, Lagrangian, Mechanics, Request, Terms};
    use crate::scalar::Real;

    /// `cos(q0) v0 v1 + sin(2 q0) q1 v1^2 + v0^2 v1^2 - cos(q0) q1`.
    struct Mixed;

    impl Lagrangian for Mixed {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            let twice = q[0] + q[0];
            q[0].cos() * v[0] * v[1] + twice.sin() * q[1] * v[1].sqr() + (v[0] * v[1]).sqr() - q[0].cos() * q[1]
        }
    }

    #[test]
    fn changes_are_what_the_engine_says() {
        let usual = Typical { mass: vec![1.0; 2], velocity: vec![1.0; 2], acceleration: vec![1.0; 2] };
        let changes = Changes::new(&[true, false], &[[0.0, 1.0], [-1.0, 1.0]], &usual, false).unwrap();
        let (q, v, a) = ([0.4, 0.7], [1.3, -0.6], [0.9, 2.1]);
        let mut values = Values::default();
        changes.functions.evaluate(&q, &mut values);
        let function = |value: f64| values.value.iter().position(|x| (x - value).abs() < 1e-12).unwrap();
        let find = |product: &[usize], function: usize| {
            let is = |c: &Change| c.function == function && c.kind == VelocityFactor::Product(product.to_vec());
            let k = changes.all.iter().position(is).unwrap();
            (k, 1.0 / changes.all[k].size)
        };
        let (cos, sin) = (q[0].cos(), (2.0 * q[0]).sin());
        let parts = [
            (find(&[0, 1], function(cos)), 1.0),
            (find(&[1, 1], function(sin * q[1])), 1.0),
            (find(&[0, 0, 1, 1], 0), 1.0),
            (find(&[], function(cos * q[1])), -1.0),
        ];
        let mut row = Row::default();
        changes.evaluate(&q, &v, &a, &mut row);
        let count = changes.len();
        let sum =
            |of: &[f64], at: usize| parts.iter().map(|((k, unit), sign)| sign * unit * of[at * count + k]).sum::<f64>();
        let mut terms = Terms::default();
        // Its mass matrix does not matter, because no accelerations are requested.
        let wanted = Request::MASS_MATRIX | Request::CORIOLIS | Request::DL_DQ | Request::ENERGY;
        Mechanics::new(Mixed, vec![]).terms(&q, &v, wanted, &mut terms).unwrap();
        for i in 0..2 {
            let inertia: f64 = (0..2).map(|j| terms.mass_matrix[i * 2 + j] * a[j]).sum();
            let expected = inertia + terms.coriolis[i] - terms.dl_dq[i];
            assert!((sum(&row.equation, i) - expected).abs() < 1e-12, "{i}");
            for j in 0..2 {
                assert!((sum(&row.mass, i * 2 + j) - terms.mass_matrix[i * 2 + j]).abs() < 1e-12, "{i} {j}");
            }
        }
        assert!((sum(&row.energy, 0) - terms.energy[0]).abs() < 1e-12);
    }

    #[test]
    fn many_coordinates_have_few_functions() {
        let count = |n: usize| {
            let usual = Typical { mass: vec![1.0; n], velocity: vec![1.0; n], acceleration: vec![1.0; n] };
            Changes::new(&vec![true; n], &vec![[0.0, 1.0]; n], &usual, true).map(|changes| changes.len())
        };
        for n in 1..=20 {
            assert!(count(n).is_some_and(|count| count <= MOST_CHANGES), "{n}");
        }
        assert_eq!(count(60), None);
    }

    #[test]
    fn gradients_are_those_of_the_values() {
        let functions = Functions::new(&[true, false], &[[0.0, 0.0], [-1.0, 3.0]], 3);
        // Angle of grade 0 to 3 in 1, 2, 2, 2 kinds, beside 4, 3, 2, 1 polynomials.
        assert_eq!((functions.len(), functions.up_to(0), functions.up_to(1)), (16, 1, 4));
        let at = |q: [f64; 2]| {
            let mut values = Values::default();
            functions.evaluate(&q, &mut values);
            values
        };
        let (q, h) = ([0.7, 1.9], 1e-5);
        let here = at(q);
        assert_eq!(here.value[0], 1.0);
        for i in 0..2 {
            let shifted = |h: f64| at(std::array::from_fn(|k| q[k] + if k == i { h } else { 0.0 })).value;
            for (k, (a, b)) in shifted(h).iter().zip(shifted(-h)).enumerate() {
                assert!(((a - b) / (2.0 * h) - here.gradient[2 * k + i]).abs() < 1e-8, "{k} {i}");
            }
        }
    }
}
