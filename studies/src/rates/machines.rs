//! Machines of the literature under drives and measured inputs: each is simulated by its published equations and identified from noisy positions
//! by its system file. Counted are the verdict of the right form and of one without a term, and the ranges that hold the truth.

use super::identify::Tally;
use super::{Outcome, Rate};
use lnn::identification::{IdentifyOptions, identify};
use lnn::lagrangian::{Description, SystemInstance};
use lnn::random::{RandomGenerator, RngStream};
use lnn::recording::{RecordedTrajectory, Recording};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::borrow::Cow;

/// Steps of the simulation between two samples.
const STEPS: usize = 20;
/// Noise of positions, over the spread of each coordinate.
const NOISE: f64 = 0.01;
/// How far constants start from the truth at most.
const AWAY: f64 = 0.2;

/// What a machine does at a time and a state, under inputs.
type Equations = fn(f64, &[f64], &[f64], &[f64]) -> Vec<f64>;

/// Inputs at a time and a state, of a draw of eight numbers.
type Inputs = fn(f64, &[f64], &[f64], &[f64; 8]) -> Vec<f64>;

/// A machine with the source of its equations.
struct Machine {
    name: &'static str,
    /// The same, where a term is missing.
    without: &'static str,
    /// System file; the parameters have their true values and those to find are marked.
    system: &'static str,
    /// A text of the file, and what takes its place in the wrong form.
    wrong: (&'static str, &'static str),
    acceleration: Equations,
    /// Initial positions and velocities, changed by up to a tenth from recording to recording.
    start: (&'static [f64], &'static [f64]),
    /// Inputs at a time and a state, held between the samples; a draw of eight numbers from 0 to 1 makes each recording another one.
    inputs: Inputs,
    /// What is measured at a state, in the order of the names; empty for the positions.
    reads: fn(&[f64], &[f64]) -> Vec<f64>,
    step: f64,
    samples: usize,
    /// Height of a floor that the last coordinate bounces off, keeping this share of its speed. Recordings are cut there.
    floor: Option<f64>,
}

fn none(_: f64, _: &[f64], _: &[f64], _: &[f64; 8]) -> Vec<f64> {
    Vec::new()
}

fn positions(_: &[f64], _: &[f64]) -> Vec<f64> {
    Vec::new()
}

/// A sum of tones of up to `rate` rad/s.
fn tones(t: f64, rate: f64, draw: &[f64; 8]) -> f64 {
    let tone = |k: usize| ((0.1 + 0.9 * draw[k]) * rate * t + 6.3 * draw[k + 4]).sin();
    (0..4).map(tone).sum()
}

const DUFFING: Machine = Machine {
    name: "Duffing, driven (Kovacic and Brennan, 2011)",
    without: "Duffing without its cubic force",
    system: r#"
name = "driven-duffing"
lagrangian = "x_dot^2/2 - k*x^2/2 - b*x^4/4"
dissipation = "c*x_dot^2/2"
coordinates = [{ name = "x", bounds = [-3, 3], velocity_bounds = [-3, 3] }]
[forces]
x = "F*cos(om*t)"
[parameters]
k = { default = 1, learn = true }
b = { default = 0.5, learn = true }
c = { default = 0.1, learn = true }
F = { default = 0.6, learn = true }
om = { default = 1.4, learn = true, range = "positive" }
"#,
    wrong: (" - b*x^4/4", " - b*0"),
    acceleration: |t, q, v, _| vec![0.6 * (1.4 * t).cos() - 0.1 * v[0] - q[0] - 0.5 * q[0].powi(3)],
    start: (&[1.0], &[0.2]),
    inputs: none,
    reads: positions,
    step: 0.05,
    samples: 1000,
    floor: None,
};

const STAGE: Machine = Machine {
    name: "linear stage, EMPS (Janot, Gautier and Brunot, 2019)",
    without: "EMPS without dry friction",
    system: r#"
name = "emps"
lagrangian = "M*q_dot^2/2"
dissipation = "Fv*q_dot^2/2"
coordinates = [{ name = "q", unit = "m", bounds = [-0.3, 0.3], velocity_bounds = [-0.5, 0.5] }]
[inputs]
u = "V"
[forces]
q = "35.15065*u - Fc*tanh(q_dot/0.001) - offset"
[parameters]
M = { default = 95.1089, unit = "kg", learn = true }
Fv = { default = 203.5034, unit = "N s/m", learn = true }
Fc = { default = 20.3935, unit = "N", learn = true }
offset = { default = -3.1648, unit = "N", learn = true }
"#,
    wrong: (" - Fc*tanh(q_dot/0.001)", " - Fc*0"),
    acceleration: |_, _, v, u| {
        let friction = 203.5034 * v[0] + 20.3935 * (v[0] / 0.001).tanh();
        vec![(35.15065 * u[0] - friction + 3.1648) / 95.1089]
    },
    start: (&[0.0], &[0.0]),
    // A controller that follows a sum of tones.
    inputs: |t, q, v, draw| vec![(0.03 * tones(t, 2.5, draw) - q[0]) * 160.0 - 12.0 * v[0]],
    reads: positions,
    step: 0.005,
    samples: 2000,
    floor: None,
};

const DRIVES: Machine = Machine {
    name: "two drives on a belt (after Wigren and Schoukens, 2017)",
    without: "two drives without the damping of the belt",
    system: r#"
name = "two-drives"
lagrangian = "0.02*a_dot^2/2 + J*b_dot^2/2 - k*(a - b)^2/2"
dissipation = "f*(a_dot^2 + b_dot^2)/2 + d*(a_dot - b_dot)^2/2"
[[coordinates]]
name = "a"
bounds = [-90, 90]
velocity_bounds = [-20, 20]
[[coordinates]]
name = "b"
bounds = [-90, 90]
velocity_bounds = [-20, 20]
[inputs]
u = "V"
w = "V"
[forces]
a = "K*u"
b = "K*w"
[parameters]
J = { default = 0.03, learn = true }
k = { default = 2, learn = true }
f = { default = 0.02, learn = true }
d = { default = 0.01, learn = true }
K = { default = 0.3, learn = true }
"#,
    wrong: (" + d*(a_dot - b_dot)^2/2", " + d*0"),
    acceleration: |_, q, v, u| {
        let belt = 2.0 * (q[0] - q[1]) + 0.01 * (v[0] - v[1]);
        vec![(0.3 * u[0] - belt - 0.02 * v[0]) / 0.02, (0.3 * u[1] + belt - 0.02 * v[1]) / 0.03]
    },
    start: (&[0.5, -0.2], &[1.0, 0.0]),
    inputs: |t, q, _, draw| {
        let back = |x: f64| -0.3 * x;
        vec![tones(t, 12.0, draw) + back(q[0]), (0.4 + draw[0]) * (7.0 * t + 5.0 * draw[1]).sin() + back(q[1])]
    },
    reads: positions,
    step: 0.01,
    samples: 1500,
    floor: None,
};

const BALL: Machine = Machine {
    name: "ball between bounces, in air",
    without: "ball without the drag of the air",
    system: r#"
name = "ball-in-air"
lagrangian = "(x_dot^2 + y_dot^2)/2 - g*y"
[[coordinates]]
name = "x"
unit = "m"
bounds = [0, 30]
velocity_bounds = [-10, 10]
[[coordinates]]
name = "y"
unit = "m"
bounds = [0, 5]
velocity_bounds = [-10, 10]
[forces]
x = "-b*x_dot*sqrt(x_dot^2 + y_dot^2)"
y = "-b*y_dot*sqrt(x_dot^2 + y_dot^2)"
[parameters]
g = { default = 9.81, learn = true }
b = { default = 0.1, learn = true }
"#,
    wrong: ("\"-b*x_dot*sqrt(x_dot^2 + y_dot^2)\"\ny = \"-b*y_dot*sqrt(x_dot^2 + y_dot^2)\"", "\"0*b\""),
    acceleration: |_, _, v, _| {
        let drag = 0.1 * v[0].hypot(v[1]);
        vec![-drag * v[0], -9.81 - drag * v[1]]
    },
    start: (&[0.0, 4.0], &[3.0, 2.0]),
    inputs: none,
    reads: positions,
    step: 0.01,
    samples: 400,
    floor: Some(0.85),
};

const FOUCAULT: Machine = Machine {
    name: "Foucault's pendulum in the Panthéon, 67 m",
    without: "Foucault's pendulum on an Earth at rest",
    system: r#"
name = "foucault"
lagrangian = "(x_dot^2 + y_dot^2)/2 + om*(x*y_dot - y*x_dot) - w^2*(x^2 + y^2)/2"
[[coordinates]]
name = "x"
unit = "m"
bounds = [-5, 5]
velocity_bounds = [-2, 2]
[[coordinates]]
name = "y"
unit = "m"
bounds = [-5, 5]
velocity_bounds = [-2, 2]
[parameters]
w = { default = 0.38264, unit = "rad/s", learn = true }
om = { default = 5.488e-5, unit = "rad/s", learn = true }
"#,
    wrong: (" + om*(x*y_dot - y*x_dot)", " + om*0"),
    acceleration: |_, q, v, _| {
        let (w, om) = (0.38264f64, 5.488e-5);
        vec![2.0 * om * v[1] - w * w * q[0], -2.0 * om * v[0] - w * w * q[1]]
    },
    start: (&[3.0, 0.1], &[0.0, 0.1]),
    inputs: none,
    reads: positions,
    step: 1.0,
    samples: 3600,
    floor: None,
};

const SHAKEN: Machine = Machine {
    name: "pendulum on a shaken support",
    without: "shaken pendulum without friction",
    system: r#"
name = "parametric-pendulum"
lagrangian = "l^2*th_dot^2/2 + l*(9.81 - a*om^2*cos(om*t))*cos(th)"
dissipation = "c*th_dot^2/2"
coordinates = [{ name = "th", periodic = true, velocity_bounds = [-9, 9] }]
[parameters]
l = { default = 0.5, learn = true, range = "positive" }
a = { default = 0.04, learn = true }
om = { default = 9, learn = true, range = "positive" }
c = { default = 0.02, learn = true }
"#,
    wrong: ("c*th_dot^2/2", "0*c*th_dot^2"),
    acceleration: |t, q, v, _| {
        let (l, a, om, c) = (0.5, 0.04, 9.0f64, 0.02);
        vec![-(9.81 - a * om * om * (om * t).cos()) / l * q[0].sin() - c / (l * l) * v[0]]
    },
    start: (&[0.8], &[0.0]),
    inputs: none,
    reads: positions,
    step: 0.02,
    samples: 750,
    floor: None,
};

const WIGGLER: Machine = Machine {
    name: "charged particle in a wiggler",
    without: "wiggler without its field",
    system: include_str!("../../../examples/systems/wiggler.toml"),
    wrong: ("sin(k*z)", "sin(k*x)"),
    acceleration: |_, q, v, _| {
        let field = 1.2 * (2.0 * q[1]).cos();
        vec![field * v[1], -field * v[0]]
    },
    start: (&[0.1, 0.0], &[0.0, 1.0]),
    inputs: none,
    reads: positions,
    step: 0.05,
    samples: 500,
    floor: None,
};

const SPACECRAFT: Machine = Machine {
    name: "spacecraft with thrusters near its orbit (Clohessy and Wiltshire, 1960)",
    without: "spacecraft without the tidal force",
    system: r#"
name = "spacecraft"
lagrangian = "(x_dot^2 + y_dot^2)/2 + n*(x*y_dot - y*x_dot) + 3*n^2*x^2/2"
[[coordinates]]
name = "x"
unit = "m"
bounds = [-3000, 3000]
velocity_bounds = [-5, 5]
[[coordinates]]
name = "y"
unit = "m"
bounds = [-9000, 9000]
velocity_bounds = [-9, 9]
[inputs]
u = "1"
w = "1"
[forces]
x = "G*u"
y = "H*w + tilt*u"
[parameters]
n = { default = 1.13e-3, unit = "rad/s", learn = true }
G = { default = 2e-3, unit = "m/s^2", learn = true }
H = { default = 1.5e-3, unit = "m/s^2", learn = true }
tilt = { default = 2e-4, unit = "m/s^2", learn = true }
"#,
    wrong: (" + 3*n^2*x^2/2", ""),
    acceleration: |_, q, v, u| {
        let n = 1.13e-3;
        let tangential = -2.0 * n * v[0] + 1.5e-3 * u[1] + 2e-4 * u[0];
        vec![3.0 * n * n * q[0] + 2.0 * n * v[1] + 2e-3 * u[0], tangential]
    },
    start: (&[50.0, 100.0], &[0.1, -0.1]),
    // Off, forwards or backwards.
    inputs: |t, _, _, draw| {
        let pulse =
            |rate: f64, at: usize| (1.4 * (rate * (0.6 + 0.8 * draw[at]) * t + 6.3 * draw[at + 1]).sin()).round();
        vec![pulse(0.011, 0), pulse(0.007, 2)]
    },
    reads: positions,
    step: 10.0,
    samples: 600,
    floor: None,
};

const STAR: Machine = Machine {
    name: "binary star, place on the sky and radial velocity",
    without: "binary star by another power of the distance",
    system: include_str!("../../../examples/systems/star_in_projection.toml"),
    wrong: (" + GM/r\"", " + GM/r^1.2\""),
    acceleration: |_, q, v, _| vec![q[0] * v[1] * v[1] - 35.0 / (q[0] * q[0]), -2.0 * v[0] * v[1] / q[0]],
    start: (&[1.0, 0.4], &[0.5, 5.0]),
    inputs: none,
    reads: |q, v| {
        let ((x, y), (sin_i, cos_i), (sin_node, cos_node)) =
            ((q[0] * q[1].cos(), q[0] * q[1].sin()), 0.9f64.sin_cos(), 0.3f64.sin_cos());
        let towards = v[0] * q[1].sin() + q[0] * v[1] * q[1].cos();
        vec![x * sin_node + y * cos_node * cos_i, x * cos_node - y * sin_node * cos_i, towards * sin_i]
    },
    step: 0.02,
    samples: 200,
    floor: None,
};

const MACHINES: [Machine; 9] = [DUFFING, STAGE, DRIVES, BALL, FOUCAULT, SHAKEN, WIGGLER, SPACECRAFT, STAR];

/// A motion and the inputs at its samples.
struct Recorded {
    recording: Recording,
    inputs: Vec<Vec<f64>>,
}

impl Machine {
    /// The system of the right or of the wrong form, with values in place of those of its file.
    fn system(&self, right: bool, values: &[(String, String)]) -> Outcome<SystemInstance<f64>> {
        let (text, other) = self.wrong;
        let changed = if right { self.system.to_string() } else { self.system.replace(text, other) };
        let description: Description = toml::from_str(&changed)?;
        Ok(SystemInstance::new(Cow::Owned(description.system()?), values)?)
    }

    /// The constants to find with their true values.
    fn truth(&self) -> Outcome<Vec<(String, f64)>> {
        let table: toml::Table = toml::from_str(self.system)?;
        let parameters = table["parameters"].as_table().ok_or("parameters")?;
        let value = |x: &toml::Value| x.as_float().or(x.as_integer().map(|x| x as f64));
        Ok(parameters.iter().filter_map(|(name, own)| Some((name.clone(), value(&own["default"])?))).collect())
    }

    /// Motion by the classical Runge-Kutta method of fourth order, with noise.
    fn record(&self, rng: &mut RandomGenerator) -> Outcome<Recorded> {
        let table: toml::Table = toml::from_str(self.system)?;
        let names = table["coordinates"].as_array().ok_or("coordinates")?;
        let coordinates: Vec<String> = names.iter().map(|own| own["name"].as_str().unwrap_or("q").into()).collect();
        let n = coordinates.len();
        let draw: [f64; 8] = std::array::from_fn(|_| rng.random_range(0.0..1.0));
        let mut state: Vec<f64> = [self.start.0, self.start.1].concat();
        state.iter_mut().for_each(|x| *x *= rng.random_range(0.9..1.1));
        let (mut tracks, mut inputs) = (vec![track()], vec![Vec::new()]);
        for sample in 0..self.samples {
            let t = sample as f64 * self.step;
            let given = (self.inputs)(t, &state[..n], &state[n..], &draw);
            let (own, inputs_of) = (tracks.last_mut().ok_or("none")?, inputs.last_mut().ok_or("none")?);
            own.times.push(t);
            let readings = (self.reads)(&state[..n], &state[n..]);
            own.q.extend(if readings.is_empty() { &state[..n] } else { &readings });
            inputs_of.extend(&given);
            let h = self.step / STEPS as f64;
            for k in 0..STEPS {
                state = self.stepped((t + k as f64 * h, h), &state, &given);
            }
            if let Some(kept) = self.floor.filter(|_| state[n - 1] < 0.0 && state[2 * n - 1] < 0.0) {
                state[2 * n - 1] *= -kept;
                tracks.push(track());
                inputs.push(Vec::new());
            }
        }
        let system = self.system(true, &[])?;
        let measured: Vec<String> = system.measured().map(str::to_string).collect();
        let named = if measured.is_empty() { coordinates } else { measured };
        let sizes: Vec<f64> = (0..named.len())
            .map(|i| {
                let own = || tracks.iter().flat_map(|track| track.q.iter().skip(i).step_by(named.len()));
                let mean = own().sum::<f64>() / self.samples as f64;
                NOISE * (own().map(|q| (q - mean) * (q - mean)).sum::<f64>() / self.samples as f64).sqrt()
            })
            .collect();
        for (k, q) in tracks.iter_mut().flat_map(|track| track.q.iter_mut().enumerate()) {
            let noise: f64 = StandardNormal.sample(rng);
            *q += sizes[k % sizes.len()] * noise;
        }
        if (self.inputs)(0.0, &state[..n], &state[n..], &draw).is_empty() {
            inputs.clear();
        }
        let angles = names.iter().map(|own| own.get("periodic").is_some());
        let periodic = if named.len() == n { angles.collect() } else { vec![false; named.len()] };
        Ok(Recorded { recording: Recording { coordinates: named, periodic, tracks }, inputs })
    }

    /// The state a step later.
    fn stepped(&self, (t, h): (f64, f64), state: &[f64], inputs: &[f64]) -> Vec<f64> {
        let n = state.len() / 2;
        let slope = |t: f64, x: &[f64]| [x[n..].to_vec(), (self.acceleration)(t, &x[..n], &x[n..], inputs)].concat();
        let along = |slope: &[f64], h: f64| state.iter().zip(slope).map(|(x, s)| x + h * s).collect::<Vec<f64>>();
        let first = slope(t, state);
        let second = slope(t + h / 2.0, &along(&first, h / 2.0));
        let third = slope(t + h / 2.0, &along(&second, h / 2.0));
        let fourth = slope(t + h, &along(&third, h));
        let mean = |k: usize| (first[k] + 2.0 * second[k] + 2.0 * third[k] + fourth[k]) / 6.0;
        (0..2 * n).map(|k| state[k] + h * mean(k)).collect()
    }

    /// What is said of recordings of so many seeds.
    fn judged(&self, seeds: u64, right: bool) -> Outcome<Tally> {
        let mut tally = Tally::of(right);
        let truth = self.truth()?;
        let pairs: Vec<(&str, f64)> = truth.iter().map(|(name, x)| (name.as_str(), *x)).collect();
        for seed in 0..seeds {
            let mut rng = RngStream::Test.generator(7000 + seed);
            let Recorded { recording, inputs } = self.record(&mut rng)?;
            let away = |x: f64, rng: &mut RandomGenerator| x * rng.random_range(1.0 - AWAY..1.0 + AWAY);
            let start: Vec<_> = truth.iter().map(|(name, x)| (name.clone(), away(*x, &mut rng).to_string())).collect();
            let options = IdentifyOptions::new().inputs(inputs).threads(2);
            match identify(&self.system(right, &start)?, &recording, &options) {
                Ok(found) => tally.count(seed, &found, &pairs),
                Err(error) => tally.refused(seed, &error.to_string()),
            }
        }
        Ok(tally)
    }
}

fn track() -> RecordedTrajectory {
    RecordedTrajectory { name: "run".into(), times: vec![], q: vec![], v: vec![], a: vec![], force: vec![] }
}

/// Cascaded tanks (Schoukens and Noel, 2017), as one might write them: motion of first order, without a kinetic energy.
const TANKS: &str = r#"
name = "tanks"
lagrangian = "0"
dissipation = "h1_dot^2/2 + h2_dot^2/2"
coordinates = [{ name = "h1", bounds = [0, 10] }, { name = "h2", bounds = [0, 10] }]
parameters = { k1 = 0.05, k2 = 0.05, k3 = 0.05, k4 = 0.2 }
inputs = { u = "V" }
forces = { h1 = "-k1*sqrt(h1) + k4*u", h2 = "k2*sqrt(h1) - k3*sqrt(h2)" }
"#;

/// Rates of `seeds` recordings of every machine.
pub fn rates(seeds: u64) -> Outcome<Vec<Rate>> {
    let tanks: Description = toml::from_str(TANKS)?;
    let refused = tanks.system().is_err_and(|error| error.to_string().contains("kinetic energy"));
    let (verdict, case) = ("refused for want of a kinetic energy", "cascaded tanks (Schoukens and Noel, 2017)");
    let mut rates = vec![Rate { verdict, case, said: refused.into(), of: 1, limits: 1.0..=1.0 }];
    for machine in &MACHINES {
        let right = machine.judged(seeds, true)?;
        rates.extend([right.explained(machine.name, 0.94..=1.0), right.held(machine.name, 0.85..=0.95)]);
        rates.push(machine.judged(seeds.div_ceil(5), false)?.explained(machine.without, 0.0..=0.05));
    }
    Ok(rates)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_those_of_the_system_file() {
        let (q, v) = ([0.8, 0.7], [0.4, 5.0]);
        let formulas = STAR.system(true, &[]).unwrap().measure((&q, &v, &[0.0; 2]), &[0.0]);
        let readings = (STAR.reads)(&q, &v);
        let apart = formulas.iter().zip(&readings).map(|(formula, reading)| (formula - reading).abs());
        assert!(formulas.len() == readings.len() && apart.fold(0.0, f64::max) < 1e-12, "{formulas:?} {readings:?}");
    }
}
