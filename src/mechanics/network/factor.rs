//! Factors: a quadratic form of the velocities as a sum of squares, which has its signature whatever the numbers are.

use crate::scalar::Real;
use serde::{Deserialize, Serialize};

/// Factor of the quadratic form of a structure, which makes it a sum of squares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Factor {
    /// A lower triangle with the diagonal `softplus(c_ii) + 10^-3`: as many squares as coordinates.
    #[default]
    Triangle,
    /// A rectangle of numbers of any sign beside `10^-6` times the identity: three squares for every coordinate in space,
    /// speeds in a space around it, smooth where the diagonal of a triangle has a root. A time has its own shift and lapse.
    Rectangle,
}

/// Least diagonal element of a triangular factor, and of a lapse; its square is the least eigenvalue beside a rectangle.
const LEAST: f64 = 1e-3;

/// Rows of a rectangle for every coordinate in space: the speeds in a space with room around.
const ROWS: usize = 3;

/// Initial biases of the diagonal of a triangle: `softplus(1) = 1.31`.
const DIAGONAL: f64 = 1.0;

impl Factor {
    /// `true` for what files without the key have.
    pub(super) fn is_triangle(&self) -> bool {
        *self == Self::Triangle
    }

    /// Numbers of a form in `n` coordinates, one of them a time if it is `lorentzian`.
    pub(super) fn numbers(self, n: usize, lorentzian: bool) -> usize {
        let space = n - usize::from(lorentzian);
        match self {
            Self::Triangle => n * (n + 1) / 2,
            Self::Rectangle => ROWS * space * space + if lorentzian { n } else { 0 },
        }
    }

    /// Initial biases of the numbers, those other than 0 with their indices: a form of 1.7 times the identity.
    pub(super) fn initial_biases(self, n: usize, lorentzian: bool) -> Vec<(usize, f64)> {
        let space = n - usize::from(lorentzian);
        match self {
            Self::Triangle => (0..n).map(|i| (i * (i + 1) / 2 + i, DIAGONAL)).collect(),
            Self::Rectangle => {
                let lapse = lorentzian.then(|| (self.numbers(n, true) - 1, DIAGONAL));
                (0..space).map(|i| (i * space + i, DIAGONAL.exp().ln_1p())).chain(lapse).collect()
            }
        }
    }

    /// Factor of the initial output weights.
    pub(super) fn variation(self) -> f64 {
        match self {
            Self::Triangle => 0.1,
            Self::Rectangle => 0.3,
        }
    }

    /// Half the form of `v`; `order` is the order of the coordinates, the last one a time, counted negative, if it is
    /// `lorentzian`.
    ///
    /// - Triangle: `v.C eta C^T v / 2`, the numbers those of `C`, row by row.
    /// - Rectangle: `|B w|^2 / 2 - (N v_t)^2 / 2`, `w_i = v_i + shift_i v_t`, the numbers those of `B`, row by row, then the
    ///   shift and the lapse `N`.
    pub(super) fn half_form<R: Real>(self, numbers: &[R], v: &[R], order: &[usize], lorentzian: bool) -> R {
        match self {
            Self::Triangle => half_form_of_triangle(numbers, v, order, lorentzian),
            Self::Rectangle => half_form_of_rectangle(numbers, v, order, lorentzian),
        }
    }
}

/// A positive number from any.
fn positive<R: Real>(x: R) -> R {
    x.softplus() + R::of(LEAST)
}

fn half_form_of_triangle<R: Real>(triangle: &[R], v: &[R], order: &[usize], lorentzian: bool) -> R {
    let n = v.len();
    let mut half = R::zero();
    for k in 0..n {
        let along = (k..n).fold(R::zero(), |sum, i| {
            let element = triangle[i * (i + 1) / 2 + k];
            sum + if i == k { positive(element) } else { element } * v[order[i]]
        });
        let square = along.sqr() * R::half();
        half = if lorentzian && k + 1 == n { half - square } else { half + square };
    }
    half
}

fn half_form_of_rectangle<R: Real>(numbers: &[R], v: &[R], order: &[usize], lorentzian: bool) -> R {
    let space = v.len() - usize::from(lorentzian);
    let (rectangle, rest) = numbers.split_at(ROWS * space * space);
    let moved: Vec<R> = match order[space..] {
        [time] => order[..space].iter().zip(rest).map(|(&i, &shift)| v[i] + shift * v[time]).collect(),
        _ => order.iter().map(|&i| v[i]).collect(),
    };
    let square = |sum: R, x: R| sum + x.sqr();
    let along = |row: &[R]| row.iter().zip(&moved).fold(R::zero(), |sum, (&b, &w)| sum + b * w);
    let least = moved.iter().copied().fold(R::zero(), square) * R::of(LEAST * LEAST);
    let form = rectangle.chunks_exact(space.max(1)).map(along).fold(least, square);
    let form = match order[space..] {
        [time] => form - (positive(rest[space]) * v[time]).sqr(),
        _ => form,
    };
    form * R::half()
}

/// The coordinates with the time-like one last.
pub(super) fn time_last(n: usize, time: Option<usize>) -> Vec<usize> {
    (0..n).filter(|&i| Some(i) != time).chain(time).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `softplus(x) + 10^-3 = 1`: a unit triangle gives the Minkowski metric, whatever the place of the time.
    #[test]
    fn a_unit_triangle_gives_the_minkowski_metric() {
        let one = (0.999_f64).exp_m1().ln();
        let triangle = [one, 0.0, one, 0.0, 0.0, one];
        for time in 0..3 {
            let order = time_last(3, Some(time));
            for i in 0..3 {
                let v: [f64; 3] = std::array::from_fn(|k| if k == i { 2.0 } else { 0.0 });
                let expected = if i == time { -2.0 } else { 2.0 };
                assert!((Factor::Triangle.half_form(&triangle, &v, &order, true) - expected).abs() < 1e-14);
            }
        }
        assert_eq!(time_last(2, None), [0, 1]);
    }

    /// `|B w|^2 - (N v_t)^2` with the shift in `w`, and `10^-6 |w|^2`, for numbers worked out by hand.
    #[test]
    fn a_rectangle_is_a_sum_of_squares_with_shift_and_lapse() {
        let lapse = (2.0 - LEAST).exp_m1().ln();
        let rectangle = [1.0, 2.0, 0.0, -1.0, 3.0, 0.0, 0.0, 0.5, 0.0, 0.0, -1.0, 0.0];
        let v = [0.5, 2.0, -1.0];
        let order = time_last(3, Some(1));
        // w = (0.5 + 0.25 * 2, -1 - 0.5 * 2) = (1, -2).
        let squares = 9.0 + 4.0 + 9.0 + 1.0 + 1.0 + LEAST * LEAST * 5.0;
        let lorentzian = [&rectangle[..], &[0.25, -0.5, lapse]].concat();
        assert_eq!(lorentzian.len(), Factor::Rectangle.numbers(3, true));
        let found: f64 = Factor::Rectangle.half_form(&lorentzian, &v, &order, true);
        assert!((found - (squares - 16.0) / 2.0).abs() < 1e-13);
        // A time alone.
        assert_eq!(
            Factor::Rectangle.half_form(&[lapse], &[1.0], &[0], true),
            -0.5 * (lapse.exp().ln_1p() + LEAST).powi(2)
        );
        let found: f64 = Factor::Rectangle.half_form(&rectangle, &[1.0, -2.0], &[0, 1], false);
        assert!((found - squares / 2.0).abs() < 1e-13);
    }
}
