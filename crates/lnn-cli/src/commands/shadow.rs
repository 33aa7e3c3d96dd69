//! `lnn shadow`: traces light through a metric, and draws the shadow and the sky around it.

use crate::CliError;
use crate::arguments::metrics::Metrics;
use crate::arguments::number::{choice, directions, index_of, number, thread_count, threads, whole};
use crate::arguments::source::parameter;
use crate::directories::files::{OutputFile, file_ending};
use crate::terminal::progress::Progress;
use crate::terminal::{interrupt, output};
use crate::thresholds::{FARTHEST, NEAREST};
use lnn::lagrangian::MechanicsError;
use lnn::names::pluralize;
use lnn::pipeline::require_memory;
use lnn::relativity::{Camera, Chart, Observer, RelativityError, Scene, TOLERANCES, Tracing};
use lnn::report::png;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

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
    #[arg(long, value_name = "N", default_value = "64", allow_hyphen_values = true, value_parser = directions)]
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

impl Args {
    fn chart(&self, coordinates: &[String]) -> Result<Chart, CliError> {
        let place = |option: &str, name: &str| index_of(option, "coordinate", name.trim(), coordinates);
        let time = place("--time", &self.time)?;
        let usual = Chart::usual_space(coordinates, &self.time);
        let space = if self.space.is_empty() { &usual } else { &self.space };
        let [x, y, z] = space.as_slice() else {
            return Err(CliError::usage(format_args!("--space: expected three names, found {}", space.len())));
        };
        Ok(Chart { time, space: [place("--space", x)?, place("--space", y)?, place("--space", z)?] })
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
    let given = Metrics::read(args.system.as_deref(), args.model.as_deref(), &args.param)?;
    let camera = args.camera(args.chart(&given.coordinates)?);
    let tracing = Tracing { tolerance: args.tolerance, threads: threads(args.threads), ..Tracing::of(&camera) };
    let scene = Scene::new(given.metrics, &given.periodic, camera, tracing, args.far).map_err(refused)?;
    let inputs: Vec<&Path> = given.files.iter().map(PathBuf::as_path).collect();
    let out = OutputFile::claim(&args.out, &inputs, args.overwrite)?;
    let most = Camera::MOST_PIXELS;
    if camera.width.saturating_mul(camera.height) > most {
        return Err(CliError::usage(format_args!("--width, --height: expected at most {most} pixels together")));
    }
    require_memory("the picture", scene.bytes())?;
    let (stop, progress) = (interrupt::flag()?, Progress::new(scene.rays() as u64, "rays"));
    let found = scene.views(args.edges, &stop, &|name| progress.say(name), &|rays| progress.add(rays));
    drop(progress);
    let (views, interrupted) = (found.map_err(refused)?, stop.load(Ordering::Relaxed));
    out.write(&png(&scene.picture(&views).map_err(refused)?))?;
    let summary = scene.summary((&given.system, given.unit.as_deref()), &views).map_err(refused)?;
    let place = args.out.display().to_string();
    OutputFile::print(Some(out), &output::shown(&summary, args.json, |summary| summary.findings(Some(&place)))?)?;
    if interrupted {
        let done: usize = views.iter().map(|view| view.shadow.finished()).sum();
        let rays = pluralize(scene.rays(), "ray", "rays");
        return Err(CliError::interrupted(format_args!(
            "interrupted, {done} of {rays} followed to an end are in {place}"
        )));
    }
    Ok(())
}

/// Converts an error and adds the option that helps.
fn refused(error: RelativityError) -> CliError {
    match &error {
        RelativityError::NothingRests => {
            CliError::usage(format_args!("--observer rest: {error}; --observer normal may be there"))
        }
        RelativityError::DependsOnTime => {
            CliError::usage(format_args!("--time: {error} (a model is, trained with --cyclic t)"))
        }
        RelativityError::OneSided { .. } => CliError::usage(format_args!(
            "--space: the last coordinate is an angle: {error}; or use Cartesian coordinates"
        )),
        RelativityError::Chart { .. } => CliError::usage("--time, --space: expected four different coordinates"),
        RelativityError::Mechanics(MechanicsError::Interrupted) => {
            CliError::interrupted("interrupted before the first ray")
        }
        RelativityError::Invalid { .. } | RelativityError::Coordinates { .. } => CliError::usage(error),
        _ => CliError::data(error),
    }
}
