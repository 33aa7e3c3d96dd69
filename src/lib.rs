//! Stabilized Lagrangian neural networks: learn `L(q, dq/dt)` from motion, predict motion that keeps its energy, read
//! physics off the learned function.
//!
//! # The way of the data
//!
//! ```text
//! measured motion  recording::Recording ─┐
//! states with a    data::Dataset  ───┼─► training::train ─► network::NetworkLagrangian ◄─► network::file::ModelFile
//! closed form      data::sample   ───┘                               │
//! L written down   lagrangian::Lagrangian ─► lagrangian::Mechanics ────┤
//!                                                                        ▼
//!                                                       lagrangian::EulerLagrange: L, p, M, a, E of a batch
//!                                                                        │
//!                                rollout (motion) ◄──────────────────────┼──► analysis (errors, exponents), your solver
//! ```
//!
//! Everything that moves by a Lagrangian, learned or written down, is an [`EulerLagrange`](lagrangian::EulerLagrange):
//! one call gives the terms of a batch of states, and nothing that was not asked for is computed.
//!
//! | to | use |
//! |---|---|
//! | write a Lagrangian, or take one of the catalogue | [`lagrangian::Lagrangian`], [`lagrangian::systems()`] |
//! | get `L`, `p`, `M`, `a`, `E` of states | [`lagrangian::EulerLagrange::terms`] |
//! | know metric, connection and curvature at a point | [`geometry::geometries`] |
//! | integrate, with error control or symplectically | [`rollout::rollout`], [`rollout::rollout_many`] |
//! | learn from accelerations | [`presets::Trainer`] (your own [`data::Dataset`]), [`training::run`] (a configuration) |
//! | learn from recorded motion | `pipeline::Fit` (feature `pipeline`) |
//! | know every key of a configuration | the page [`docs::configuration`] |
//! | minimise your own loss of a network | [`training::Objective`], or [`tape::Recorded`] and [`tape::Evaluation`] below it |
//! | store and load models | [`network::file::ModelFile`] |
//! | differentiate a function of yours | [`tape::gradient`], [`tape::hessian`]; over many states [`tape::Program`] |
//! | solve small symmetric systems in batches | [`linalg`] |
//! | put constraints beside a Lagrangian, find those that recorded motion obeys | [`lagrangian::Constrained`], [`constraints`] |
//! | find what a Lagrangian conserves, compare two Lagrangians | [`symmetry::symmetries`], [`symmetry::quadratic`], [`symmetry::compare`] |
//! | read a Lagrangian as a formula, from motion or from a model | [`formula`] |
//! | see the shadow of a black hole and the sky around it | [`relativity::shadow()`], [`relativity::outline`] |
//! | prove where a mass matrix has its signature | [`certificate`] |
//! | judge a model: energy, coordinates, Lyapunov exponents | [`analysis`] |
//! | train, fit, evaluate, run an experiment, with all files and reports | `pipeline` (feature `pipeline`) |
//!
//! [`prelude`] holds the names that most programs need. Inside, the modules stand on six floors, `numerics`, `support`, `mechanics`,
//! `learning`, `physics` and `app`, each of which imports only from those before it.
//!
//! # Shapes, units, numbers
//!
//! A state is `(q, v)`, `v = dq/dt`. A batch of `b` states of `n` coordinates is two slices `(b, n)`, row-major: one
//! state after the other. Matrices are `(b, n, n)`. Units are SI: m, rad, s, kg, J; angles may be any number of turns. What
//! a network has learned it returns in the same physical units, `L` up to a factor and a total time derivative, neither of
//! which moves anything. The number is a parameter of every type: [`f32`], [`f64`] or the double-double [`scalar::Dd`].
//!
//! Nothing here is global: a model, an objective or a roll-out may be used from any thread, several at a time. Threads
//! are started only where a number of threads is an argument; results do not depend on that number. Errors are
//! typed, `Send + Sync`, and say which row and which argument; library code does not print and does not end the process.
//!
//! # Terms of a Lagrangian
//!
//! ```
//! use lnn::prelude::*;
//!
//! struct SpringPendulum; // q = (length in m, angle in rad); m, k, rest length, g
//! impl Lagrangian for SpringPendulum {
//!     fn coordinates(&self) -> usize { 2 }
//!     fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
//!         let kinetic = p[0] * (v[0].sqr() + (q[0] * v[1]).sqr()) * R::of(0.5);
//!         kinetic - p[1] * (q[0] - p[2]).sqr() * R::of(0.5) + p[0] * p[3] * q[0] * q[1].cos()
//!     }
//! }
//!
//! let model = Mechanics::new(SpringPendulum, [0.5, 20.0, 1.0, 9.81]);
//! let (q, v) = ([1.2, 0.0, 1.5, 0.3], [0.0, 2.0, 1.0, 0.0]); // two states
//! assert_eq!(model.mass_matrix(&q, &v)?[..4], [0.5, 0.0, 0.0, 0.5 * 1.2 * 1.2]);
//! // r'' = r w^2 - k (r - r0)/m + g cos(angle)
//! let expected: f64 = 1.2 * 4.0 - 20.0 * 0.2 / 0.5 + 9.81;
//! assert!((model.acceleration(&q, &v)?[0] - expected).abs() < 1e-13);
//!
//! // Several terms in one pass, into buffers that are used again: later calls allocate nothing.
//! let mut terms = Terms::default();
//! model.terms(&q, &v, Request::MASS_MATRIX | Request::ENERGY, &mut terms)?;
//! assert_eq!(terms.energy.len(), 2);
//! # Ok::<(), lnn::lagrangian::MechanicsError>(())
//! ```
//!
//! # Motion
//!
//! ```
//! use lnn::lagrangian::build;
//! use lnn::prelude::*;
//! use lnn::rollout::Method;
//!
//! let model = build::<f64>("double-pendulum", &[("m2".to_string(), "0.5".to_string())])?;
//! let motion = model.rollout(&[2.0, 1.0], &[0.0, 0.0], 5.0, 0.1)?; // 5 s, a sample every 0.1 s
//! assert_eq!(motion.t.len(), 51);
//!
//! // By a method that keeps the energy.
//! let options = Options { method: Method::Gauss6, step: Some(0.01), ..Options::new(5.0, 0.1) };
//! let energy = rollout(&*model, &[2.0, 1.0], &[0.0, 0.0], &options).complete()?.energy.unwrap(); // J, at every sample
//! assert!(energy.iter().all(|e| (e - energy[0]).abs() < 1e-7));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Learning
//!
//! ```
//! use lnn::lagrangian::configure;
//! use lnn::training::{Hooks, run};
//! use lnn::presets::Preset;
//!
//! let system = configure::<f64>("harmonic-oscillator", &[])?;
//! let mut config = Preset::Quick.config(&system).unwrap();
//! config.network.hidden = vec![8]; // as small as can be: this runs in a moment
//! (config.data.training, config.data.validation, config.data.test) = (256, 64, 64);
//! (config.optimizer.batch, config.phases[0].epochs) = (32, 20);
//! let learned = run::<f64>(&config, 1, &Hooks::default())?; // one thread
//! let history = &learned.trained.history;
//! assert!(history[19].validation_loss < history[0].validation_loss);
//! // `learned.model` is an EulerLagrange like any other.
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! States of your own go to [`presets::Trainer`], recordings to `pipeline::Fit`.
//!
//! # Derivatives by the tape
//!
//! ```
//! use lnn::scalar::Real;
//! use lnn::tape::{ScalarFunction, gradient};
//!
//! struct Rosenbrock;
//! impl ScalarFunction for Rosenbrock {
//!     fn eval<R: Real>(&self, x: &[R]) -> R {
//!         (R::one() - x[0]).sqr() + (x[1] - x[0].sqr()).sqr() * R::of(8.0)
//!     }
//! }
//!
//! let (value, slope) = gradient(&Rosenbrock, &[2.0, 3.0])?;
//! assert_eq!((value, slope), (9.0, vec![34.0 * 2.0 - 2.0, -16.0]));
//! # Ok::<(), lnn::tape::TapeError>(())
//! ```
//!
//! Guides and reference stand in [`docs`]: the command line, configurations, recorded motion, the method, figures with their
//! commands. Programs that use the crate stand in `examples/`: solvers of other crates, parameter identification by argmin, nalgebra
//! matrices, batches without allocation, a filmed pendulum.
// What only higher floors use is dead without them; the default features tell what is dead for everybody.
#![cfg_attr(not(feature = "cli"), allow(dead_code, unused_imports))]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod prelude;

#[cfg(feature = "training")]
mod app;
#[cfg(feature = "data")]
mod learning;
mod mechanics;
mod numerics;
mod physics;
mod support;

// Users need not know the floors.
#[cfg(feature = "cli")]
#[doc(hidden)]
pub use app::cli;
#[cfg(feature = "training")]
#[doc(hidden)]
pub use app::experiments;
#[cfg(feature = "pipeline")]
pub use app::pipeline;
#[cfg(feature = "plot")]
#[doc(hidden)]
pub use app::report;
#[cfg(feature = "data")]
pub use learning::recording;
#[cfg(feature = "training")]
pub use learning::{configuration, data, optimizers, presets, shooting, training};
#[cfg(feature = "rollout")]
pub use mechanics::rollout;
pub use mechanics::{lagrangian, network};
#[doc(hidden)]
pub use numerics::ops;
#[doc(hidden)]
pub use numerics::random;
pub use numerics::{forward, linalg, scalar, tape};
#[cfg(feature = "data")]
pub use physics::constraints;
#[cfg(feature = "training")]
pub use physics::{analysis, formula};
pub use physics::{certificate, geometry};
#[cfg(feature = "rollout")]
pub use physics::{relativity, symmetry};
pub(crate) use support::names;
#[doc(hidden)]
pub use support::storage;

#[cfg(all(any(doc, doctest), feature = "cli"))]
#[cfg(any(doc, doctest))]
pub mod docs;

/// The README's code runs as a documentation test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
