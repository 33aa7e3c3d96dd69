//! The paper's network experiments, all on the double pendulum (its appendix "Training details of network experiments").

use super::experiments::{Experiment, Picture};
use super::physical::config_of;
use super::reductions::{Quantity, Reduction};
use lnn::configuration::{Config, Precision, Regularizer, Scaling};
use lnn::experiments::{Reported, Run, slug};
use lnn::network::{ActivationChoice, Initialization, InputLayer};
use lnn::presets::Preset;
use std::f64::consts::PI;

/// Angle bounds of a training.
type Range = [f64; 2];

const WIDE: Range = [-3.0 * PI, 3.0 * PI];
const EXTENDED: Range = [-0.5 * PI, 2.5 * PI];
const TURN: Range = [0.0, 2.0 * PI];

/// The baseline of the appendix: angles in `[-3 pi, 3 pi]`, 300 epochs, rate 1e-3, lowest 1e-6, period 30.
///
/// The appendix names no regularizer for experiments other than its own; as in the physical experiments it is the
/// eigenvalue penalty with weight 5.
fn baseline() -> Config {
    let mut config = config_of(Preset::Paper, "double-pendulum");
    config.phases.truncate(1);
    trained_on(config, WIDE)
}

fn trained_on(mut config: Config, range: Range) -> Config {
    for phase in &mut config.phases {
        phase.position.fill(range);
    }
    config
}

fn run(group: &str, label: &str, config: Config) -> Run {
    Run {
        name: slug(label),
        label: label.to_string(),
        abscissa: None,
        group: group.to_string(),
        config,
        reported: Reported::default(),
    }
}

const fn reduction(quantity: Quantity, group: &'static str, against: &'static str, paper: f64) -> Reduction {
    Reduction { quantity, group, against, paper }
}

/// A run with a seed and with figures of the paper.
trait With {
    fn seed(self, seed: u64) -> Self;
    fn reported(self, loss: f64, instability: f64) -> Self;
}

impl With for Run {
    fn seed(mut self, seed: u64) -> Self {
        self.config.seed = seed;
        self
    }
    fn reported(mut self, loss: f64, instability: f64) -> Self {
        self.reported = Reported { loss: Some(loss), instability: Some(instability), ..Reported::NOTHING };
        self
    }
}

pub(super) const REGULARIZATION: Experiment = Experiment {
    name: "regularization",
    title: "Effect of the Hessian regularization",
    paper: "Figs. regularization_existence, regularization_comparison, lambda_values",
    finding: "Validation loss 96.6 % (eigenvalue) and 96.4 % (Sylvester) below the mean of the unregularized runs, \
              instability 90.7 % and 71.6 % below; 2 of 4 unregularized models useless for integration; the best \
              weight is 100 for both, and larger ones cost little.",
    pictures: &[Picture::Scan { abscissa: "lambda" }, Picture::TradeOff],
    reductions: &[
        reduction(Quantity::Loss, "eigenvalue", "none", 0.966),
        reduction(Quantity::Loss, "Sylvester", "none", 0.964),
        reduction(Quantity::Instability, "eigenvalue", "none", 0.9068),
        reduction(Quantity::Instability, "Sylvester", "none", 0.7162),
    ],
    runs: || {
        let base = || trained_on(baseline(), EXTENDED);
        let without = (0..4).map(|seed| {
            let config = Config { penalty: Regularizer::None, ..base() };
            run("none", "no regularization", config).seed(seed)
        });
        let scan = |group: &'static str, weights: [f64; 4], penalty: fn(f64) -> Regularizer| {
            weights.map(|lambda| Run {
                abscissa: Some(lambda),
                ..run(group, &format!("{group}, lambda {lambda}"), Config { penalty: penalty(lambda), ..base() })
            })
        };
        let eigenvalue = scan("eigenvalue", [1.0, 10.0, 100.0, 1e3], |lambda| Regularizer::Eigenvalue { lambda });
        let sylvester = scan("Sylvester", [10.0, 100.0, 1e3, 1e4], |lambda| Regularizer::Sylvester { lambda });
        without.chain(eigenvalue).chain(sylvester).collect()
    },
};

pub(super) const SCALING: Experiment = Experiment {
    name: "scaling",
    title: "Effect of scaling",
    paper: "Fig. scaling_performance",
    finding: "Normalised loss 40.9 % lower with physical scaling than without, instability 97.6 % lower; DyT falls short \
              of it. All with x tanh(kx).",
    pictures: &[Picture::TradeOff],
    reductions: &[
        reduction(Quantity::PhysicalLoss, "physical scaling", "no scaling", 0.4087),
        reduction(Quantity::PhysicalInstability, "physical scaling", "no scaling", 0.9755),
    ],
    runs: || {
        let model = |label: &str, scaling: Scaling, input_layer: InputLayer| {
            let mut config = baseline();
            config.network.activation = ActivationChoice::XTanh;
            config.network.scaling = scaling;
            config.network.input_layer = input_layer;
            run(label, label, config)
        };
        vec![
            model("physical scaling", Scaling::Physical, InputLayer::None),
            model("no scaling", Scaling::None, InputLayer::None),
            model("DyT", Scaling::None, InputLayer::Dyt),
        ]
    },
};

pub(super) const QUADRATIC_TERM: Experiment = Experiment {
    name: "quadratic-term",
    title: "Effect of the initial quadratic term",
    paper: "Fig. extraterm_performance",
    finding: "The term |v|^2 lowers instability substantially, and the mean validation loss too.",
    pictures: &[Picture::TradeOff],
    reductions: &[],
    runs: || {
        let model = |activation: ActivationChoice, alpha: f64| {
            let mut config = baseline();
            config.network.activation = activation;
            config.network.alpha = alpha;
            let with = if alpha == 0.0 { "without |v|^2" } else { "with |v|^2" };
            run(with, &format!("{activation} {with}"), config)
        };
        let pendulum = [ActivationChoice::Gelu, ActivationChoice::XTanh, ActivationChoice::Softplus]
            .into_iter()
            .flat_map(|activation| [1.0, 0.0].map(|alpha| model(activation, alpha)));
        pendulum.collect()
    },
};

/// Preset quick of anti-de Sitter space.
pub(super) const ADDED_TERM: Experiment = Experiment {
    name: "added-term",
    title: "Signs of the added squares of a spacetime",
    paper: "-",
    finding: "The relativistic models of the authors add the squares with the signs of the metric.",
    pictures: &[Picture::TradeOff],
    reductions: &[],
    runs: || {
        let rows = [("-t'^2 + x'^2 + y'^2 + z'^2", true, 1.0), ("|v|^2", false, 1.0), ("nothing added", true, 0.0)];
        let row = |(label, signed, alpha): (&str, bool, f64)| {
            let mut config = config_of(Preset::Quick, "ads4-geodesic");
            config.network.alpha = alpha;
            config.network.time_like = config.network.time_like.filter(|_| signed);
            run(label, label, config)
        };
        rows.map(row).to_vec()
    },
};

/// Product of width and learning rate over that of the paper.
const PRODUCTS: [f64; 3] = [0.25, 1.0, 4.0];

pub(super) const BOUNDARY: Experiment = Experiment {
    name: "boundary",
    title: "Where a training needs the penalty",
    paper: "-",
    finding: "With the choices of the first group, 2 of 4 models without the penalty were useless.",
    pictures: &[Picture::Gain { abscissa: "width times rate" }],
    reductions: &[],
    runs: || {
        let varied = |group: &str, change: fn(&mut Config)| {
            let mut config = trained_on(baseline(), EXTENDED);
            change(&mut config);
            let pairs = PRODUCTS.into_iter().flat_map(|product| [(product, 0.0), (product, 100.0)]);
            let runs = pairs.map(|(product, lambda)| {
                let mut config = Config { penalty: Regularizer::Eigenvalue { lambda }, ..config.clone() };
                config.phases.iter_mut().for_each(|phase| phase.rate *= product);
                let penalty = if lambda == 0.0 { "no penalty" } else { "penalty" };
                let label = format!("{group}, rate times {product}, {penalty}");
                Run { abscissa: Some(product), ..run(group, &label, config) }
            });
            runs.collect::<Vec<Run>>()
        };
        [
            varied("the paper's choices", |_| ()),
            varied("x tanh(kx)", |config| config.network.activation = ActivationChoice::XTanh),
            varied("softplus", |config| config.network.activation = ActivationChoice::Softplus),
            varied("without |v|^2", |config| config.network.alpha = 0.0),
            varied("variance-preserving", |config| {
                config.network.initialization = Initialization::VariancePreserving;
            }),
            varied("[-3 pi, 3 pi]", |config| config.phases.iter_mut().for_each(|phase| phase.position.fill(WIDE))),
            varied("double precision", |config| config.precision = Precision::F64),
        ]
        .concat()
    },
};

/// Activations of the paper with both initialisations.
fn activation_run(label: &str, activation: ActivationChoice, initialization: Initialization) -> Run {
    let mut config = baseline();
    config.network.activation = activation;
    config.network.initialization = initialization;
    run(activation.name(), label, config)
}

pub(super) const ACTIVATIONS: Experiment = Experiment {
    name: "activations",
    title: "Activation functions",
    paper: "Table activation_comparison, Fig. activation_comparison",
    finding: "GELU is best in loss and instability, x tanh(kx) follows, softplus and the hybrid are far behind. Each row \
              is the mean over default and variance-preserving initialisation.",
    pictures: &[Picture::TradeOff],
    reductions: &[],
    runs: || {
        [
            ("GELU", ActivationChoice::Gelu, 0.00738, 0.01452),
            ("x tanh(kx)", ActivationChoice::XTanh, 0.01114, 0.05048),
            ("softplus", ActivationChoice::Softplus, 0.04452, 0.02850),
            ("quadratic-softplus hybrid", ActivationChoice::QuadraticSoftplus, 0.16380, 0.04915),
        ]
        .into_iter()
        .flat_map(|(label, activation, loss, instability)| {
            [("default", Initialization::Default), ("custom", Initialization::VariancePreserving)].map(
                |(word, kind)| {
                    let run = activation_run(label, activation, kind).reported(loss, instability);
                    Run { name: format!("{}-{word}", run.name), ..run }
                },
            )
        })
        .collect()
    },
};

pub(super) const INITIALIZATION: Experiment = Experiment {
    name: "initialization",
    title: "Weight initialisation",
    paper: "Table initialization_comparison",
    finding: "Variance-preserving initialisation improves softplus, the hybrid and x tanh(kx), and slightly harms GELU.",
    pictures: &[Picture::TradeOff],
    reductions: &[],
    runs: || {
        use ActivationChoice::{Gelu, QuadraticSoftplus as Hybrid, Softplus, XTanh};
        use Initialization::{Default as Plain, VariancePreserving as Custom};
        [
            ("GELU v2", Gelu, Plain, 1, 0.006859, 0.02867),
            ("GELU", Gelu, Plain, 0, 0.007114, 0.01179),
            ("GELU, custom", Gelu, Custom, 0, 0.007649, 0.01726),
            ("GELU v2, custom", Gelu, Custom, 1, 0.009203, 0.006530),
            ("x tanh(kx), custom", XTanh, Custom, 0, 0.009808, 0.09090),
            ("x tanh(kx)", XTanh, Plain, 0, 0.012475, 0.01007),
            ("softplus, custom", Softplus, Custom, 0, 0.032768, 0.02932),
            ("hybrid, custom", Hybrid, Custom, 0, 0.050726, 0.03244),
            ("softplus", Softplus, Plain, 0, 0.056272, 0.02768),
            ("hybrid", Hybrid, Plain, 0, 0.276867, 0.06585),
        ]
        .into_iter()
        .map(|(label, activation, kind, seed, loss, instability)| {
            activation_run(label, activation, kind).seed(seed).reported(loss, instability)
        })
        .collect()
    },
};

pub(super) const TRAINING_RANGE: Experiment = Experiment {
    name: "training-range",
    title: "Training range of the angles",
    paper: "Fig. training_range",
    finding: "Trained on [0, 2 pi] alone, det M has wrong signs near 0 and 2 pi at high velocity; a range extended by \
              pi/10 to pi/2 on both sides cures it.",
    pictures: &[Picture::Evaluation(&["det_mass_matrix"])],
    reductions: &[],
    runs: || {
        let extended = |by: f64| [-by, 2.0 * PI + by];
        [
            ("[-3 pi, 3 pi]", WIDE, 0),
            ("[0, 2 pi]", TURN, 0),
            ("[0, 2 pi] v2", TURN, 1),
            ("[-pi/2, 2 pi + pi/2]", EXTENDED, 0),
            ("[-pi/4, 2 pi + pi/4]", extended(PI / 4.0), 0),
            ("[-pi/10, 2 pi + pi/10]", extended(PI / 10.0), 0),
        ]
        .into_iter()
        .zip(["wide", "turn", "turn-v2", "half-pi", "quarter-pi", "tenth-pi"])
        .map(|((label, range, seed), name)| {
            let run = run(label, label, trained_on(baseline(), range)).seed(seed);
            Run { name: name.to_string(), ..run }
        })
        .collect()
    },
};

pub(super) const OLD_TRICKS: Experiment = Experiment {
    name: "old-tricks",
    title: "Tricks suggested before",
    paper: "Fig. old_models",
    finding: "The paper's model is better in loss and stability than softplus with the initialisation of Cranmer et al. \
              (2020) and than the hybrid network with |v|^2 of Liu et al. (2021), both on [0, 2 pi] without penalty.",
    pictures: &[Picture::TradeOff],
    reductions: &[],
    runs: || {
        let old = |label: &str, activation, initialization, alpha| {
            let mut config = Config { penalty: Regularizer::None, ..trained_on(baseline(), TURN) };
            config.network.activation = activation;
            config.network.initialization = initialization;
            config.network.alpha = alpha;
            run(label, label, config)
        };
        let ours = Config { penalty: Regularizer::Eigenvalue { lambda: 100.0 }, ..trained_on(baseline(), EXTENDED) };
        vec![
            old("Cranmer initialisation", ActivationChoice::Softplus, Initialization::CranmerPaper, 0.0),
            old("Liu tricks", ActivationChoice::QuadraticSoftplus, Initialization::Default, 1.0),
            run("paper's model", "paper's model", ours),
        ]
    },
};
