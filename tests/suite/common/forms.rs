//! Random systems of ten kinds, in most of which some constants are known in combinations alone, with recorded motion.
#![allow(dead_code, reason = "each program uses its part")]

use lnn::identification::{Identified, IdentifyOptions, identify};
use lnn::lagrangian::{Description, SystemInstance};
use lnn::random::RngStream;
use lnn::recording::{RecordedTrajectory, Recording};
use lnn::rollout::{Driven, RolloutOptions};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::borrow::Cow;
use std::collections::BTreeMap;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// A form: its Lagrangian and dissipation, coordinates with their usual start, constants with their usual values and whether they are positive,
/// and whether it is driven.
struct Form {
    lagrangian: &'static str,
    dissipation: &'static str,
    coordinates: &'static [(&'static str, f64)],
    constants: &'static [(&'static str, f64, bool)],
    driven: bool,
}

const FORMS: [Form; 10] = [
    // Known is l/g.
    Form {
        lagrangian: "m*l^2*a_dot^2/2 + m*g*l*cos(a)",
        dissipation: "0*a_dot",
        coordinates: &[("a", 1.0)],
        constants: &[("m", 2.0, true), ("l", 1.0, true), ("g", 9.8, true)],
        driven: false,
    },
    // Two directions share the constant of friction.
    Form {
        lagrangian: "m*l^2*a_dot^2/2 + m*g*l*cos(a)",
        dissipation: "c*a_dot^2/2",
        coordinates: &[("a", 1.5)],
        constants: &[("m", 2.0, true), ("l", 1.0, true), ("g", 9.8, true), ("c", 0.5, true)],
        driven: false,
    },
    Form {
        lagrangian: "m*x_dot^2/2 - k*x^2/2",
        dissipation: "c*x_dot^2/2",
        coordinates: &[("x", 1.0)],
        constants: &[("m", 1.5, true), ("k", 6.0, true), ("c", 0.3, true)],
        driven: false,
    },
    // A sum with a small partner.
    Form {
        lagrangian: "x_dot^2/2 - (a + b)*x^2/2",
        dissipation: "0*x_dot",
        coordinates: &[("x", 1.0)],
        constants: &[("a", 3.0, true), ("b", 0.01, true)],
        driven: false,
    },
    // Signed constants.
    Form {
        lagrangian: "x_dot^2/2 - k*x^2/2 + p*r*x",
        dissipation: "0*x_dot",
        coordinates: &[("x", 1.0)],
        constants: &[("k", 4.0, true), ("p", -1.5, false), ("r", 0.8, false)],
        driven: false,
    },
    // Everything is known.
    Form {
        lagrangian: "m*x_dot^2/2 - k*x^2/2",
        dissipation: "c*x_dot^2/2",
        coordinates: &[("x", 0.5)],
        constants: &[("m", 1.5, true), ("k", 6.0, true), ("c", 0.4, true)],
        driven: true,
    },
    Form {
        lagrangian: "m*x_dot^2/2 + n*y_dot^2/2 - k*x^2/2 - s*(y - x)^2/2",
        dissipation: "0*x_dot",
        coordinates: &[("x", 1.0), ("y", -0.6)],
        constants: &[("m", 1.0, true), ("n", 1.5, true), ("k", 3.0, true), ("s", 5.0, true)],
        driven: false,
    },
    // A square.
    Form {
        lagrangian: "x_dot^2/2 - a^2*b*x^2/2",
        dissipation: "c*x_dot^2/2",
        coordinates: &[("x", 1.0)],
        constants: &[("a", 1.5, true), ("b", 2.0, true), ("c", 0.2, true)],
        driven: false,
    },
    // A force tells everything but the two parts of a product.
    Form {
        lagrangian: "m*x_dot^2/2 - k*w*x^2/2",
        dissipation: "0*x_dot",
        coordinates: &[("x", 0.5)],
        constants: &[("m", 1.5, true), ("k", 3.0, true), ("w", 2.0, true)],
        driven: true,
    },
    // A difference.
    Form {
        lagrangian: "x_dot^2/2 - k*x^2/2 + (u - w)*x",
        dissipation: "0*x_dot",
        coordinates: &[("x", 1.0)],
        constants: &[("k", 4.0, true), ("u", 2.0, false), ("w", 1.2, false)],
        driven: false,
    },
];

/// Number of kinds.
pub const KINDS: usize = FORMS.len();
const NOISE: f64 = 1e-3;
/// Time between samples in s.
const STEP: f64 = 0.02;

/// A system of a kind with its true constants and a recording of its motion.
pub struct Trial {
    form: &'static Form,
    pub truth: BTreeMap<String, f64>,
    recording: Recording,
}

/// Values of constants within a factor of the usual ones.
fn drawn(form: &Form, factor: f64, rng: &mut impl Rng) -> BTreeMap<String, f64> {
    let mut scaled = |usual: f64| usual * factor.powf(rng.random_range(-1.0..1.0));
    form.constants.iter().map(|(name, usual, _)| (name.to_string(), scaled(*usual))).collect()
}

fn instance(form: &Form, values: &BTreeMap<String, f64>) -> Outcome<SystemInstance<f64>> {
    let coordinates: Vec<String> = form
        .coordinates
        .iter()
        .map(|(name, _)| format!(r#"{{"name": "{name}", "bounds": [-4, 4], "velocity_bounds": [-9, 9]}}"#))
        .collect();
    let constants: Vec<String> = form
        .constants
        .iter()
        .map(|(name, usual, positive)| {
            let range = if *positive { "positive" } else { "any" };
            format!(r#""{name}": {{"default": {usual}, "range": "{range}"}}"#)
        })
        .collect();
    let text = format!(
        r#"{{"name": "drawn", "lagrangian": "{}", "dissipation": "{}", "coordinates": [{}], "parameters": {{{}}}}}"#,
        form.lagrangian,
        form.dissipation,
        coordinates.join(", "),
        constants.join(", ")
    );
    let description: Description = serde_json::from_str(&text)?;
    let given: Vec<(String, String)> = values.iter().map(|(name, x)| (name.clone(), x.to_string())).collect();
    Ok(SystemInstance::new(Cow::Owned(description.system()?), &given)?)
}

impl Trial {
    /// The system of a kind and a seed, recorded twice over `seconds` at 50 samples a second.
    pub fn new(kind: usize, seed: u64, seconds: f64) -> Outcome<Self> {
        let form = &FORMS[kind];
        let mut rng = RngStream::Trajectories.generator(1000 * seed + kind as u64);
        let truth = drawn(form, 1.5, &mut rng);
        let model = instance(form, &truth)?.build()?;
        let n = form.coordinates.len();
        let push = |t: f64| 4.0 * (1.7 * t).sin() + 2.5 * (4.1 * t).cos();
        // Straight lines between the samples, so that it is known what drives the system there.
        let between = |t: f64| {
            let (before, share) = ((t / STEP).floor(), (t / STEP).fract());
            (1.0 - share) * push(before * STEP) + share * push((before + 1.0) * STEP)
        };
        let law =
            |t: f64, _: &[f64], _: &[f64], force: &mut [f64]| force[0] = if form.driven { between(t) } else { 0.0 };
        let mut tracks = Vec::new();
        for sign in [1.0, -0.6] {
            let start: Vec<f64> = form.coordinates.iter().map(|(_, q)| q * sign).collect();
            let motion =
                Driven::new(&*model, &law).rollout(&start, &vec![0.0; n], &RolloutOptions::reference(seconds, STEP));
            let motion = motion.complete()?;
            let noisy = |q: &f64| {
                let draw: f64 = StandardNormal.sample(&mut rng);
                q + NOISE * draw
            };
            let q = motion.q.iter().map(noisy).collect();
            let force = if form.driven { motion.t.iter().map(|t| push(*t)).collect() } else { Vec::new() };
            tracks.push(RecordedTrajectory { name: "run".into(), times: motion.t, q, v: vec![], a: vec![], force });
        }
        let coordinates = form.coordinates.iter().map(|(name, _)| name.to_string()).collect();
        Ok(Self { form, truth, recording: Recording { coordinates, periodic: vec![false; n], tracks } })
    }

    /// What is found from a start within a factor of 2.5 of the usual constants.
    pub fn identified(&self, start: u64) -> Outcome<Identified> {
        let mut rng = RngStream::Trajectories.generator(77_000 + start);
        let form = instance(self.form, &drawn(self.form, 2.5, &mut rng))?;
        Ok(identify(&form, &self.recording, &IdentifyOptions::default())?)
    }
}

/// A stated value.
pub struct Stated {
    pub name: String,
    pub value: f64,
    pub error: f64,
    terms: Vec<(String, f64)>,
    product: bool,
}

impl Stated {
    /// Its value by other constants.
    pub fn by(&self, constants: &BTreeMap<String, f64>) -> f64 {
        let terms = self.terms.iter().map(|(name, factor)| (constants[name], *factor));
        match self.product {
            true => terms.map(|(x, power)| x.powi(power as i32)).product(),
            false => terms.map(|(x, factor)| x * factor).sum(),
        }
    }
}

/// Everything whose value and error are stated: constants and combinations.
pub fn stated(found: &Identified) -> Vec<Stated> {
    let constants = found.constants.iter().filter_map(|constant| {
        let terms = vec![(constant.symbol.clone(), 1.0)];
        let (name, value) = (constant.symbol.clone(), constant.value);
        Some(Stated { name, value, error: constant.standard_error?, terms, product: false })
    });
    let open = found.undetermined.iter().flat_map(|open| &open.known).chain(&found.combinations);
    let known = open.map(|known| Stated {
        name: known.name.clone(),
        value: known.value,
        error: known.standard_error,
        terms: known.terms.clone(),
        product: known.product,
    });
    constants.chain(known).collect()
}

/// Values of all constants of a result.
pub fn values(found: &Identified) -> BTreeMap<String, f64> {
    found.constants.iter().map(|constant| (constant.symbol.clone(), constant.value)).collect()
}
