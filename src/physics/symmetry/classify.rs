//! Names of Lie algebras by their structure constants.

use super::algebra::{killing_form, signature};
use super::orthonormal::{Orthonormal, dot, orthonormal};
use crate::linalg::singular;

/// Structure constants `[X_a, X_b] = sum_c c[a][b][c] X_c`.
type Constants = [Vec<Vec<f64>>];

/// Semisimple algebras of a dimension that the signature of the Killing form tells apart: numbers of its negative and positive
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

/// Dimensions of an algebra that is looked into, at most: what has a name here is far smaller.
const MOST: usize = 64;

/// Name of the algebra with these constants, known to `tolerance`; `None` for one that is not known here.
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
    if m > MOST {
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
    // Most elements that are asked for have few components.
    for (a, x) in x.iter().enumerate().filter(|(_, x)| **x != 0.0) {
        for (b, y) in y.iter().enumerate().filter(|(_, y)| **y != 0.0) {
            super::orthonormal::add(&mut result, &c[a][b], x * y);
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
    // The largest first: what is left of small ones is judged beside them.
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

/// Orthonormal vectors beside these, which are orthonormal, of all `m` dimensions.
fn complement(m: usize, these: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let axes = (0..m).map(|k| (0..m).map(|i| f64::from(u8::from(i == k))).collect());
    let all: Vec<Vec<f64>> = these.iter().cloned().chain(axes).collect();
    orthonormal(&all, 1e-6).columns.split_off(these.len())
}

/// Constants of a subalgebra, or of the quotient by the ideal beside it, in an orthonormal basis.
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

    /// Generators of the rotations of a metric of signs, as matrices of `size` rows, with the translations if there is a row more.
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
