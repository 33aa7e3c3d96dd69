//! Stabilized Lagrangian neural networks: learn `L(q, dq/dt)` from motion, predict motion that conserves its energy, and read
//! physics off the learned function.
//!
//! # Flow of data
//!
//! ```text
//! measured motion  recording::Recording ─┐
//! states with a    data::Dataset  ───┼─► training::train ─► network::NetworkLagrangian ◄─► network::ModelFile
//! closed form      data::sample   ───┘                               │
//! L written down   lagrangian::Lagrangian ─► lagrangian::Mechanics ────┤
//!                                                                        ▼
//!                                                       lagrangian::EulerLagrange: L, p, M, a, E of a batch
//!                                                                        │
//!                                rollout (motion) ◄──────────────────────┼──► analysis (errors, exponents), your solver
//! ```
//!
//! Every Lagrangian, learned or written down, is an [`EulerLagrange`](lagrangian::EulerLagrange). One call evaluates the requested
//! terms of a batch of states, and only those.
//!
//! | to | use |
//! |---|---|
//! | write a Lagrangian, or take one of the catalogue | [`lagrangian::Lagrangian`], [`lagrangian::System::unconstrained`] |
//! | get `L`, `p`, `M`, `a`, `E` of states | [`lagrangian::EulerLagrange::terms`] |
//! | compute the metric, connection and curvature at a point | [`geometry::Geometry::of`] |
//! | integrate, with error control or symplectically | [`rollout::rollout`], [`rollout::rollout_many`] |
//! | learn from accelerations | [`presets::Trainer`] (your own [`data::Dataset`]), [`training::run`] (a configuration) |
//! | learn from recorded motion | `pipeline::Fit` (feature `pipeline`) |
//! | look up a key of a configuration | the page [`docs::configuration`] |
//! | minimise your own loss of a network | [`training::Objective`], or [`tape::Recorded`] and [`tape::Evaluation`] below it |
//! | store and load models | [`network::ModelFile`] |
//! | differentiate your own function | [`tape::Function`], recorded once; [`tape::gradient`], [`tape::hessian`] of one point |
//! | call accelerations from your own solver, of few or many coordinates | [`lagrangian::Accelerations`] |
//! | call the motion from a solver of another crate | [`lagrangian::EulerLagrange::rhs`] |
//! | call the torques of an arm from your own controller | [`lagrangian::Torques`] |
//! | linearize accelerations, by state, force and parameters | [`lagrangian::Linearizer`] |
//! | differentiate the end of a motion, by start, force and parameters | [`rollout::Flow`] |
//! | solve small symmetric systems in batches | [`linalg`] |
//! | put constraints beside a Lagrangian, find those that recorded motion obeys | [`lagrangian::Constrained`], [`constraints`] |
//! | find what a Lagrangian conserves, compare two Lagrangians | [`symmetry::Symmetries::find`], [`symmetry::Quadratic::find`], [`symmetry::Comparison::of`] |
//! | read a Lagrangian as a formula, from motion or from a model | [`formula`] |
//! | find the constants of a Lagrangian whose form is known | [`identification`] |
//! | read a system of your own from its file | `pipeline::parse_system` (feature `pipeline`), [`lagrangian::SystemInstance::new`] |
//! | draw random numbers that a seed repeats | [`random`] |
//! | see the shadow of a black hole and the sky around it | [`relativity::Scene`], [`relativity::Shadow::of`], [`relativity::Outline::of`] |
//! | prove where a mass matrix has its signature | [`certificate`] |
//! | test a model: energy, coordinates, Lyapunov exponents | [`analysis`] |
//! | end a long search, or see how far it is | [`cancellation::Cancellation`] |
//! | train, fit, evaluate, with all files and reports | `pipeline` (feature `pipeline`) |
//!
//! [`prelude`] holds the names that most programs need. Numbers, derivatives, Euler-Lagrange terms and roll-outs are a package of their
//! own, `lnn-engine`, with the same module names: a solver that embeds no more than them may depend on it alone. Internally, the
//! modules are arranged on six floors, `numerics`, `support` and `mechanics` in the engine, `learning`, `physics` and `app` above it,
//! each of which imports only from those before it.
//!
//! # Shapes, units, numbers
//!
//! A state is `(q, v)`, with `v = dq/dt`. A batch of `b` states of `n` coordinates is two row-major slices `(b, n)`. Matrices are
//! `(b, n, n)`. Units are SI: m, rad, s, kg, J. Angles may have any number of turns. A learned network returns its results in the
//! same physical units. Its `L` is determined up to a factor and a total time derivative, neither of which changes the motion. The
//! number type is a parameter of every type: [`f32`], [`f64`] or the double-double [`scalar::Dd`].
//!
//! There is no global state: a model, an objective or a roll-out may be used from several threads at the same time. The library
//! starts threads only where the number of threads is an argument, and results do not depend on that number. Errors are typed and
//! `Send + Sync`, and they name the row and the argument. Library code neither prints nor ends the process.
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
//! // Several terms in one pass, into buffers that are reused: later calls allocate nothing.
//! let mut terms = Terms::default();
//! model.terms(&q, &v, Request::MASS_MATRIX | Request::ENERGY, &mut terms)?;
//! assert_eq!(terms.energy.len(), 2);
//! # Ok::<(), lnn::lagrangian::MechanicsError>(())
//! ```
//!
//! # Motion
//!
//! ```
//! use lnn::lagrangian::SystemInstance;
//! use lnn::prelude::*;
//! use lnn::rollout::Integrator;
//!
//! let model = SystemInstance::<f64>::named("double-pendulum", &[("m2".to_string(), "0.5".to_string())])?.build()?;
//! let motion = model.rollout(&[2.0, 1.0], &[0.0, 0.0], 5.0, 0.1)?; // 5 s, a sample every 0.1 s
//! assert_eq!(motion.t.len(), 51);
//!
//! // With a method that conserves the energy.
//! let options = RolloutOptions::new(5.0, 0.1).method(Integrator::Gauss6).step(0.01);
//! let energy = rollout(&*model, &[2.0, 1.0], &[0.0, 0.0], &options).complete()?.energy.unwrap(); // J, at every sample
//! assert!(energy.iter().all(|e| (e - energy[0]).abs() < 1e-7));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Learning
//!
//! ```
//! use lnn::lagrangian::SystemInstance;
//! use lnn::presets::Preset;
//! use lnn::training::{Hooks, run};
//!
//! let system = SystemInstance::<f64>::named("harmonic-oscillator", &[])?;
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
//! To learn from your own states, use [`presets::Trainer`]; to learn from recordings, `pipeline::Fit`.
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
//! The module [`docs`] holds guides and references: the command line, configurations, recorded motion, the method, and figures with
//! their commands. The folder `examples/` holds programs that use the crate: solvers of other crates, parameter identification by
//! argmin, nalgebra matrices, batches without allocation, a filmed pendulum.
// What only higher floors use is dead without them; the default features tell what is dead for everybody.
#![cfg_attr(not(feature = "pipeline"), allow(dead_code, unused_imports))]
#![cfg_attr(not(feature = "std"), no_std)]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

#[macro_use]
extern crate alloc;

pub mod prelude;

#[cfg(feature = "training")]
mod app;
#[cfg(feature = "data")]
mod learning;
#[cfg(test)]
#[allow(dead_code, reason = "the engine's own tests use the others")]
#[path = "../crates/lnn-engine/src/mechanics/rollout/models.rs"]
mod models;
mod physics;
#[cfg(test)]
#[path = "../crates/lnn-engine/src/properties.rs"]
mod properties;

// Users need not know the floors.
#[cfg(feature = "pipeline")]
pub use app::pipeline;
#[cfg(feature = "plot")]
#[doc(hidden)]
pub use app::report;
#[cfg(feature = "data")]
pub use learning::recording;
#[cfg(feature = "training")]
pub use learning::{configuration, data, optimizers, presets, training};
#[cfg(feature = "std")]
pub use lnn_engine::cancellation;
#[cfg(feature = "rollout")]
pub use lnn_engine::rollout;
#[cfg(feature = "std")]
#[doc(hidden)]
pub use lnn_engine::storage;
pub use lnn_engine::{findings, lagrangian, linalg, network, random, scalar, tape};
#[doc(hidden)]
pub use lnn_engine::{forward, names, ops};
#[cfg(feature = "std")]
pub use physics::certificate;
#[cfg(feature = "data")]
pub use physics::constraints;
#[cfg(feature = "data")]
pub(crate) use physics::digits;
pub use physics::geometry;
#[cfg(feature = "training")]
pub use physics::{analysis, formula, identification};
#[cfg(feature = "rollout")]
pub use physics::{relativity, symmetry};
#[cfg(feature = "training")]
#[doc(hidden)]
pub use {app::experiments, learning::shooting};

#[cfg(all(any(doc, doctest), feature = "pipeline"))]
pub mod docs;

/// The README's code runs as a documentation test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
