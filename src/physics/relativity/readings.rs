//! Quantities read off a learned metric of a hole, next to those of the exact one: among them the parameters of the closest metric of the
//! family, and the drift of quantities that the exact motion conserves.

use super::coordinates::Spheroidal;
use super::orbits::{infall, passing, radial_period};
use super::thresholds::{
    ADVANCE_TARGET, BOUND_ORBITS, DRIFT_TARGET, FIRST_DAMPING, FIRST_PARAMETERS, HORIZON_TARGET, INFALL_TARGET,
    KRETSCHMANN_TARGET, LAST_PARAMETER_STEP, LIGHT_ORBIT_TARGETS, MASS_DISTANCE, METRIC_POINTS, METRIC_TARGETS,
    MOST_DAMPING, NO_SPIN, PARAMETER_DIFFERENCE, PARAMETER_STEPS, PERIOD_SAMPLES, RICCI_TARGET, STABLE_ORBIT_TARGETS,
    VACUUM,
};
use super::{CentralCoordinates, Chart};
use crate::analysis::{MassMatrixError, conserved_change, matrices_at_rest, nearest_factor};
use crate::geometry::{CircularOrbit, Geometry, GeometryError, Sense};
use crate::lagrangian::{EulerLagrange, SystemInstance};
use crate::linalg::{Workspace, solve};
use crate::symmetry::{self, Basis, Degrees, Quadratic, Region, Symmetries};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// A quantity read off a learned metric.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// Its name, with the unit of length `M`.
    pub quantity: String,
    /// Value of the exact metric, if the quantity is not an error itself.
    pub exact: Option<f64>,
    /// Value for the learned metric; none if the metric has no such quantity.
    pub learned: Option<f64>,
    /// Error, relative where there is an exact value; none without a learned one.
    pub error: Option<f64>,
    /// Target error.
    pub aim: f64,
}

/// A system and a metric that learned it.
#[derive(Clone, Copy)]
pub struct LearnedHole<'a> {
    /// The exact one.
    pub exact: &'a dyn EulerLagrange<f64>,
    /// The learned one, up to a factor.
    pub learned: &'a dyn EulerLagrange<f64>,
    /// The system of the exact one.
    pub system: &'a SystemInstance<f64>,
    /// The coordinates of both.
    pub around: CentralCoordinates,
    /// Distances that were learned.
    pub range: (f64, f64),
}

impl LearnedHole<'_> {
    fn reading(quantity: impl Into<String>, exact: Option<f64>, learned: Option<f64>, aim: f64) -> Option<Reading> {
        let exact = exact?;
        let error = learned.map(|learned| (learned / exact - 1.0).abs());
        Some(Reading { quantity: quantity.into(), exact: Some(exact), learned, error, aim })
    }

    /// A quantity that is an error.
    fn error(quantity: impl Into<String>, error: Option<f64>, aim: f64) -> Reading {
        Reading { quantity: quantity.into(), exact: None, learned: None, error, aim }
    }

    /// A quantity of both metrics; the learned value is none where it does not exist.
    fn both<T>(
        &self,
        of: impl Fn(&dyn EulerLagrange<f64>) -> Result<T, GeometryError>,
    ) -> Result<(T, Option<T>), GeometryError> {
        Ok((of(self.exact)?, of(self.learned).ok()))
    }

    /// Mass of the exact metric by its attraction from afar.
    ///
    /// # Errors
    /// Those of the exact metric.
    pub fn mass(&self) -> Result<f64, GeometryError> {
        let origin = self.around.origin();
        let metric = self.around.equator(self.exact, &origin).at(MASS_DISTANCE)?;
        Ok(-0.5 * metric.first[0] * MASS_DISTANCE * MASS_DISTANCE)
    }

    /// All quantities that the metrics have, with lengths in units of the mass.
    ///
    /// # Errors
    /// Those of the exact metric; where the learned one refuses, the reading has no value.
    pub fn readings(&self) -> Result<Vec<Reading>, GeometryError> {
        let mass = self.mass()?;
        let mut all = Vec::new();
        let factor = self.metric(mass, &mut all);
        self.equator(mass, &mut all)?;
        self.periastra(mass, &mut all)?;
        self.fall(mass, &mut all);
        self.parameters(mass, &mut all);
        self.curvature(mass, factor, &mut all)?;
        self.symmetries(mass, &mut all);
        Ok(all)
    }

    /// Distances in units of the mass, within the learned range.
    fn within(&self, mass: f64, (low, high): (f64, f64)) -> (f64, f64) {
        ((low * mass).max(self.range.0), (high * mass).min(self.range.1))
    }

    /// The error of the metric, and the factor that brings the learned one closest.
    fn metric(&self, mass: f64, all: &mut Vec<Reading>) -> f64 {
        let points = self.around.points(METRIC_POINTS, self.within(mass, (1.5, 20.0)));
        let found = MassMatrixError::of(self.exact, self.learned, &points);
        let error = Some(found.error).filter(|error| error.failed == 0);
        all.push(Self::error("metric, R from 1.5 to 20 M, median", error.map(|error| error.median), METRIC_TARGETS[0]));
        all.push(Self::error("metric, R from 1.5 to 20 M, 99 %", error.map(|error| error.p99), METRIC_TARGETS[1]));
        found.factor
    }

    fn equator(&self, mass: f64, all: &mut Vec<Reading>) -> Result<(), GeometryError> {
        let origin = self.around.origin();
        let range = self.within(mass, (1.3, 20.0));
        let dragging =
            |model: &dyn EulerLagrange<f64>| Ok(self.around.equator(model, &origin).at(4.0 * mass)?.dragging());
        let (turns, learned_turns) = self.both(dragging)?;
        let senses = self.senses(mass)?;
        let spins = senses.len() > 1;
        let radius = |orbit: Option<CircularOrbit<f64>>| orbit.map(|orbit| orbit.radius / mass);
        let impact = |orbit: Option<CircularOrbit<f64>>| orbit.map(|orbit| orbit.impact_parameter() / mass);
        let [stable_aim, light_aim] =
            [STABLE_ORBIT_TARGETS, LIGHT_ORBIT_TARGETS].map(|targets| targets[usize::from(spins)]);
        for &(sense, suffix) in senses {
            let stable = |model: &dyn EulerLagrange<f64>| {
                self.around.equator(model, &origin).innermost_stable(range, sense).map(radius)
            };
            let (exact, learned) = self.both(stable)?;
            let name = format!("innermost stable orbit{suffix} [M]");
            all.extend(Self::reading(name, exact, learned.flatten(), stable_aim));
            let light = |model: &dyn EulerLagrange<f64>| self.around.equator(model, &origin).light(range, sense);
            let (exact, learned) = self.both(light)?;
            let learned = learned.flatten();
            let name = format!("orbit of light{suffix} [M]");
            all.extend(Self::reading(name, radius(exact), radius(learned), light_aim));
            let name = format!("critical impact parameter{suffix} [M]");
            all.extend(Self::reading(name, impact(exact), impact(learned), light_aim));
        }
        let through = self.within(mass, (1.25, 20.0));
        let (exact, learned) = self.both(|model| self.around.equator(model, &origin).horizon(through))?;
        let scaled = |radius: Option<f64>| radius.map(|radius| radius / mass);
        all.extend(Self::reading("horizon [M]", scaled(exact), scaled(learned.flatten()), HORIZON_TARGET));
        if spins {
            let (exact, learned) = self.both(|model| self.around.equator(model, &origin).ergosurface(through))?;
            all.extend(Self::reading("ergosurface [M]", scaled(exact), scaled(learned.flatten()), HORIZON_TARGET));
            let learned = learned_turns.map(|turns| turns * mass);
            all.extend(Self::reading("frame dragging at 4 M [1/M]", Some(turns * mass), learned, HORIZON_TARGET));
        }
        Ok(())
    }

    /// Senses of motion in the equator that differ, and their names: one without a spin.
    fn senses(&self, mass: f64) -> Result<&'static [(Sense, &'static str)], GeometryError> {
        let origin = self.around.origin();
        let turns = self.around.equator(self.exact, &origin).at(4.0 * mass)?.dragging();
        let spins = turns.abs() > NO_SPIN / mass;
        Ok(if spins {
            &[(Sense::Forward, ", forward"), (Sense::Backward, ", backward")]
        } else {
            &[(Sense::Forward, "")]
        })
    }

    fn periastra(&self, mass: f64, all: &mut Vec<Reading>) -> Result<(), GeometryError> {
        let origin = self.around.origin();
        let exact = self.around.equator(self.exact, &origin);
        for &(sense, suffix) in self.senses(mass)? {
            for (p, e) in BOUND_ORBITS {
                let (near, far) = (p / (1.0 + e) * mass, p / (1.0 - e) * mass);
                if near < self.range.0 {
                    continue;
                }
                let Some(turning) = exact.between(near, far, sense)? else { continue };
                let [q, v] = self.around.turning(near, &turning);
                let kepler = TAU * (0.5 * (near + far)).powf(1.5) / mass.sqrt();
                let advance = |model: &dyn EulerLagrange<f64>| {
                    let found = radial_period(model, (&q, &v), self.around, (4.0 * kepler, kepler / PERIOD_SAMPLES))?;
                    Some(found.advance)
                };
                // Orbits that fall in or turn elsewhere do not lie between the two.
                let Some(truth) = advance(self.exact).filter(|advance| *advance > 0.0) else { continue };
                let name = format!("periastron advance, p = {p} M, e = {e}{suffix} [rad]");
                all.extend(Self::reading(name, Some(truth), advance(self.learned), ADVANCE_TARGET));
            }
        }
        Ok(())
    }

    fn fall(&self, mass: f64, all: &mut Vec<Reading>) {
        if self.range.0 > 1.5 * mass {
            return;
        }
        let direction = [0.48, 0.6, 0.64];
        let (q, mut v) = (self.around.place(10.0 * mass, direction), [0.0; 4]);
        let n = self.exact.coordinates();
        let (time, metric) = (self.around.time(), matrices_at_rest(self.exact, &q));
        v[time] = (-metric[time * n + time]).sqrt().recip();
        let fall = |model| infall(model, (&q, &v), (self.around, 1.5 * mass), (200.0 * mass, 0.25 * mass));
        let (truth, learned) = (fall(self.exact), fall(self.learned));
        let kept = learned.filter(|fall| fall.keeps_signature).map(|fall| fall.time / mass);
        let name = "infall from rest at 10 M to 1.5 M, signature kept: proper time [M]";
        all.extend(Self::reading(name, truth.map(|fall| fall.time / mass), kept, INFALL_TARGET));
        // An inclined bound orbit, between 10 and 14 M without a spin: far from whirling orbits, which multiply every error.
        let (q, mut v) = (self.around.place(10.0 * mass, [1.0, 0.0, 0.0]), [0.0; 4]);
        if let CentralCoordinates::Cartesian(Chart { space: [_, y, z], .. }) = self.around {
            (v[y], v[z]) = (0.28, 0.28);
            if self.system.impose_constraint(&q, &mut v).is_ok() {
                let drift = conserved_drift(self.system, self.learned, (&q, &v), (1000.0 * mass, mass));
                all.push(Self::error(
                    "conserved quantities along an inclined orbit, drift until 1000 M",
                    drift,
                    DRIFT_TARGET,
                ));
            }
        }
    }

    fn parameters(&self, mass: f64, all: &mut Vec<Reading>) {
        let points = self.around.points(METRIC_POINTS / 8, self.within(mass, (1.5, 20.0)));
        let symbols = self.system.system.parameters.iter().map(|p| p.symbol.to_string());
        let exact: Vec<(String, f64)> = symbols.zip(self.system.parameters.iter().copied()).collect();
        // From values far from the true ones.
        let start = exact.iter().map(|(symbol, value)| (symbol.clone(), FIRST_PARAMETERS * value)).collect();
        let found = nearest_parameters(self.system, self.learned, &points, &start);
        for (symbol, value) in exact.into_iter().filter(|(_, value)| *value != 0.0) {
            let learned = found.as_ref().and_then(|found| found.get(&symbol).copied());
            all.extend(Self::reading(format!("parameter {symbol}"), Some(value), learned, HORIZON_TARGET));
        }
    }

    fn curvature(&self, mass: f64, factor: f64, all: &mut Vec<Reading>) -> Result<(), GeometryError> {
        let size = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        for distance in [3.0, 6.0, 10.0] {
            let points = self.around.points(12, (distance * mass, distance * mass));
            let rest = [0.0; 4];
            let of = |model| Geometry::of(model, &points, &rest)?.into_iter().collect::<Result<Vec<_>, _>>();
            let (exact, learned) = (of(self.exact)?, of(self.learned).ok());
            let largest = |errors: &mut dyn Iterator<Item = f64>| errors.fold(0.0, f64::max);
            let vacuum =
                exact.iter().all(|point| size(&point.curvature.ricci) < VACUUM * size(&point.curvature.riemann));
            if vacuum {
                let share = learned.as_ref().map(|learned| {
                    largest(&mut learned.iter().map(|p| size(&p.curvature.ricci) / size(&p.curvature.riemann)))
                });
                all.push(Self::error(format!("Ricci over Riemann at {distance} M, largest"), share, RICCI_TARGET));
            }
            // Around a spin it passes through zero.
            let size = largest(&mut exact.iter().map(|point| point.curvature.kretschmann.abs()));
            let error = learned.as_ref().map(|learned| {
                largest(&mut learned.iter().zip(&exact).map(|(learned, exact)| {
                    (learned.curvature.kretschmann / (factor * factor) - exact.curvature.kretschmann).abs() / size
                }))
            });
            all.push(Self::error(
                format!("Kretschmann's scalar at {distance} M over its largest, largest error"),
                error,
                KRETSCHMANN_TARGET,
            ));
        }
        Ok(())
    }

    /// Numbers of conserved quantities of second degree in the momenta beyond the energy and products of charges, among functions of the
    /// polar angle of spheroidal coordinates: Carter's constant, around a spin.
    fn carter(&self, mass: f64, all: &mut Vec<Reading>) {
        let CentralCoordinates::Cartesian(Chart { time, space }) = self.around else { return };
        let symbol = self.system.system.parameters.iter().position(|p| p.symbol == "a");
        let Some(&spin) = symbol.and_then(|i| self.system.parameters.get(i)).filter(|spin| **spin != 0.0) else {
            return;
        };
        let names = ["t", "r", "theta", "phi"].map(String::from);
        let charts = [symmetry::Chart::Line, symmetry::Chart::Line, symmetry::Chart::Polar, symmetry::Chart::Line];
        let basis = Basis::new(&names, &charts, Degrees { polynomial: 0, trigonometric: 2, hyperbolic: 0 });
        let (low, high) = self.within(mass, (2.5, 12.0));
        let region = Region {
            position: vec![[0.0, 1.0], [low, high], [0.5, 2.6], [0.0, TAU]],
            velocity: vec![[1.0, 2.0], [-0.5, 0.5], [-0.1, 0.1], [-0.1, 0.1]],
        };
        let (q, v) = region.states(1000, 0, |_, _| true);
        let count = |model, tolerance| {
            let model = Spheroidal { model, spin, time, space };
            let found = Symmetries::find(&model, &basis, (&q, &v), tolerance).ok()?;
            let found = Quadratic::find(&model, &basis, &found.fields, (&q, &v), tolerance).ok()?;
            found.separation.count.map(|_| found.conserved.len() as f64)
        };
        let (exact, learned) = (count(self.exact, Some(Symmetries::EXACT)), count(self.learned, None));
        all.extend(Self::reading("quadratic charges beyond products: Carter's", exact, learned, 0.0));
    }

    /// Numbers of point symmetries of both, among fields linear in the coordinates or in sines and cosines of angles.
    fn symmetries(&self, mass: f64, all: &mut Vec<Reading>) {
        let coordinates = self.system.system.coordinates(4);
        let names: Vec<String> = coordinates.iter().map(|c| c.name.to_string()).collect();
        let (charts, degrees) = match self.around {
            CentralCoordinates::Cartesian(_) => {
                (vec![symmetry::Chart::Line; 4], Degrees { polynomial: 1, trigonometric: 0, hyperbolic: 0 })
            }
            CentralCoordinates::Spherical { polar, azimuth, .. } => {
                let mut charts = vec![symmetry::Chart::Line; 4];
                (charts[polar], charts[azimuth]) = (symmetry::Chart::Polar, symmetry::Chart::Circle);
                let usual = Degrees::usual(&charts);
                (charts, Degrees { polynomial: 0, ..usual })
            }
        };
        let basis = Basis::new(&names, &charts, degrees);
        let (low, high) = self.within(mass, (2.5, 12.0));
        let points = self.around.points(1000, (low, high));
        let region = Region { position: vec![[0.0, 1.0]; 4], velocity: vec![[-0.5, 0.5]; 4] };
        let (_, mut v) = region.states(points.len() / 4, 0, |_, _| true);
        v.chunks_exact_mut(4).for_each(|v| v[self.around.time()] += 1.5);
        let count = |model, tolerance| {
            let found = Symmetries::find(model, &basis, (&points, &v), tolerance).ok()?;
            Some(found.separation.count? as f64)
        };
        let (exact, learned) = (count(self.exact, Some(Symmetries::EXACT)), count(self.learned, None));
        all.extend(Self::reading("point symmetries", exact, learned, 0.0));
        self.carter(mass, all);
    }
}

/// Values by symbol.
type Values = BTreeMap<String, f64>;

/// Residuals of the metric of a system with these parameters against a learned one, each point relative to the size of its metric, after
/// the best factor; `None` if no such system exists.
fn residuals(system: &SystemInstance<f64>, values: &Values, learned: &[f64], points: &[f64]) -> Option<Vec<f64>> {
    let model = SystemInstance::<f64>::with_values(system.system.clone(), values).ok()?.build().ok()?;
    let n = model.coordinates();
    let exact = matrices_at_rest(model.as_ref(), points);
    let factor = nearest_factor(n * n, &exact, learned);
    let pairs = exact.chunks_exact(n * n).zip(learned.chunks_exact(n * n));
    let all: Vec<f64> = pairs
        .flat_map(|(g, h)| {
            let size = g.iter().map(|x| x * x).sum::<f64>().sqrt();
            g.iter().zip(h).map(move |(a, b)| (factor * b - a) / size)
        })
        .collect();
    all.iter().all(|x| x.is_finite()).then_some(all)
}

fn square(residuals: &[f64]) -> f64 {
    residuals.iter().map(|r| r * r).sum()
}

/// The values of the parameters of `system`, by symbol, for which its metric comes nearest to that of `learned` up to a factor at `points`,
/// `(points, n)`: least squares by the method of Levenberg and Marquardt from `start`;
/// `None` where one of the two metrics is not finite.
pub fn nearest_parameters(
    system: &SystemInstance<f64>,
    learned: &dyn EulerLagrange<f64>,
    points: &[f64],
    start: &Values,
) -> Option<Values> {
    let learned = matrices_at_rest(learned, points);
    let of = |values: &Values| residuals(system, values, &learned, points);
    let (mut values, symbols) = (start.clone(), start.keys().cloned().collect::<Vec<_>>());
    let (mut now, count) = (of(&values)?, symbols.len());
    let (mut damping, mut workspace) = (FIRST_DAMPING, Workspace::default());
    for _ in 0..PARAMETER_STEPS {
        let mut columns = Vec::with_capacity(count);
        for symbol in &symbols {
            let step = PARAMETER_DIFFERENCE * (1.0 + values[symbol].abs());
            let shifted = |by: f64| {
                let mut values = values.clone();
                values.entry(symbol.clone()).and_modify(|x| *x += by);
                of(&values)
            };
            let (more, less) = (shifted(step)?, shifted(-step)?);
            columns.push(more.iter().zip(&less).map(|(a, b)| (a - b) / (2.0 * step)).collect::<Vec<f64>>());
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut normal: Vec<f64> = columns.iter().flat_map(|a| columns.iter().map(move |b| dot(a, b))).collect();
        let down: Vec<f64> = columns.iter().map(|column| -dot(column, &now)).collect();
        (0..count).for_each(|k| normal[k * count + k] *= 1.0 + damping);
        let mut step = vec![0.0; count];
        solve(count, &normal, &down, &mut step, &mut workspace).ok()?;
        let mut trial = values.clone();
        symbols.iter().zip(&step).for_each(|(symbol, step)| *trial.entry(symbol.clone()).or_default() += step);
        let small = symbols
            .iter()
            .zip(&step)
            .all(|(symbol, step)| step.abs() < LAST_PARAMETER_STEP * (1.0 + values[symbol].abs()));
        match of(&trial).filter(|then| square(then) <= square(&now)) {
            Some(then) => (values, now, damping) = (trial, then, damping * 0.1),
            None => damping *= 10.0,
        }
        if small || damping > MOST_DAMPING {
            break;
        }
    }
    Some(values)
}

/// Largest change of the system's conserved vector along the motion of a model from `(q, v)` until `t_end`, sampled every `dt`, relative to
/// its length at the start; `None` for a system without one, or a motion that does not reach the end.
fn conserved_drift(
    system: &SystemInstance<f64>,
    model: &dyn EulerLagrange<f64>,
    (q, v): (&[f64], &[f64]),
    (t_end, dt): (f64, f64),
) -> Option<f64> {
    let start = system.conserved(q, v)?;
    let mut worst = 0.0_f64;
    passing(model, (q, v), (t_end, dt), |state| {
        let now = system.conserved(&state.q, &state.v);
        worst = worst.max(now.map_or(f64::NAN, |vector| conserved_change(&start, &vector)));
        state.t >= t_end
    })?;
    worst.is_finite().then_some(worst)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::relativity::{CentralCoordinates, Chart};

    fn of(name: &str, given: &[(&str, &str)], around: CentralCoordinates, range: (f64, f64)) -> Vec<Reading> {
        let given: Vec<_> = given.iter().map(|(symbol, value)| (symbol.to_string(), value.to_string())).collect();
        let system = SystemInstance::<f64>::named(name, &given).unwrap();
        let exact = system.build().unwrap();
        let pair = LearnedHole { exact: &*exact, learned: &*exact, system: &system, around, range };
        pair.readings().unwrap()
    }

    #[test]
    fn the_exact_metric_reads_as_itself() {
        let cartesian = CentralCoordinates::Cartesian(Chart::default());
        let readings = of("kerr-cartesian", &[("M", "2"), ("a", "1.8")], cartesian, (2.7, 80.0));
        for reading in &readings {
            assert!(reading.error.is_some_and(|error| error < 1e-8), "{reading:?}");
        }
        let value = |name: &str| readings.iter().find(|r| r.quantity == name).and_then(|r| r.learned).unwrap();
        assert_eq!((value("point symmetries"), value("quadratic charges beyond products: Carter's")), (2.0, 1.0));
        assert!((value("parameter a") - 1.8).abs() < 1e-9);
    }

    #[test]
    fn what_lies_outside_the_learned_distances_is_not_read() {
        let spherical = CentralCoordinates::Spherical { time: 0, radius: 1, polar: 2, azimuth: 3 };
        let readings = of("schwarzschild-geodesic", &[("M", "2")], spherical, (6.0, 30.0));
        let value = |name: &str| readings.iter().find(|r| r.quantity == name).and_then(|r| r.learned);
        // Lengths in units of the mass, 2 here.
        assert!((value("innermost stable orbit [M]").unwrap() - 6.0).abs() < 1e-9);
        assert!(value("orbit of light [M]").is_none_or(|r| (r - 3.0).abs() < 1e-9));
        assert_eq!(value("horizon [M]"), None);
        assert_eq!(value("point symmetries"), Some(4.0));
        assert!(readings.iter().all(|r| !r.quantity.contains("infall")));
    }

    #[test]
    fn mass_and_spin_are_found_from_far_off() {
        let around = CentralCoordinates::Cartesian(Chart::default());
        let given = [("M".to_string(), "1.3".to_string()), ("a".to_string(), "-0.7".to_string())];
        let (hole, system) = (
            SystemInstance::<f64>::named("kerr-cartesian", &given).unwrap().build().unwrap(),
            SystemInstance::named("kerr-cartesian", &[]).unwrap(),
        );
        let start = [("M".to_string(), 0.8), ("a".to_string(), 0.2)].into();
        let points = around.points(200, (2.0, 20.0));
        let found = nearest_parameters(&system, &*hole, &points, &start).unwrap();
        assert!((found["M"] - 1.3).abs() < 1e-9 && (found["a"] + 0.7).abs() < 1e-9, "{found:?}");
    }
}
