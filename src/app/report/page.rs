//! A model as an interactive page: an HTML file with the recorded operations, the weights, and JavaScript that evaluates them.

use super::html::{base64, escape};
use crate::analysis::{MassMatrixError, mass_matrix_error_within};
use crate::lagrangian::system::Bounds;
use crate::lagrangian::{
    Constraints, EulerLagrange, ExpressionConstraints, Lagrangian, LagrangianVisitor, SystemError, SystemInstance,
    project,
};
use crate::network::NetworkLagrangian;
use crate::network::file::{Header, ModelFileError};
use crate::report::thresholds::{COMPARED_STATES, CROSSING_SECONDS, EXAMINED_STARTS, MOST_PAGE_BYTES};
use crate::tape::{Listing, Operation, TapeError};
use serde_json::{Value, json};
use thiserror::Error;

const PAGE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/play.css");
const ENGINE: &str = include_str!("page/engine.js");
const PICTURES: &str = include_str!("page/pictures.js");
const PLAY: &str = include_str!("page/play.js");

/// Why a page cannot be written.
#[derive(Debug, Error)]
pub enum PageError {
    /// A function cannot be written as a list of operations.
    #[error(transparent)]
    Tape(#[from] TapeError),
    /// The constraints do not match the model.
    #[error(transparent)]
    Header(#[from] ModelFileError),
    /// The constraints do not match the system.
    #[error(transparent)]
    System(#[from] SystemError),
    /// The page would be too large.
    #[error("the page would have {found} bytes, {MOST_PAGE_BYTES} at most are written: a smaller network has a page")]
    Large {
        /// Size of the page in bytes.
        found: usize,
    },
}

/// Creates the page of a model and, if it is known, of the system that it learned.
///
/// # Errors
/// [`PageError`].
pub fn page(
    header: &Header,
    network: &NetworkLagrangian<f64>,
    system: Option<&SystemInstance<f64>>,
) -> Result<String, PageError> {
    let (architecture, n, weights) = (network.architecture(), header.columns.len() / 2, network.weights());
    let lagrangian =
        Listing::record::<f64, _>(2 * n, weights.len(), |x, p| architecture.lagrangian(p, &x[..n], &x[n..]))?;
    let dissipation = match architecture.has_friction() {
        false => Value::Null,
        true => operations(&Listing::record::<f64, _>(2 * n, weights.len(), |x, p| {
            architecture.rayleigh_dissipation(p, &x[..n], &x[n..])
        })?),
    };
    let motion = header.constrain::<f64>(Box::new(network.cast::<f64>()))?;
    let held = match header.constraints()? {
        Some((constraints, parameters)) => json!({
            "rows": rows(&constraints, motion.as_ref(), parameters.len())?, "parameters": parameters,
        }),
        None => json!({ "rows": [], "parameters": [] }),
    };
    let single: Vec<u8> = weights.iter().flat_map(|weight| (*weight as f32).to_le_bytes()).collect();
    let exact = system.map(exact).transpose()?.flatten();
    let angle = |unit: &'static str| architecture.periodic.iter().map(move |angle| if *angle { unit } else { "" });
    let units = system.map_or_else(
        || angle("rad").chain(angle("rad/s")).map(String::from).collect(),
        |system| system.system.units(n),
    );
    let time_unit = system.map_or("s", |system| &system.system.time_unit);
    let start = start(header, system, motion.as_ref());
    let time_like = architecture.time_like.or(system.and_then(|system| system.system.time_like));
    let t_end = system.map_or(CROSSING_SECONDS, |system| system.system.trajectory(n).t_end);
    let t_end = if time_unit == "s" { t_end } else { t_end.max(crossing(header, &start, time_like)) };
    let rate = if time_unit == "s" { 1.0 } else { t_end / CROSSING_SECONDS };
    let title = system.map_or(header.system.as_str(), |system| &system.system.title);
    let data = json!({
        "columns": header.columns,
        "units": units,
        "periodic": architecture.periodic,
        "time_like": time_like,
        "time_unit": if time_unit == "1" { "" } else { time_unit },
        "span": t_end.min(CROSSING_SECONDS * rate),
        "rate": rate,
        "start": { "q": start.0, "v": start.1 },
        "ranges": { "position": header.position, "velocity": header.velocity },
        "learned": {
            "lagrangian": operations(&lagrangian), "dissipation": dissipation, "weights": base64(&single),
            "held": held, "factors": system.map(|system| factors(header, (network, motion.as_ref()), system)).transpose()?,
        },
        "constraints": header.held_by(),
        "exact": exact,
    });
    let known = if data["exact"].is_null() { "." } else { ", <b class=\"exact\">exact</b>." };
    // The data must not contain the tag that ends their element.
    let data = data.to_string().replace('<', "\\u003c");
    let text = PAGE.replace("{TITLE}", &escape(&format!("{title}: learned")));
    let text = text.replace("{STYLE}", STYLE).replace("{EXACT}", known).replace("{ENGINE}", ENGINE);
    let text = text.replace("{PLAY}", &[PICTURES, PLAY].concat()).replace("{DATA}", &data);
    if text.len() > MOST_PAGE_BYTES {
        return Err(PageError::Large { found: text.len() });
    }
    Ok(text)
}

/// Collects the exact Lagrangian, dissipation and constraints with their parameters.
fn exact(system: &SystemInstance<f64>) -> Result<Option<Value>, PageError> {
    struct List {
        n: usize,
        parameters: usize,
    }
    impl LagrangianVisitor for List {
        type Output = Result<Listing, TapeError>;
        fn visit<L: Lagrangian>(self, lagrangian: &L) -> Self::Output {
            let Self { n, parameters } = self;
            Listing::record::<f64, _>(2 * n, parameters, |x, p| lagrangian.lagrangian(p, &x[..n], &x[n..]))
        }
    }
    if system.is_timed() {
        return Ok(None);
    }
    let list = || List { n: system.coordinates, parameters: system.parameters.len() };
    let Some(listing) = system.visit_unconstrained(list()).transpose()? else { return Ok(None) };
    let dissipation = match system.dissipation() {
        Some(function) => operations(&list().visit(function)?),
        None => Value::Null,
    };
    let held = match system.constraints() {
        Some(constraints) => rows(constraints, system.build()?.as_ref(), system.parameters.len())?,
        None => Vec::new(),
    };
    let named = system.system.parameters.iter().zip(&system.parameters);
    let parameters: Vec<Value> =
        named.map(|(p, value)| json!({ "symbol": p.symbol, "unit": p.unit, "value": value })).collect();
    Ok(Some(json!({
        "lagrangian": operations(&listing), "dissipation": dissipation, "held": { "rows": held }, "parameters": parameters,
    })))
}

/// Selects the constraint rows that vanish along a motion and are independent.
fn rows(
    constraints: &ExpressionConstraints,
    motion: &dyn EulerLagrange<f64>,
    parameters: usize,
) -> Result<Vec<Value>, TapeError> {
    let (n, kept) = (constraints.coordinates(), motion.manifold().map_or(&[][..], |manifold| manifold.names()));
    let all = constraints.names().into_iter().enumerate().filter(|(_, name)| kept.contains(name));
    all.map(|(row, name)| {
        let value = Listing::record::<f64, _>(2 * n, parameters, |x, p| constraints.value(row, p, &x[..n], &x[n..]))?;
        Ok(json!({ "name": name, "holonomic": constraints.is_holonomic(row), "value": operations(&value) }))
    })
    .collect()
}

/// Converts bounds to pairs.
fn pairs(ranges: &[[f64; 2]]) -> Vec<(f64, f64)> {
    ranges.iter().map(|&[low, high]| (low, high)).collect()
}

/// Chooses a point in a box; `share` and the number `k` of the attempt determine the relative position along each side.
fn inside(sides: &[(f64, f64)], share: f64, k: usize) -> Vec<f64> {
    let share = |i: usize| (share + (k * (i + 1)) as f64 * std::f64::consts::SQRT_2).fract();
    sides.iter().enumerate().map(|(i, (low, high))| low + share(i) * (high - low)).collect()
}

/// Factors of the coordinates that bring the mass matrix of a network, and of its motion under constraints, closest to the exact one over
/// the known region; none if the two cannot be compared.
fn factors(
    header: &Header,
    (network, motion): (&NetworkLagrangian<f64>, &dyn EulerLagrange<f64>),
    system: &SystemInstance<f64>,
) -> Result<Option<Vec<f64>>, PageError> {
    let exact = system.build()?;
    let (positions, velocities) = (pairs(&header.position), pairs(&header.velocity));
    let states = (1..=COMPARED_STATES).filter_map(|k| {
        let (mut q, mut v) = (inside(&positions, 0.3, k), inside(&velocities, 0.75, k));
        motion.manifold().map_or(Ok(()), |manifold| project(manifold, &mut q, &mut v).map(drop)).ok()?;
        system.check_domain(&q).is_ok().then_some((q, v))
    });
    let (q, v): (Vec<Vec<f64>>, Vec<Vec<f64>>) = states.unzip();
    let (q, v) = (q.concat(), v.concat());
    let found = match motion.manifold() {
        None => MassMatrixError::of(exact.as_ref(), network, &q),
        Some(manifold) => mass_matrix_error_within(manifold, (exact.as_ref(), network), (&q, &v)),
    };
    Ok(Some(found.factors).filter(|factors| factors.iter().all(|factor| factor.is_finite())))
}

/// Finds a moving start within the known region; for a system, among the starts of its trajectory test, on its mass shell and its
/// constraints.
fn start(
    header: &Header,
    system: Option<&SystemInstance<f64>>,
    motion: &dyn EulerLagrange<f64>,
) -> (Vec<f64>, Vec<f64>) {
    let Bounds { positions, velocities } = match system {
        Some(system) => system.system.trajectory(system.coordinates).start,
        None => Bounds { positions: pairs(&header.position), velocities: pairs(&header.velocity) },
    };
    let (q, mut v) = (inside(&positions, 0.3, 0), inside(&velocities, 0.75, 0));
    if let Some(system) = system {
        // If that fails, the start may lie off the shell.
        let _ = system.impose_constraint(&q, &mut v);
    }
    let Some(manifold) = motion.manifold() else { return (q, v) };
    let known = |q: &[f64]| q.iter().zip(&header.position).all(|(q, [low, high])| (low..=high).contains(&q));
    let tries = (1..=EXAMINED_STARTS).filter_map(|k| {
        let (mut q, mut v) = (inside(&positions, 0.3, k), inside(&velocities, 0.75, k));
        project(manifold, &mut q, &mut v).ok().map(|_| (q, v))
    });
    let mut tries = tries.peekable();
    let first = tries.peek().cloned().unwrap_or((q, v));
    tries.find(|(q, _)| known(q)).unwrap_or(first)
}

/// Shortest time in which a motion from a start crosses the known range of a coordinate; 0 if it crosses none.
fn crossing(header: &Header, (_, v): &(Vec<f64>, Vec<f64>), time_like: Option<usize>) -> f64 {
    let widths = header.position.iter().map(|[low, high]| high - low).zip(v).enumerate();
    let times = widths.filter(|(i, _)| Some(*i) != time_like).map(|(_, (width, v))| width / v.abs());
    let least = times.filter(|time| time.is_finite() && *time > 0.0).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

/// Converts the operations to JSON: kind or name, then operands.
fn operations(listing: &Listing) -> Value {
    let one = |operation: &Operation| match operation {
        Operation::Input(index) => json!(["i", index]),
        Operation::Parameter(index) => json!(["p", index]),
        Operation::Constant(value) => json!(["c", value]),
        Operation::Function(name, operands) => {
            [json!(name)].into_iter().chain(operands.iter().map(|row| json!(row))).collect()
        }
        Operation::Dense(inputs, outputs, weights, bias) => json!(["d", inputs, outputs, weights, bias]),
    };
    json!({ "operations": listing.operations.iter().map(one).collect::<Vec<_>>(), "result": listing.result })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::file::ModelFile;

    #[test]
    fn a_start_crosses_what_the_model_knows_in_the_time_of_its_fastest_coordinate() {
        let bytes = include_bytes!("../../../examples/data/double_pendulum.safetensors");
        let mut header = ModelFile::<f64>::from_bytes(bytes).unwrap().header;
        header.position = vec![[0.0, 2.0], [0.0, 3.0]];
        let time = |v: [f64; 2], time_like| crossing(&header, &(Vec::new(), v.to_vec()), time_like);
        assert_eq!([time([0.5, -3.0], None), time([0.5, -3.0], Some(1)), time([0.0, 0.0], None)], [1.0, 4.0, 0.0]);
    }
}
