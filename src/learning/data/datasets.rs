//! The sets of states of a run.

use crate::data::dataset::Dataset;
use crate::scalar::Scalar;

/// Datasets of a run, in the precision of training.
#[derive(Clone, Debug)]
pub struct Datasets<S> {
    /// Training states of each phase.
    pub training: Vec<Dataset<S>>,
    /// Validation states.
    pub validation: Dataset<S>,
    /// Fresh states for the final figure.
    pub test: Dataset<S>,
}

impl<S: Scalar> Datasets<S> {
    /// Name and checksum of each set: training of every phase, validation, test.
    pub fn checksums(&self) -> Vec<(String, u32)> {
        let training =
            self.training.iter().enumerate().map(|(k, set)| (format!("training states of phase {}", k + 1), set));
        let others = [("validation states".to_string(), &self.validation), ("test states".to_string(), &self.test)];
        training.chain(others).map(|(name, set)| (name, set.checksum())).collect()
    }
}
