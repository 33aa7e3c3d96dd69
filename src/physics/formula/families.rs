//! Families of functions that terms are made of.

use super::error::FormulaError;
use super::function::{Factor, Function};
use super::thresholds::MOST_FAMILY_DEGREE;

/// Which functions of the coordinates a library is made of, by family and total degree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Families {
    /// Powers of coordinates that are not angles.
    pub polynomial: usize,
    /// Sines and cosines of sums and differences of multiples of the angles.
    pub trigonometric: usize,
    /// Positive and negative powers of the distance from the origin in the coordinates that are not angles.
    pub radial: usize,
    /// Reciprocals of powers of every coordinate that is not an angle.
    pub reciprocal: usize,
}

impl Default for Families {
    fn default() -> Self {
        Self { polynomial: 2, trigonometric: 2, radial: 0, reciprocal: 0 }
    }
}

impl Families {
    /// `true` without powers of distances and reciprocals.
    pub(super) fn is_polynomial(&self) -> bool {
        self.radial == 0 && self.reciprocal == 0
    }

    /// The functions of coordinates; those marked `periodic` are angles.
    pub(super) fn functions(&self, periodic: &[bool]) -> Vec<Function> {
        let n = periodic.len();
        let lines: Vec<usize> = (0..n).filter(|&i| !periodic[i]).collect();
        let angles: Vec<usize> = (0..n).filter(|&i| periodic[i]).collect();
        let mut of_lines: Vec<(usize, Vec<Factor>)> = Vec::new();
        for powers in exponents(lines.len(), self.polynomial) {
            let factors = lines.iter().zip(&powers).filter(|(_, p)| **p > 0);
            of_lines.push((powers.iter().sum(), factors.map(|(&i, &p)| Factor::Power(i, p as i32)).collect()));
        }
        if lines.len() > 1 {
            for k in (1..=self.radial as i32).flat_map(|k| [-k, k]).filter(|k| *k < 0 || k % 2 != 0) {
                of_lines.push((k.unsigned_abs() as usize, vec![Factor::Radius(lines.clone(), k)]));
            }
        }
        for k in 1..=self.reciprocal as i32 {
            of_lines.extend(lines.iter().map(|&i| (k as usize, vec![Factor::Power(i, -k)])));
        }
        let mut waves: Vec<(usize, Option<Factor>)> = vec![(0, None)];
        for harmonics in harmonics(angles.len(), self.trigonometric as i32) {
            let mut all = vec![0; n];
            angles.iter().zip(&harmonics).for_each(|(&i, &m)| all[i] = m);
            let degree = harmonics.iter().map(|m| m.unsigned_abs() as usize).sum();
            waves.push((degree, Some(Factor::Cosine(all.clone()))));
            waves.push((degree, Some(Factor::Sine(all))));
        }
        let most = self.polynomial.max(self.trigonometric).max(self.reciprocal);
        let mut functions = Vec::new();
        for (power, factors) in &of_lines {
            for (degree, wave) in &waves {
                if *degree == 0 || power + degree <= most {
                    functions.push(Function::Product(factors.iter().cloned().chain(wave.clone()).collect()));
                }
            }
        }
        functions
    }
}

impl std::fmt::Display for Families {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { polynomial, trigonometric, radial, reciprocal } = *self;
        let all = [
            ("polynomial", polynomial),
            ("trigonometric", trigonometric),
            ("radial", radial),
            ("reciprocal", reciprocal),
        ];
        let parts = all.iter().filter(|(_, degree)| *degree > 0).map(|(family, degree)| format!("{family}:{degree}"));
        f.write_str(&parts.collect::<Vec<_>>().join(","))
    }
}

impl std::str::FromStr for Families {
    type Err = String;

    /// `family:degree,..`; a family that is missing has degree 0.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut families = Self { polynomial: 0, trigonometric: 0, radial: 0, reciprocal: 0 };
        for part in text.split(',') {
            let (family, degree) = part.split_once(':').ok_or("expected FAMILY:DEGREE, such as polynomial:3")?;
            let place = match family.trim() {
                "polynomial" => &mut families.polynomial,
                "trigonometric" => &mut families.trigonometric,
                "radial" => &mut families.radial,
                "reciprocal" => &mut families.reciprocal,
                family => {
                    let known = ["polynomial", "trigonometric", "radial", "reciprocal"];
                    return Err(crate::names::unknown("family", family, known));
                }
            };
            let degree = degree.trim().parse().ok().filter(|degree| *degree <= MOST_FAMILY_DEGREE);
            *place = degree.ok_or_else(|| format!("{family}: expected a degree from 0 to {MOST_FAMILY_DEGREE}"))?;
        }
        Ok(families)
    }
}

/// Exponents of `count` coordinates with a sum of at most `degree`, lower sums first.
fn exponents(count: usize, degree: usize) -> Vec<Vec<usize>> {
    let mut all = vec![vec![]];
    for _ in 0..count {
        all = all
            .into_iter()
            .flat_map(|start: Vec<usize>| {
                let left = degree - start.iter().sum::<usize>();
                (0..=left).map(move |k| [start.clone(), vec![k]].concat())
            })
            .collect();
    }
    all.sort_by_key(|powers| powers.iter().sum::<usize>());
    all
}

/// Multiples of `count` angles with a sum of magnitudes from 1 to `degree`, one of each pair `m`, `-m`.
fn harmonics(count: usize, degree: i32) -> Vec<Vec<i32>> {
    let mut all: Vec<Vec<i32>> = vec![vec![]];
    for _ in 0..count {
        all = all
            .into_iter()
            .flat_map(|start| {
                let left = degree - start.iter().map(|m| m.abs()).sum::<i32>();
                (-left..=left).map(move |m| [start.clone(), vec![m]].concat())
            })
            .collect();
    }
    all.retain(|m| m.iter().find(|m| **m != 0).is_some_and(|first| *first > 0));
    all.sort_by_key(|m| m.iter().map(|m| m.abs()).sum::<i32>());
    all
}

/// A user's function, which must not depend on velocities.
pub(super) fn own_function(names: &[String], text: &str) -> Result<Function, FormulaError> {
    let wrong = |problem: String| FormulaError::Function { text: text.to_string(), problem };
    let function = Function::formula(names, text).map_err(|error| wrong(error.to_string()))?;
    if function.moves() {
        return Err(wrong("expected coordinates alone, found a velocity".to_string()));
    }
    Ok(function)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn families_are_read_or_refused() {
        let read = |text: &str| text.parse::<Families>();
        assert_eq!(read("radial:3").unwrap(), Families { polynomial: 0, trigonometric: 0, radial: 3, reciprocal: 0 });
        assert!(read("polynomial").is_err() && read("polynom:1").is_err() && read("polynomial:99").is_err());
    }
}
