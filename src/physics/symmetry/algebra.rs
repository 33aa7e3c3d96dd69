//! The Lie algebra of vector fields: structure constants, Killing form, and the name of the algebra.

use super::basis::{Basis, Values};
use super::null_space::{Orthonormal, add, dot, orthonormal};
use super::sample::Sample;
use super::thresholds::{
    CLOSURE_NOISE, CLOSURES, COMMUTATOR_PRODUCTS, COMMUTATOR_STATES, CONSTANT_NOISE, INDEPENDENT_AXIS,
    LEAST_CONSTANT_NOISE, MOST_NAMED_DIMENSION, SQUARE_ROUNDING,
};
use super::{Field, SymmetryError};
use crate::linalg::{MatMut, MatRef, Workspace, eigenvalues, gemm, inverse, singular};
use serde::Serialize;

/// Structure of a Lie algebra of fields `X_1, .., X_m`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Algebra {
    /// `c[a][b][c]` of `[X_a, X_b] = sum_c c[a][b][c] X_c`; if there is no such combination, of the nearest one.
    pub structure_constants: Vec<Vec<Vec<f64>>>,
    /// Root mean square of the part of the commutators that is no combination of the fields, for fields of unit length and every coordinate
    /// in units of its spread over the states: 0 for an algebra.
    pub closure: f64,
    /// `true` if the commutators are combinations of the fields up to the noise of the fields; if not, the fields are no
    /// algebra, and neither constants nor signature mean anything.
    pub closes: bool,
    /// Numbers of negative, positive and zero eigenvalues of the Killing form `K_ab = c_ac^d c_bd^c`; a compact algebra has
    /// negative ones.
    pub killing_form_signature: [usize; 3],
    /// Name, such as `so(3)+R`, if it is identified. Fields that do not close have none; neither do those of a degenerate Lagrangian, whose
    /// number depends on the basis of functions.
    pub name: Option<String>,
}

impl Algebra {
    /// The algebra of fields whose coefficients have this relative noise.
    pub(crate) fn new(sample: &Sample, basis: &Basis, fields: &[Field], noise: f64) -> Result<Self, SymmetryError> {
        let (n, m) = (sample.n, fields.len());
        let pairs: Vec<(usize, usize)> = (0..m).flat_map(|a| (a + 1..m).map(move |b| (a, b))).collect();
        // Each state has n equations for m unknown coefficients of every commutator.
        let (few, worth) = (4 * m / n + 1, COMMUTATOR_PRODUCTS / (pairs.len() * n * m).max(1));
        let at_states = vectors(sample, basis, fields, few.max(worth.min(COMMUTATOR_STATES)));
        let states = at_states.len();
        let mean = |a: usize| at_states.iter().map(|at| dot(&at.vectors[a], &at.vectors[a])).sum::<f64>();
        let lengths: Vec<f64> =
            (0..m).map(|a| (mean(a) / states as f64).sqrt().max(f64::MIN_POSITIVE.sqrt())).collect();
        let (mut gram, mut sides) = (vec![0.0; m * m], vec![0.0; pairs.len() * m]);
        let (mut squares, mut brackets) = (vec![0.0; pairs.len()], Vec::with_capacity(pairs.len() * n));
        for at in &at_states {
            // Points far out, where fields grow, count no more than the others.
            let unit = at.vectors.iter().zip(&lengths).flat_map(|(x, length)| x.iter().map(move |x| x / length));
            let unit: Vec<f64> = unit.collect();
            let size = dot(&unit, &unit).max(f64::MIN_POSITIVE);
            brackets.clear();
            for (&(a, b), square) in pairs.iter().zip(&mut squares) {
                let scale = 1.0 / (lengths[a] * lengths[b]);
                let rows = at.slopes[b].chunks_exact(n).zip(at.slopes[a].chunks_exact(n));
                let (x, y) = (&at.vectors[a], &at.vectors[b]);
                brackets.extend(rows.map(|(there, back)| scale * (dot(there, x) - dot(back, y))));
                let bracket = &brackets[brackets.len() - n..];
                *square += dot(bracket, bracket) / size;
            }
            let fields = MatRef::new(&unit, m, n);
            gemm(MatMut::new(&mut gram, m, m), true, 1.0 / size, fields, fields.t());
            let brackets = MatRef::new(&brackets, pairs.len(), n);
            gemm(MatMut::new(&mut sides, pairs.len(), m), true, 1.0 / size, brackets, fields.t());
        }
        let mut inverted = vec![0.0; m * m];
        inverse(m, &gram, &mut inverted, &mut Workspace::new())
            .map_err(|_| SymmetryError::NotFinite { what: "a commutator of fields" })?;
        let mut constants = vec![vec![vec![0.0; m]; m]; m];
        let mut rest = 0.0;
        for ((&(a, b), side), square) in pairs.iter().zip(sides.chunks_exact(m)).zip(&squares) {
            let by = |matrix: &[f64], x: &[f64]| matrix.chunks_exact(m).map(|row| dot(row, x)).collect::<Vec<f64>>();
            let mut x = by(&inverted, side);
            // Once more: fields may nearly depend on each other.
            let left: Vec<f64> = side.iter().zip(by(&gram, &x)).map(|(side, found)| side - found).collect();
            add(&mut x, &by(&inverted, &left), 1.0);
            rest += (square - 2.0 * dot(&x, side) + dot(&x, &by(&gram, &x))).max(0.0);
            let scale = |c: usize| lengths[a] * lengths[b] / lengths[c];
            let x: Vec<f64> = x.iter().enumerate().map(|(c, x)| x * scale(c)).collect();
            let largest = x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            for c in 0..m {
                let value = if x[c].abs() <= (CONSTANT_NOISE * noise).max(LEAST_CONSTANT_NOISE) * largest.max(1.0) {
                    0.0
                } else {
                    x[c]
                };
                constants[a][b][c] = value;
                constants[b][a][c] = -value;
            }
        }
        // A difference of squares has only half of the digits.
        let rest = if rest > SQUARE_ROUNDING * squares.iter().sum::<f64>() { rest } else { 0.0 };
        let closure = (rest / states as f64).sqrt();
        let tolerance = (CLOSURE_NOISE * noise).clamp(CLOSURES.0, CLOSURES.1);
        let closes = closure <= tolerance;
        Ok(Self {
            closure,
            closes,
            killing_form_signature: signature(&killing_form(&constants), tolerance)?,
            name: if closes && sample.singular == 0 { name(&constants, tolerance) } else { None },
            structure_constants: constants,
        })
    }
}

/// Fields at a state, every coordinate in units of its spread.
struct FieldsAt {
    /// The fields, `(n)` each.
    vectors: Vec<Vec<f64>>,
    /// Their derivatives, `(n, n)` each.
    slopes: Vec<Vec<f64>>,
}

/// Evaluates fields at about `states` states, spread over the sample.
fn vectors(sample: &Sample, basis: &Basis, fields: &[Field], states: usize) -> Vec<FieldsAt> {
    let (n, spread) = (sample.n, sample.spread());
    let step = (sample.len() / states).max(1);
    let mut at = Values::default();
    let vector = |field: &Field, at: &Values| -> Vec<f64> {
        field.vector(at, n).iter().zip(&spread).map(|(x, unit)| x / unit).collect()
    };
    let slopes = |field: &Field, at: &Values| -> Vec<f64> {
        field.derivative(at, n).iter().enumerate().map(|(e, x)| x * spread[e % n] / spread[e / n]).collect()
    };
    let states = sample.q.chunks_exact(n).step_by(step);
    states
        .map(|q| {
            basis.evaluate(q, &mut at);
            FieldsAt {
                vectors: fields.iter().map(|field| vector(field, &at)).collect(),
                slopes: fields.iter().map(|field| slopes(field, &at)).collect(),
            }
        })
        .collect()
}

/// `K_ab = sum of c[a][c][d] c[b][d][c]`, rows of a symmetric matrix.
fn killing_form(c: &[Vec<Vec<f64>>]) -> Vec<f64> {
    let m = c.len();
    let entry = |a: usize, b: usize| (0..m).map(|i| (0..m).map(|j| c[a][i][j] * c[b][j][i]).sum::<f64>()).sum();
    (0..m).flat_map(|a| (0..m).map(move |b| (a, b))).map(|(a, b)| entry(a, b)).collect()
}

/// Numbers of negative, positive and zero eigenvalues of a symmetric matrix.
pub(crate) fn signature(matrix: &[f64], tolerance: f64) -> Result<[usize; 3], SymmetryError> {
    let m = matrix.len().isqrt();
    let mut values = vec![0.0; m];
    eigenvalues(m, matrix, &mut values, &mut Workspace::new())
        .map_err(|_| SymmetryError::NotFinite { what: "the Killing form" })?;
    let largest = values.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let floor = tolerance * largest.max(tolerance);
    let count = |test: &dyn Fn(f64) -> bool| values.iter().filter(|x| test(**x)).count();
    Ok([count(&|x| x < -floor), count(&|x| x > floor), count(&|x| x.abs() <= floor)])
}

/// Structure constants `[X_a, X_b] = sum_c c[a][b][c] X_c`.
type Constants = [Vec<Vec<f64>>];

/// Semisimple algebras of a dimension, as identified by the signature of the Killing form: numbers of its negative and positive
/// eigenvalues, name.
const SEMISIMPLE: [(usize, usize, &str); 13] = [
    (3, 0, "so(3)"),
    (1, 2, "so(2,1)"),
    (6, 0, "so(4)"),
    (3, 3, "so(3,1)"),
    (2, 4, "so(2,2)"),
    (4, 2, "so(3)+so(2,1)"),
    (8, 0, "su(3)"),
    (4, 4, "su(2,1)"),
    (3, 5, "sl(3,R)"),
    (9, 0, "so(3)+so(3)+so(3)"),
    (10, 0, "so(5)"),
    (6, 4, "so(4,1)"),
    (4, 6, "so(3,2)"),
];

/// Name of the algebra with these constants, known to `tolerance`; `None` if it cannot be identified.
///
/// Abelian, semisimple (of dimension 3, 6, 8, 9, 10), Euclidean `e(n)` and pseudo-Euclidean `iso(p,q)`, `n` from 2 to 5, the solvable
/// `aff(1)` and `heis(3)`, and direct sums of these with `R^n` and with each other.
pub(crate) fn name(c: &Constants, tolerance: f64) -> Option<String> {
    let m = c.len();
    if m == 0 {
        return None;
    }
    let derived = derived(c, tolerance);
    if derived.columns.is_empty() {
        return Some(abelian(m));
    }
    if m > MOST_NAMED_DIMENSION {
        return None;
    }
    let center = center(c, tolerance)?;
    if !center.is_empty() {
        let both = orthonormal(&[derived.columns.as_slice(), &center].concat(), tolerance);
        if both.columns.len() < derived.columns.len() + center.len() {
            return nilpotent(m, derived.columns.len(), center.len());
        }
        let rest = name(&projected(c, &complement(m, &center)), tolerance)?;
        return Some(format!("{rest}+{}", abelian(center.len())));
    }
    let perfect = perfect(c, tolerance);
    match perfect.len() {
        0 => solvable(c, &derived, tolerance),
        dimension if dimension == m => {
            let [negative, positive, zero] = signature(&killing_form(c), tolerance).ok()?;
            if zero == 0 { semisimple(negative, positive) } else { euclidean(c, &derived, tolerance) }
        }
        _ => {
            let inner = projected(c, &perfect);
            let [.., zero] = signature(&killing_form(&inner), tolerance).ok()?;
            let others = centralizer(c, &perfect, tolerance)?;
            if zero > 0 || perfect.len() + others.len() != m {
                return None;
            }
            Some(format!("{}+{}", name(&inner, tolerance)?, name(&projected(c, &others), tolerance)?))
        }
    }
}

fn abelian(m: usize) -> String {
    if m == 1 { "R".to_string() } else { format!("R^{m}") }
}

fn semisimple(negative: usize, positive: usize) -> Option<String> {
    let known = SEMISIMPLE.iter().find(|(n, p, _)| (*n, *p) == (negative, positive));
    known.map(|(.., name)| name.to_string())
}

/// Algebras with a center inside their commutators: of these the one of Heisenberg is known.
fn nilpotent(m: usize, derived: usize, center: usize) -> Option<String> {
    ((m, derived, center) == (3, 1, 1)).then(|| "heis(3)".to_string())
}

/// Solvable algebras of dimension 2 and 3 without a center.
fn solvable(c: &Constants, derived: &Orthonormal, tolerance: f64) -> Option<String> {
    let m = c.len();
    if m == 2 {
        return Some("aff(1)".to_string());
    }
    let [u, v] = derived.columns.as_slice() else { return None };
    let other = complement(m, &derived.columns);
    if m != 3 || dot(&bracket(c, u, v), &bracket(c, u, v)).sqrt() > tolerance {
        return None;
    }
    // The outer element turns or stretches the plane of the commutators.
    let (a, b) = (bracket(c, &other[0], u), bracket(c, &other[0], v));
    let (trace, determinant) = (dot(&a, u) + dot(&b, v), dot(&a, u) * dot(&b, v) - dot(&a, v) * dot(&b, u));
    if trace.abs() > tolerance.sqrt() * determinant.abs().sqrt() {
        return None;
    }
    Some(if determinant > 0.0 { "e(2)" } else { "iso(1,1)" }.to_string())
}

/// Rotations and translations of a flat space of dimension `n > 2`: an abelian radical of that dimension, on which the rotations act
/// as on vectors.
fn euclidean(c: &Constants, derived: &Orthonormal, tolerance: f64) -> Option<String> {
    let m = c.len();
    let n = (3..=5).find(|n| n * (n + 1) / 2 == m)?;
    let killing = killing_form(c);
    // The radical is orthogonal to all commutators.
    let columns: Vec<Vec<f64>> =
        (0..m).map(|a| derived.columns.iter().map(|d| dot(&killing[a * m..(a + 1) * m], d)).collect()).collect();
    let radical = null(&columns, tolerance)?;
    let flat = radical.iter().all(|a| radical.iter().all(|b| bracket(c, a, b).iter().all(|x| x.abs() <= tolerance)));
    if radical.len() != n || !flat {
        return None;
    }
    let outer = complement(m, &radical);
    let rotations = projected(c, &outer);
    let own = killing_form(&rotations);
    // The trace over vectors adds 1/(n - 2) of the rotations' own Killing form, that over spinors another part.
    let whole =
        |a: usize, b: usize| (0..m).map(|i| outer[a][i] * dot(&killing[i * m..(i + 1) * m], &outer[b])).sum::<f64>();
    let (count, factor) = (outer.len(), 1.0 + 1.0 / (n as f64 - 2.0));
    let largest = own.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let pairs = || (0..count).flat_map(|a| (0..count).map(move |b| (a, b)));
    if pairs().any(|(a, b)| (whole(a, b) - factor * own[a * count + b]).abs() > tolerance.sqrt() * largest) {
        return None;
    }
    let [negative, positive, _] = signature(&own, tolerance).ok()?;
    let name = semisimple(negative, positive)?;
    let inside = name.strip_prefix("so(")?.strip_suffix(')')?;
    Some(if inside.contains(',') { format!("iso({inside})") } else { format!("e({inside})") })
}

/// `[x, y]`.
fn bracket(c: &Constants, x: &[f64], y: &[f64]) -> Vec<f64> {
    let m = c.len();
    let mut result = vec![0.0; m];
    // Most elements that are requested have few components.
    for (a, x) in x.iter().enumerate().filter(|(_, x)| **x != 0.0) {
        for (b, y) in y.iter().enumerate().filter(|(_, y)| **y != 0.0) {
            super::null_space::add(&mut result, &c[a][b], x * y);
        }
    }
    result
}

/// Orthonormal basis of the commutators.
fn derived(c: &Constants, tolerance: f64) -> Orthonormal {
    let m = c.len();
    let axes: Vec<Vec<f64>> = complement(m, &[]);
    commutators(c, &axes, tolerance)
}

/// Orthonormal basis of the commutators of elements.
fn commutators(c: &Constants, of: &[Vec<f64>], tolerance: f64) -> Orthonormal {
    let all = of.iter().enumerate().flat_map(|(k, x)| of[k + 1..].iter().map(move |y| bracket(c, x, y)));
    // The largest first: the remainders of small ones are compared with them.
    let mut all: Vec<Vec<f64>> = all.filter(|x| dot(x, x).sqrt() > tolerance).collect();
    all.sort_by(|a, b| dot(b, b).total_cmp(&dot(a, a)));
    orthonormal(&all, tolerance.sqrt())
}

/// Orthonormal basis of the last of the derived algebras.
fn perfect(c: &Constants, tolerance: f64) -> Vec<Vec<f64>> {
    let mut last = complement(c.len(), &[]);
    loop {
        let next = commutators(c, &last, tolerance).columns;
        if next.len() == last.len() || next.is_empty() {
            return next;
        }
        last = next;
    }
}

/// Elements that commute with all.
fn center(c: &Constants, tolerance: f64) -> Option<Vec<Vec<f64>>> {
    centralizer(c, &complement(c.len(), &[]), tolerance)
}

/// Elements that commute with these.
fn centralizer(c: &Constants, with: &[Vec<f64>], tolerance: f64) -> Option<Vec<Vec<f64>>> {
    let axes = complement(c.len(), &[]);
    let columns: Vec<Vec<f64>> =
        axes.iter().map(|axis| with.iter().flat_map(|x| bracket(c, axis, x)).collect()).collect();
    null(&columns, tolerance)
}

/// Orthonormal null vectors of a matrix that is given by its columns.
fn null(columns: &[Vec<f64>], tolerance: f64) -> Option<Vec<Vec<f64>>> {
    let missing = columns.len().saturating_sub(columns.first().map_or(0, Vec::len));
    let tall: Vec<Vec<f64>> = columns.iter().map(|column| [column.as_slice(), &vec![0.0; missing]].concat()).collect();
    let found = singular(&tall)?;
    let largest = found.values.last().copied().unwrap_or(0.0);
    let zero = found.values.iter().take_while(|value| **value <= tolerance * largest).count();
    Some(found.vectors[..zero].to_vec())
}

/// Orthonormal vectors that complete these orthonormal ones to a basis of all `m` dimensions.
fn complement(m: usize, these: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let axes = (0..m).map(|k| (0..m).map(|i| f64::from(u8::from(i == k))).collect());
    let all: Vec<Vec<f64>> = these.iter().cloned().chain(axes).collect();
    orthonormal(&all, INDEPENDENT_AXIS).columns.split_off(these.len())
}

/// Structure constants of a subalgebra, or of the quotient by the complementary ideal, in an orthonormal basis.
fn projected(c: &Constants, basis: &[Vec<f64>]) -> Vec<Vec<Vec<f64>>> {
    let along = |x: &[f64]| basis.iter().map(|u| dot(x, u)).collect();
    basis.iter().map(|x| basis.iter().map(|y| along(&bracket(c, x, y))).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Constants of an algebra of matrices `(k, k)`, linearly independent.
    fn of_matrices(all: &[Vec<f64>]) -> Vec<Vec<Vec<f64>>> {
        let k = all[0].len().isqrt();
        let product = |a: &[f64], b: &[f64]| -> Vec<f64> {
            let entry = |i: usize, j: usize| (0..k).map(|l| a[i * k + l] * b[l * k + j]).sum();
            (0..k * k).map(|e| entry(e / k, e % k)).collect()
        };
        let known = orthonormal(all, 1e-9);
        let coefficients = |x: &[f64]| known.given(&known.along(x), all.len());
        let bracket = |a: &Vec<f64>, b: &Vec<f64>| -> Vec<f64> {
            product(a, b).iter().zip(product(b, a)).map(|(x, y)| x - y).collect()
        };
        all.iter().map(|a| all.iter().map(|b| coefficients(&bracket(a, b))).collect()).collect()
    }

    /// Generators of the rotations of a metric with these signs, as matrices of `size` rows; with the translations if there is an extra
    /// row.
    fn rotations(signs: &[f64], size: usize) -> Vec<Vec<f64>> {
        let n = signs.len();
        let matrix = |entries: &[(usize, usize, f64)]| {
            let mut m = vec![0.0; size * size];
            entries.iter().for_each(|&(i, j, x)| m[i * size + j] = x);
            m
        };
        let turns = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
        let turns = turns.map(|(i, j)| matrix(&[(i, j, signs[i]), (j, i, -signs[j])]));
        let moves = (0..if size > n { n } else { 0 }).map(|i| matrix(&[(i, n, 1.0)]));
        turns.chain(moves).collect()
    }

    #[test]
    fn classical_algebras_have_their_names() {
        let named = |signs: &[f64], size| name(&of_matrices(&rotations(signs, size)), 1e-9);
        for (signs, flat, round) in [
            (&[1.0, 1.0][..], "e(2)", "R"),
            (&[-1.0, 1.0], "iso(1,1)", "R"),
            (&[1.0; 3], "e(3)", "so(3)"),
            (&[-1.0, 1.0, 1.0], "iso(2,1)", "so(2,1)"),
            (&[1.0; 4], "e(4)", "so(4)"),
            (&[-1.0, 1.0, 1.0, 1.0], "iso(3,1)", "so(3,1)"),
            (&[-1.0, -1.0, 1.0, 1.0], "iso(2,2)", "so(2,2)"),
            (&[1.0; 5], "e(5)", "so(5)"),
        ] {
            assert_eq!(named(signs, signs.len() + 1).as_deref(), Some(flat), "{signs:?}");
            assert_eq!(named(signs, signs.len()).as_deref(), Some(round), "{signs:?}");
        }
        assert_eq!(named(&[-1.0, -1.0, 1.0, 1.0, 1.0], 5).as_deref(), Some("so(3,2)"));
        assert_eq!(named(&[-1.0, 1.0, 1.0, 1.0, 1.0], 5).as_deref(), Some("so(4,1)"));
    }

    #[test]
    fn direct_sums_are_told_apart() {
        let sum = |blocks: &[(&[f64], usize)]| {
            let size: usize = blocks.iter().map(|(_, size)| size).sum();
            let mut start = 0;
            let mut all = Vec::new();
            for &(signs, own) in blocks {
                for block in rotations(signs, own) {
                    let mut m = vec![0.0; size * size];
                    (0..own * own).for_each(|e| m[(start + e / own) * size + start + e % own] = block[e]);
                    all.push(m);
                }
                start += own;
            }
            name(&of_matrices(&all), 1e-9)
        };
        let three: &[f64] = &[1.0; 3];
        assert_eq!(sum(&[(three, 3), (&[1.0; 2], 2)]).as_deref(), Some("so(3)+R"));
        assert_eq!(sum(&[(three, 3), (&[1.0; 2], 3)]).as_deref(), Some("so(3)+e(2)"));
        assert_eq!(sum(&[(three, 3), (&[-1.0, 1.0, 1.0], 3)]).as_deref(), Some("so(3)+so(2,1)"));
        assert_eq!(sum(&[(&[1.0; 2], 2), (&[-1.0, 1.0], 2)]).as_deref(), Some("R^2"));
    }

    #[test]
    fn solvable_algebras_are_told_apart() {
        let matrices =
            |list: &[[f64; 9]]| name(&of_matrices(&list.iter().map(|m| m.to_vec()).collect::<Vec<_>>()), 1e-9);
        let entry = |at: usize| std::array::from_fn(|e| f64::from(u8::from(e == at)));
        assert_eq!(matrices(&[entry(1), entry(5), entry(2)]).as_deref(), Some("heis(3)"));
        assert_eq!(matrices(&[entry(0), entry(1)]).as_deref(), Some("aff(1)"));
        // A turn that also stretches has no name.
        let spiral = [0.5, -1.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(matrices(&[spiral, entry(2), entry(5)]), None);
    }
}
