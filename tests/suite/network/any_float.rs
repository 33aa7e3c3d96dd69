//! The engine over a number of another crate, beside `f64`.

use lnn::configuration::Penalty;
use lnn::data::Dataset;
use lnn::lagrangian::systems::DoublePendulum;
use lnn::lagrangian::{EulerLagrange, Mechanics, Request, SystemInstance, Terms};
use lnn::network::{Activation, ActivationChoice, Architecture, Form, Initialization, InputLayer, NetworkLagrangian};
use lnn::rollout::{Integrator, RolloutOptions, rollout_fixed};
use lnn::scalar::{AnyFloat, Real, Scalar};
use lnn::tape::{Depth, Evaluation, MixedDirections, ScalarFunction, gradient};
use lnn::training::Objective;
use ordered_float::OrderedFloat;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

type Results = Vec<(&'static str, Vec<f64>)>;

const Q: [f64; 6] = [0.4, -1.3, 2.9, 7.5, -0.2, 0.7];
const V: [f64; 6] = [1.1, 0.3, -2.4, 0.8, 0.0, 1.9];

fn numbers<S: Scalar>(x: &[f64]) -> Vec<S> {
    x.iter().map(|&x| S::of_f64(x)).collect()
}

fn floats<S: Scalar>(x: &[S]) -> Vec<f64> {
    x.iter().map(|x| x.to_f64()).collect()
}

fn double_pendulum<S: Scalar>() -> Mechanics<DoublePendulum, S> {
    Mechanics::new(DoublePendulum, SystemInstance::named("double-pendulum", &[]).unwrap().parameters)
}

/// Accelerations of any model.
fn terms<S: Scalar>(model: &dyn EulerLagrange<S>) -> Results {
    let mut terms = Terms::default();
    let request = Request::MASS_MATRIX | Request::ACCELERATION | Request::ENERGY;
    model.terms(&numbers::<S>(&Q), &numbers::<S>(&V), request, &mut terms).unwrap();
    vec![
        ("mass matrix", floats(&terms.mass_matrix)),
        ("acceleration", floats(&terms.acceleration)),
        ("energy", floats(&terms.energy)),
    ]
}

/// Steps of Gauss's method of order 6.
fn motion<S: Scalar>(model: &dyn EulerLagrange<S>) -> Results {
    let [t_end, dt, step] = [0.3, 0.1, 0.05].map(S::of_f64);
    let options = RolloutOptions::new(t_end, dt).method(Integrator::Gauss6).step(step);
    let rolled = rollout_fixed(model, &numbers::<S>(&Q[..2]), &numbers::<S>(&V[..2]), &options).complete().unwrap();
    vec![("motion", floats(&rolled.q)), ("velocities", floats(&rolled.v))]
}

/// A recorded network: its terms, and the gradient of its mixed derivatives by the weights.
fn network<S: Scalar>(activation: ActivationChoice) -> Results {
    let architecture = Architecture {
        coordinates: 2,
        hidden: [12, 12].map(|width| width * activation.branches().len()).to_vec(),
        activation,
        alpha: 0.75,
        time_like: None,
        scale: vec![1.5, 2.0],
        periodic: vec![true, false],
        embed_periodic: true,
        input_layer: InputLayer::Dyt,
        dissipation: None,
        form: Form::default(),
    };
    let rng = || ChaCha8Rng::seed_from_u64(7);
    let weights: Vec<S> =
        architecture.initial_weights::<f64>(Initialization::Default, &mut rng()).into_iter().map(S::of_f64).collect();
    let mut chunk = Evaluation::new(architecture.model::<S>().lagrangian().clone());
    chunk.evaluate(&weights, &numbers::<S>(&Q), &numbers::<S>(&V), Depth::Training);
    let directions = MixedDirections { s: numbers::<S>(&V), t: numbers::<S>(&Q), moving: true };
    let mut slope = vec![<S as Real>::zero(); weights.len()];
    chunk.add_gradient(&weights, &directions, &mut slope, None);
    let mut results = vec![
        ("Lagrangian", floats(&chunk.lagrangian)),
        ("momentum", floats(&chunk.momentum)),
        ("dL/dq", floats(&chunk.dl_dq)),
        ("Coriolis", floats(&chunk.coriolis)),
        ("gradient", floats(&slope)),
    ];

    let data = Dataset::new(2, numbers::<S>(&Q), numbers::<S>(&V), numbers::<S>(&[1.0; 6])).unwrap();
    let mut objective = Objective::new(&architecture, Penalty::Eigenvalue { lambda: 0.1 }, 2).unwrap();
    let report = objective.step(&weights, &data, &[0, 1, 2], &mut slope);
    results.extend([("loss", vec![report.loss.to_f64()]), ("gradient of the loss", floats(&slope))]);

    let model = NetworkLagrangian::new(architecture, weights).unwrap();
    results.extend(terms::<S>(&model));
    results.extend(motion::<S>(&model));
    results
}

/// What `num_traits` has no name for.
struct Special;
impl ScalarFunction for Special {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let sum = |a: R, &x: &R| {
            a + x.erfc() * Activation::Gelu.apply(x) + x.logistic() * x.softplus() + (x.ln_cosh() + x.relu()).sin()
        };
        x.iter().fold(R::zero(), sum)
    }
}

fn special<S: Scalar>() -> Results {
    let (value, slope) = gradient(&Special, &numbers::<S>(&Q)).unwrap();
    let wrapped: Vec<S> = numbers::<S>(&[-3.0, 6.5, 1e9, -1e-20]).iter().map(|x| x.wrap_angle()).collect();
    vec![("special functions", vec![value.to_f64()]), ("their slopes", floats(&slope)), ("angles", floats(&wrapped))]
}

fn everything<S: Scalar>() -> Results {
    let mut results = terms::<S>(&double_pendulum::<S>());
    results.extend(motion::<S>(&double_pendulum::<S>()));
    for activation in ActivationChoice::ALL {
        results.extend(network::<S>(activation));
    }
    results.extend(special::<S>());
    results
}

#[test]
fn a_number_of_another_crate_gives_what_f64_gives() {
    let (found, expected) = (everything::<AnyFloat<OrderedFloat<f64>>>(), everything::<f64>());
    assert!(found.len() == expected.len() && found.len() > 60);
    let size = |x: &[f64]| x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    for ((what, found), (_, expected)) in found.iter().zip(&expected) {
        assert_eq!(found.len(), expected.len());
        let difference: Vec<f64> = found.iter().zip(expected).map(|(x, y)| x - y).collect();
        // Sums of some hundred terms, and mass matrices with condition numbers of some hundreds.
        let error = size(&difference) / size(expected);
        assert!(error <= 1e-12, "{what}: {error:e}");
    }
}

#[test]
fn nan_compares_as_it_should_whatever_its_type_says() {
    type Number = AnyFloat<OrderedFloat<f64>>;
    let (nan, one) = (Number::nan(), <Number as Real>::one());
    assert!(nan.0 == nan.0 && nan.0 > one.0, "a total order");
    assert!(nan != nan && nan.partial_cmp(&one).is_none() && nan.partial_cmp(&nan).is_none());
    assert!(nan.select(one, -one).is_nan() && Real::max(nan, one).is_nan() && Real::min(one, nan).is_nan());
    assert_eq!(Number::parse("-1.25e-3").map(|x| x.to_text()), Some("-0.00125".to_string()));
    assert_eq!(Number::parse("1e"), None);
}
