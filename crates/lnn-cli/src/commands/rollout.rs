//! `lnn rollout`: predicts the motion of a model from one state.

use crate::CliError;
use crate::arguments::forces::ForceArgs;
use crate::arguments::input::{is_standard, place};
use crate::arguments::integration::IntegrationArgs;
use crate::arguments::motion_source::{MotionArgs, MotionSource};
use crate::terminal::output;
use files::FileArgs;
use integrate::integrate;
use lnn::lagrangian::{EulerLagrange, LeastNorm};
use lnn::names::pluralize;
use lnn::report::MotionSummary;
use lnn::rollout::Event;
use readings::ReadingColumns;
use samples::{MoreColumns, Samples};
use std::path::Path;
use tube::TubeArgs;

mod files;
mod integrate;
mod readings;
mod samples;
mod tube;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    subject: MotionArgs,
    #[command(flatten)]
    integration: IntegrationArgs,
    #[command(flatten)]
    forces: ForceArgs,
    #[command(flatten)]
    files: FileArgs,
    /// Report the charges of the model's symmetries along the motion, with the parts of their drift due to the model and to
    /// the integrator.
    #[arg(long)]
    charges: bool,
    #[command(flatten)]
    tube: TubeArgs,
    /// Print a JSON object instead of text.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// Rejects options that exclude each other, and files that exist or are inputs.
    fn check(&self, source: &MotionSource, is_driven: bool) -> Result<(), CliError> {
        let problem = if self.json && is_standard(&self.files.out) {
            "--json: the trajectory takes standard output (--out -)"
        } else if self.files.events.is_some() && source.events.is_empty() {
            "--events: the system has none, see the table [events] of a system file"
        } else if self.charges && source.events.iter().any(Event::is_impact) {
            "--charges: impacts change them; leave the table [events] out"
        } else if self.charges && (is_driven || source.model.is_timed()) {
            "--charges: only for motion without external forces, of a system that does not depend on time"
        } else {
            return self.files.require_room(&self.inputs(source));
        };
        Err(CliError::usage(problem))
    }

    /// Files that are read.
    fn inputs<'a>(&'a self, source: &'a MotionSource) -> Vec<&'a Path> {
        let files = self.forces.files().chain(self.tube.files());
        files.chain(source.file.as_deref()).chain(self.subject.constraints.as_deref()).collect()
    }
}

/// Integrates in double precision and writes the valid part of the trajectory.
///
/// # Errors
/// A usage error for a state of the wrong length; a data error for a bad model, a file that cannot be written, or a
/// motion that ends before its time, the samples up to there being written.
pub fn run(args: &Args) -> Result<(), CliError> {
    let mut source = args.subject.read()?;
    let (q, v) = args.subject.state.split_at(source.columns.len() / 2);
    let span = (args.integration.t_start, args.integration.t_end);
    let force = args.forces.force(&source.columns[..q.len()], &source.forces, span)?;
    let force = source.take_inputs(force)?;
    let options = args.integration.options(&source)?;
    args.check(&source, force.is_some())?;
    let learned = (source.model.as_ref(), args.subject.model.as_deref());
    let tube = args.tube.tube(learned, &source.columns[..q.len()], span)?;
    let more = MoreColumns { tube, readings: ReadingColumns::of(&source, force.is_some())? };
    let mut samples = Samples::create(&args.files.out, &source, more, args.charges)?;
    let least_norm = LeastNorm(source.model.as_ref());
    let model: &dyn EulerLagrange<f64> = if args.subject.least_norm { &least_norm } else { source.model.as_ref() };
    if args.subject.least_norm {
        let open = pluralize(least_norm.open_directions(options.t0, q, v), "direction", "directions");
        let singular = format!("the mass matrix is singular along {open} at the start");
        output::note(&format!("least norm: {singular}, and the motion does not follow them"));
    }
    let ending = integrate(model, force.as_ref(), (q, v), &options, &mut samples)?;
    // Another program may have written a file in the meantime.
    args.files.require_room(&args.inputs(&source))?;
    let (record, tube, kept) = samples.finish()?;
    let events = (!source.events.is_empty()).then(|| record.events(&ending.events));
    args.files.write_events(events.as_ref())?;
    args.files.draw(&record, (&source, model), tube.as_ref())?;
    if let Some(leaving) = record.leaving.as_ref().filter(|_| args.integration.beyond_range) {
        output::note(&format!("{}; the motion after that is extrapolated", leaving.text()));
    }
    if let Some(stop) = &ending.stop {
        let shown = events.filter(|events| !args.json && !events.table.rows.is_empty());
        shown.map_or(Ok(()), |events| args.files.print(&events.findings().to_string()))?;
        let names = model.manifold().map_or(&[][..], |manifold| manifold.names());
        return Err(args.integration.ended(stop, (&source.columns, names), (ending.samples, &place(&args.files.out))));
    }
    let mut summary = MotionSummary::of((&source.name, model), &record, (&options, &ending), force.is_some());
    summary.charges = kept.map(|motion| args.subject.probe()?.charges(&motion)).transpose()?;
    (summary.time_unit, summary.tube, summary.events) = (source.time_unit, tube, events);
    summary.out = place(&args.files.out);
    args.files.print(&output::shown(&summary, args.json, MotionSummary::findings)?)
}
