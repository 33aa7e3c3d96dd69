//! How often a form is said to explain a motion, and how often stated ranges hold the truth.

use super::{Outcome, Rate};
use lnn::identification::{Identified, IdentifyOptions, identify};
use lnn::lagrangian::{Description, SystemInstance};
use lnn::prelude::Motion;
use lnn::random::{RandomGenerator, RngStream};
use lnn::recording::{RecordedTrajectory, Recording, Targets};
use lnn::rollout::{Driven, RolloutOptions, SampledForce};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::borrow::Cow;
use std::ops::RangeInclusive;

type Constants = Vec<(&'static str, f64)>;

/// A form, with a term that is left out of a wrong one.
struct Form {
    name: &'static str,
    lagrangian: &'static str,
    dissipation: &'static str,
    /// What takes the place of both in the wrong form.
    wrong: [&'static str; 2],
    coordinates: &'static [&'static str],
    /// Constants with the ranges that they are drawn from; the last is that of the missing term.
    constants: &'static [(&'static str, f64, f64)],
}

const FORMS: [Form; 3] = [
    Form {
        name: "oscillator",
        lagrangian: "x_dot^2/2 - k*x^2/2",
        dissipation: "c*x_dot^2/2",
        wrong: ["x_dot^2/2 - k*x^2/2", "0*x_dot^2"],
        coordinates: &["x"],
        constants: &[("k", 1.0, 9.0), ("c", 0.05, 0.3)],
    },
    Form {
        name: "pendulum",
        lagrangian: "a_dot^2/2 + w*cos(a)",
        dissipation: "c*a_dot^2/2",
        wrong: ["a_dot^2/2 + w*cos(a)", "0*a_dot^2"],
        coordinates: &["a"],
        constants: &[("w", 4.0, 12.0), ("c", 0.05, 0.2)],
    },
    Form {
        name: "two-pendula",
        lagrangian: "(1+m)*a_dot^2/2 + m*l^2*b_dot^2/2 + m*l*a_dot*b_dot*cos(a-b) + 9.81*((1+m)*cos(a) + m*l*cos(b))",
        dissipation: "c*(b_dot-a_dot)^2/2",
        wrong: [
            "(1+m)*a_dot^2/2 + m*l^2*b_dot^2/2 + m*l*a_dot*b_dot*cos(a-b) + 9.81*((1+m)*cos(a) + m*l*cos(b))",
            "0*a_dot^2",
        ],
        coordinates: &["a", "b"],
        constants: &[("m", 0.4, 1.5), ("l", 0.6, 1.4), ("c", 0.02, 0.1)],
    },
];

const DUFFING: Form = Form {
    name: "Duffing",
    lagrangian: "m*x_dot^2/2 - k*x^2/2 - b*x^4/4",
    dissipation: "c*x_dot^2/2",
    wrong: ["m*x_dot^2/2 - k*x^2/2", "c*x_dot^2/2"],
    coordinates: &["x"],
    constants: &[("m", 0.8, 1.2), ("k", 0.8, 1.5), ("c", 0.1, 0.3), ("b", 0.2, 0.5)],
};

const ARM: Form = Form {
    name: "two-links",
    lagrangian: "A*q1_dot^2/2 + B*(q1_dot+q2_dot)^2/2 + C*q1_dot*(q1_dot+q2_dot)*cos(q2) + 9.81*(G1*cos(q1) + G2*cos(q1+q2))",
    dissipation: "f1*q1_dot^2/2 + f2*q2_dot^2/2",
    wrong: [
        "A*q1_dot^2/2 + B*(q1_dot+q2_dot)^2/2 + C*q1_dot*(q1_dot+q2_dot)*cos(q2) + 9.81*G1*cos(q1)",
        "f1*q1_dot^2/2 + f2*q2_dot^2/2",
    ],
    coordinates: &["q1", "q2"],
    constants: &[
        ("A", 0.3, 0.6),
        ("B", 0.08, 0.16),
        ("C", 0.06, 0.12),
        ("G1", 1.0, 1.8),
        ("f1", 0.1, 0.3),
        ("f2", 0.05, 0.15),
        ("G2", 0.2, 0.5),
    ],
};

fn normal(rng: &mut RandomGenerator) -> f64 {
    StandardNormal.sample(rng)
}

impl Form {
    fn drawn(&self, rng: &mut RandomGenerator) -> Constants {
        self.constants.iter().map(|(name, low, high)| (*name, rng.random_range(*low..*high))).collect()
    }

    /// The system with some values; all its constants are unknown.
    fn system(&self, right: bool, values: &[(&str, f64)]) -> Outcome<SystemInstance<f64>> {
        let kept = if right { self.constants.len() } else { self.constants.len() - 1 };
        let parameters: serde_json::Map<_, _> =
            self.constants[..kept].iter().map(|(name, low, high)| (name.to_string(), (low + high).into())).collect();
        let coordinates: Vec<_> = self
            .coordinates
            .iter()
            .map(|name| serde_json::json!({ "name": name, "bounds": [-3, 3], "velocity_bounds": [-6, 6] }))
            .collect();
        let [lagrangian, dissipation] = if right { [self.lagrangian, self.dissipation] } else { self.wrong };
        let description: Description = serde_json::from_value(serde_json::json!({
            "name": self.name, "lagrangian": lagrangian, "dissipation": dissipation,
            "coordinates": coordinates, "parameters": parameters,
        }))?;
        let given: Vec<_> = values.iter().map(|(name, x)| (name.to_string(), x.to_string())).collect();
        Ok(SystemInstance::new(Cow::Owned(description.system()?), &given)?)
    }

    fn recording(&self, tracks: Vec<RecordedTrajectory>) -> Recording {
        let coordinates = self.coordinates.iter().map(|name| name.to_string()).collect();
        Recording { coordinates, periodic: vec![false; self.coordinates.len()], tracks }
    }

    /// Free motion from starts that are drawn, 10 s at 50 Hz.
    fn free(&self, truth: &Constants, runs: usize, rng: &mut RandomGenerator) -> Outcome<Recording> {
        let (model, n) = (self.system(true, truth)?.build()?, self.coordinates.len());
        let mut run = || {
            let start: Vec<f64> = (0..2 * n).map(|_| rng.random_range(-1.3..1.3)).collect();
            let motion = model.rollout(&start[..n], &start[n..], 10.0 / runs as f64, 0.02)?;
            Ok(track(motion.t, motion.q, Vec::new()))
        };
        Ok(self.recording((0..runs).map(|_| run()).collect::<Outcome<_>>()?))
    }
}

fn track(times: Vec<f64>, q: Vec<f64>, force: Vec<f64>) -> RecordedTrajectory {
    RecordedTrajectory { name: "run".into(), times, q, v: Vec::new(), a: Vec::new(), force }
}

/// Adds noise of a standard deviation with a memory from sample to sample.
fn add(recording: &mut Recording, (size, memory): (f64, f64), rng: &mut RandomGenerator) {
    let n = recording.n();
    for track in &mut recording.tracks {
        let mut last: Vec<f64> = (0..n).map(|_| size * normal(rng)).collect();
        for (at, q) in track.q.iter_mut().enumerate() {
            let own = &mut last[at % n];
            *own = memory * *own + size * (1.0 - memory * memory).sqrt() * normal(rng);
            *q += *own;
        }
    }
}

/// A driven oscillator, 0.05 s a sample, under a force that is measured with noise and is held between the samples.
fn driven(truth: &Constants, force_noise: f64, rng: &mut RandomGenerator) -> Outcome<Recording> {
    let model = DUFFING.system(true, truth)?.build()?;
    let (step, samples) = (0.05, 1200);
    let tones: Vec<[f64; 3]> = (0..5).map(|_| [0.4, rng.random_range(0.3..4.0), rng.random_range(0.0..6.0)]).collect();
    let push = |t: f64| tones.iter().map(|[size, rate, phase]| size * (rate * t + phase).sin()).sum::<f64>();
    let (mut q, mut force, mut state) = (Vec::new(), Vec::new(), (0.0, 0.0));
    let times: Vec<f64> = (0..samples).map(|k| f64::from(k) * step).collect();
    for t in &times {
        q.push(state.0);
        force.push(push(*t) + force_noise * normal(rng));
        let held = SampledForce::constant(vec![push(*t)])?;
        let motion =
            Driven::new(&*model, &held).rollout(&[state.0], &[state.1], &RolloutOptions::new(step, step)).complete()?;
        state = (motion.q[1], motion.v[1]);
    }
    Ok(DUFFING.recording(vec![track(times, q, force)]))
}

/// Two links on a motion of five tones a joint, 10 s at 200 Hz, torques with 1 % of noise. `repeat`: share of readings that repeat the last.
fn arm(truth: &Constants, (encoder, repeat): (f64, f64), rng: &mut RandomGenerator) -> Recording {
    let of = |name: &str| truth.iter().find(|(own, _)| *own == name).map_or(0.0, |(_, x)| *x);
    let tones: Vec<Vec<[f64; 3]>> = (0..2)
        .map(|_| {
            let tone = |rng: &mut RandomGenerator| {
                let rate = std::f64::consts::TAU * rng.random_range(0.1..1.2);
                [rng.random_range(0.2..0.5) / (1.0 + rate / 4.0), rate, rng.random_range(0.0..std::f64::consts::TAU)]
            };
            (0..5).map(|_| tone(rng)).collect()
        })
        .collect();
    let times: Vec<f64> = (0..2000).map(|k| f64::from(k) * 0.005).collect();
    let (mut q, mut force) = (Vec::new(), Vec::new());
    for &t in &times {
        let state: Vec<[f64; 3]> = tones
            .iter()
            .map(|tones| {
                tones.iter().fold([0.0; 3], |[q, v, a], [size, rate, phase]| {
                    let (sin, cos) = (rate * t + phase).sin_cos();
                    [q + size * sin, v + size * rate * cos, a - size * rate * rate * sin]
                })
            })
            .collect();
        let [[q1, v1, a1], [q2, v2, a2]] = [state[0], state[1]];
        let (sin, cos) = q2.sin_cos();
        let common = of("B") * (a1 + a2) + 9.81 * of("G2") * (q1 + q2).sin();
        force.push(
            of("A") * a1
                + common
                + of("C") * (cos * (2.0 * a1 + a2) - sin * (2.0 * v1 * v2 + v2 * v2))
                + 9.81 * of("G1") * q1.sin()
                + of("f1") * v1,
        );
        force.push(common + of("C") * (cos * a1 + sin * v1 * v1) + of("f2") * v2);
        q.extend([q1, q2]);
    }
    for i in 0..2 {
        let size = 0.01 * (force.iter().skip(i).step_by(2).map(|f| f * f).sum::<f64>() / 2000.0).sqrt();
        force.iter_mut().skip(i).step_by(2).for_each(|f| *f += size * normal(rng));
    }
    q.iter_mut().for_each(|q| *q += encoder * normal(rng));
    for at in 2..q.len() {
        if repeat > 0.0 && rng.random_bool(repeat) {
            q[at] = q[at - 2];
        }
    }
    ARM.recording(vec![track(times, q, force)])
}

/// What was said in a case: of the form, and of the ranges.
#[derive(Default)]
pub(super) struct Tally {
    /// What is to be said of the form.
    right: bool,
    /// Seeds of which the other is said, with the verdict.
    missed: Vec<(u64, String)>,
    explained: usize,
    systems: usize,
    held: usize,
    ranges: usize,
    square: f64,
}

impl Tally {
    pub(super) fn of(right: bool) -> Self {
        Self { right, ..Self::default() }
    }

    pub(super) fn count(&mut self, seed: u64, found: &Identified, truth: &[(&str, f64)]) {
        self.systems += 1;
        if found.explained != self.right {
            self.missed.push((seed, format!("{} (left to gain {:.1e})", found.verdict, found.decrement)));
        }
        self.explained += usize::from(found.explained);
        let errors = found.constants.iter().filter_map(|c| {
            let (_, truth) = truth.iter().find(|(name, _)| *name == c.symbol)?;
            let sums = found.combinations.iter().find(|sum| sum.terms.len() == 1 && sum.terms[0].0 == c.symbol);
            Some((c.value - truth) / c.standard_error.or(sums.map(|sum| sum.standard_error))?)
        });
        for z in errors {
            self.ranges += 1;
            self.held += usize::from(z.abs() < 1.645);
            self.square += z * z;
        }
    }

    /// Counts a recording that is refused.
    pub(super) fn refused(&mut self, seed: u64, why: &str) {
        self.systems += 1;
        if self.right {
            self.missed.push((seed, why.to_string()));
        }
    }

    pub(super) fn explained(&self, case: &'static str, limits: RangeInclusive<f64>) -> Rate {
        for (seed, says) in &self.missed {
            eprintln!("{case}, seed {seed}: {says}");
        }
        Rate { verdict: "explained", case, said: self.explained, of: self.systems, limits }
    }

    /// Ranges of 90 %; their number in a table of 20 systems scatters by 3 to 5 %.
    pub(super) fn held(&self, case: &'static str, limits: RangeInclusive<f64>) -> Rate {
        let rms = (self.square / self.ranges.max(1) as f64).sqrt();
        eprintln!("{case}: root mean square of errors over stated ones {rms:.2}");
        Rate { verdict: "90 % range holds", case, said: self.held, of: self.ranges, limits }
    }
}

const SIZE: f64 = 2e-3;

/// Free motion of forms in turn: noise with some memory, and what is done to the recording then.
fn free(
    seeds: u64,
    (memory, right): (f64, bool),
    options: &IdentifyOptions,
    spoil: impl Fn(&mut Recording, &mut RandomGenerator),
) -> Outcome<Tally> {
    let mut tally = Tally::of(right);
    for seed in 0..seeds {
        let (form, mut rng) = (&FORMS[seed as usize % FORMS.len()], RngStream::Test.generator(seed));
        let truth = form.drawn(&mut rng);
        let mut recording = form.free(&truth, 2, &mut rng)?;
        add(&mut recording, (SIZE, memory), &mut rng);
        spoil(&mut recording, &mut rng);
        tally.count(seed, &identify(&form.system(right, &[])?, &recording, options)?, &truth);
    }
    Ok(tally)
}

/// Free motion with friction of so many of its standard errors, which the form does not have.
fn missing(seeds: u64, errors: f64) -> Outcome<Tally> {
    let mut tally = Tally::of(false);
    for seed in 0..seeds {
        let form = &FORMS[seed as usize % FORMS.len()];
        let measured = |friction: Option<f64>| -> Outcome<_> {
            let mut rng = RngStream::Test.generator(3000 + seed);
            let mut truth = form.drawn(&mut rng);
            if let (Some(friction), Some((_, last))) = (friction, truth.last_mut()) {
                *last = friction;
            }
            let mut recording = form.free(&truth, 2, &mut rng)?;
            add(&mut recording, (SIZE, 0.0), &mut rng);
            Ok((recording, truth))
        };
        let found = |right: bool, recording: &Recording| -> Outcome<Identified> {
            Ok(identify(&form.system(right, &[])?, recording, &IdentifyOptions::default())?)
        };
        let known = found(true, &measured(None)?.0)?;
        let error = known.constants.last().and_then(|friction| friction.standard_error);
        let (recording, truth) = measured(Some(errors * error.ok_or("the friction is not determined")?))?;
        tally.count(seed, &found(false, &recording)?, &truth);
    }
    Ok(tally)
}

/// Driven oscillators.
fn forced(seeds: u64, force_noise: f64, right: bool) -> Outcome<Tally> {
    let mut tally = Tally::of(right);
    for seed in 0..seeds {
        let mut rng = RngStream::Test.generator(1000 + seed);
        let truth = DUFFING.drawn(&mut rng);
        let mut recording = driven(&truth, force_noise, &mut rng)?;
        add(&mut recording, (SIZE, 0.0), &mut rng);
        tally.count(seed, &identify(&DUFFING.system(right, &[])?, &recording, &IdentifyOptions::default())?, &truth);
    }
    Ok(tally)
}

/// Arms by their torques.
fn arms(seeds: u64, reading: (f64, f64), right: bool) -> Outcome<Tally> {
    let mut tally = Tally::of(right);
    let options = IdentifyOptions::new().targets(Targets::Forces).threads(2);
    // Each is fitted 21 times.
    for seed in 0..seeds.div_ceil(2) {
        let mut rng = RngStream::Test.generator(2000 + seed);
        let truth = ARM.drawn(&mut rng);
        let recording = arm(&truth, reading, &mut rng);
        tally.count(seed, &identify(&ARM.system(right, &[])?, &recording, &options)?, &truth);
    }
    Ok(tally)
}

/// How often a constant is said to differ between five trajectories, the last of which has another value of the first constant.
fn differ(seeds: u64, (memory, factor): (f64, f64)) -> Outcome<usize> {
    let mut said = 0;
    for seed in 0..seeds {
        let (form, mut rng) = (&FORMS[seed as usize % FORMS.len()], RngStream::Test.generator(4000 + seed));
        let truth = form.drawn(&mut rng);
        let mut other = truth.clone();
        other[0].1 *= factor;
        let mut recording = form.free(&truth, 1, &mut rng)?;
        for values in [&truth, &truth, &truth, &other] {
            recording.tracks.extend(form.free(values, 1, &mut rng)?.tracks);
        }
        add(&mut recording, (SIZE, memory), &mut rng);
        let options = IdentifyOptions::new().by_trajectory(true);
        let found = identify(&form.system(true, &[])?, &recording, &options)?;
        said += usize::from(found.by_trajectory.ok_or("no scatter")?.scatter.iter().any(|scatter| scatter.differs));
    }
    Ok(said)
}

/// Rates of `seeds` systems a case.
pub fn rates(seeds: u64) -> Outcome<Vec<Rate>> {
    const RIGHT: RangeInclusive<f64> = 0.94..=1.0;
    const WRONG: RangeInclusive<f64> = 0.0..=0.05;
    const RANGES: RangeInclusive<f64> = 0.83..=0.97;
    let plain = IdentifyOptions::default();
    let robust = plain.clone().robust(true);
    let nothing = |_: &mut Recording, _: &mut RandomGenerator| ();
    let noise = |recording: &mut Recording, rng: &mut RandomGenerator| {
        recording.tracks.iter_mut().flat_map(|track| &mut track.q).for_each(|q| *q = normal(rng));
    };
    let outliers = |recording: &mut Recording, rng: &mut RandomGenerator| {
        let all = recording.tracks.iter_mut().flat_map(|track| &mut track.q);
        all.for_each(|q| *q += if rng.random_bool(0.004) { 50.0 * SIZE * normal(rng) } else { 0.0 });
    };
    let unlike = |recording: &mut Recording, rng: &mut RandomGenerator| {
        recording.tracks[1].q.iter_mut().for_each(|q| *q += 5.0 * SIZE * normal(rng));
    };
    let mut rates = Vec::new();
    let of_noise = Tally { missed: Vec::new(), ..free(seeds, (0.0, true), &plain, noise)? };
    rates.push(of_noise.explained("noise instead of motion", WRONG));
    rates.push(free(seeds, (0.0, false), &plain, nothing)?.explained("friction missing, white noise", WRONG));
    // Without any the form is right.
    let without = missing(seeds, 0.0)?;
    rates.push(Rate {
        verdict: "explained",
        case: "friction of 0 standard errors missing",
        said: without.explained,
        of: without.systems,
        // Three in 100 are refused (6 of seeds 0 to 199).
        limits: 0.9..=1.0,
    });
    for (errors, case) in [
        (3.0, "friction of 3 standard errors missing"),
        (6.0, "friction of 6 standard errors missing"),
        (12.0, "friction of 12 standard errors missing"),
        (25.0, "friction of 25 standard errors missing"),
    ] {
        // How small a term may be is what is measured.
        let Tally { explained, systems, .. } = missing(seeds, errors)?;
        rates.push(Rate { verdict: "explained", case, said: explained, of: systems, limits: 0.0..=1.0 });
    }
    rates.push(forced(seeds, 0.0, false)?.explained("cubic force missing, driven", WRONG));
    rates.push(arms(seeds, (2e-4, 0.0), false)?.explained("weight of a link missing, by forces", WRONG));
    rates.push(arms(seeds, (2e-4, 0.125), false)?.explained("the same, one reading in eight repeated", WRONG));
    let white = free(seeds, (0.0, true), &plain, nothing)?;
    rates.extend([white.explained("right form, white noise", RIGHT), white.held("right form, white noise", RANGES)]);
    let coloured = free(seeds, (0.9, true), &plain, nothing)?;
    rates.push(coloured.held("right form, noise of memory 0.9", 0.78..=0.97));
    let spoilt = free(seeds, (0.0, true), &robust, outliers)?;
    rates.extend([spoilt.explained("outliers, robust", RIGHT), spoilt.held("outliers, robust", RANGES)]);
    rates.push(free(seeds, (0.0, true), &plain, unlike)?.held("one track five times as noisy", 0.83..=1.0));
    let exact = forced(seeds, 0.0, true)?;
    rates.extend([exact.explained("right form, driven", RIGHT), exact.held("right form, driven", RANGES)]);
    let noisy = forced(seeds, 0.05, true)?;
    rates.extend([noisy.explained("known force with noise", RIGHT), noisy.held("known force with noise", RANGES)]);
    for (encoder, case) in [(1e-4, "by forces, 0.1 mrad"), (2e-4, "by forces, 0.2 mrad"), (1e-3, "by forces, 1 mrad")] {
        let arms = arms(seeds, (encoder, 0.0), true)?;
        rates.extend([arms.explained(case, RIGHT), arms.held(case, RANGES)]);
    }
    let repeated = arms(seeds, (2e-4, 0.125), true)?;
    rates.push(repeated.explained("by forces, one reading in eight repeated", RIGHT));
    rates.push(repeated.held("by forces, one reading in eight repeated", RANGES));
    for (case, how, limits) in [
        ("five trajectories alike", (0.0, 1.0), 0.0..=0.05),
        ("five trajectories alike, noise of memory 0.9", (0.9, 1.0), 0.0..=0.1),
        ("the first constant of the fifth 3 % larger", (0.0, 1.03), 0.8..=1.0),
    ] {
        rates.push(Rate { verdict: "a constant differs", case, said: differ(seeds, how)?, of: seeds as usize, limits });
    }
    Ok(rates)
}
