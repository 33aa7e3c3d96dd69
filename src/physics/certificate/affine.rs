//! `W x + b` for a matrix of constants: one product of matrices over all parts of the numbers.

use super::arena::{Arena, LANES, Place, width};
use super::form::TINY;
use super::interval::Interval;
use super::number::Number;
use crate::linalg::{MatMut, MatRef, gemm};
use crate::scalar::vectorized;

/// `W x + b`, `(outputs)`; `weights` is `W`, `(outputs, inputs)` row-major, `bias` is `b` or empty.
///
/// The polynomial of an output is the product of `W` with those of the inputs; its distance is the product of `|W|` with the distances of the
/// inputs and with what the rounding of a sum of so many products can lose in any order, `|error| <= gamma sum_j |W_ij| |x_j|`,
/// `gamma = inputs EPSILON / 2` to first order (Higham 2002, section 3.1), charged twice.
pub fn map<'a>(weights: &[Number<'a>], bias: &[Number<'a>], x: &[Number<'a>]) -> Vec<Number<'a>> {
    let arena = x.iter().find_map(|x| if let Number::Variable(arena, _) = x { Some(*arena) } else { None });
    let exact: Option<Vec<f64>> = weights.iter().map(exact).collect();
    let constants: Option<Vec<Interval>> = bias.iter().map(constant).collect();
    match (arena, exact, constants) {
        (Some(arena), Some(weights), Some(bias)) => product(arena, &weights, &bias, x),
        _ => termwise(weights, bias, x),
    }
}

fn constant(x: &Number<'_>) -> Option<Interval> {
    if let Number::Constant(x) = x { Some(*x) } else { None }
}

fn exact(x: &Number<'_>) -> Option<f64> {
    constant(x).filter(|x| x.is_point()).map(|x| x.low)
}

/// Sums of products, one after the other.
fn termwise<'a>(weights: &[Number<'a>], bias: &[Number<'a>], x: &[Number<'a>]) -> Vec<Number<'a>> {
    let rows = weights.chunks_exact(x.len().max(1)).enumerate();
    let start = |i: usize| bias.get(i).copied().unwrap_or(Number::Constant(Interval::ZERO));
    rows.map(|(i, row)| row.iter().zip(x).fold(start(i), |sum, (&w, &x)| sum + w * x)).collect()
}

fn product<'a>(arena: &'a Arena, weights: &[f64], bias: &[Interval], x: &[Number<'a>]) -> Vec<Number<'a>> {
    let (rows, inputs, stride) = (arena.block(), x.len(), arena.basis.stride());
    let outputs = weights.len() / inputs;
    // Relative loss of a sum of `inputs` products, with room for the sums of distances.
    let loss = (inputs + stride + 16) as f64 * f64::EPSILON;
    let columns = gathered(arena, x);
    let distances = distances(&columns, (inputs, stride), loss);
    let absolute: Vec<f64> = weights.iter().map(|w| w.abs()).collect();
    let times = |a: &[f64], w: &[f64]| {
        let rows = a.len() / inputs;
        let mut c = vec![0.0; rows * outputs];
        let (a, w) = (MatRef::new(a, rows, inputs), MatRef::new(w, outputs, inputs));
        gemm(MatMut::new(&mut c, rows, outputs), false, 1.0, a, w.t());
        c
    };
    let (sums, spreads) = (times(&columns, weights), times(&distances, &absolute));
    let lanes: Vec<usize> = (0..outputs).step_by(LANES).map(|first| LANES.min(outputs - first)).collect();
    let pack = arena.make(&lanes, |_, new| {
        let mut rest = new;
        for (&lanes, first) in lanes.iter().zip((0..).step_by(LANES)) {
            let width = width(lanes);
            let (pack, others) = rest.split_at_mut(rows * width);
            rest = others;
            let parts = pack.chunks_exact_mut(stride * width).zip(sums.chunks_exact(stride * outputs));
            for (part, (form, sums)) in parts.enumerate() {
                // The function 0 stays so.
                if distances[part * inputs..(part + 1) * inputs].iter().all(|x| *x == 0.0) {
                    continue;
                }
                for (form, sums) in form.chunks_exact_mut(width).zip(sums.chunks_exact(outputs)) {
                    form[..lanes].copy_from_slice(&sums[first..first + lanes]);
                }
                for (lane, spread) in spreads[part * outputs + first..][..lanes].iter().enumerate() {
                    form[(stride - 1) * width + lane] = spread * (1.0 + loss) + TINY;
                }
            }
            for (lane, bias) in bias.iter().skip(first).take(lanes).enumerate() {
                let last = (stride - 1) * width + lane;
                let sum = pack[lane] + bias.middle();
                let distance = pack[last] + bias.radius() + f64::EPSILON * sum.abs();
                (pack[lane], pack[last]) = (sum, distance * (1.0 + loss));
            }
        }
    });
    let place = |i: usize| Place { pack: pack + (i / LANES) as u32, lane: (i % LANES) as u32 };
    (0..outputs).map(|i| Number::Variable(arena, place(i))).collect()
}

/// The coefficients of numbers, `(parts x stride, numbers)`.
fn gathered(arena: &Arena, x: &[Number<'_>]) -> Vec<f64> {
    let (rows, inputs) = (arena.block(), x.len());
    let mut columns = vec![0.0; rows * inputs];
    let mut i = 0;
    while i < inputs {
        i += match x[i] {
            Number::Constant(value) => {
                (columns[i], columns[(arena.basis.stride() - 1) * inputs + i]) = (value.middle(), value.radius());
                1
            }
            Number::Variable(_, Place { pack, lane }) => {
                // Neighbours go together.
                let next = |(x, lane): (&Number<'_>, u32)| matches!(x, Number::Variable(_, place) if *place == Place { pack, lane });
                let run = x[i..].iter().zip(lane..).take_while(|pair| next(*pair)).count();
                arena.look(pack, |forms, width| {
                    for (row, form) in columns.chunks_exact_mut(inputs).zip(forms.chunks_exact(width)) {
                        row[i..i + run].copy_from_slice(&form[lane as usize..lane as usize + run]);
                    }
                });
                run
            }
        };
    }
    columns
}

/// Distances of the inputs and what rounding may lose of their coefficients, `(parts, inputs)`.
fn distances(columns: &[f64], (inputs, stride): (usize, usize), loss: f64) -> Vec<f64> {
    let mut found = vec![0.0; columns.len() / stride];
    vectorized(
        #[inline(always)]
        || {
            for (found, part) in found.chunks_exact_mut(inputs).zip(columns.chunks_exact(stride * inputs)) {
                let (coefficients, distances) = part.split_at((stride - 1) * inputs);
                for row in coefficients.chunks_exact(inputs) {
                    found.iter_mut().zip(row).for_each(|(sum, x)| *sum += x.abs());
                }
                found.iter_mut().zip(distances).for_each(|(sum, r)| *sum = (r + loss * *sum) * (1.0 + loss));
            }
        },
    );
    found
}
