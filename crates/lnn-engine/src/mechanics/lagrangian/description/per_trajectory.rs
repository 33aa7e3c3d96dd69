//! Parameters with a value for each trajectory, such as a payload that differs between logs.
//!
//! A parameter `p` is replaced by the definition `p = p_a*[a] + p_b*[b] + ..`, with one parameter for each trajectory and a mark that is 1
//! on this trajectory and 0 on all others. Marks are inputs on which the Lagrangian may depend, since they are constant along a motion.

use super::{Decimal, Description, DescriptionError, ParameterDescription};
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::string::{String, ToString};
use alloc::vec::Vec;

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// The scope in which a parameter has a separate value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
pub enum Per {
    /// Every trajectory of a recording.
    Trajectory,
}

/// A description for given trajectories.
pub struct PerTrajectory {
    /// The description, with parameters `p_NAME` in place of `p`, and one input per trajectory that marks it.
    pub description: Description,
    /// The marks, trajectory by trajectory.
    pub marks: Vec<String>,
    /// For each `p`, the new parameters whose values are unknown.
    pub unknown: BTreeMap<String, Vec<String>>,
}

impl Description {
    /// Returns `true` if a parameter has a separate value for each trajectory.
    pub fn is_per_trajectory(&self) -> bool {
        self.parameters.values().any(|parameter| parameter.per.is_some())
    }

    /// Returns the description for trajectories with these names, with its links expanded. Known values are not learned.
    ///
    /// # Errors
    /// A known value belongs to a trajectory that does not exist, or a name is already used.
    #[doc(hidden)]
    pub fn per_trajectory(&self, names: &[String]) -> Result<PerTrajectory, DescriptionError> {
        let mut all = self.unfolded()?;
        let marks: Vec<String> = (1..=names.len()).map(|k| format!("_trajectory_{k}")).collect();
        let labels = labels(names);
        let open = !self.parameters.values().any(|parameter| parameter.learn);
        let each: BTreeMap<String, ParameterDescription> = all
            .parameters
            .iter()
            .filter(|(_, own)| own.per.is_some())
            .map(|(p, own)| (p.clone(), own.clone()))
            .collect();
        let mut unknown = BTreeMap::new();
        all.parameters.retain(|_, own| own.per.is_none());
        all.parameters.values_mut().for_each(|own| own.learn |= open);
        for (symbol, own) in each {
            if let Some(name) = own.known.keys().find(|name| !names.contains(name)) {
                let problem = format!("no trajectory {name}, expected one of {}", names.join(", "));
                return Err(DescriptionError::new(format!("parameters.{symbol}.known"), problem));
            }
            let (mut sum, mut open) = (Vec::new(), Vec::new());
            for ((name, label), mark) in names.iter().zip(&labels).zip(&marks) {
                let known = own.known.get(name);
                let default = known.unwrap_or(&own.default).clone();
                let of_one = ParameterDescription {
                    default,
                    learn: known.is_none(),
                    per: None,
                    known: BTreeMap::new(),
                    ..own.clone()
                };
                let single = format!("{symbol}_{label}");
                sum.push(format!("{single}*{mark}"));
                open.extend(known.is_none().then(|| single.clone()));
                if all.parameters.insert(single.clone(), of_one).is_some() {
                    return Err(DescriptionError::new(format!("parameters.{single}"), "the name is taken"));
                }
            }
            all.definitions.insert(symbol.clone(), sum.join(" + "));
            unknown.insert(symbol, open);
        }
        all.inputs.extend(marks.iter().map(|mark| (mark.clone(), super::one())));
        all.marks = marks.iter().cloned().collect::<BTreeSet<_>>();
        Ok(PerTrajectory { description: all, marks, unknown })
    }

    /// Number of inputs that mark trajectories.
    pub(crate) fn marks(&self) -> usize {
        self.marks.len()
    }

    /// Sets the value for trajectories whose parameter is unknown, as in a system with values of its parameters.
    pub fn with_default(&mut self, symbol: &str, value: f64) {
        if let Some(own) = self.parameters.get_mut(symbol) {
            own.default = Decimal(value.to_string());
        }
    }
}

/// Converts names of trajectories to unique parts of parameter names: letters, digits and `_`.
fn labels(names: &[String]) -> Vec<String> {
    let plain =
        |name: &String| name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect::<String>();
    let mut found: Vec<String> = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let label = plain(name);
        found.push(if found.contains(&label) { format!("{label}_{}", k + 1) } else { label });
    }
    found
}
