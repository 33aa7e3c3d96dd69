//! Certificates: proofs that the mass matrix `M = d2L/dv dv` has its signature, and a condition number below a bound, in a region of states.
//!
//! A Lagrangian, learned or given as a formula, is evaluated once per box of states with numbers that carry its value and its first and second
//! derivatives along the velocities, each as a polynomial over the box and a bound of the distance from it (a Taylor model, of the third
//! order for two coordinates). The result encloses the mass matrix of every state of the box; Gershgorin's and Sylvester's theorems prove
//! the signs of its eigenvalues and bound its condition number. Undecided boxes are cut in two.
//!
//! # What is proven
//!
//! Every statement is about the Lagrangian as a function of real numbers whose weights, parameters and constants are those of the program.
//! The rounding of the proof itself is covered everywhere: `Interval`s are rounded outward, forms add to their distance the possible
//! rounding error of a sum or a product, and the functions of the standard library are granted 8 units in the last place. Rounding in a
//! program that evaluates the same mass matrix at one state is not part of the statement; it shifts eigenvalues by about the condition
//! number times `1e-16`, relative to the smallest.
//!
//! A box in which a branch of the Lagrangian (`select`, `max`, `|x|`) is not decided, or the Lagrangian is not defined, stays open.
//!
//! # Example
//!
//! ```
//! use lnn::certificate::{Certificate, CertificateOptions, Signature, Verdict};
//! use lnn::lagrangian::{Bounds, SystemInstance};
//!
//! let pendulum = SystemInstance::<f64>::named("double-pendulum", &[])?;
//! let region = Bounds::uniform(2, (-3.2, 3.2), (-9.0, 9.0)); // rad, rad/s
//! let mut options = CertificateOptions::new(Signature { positive: 2, negative: 0 });
//! options.boxes = 20_000;
//! let found = Certificate::of_system(&pendulum, &region, &options)?;
//! assert_eq!((found.certified, found.refuted, found.open), (1.0, 0.0, 0.0));
//! // M = [[2, c], [c, 1]] with c = cos(theta1 - theta2): the largest condition number is 6.854, at c = 1.
//! assert!(found.condition.unwrap() > 6.854);
//! assert!(matches!(found.verdict(&[0.1, 3.0], &[1.0, -8.0]), Verdict::Certified { .. }));
//! assert_eq!(found.verdict(&[4.0, 3.0], &[1.0, -8.0]), Verdict::Open); // outside
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod arena;
mod form;
mod function;
mod interval;
mod models;
mod number;
mod report;
mod search;
mod spectrum;
mod thresholds;

pub use models::Guarded;
pub use search::Verdict;

use crate::lagrangian::system::Bounds;
use crate::lagrangian::{Lagrangian, LagrangianVisitor, SystemInstance};
use crate::scalar::Scalar;
use search::{Tree, search};
use spectrum::{Enclose, Source};
use std::sync::atomic::AtomicBool;
use std::time::Instant;
use thresholds::MOST_COORDINATES;

/// Numbers of positive and of negative eigenvalues of a mass matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(into = "[usize; 2]"))]
pub struct Signature {
    /// Positive eigenvalues.
    pub positive: usize,
    /// Negative eigenvalues.
    pub negative: usize,
}

impl From<Signature> for [usize; 2] {
    fn from(of: Signature) -> Self {
        [of.positive, of.negative]
    }
}

impl Signature {
    /// The signature of `n` coordinates, one of which may be a time: all positive except for the time.
    pub fn of(n: usize, time_like: bool) -> Self {
        let negative = usize::from(time_like && n > 0);
        Self { positive: n - negative, negative }
    }
}

/// What a search for a certificate proves, and how long it may take. [`CertificateOptions::new`] sets the signature and usual limits; assign
/// the other fields afterwards.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct CertificateOptions<'a> {
    /// Signature to be proven.
    pub signature: Signature,
    /// Largest condition number allowed, `max |eigenvalue| / min |eigenvalue|` of the matrix in the units of the coordinates, at least 1;
    /// `None` for any.
    pub condition: Option<f64>,
    /// Time in s after which no further box is evaluated.
    pub seconds: f64,
    /// Largest number of boxes to evaluate. A search that this limit ends, rather than time, gives the same result on any number of threads.
    pub boxes: usize,
    /// Largest number of threads; if fewer can be started, the search takes longer and finds the same.
    pub threads: usize,
    /// A flag that stops the search; proofs up to then are kept.
    pub stop: Option<&'a AtomicBool>,
}

impl CertificateOptions<'_> {
    /// Ten seconds on one thread, any condition number, at most 10 million boxes.
    pub fn new(signature: Signature) -> Self {
        Self { signature, condition: None, seconds: 10.0, boxes: 10_000_000, threads: 1, stop: None }
    }
}

/// A state where the mass matrix is proven to violate the conditions.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Witness {
    /// Coordinates `(n)`.
    pub q: Vec<f64>,
    /// Velocities `(n)`.
    pub v: Vec<f64>,
    /// Eigenvalues of the mass matrix there, ascending, rounded.
    pub eigenvalues: Vec<f64>,
}

/// Outcome of a search: shares of the region, which add up to 1, and proofs about single states.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Certificate {
    /// The signature that was to be proven.
    pub signature: Signature,
    /// The largest condition number that was allowed.
    #[cfg_attr(feature = "serde", serde(rename = "condition"))]
    pub limit: Option<f64>,
    /// Fraction of the region in which every state is proven to satisfy the conditions.
    pub certified: f64,
    /// Fraction of the region in which every state is proven to violate the conditions.
    pub refuted: f64,
    /// Fraction of the region in which neither is proven.
    pub open: f64,
    /// Boxes evaluated.
    pub boxes: usize,
    /// A state that is proven to violate the conditions, if one was found.
    pub witness: Option<Witness>,
    /// Proven bound of the condition number in the whole certified share; `None` if no box was certified by enclosures.
    #[cfg_attr(feature = "serde", serde(rename = "condition_bound"))]
    pub condition: Option<f64>,
    /// `true` if the structure of the model proves the signature at every state, in the region and outside of it.
    pub by_construction: bool,
    /// Time taken in s.
    pub seconds: f64,
    #[cfg_attr(feature = "serde", serde(skip))]
    regions: Vec<Vec<(f64, f64)>>,
    #[cfg_attr(feature = "serde", serde(skip))]
    tree: Tree,
    /// `true` for coordinates that are reduced to one turn before the Lagrangian is evaluated.
    #[cfg_attr(feature = "serde", serde(skip))]
    wrapped: Vec<bool>,
}

impl Certificate {
    /// The verdict on a state: `q` and `v`, both `(n)`. [`Verdict::Open`] outside the region and for a state of the wrong length.
    ///
    /// This takes a few comparisons, so that an integrator can call it at every step, as it does for a [`Guarded`] model.
    pub fn verdict<S: Scalar>(&self, q: &[S], v: &[S]) -> Verdict {
        let wrapped = |(i, x): (usize, &S)| if self.wrapped.get(i) == Some(&true) { x.wrap_angle() } else { *x };
        let state: Vec<f64> = q.iter().enumerate().map(wrapped).chain(v.iter().copied()).map(S::to_f64).collect();
        let holds = |region: &&Vec<(f64, f64)>| {
            region.len() == state.len() && region.iter().zip(&state).all(|(b, x)| b.0 <= *x && *x <= b.1)
        };
        let found = self.regions.iter().position(|region| holds(&region));
        found.map_or(Verdict::Open, |root| self.tree.verdict(root, &state))
    }
}

/// Why there is no certificate.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum CertificateError {
    /// A region with bounds for another number of coordinates.
    Shape {
        /// Coordinates or velocities.
        what: &'static str,
        /// Number of coordinates.
        expected: usize,
        /// Pairs found.
        found: usize,
    },
    /// Bounds that contain no number, or too many.
    Bounds {
        /// Coordinate or velocity.
        what: &'static str,
        /// Index from 0.
        index: usize,
        /// Lower bound found.
        low: f64,
        /// Upper bound found.
        high: f64,
    },
    /// A signature of a matrix of another size.
    Signature {
        /// Number of coordinates.
        expected: usize,
        /// Positive eigenvalues.
        positive: usize,
        /// Negative eigenvalues.
        negative: usize,
    },
    /// A condition number below 1, or not a number.
    Condition(f64),
    /// More coordinates than are supported.
    Coordinates(usize),
    /// The system is not in the catalogue and has no description.
    NoLagrangian,
    /// A system that depends on the time.
    Timed,
}

impl std::fmt::Display for CertificateError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Shape { what, expected, found } => write!(f, "expected bounds of {expected} {what}, found {found}"),
            Self::Bounds { what, index, low, high } => {
                write!(f, "bounds of {what} {index}: expected two finite numbers in order, found {low} and {high}")
            }
            Self::Signature { expected, positive, negative } => write!(
                f,
                "expected a signature of {expected} eigenvalues, found {positive} positive and {negative} negative ones"
            ),
            Self::Condition(found) => write!(f, "expected a condition number of at least 1, found {found}"),
            Self::Coordinates(found) => write!(f, "expected at most {MOST_COORDINATES} coordinates, found {found}"),
            Self::NoLagrangian => f.write_str("the system has no Lagrangian that can be evaluated"),
            Self::Timed => write!(f, "{}", crate::lagrangian::MechanicsError::Timed),
        }
    }
}

impl std::error::Error for CertificateError {}

impl Certificate {
    /// Proves in which parts of a region the mass matrix of a Lagrangian has its signature.
    ///
    /// `parameters` are those of the Lagrangian; a parameter that no `f64` equals is enclosed.
    ///
    /// # Errors
    /// [`CertificateError`] for a region, a signature or a condition number that does not fit.
    pub fn of<L: Lagrangian, S: Scalar>(
        lagrangian: &L,
        parameters: &[S],
        region: &Bounds,
        options: &CertificateOptions<'_>,
    ) -> Result<Self, CertificateError> {
        let bounds = checked(lagrangian.coordinates(), region, options)?;
        Ok(certificate(&Source::new(lagrangian, parameters), vec![(bounds, 1.0)], options))
    }

    /// As [`Certificate::of`], for a system from the catalogue or from its description.
    ///
    /// # Errors
    /// Those of [`Certificate::of`], [`CertificateError::NoLagrangian`] and [`CertificateError::Timed`].
    pub fn of_system<S: Scalar>(
        configured: &SystemInstance<S>,
        region: &Bounds,
        options: &CertificateOptions<'_>,
    ) -> Result<Self, CertificateError> {
        struct Certify<'a, S>(&'a [S], &'a Bounds, &'a CertificateOptions<'a>);
        impl<S: Scalar> LagrangianVisitor for Certify<'_, S> {
            type Output = Result<Certificate, CertificateError>;
            fn visit<L: Lagrangian>(self, lagrangian: &L) -> Self::Output {
                Certificate::of(lagrangian, self.0, self.1, self.2)
            }
        }
        if configured.is_timed() {
            return Err(CertificateError::Timed);
        }
        configured
            .visit(Certify(&configured.parameters, region, options))
            .unwrap_or(Err(CertificateError::NoLagrangian))
    }
}

/// The bounds of positions, then of velocities, if region and options fit the number of coordinates.
fn checked(n: usize, region: &Bounds, options: &CertificateOptions<'_>) -> Result<Vec<(f64, f64)>, CertificateError> {
    if n > MOST_COORDINATES {
        return Err(CertificateError::Coordinates(n));
    }
    for (names, name, bounds) in
        [("coordinates", "coordinate", &region.positions), ("velocities", "velocity", &region.velocities)]
    {
        if bounds.len() != n {
            return Err(CertificateError::Shape { what: names, expected: n, found: bounds.len() });
        }
        let right = |(low, high): (f64, f64)| low <= high && [low, high, high - low].iter().all(|x| x.is_finite());
        if let Some(index) = bounds.iter().position(|b| !right(*b)) {
            let (low, high) = bounds[index];
            return Err(CertificateError::Bounds { what: name, index, low, high });
        }
    }
    let Signature { positive, negative } = options.signature;
    if positive + negative != n {
        return Err(CertificateError::Signature { expected: n, positive, negative });
    }
    match options.condition {
        Some(limit) if limit.is_nan() || limit < 1.0 => Err(CertificateError::Condition(limit)),
        _ => Ok([region.positions.as_slice(), &region.velocities].concat()),
    }
}

/// Searches regions, given with their shares.
fn certificate(
    source: &dyn Enclose,
    regions: Vec<(Vec<(f64, f64)>, f64)>,
    options: &CertificateOptions<'_>,
) -> Certificate {
    let start = Instant::now();
    let roots = regions.iter().map(|(bounds, _)| bounds.clone()).collect();
    let found = search(source, regions, options);
    Certificate {
        signature: options.signature,
        limit: options.condition,
        certified: found.certified,
        refuted: found.refuted,
        // Shares of halvings are exact in binary; of cut turns they are rounded.
        open: (1.0 - found.certified - found.refuted).max(0.0),
        boxes: found.boxes,
        witness: found.witness,
        condition: (found.condition > 0.0).then_some(found.condition),
        by_construction: false,
        seconds: start.elapsed().as_secs_f64(),
        regions: roots,
        tree: found.tree,
        wrapped: vec![false; source.coordinates()],
    }
}

#[cfg(test)]
mod interval_tests;
#[cfg(test)]
mod tests;
