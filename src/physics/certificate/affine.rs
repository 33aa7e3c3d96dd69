//! `W x + b` for a matrix of constants: one product of matrices over all parts of the numbers.

use super::interval::Interval;
use super::number::{Arena, Number};
use crate::scalar::vectorized;

/// `W x + b`, `(outputs)`; `weights` is `W`, `(outputs, inputs)` row-major, `bias` is `b` or empty.
///
/// The plane of an output is the product of `W` with the planes of the inputs, summed in order in `f64`; its distance is the product of
/// `|W|` with the distances of the inputs and with what the rounding of a sum of so many products can lose,
/// `|error| <= gamma sum_j |W_ij| |x_j|`, `gamma = inputs EPSILON / 2` to first order (Higham 2002, section 3.1), charged twice.
pub fn map<'a>(weights: &[Number<'a>], bias: &[Number<'a>], x: &[Number<'a>]) -> Vec<Number<'a>> {
    let arena = x.iter().find_map(|x| if let Number::Variable(arena, _) = x { Some(*arena) } else { None });
    let exact: Option<Vec<f64>> = weights.iter().map(exact).collect();
    match (arena, exact) {
        (Some(arena), Some(weights)) => product(arena, &weights, bias, x),
        _ => termwise(weights, bias, x),
    }
}

fn exact(x: &Number<'_>) -> Option<f64> {
    match x {
        Number::Constant(x) if x.is_point() => Some(x.low),
        _ => None,
    }
}

/// Sums of products, one after the other.
fn termwise<'a>(weights: &[Number<'a>], bias: &[Number<'a>], x: &[Number<'a>]) -> Vec<Number<'a>> {
    let rows = weights.chunks_exact(x.len().max(1)).enumerate();
    let start = |i: usize| bias.get(i).copied().unwrap_or(Number::Constant(Interval::ZERO));
    rows.map(|(i, row)| row.iter().zip(x).fold(start(i), |sum, (&w, &x)| sum + w * x)).collect()
}

fn product<'a>(arena: &'a Arena, weights: &[f64], bias: &[Number<'a>], x: &[Number<'a>]) -> Vec<Number<'a>> {
    let (parts, stride, inputs) = (arena.parts(), arena.stride(), x.len());
    let (plane, outputs) = (stride - 1, weights.len() / inputs);
    let columns = parts * plane;
    // Relative loss of a sum of `inputs` products with room for the sums of distances.
    let loss = (inputs + 8) as f64 * f64::EPSILON;
    // Planes (inputs, parts x plane) and distances (inputs, parts).
    let (mut planes, mut distances) = (vec![0.0; inputs * columns], vec![0.0; inputs * parts]);
    for ((x, planes), distances) in
        x.iter().zip(planes.chunks_exact_mut(columns)).zip(distances.chunks_exact_mut(parts))
    {
        let mut take = |forms: &[f64]| {
            let rows = forms.chunks_exact(stride).zip(planes.chunks_exact_mut(plane)).zip(distances.iter_mut());
            for ((form, to), distance) in rows {
                to.copy_from_slice(&form[..plane]);
                let size: f64 = to.iter().map(|x| x.abs()).sum();
                *distance = (form[plane] + loss * size) * (1.0 + loss);
            }
        };
        match *x {
            Number::Variable(arena, index) => arena.look(index, &mut take),
            Number::Constant(value) => {
                planes[0] = value.middle();
                distances[0] = (value.radius() + loss * planes[0].abs()) * (1.0 + loss);
            }
        }
    }
    let mut sums = vec![0.0; outputs * columns];
    let mut spreads = vec![0.0; outputs * parts];
    vectorized(
        #[inline(always)]
        || {
            let rows = sums.chunks_exact_mut(columns).zip(spreads.chunks_exact_mut(parts));
            for ((sums, spreads), row) in rows.zip(weights.chunks_exact(inputs)) {
                let terms = row.iter().zip(planes.chunks_exact(columns)).zip(distances.chunks_exact(parts));
                for ((&w, planes), distances) in terms {
                    sums.iter_mut().zip(planes).for_each(|(sum, x)| *sum += w * x);
                    let w = w.abs();
                    spreads.iter_mut().zip(distances).for_each(|(sum, x)| *sum += w * x);
                }
            }
        },
    );
    let first = arena.make(outputs, |_, new| {
        let rows = sums.chunks_exact(plane).zip(&spreads);
        for (form, (sums, &spread)) in new.chunks_exact_mut(stride).zip(rows) {
            form[..plane].copy_from_slice(sums);
            // The smallest numbers cover underflow; the function 0 stays so.
            let empty = spread == 0.0 && sums.iter().all(|x| *x == 0.0);
            form[plane] = if empty { 0.0 } else { spread * (1.0 + loss) + 1e-290 };
        }
    });
    let rows = (first..).take(outputs).map(|index| Number::Variable(arena, index));
    let biased = |(i, row): (usize, Number<'a>)| bias.get(i).map_or(row, |&b| row + b);
    rows.enumerate().map(biased).collect()
}
