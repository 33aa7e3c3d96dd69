//! Experiments as data, those of Hamzaogullari and Ozakin and some on the presets: every table and figure is a list of training
//! configurations.

use super::reductions::Reduction;
use super::{black_holes, network, physical};
use lnn::configuration::Config;
use lnn::experiments::Run;
use lnn::lagrangian::SystemInstance;
use lnn::names::unknown;
use std::collections::BTreeMap;

/// Pictures of an experiment beside its table and loss curves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Picture {
    /// Lowest loss of each run against its abscissa, a line per group.
    Scan {
        /// Label of the horizontal axis.
        abscissa: &'static str,
    },
    /// How many times lower the penalty makes the lowest loss, against the abscissa, a line per group.
    Gain {
        /// Label of the horizontal axis.
        abscissa: &'static str,
    },
    /// Loss against instability, a point per row.
    TradeOff,
    /// Lowest validation loss so far against seconds of training, a line per run.
    Clock,
    /// Quantities of black holes read off the learned metrics, beside the exact ones: a table per row.
    BlackHole,
    /// Pictures of every run's evaluation whose file name begins so.
    Evaluation(&'static [&'static str]),
}

/// A table or figure, of the paper or beside it.
#[derive(Clone, Copy, Debug)]
pub struct Experiment {
    /// Name on the command line.
    pub name: &'static str,
    /// Heading.
    pub title: &'static str,
    /// Figures and tables of the paper that it regenerates, `-` if there are none.
    pub paper: &'static str,
    /// The paper's finding, in a sentence or two.
    pub finding: &'static str,
    /// Pictures.
    pub pictures: &'static [Picture],
    /// Reductions that the paper states.
    pub reductions: &'static [Reduction],
    /// Runs of one seed at the paper's scale.
    pub runs: fn() -> Vec<Run>,
}

static EXPERIMENTS: &[Experiment] = &[
    network::REGULARIZATION,
    network::SCALING,
    network::QUADRATIC_TERM,
    network::ACTIVATIONS,
    network::INITIALIZATION,
    network::TRAINING_RANGE,
    network::OLD_TRICKS,
    network::BOUNDARY,
    network::ADDED_TERM,
    physical::DOUBLE_PENDULUM,
    physical::SPRING_PENDULUM,
    physical::TRIPLE_PENDULUM,
    physical::SPHERE_GEODESIC,
    physical::ADS4_GEODESIC,
    physical::QUICK,
    physical::BEST,
    physical::TIME_TO_ACCURACY,
    black_holes::BLACK_HOLES,
];

/// All experiments, in the order of the paper.
pub fn experiments() -> &'static [Experiment] {
    EXPERIMENTS
}

/// The experiment of a name.
///
/// # Errors
/// A message with the nearest name.
pub fn find(name: &str) -> Result<&'static Experiment, String> {
    let known = || EXPERIMENTS.iter().map(|e| e.name);
    EXPERIMENTS.iter().find(|e| e.name == name).ok_or_else(|| unknown("experiment", name, known()))
}

impl Experiment {
    /// `true` if the time of its runs matters: they then run one after the other, each on all threads.
    pub fn is_timed(&self) -> bool {
        self.pictures.contains(&Picture::Clock)
    }

    /// `true` if black holes are read off its models.
    pub fn reads_holes(&self) -> bool {
        self.pictures.contains(&Picture::BlackHole)
    }

    /// The runs at a scale, each for `seeds` seeds from 0; runs that the paper itself repeats keep their own seeds apart.
    pub fn runs(&self, scale: Scale, seeds: usize) -> Vec<Run> {
        Self::seeded((self.runs)(), scale, seeds)
    }

    /// The runs of another system than the experiment's own, with these parameters and otherwise its own; `None` if the experiment is about
    /// certain systems.
    pub fn runs_of(
        &self,
        (system, parameters): (&SystemInstance<f64>, &BTreeMap<String, f64>),
        scale: Scale,
        seeds: usize,
    ) -> Option<Vec<Run>> {
        self.reads_holes().then(|| Self::seeded(black_holes::runs_of(system, parameters), scale, seeds))
    }

    fn seeded(runs: Vec<Run>, scale: Scale, seeds: usize) -> Vec<Run> {
        let alone = runs.len() == 1;
        let stride = 1 + runs.iter().map(|run| run.config.seed).max().unwrap_or(0);
        (0..seeds as u64)
            .flat_map(|k| runs.iter().map(move |run| (k, run.clone())))
            .map(|(k, mut run)| {
                run.config.seed += k * stride;
                run.name = format!("{}-seed{}", run.name, run.config.seed);
                scale.apply(&mut run.config, alone);
                run
            })
            .collect()
    }
}

/// Size of an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Scale {
    /// All experiments in minutes; a test that they run.
    Smoke,
    /// Minutes each; enough for a ranking.
    ///
    /// Widths of 128, 30,000 states and 30 epochs; 60,000 states and 300 epochs for an experiment of one run. Learning rates
    /// grow as widths shrink, so that their product is the paper's: with it trainings without a penalty fail as the paper's do, and
    /// without it they do not (for Adam, Yang et al. 2021, "Tensor Programs V").
    Short,
    /// The paper's own.
    Paper,
}

/// Limits that a scale puts on a configuration.
struct Limits {
    states: usize,
    width: usize,
    epochs: usize,
    batch: usize,
}

impl Scale {
    fn limits(self, alone: bool) -> Option<Limits> {
        match self {
            Self::Smoke => Some(Limits { states: 512, width: 16, epochs: 4, batch: 64 }),
            Self::Short if alone => Some(Limits { states: 60_000, width: 128, epochs: 300, batch: 128 }),
            Self::Short => Some(Limits { states: 30_000, width: 128, epochs: 30, batch: 128 }),
            Self::Paper => None,
        }
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Smoke => "smoke",
            Self::Short => "short",
            Self::Paper => "paper",
        }
    }

    /// Starts of the trajectory test and the fraction of the paper's time span.
    pub fn trajectories(self) -> (usize, f64) {
        match self {
            Self::Smoke => (1, 0.02),
            Self::Short | Self::Paper => (4, 1.0),
        }
    }

    /// Cuts states, widths, epochs and batch to the scale; the phases share the epochs in the paper's proportion, and their rates are
    /// those of [`Scale::Short`].
    ///
    /// The period of the annealing shrinks only where less than one fall would fit into a phase.
    /// `alone`: the only run of its experiment.
    fn apply(self, config: &mut Config, alone: bool) {
        let Some(limits) = self.limits(alone) else { return };
        let data = &mut config.data;
        data.training = data.training.min(limits.states);
        data.validation = data.validation.min(limits.states / 5);
        data.test = data.test.min(limits.states / 5);
        config.optimizer.batch = config.optimizer.batch.min(limits.batch);
        let widest = config.network.hidden.iter().copied().max().unwrap_or(0);
        for width in &mut config.network.hidden {
            *width = (*width).min(limits.width);
        }
        let wider = if self == Self::Short { f64::max(1.0, widest as f64 / limits.width as f64) } else { 1.0 };
        let total: usize = config.phases.iter().map(|phase| phase.epochs).sum();
        for phase in &mut config.phases {
            phase.epochs = (phase.epochs * limits.epochs.min(total) / total).max(1);
            phase.t_max = phase.t_max.min(phase.epochs as f64);
            phase.rate *= wider;
        }
    }
}

#[cfg(test)]
#[path = "../../../tests/suite/common/penalties.rs"]
mod penalties;
#[cfg(test)]
mod tests {
    use super::penalties::allow_the_truth;
    use super::*;
    use lnn::experiments::slug;
    use lnn::network::Structure;
    use std::collections::BTreeSet;

    #[test]
    fn every_run_is_valid_and_has_a_name_of_its_own() {
        for experiment in experiments() {
            for scale in [Scale::Smoke, Scale::Short, Scale::Paper] {
                let runs = experiment.runs(scale, 2);
                let names: BTreeSet<&str> = runs.iter().map(|run| run.name.as_str()).collect();
                assert_eq!(names.len(), runs.len(), "{}", experiment.name);
                for run in &runs {
                    let system = run.config.system().unwrap();
                    run.config.validate(system.coordinates).unwrap();
                    run.config.penalty().unwrap();
                    assert_eq!(slug(&run.name), run.name);
                }
            }
        }
    }

    #[test]
    fn names_are_found_and_the_nearest_is_offered() {
        for experiment in experiments() {
            assert_eq!(find(experiment.name).unwrap().title, experiment.title);
        }
        assert!(find("activation").unwrap_err().contains("activations"));
    }

    #[test]
    fn the_short_scale_keeps_width_times_rate() {
        let of = |scale| find("regularization").unwrap().runs(scale, 1).remove(0).config;
        let (paper, short) = (of(Scale::Paper), of(Scale::Short));
        let product = |config: &Config| config.network.hidden[0] as f64 * config.phases[0].rate;
        assert!((product(&paper) / product(&short) - 1.0).abs() < 1e-12);
        assert_eq!((short.network.hidden[0], short.phases[0].epochs), (128, 30));
        // A preset that is no wider keeps its rate.
        let quick = |scale| find("quick").unwrap().runs(scale, 1).remove(0).config.phases[0].rate;
        assert_eq!(quick(Scale::Short), quick(Scale::Paper));
    }

    #[test]
    fn the_paper_scale_is_the_papers_own() {
        let runs = find("regularization").unwrap().runs(Scale::Paper, 1);
        assert_eq!(runs.len(), 12);
        let seeds: BTreeSet<u64> =
            runs.iter().filter(|r| r.config.penalty.lambda() == 0.0).map(|r| r.config.seed).collect();
        assert_eq!(seeds.len(), 4);
        for run in &runs {
            let c = &run.config;
            assert_eq!(
                (c.data.training, c.phases[0].epochs, c.network.hidden.as_slice()),
                (60_000, 300, [500; 3].as_slice())
            );
        }
    }

    /// Every penalty, once per system, against the exact mass matrices of its training states.
    #[test]
    fn no_penalty_forbids_the_truth() {
        let runs = experiments().iter().flat_map(|experiment| experiment.runs(Scale::Smoke, 1)).map(|run| run.config);
        assert!(allow_the_truth(runs) > 10);
    }

    /// On a mass shell alone a metric is not identifiable by a function of velocities.
    #[test]
    fn black_boxes_beside_black_holes_have_states_off_the_shell() {
        let holes = experiments().iter().find(|experiment| experiment.reads_holes()).unwrap();
        for run in holes.runs(Scale::Paper, 1) {
            let black_box = run.config.network.structure == Structure::BlackBox;
            assert_eq!(run.config.data.rescaled_fraction, if black_box { 0.75 } else { 0.0 }, "{}", run.name);
        }
    }
}
