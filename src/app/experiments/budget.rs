//! Shares of the paper's budget that an experiment may take.

use crate::configuration::Config;

/// Size of an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Minutes for all experiments together: shows that everything runs, not what is better.
    Smoke,
    /// Minutes each: widths of 128, 30,000 states and 90 epochs, enough to read a ranking; 60,000 states and 300 epochs for
    /// an experiment of one run.
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
            Self::Short => Some(Limits { states: 30_000, width: 128, epochs: 90, batch: 128 }),
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

    /// Cuts states, widths, epochs and batch to the scale; the phases share the epochs in the paper's proportion.
    ///
    /// The period of the annealing shrinks only where less than one fall would fit into a phase.
    /// `alone`: the only run of its experiment.
    pub(super) fn apply(self, config: &mut Config, alone: bool) {
        let Some(limits) = self.limits(alone) else { return };
        let data = &mut config.data;
        data.training = data.training.min(limits.states);
        data.validation = data.validation.min(limits.states / 5);
        data.test = data.test.min(limits.states / 5);
        config.optimizer.batch = config.optimizer.batch.min(limits.batch);
        for width in &mut config.network.hidden {
            *width = (*width).min(limits.width);
        }
        let total: usize = config.phases.iter().map(|phase| phase.epochs).sum();
        for phase in &mut config.phases {
            phase.epochs = (phase.epochs * limits.epochs.min(total) / total).max(1);
            phase.t_max = phase.t_max.min(phase.epochs as f64);
        }
    }
}
