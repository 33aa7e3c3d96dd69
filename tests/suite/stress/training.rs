//! Cases 13, 26, 36 and 37: gradients of the loss, medians, sums over many rows, splits and threads.

use super::objective::{all_rows, architecture, mass_matrices, states, step, weights};
use super::record::{Row, exact};
use crate::common::accuracy::{cast, largest};
use crate::common::matrices::dd;
use lnn::configuration::Penalty;
use lnn::data::Dataset;
use lnn::lagrangian::{EulerLagrange, Request, Terms};
use lnn::linalg::{self, Workspace};
use lnn::network::{ActivationChoice, NetworkLagrangian};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::training::Objective;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Largest condition number of a list of matrices.
fn worst_condition(n: usize, matrices: &[Dd]) -> f64 {
    let kappa = |m: &[Dd]| linalg::condition_number(n, m, &mut Workspace::new()).unwrap();
    matrices.chunks_exact(n * n).map(kappa).fold(1.0, f64::max)
}

fn difference<S: Scalar>(found: &[S], exact: &[Dd]) -> f64 {
    assert_eq!(found.len(), exact.len());
    largest(&found.iter().zip(exact).map(|(&x, &y)| dd(x) - y).collect::<Vec<_>>())
}

/// The largest change of any component per relative change of the weights: of four random patterns of signs, the worst.
fn sensitivity(theta: &[Dd], base: &[Dd], output: impl Fn(&[Dd]) -> Vec<Dd>) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let h = 2f64.powi(-44);
    let mut change = || {
        let moved: Vec<Dd> =
            theta.iter().map(|&w| w * (Dd::one() + Dd::of_f64(if rng.random_bool(0.5) { h } else { -h }))).collect();
        difference(&output(&moved), base) / h
    };
    (0..4).map(|_| change()).fold(0.0, f64::max)
}

/// Takes an error into account in units of `n eps kappa |x|`, `kappa` the condition of the mass matrices.
///
/// That unit alone, with its limit of 100, cannot hold: `kappa` knows nothing of terms that cancel within `M`, within
/// `g - c` or in a sum over states, and it is 1 for every `M` of one coordinate, however small a difference `M` is.
/// Where it leaves more than a few units, R also counts what the same relative change of the weights does to the exact
/// result; the row tells the figure by `kappa` alone beside it.
fn see(
    row: &mut Row,
    (unit, eps): (f64, f64),
    (error, size): (f64, f64),
    sensitivity: impl Fn() -> f64,
    place: impl Fn() -> String,
) {
    let plain = error / (unit * size);
    let r = if plain < 3.0 { plain } else { error / (unit * size + eps * sensitivity()) };
    row.see(r, || format!("{}, {plain:.1} by kappa alone", place()));
}

/// `M`, `a` and the gradient of the loss with penalties of weight 100, against the same code in double-double (which
/// is itself checked against reverse mode through the whole loss).
fn loss_gradients<S: Scalar>() {
    let eps = S::epsilon().to_f64();
    let mut rows =
        ["M, unit n eps |M|", "a, unit n eps kappa |a|", "gradient of loss + 100 penalty, unit n eps kappa |.|"]
            .map(|name| Row::new::<S>(13, name));
    for n in 1..=6 {
        for activation in ActivationChoice::ALL {
            // Positive definite, negative definite, and whatever the network makes of it.
            for alpha in [1.0, -0.5, 0.02] {
                let shape = architecture(n, &[16, 16], activation, alpha);
                let theta = weights::<S>(&shape, 13 + n as u64);
                let data = states::<S>(n, 24, 14);
                let (wide, wide_data) = (cast::<S, Dd>(&theta), data.cast::<Dd>());
                let kappa = worst_condition(n, &mass_matrices(&shape, &theta, &data));
                let place = || format!("n = {n}, {activation}, alpha = {alpha}, condition {kappa:.1e}");
                let unit = n as f64 * eps;

                let network = NetworkLagrangian::new(shape.clone(), theta.clone()).unwrap();
                let (mut found, mut exact) = (Terms::default(), Terms::default());
                network.terms(data.q(), data.v(), Request::ALL, &mut found).unwrap();
                network.cast::<Dd>().terms(wide_data.q(), wide_data.v(), Request::ALL, &mut exact).unwrap();
                let moved = |theta: &[Dd]| {
                    let mut moved = Terms::default();
                    let network = NetworkLagrangian::new(shape.clone(), theta.to_vec()).unwrap();
                    network.terms(wide_data.q(), wide_data.v(), Request::ACCELERATION, &mut moved).unwrap();
                    moved
                };
                let of_m = || sensitivity(&wide, &exact.mass_matrix, |theta| moved(theta).mass_matrix);
                let error = difference(&found.mass_matrix, &exact.mass_matrix);
                see(&mut rows[0], (unit, eps), (error, largest(&exact.mass_matrix)), of_m, place);
                let of_a = || sensitivity(&wide, &exact.acceleration, |theta| moved(theta).acceleration);
                let error = difference(&found.acceleration, &exact.acceleration);
                see(&mut rows[1], (unit * kappa, eps), (error, largest(&exact.acceleration)), of_a, place);

                let lambda = 100.0;
                for penalty in
                    [Penalty::None, Penalty::Eigenvalue { lambda }, Penalty::Sylvester { lambda, time: None }]
                {
                    let (report, gradient) = step(&shape, (penalty, 2), &theta, &data, &all_rows(24));
                    let (judge, exact) = step(&shape, (penalty, 1), &wide, &wide_data, &all_rows(24));
                    assert_eq!((report.failure, report.penalised), (None, judge.penalised));
                    let moved = |theta: &[Dd]| step(&shape, (penalty, 1), theta, &wide_data, &all_rows(24)).1;
                    let of_gradient = || sensitivity(&wide, &exact, moved);
                    let error = difference(&gradient, &exact);
                    let place = || format!("{}, {penalty:?}", place());
                    see(&mut rows[2], (unit * kappa, eps), (error, largest(&exact)), of_gradient, place);
                }
            }
        }
    }
    rows.into_iter().for_each(Row::end);
}

#[test]
fn case_13_gradients_of_the_loss() {
    loss_gradients::<f32>();
    loss_gradients::<f64>();
}

/// `relu(-det M_1)/(c_1 + eps) + relu(-det M_2)/(c_1 c_2 + eps)`.
fn sylvester_of_two(m: &[Dd], c: [Dd; 2]) -> Dd {
    let eps = Dd::of_f64(1e-8);
    (-m[0]).relu() / (c[0] + eps) + (m[1] * m[2] - m[0] * m[3]).relu() / (c[0] * c[1] + eps)
}

/// An even batch: the penalty is that of the lower median and not that of the upper one, nor of their mean.
fn medians<S: Scalar>() {
    let mut row = Row::new::<S>(26, "Sylvester's penalty by the lower median");
    for batch in [1, 2, 6, 64, 130] {
        let shape = architecture(2, &[8, 8], ActivationChoice::Gelu, -0.1);
        let theta = weights::<S>(&shape, 26);
        let data = states::<S>(2, batch, 27);
        let matrices = mass_matrices(&shape, &theta, &data);
        let by_index = |index: usize| {
            let c = [0, 3].map(|k| {
                let mut column: Vec<Dd> = matrices.chunks_exact(4).map(|m| m[k].abs()).collect();
                column.sort_by(|a, b| a.partial_cmp(b).unwrap());
                column[index]
            });
            let sum = matrices.chunks_exact(4).fold(<Dd as Real>::zero(), |s, m| s + sylvester_of_two(m, c));
            sum / Dd::of_f64(batch as f64)
        };
        let (lower, upper) = (by_index((batch - 1) / 2), by_index(batch / 2));
        let (report, _) =
            step(&shape, (Penalty::Sylvester { lambda: 1.0, time: None }, 2), &theta, &data, &all_rows(batch));
        let error = |expected: Dd| ((dd(report.penalty) - expected) / lower).to_f64().abs() / S::epsilon().to_f64();
        row.see(error(lower), || format!("batch {batch}"));
        assert!(batch % 2 == 1 || error(upper) > 1000.0, "the upper median cannot be told apart");
    }
    row.end();
}

#[test]
fn case_26_lower_medians_of_even_batches() {
    medians::<f32>();
    medians::<f64>();
}

/// The loss of a few states repeated very often is that of those states.
fn many_rows<S: Scalar>(count: usize) {
    let mut row = Row::new::<S>(36, "mean over many rows, unit eps log2 N");
    let shape = architecture(1, &[2], ActivationChoice::Softplus, 1.0);
    let theta = weights::<S>(&shape, 36);
    let few = states::<S>(1, 5, 37);
    let repeat = |x: &[S]| x.iter().copied().cycle().take(count).collect::<Vec<S>>();
    let many = Dataset::new(1, repeat(few.q()), repeat(few.v()), repeat(few.a())).unwrap();
    let mut objective = Objective::new(&shape, Penalty::None, 2).unwrap();
    // Accelerations and residuals of the five in the precision at hand, their mean in double-double.
    let alone: Vec<Dd> = (0..5)
        .map(|k| {
            let one = |x: &[S]| vec![x[k]];
            dd(objective.loss(&theta, &Dataset::new(1, one(few.q()), one(few.v()), one(few.a())).unwrap()).loss)
        })
        .collect();
    let weighted = |k: usize| alone[k] * Dd::of_f64(((count - k).div_ceil(5)) as f64);
    let exact = (0..5).fold(<Dd as Real>::zero(), |s, k| s + weighted(k)) / Dd::of_f64(count as f64);
    let report = objective.loss(&theta, &many);
    let error = ((dd(report.loss) - exact) / exact).to_f64().abs();
    row.see(error / (S::epsilon().to_f64() * (count as f64).log2()), || format!("{count} rows"));
    row.end_below(4.0);
}

#[test]
fn case_36_many_rows() {
    many_rows::<f32>(300_001);
    many_rows::<f64>(100_001);
}

#[test]
#[ignore = "long"]
fn case_36_ten_million_rows() {
    many_rows::<f32>(10_000_000);
    many_rows::<f64>(10_000_000);
}

/// Gradients of the parts of a batch add up to that of the batch; threads change no bit.
fn splits<S: Scalar>() {
    let mut row = Row::new::<S>(37, "gradient of a split batch, unit eps log2 B |terms|");
    let shape = architecture(2, &[16, 16], ActivationChoice::Gelu, 0.5);
    let theta = weights::<S>(&shape, 38);
    let mut checks = 0;
    for batch in [2, 64, 100, 1000] {
        let data = states::<S>(2, batch, 39);
        let rows = all_rows(batch);
        let penalty = Penalty::Eigenvalue { lambda: 10.0 };
        let (report, whole) = step(&shape, (penalty, 1), &theta, &data, &rows);
        for threads in [2, 3, 4, 16] {
            assert_eq!(
                (report, whole.clone()),
                step(&shape, (penalty, threads), &theta, &data, &rows),
                "{threads} threads"
            );
            checks += 1;
        }
        for part in [1, 7, 64, 500].into_iter().filter(|&part| part < batch) {
            let (mut sum, mut size) = (vec![<Dd as Real>::zero(); theta.len()], vec![0.0; theta.len()]);
            for rows in rows.chunks(part) {
                let share = Dd::of_f64(rows.len() as f64) / Dd::of_f64(batch as f64);
                let (_, gradient) = step(&shape, (penalty, 2), &theta, &data, rows);
                for ((sum, size), g) in sum.iter_mut().zip(&mut size).zip(gradient) {
                    *sum += share * dd(g);
                    *size += (share * dd(g)).to_f64().abs();
                }
            }
            let largest = size.iter().copied().fold(0.0, f64::max);
            let error = difference(&whole, &sum) / largest;
            row.see(error / (S::epsilon().to_f64() * (batch as f64).log2()), || format!("{batch} in parts of {part}"));
        }
    }
    row.end_below(10.0);
    exact::<S>(37, "the same bytes on 1, 2, 3, 4, 16 threads", checks);
}

#[test]
fn case_37_splits_and_threads() {
    splits::<f32>();
    splits::<f64>();
}
