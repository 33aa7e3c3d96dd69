//! Report of a certificate.

use super::{Certificate, Signature};
use crate::findings::Findings;
use crate::names::pluralize;

impl Certificate {
    /// The shares of the region, bounds, and a state that is proven to violate the conditions; `columns` names coordinates and velocities.
    pub fn findings(&self, columns: &[String]) -> Findings {
        let mut findings = Findings::default();
        let Signature { positive, negative } = self.signature;
        let limit = self.limit.map_or(String::new(), |k| format!(" and a condition number of at most {k}"));
        findings.line(format!(
            "Share of the region where the mass matrix is proven to have {positive} positive and {negative} negative eigenvalues{limit}:"
        ));
        let shares = [("certified", self.certified), ("refuted", self.refuted), ("open", self.open)];
        findings.lines(shares.map(|(name, share)| format!("  {name:<12} {:>9.4} %", 100.0 * share)));
        if self.by_construction {
            findings.line("The structure of the model proves the signature at every state.");
        }
        if let Some(bound) = self.condition {
            findings.line(format!("Condition number in the certified share: at most {bound:.6}."));
        }
        if let Some(witness) = &self.witness {
            let state = columns.iter().map(String::as_str).zip(witness.q.iter().chain(&witness.v));
            let values = witness.eigenvalues.iter().map(|x| ("eigenvalue", x));
            findings.line("A state that is proven to violate the conditions:");
            findings.lines(state.chain(values).map(|(name, x)| format!("  {name:<12} {x:>24.16e}")));
        }
        findings.line(format!("{}, {:.2} s", pluralize(self.boxes, "box", "boxes"), self.seconds));
        findings
    }
}
