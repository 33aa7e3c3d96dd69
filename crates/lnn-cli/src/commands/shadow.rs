//! `lnn shadow`: traces light through a metric, and draws the shadow and the sky around it.

use crate::CliError;
use crate::arguments::learned::{Learned, model_file};
use crate::arguments::number::{choice, index_of, number, thread_count, threads, weight, whole};
use crate::arguments::source::{Source, parameter};
use crate::arguments::system_arg;
use crate::directories::files::{OutputFile, file_ending};
use crate::terminal::interrupt;
use crate::terminal::progress::Progress;
use crate::thresholds::{FARTHEST, MOST_EDGES, NEAREST, PIXEL_BYTES};
use lnn::lagrangian::{EulerLagrange, MechanicsError};
use lnn::names::pluralize;
use lnn::pipeline::require_memory;
use lnn::relativity::{
    Camera, Chart, Observer, RelativityError, ShadowSummary, TOLERANCES, Tracing, TwoSided, View, time_moves_alone,
};
use lnn::report::png;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A system by name (`lnn systems` lists them), or by the file that describes it: the exact metric.
    #[arg(long, value_name = "NAME|FILE", required_unless_present = "model")]
    system: Option<String>,
    /// A trained model, a file or the directory of a run: the learned metric, shown beside the exact one of --system if that is given.
    #[arg(long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// A parameter of the system; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", num_args = 1.., value_parser = parameter, requires = "system")]
    param: Vec<(String, String)>,
    /// Time coordinate; a metric that depends on it is refused.
    #[arg(long, value_name = "NAME", default_value = "t")]
    time: String,
    /// Spatial coordinates: Cartesian around the centre, the last one the axis; or those of a wormhole, a radial one that goes to minus and
    /// to plus infinity, the angle from the axis, and the periodic angle about it [default: x,y,z if there are such, otherwise the three
    /// beside the time in their order].
    #[arg(long, value_name = "X,Y,Z|L,THETA,PHI", value_delimiter = ',')]
    space: Vec<String>,
    /// Distance of the camera from the centre, or its radial coordinate, in the unit of the coordinates.
    #[arg(long, value_name = "R", default_value = "20", allow_hyphen_values = true, value_parser = number(NEAREST, FARTHEST))]
    distance: f64,
    /// Angle of the camera from the axis, in degrees, 0 to 180.
    #[arg(long, value_name = "DEGREES", default_value = "80", allow_hyphen_values = true, value_parser = number(0.0, 180.0))]
    inclination: f64,
    /// Angle of the camera about the axis, in degrees, from x towards y, -360 to 360.
    #[arg(long, value_name = "DEGREES", default_value = "0", allow_hyphen_values = true, value_parser = number(-360.0, 360.0))]
    azimuth: f64,
    /// Motion of the camera.
    #[arg(long, value_parser = choice(&Observer::ALL, Observer::name, Observer::about), value_name = "NAME", default_value = "rest")]
    observer: Observer,
    /// Angle between the left and the right end of the picture, in degrees, 179 at most.
    #[arg(long, value_name = "DEGREES", default_value = "70", allow_hyphen_values = true, value_parser = number(1e-6, 179.0))]
    field_of_view: f64,
    /// Pixels of a row.
    #[arg(long, value_name = "N", default_value = "400", allow_hyphen_values = true, value_parser = whole(1, Camera::MOST_PIXELS))]
    width: usize,
    /// Rows [default: as many as pixels of a row].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = whole(1, Camera::MOST_PIXELS))]
    height: Option<usize>,
    /// Distance beyond which an outgoing ray comes from the sky; keep it within the training range of a learned metric [default: 100
    /// times the distance of the camera, with a learned metric twice the distance].
    #[arg(long, value_name = "R", allow_hyphen_values = true, value_parser = number(NEAREST, FARTHEST))]
    far: Option<f64>,
    /// Relative error of a step of a ray, 1e-12 to 0.01; the edge of the shadow is found with a hundredth of it, 1e-12 at least.
    #[arg(long, value_name = "T", default_value = "1e-6", allow_hyphen_values = true, value_parser = number(TOLERANCES.0, TOLERANCES.1))]
    tolerance: f64,
    /// Directions in which the edge of the shadow is found by bisection, a multiple of four; 0 omits the edge.
    #[arg(long, value_name = "N", default_value = "64", allow_hyphen_values = true, value_parser = edges)]
    edges: usize,
    /// Threads; the picture does not depend on them [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
    threads: Option<usize>,
    /// Picture; with two metrics it shows the exact one, the learned one, and their difference.
    #[arg(long, value_name = "FILE.png", value_parser = file_ending(&["png"]))]
    out: PathBuf,
    /// Replace the file.
    #[arg(long)]
    overwrite: bool,
    /// Print a JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// Parses the number of directions around the centre.
fn edges(text: &str) -> Result<usize, String> {
    let number = weight(text).ok().filter(|x| x % 4.0 == 0.0 && *x <= MOST_EDGES);
    number.map(|x| x as usize).ok_or_else(|| format!("expected a multiple of four from 0 to {MOST_EDGES}"))
}

/// The metrics through which light is traced, with the names of their coordinates.
struct Metrics {
    system: String,
    coordinates: Vec<String>,
    /// For each coordinate, whether it is known to be a periodic angle.
    periodic: Vec<bool>,
    /// Unit of the coordinates, if it is known.
    unit: Option<String>,
    /// Name of each, and its terms.
    models: Vec<(&'static str, Box<dyn EulerLagrange<f64>>)>,
}

impl Args {
    /// Reads the metrics to view.
    fn metrics(&self) -> Result<Metrics, CliError> {
        let (mut system, mut columns, mut known, mut models) = (String::new(), Vec::new(), None, Vec::new());
        let learned = self.model.as_deref().map(Learned::<f64>::load_free).transpose()?;
        if let Some(name) = &self.system {
            let configured = match &learned {
                Some(learned) => learned.beside(name, &self.param)?,
                None => lnn::lagrangian::SystemInstance::new(system_arg::system(name)?, &self.param)
                    .map_err(CliError::usage)?,
            };
            let source = Source::<f64>::configured(configured.system.clone(), &self.param)?;
            (system, columns) = (configured.system.name.to_string(), source.columns);
            known = Some(configured.system);
            models.push(("exact", source.model));
        }
        if let Some(Learned { header, network }) = learned {
            if models.is_empty() {
                known = system_arg::learned_system(&header).ok();
            }
            (system, columns) = (header.system, header.columns);
            models.push(("learned", Box::new(network)));
        }
        let coordinates = columns[..columns.len() / 2].to_vec();
        let unit = known.as_ref().map(|system| system.time_unit.to_string());
        let periodic = known.map(|system| system.coordinates(coordinates.len()).iter().map(|c| c.periodic).collect());
        Ok(Metrics { system, periodic: periodic.unwrap_or_default(), coordinates, unit, models })
    }

    fn chart(&self, coordinates: &[String]) -> Result<Chart, CliError> {
        let place = |option: &str, name: &str| index_of(option, "coordinate", name.trim(), coordinates);
        let time = place("--time", &self.time)?;
        let cartesian = ["x", "y", "z"].map(String::from);
        let others: Vec<String> = coordinates.iter().filter(|name| **name != self.time).cloned().collect();
        let usual = if others.len() != 3 || cartesian.iter().all(|name| coordinates.contains(name)) {
            &cartesian[..]
        } else {
            &others
        };
        let space = if self.space.is_empty() { usual } else { &self.space };
        let [x, y, z] = space else {
            return Err(CliError::usage(format_args!("--space: expected three names, found {}", space.len())));
        };
        Ok(Chart { time, space: [place("--space", x)?, place("--space", y)?, place("--space", z)?] })
    }

    /// Distance of the sky.
    fn far(&self) -> f64 {
        let camera = self.camera(Chart::default());
        let usual = if self.model.is_none() { camera.sky_of_exact() } else { camera.sky_of_learned() };
        self.far.unwrap_or(usual)
    }

    /// Creates the camera in Cartesian coordinates and the settings of ray tracing; metrics of wormholes are transformed to such
    /// coordinates.
    fn scene(&self, metrics: &mut Metrics) -> Result<(Camera, Tracing), CliError> {
        let chart = self.chart(&metrics.coordinates)?;
        let far = self.far();
        let camera = self.camera(chart);
        let usual = Tracing { tolerance: self.tolerance, threads: threads(self.threads), ..Tracing::of(&camera) };
        if metrics.periodic.get(chart.space[2]) != Some(&true) {
            return Ok((camera, Tracing { far, ..usual }));
        }
        let (mut distances, mut models) = ([0.0; 3], Vec::new());
        for (name, model) in metrics.models.drain(..) {
            let sided = TwoSided::new(model, chart.time, chart.space, self.distance, far).map_err(refused)?;
            distances = [self.distance, far, -far].map(|radius| sided.distance(radius));
            models.push((name, Box::new(sided) as Box<dyn EulerLagrange<f64>>));
        }
        metrics.models = models;
        let [distance, far, second] = distances;
        Ok((Camera { chart: Chart::default(), distance, ..camera }, Tracing { far, second, ..usual }))
    }

    fn camera(&self, chart: Chart) -> Camera {
        Camera {
            chart,
            azimuth: self.azimuth.to_radians(),
            observer: self.observer,
            field_of_view: self.field_of_view.to_radians(),
            width: self.width,
            height: self.height.unwrap_or(self.width),
            ..Camera::new(self.distance, self.inclination.to_radians())
        }
    }
}

/// Traces the rays, writes the picture and prints its properties.
///
/// # Errors
/// A usage error for an unknown system, wrong parameters, an impossible camera; a data error for a bad model and for a picture that cannot
/// be written.
pub fn run(args: &Args) -> Result<(), CliError> {
    let mut metrics = args.metrics()?;
    let (camera, tracing) = args.scene(&mut metrics)?;
    let Metrics { system, unit, models, .. } = metrics;
    let model = args.model.as_deref().map(model_file).transpose()?;
    let file = args.system.as_ref().filter(|name| system_arg::is_file(name)).map(PathBuf::from);
    let inputs: Vec<_> = model.iter().chain(&file).map(PathBuf::as_path).collect();
    let out = OutputFile::claim(&args.out, &inputs, args.overwrite)?;

    let pixels = camera.width.saturating_mul(camera.height);
    let most = Camera::MOST_PIXELS;
    if pixels > most {
        return Err(CliError::usage(format_args!("--width, --height: expected at most {most} pixels together")));
    }
    let pixels = pixels * models.len();
    require_memory("the picture", (pixels as u64).checked_mul(PIXEL_BYTES))?;
    let stop = interrupt::flag()?;
    let (progress, done) = (Progress::new(pixels as u64, "rays"), AtomicU64::new(0));
    let advance = |rays: usize| {
        let rays = rays as u64;
        progress.advance(done.fetch_add(rays, Ordering::Relaxed) + rays);
    };
    let metrics: Vec<_> = models.iter().map(|(name, model)| (*name, &**model)).collect();
    let found = View::of(&metrics, (&camera, &tracing, args.edges), &stop, &|name| progress.say(name), &advance);
    let views = found.map_err(refused)?;
    drop(progress);
    let interrupted = stop.load(Ordering::Relaxed);

    out.write(&png(&camera.picture(&views).map_err(refused)?))?;
    let alone = |model: &dyn EulerLagrange<f64>| time_moves_alone(model, camera.chart, camera.distance);
    let free_factor = args.model.is_some() && models.iter().any(|(_, model)| alone(&**model));
    let summary = ShadowSummary::of((&system, unit.as_deref()), (&camera, &tracing), &views, free_factor);
    // A wormhole has radial coordinates.
    let summary = ShadowSummary { distance: args.distance, far: args.far(), ..summary.map_err(refused)? };
    let text = match args.json {
        true => serde_json::to_string(&summary).map_err(CliError::data)? + "\n",
        false => summary.findings(Some(&args.out.display().to_string())).to_string(),
    };
    OutputFile::print(Some(out), &text)?;
    if interrupted {
        let done: usize = views.iter().map(|view| view.shadow.finished()).sum();
        let (rays, place) = (pluralize(pixels, "ray", "rays"), args.out.display());
        return Err(CliError::interrupted(format_args!(
            "interrupted, {done} of {rays} followed to an end are in {place}"
        )));
    }
    Ok(())
}

/// Converts an error and adds the option that helps.
fn refused(error: RelativityError) -> CliError {
    match &error {
        RelativityError::Invalid { what, expected, .. } => match *what {
            "distance" | "azimuth" | "tolerance" => CliError::usage(format_args!("--{what}: expected {expected}")),
            "far distance" => CliError::usage(format_args!("--far: expected {expected}")),
            "inclination" => CliError::usage("--inclination: expected 0 to 180 degrees"),
            "field of view" => CliError::usage("--field-of-view: expected an angle below 180 degrees"),
            _ => CliError::usage(error),
        },
        RelativityError::NothingRests => {
            CliError::usage(format_args!("--observer rest: {error}; --observer normal may be there"))
        }
        RelativityError::DependsOnTime => {
            CliError::usage(format_args!("--time: {error} (a model is, trained with --cyclic t)"))
        }
        RelativityError::Mechanics(MechanicsError::Interrupted) => {
            CliError::interrupted("interrupted before the first ray")
        }
        RelativityError::OneSided { .. } => CliError::usage(format_args!(
            "--space: the last coordinate is an angle: {error}; or use Cartesian coordinates"
        )),
        RelativityError::Chart { .. } => CliError::usage("--time, --space: expected four different coordinates"),
        RelativityError::Coordinates { .. } => CliError::usage(error),
        _ => CliError::data(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read() {
        assert_eq!((edges("0"), edges(" 64 ")), (Ok(0), Ok(64)));
        assert!(["3", "-4", "4100", "x", ""].iter().all(|bad| edges(bad).is_err()));
    }
}
