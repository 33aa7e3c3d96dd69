//! The geometry of networks: jets of their mass matrix against differences of it in double-double.

use super::spaces::dd;
use lnn::geometry::Geometry;
use lnn::lagrangian::{EulerLagrange, Request, Terms};
use lnn::network::{ActivationChoice, Architecture, Form, InputLayer, Layout, NetworkLagrangian, Structure};
use lnn::scalar::{Dd, Real, Scalar};

fn network(activation: ActivationChoice, structure: Structure, even: bool) -> NetworkLagrangian<f64> {
    let time_like = matches!(structure, Structure::BlackBox | Structure::Metric).then_some(0);
    let architecture = Architecture {
        coordinates: 3,
        hidden: vec![8, 8],
        activation,
        alpha: if structure == Structure::BlackBox { 0.5 } else { 0.0 },
        time_like,
        scale: vec![2.0, 1.0, 0.5],
        periodic: vec![false, true, true],
        embed_periodic: even,
        input_layer: InputLayer::None,
        dissipation: None,
        form: Form { structure, even_in_v: even && structure != Structure::Metric, ..Form::default() },
    };
    let count = Layout::new(&architecture).parameters;
    NetworkLagrangian::new(architecture, (0..count).map(|k| (k as f64 * 0.7).sin() / 2.0).collect()).unwrap()
}

fn mass_matrix(model: &NetworkLagrangian<Dd>, q: &[Dd], v: &[Dd]) -> Vec<Dd> {
    let mut terms = Terms::default();
    model.terms(q, v, Request::MASS_MATRIX, &mut terms).unwrap();
    terms.mass_matrix
}

/// `M` and its first and second derivatives by coordinates `k`, `l`: central differences of order 2 in double-double, good to
/// about `h^2`.
fn differences(model: &NetworkLagrangian<Dd>, q: &[Dd], v: &[Dd], (k, l): (usize, usize)) -> (Vec<Dd>, Vec<Dd>) {
    let h = dd(1e-6);
    let moved = |a: f64, b: f64| {
        let mut q = q.to_vec();
        q[k] += dd(a) * h;
        q[l] += dd(b) * h;
        mass_matrix(model, &q, v)
    };
    let [up, down] = [moved(1.0, 0.0), moved(-1.0, 0.0)];
    let first = up.iter().zip(&down).map(|(&a, &b)| (a - b) / (dd(2.0) * h)).collect();
    let corners = [moved(1.0, 1.0), moved(-1.0, -1.0), moved(1.0, -1.0), moved(-1.0, 1.0)];
    let second =
        (0..up.len()).map(|i| (corners[0][i] + corners[1][i] - corners[2][i] - corners[3][i]) / (dd(4.0) * h * h));
    (first, second.collect())
}

#[test]
fn jets_are_derivatives_of_the_mass_matrix() {
    for structure in Structure::ALL {
        for (k, activation) in ActivationChoice::ALL.into_iter().enumerate() {
            let model = network(activation, structure, k % 2 == 1);
            // The angles are some turns away.
            let (q, v) = ([0.3, 7.0, -9.0], [0.4, -0.2, 0.1]);
            let jet = &model.metric_jets(&q, &v).unwrap()[0];
            let wide = model.cast::<Dd>();
            let (q, v) = (q.map(dd), v.map(dd));
            let n = 3;
            let size = jet.second.iter().chain(&jet.metric).fold(0f64, |m, x| m.max(x.abs()));
            let check = |found: &[f64], exact: &[Dd], what: &str| {
                for (&found, exact) in found.iter().zip(exact) {
                    let error = (dd(found) - *exact).abs().to_f64();
                    assert!(error < 1e-10 * size, "{what} {activation} {}: {found} {exact}", structure.name());
                }
            };
            check(&jet.metric, &mass_matrix(&wide, &q, &v), "metric");
            for (k, l) in [(0, 0), (0, 1), (1, 1), (2, 1), (2, 2)] {
                let (first, second) = differences(&wide, &q, &v, (k, l));
                check(&jet.first[k * n * n..], &first, "first");
                check(&jet.second[(k * n + l) * n * n..], &second, "second");
                check(&jet.second[(l * n + k) * n * n..], &second, "second");
            }
        }
    }
}

/// Every precision gives the same curvature, and a batch what its points give one by one.
#[test]
fn precisions_and_batches_agree() {
    let model = network(ActivationChoice::Gelu, Structure::Metric, false);
    let points = [0.3, 0.5, -0.2, 1.1, 2.0, 0.4];
    let both = Geometry::of(&model, &points, &[0.0; 3]).unwrap();
    for (k, found) in both.into_iter().enumerate() {
        let (q, found) = (&points[3 * k..3 * k + 3], found.unwrap());
        assert_eq!(found, Geometry::of(&model, q, &[0.0; 3]).unwrap().remove(0).unwrap());
        assert_eq!((found.metric.signature.negative, found.metric.signature.positive), (1, 2));
        let wide =
            Geometry::of(&model.cast::<Dd>(), &[q[0], q[1], q[2]].map(dd), &[dd(0.0); 3]).unwrap().remove(0).unwrap();
        let size = wide.curvature.riemann.iter().fold(0f64, |m, x| m.max(x.to_f64().abs()));
        assert!((found.curvature.scalar - wide.curvature.scalar.to_f64()).abs() < 1e-11 * size);
        let single = [q[0], q[1], q[2]].map(|x| x as f32);
        let single = Geometry::of(&model.cast::<f32>(), &single, &[0f32; 3]).unwrap().remove(0).unwrap();
        assert!((f64::from(single.curvature.scalar) - wide.curvature.scalar.to_f64()).abs() < 1e-2 * size);
    }
}
