//! Smooth functions of the coordinates: products of harmonics of angles and of Chebyshev polynomials of lengths.

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
