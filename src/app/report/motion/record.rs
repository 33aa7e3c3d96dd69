//! A record of a motion of any length: its end, its energy, where it left the training range, and points of its curves.

use crate::lagrangian::EulerLagrange;
use crate::names::rounded;
use crate::report::thresholds::{INVARIANT_STATES, MOST_CURVE_POINTS};
use crate::rollout::{Domain, Trajectory};
use crate::symmetry::Invariant;
use serde::Serialize;
use std::ops::Range;

/// The first sample outside the states that a model was trained on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Leaving {
    /// Its time.
    pub t: f64,
    /// The component that left the range.
    pub column: String,
    /// Its value.
    pub value: f64,
    /// The range of the training states.
    pub trained_on: [f64; 2],
}

impl Leaving {
    /// Describes it in words.
    pub fn text(&self) -> String {
        let Self { t, column, value, trained_on: [low, high] } = self;
        format!(
            "left the training range at t = {t}: {column} reached {}, trained on [{low}, {high}]",
            rounded(*value, 6)
        )
    }
}

/// Records a motion whose samples arrive in pieces; stores few of them.
pub struct MotionRecord {
    domain: Domain<f64>,
    pub(super) columns: Vec<String>,
    /// Where it left the training range.
    pub leaving: Option<Leaving>,
    /// Time of the last sample.
    pub end: f64,
    /// Value of `p.v - L` at the start, and its largest deviation from that.
    pub energy: (f64, f64),
    /// Times, and values of every column and of the energy, of every `stride`-th sample.
    pub(super) times: Vec<f64>,
    pub(super) values: Vec<Vec<f64>>,
    stride: usize,
    seen: usize,
}

impl MotionRecord {
    /// Starts recording a motion; `columns` are those of the model, and `domain` contains its training states.
    pub fn new(domain: Domain<f64>, columns: &[String]) -> Self {
        let values = vec![Vec::new(); columns.len() + 1];
        let columns = columns.to_vec();
        let energy = (f64::NAN, 0.0);
        Self { domain, columns, leaving: None, end: f64::NAN, energy, times: Vec::new(), values, stride: 1, seen: 0 }
    }

    /// Records the next samples.
    pub fn add(&mut self, piece: &Trajectory<f64>) {
        for k in 0..piece.len() {
            let (q, v) = piece.state(k);
            let state = [q, v].concat();
            if self.leaving.is_none()
                && let Some((component, low, high)) = self.domain.violation(&state)
            {
                let column = self.columns.get(component).cloned().unwrap_or_default();
                self.leaving =
                    Some(Leaving { t: piece.t[k], column, value: state[component], trained_on: [low, high] });
            }
            self.end = piece.t[k];
            let energy = piece.energy.as_ref().and_then(|energy| energy.get(k)).copied().unwrap_or(f64::NAN);
            match self.seen {
                0 => self.energy.0 = energy,
                _ => self.energy.1 = (energy - self.energy.0).abs().max(self.energy.1),
            }
            if self.seen.is_multiple_of(self.stride) {
                self.times.push(piece.t[k]);
                for (values, x) in self.values.iter_mut().zip(state.into_iter().chain([energy])) {
                    values.push(x);
                }
            }
            self.seen += 1;
            if self.times.len() > MOST_CURVE_POINTS {
                self.stride *= 2;
                thin(&mut self.times);
                self.values.iter_mut().for_each(thin);
            }
        }
    }

    /// Name of the parameter of the motion: `t`, or `tau` if a coordinate is called `t`.
    pub fn parameter(&self) -> &'static str {
        if self.columns.iter().any(|name| name == "t") { "tau" } else { "t" }
    }

    /// The quantity that a model without friction conserves along its motion; `None` if its terms do not show one.
    pub fn invariant(&self, model: &dyn EulerLagrange<f64>) -> Option<Invariant> {
        let n = self.columns.len() / 2;
        let states = (0..self.times.len()).step_by(self.times.len().div_ceil(INVARIANT_STATES).max(1));
        let part = |columns: Range<usize>| {
            states.clone().flat_map(move |k| self.values[columns.clone()].iter().map(move |values| values[k]))
        };
        let (q, v): (Vec<f64>, Vec<f64>) = (part(0..n).collect(), part(n..2 * n).collect());
        Invariant::of(model, &q, &v).ok().filter(|found| *found != Invariant::Nothing)
    }
}

fn thin(values: &mut Vec<f64>) {
    let mut k = 0;
    values.retain(|_| {
        k += 1;
        k % 2 == 1
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::MotionTexts;

    #[test]
    fn long_motions_are_thinned_and_watched() {
        let domain = Domain::new(vec![Some((-1.0, 5000.0)), None]);
        let mut watch = MotionRecord::new(domain, &["x".to_string(), "x_dot".to_string()]);
        let piece = |k: usize| Trajectory {
            coordinates: 1,
            t: vec![k as f64],
            q: vec![k as f64],
            v: vec![1.0],
            energy: Some(vec![0.5]),
        };
        (0..10_001).for_each(|k| watch.add(&piece(k)));
        assert!(watch.times.len() <= MOST_CURVE_POINTS + 1 && watch.times.len() > MOST_CURVE_POINTS / 2);
        assert!(watch.times.windows(2).all(|t| t[1] - t[0] == watch.stride as f64) && watch.times[0] == 0.0);
        let leaving = watch.leaving.as_ref().unwrap();
        assert_eq!((leaving.t, leaving.column.as_str(), leaving.trained_on), (5001.0, "x", [-1.0, 5000.0]));
        let units = ["m", "m/s"].map(String::from);
        let texts = |parameter, energy| MotionTexts { title: "Motion", parameter, energy, units: &units };
        assert!(watch.to_svg(&texts("time [s]", "energy"), None).unwrap().starts_with("<svg"));
        let page = watch.to_html(&texts("affine parameter", "g(v, v)/2"), None).unwrap();
        assert!(page.contains("g(v, v)/2 of the model against affine parameter") && !page.contains("nergy"), "{page}");
        assert_eq!(watch.energy, (0.5, 0.0));
        assert!(page.matches("<figure").count() == 3 && page.contains("left the training range at t = 5001"));
        assert!(page.contains(">x [m]</text>") && page.contains(">x_dot [m/s]</text>"));
    }
}
