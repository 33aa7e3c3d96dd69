//! The search for constants from starts that are far off: it arrives at the truth or says that it did not.

use super::{Outcome, Rate};
use crate::setups::configured;
use lnn::identification::{Identified, IdentifyOptions, identify};
use lnn::lagrangian::SystemInstance;
use lnn::prelude::*;
use lnn::random::RngStream;
use lnn::recording::{RecordedTrajectory, Recording};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// Starts are off by a factor of up to so much, either way.
const FAR: f64 = 20.0;
/// Standard errors beyond which a constant is wrong.
const WRONG: f64 = 5.0;

/// A form, the truth of its constants, and the scale of starts of the motion, `(2, n)`.
struct Case {
    text: &'static str,
    truth: &'static [(&'static str, [f64; 2])],
    starts: &'static [f64],
}

/// Constants are drawn between two values, by their logarithm.
const CASES: [Case; 4] = [
    Case {
        text: r#"
            name = "spring"
            lagrangian = "m*x_dot^2/2 - k*x^2/2 - b*x^4/4"
            dissipation = "c*x_dot^2/2"
            coordinates = [{ name = "x", bounds = [-2, 2], velocity_bounds = [-3, 3] }]
            [parameters]
            m = 1
            k = { default = 1, learn = true, range = "positive" }
            b = { default = 1, learn = true, range = "at least 0" }
            c = { default = 1, learn = true, range = "positive" }"#,
        truth: &[("k", [0.5, 10.0]), ("b", [0.2, 5.0]), ("c", [0.05, 5.0])],
        starts: &[1.5, 2.0],
    },
    Case {
        text: r#"
            name = "swing"
            lagrangian = "a_dot^2/2 + w*cos(a)"
            dissipation = "c*a_dot^2/2"
            coordinates = [{ name = "a", periodic = true, velocity_bounds = [-5, 5] }]
            [parameters]
            w = { default = 1, learn = true, range = "positive" }
            c = { default = 1, learn = true, range = "positive" }"#,
        truth: &[("w", [2.0, 30.0]), ("c", [0.05, 2.0])],
        starts: &[2.0, 3.0],
    },
    Case {
        text: r#"
            name = "orbit"
            lagrangian = "(x_dot^2 + y_dot^2)/2 + mu/sqrt(x^2 + y^2)"
            coordinates = [{ name = "x", bounds = [-3, 3], velocity_bounds = [-3, 3] }, { name = "y", bounds = [-3, 3], velocity_bounds = [-3, 3] }]
            [parameters]
            mu = { default = 1, learn = true, range = "positive" }"#,
        truth: &[("mu", [0.7, 1.5])],
        starts: &[1.0, 0.1, 0.1, 1.0],
    },
    Case {
        text: r#"
            name = "pair"
            lagrangian = "(x_dot^2 + y_dot^2)/2 - k*x^2/2 - s*(x - y)^2/2"
            dissipation = "c*(x_dot - y_dot)^2/2"
            coordinates = [{ name = "x", bounds = [-2, 2], velocity_bounds = [-3, 3] }, { name = "y", bounds = [-2, 2], velocity_bounds = [-3, 3] }]
            [parameters]
            k = { default = 1, learn = true, range = "positive" }
            s = { default = 1, learn = true, range = "positive" }
            c = { default = 1, learn = true, range = "positive" }"#,
        truth: &[("k", [0.5, 10.0]), ("s", [0.5, 10.0]), ("c", [0.02, 1.0])],
        starts: &[1.0, 1.0, 2.0, 2.0],
    },
];

impl Case {
    fn system(&self, given: &[(&str, f64)]) -> Outcome<SystemInstance<f64>> {
        configured(self.text, given)
    }

    /// Motion of 8 s at 50 Hz with 2 permille of noise, identified from a far start; the truth.
    fn identified(&self, seed: u64) -> Outcome<(Identified, Vec<(&'static str, f64)>)> {
        let mut rng = RngStream::Trajectories.generator(seed);
        let mut between = |low: f64, high: f64| low * (high / low).powf(rng.random::<f64>());
        let truth: Vec<(&str, f64)> =
            self.truth.iter().map(|(name, [low, high])| (*name, between(*low, *high))).collect();
        let start: Vec<(&str, f64)> = truth.iter().map(|(name, x)| (*name, x * between(1.0 / FAR, FAR))).collect();
        let state: Vec<f64> = self.starts.iter().map(|scale| scale * between(0.6, 1.2)).collect();
        let instance = self.system(&truth)?;
        let n = instance.coordinates;
        let motion = instance.build()?.rollout(&state[..n], &state[n..], 8.0, 0.02)?;
        let noisy = |q: &f64| {
            let draw: f64 = StandardNormal.sample(&mut rng);
            q + 2e-3 * draw
        };
        let q = motion.q.iter().map(noisy).collect();
        let track = RecordedTrajectory { name: "run".into(), times: motion.t, q, v: vec![], a: vec![], force: vec![] };
        let coordinates = instance.system.coordinates(n);
        let recording = Recording {
            coordinates: coordinates.iter().map(|c| c.name.to_string()).collect(),
            periodic: coordinates.iter().map(|c| c.periodic).collect(),
            tracks: vec![track],
        };
        Ok((identify(&self.system(&start)?, &recording, &IdentifyOptions::default())?, truth))
    }
}

/// Rates of `seeds` systems of every form.
pub fn convergence(seeds: u64) -> Outcome<Vec<Rate>> {
    let [mut found, mut wrong, mut silent, mut of] = [0; 4];
    for case in &CASES {
        for seed in 0..seeds {
            let (identified, truth) = case.identified(seed)?;
            let near = |(name, truth): &(&str, f64)| {
                let constant = identified.constants.iter().find(|constant| constant.symbol == *name);
                constant.is_some_and(|c| c.standard_error.is_none_or(|error| (c.value - truth).abs() < WRONG * error))
            };
            let right = truth.iter().all(near);
            of += 1;
            found += usize::from(right && identified.converged);
            wrong += usize::from(!right && identified.explained);
            silent += usize::from(!identified.converged && identified.explained);
        }
    }
    let case = "starts off by a factor of up to 20";
    let rate = |verdict, said, limits| Rate { verdict, case, said, of, limits };
    Ok(vec![
        rate("explained, constants wrong", wrong, 0.0..=0.02),
        rate("explained, not converged", silent, 0.0..=0.0),
        rate("converged, constants right", found, 0.9..=1.0),
    ])
}
