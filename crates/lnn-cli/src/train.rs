//! `lnn train`: trains a model, tests it, writes the results.

use crate::learn::{Learned, Session, open};
use crate::resume::{Text, parse, reopen, require_same};
use crate::system_arg::note_impacts;
use crate::train_config::Args;
use crate::{CliError, output};
use lnn::configuration::{Config, Penalty, Regularizer};
use lnn::data::sample_all;
use lnn::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use lnn::names::percent;
use lnn::pipeline::{Begin, Command, train};
use lnn::training::LATEST;

/// Trains and writes everything into the output directory; continues a stopped training on request.
///
/// # Errors
/// A usage error for arguments and configuration, a data error for files and a training that fails, an interruption;
/// after the last two the best model so far is written, if there is one.
pub fn run(args: &Args) -> Result<(), CliError> {
    if let Some(format) = args.run.print_config {
        return args.print(format);
    }
    let (config, system, folder, begin) = match &args.run.resume {
        None => {
            let (config, system) = args.resolve(None)?;
            let folder = open(&args.run, &config, &args.inputs())?;
            (config, system, folder, Begin::Anew)
        }
        Some(path) => {
            let read = |text: Text<'_>| {
                let saved: Config = match text {
                    Text::Checkpoint(text) => parse(path, LATEST, text)?,
                    Text::Configuration(text) => parse(path, "config.toml", text)?,
                };
                require_same(path, &saved, &args.resolve(Some(&saved))?.0)?;
                Ok(saved)
            };
            let Some((folder, saved)) = reopen(path, Command::Train, args.run.json, read)? else { return Ok(()) };
            let system = args.check(&saved)?;
            (saved, system, folder, Begin::Resume)
        }
    };
    note_impacts(&system);
    let forbidden = forbidden_share(&config, &system).filter(|share| *share > 0.0);
    if let (Some(share), Regularizer::LorentzianSylvester { time, .. }) = (forbidden, &config.penalty) {
        let place = "as inside of a horizon or of an ergosphere: choose --penalty signature, or other bounds";
        let share = percent(share);
        output::note(&format!("the penalty is against g_{time}{time} > 0, which {share} of the states have, {place}"));
    }
    let session = Session::new(&args.run, folder, begin, None)?;
    let report = train(&config, &system, &session.options, &session.folder, &session.watch());
    session.conclude(report.and_then(|report| {
        let (json, findings, epochs) = (report.json()?, report.findings(), report.history.len());
        Ok(Learned { json, findings, stop: report.stop, epochs, unfinished: None })
    }))
}

/// States that are examined for a remark on the penalty.
const LOOKED_AT: usize = 512;

/// Share of the training states at which the exact metric violates a penalty; `None` without such a penalty, or if it is unknown.
fn forbidden_share(config: &Config, system: &SystemInstance<f64>) -> Option<f64> {
    let Penalty::Sylvester { time: Some(time), .. } = config.penalty().ok()? else { return None };
    let mut few = config.clone();
    (few.data.training, few.data.validation, few.data.test) = (LOOKED_AT, 1, 1);
    let (data, _) = sample_all::<f64>(&few, system).ok()?;
    let (set, n, mut terms) = (&data.training[0], system.coordinates, Terms::default());
    system.build().ok()?.terms(set.q(), set.v(), Request::MASS_MATRIX, &mut terms).ok()?;
    let forbidden = terms.mass_matrix.chunks_exact(n * n).filter(|g| g[time * n + time] > 0.0).count();
    Some(forbidden as f64 / set.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lnn::lagrangian::configure;
    use lnn::network::Structure;
    use lnn::presets::Preset;

    #[test]
    fn a_penalty_is_known_to_forbid_the_inside_of_a_horizon() {
        let share = |name: &str, radius: [f64; 2]| {
            let system = configure::<f64>(name, &[]).unwrap();
            let mut config = Preset::Quick.config(&system).unwrap();
            config.take_structure(Structure::BlackBox);
            config.penalty = Regularizer::LorentzianSylvester { lambda: 1.0, time: "t".to_string() };
            config.data.shell_radius = config.data.shell_radius.map(|_| radius);
            forbidden_share(&config, &system)
        };
        // The horizon of mass 1 is at 2.
        assert_eq!(share("schwarzschild-cartesian", [3.0, 20.0]), Some(0.0));
        assert_eq!(share("schwarzschild-cartesian", [1.0, 1.9]), Some(1.0));
        assert!(share("schwarzschild-cartesian", [1.0, 4.0]).is_some_and(|share| (0.3..0.7).contains(&share)));
        assert_eq!(share("ads4-geodesic", [0.0; 2]), Some(0.0));
        let system = configure::<f64>("kepler", &[]).unwrap();
        assert_eq!(forbidden_share(&Preset::Quick.config(&system).unwrap(), &system), None);
    }
}
