//! Recorded forces as forces of a roll-out.

use crate::recording::RecordedTrajectory;
use crate::rollout::SampledForce;

impl RecordedTrajectory {
    /// The known external forces, linear between the samples; `None` if there are none.
    pub(crate) fn sampled_force(&self) -> Option<SampledForce<f64>> {
        let n = self.force.len().checked_div(self.len()).filter(|n| *n > 0)?;
        SampledForce::new(n, self.times.clone(), self.force.clone()).ok()
    }
}
