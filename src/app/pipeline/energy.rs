//! The energy balance of held-out motion by a model: change, work, friction and remainder.

use crate::data::Split;
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::pipeline::thresholds::STATES_AT_ONCE;
use crate::recording::{RecordedTrajectory, Smoothed};
use crate::report::{Figure, LinePlot, Series, figure, line_plot, median_of};
use crate::rollout::{Driven, Trajectory};
use serde::Serialize;

/// Energy balance of held-out trajectories, averaged over them, in the unit of the learned `L`, which is J only if forces were given:
/// `change = work - friction + defect`.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Balance {
    /// Number of trajectories.
    pub trajectories: usize,
    /// Mean over the samples of `p.v/2`, the kinetic energy of a mechanical system.
    pub kinetic: f64,
    /// Energy at the end of a trajectory minus energy at its start.
    pub change: f64,
    /// Work of the known forces.
    pub work: f64,
    /// Energy dissipated by friction.
    pub friction: f64,
    /// Change of energy that neither friction nor forces explain.
    pub defect: f64,
    /// Root mean square of the defect over the trajectories, since the mean may cancel.
    pub defect_rms: f64,
    /// `true` if any force was known.
    #[serde(skip)]
    pub forced: bool,
}

/// Energy along a trajectory divided by its mean kinetic energy.
struct EnergyPath {
    times: Vec<f64>,
    energy: Vec<f64>,
    kinetic: Vec<f64>,
    /// The energy expected from friction and known forces.
    expected: Vec<f64>,
    /// `true` if friction or a force did work.
    driven: bool,
}

impl EnergyPath {
    /// Evaluates the energy at the estimated states with full windows; `None` if the model gives no finite energy.
    fn new(model: &dyn EulerLagrange<f64>, track: &RecordedTrajectory, states: &Smoothed) -> Option<Self> {
        let n = model.coordinates();
        let rows = states.interior();
        let of = |values: &[f64]| values[rows.start * n..rows.end * n].to_vec();
        let (times, q, v) = (&states.times[rows.clone()], of(&states.q), of(&states.v));
        let force = if track.force.is_empty() { vec![0.0; q.len()] } else { of(&track.force) };
        let (mut energy, mut kinetic, mut power, mut terms) = (Vec::new(), Vec::new(), Vec::new(), Terms::default());
        let size = STATES_AT_ONCE * n;
        for ((q, v), force) in q.chunks(size).zip(v.chunks(size)).zip(force.chunks(size)) {
            model.terms(q, v, Request::ENERGY | Request::FORCE, &mut terms).ok()?;
            energy.extend_from_slice(&terms.energy);
            let dot = |a: &[f64]| -> Vec<f64> {
                a.chunks(n).zip(v.chunks(n)).map(|(a, v)| a.iter().zip(v).map(|(a, v)| a * v).sum()).collect()
            };
            kinetic.extend(dot(&terms.momentum).iter().map(|p| 0.5 * p));
            terms.dissipation.resize(q.len() / n, 0.0);
            power.extend(dot(force).iter().zip(&terms.dissipation).map(|(gained, lost)| gained - lost));
        }
        let mean = kinetic.iter().sum::<f64>() / kinetic.len() as f64;
        let scaled = |values: Vec<f64>| values.into_iter().map(|x| x / mean).collect::<Vec<f64>>();
        let driven = power.iter().any(|power| *power != 0.0);
        let (energy, kinetic, power) = (scaled(energy), scaled(kinetic), scaled(power));
        // By the trapezoidal rule, which is accurate enough for a picture.
        let mut expected = vec![*energy.first()?];
        for k in 1..times.len() {
            expected.push(expected[k - 1] + 0.5 * (power[k] + power[k - 1]) * (times[k] - times[k - 1]));
        }
        Some(Self { times: times.iter().map(|t| t - times[0]).collect(), energy, kinetic, expected, driven })
    }

    /// Root mean square difference between energy and expected energy.
    fn error(&self) -> f64 {
        let squares = self.energy.iter().zip(&self.expected).map(|(a, b)| (a - b).powi(2));
        (squares.sum::<f64>() / self.energy.len() as f64).sqrt()
    }
}

/// Energy along the held-out trajectory with the median energy error: that of the model, its kinetic and potential parts, and the energy
/// expected from friction and known forces, divided by the mean kinetic energy. `None` if the model gives no finite energy.
pub fn energy_figure(model: &dyn EulerLagrange<f64>, part: &Split) -> Option<Figure> {
    let pairs = part.recording.tracks.iter().zip(&part.states);
    let paths: Vec<EnergyPath> = pairs.filter_map(|(track, states)| EnergyPath::new(model, track, states)).collect();
    let path = &paths[median_of(&paths.iter().map(EnergyPath::error).collect::<Vec<_>>())?];
    let potential: Vec<f64> = path.energy.iter().zip(&path.kinetic).map(|(e, t)| e - t).collect();
    let lowest = potential.iter().copied().fold(f64::INFINITY, f64::min);
    let line = |name: &str, values: &[f64], by: f64| {
        Series::new(name, &path.times, &values.iter().map(|x| x - by).collect::<Vec<_>>())
    };
    let name = if path.driven { "expected energy" } else { "energy at the start" };
    let series = vec![
        line("energy", &path.energy, lowest),
        line(name, &path.expected, lowest),
        line("kinetic", &path.kinetic, 0.0),
        line("potential", &potential, lowest),
    ];
    let (x_label, y_label) = ("time [s]".to_string(), "energy / mean kinetic energy".to_string());
    let plot = LinePlot { x_label, y_label, series, ..LinePlot::default() };
    let which = match paths.len() {
        1 => String::new(),
        count => format!(" (of {count} trajectories the one whose energy has the median error)"),
    };
    let works = if path.driven { ", less friction, plus the work of known forces" } else { "" };
    let caption = format!(
        "Energy of the learned Lagrangian along measured motion that it has not seen{which}, and its parts p.v/2 (kinetic) and the rest \
         (potential). The nearer the energy to the expected one, the better: that at the start{works}."
    );
    figure("energy_held_out.svg", "The energy along held-out motion", line_plot(&plot), caption)
}

/// Computes the balance at the estimated states with full windows; `None` if no trajectory has such states.
pub fn balance(model: &dyn EulerLagrange<f64>, part: &Split) -> Option<Balance> {
    let n = model.coordinates();
    let mut sums = Balance::default();
    let mut samples = 0.0;
    let mut terms = Terms::default();
    for (track, states) in part.recording.tracks.iter().zip(&part.states) {
        let rows = states.interior();
        let of = |values: &[f64]| values[rows.start * n..rows.end * n].to_vec();
        let (q, v) = (of(&states.q), of(&states.v));
        let trajectory = Trajectory { coordinates: n, t: states.times[rows.clone()].to_vec(), q, v, energy: None };
        let force = track.sampled_force().map(|force| force.between(part.between));
        let balance = match &force {
            Some(force) => Driven::new(model, force).energy_balance(&trajectory),
            None => trajectory.energy_balance(model),
        };
        let Ok(balance) = balance else { continue };
        sums.trajectories += 1;
        sums.forced |= force.is_some();
        sums.change += balance.change;
        sums.work += balance.work;
        sums.friction += balance.dissipated;
        sums.defect += balance.defect();
        sums.defect_rms += balance.defect().powi(2);
        for (q, v) in trajectory.q.chunks(STATES_AT_ONCE * n).zip(trajectory.v.chunks(STATES_AT_ONCE * n)) {
            let _ = model.terms(q, v, Request::MOMENTUM, &mut terms);
            sums.kinetic += 0.5 * terms.momentum.iter().zip(v).map(|(p, v)| p * v).sum::<f64>();
            samples += (q.len() / n) as f64;
        }
    }
    let mean = |sum: f64| sum / sums.trajectories as f64;
    (sums.trajectories > 0).then(|| Balance {
        kinetic: sums.kinetic / samples,
        change: mean(sums.change),
        work: mean(sums.work),
        friction: mean(sums.friction),
        defect: mean(sums.defect),
        defect_rms: mean(sums.defect_rms).sqrt(),
        ..sums
    })
}

impl Balance {
    /// Root mean square energy defect over the trajectories, relative to the mean kinetic energy.
    pub fn unaccounted(&self) -> f64 {
        self.defect_rms / self.kinetic.abs()
    }

    /// Describes the balance in two lines, its terms divided by the mean kinetic energy.
    pub fn lines(&self) -> [String; 2] {
        let tenths = |x: f64| (1e3 * x / self.kinetic.abs()).round();
        let [change, work, friction] = [self.change, self.work, self.friction].map(tenths);
        // Uses the rounded parts, so that they add up as printed.
        let rest = change - work + friction;
        let percent = |tenths: f64| format!("{:.1} %", tenths / 10.0 + 0.0);
        let count = self.trajectories;
        let (along, spread) = match count {
            1 => ("the held-out trajectory".to_string(), String::new()),
            _ => {
                let rms = percent(tenths(self.defect_rms));
                (format!("{count} held-out trajectories (mean)"), format!(" (rms {rms})"))
            }
        };
        let work =
            if self.forced { format!("work of the known forces {} - ", percent(work)) } else { "- ".to_string() };
        let [change, friction, rest] = [change, friction, rest].map(percent);
        [
            format!("energy along {along}, over the mean kinetic energy:"),
            format!("  change {change} = {work}taken by friction {friction} + not accounted for {rest}{spread}"),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up_as_they_stand() {
        let balance = Balance {
            trajectories: 3,
            kinetic: -2.0,
            change: -0.30009,
            work: 0.10006,
            friction: 0.50006,
            defect: 0.09991,
            defect_rms: 0.2,
            forced: true,
        };
        let text = balance.lines().join("\n");
        let part = |after: &str| -> f64 {
            let rest = &text[text.find(after).unwrap() + after.len()..];
            rest.split_whitespace().next().unwrap().parse().unwrap()
        };
        let [change, work, friction, rest] = ["change ", "known forces ", "by friction ", "accounted for "].map(part);
        assert!((change - (work - friction + rest)).abs() < 1e-9, "{text}");
        assert!((rest - 5.0).abs() < 0.11 && text.contains("3 held-out trajectories (mean)"), "{text}");
        assert!(text.contains("(rms 10.0 %)") && text.lines().all(|line| line.len() <= 120), "{text}");
        let free = Balance { trajectories: 1, forced: false, work: 0.0, ..balance }.lines().join("\n");
        assert!(free.contains("along the held-out trajectory,") && !free.contains("forces"), "{free}");
        assert!(!free.contains("rms"), "{free}");
    }
}
