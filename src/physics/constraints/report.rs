//! Report of constraints.

use super::examine::{ExaminedLagrangian, OwnConstraint};
use super::{ConstraintKind, FoundConstraint, FoundConstraints};
use crate::findings::Findings;
use crate::names::{percent, pluralize, rounded};

impl FoundConstraints {
    /// The constraints, their accuracy, and the limits of the search.
    pub fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        let on = pluralize(self.trajectories, "trajectory", "trajectories");
        findings.line(match self.count {
            0 => format!("no constraints found on {on}"),
            count => format!("{} found within the noise on {on}", pluralize(count, "constraint", "constraints")),
        });
        if !self.constraints.is_empty() {
            let rows = self.constraints.iter().map(FoundConstraint::row);
            findings.gap().table(&["kind", "formula", "defect"], rows);
        }
        let noise = self.coordinates.iter().zip(&self.noise);
        let noise: Vec<String> = noise.map(|(name, &noise)| format!("{name} {}", percent(noise.max(1e-6)))).collect();
        findings
            .gap()
            .line(format!("noise relative to size, below which deviations cannot be seen: {}", noise.join(", ")));
        findings.lines(self.still.iter().map(|(column, how)| format!("{column} {how}; it was left out")));
        for (kind, text) in [
            (
                ConstraintKind::Nearly,
                "nearly: the deviation is small but larger than the noise; a stiff element, or a curve that looks straight",
            ),
            (
                ConstraintKind::Branching,
                "branching: its gradient vanishes along the motion, where a second branch begins; a roll-out cannot be constrained by it",
            ),
        ] {
            if self.constraints.iter().any(|found| found.kind == kind) {
                findings.line(text);
            }
        }
        if let Some(gap) = self.gap {
            let gap = rounded(gap, 3);
            findings.line(format!("the next combination of coordinates varies {gap} times as much"));
        }
        findings.lines(&self.limits);
        if self.refuted > 0 {
            let what = pluralize(self.refuted, "candidate does", "candidates do");
            findings.line(format!("{what} not hold on held-out trajectories (not listed)"));
        }
        if self.trajectories == 1 && !self.constraints.is_empty() {
            findings.line(
                "one trajectory cannot distinguish constraints from conserved quantities: record more trajectories",
            );
        }
        findings
    }
}

impl FoundConstraint {
    fn row(&self) -> [String; 3] {
        let kind = match self.kind {
            ConstraintKind::Holonomic => "holonomic",
            ConstraintKind::Nonholonomic => "nonholonomic",
            ConstraintKind::PerTrajectory => "per trajectory",
            ConstraintKind::Nearly => "nearly",
            ConstraintKind::Branching => "branching",
        };
        let sign = if self.kind == ConstraintKind::PerTrajectory { "const" } else { "0" };
        [kind.to_string(), format!("{} = {sign}", self.formula), rounded(self.defect, 3)]
    }
}

impl ExaminedLagrangian {
    /// The constraints and the degenerate directions.
    pub fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        findings.line(format!("{}: {}", self.system, pluralize(self.count, "constraint", "constraints")));
        let own = |OwnConstraint { name, formula, .. }: &OwnConstraint| format!("  {name:<12} {formula} = 0");
        findings.lines(self.constraints.iter().map(own));
        findings.lines(self.redundant.iter().map(|name| format!("  {name:<12} follows from the others")));
        findings.line(match self.open {
            0 => format!(
                "the motion is determined: the mass matrix has full rank within the constraints at {} states",
                self.states
            ),
            open => format!(
                "the Lagrangian is degenerate along {} at {} of {} states:",
                pluralize(open, "direction", "directions"),
                self.open_states,
                self.states
            ),
        });
        for direction in &self.null_directions {
            let parts = self.coordinates.iter().zip(direction).map(|(name, x)| format!("{name} {}", rounded(*x, 4)));
            findings.line(format!("  {}", parts.collect::<Vec<_>>().join(", ")));
        }
        findings
    }
}
