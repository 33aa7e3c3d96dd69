//! Tests on closed chains: a slider-crank and a four-bar linkage described by points, a five-bar linkage described by angles.

use super::follow::Follower;
use super::tests::{described, noise};
use super::*;
use crate::lagrangian::{Equations, EulerLagrange, RowEquations, SystemInstance, project};
use crate::recording::{RecordedTrajectory, Recording, Targets};
use crate::rollout::{Driven, RolloutOptions};

/// A mechanism, with the constants that are fitted to its motion and to its forces.
struct Mechanism {
    text: &'static str,
    truth: &'static [(&'static str, f64)],
    of_motion: &'static [&'static str],
    of_forces: &'static [&'static str],
    starts: &'static [&'static [f64]],
    /// The coordinate on which a known force acts, and the size of the force.
    driven: (usize, f64),
    /// A part of the description, and its replacement in a wrong model.
    wrong: [&'static str; 2],
}

const SLIDER: Mechanism = Mechanism {
    text: r#"{"name": "slider-crank", "dissipation": "c*x2_dot^2/2",
        "lagrangian": "m1*(x1_dot^2 + y1_dot^2)/2 - m1*g*y1 + m2*x2_dot^2/2 - k*(x2 - 2)^2/2",
        "coordinates": [{"name": "x1", "bounds": [-2, 2], "velocity_bounds": [-2, 2]},
            {"name": "y1", "bounds": [-2, 2], "velocity_bounds": [-2, 2]},
            {"name": "x2", "bounds": [-4, 4], "velocity_bounds": [-2, 2]}],
        "parameters": {"m1": 1, "m2": 1, "c": 0.4, "k": 2, "g": 9.81, "r": 0.9, "l": 2.2},
        "constraints": {"crank": "x1^2 + y1^2 - r^2", "rod": "(x2 - x1)^2 + y1^2 - l^2",
            "twice": "2*(x2 - x1)^2 + 2*y1^2 - 2*l^2"}}"#,
    truth: &[("m2", 0.7), ("c", 0.5), ("k", 3.0), ("r", 1.0), ("l", 2.0)],
    of_motion: &["m2", "c", "k", "r", "l"],
    of_forces: &["m1", "m2", "c", "k"],
    starts: &[&[0.6, 0.8, 2.43, 0.0, 0.0, 0.0], &[0.8, -0.6, 2.7, 1.8, 2.4, 1.0], &[-0.9, 0.4, 1.0, 1.0, 2.0, 1.0]],
    driven: (2, 4.0),
    wrong: ["c*x2_dot^2/2", "c*x2_dot^4/4"],
};

const FOUR_BAR: Mechanism = Mechanism {
    text: r#"{"name": "four-bar", "dissipation": "e*(x2_dot^2 + y2_dot^2)/2",
        "lagrangian": "(m*(x1_dot^2 + y1_dot^2) + M*(x2_dot^2 + y2_dot^2))/2 - g*(m*y1 + M*y2)",
        "coordinates": [{"name": "x1", "bounds": [-1, 1], "velocity_bounds": [-2, 2]},
            {"name": "y1", "bounds": [-1, 1], "velocity_bounds": [-2, 2]},
            {"name": "x2", "bounds": [-1, 4], "velocity_bounds": [-2, 2]},
            {"name": "y2", "bounds": [-1, 4], "velocity_bounds": [-2, 2]}],
        "parameters": {"m": 1, "M": 1, "e": 0.2, "g": 9.81, "a": 0.95, "b": 2.6, "c": 2.1, "d": 2.9},
        "constraints": {"crank": "x1^2 + y1^2 - a^2", "coupler": "(x2 - x1)^2 + (y2 - y1)^2 - b^2",
            "rocker": "(x2 - d)^2 + y2^2 - c^2"}}"#,
    truth: &[("M", 1.4), ("e", 0.3), ("a", 1.0), ("b", 2.5), ("c", 2.0), ("d", 3.0)],
    of_motion: &["M", "e", "a", "b", "c", "d"],
    of_forces: &["m", "M", "e"],
    starts: &[
        &[0.8, 0.6, 2.6, 2.0, -1.2, 1.6, 0.0, 0.0],
        &[0.3, -0.95, 1.6, 1.5, 5.0, 1.6, 0.0, 0.0],
        &[-0.9, 0.4, 1.4, 1.3, 0.0, 0.0, 0.0, 0.0],
    ],
    driven: (2, 4.0),
    wrong: ["e*(x2_dot^2 + y2_dot^2)/2", "e*x1_dot^2/2"],
};

const FIVE_BAR: Mechanism = Mechanism {
    text: r#"{"name": "five-bar", "dissipation": "e*(t1_dot^2 + t2_dot^2)/2",
        "lagrangian": "m*a^2*(t1_dot^2 + t2_dot^2)/2 - g*(m*a*(sin(t1) + sin(t2)) + M*(a*sin(t1) + b*sin(t3))) - k*((t1 - 2)^2 + (t2 - 1)^2)/2 + M*(a^2*t1_dot^2 + b^2*t3_dot^2 + 2*a*b*t1_dot*t3_dot*cos(t1 - t3))/2",
        "coordinates": [{"name": "t1", "periodic": true, "bounds": [1, 3], "velocity_bounds": [-2, 2]},
            {"name": "t2", "periodic": true, "bounds": [0, 2], "velocity_bounds": [-2, 2]},
            {"name": "t3", "periodic": true, "bounds": [0, 1.5], "velocity_bounds": [-2, 2]},
            {"name": "t4", "periodic": true, "bounds": [1.5, 3], "velocity_bounds": [-2, 2]}],
        "parameters": {"m": 1, "M": 0.5, "e": 0.1, "g": 2, "k": 25, "a": 1, "b": 1.4, "d": 1.1},
        "constraints": {"across": "a*cos(t1) + b*cos(t3) - d - a*cos(t2) - b*cos(t4)",
            "up": "a*sin(t1) + b*sin(t3) - a*sin(t2) - b*sin(t4)"}}"#,
    truth: &[("M", 0.7), ("e", 0.2), ("b", 1.5), ("d", 1.0)],
    of_motion: &["M", "e", "b", "d"],
    of_forces: &["m", "M", "e"],
    starts: &[
        &[2.2, 0.9, 0.75, 2.4, 0.0, 0.0, 0.0, 0.0],
        &[1.8, 1.3, 0.9, 2.2, 0.8, -0.8, 0.0, 0.0],
        &[2.0, 0.6, 0.7, 2.3, 1.0, 0.6, 0.0, 0.0],
    ],
    driven: (0, 3.0),
    wrong: ["e*(t1_dot^2 + t2_dot^2)/2", "e*(t1_dot^4 + t2_dot^4)/4"],
};

const NOISE: f64 = 1e-3;
const NOISE_OF_FORCE: f64 = 0.05;

impl Mechanism {
    fn form(&self, pairs: &[(&str, f64)]) -> SystemInstance<f64> {
        described(self.text, pairs)
    }

    fn wrong(&self, pairs: &[(&str, f64)]) -> SystemInstance<f64> {
        described(&self.text.replace(self.wrong[0], self.wrong[1]), pairs)
    }

    /// Values of the constants in the constraints.
    fn lengths(&self) -> Vec<(&'static str, f64)> {
        self.truth.iter().copied().filter(|(name, _)| !self.of_forces.contains(name)).collect()
    }

    /// Noisy motion, under a known force with noise if `forced`.
    fn recorded(&self, forced: bool, seed: u64) -> Recording {
        let instance = self.form(self.truth);
        let (n, model) = (instance.coordinates, instance.build().unwrap());
        let (driven, size) = self.driven;
        let push = |t: f64| if forced { size * ((2.3 * t).sin() + 0.75 * (3.7 * t).cos()) } else { 0.0 };
        let force = |t: f64, _: &[f64], _: &[f64], force: &mut [f64]| force[driven] = push(t);
        let track = |start: &&[f64]| {
            let (mut q, mut v) = (start[..n].to_vec(), start[n..].to_vec());
            project(model.manifold().unwrap(), &mut q, &mut v).unwrap();
            let motion =
                Driven::new(&*model, &force).rollout(&q, &v, &RolloutOptions::new(3.0, 0.02)).complete().unwrap();
            let mut forces = vec![0.0; if forced { motion.q.len() } else { 0 }];
            let own = forces.iter_mut().skip(driven).step_by(n).zip(&motion.t);
            own.for_each(|(force, t)| *force = push(*t));
            let (v, a) = (Vec::new(), Vec::new());
            RecordedTrajectory { name: "run".into(), times: motion.t, q: motion.q, v, a, force: forces }
        };
        let coordinates = instance.system.coordinates(n);
        let mut recording = Recording {
            coordinates: coordinates.iter().map(|c| c.name.to_string()).collect(),
            periodic: coordinates.iter().map(|c| c.periodic).collect(),
            tracks: self.starts.iter().map(track).collect(),
        };
        noise(&mut recording, &vec![NOISE; n], seed);
        // Noise of the force, added in the same way.
        let mut of_force = recording.clone();
        for (track, own) in of_force.tracks.iter_mut().zip(&recording.tracks) {
            track.q.clone_from(&own.force);
        }
        let sigma: Vec<f64> = (0..n).map(|i| if i == driven { NOISE_OF_FORCE } else { 0.0 }).collect();
        noise(&mut of_force, &sigma, seed + 1000);
        recording.tracks.iter_mut().zip(of_force.tracks).for_each(|(track, noisy)| track.force = noisy.q);
        recording
    }

    /// Deviations of the constants from the truth in standard errors for several recordings, and the number of explained recordings.
    fn deviations(&self, targets: Targets, forced: bool) -> (Vec<f64>, usize) {
        let (mut all, mut explained) = (Vec::new(), 0);
        let constants = if targets == Targets::Forces { self.of_forces } else { self.of_motion };
        let lengths = if targets == Targets::Forces { self.lengths() } else { Vec::new() };
        for seed in 0..4 {
            let options = IdentifyOptions::new().constants(constants.iter().copied()).targets(targets);
            let found = identify(&self.form(&lengths), &self.recorded(forced, seed), &options).unwrap();
            let instance = self.form(self.truth);
            for constant in &found.constants {
                let at = instance.system.parameters.iter().position(|p| p.symbol == constant.symbol).unwrap();
                let error = constant.standard_error.unwrap();
                let truth = instance.parameters[at];
                assert!(error < 0.25 * truth, "{constant:?}");
                all.push((constant.value - truth) / error);
            }
            explained += usize::from(found.explained);
            eprintln!("{} {targets:?} {seed}: {:?} {:?}", instance.system.name, found.verdict, all);
        }
        (all, explained)
    }

    fn check(&self, targets: Targets, forced: bool) {
        let (all, explained) = self.deviations(targets, forced);
        let within = |limit: f64| all.iter().filter(|z| z.abs() < limit).count();
        assert!(
            within(3.5) == all.len() && 20 * within(2.0) >= 17 * all.len() && explained >= 3,
            "{all:?} {explained}"
        );
    }
}

#[test]
fn constants_of_a_slider_crank_lie_within_their_errors() {
    SLIDER.check(Targets::Motion, false);
}

#[test]
fn constants_of_a_four_bar_linkage_lie_within_their_errors() {
    FOUR_BAR.check(Targets::Motion, false);
    FOUR_BAR.check(Targets::Forces, true);
}

#[test]
fn constants_of_a_five_bar_linkage_lie_within_their_errors() {
    FIVE_BAR.check(Targets::Motion, false);
    FIVE_BAR.check(Targets::Forces, true);
}

#[test]
fn forces_with_noise_move_a_slider_crank() {
    SLIDER.check(Targets::Motion, true);
}

#[test]
fn a_wrong_form_of_a_closed_chain_is_not_explained() {
    for mechanism in [SLIDER, FOUR_BAR, FIVE_BAR] {
        for (targets, constants) in [(Targets::Motion, mechanism.of_motion), (Targets::Forces, mechanism.of_forces)] {
            let forces = targets == Targets::Forces;
            let options = IdentifyOptions::new().constants(constants.iter().copied()).targets(targets);
            let form = mechanism.wrong(&if forces { mechanism.lengths() } else { Vec::new() });
            let found = identify(&form, &mechanism.recorded(forces, 0), &options).unwrap();
            assert!(!found.explained, "{} {targets:?} {:?}", form.system.name, found.verdict);
        }
    }
}

#[test]
fn positions_off_the_constraints_are_refused_or_named() {
    let recording = SLIDER.recorded(true, 0);
    let options =
        |names: &[&str], targets: Targets| IdentifyOptions::new().constants(names.iter().copied()).targets(targets);
    // Rods whose given lengths are wrong.
    for targets in [Targets::Motion, Targets::Forces] {
        let form = SLIDER.form(&[("r", 1.0), ("l", 2.1)]);
        let error = identify(&form, &recording, &options(&["m2", "c", "k"], targets)).unwrap_err();
        let IdentifyError::OffConstraint { constraint, distance, .. } = &error else { panic!("{error}") };
        assert!(constraint == "rod" && (distance / 0.07 - 1.0).abs() < 0.4, "{error}");
    }
    // No length turns an ellipse into a circle.
    let mut squeezed = recording.clone();
    for track in &mut squeezed.tracks {
        track.q.iter_mut().skip(1).step_by(3).for_each(|y| *y *= 0.8);
    }
    let found = identify(&SLIDER.form(&[]), &squeezed, &options(SLIDER.of_motion, Targets::Motion)).unwrap();
    assert!(!found.explained && found.obstacles.iter().any(|text| text.contains("`crank`")), "{:?}", found.obstacles);
    let error = identify(&SLIDER.form(&[]), &recording, &options(&["m2", "l"], Targets::Forces)).unwrap_err();
    assert!(matches!(error, IdentifyError::OffConstraint { .. }), "{error}");
    let form = SLIDER.form(&[("r", 1.0), ("l", 2.0)]);
    let error = identify(&form, &recording, &options(&["m2", "l"], Targets::Forces)).unwrap_err();
    assert_eq!(error, IdentifyError::MovesConstraints { symbols: vec!["l".into()] });
}

#[test]
fn free_motion_of_a_closed_chain_gives_ratios_of_masses() {
    let options = IdentifyOptions::new().constants(["m1", "m2", "c", "k"]);
    let form = SLIDER.form(&[("r", 1.0), ("l", 2.0)]);
    let found = identify(&form, &SLIDER.recorded(false, 0), &options).unwrap();
    let known: Vec<&str> = found.undetermined.iter().flat_map(|open| &open.known).map(|c| &*c.name).collect();
    assert!(found.undetermined.len() == 1 && known.len() == 3, "{:?}", found.undetermined);
    let truth = |name: &str| SLIDER.truth.iter().find(|(known, _)| *known == name).map_or(1.0, |(_, x)| *x);
    for known in &found.undetermined[0].known {
        let value: f64 = known.terms.iter().map(|(name, power)| truth(name).powf(*power)).product();
        assert!(known.product && (known.value - value).abs() < 3.5 * known.standard_error, "{known:?} {value}");
    }
}

const H: f64 = 1e-5;

/// A system under constraints with its recorded equations and a state on the constraints.
struct Recorded {
    instance: SystemInstance<f64>,
    equations: Equations,
    state: Vec<f64>,
}

impl Recorded {
    fn of(instance: SystemInstance<f64>, start: &[f64]) -> Self {
        let chosen: Vec<usize> = (0..instance.parameters.len()).collect();
        let acting = instance.acting_constraints().unwrap();
        let equations = Equations::record(&instance, &chosen, &acting).unwrap().unwrap();
        let (n, rows) = (instance.coordinates, equations.rows.as_ref().unwrap());
        assert!(rows.names.len() == 2 && rows.freedom() == 2 * n - 2 - rows.holonomic());
        let mut recorded = Self { instance, equations, state: Vec::new() };
        recorded.state = recorded.projected(&recorded.instance.parameters, start);
        recorded
    }

    fn rows(&self) -> &RowEquations {
        self.equations.rows.as_ref().unwrap()
    }

    /// The state, projected onto the constraints with these parameters.
    fn projected(&self, p: &[f64], state: &[f64]) -> Vec<f64> {
        let mut state = state.to_vec();
        let (q, v) = state.split_at_mut(self.instance.coordinates);
        project(&self.rows().manifold(p).unwrap(), q, v).unwrap();
        state
    }

    /// Accelerations agree with those of the model, and their slopes with differences.
    fn check_slopes(&self) {
        let (n, count, p) = (self.instance.coordinates, self.instance.parameters.len(), &self.instance.parameters);
        let recording = Recording { coordinates: Vec::new(), periodic: Vec::new(), tracks: Vec::new() };
        let (between, inputs, equations) = (Between::Linear, Vec::new(), &self.equations);
        let driven = DrivenEquations {
            recording: &recording,
            equations,
            chosen: count,
            between,
            inputs,
            step: 1.0,
            substeps: 1,
        };
        let mut follower = Follower::new(&driven);
        let mut accelerations = |state: &[f64], p: &[f64]| {
            let mut a = vec![0.0; n];
            follower.accelerate(p, (&state[..n], &state[n..]), &[], &mut a);
            a
        };
        let a = accelerations(&self.state, p);
        let expected = self.instance.build().unwrap().acceleration(&self.state[..n], &self.state[n..]).unwrap();
        assert!(a.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-10), "{a:?} {expected:?}");
        let mut shifted = |column: usize, h: f64| {
            let mut all = [&self.state[..], p].concat();
            all[column] += h;
            accelerations(&all[..2 * n], &all[2 * n..])
        };
        let mut difference = |column: usize| {
            let (up, down) = (shifted(column, H), shifted(column, -H));
            up.iter().zip(down).map(|(up, down)| (up - down) / (2.0 * H)).collect::<Vec<f64>>()
        };
        let differences: Vec<Vec<f64>> = (0..2 * n + count).map(&mut difference).collect();
        accelerations(&self.state, p);
        let slopes = follower.slopes(p, (&self.state[..n], &self.state[n..], &a));
        for (column, difference) in differences.iter().enumerate() {
            for i in 0..n {
                let slope = slopes[i * (2 * n + count) + column];
                let off = (slope - difference[i]).abs();
                assert!(off < 1e-6 * (1.0 + slope.abs()), "{i} {column}: {slope} {difference:?}");
            }
        }
    }

    /// A free direction stays on the constraints to first order, and a constant moves an initial state as the projection does.
    fn check_tangent(&self) {
        let (n, p) = (self.instance.coordinates, &self.instance.parameters);
        let tangent = self.rows().tangent(&self.rows().manifold(p).unwrap(), p, &self.state);
        assert_eq!(tangent.free.len(), self.rows().freedom() * 2 * n);
        for direction in tangent.free.chunks_exact(2 * n) {
            let moved: Vec<f64> = self.state.iter().zip(direction).map(|(x, d)| x + 1e-4 * d).collect();
            let back = self.projected(p, &moved);
            let off = moved.iter().zip(&back).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-7, "{direction:?}");
        }
        for (k, direction) in tangent.following.chunks_exact(2 * n).enumerate() {
            let at = |h: f64| {
                let mut p = p.clone();
                p[k] += h;
                self.projected(&p, &self.state)
            };
            for ((up, down), d) in at(H).iter().zip(at(-H)).zip(direction) {
                assert!(((up - down) / (2.0 * H) - d).abs() < 1e-6, "{k} {direction:?}");
            }
        }
    }
}

#[test]
fn slopes_and_starts_under_constraints_are_those_of_differences() {
    let rolling = SystemInstance::<f64>::named("rolling-disk", &[]).unwrap();
    let starts: [&[f64]; 2] = [SLIDER.starts[1], &[0.3, -0.2, 0.7, 0.4, 0.1, 0.2, 1.1, 2.0]];
    for (instance, start) in [SLIDER.form(SLIDER.truth), rolling].into_iter().zip(starts) {
        let recorded = Recorded::of(instance, start);
        recorded.check_slopes();
        recorded.check_tangent();
    }
}
