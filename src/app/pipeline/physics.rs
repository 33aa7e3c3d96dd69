//! Physics of a model: its functions, metric, curvature, symmetries, charges and signature, compared with those of the system that it
//! learned. Work is limited by counts instead of time, so that every run gives the same results.

use crate::analysis::{
    MassMatrixError, MetricComponent, Spread, curvature_grid, curvature_scalars, is_metric, matrices_at_rest,
    metric_components,
};
use crate::certificate::{Certificate, CertificateOptions, Signature};
use crate::geometry::MOST_COORDINATES;
use crate::lagrangian::system::Bounds;
use crate::lagrangian::{EulerLagrange, SystemInstance};
use crate::names::number;
use crate::network::{NetworkLagrangian, Structure};
use crate::pipeline::PipelineError;
use crate::pipeline::determination::Determined;
use crate::pipeline::equivalence::{Equivalence, gauge_functions};
use crate::pipeline::learned_functions::{Pair, Picturing};
use crate::pipeline::thresholds::{
    CERTIFICATE_BOXES, CERTIFICATE_WORK, CURVATURE_POINTS, CURVATURE_WORK, LEAST_MAP_POINTS, METRIC_POINTS,
    METRIC_WORK, MOST_MAPS, PHYSICS_SEED,
};
use crate::recording::Recording;
use crate::report::Figure;
use crate::rollout::{Domain, Trajectory};
use crate::symmetry::{
    ChargeDrift, Chart, Degrees, Region, Symmetries, bases, drifts, enough, middle, most_symmetries, unknowns,
};
use serde::Serialize;
use std::collections::BTreeMap;

/// Curvature scalar of the learned metric at rest, multiplied by the free factor of the Lagrangian.
#[derive(Clone, Debug, Serialize)]
pub struct CurvatureScalar {
    /// Factor that brings the learned metric closest to the exact one; 1 if the exact one is unknown.
    pub factor: f64,
    /// Curvature of the model, including the factor.
    pub learned: Spread,
    /// Curvature of the system, if it is known.
    pub exact: Option<Spread>,
}

/// Point symmetries that were found.
#[derive(Clone, Debug, Serialize)]
pub struct FoundSymmetries {
    /// Number of symmetries; `None` if there is no gap between singular values.
    pub count: Option<usize>,
    /// Ratio of the smallest singular value that is not zero to the largest that is.
    pub gap: Option<f64>,
    /// Name of the algebra, if it has a usual one.
    pub name: Option<String>,
    /// Formulas of the fields.
    pub fields: Vec<String>,
    /// Degrees of the functions in which they were found, such as `polynomial:1,trigonometric:2,hyperbolic:0`.
    pub basis: String,
}

impl FoundSymmetries {
    fn new(found: &Symmetries, degrees: Degrees) -> Self {
        Self {
            count: found.separation.count,
            gap: found.separation.gap,
            name: found.algebra.as_ref().and_then(|algebra| algebra.name.clone()),
            fields: found.fields.iter().map(|field| field.text(&found.basis)).collect(),
            basis: degrees.to_string(),
        }
    }
}

/// Shares of the region in which the mass matrix is proven to have a signature, or proven not to have it.
#[derive(Clone, Debug, Serialize)]
pub struct ProvenSignature {
    /// Number of positive eigenvalues to prove.
    pub positive: usize,
    /// Number of negative eigenvalues.
    pub negative: usize,
    /// `true` if the structure of the model guarantees the signature at every state.
    pub by_construction: bool,
    /// Share of the region in which the signature is proven.
    pub certified: f64,
    /// Share of the region in which the signature is refuted.
    pub refuted: f64,
    /// Share of the region that remains undecided with this number of boxes.
    pub open: f64,
    /// Boxes that were evaluated.
    pub boxes: usize,
}

/// Physics of a model over a region of states.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Physics {
    /// Bounds of the states that were examined, by column.
    pub region: BTreeMap<String, [f64; 2]>,
    /// Best factor and gauge term relative to the exact Lagrangian, if the system is known, and the remaining differences.
    pub equivalence: Option<Equivalence>,
    /// Components of the metric, for geodesics only.
    pub metric: Vec<MetricComponent>,
    /// Curvature scalar, for geodesics in at least two dimensions.
    pub curvature_scalar: Option<CurvatureScalar>,
    /// Point symmetries of the model.
    pub symmetries: Option<FoundSymmetries>,
    /// Symmetries of the system, if it is known.
    pub exact_symmetries: Option<FoundSymmetries>,
    /// Drifts of the system's charges along the first learned motion, up to the end of its picture; the energy first.
    pub charges: Vec<ChargeDrift>,
    /// End of the time over which the charges were followed.
    pub charges_until: f64,
    /// Certificate of the signature.
    pub signature: Option<ProvenSignature>,
    /// Parts that were left out, with the reasons.
    pub left_out: Vec<String>,
    /// Names of the coordinates.
    #[serde(skip)]
    pub coordinates: Vec<String>,
    /// Pictures.
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

/// A model and the data needed to analyse it.
pub(crate) struct Subject<'a> {
    pub network: &'a NetworkLagrangian<f64>,
    /// States that it was trained on; periodic coordinates are unbounded.
    pub trained: &'a Domain<f64>,
    /// The system it learned, if it is known.
    pub system: Option<&'a SystemInstance<f64>>,
    /// Names of coordinates and velocities, with units as labels of axes.
    pub columns: Vec<String>,
    pub labels: Vec<String>,
    /// The recorded motion that it was trained on, if any, and what this motion determines.
    pub recorded: Option<&'a Recording>,
    pub determined: Option<&'a Determined>,
    /// Learned motion along which charges are followed.
    pub motion: Option<&'a Trajectory<f64>>,
    pub threads: usize,
}

impl Physics {
    /// Analyses a model; `check` is called between the parts, and its error ends the work.
    ///
    /// # Errors
    /// That of `check`; a system that cannot be built.
    pub(crate) fn new(
        subject: &Subject<'_>,
        check: &dyn Fn() -> Result<(), PipelineError>,
    ) -> Result<Self, PipelineError> {
        let mut found = Self::nothing(subject);
        found.find(subject, check)?;
        Ok(found)
    }

    /// Physics of a model under constraints, without the parts that need states off the constraints.
    pub(crate) fn under_constraints(subject: &Subject<'_>) -> Self {
        let problem = "maps of the learned functions, curvature, symmetries, certificate of the signature: the Lagrangian has no \
                       meaning off the constraints";
        Self { left_out: vec![problem.to_string()], ..Self::nothing(subject) }
    }

    /// Creates an empty result.
    pub(crate) fn nothing(subject: &Subject<'_>) -> Self {
        let region = subject.region();
        let ranges = region.position.iter().chain(&region.velocity).copied();
        Self {
            region: subject.columns.iter().cloned().zip(ranges).collect(),
            coordinates: subject.columns[..subject.network.coordinates()].to_vec(),
            ..Self::default()
        }
    }

    /// Computes the parts one by one; parts before an error are complete.
    ///
    /// # Errors
    /// Those of [`Physics::new`].
    pub(crate) fn find(
        &mut self,
        subject: &Subject<'_>,
        check: &dyn Fn() -> Result<(), PipelineError>,
    ) -> Result<(), PipelineError> {
        let (region, exact) = (subject.region(), subject.system.map(SystemInstance::build).transpose()?);
        check()?;
        self.find_equivalence(subject, &region, exact.as_deref());
        check()?;
        self.find_geometry(subject, &region, exact.as_deref());
        check()?;
        self.find_symmetries(subject, &region, exact.as_deref());
        check()?;
        self.find_certificate(subject, &region);
        check()
    }

    fn find_equivalence(&mut self, subject: &Subject<'_>, region: &Region, exact: Option<&dyn EulerLagrange<f64>>) {
        let Some(exact) = exact else { return };
        let (basis, states) = gauge_functions(&self.coordinates, &subject.charts(region));
        let (q, v) = subject.states(region, states);
        match Equivalence::new(subject.network, exact, &basis, (&q, &v)) {
            Ok(found) => self.equivalence = Some(found),
            Err(problem) => self.left_out.push(format!("comparison with the exact Lagrangian: {problem}")),
        }
    }

    /// Computes the functions of the Lagrangian; for geodesics, the metric and its curvature.
    fn find_geometry(&mut self, subject: &Subject<'_>, region: &Region, exact: Option<&dyn EulerLagrange<f64>>) {
        let (network, n) = (subject.network, subject.network.coordinates());
        let (q, v) = subject.states(region, CURVATURE_POINTS.0);
        if q.is_empty() {
            return;
        }
        let form = &network.architecture().form;
        let metric = match exact {
            Some(exact) => is_metric(exact, &q, &v),
            None => form.structure == Structure::Metric && form.known.is_none(),
        };
        let most = (CURVATURE_WORK / (network.weights().len() * n.pow(3)).max(1)).max(1);
        let looked_at = &q[..n * most.min(q.len() / n)];
        let found = self.equivalence.as_ref().and_then(|found| found.factor);
        let mean_mass = || {
            let masses = matrices_at_rest(network, looked_at);
            masses.iter().step_by(n * n).sum::<f64>() * n as f64 / looked_at.len() as f64
        };
        let at_rest = exact.map(|exact| MassMatrixError::of(exact, network, &q));
        let (factor, unit) = match &at_rest {
            // The curvature takes the factor of the whole Lagrangian, which a black box on a mass shell has only at rest.
            Some(at_rest) => (found.filter(|_| metric).unwrap_or(at_rest.factor), String::new()),
            None if metric => (1.0, String::new()),
            None if subject.is_forced() => (1.0, "In SI units, which the known forces fix.".to_string()),
            None => {
                let name = &self.coordinates[0];
                let unit = format!("Over the mean M[{name},{name}]: without known forces L has no unit.");
                (Some(mean_mass().recip()).filter(|factor| factor.is_finite()).unwrap_or(1.0), unit)
            }
        };
        let apart = at_rest.filter(|at_rest| at_rest.groups > 1);
        let factors = apart.map_or_else(|| vec![factor; n], |at_rest| at_rest.factors);
        let unit = if exact.is_some() { taken(&self.coordinates, &factors) } else { unit };
        let components = metric_components(exact, network, looked_at, factor);
        let picturing = self.picturing(subject, region, unit);
        let pair = Pair { learned: network, exact, factor, factors: &factors };
        let points = METRIC_WORK / (network.weights().len() * n).max(1);
        let side = points.isqrt().min(METRIC_POINTS);
        let time = subject.time_like();
        if side < LEAST_MAP_POINTS {
            self.left_out.push("maps of the learned functions: too many weights for pictures in a second".into());
        } else {
            // The Lagrangian at rest of a known system has a map of its own.
            if !metric && time.is_none() && (exact.is_none() || n == 1) {
                self.figures.extend(picturing.potential(pair, side));
            }
            let names = if metric { ("g", "metric") } else { ("M", "mass_matrix") };
            let (maps, more) = picturing.mass_matrix(pair, &components, names, side);
            self.figures.extend(maps);
            if more > 0 {
                let what = if metric { "metric" } else { "mass matrix" };
                self.left_out.push(format!("maps of {more} components of the {what} beyond the first {MOST_MAPS}"));
            }
            if !metric && time.is_none() {
                self.figures.extend(picturing.gyroscopic(pair, (side / 2).max(LEAST_MAP_POINTS)));
            }
            self.figures.extend(picturing.friction(pair, &region.velocity));
        }
        if metric {
            self.metric = components;
            if (2..=MOST_COORDINATES).contains(&n) {
                self.find_curvature(pair, &q, most, &picturing);
            }
        }
    }

    /// Region of the pictures: the recorded motion, or the region of the states. Maps are over the first two coordinates, or the first two
    /// spatial ones if there are two.
    fn picturing<'a>(&self, subject: &Subject<'a>, region: &Region, unit: String) -> Picturing<'a> {
        let n = self.coordinates.len();
        let shown = if n > 2 && subject.time_like() == Some(0) { [1, n - 1] } else { [0, (n - 1).min(1)] };
        let (names, labels) = (self.coordinates.clone(), subject.labels.clone());
        let (ranges, marks, determined) = (region.position.clone(), Vec::new(), subject.determined);
        let of_region = Picturing { names, labels, ranges, shown, marks, unit, determined };
        match subject.recorded {
            Some(recording) => of_region.of_recording(recording),
            None => of_region,
        }
    }

    fn find_curvature(&mut self, pair: Pair<'_>, q: &[f64], most: usize, picturing: &Picturing<'_>) {
        let n = self.coordinates.len();
        let q = &q[..n * most.min(q.len() / n)];
        let Pair { learned, exact, factor, .. } = pair;
        // R of `s g` is `R/s`.
        let scaled = |values: Vec<f64>| values.iter().map(|r| r / factor).collect::<Vec<f64>>();
        self.curvature_scalar = Some(CurvatureScalar {
            factor,
            learned: Spread::of(&scaled(curvature_scalars(learned, q))),
            exact: exact.map(|exact| Spread::of(&curvature_scalars(exact, q))),
        });
        let side = most.saturating_sub(q.len() / n).isqrt().min(CURVATURE_POINTS.1);
        if side < LEAST_MAP_POINTS {
            self.left_out.push("map of the curvature scalar: too many weights for a picture in a second".into());
            return;
        }
        let grid = |model: &dyn EulerLagrange<f64>| curvature_grid(model, &picturing.middle(), picturing.axes(side));
        let texts =
            ["R", "Curvature scalar R of the metric over the coordinates", "curvature_scalar"].map(String::from);
        self.figures.extend(picturing.map(texts, grid(learned).map(|r| r / factor), exact.map(grid), None));
    }

    fn find_symmetries(&mut self, subject: &Subject<'_>, region: &Region, exact: Option<&dyn EulerLagrange<f64>>) {
        let (network, n) = (subject.network, subject.network.coordinates());
        let charts = subject.charts(region);
        let names = self.coordinates.clone();
        let search = |model: &dyn EulerLagrange<f64>, exact: bool| -> Result<(Symmetries, Degrees), String> {
            let bases = bases(&names, &charts, None, exact);
            let functions = bases.iter().map(|(basis, _)| basis.len()).max().unwrap_or(0);
            let (q, v) = subject.states(region, enough(unknowns(n, functions), exact));
            most_symmetries(model, bases, (&q, &v), (None, exact)).map_err(|problem| problem.to_string())
        };
        match search(network, false) {
            Ok((found, degrees)) => self.symmetries = Some(FoundSymmetries::new(&found, degrees)),
            Err(problem) => self.left_out.push(format!("symmetries of the model: {problem}")),
        }
        let Some(exact) = exact else { return };
        match search(exact, true) {
            Ok((found, degrees)) => {
                self.exact_symmetries = Some(FoundSymmetries::new(&found, degrees));
                self.follow_charges(subject, exact, &found);
            }
            Err(problem) => self.left_out.push(format!("symmetries of the system: {problem}")),
        }
    }

    fn follow_charges(&mut self, subject: &Subject<'_>, exact: &dyn EulerLagrange<f64>, found: &Symmetries) {
        let Some(motion) = subject.motion.filter(|motion| motion.len() > 1) else { return };
        if !exact.conserves_energy() {
            self.left_out.push("drift of charges: friction changes them".into());
            return;
        }
        let all = match drifts((exact, subject.network), &found.basis, &found.fields, motion) {
            Ok(all) => all,
            Err(problem) => return self.left_out.push(format!("drift of charges: {problem}")),
        };
        self.charges_until = motion.t.last().copied().unwrap_or(0.0);
        self.charges = found.drifts(&all);
    }

    fn find_certificate(&mut self, subject: &Subject<'_>, region: &Region) {
        let network = subject.network;
        let n = network.coordinates();
        let signature = Signature::of(n, subject.time_like().is_some());
        let boxes = CERTIFICATE_WORK / (network.weights().len() * n.pow(2)).max(1);
        let options = CertificateOptions {
            seconds: f64::INFINITY,
            boxes: boxes.clamp(1, CERTIFICATE_BOXES),
            threads: subject.threads,
            ..CertificateOptions::new(signature)
        };
        let pairs = |ranges: &[[f64; 2]]| ranges.iter().map(|&[low, high]| (low, high)).collect();
        let bounds = Bounds { positions: pairs(&region.position), velocities: pairs(&region.velocity) };
        match Certificate::of_network(network, &bounds, &options) {
            Ok(proven) if proven.certified == 0.0 && proven.refuted == 0.0 => self.left_out.push(format!(
                "certificate of the signature: {} boxes prove nothing of a network of {} weights; `lnn certify` takes more",
                proven.boxes,
                network.weights().len()
            )),
            Ok(proven) => {
                self.signature = Some(ProvenSignature {
                    positive: signature.positive,
                    negative: signature.negative,
                    by_construction: proven.by_construction,
                    certified: proven.certified,
                    refuted: proven.refuted,
                    open: proven.open,
                    boxes: proven.boxes,
                });
            }
            Err(problem) => self.left_out.push(format!("certificate of the signature: {problem}")),
        }
    }
}

/// Describes the factors that multiply a learned Lagrangian for comparison with the exact one, per coordinate.
fn taken(names: &[String], factors: &[f64]) -> String {
    if factors.iter().all(|factor| *factor == factors[0]) {
        return format!("The learned Lagrangian is taken times {}, its best factor.", number(factors[0]));
    }
    let each: Vec<String> = names.iter().zip(factors).map(|(name, s)| format!("{} ({name})", number(*s))).collect();
    format!("Coordinates that do not act on each other are taken times their best factors, {}.", each.join(", "))
}

impl Subject<'_> {
    fn time_like(&self) -> Option<usize> {
        self.system.and_then(|system| system.system.time_like).or(self.network.architecture().time_like)
    }

    /// `true` if known forces drove the motion, which fixes the unit of `L`.
    fn is_forced(&self) -> bool {
        self.recorded.is_some_and(|recording| recording.tracks.iter().any(|track| !track.force.is_empty()))
    }

    /// Central part of the states that the model was trained on; for a known system, limited to the states on which errors are reported;
    /// angles cover a full turn.
    fn region(&self) -> Region {
        let n = self.network.coordinates();
        let stated = self.system.map(|system| {
            let bounds = system.system.validation(n);
            [bounds.positions, bounds.velocities].concat()
        });
        let periodic = &self.network.architecture().periodic;
        let range = |(k, trained): (usize, &Option<(f64, f64)>)| {
            let stated = stated.as_ref().map(|stated| stated[k]);
            let (low, high) = match (*trained, stated) {
                (Some(a), Some(b)) if a.0.max(b.0) < a.1.min(b.1) => (a.0.max(b.0), a.1.min(b.1)),
                (Some(a), _) => a,
                (None, Some(b)) => b,
                (None, None) => (0.0, std::f64::consts::TAU),
            };
            if k < n && periodic[k] { [low, high] } else { middle([low, high]) }
        };
        let mut all: Vec<[f64; 2]> = self.trained.bounds().iter().enumerate().map(range).collect();
        let velocity = all.split_off(n);
        Region { position: all, velocity }
    }

    /// Samples states `(states, n)` of the region, on the mass shell and inside the domain of the system.
    fn states(&self, region: &Region, states: usize) -> (Vec<f64>, Vec<f64>) {
        let inside = |q: &[f64], v: &mut [f64]| {
            let fits =
                |system: &SystemInstance<f64>| system.check_domain(q).is_ok() && system.impose_constraint(q, v).is_ok();
            self.system.is_none_or(fits)
        };
        region.states(states, PHYSICS_SEED, inside)
    }

    fn charts(&self, region: &Region) -> Vec<Chart> {
        let units = self.system.map(|system| system.system.units(system.coordinates));
        let unit = |i: usize| units.as_ref().map_or("", |units| units[i].as_str());
        let periodic = self.network.architecture().periodic.iter().zip(&region.position).enumerate();
        periodic.map(|(i, (periodic, range))| Chart::of(*periodic, unit(i), *range)).collect()
    }
}
