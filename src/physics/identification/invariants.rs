//! Combinations of constants that open directions leave unchanged: sums, and products of powers.
//!
//! A sum `c.x` is determined if `c' N = 0` for all open directions `N`, a product of powers `x_k^e_k` if `e' diag(1/x) N = 0`. The
//! exponents of short products form the integer kernel of `diag(1/x) N`, whose columns are rounded to small fractions. Both conditions hold only at
//! one point, so that a finite move must confirm each combination.

use super::determined::OpenDirection;
use super::thresholds::{FACTOR_ROUNDING, FRACTION_ROUNDING, MOST_DENOMINATOR, MOST_POWER};

/// The kind of a combination.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Product,
    Sum,
}

/// A product of powers, or a sum.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Invariant {
    pub kind: Kind,
    /// Exponents or factors of all unknowns.
    pub factors: Vec<f64>,
}

impl Invariant {
    pub fn value(&self, x: &[f64]) -> f64 {
        let both = self.factors.iter().zip(x).filter(|(factor, _)| **factor != 0.0);
        match self.kind {
            Kind::Sum => both.map(|(factor, x)| factor * x).sum(),
            Kind::Product => both.map(|(factor, x)| x.powi(*factor as i32)).product(),
        }
    }

    pub fn gradient(&self, x: &[f64]) -> Vec<f64> {
        match self.kind {
            Kind::Sum => self.factors.clone(),
            Kind::Product => {
                let value = self.value(x);
                self.factors.iter().zip(x).map(|(e, x)| if *e == 0.0 { 0.0 } else { value * e / x }).collect()
            }
        }
    }

    /// The constants that occur, each with its factor or exponent.
    pub fn terms(&self, names: &[&str]) -> Vec<(String, f64)> {
        let both = names.iter().zip(&self.factors).filter(|(_, factor)| **factor != 0.0);
        both.map(|(name, factor)| (name.to_string(), *factor)).collect()
    }
}

/// The formula of a combination, such as `c1/(g^2*m1)` or `a + 0.5*b`.
pub(super) fn written(kind: Kind, terms: &[(String, f64)]) -> String {
    match kind {
        Kind::Product => {
            let side = |sign: f64| {
                let own = terms.iter().filter(|(_, e)| e * sign > 0.0);
                let power = |(name, e): &(String, f64)| match e.abs() {
                    1.0 => name.clone(),
                    e => format!("{name}^{e}"),
                };
                own.map(power).collect::<Vec<_>>()
            };
            let above = Some(side(1.0).join("*")).filter(|text| !text.is_empty()).unwrap_or_else(|| "1".into());
            match &side(-1.0)[..] {
                [] => above,
                [single] => format!("{above}/{single}"),
                many => format!("{above}/({})", many.join("*")),
            }
        }
        Kind::Sum => {
            let mut text = String::new();
            for (name, factor) in terms {
                text += match (text.is_empty(), *factor < 0.0) {
                    (true, false) => "",
                    (true, true) => "-",
                    (false, false) => " + ",
                    (false, true) => " - ",
                };
                let size = crate::names::rounded(factor.abs(), 4);
                text += &if size == "1.000" { name.clone() } else { format!("{size}*{name}") };
            }
            text
        }
    }
}

/// The unit of a product of powers of quantities with units such as `m/s^2` or `N m s`.
pub(super) fn unit_of(factors: &[(&str, f64)]) -> String {
    let mut powers: Vec<(String, f64)> = Vec::new();
    for (unit, power) in factors {
        for (at, side) in unit.split('/').enumerate() {
            let sign = if at == 0 { *power } else { -power };
            let names = side.split([' ', '*', '(', ')']).filter(|name| !matches!(*name, "" | "1"));
            for name in names {
                let (name, own) =
                    name.split_once('^').map_or((name, 1.0), |(name, e)| (name, e.parse().unwrap_or(1.0)));
                match powers.iter_mut().find(|(known, _)| known == name) {
                    Some((_, known)) => *known += sign * own,
                    None => powers.push((name.to_string(), sign * own)),
                }
            }
        }
    }
    powers.retain(|(_, power)| *power != 0.0);
    if powers.is_empty() { String::new() } else { written(Kind::Product, &powers).replace('*', " ") }
}

/// Products of powers that no direction of a group changes, the shortest first; only unknowns whose relative changes are small fractions occur.
pub(super) fn products(columns: &[&OpenDirection], x: &[f64], inside: &[usize]) -> Vec<Invariant> {
    let exponent =
        |column: &OpenDirection, k: usize| column.change[k] / x[k] / (column.change[column.pivot] / x[column.pivot]);
    if columns.iter().any(|column| x[column.pivot] == 0.0) {
        return Vec::new();
    }
    let row = |&k: &usize| {
        // An exponent near 0 is not rounded to 0.
        let part =
            |column: &&OpenDirection| fraction(exponent(column, k)).filter(|(p, _)| *p != 0 || column.change[k] == 0.0);
        let own: Option<Vec<(i64, i64)>> = columns.iter().map(part).collect();
        own.filter(|_| x[k] != 0.0).map(|own| (k, own))
    };
    let rows: Vec<(usize, Vec<(i64, i64)>)> = inside.iter().filter_map(row).collect();
    // 12 is a multiple of all denominators.
    let whole = |(_, row): &(usize, Vec<(i64, i64)>)| row.iter().map(|(p, q)| p * 12 / q).collect::<Vec<i64>>();
    let kernel = shortened(integer_kernel(&rows.iter().map(whole).collect::<Vec<_>>()));
    let of = |powers: Vec<i64>| {
        let mut factors = vec![0.0; x.len()];
        let sign = powers.iter().find(|e| **e != 0).map_or(1, |e| e.signum());
        rows.iter().zip(&powers).for_each(|((k, _), e)| factors[*k] = (e * sign) as f64);
        Invariant { kind: Kind::Product, factors }
    };
    kernel.into_iter().filter(|powers| powers.iter().all(|e| e.abs() <= MOST_POWER)).map(of).collect()
}

/// Sums that no direction of a group changes; one for each unknown that is not a pivot.
pub(super) fn sums(columns: &[&OpenDirection], inside: &[usize], m: usize) -> Vec<Invariant> {
    let free = inside.iter().filter(|k| columns.iter().all(|column| column.pivot != **k));
    let of = |&k: &usize| {
        let mut factors = vec![0.0; m];
        factors[k] = 1.0;
        for column in columns {
            factors[column.pivot] = -without_rounding(column.change[k] / column.change[column.pivot]);
        }
        // The first factor is positive, whichever the pivots are.
        if factors.iter().find(|factor| **factor != 0.0).is_some_and(|first| *first < 0.0) {
            factors.iter_mut().for_each(|factor| *factor = -*factor);
        }
        Invariant { kind: Kind::Sum, factors }
    };
    free.map(of).collect()
}

/// A factor, replaced by the fraction that it equals up to rounding.
fn without_rounding(x: f64) -> f64 {
    let whole = fraction(x).map(|(p, q)| p as f64 / q as f64);
    whole.filter(|whole| (whole - x).abs() <= FACTOR_ROUNDING * x.abs().max(1.0)).unwrap_or(x)
}

/// The fraction with the smallest denominator near a number.
fn fraction(x: f64) -> Option<(i64, i64)> {
    let of = |q: i64| {
        let p = (x * q as f64).round();
        (((x * q as f64) - p).abs() < FRACTION_ROUNDING && p.abs() <= (MOST_POWER * q) as f64).then_some((p as i64, q))
    };
    (1..=MOST_DENOMINATOR).find_map(of)
}

/// A basis of all integer vectors `e` with `sum_i e_i row_i = 0`, by Euclid's algorithm on the rows, in reversible steps.
fn integer_kernel(rows: &[Vec<i64>]) -> Vec<Vec<i64>> {
    let count = rows.len();
    let unit = |i: usize| (0..count).map(|j| i64::from(i == j)).collect::<Vec<i64>>();
    let mut all: Vec<(Vec<i64>, Vec<i64>)> = rows.iter().enumerate().map(|(i, row)| (row.clone(), unit(i))).collect();
    for at in 0..rows.first().map_or(0, Vec::len) {
        loop {
            let of_size = |i: &usize| all[*i].0[at].abs();
            let Some(least) = (0..all.len()).filter(|i| of_size(i) > 0).min_by_key(of_size) else { break };
            let own = all[least].clone();
            let mut others = all.iter_mut().enumerate().filter(|(i, other)| *i != least && other.0[at] != 0).peekable();
            if others.peek().is_none() {
                all.swap_remove(least);
                break;
            }
            for (_, (image, powers)) in others {
                let factor = image[at] / own.0[at];
                image.iter_mut().zip(&own.0).for_each(|(x, o)| *x -= factor * o);
                powers.iter_mut().zip(&own.1).for_each(|(x, o)| *x -= factor * o);
            }
        }
    }
    all.into_iter().map(|(_, powers)| powers).collect()
}

/// Shortens a basis by replacing vectors by sums or differences with others; the shortest first.
fn shortened(mut basis: Vec<Vec<i64>>) -> Vec<Vec<i64>> {
    let size = |powers: &[i64]| powers.iter().map(|e| e.abs()).sum::<i64>();
    let shorter = |basis: &[Vec<i64>]| {
        let pairs = (0..basis.len()).flat_map(|i| (0..basis.len()).map(move |j| (i, j))).filter(|(i, j)| i != j);
        let tried = pairs.flat_map(|(i, j)| [(i, j, 1), (i, j, -1)]);
        let sum = |(i, j, sign): (usize, usize, i64)| {
            (i, basis[i].iter().zip(&basis[j]).map(|(a, b)| a + sign * b).collect::<Vec<i64>>())
        };
        tried.map(sum).find(|(i, sum)| size(sum) < size(&basis[*i]))
    };
    while let Some((i, sum)) = shorter(&basis) {
        basis[i] = sum;
    }
    basis.sort_by_key(|powers| (size(powers), powers.iter().position(|e| *e != 0)));
    basis
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(pivot: usize, change: &[f64]) -> OpenDirection {
        OpenDirection { pivot, change: change.to_vec() }
    }

    fn names_of(columns: &[OpenDirection], x: &[f64], names: &[&str]) -> Vec<String> {
        let columns: Vec<&OpenDirection> = columns.iter().collect();
        let inside: Vec<usize> = (0..x.len()).collect();
        products(&columns, x, &inside).iter().map(|found| written(found.kind, &found.terms(names))).collect()
    }

    #[test]
    fn products_hold_for_all_directions_at_once_and_for_signed_constants() {
        // Units of mass and of length: c ~ m l^2, g ~ l.
        let names = ["c", "g", "l", "m"];
        let x = [0.3, -9.0, 2.0, 5.0];
        let mass = column(3, &[0.3, 0.0, 0.0, 5.0]);
        let length = column(2, &[0.6, -9.0, 2.0, 0.0]);
        // Halves are whole numbers of another pivot, and the kernel is complete.
        let half = column(0, &[0.3, -4.5, 1.0, 0.0]);
        for second in [length, half] {
            let found = names_of(&[mass.clone(), second], &x, &names);
            let same = ["c/(g^2*m)", "c/(g*l*m)", "c/(l^2*m)"];
            assert!(found.len() == 2 && found[0] == "g/l" && same.contains(&found[1].as_str()), "{found:?}");
        }
        assert_eq!(names_of(&[column(0, &[1.0, -1.0])], &[1.0, 1.0], &names[..2]), ["c*g"]);
        assert!(names_of(&[column(0, &[3.0, std::f64::consts::PI])], &[3.0, 1.0], &names[..2]).len() < 2);
    }

    #[test]
    fn products_have_units() {
        assert_eq!(unit_of(&[("m/s^2", 1.0), ("m", -1.0)]), "1/s^2");
        assert_eq!(unit_of(&[("N m s", 1.0), ("m/s^2", -2.0), ("kg", -1.0)]), "N s^5/(m kg)");
        assert_eq!(unit_of(&[("kg", 1.0), ("kg", -1.0), ("", 2.0)]), "");
    }

    #[test]
    fn sums_have_values_gradients_and_names() {
        let found = sums(&[&column(1, &[1.0, -2.0])], &[0, 1], 2);
        let terms = found[0].terms(&["a", "b"]);
        assert_eq!(written(Kind::Sum, &terms), "a + 0.5000*b");
        assert_eq!((found[0].value(&[3.0, 4.0]), found[0].gradient(&[3.0, 4.0])), (5.0, vec![1.0, 0.5]));
        let product = Invariant { kind: Kind::Product, factors: vec![1.0, -2.0] };
        assert_eq!((product.value(&[8.0, 2.0]), product.gradient(&[8.0, 2.0])), (2.0, vec![0.25, -2.0]));
    }
}
