//! Every number that sets the target of a reading, limits the work or sets a method of relativity.

// ---- Targets of the readings of a learned hole: relative errors ----

/// The metric, in the median and for 99 % of the points.
pub(super) const METRIC_TARGETS: [f64; 2] = [2e-4, 3e-3];
/// The innermost stable orbit, without and with a spin.
pub(super) const STABLE_ORBIT_TARGETS: [f64; 2] = [1e-3, 3e-3];
/// The orbit of light and its impact parameter, without and with a spin.
pub(super) const LIGHT_ORBIT_TARGETS: [f64; 2] = [5e-4, 1e-3];
/// The horizon, the ergosurface, the dragging of frames and the parameters of the family.
pub(super) const HORIZON_TARGET: f64 = 5e-3;
/// The advance of a periastron.
pub(super) const ADVANCE_TARGET: f64 = 2e-3;
/// The proper time of a fall.
pub(super) const INFALL_TARGET: f64 = 1e-3;
/// The drift of conserved quantities along an orbit.
pub(super) const DRIFT_TARGET: f64 = 1e-4;
/// The Ricci tensor over the Riemann tensor of a vacuum.
pub(super) const RICCI_TARGET: f64 = 1e-2;
/// Kretschmann's scalar.
pub(super) const KRETSCHMANN_TARGET: f64 = 2e-2;

// ---- Properties of a metric ----

/// Share of an acceleration up to which an influence may be an error of a learned metric.
pub(super) const LEAST_INFLUENCE: f64 = 0.05;
/// Points at which influences are examined.
pub(super) const INFLUENCE_POINTS: usize = 128;
/// Later and earlier times at which a metric is compared, as shares of the relevant span.
pub(super) const COMPARED_TIMES: [f64; 3] = [0.31, -0.57, 1.0];
/// Difference of components at two times, relative to the largest of them, up to which it is rounding.
pub(super) const TIME_ROUNDING: f64 = 1e-9;
/// Time span of rays that is examined, in distances of the camera.
pub(super) const EXAMINED_SPAN: f64 = 10.0;
/// Largest relative deviation of the area radius of distant spheres from that of flat space; the area itself deviates by twice as much.
pub(super) const MOST_AREA_DEVIATION: f64 = 0.1;
/// Distance of the sky of an exact metric, relative to that of the camera: light is hardly deflected beyond.
pub(super) const SKY_OF_EXACT: f64 = 100.0;
/// The same distance for a learned metric, which was trained only up to there.
pub(super) const SKY_OF_LEARNED: f64 = 2.0;
/// Places on either side at which a metric with two sides is examined, each half as far out as the one before.
pub(super) const EXAMINED_PLACES: i32 = 40;
/// Smallest sine of the angle from the axis, where the angle about it is not determined: a state closer to the axis is turned away to this
/// angle, and its acceleration is turned back.
pub(super) const LEAST_AXIS_SINE: f64 = 1e-6;

// ---- Motion of matter ----

/// Local error of the motions that are followed.
pub(super) const MOTION_TOLERANCE: f64 = 1e-11;
/// Largest number of steps of a motion: many times what an orbit takes.
pub(super) const MOTION_STEPS: usize = 50_000;
/// Largest number of steps of the search between two samples.
pub(super) const CROSSING_STEPS: usize = 60;
/// Value at a crossing, over those at both ends and in units of [`MOTION_TOLERANCE`], at which the search ends.
pub(super) const CROSSING_VALUE: f64 = 1e-3;
/// Eccentricity of the ellipse, and of the whirl.
pub(super) const ECCENTRICITIES: [f64; 2] = [0.5, 0.7];
/// Semilatus rectum of the ellipse over the mass.
pub(super) const ELLIPSE_RECTUM: f64 = 12.0;
/// Halvings of the search for the last orbit that comes back.
pub(super) const WHIRL_HALVINGS: usize = 24;
/// Relative excess of the whirl over the semilatus rectum of that orbit.
pub(super) const WHIRL_EXCESS: f64 = 3e-3;
/// Fraction of the apastron radius that an orbit must reach to count as having returned.
pub(super) const REACHED_APASTRON: f64 = 0.99;
/// Angular velocity of a plunge over that of the circular orbit.
pub(super) const PLUNGE_VELOCITY: f64 = 0.6;

// ---- Rays ----

/// Least and largest tolerance of a step.
pub const TOLERANCES: (f64, f64) = (1e-12, 0.01);
/// Blocks that rays are divided into, whatever the number of threads.
pub(super) const RAY_BLOCKS: usize = 8;
/// Bounds of the size of a block: one call of a model is for that many rays.
pub(super) const BLOCK_SIZES: (usize, usize) = (32, 1024);
/// First step over the distance from the centre.
pub(super) const FIRST_RAY_STEP: f64 = 0.2;
/// Longest step over the distance from the centre.
pub(super) const LONGEST_RAY_STEP: f64 = 1.0;
/// Shortest step over the distance from the centre.
pub(super) const SHORTEST_RAY_STEP: f64 = 1e-12;
/// Safety factor of a step, and the bounds of its change.
pub(super) const STEP_SAFETY: f64 = 0.9;
pub(super) const STEP_CHANGES: (f64, f64) = (0.2, 5.0);
/// Distance beyond the sky to which a step may lead, over that of the sky.
pub(super) const BEYOND_SKY: f64 = 1e-3;
/// Approximate memory per pixel and metric while a picture is computed: two copies of its ray, and its colours.
pub(super) const PIXEL_BYTES: u64 = 112;
/// Halvings of the angle from 0 to pi that find the edge of a shadow.
pub(super) const EDGE_HALVINGS: usize = 30;
/// Tolerance of a step for the edge, over that for a picture.
pub(super) const EDGE_TOLERANCE: f64 = 0.01;

// ---- Readings ----

/// Ricci tensor over Riemann tensor of an exact metric up to which it is a vacuum.
pub(super) const VACUUM: f64 = 1e-6;
/// Angular velocity of the dragging of frames, times the mass, up to which there is no spin.
pub(super) const NO_SPIN: f64 = 1e-12;
/// Points of the deviation of the metric; the parameters are fitted at an eighth of them.
pub(super) const METRIC_POINTS: usize = 4000;
/// Distance at which the mass is read, where only its attraction remains.
pub(super) const MASS_DISTANCE: f64 = 1e6;
/// Semilatus rectum over mass, and eccentricity, of bound orbits.
pub(super) const BOUND_ORBITS: [(f64, f64); 8] =
    [(8.0, 0.2), (8.0, 0.5), (15.0, 0.2), (15.0, 0.5), (30.0, 0.2), (30.0, 0.5), (50.0, 0.2), (50.0, 0.5)];
/// Samples of a radial period.
pub(super) const PERIOD_SAMPLES: f64 = 400.0;
/// Values from which the parameters are fitted, over the true ones: far off.
pub(super) const FIRST_PARAMETERS: f64 = 0.6;
/// Largest number of Levenberg-Marquardt steps.
pub(super) const PARAMETER_STEPS: usize = 60;
/// Relative change of a parameter for difference quotients; the result does not depend on it.
pub(super) const PARAMETER_DIFFERENCE: f64 = 1e-5;
/// Relative change of all parameters that ends a fit.
pub(super) const LAST_PARAMETER_STEP: f64 = 1e-12;
/// First damping of a fit, and the damping that ends it.
pub(super) const FIRST_DAMPING: f64 = 1e-3;
pub(super) const MOST_DAMPING: f64 = 1e12;
