//! `lnn certify`: proves where the mass matrix has its signature.

use crate::CliError;
use crate::arguments::learned::Learned;
use crate::arguments::number::{finite, indices_of, range, seconds, thread_count, threads, whole};
use crate::arguments::source::{SystemOrModel, require_at_most};
use crate::arguments::system_arg::{self, learned_system};
use crate::terminal::format::FormatArgs;
use crate::terminal::interrupt;
use lnn::certificate::{Certificate, CertificateError, CertificateOptions, Signature};
use lnn::lagrangian::SystemInstance;
use lnn::lagrangian::system::Bounds;
use lnn::network::file::{Header, MAX_COORDINATES};
use serde::Serialize;
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    subject: SystemOrModel,
    /// Region of states: bounds of columns, such as theta1=-1..1,theta1_dot=-3..3. Other columns keep the validation bounds of the
    /// system, or the training range of the model; an angle of a model covers one turn.
    #[arg(long = "box", value_name = "COLUMN=LOW..HIGH,..", value_delimiter = ',', allow_hyphen_values = true, value_parser = side)]
    region: Vec<(String, (f64, f64))>,
    /// Largest condition number allowed, the ratio of the largest to the smallest absolute eigenvalue of the mass matrix in the units of
    /// the coordinates [default: any].
    #[arg(long, value_name = "K", allow_hyphen_values = true, value_parser = condition)]
    condition: Option<f64>,
    /// Numbers of positive and of negative eigenvalues [default: all positive, but for one if a coordinate is a time].
    #[arg(long, value_name = "P,N", value_parser = signature)]
    signature: Option<Signature>,
    /// Time limit of the search, in seconds.
    #[arg(long, value_name = "T", default_value = "10", allow_hyphen_values = true, value_parser = seconds)]
    seconds: f64,
    /// Limit of evaluated boxes; a search that ends at this limit always gives the same result.
    #[arg(long, value_name = "N", default_value = "10000000", allow_hyphen_values = true, value_parser = whole(1, 100_000_000))]
    boxes: usize,
    /// Threads; they do not change the result of a search that --boxes ends [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = thread_count)]
    threads: Option<usize>,
    #[command(flatten)]
    format: FormatArgs,
}

/// Parses `column=low..high`.
fn side(text: &str) -> Result<(String, (f64, f64)), String> {
    let found = text.split_once('=').and_then(|(name, sides)| Some((name.trim().to_string(), range(sides, "..")?)));
    found.ok_or_else(|| "expected COLUMN=LOW..HIGH, two finite numbers in order".to_string())
}

/// Parses a condition number.
fn condition(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|x| *x >= 1.0).ok_or_else(|| "expected a finite number of at least 1".to_string())
}

/// Parses `positive,negative`.
fn signature(text: &str) -> Result<Signature, String> {
    let pair = text.split_once(',').and_then(|(p, n)| Some((p.trim().parse().ok()?, n.trim().parse().ok()?)));
    let found = pair.map(|(positive, negative)| Signature { positive, negative });
    found.ok_or_else(|| "expected P,N, the numbers of positive and of negative eigenvalues".to_string())
}

/// The certificate and the columns of its region.
#[derive(Serialize)]
struct CertifiedRegion {
    system: String,
    columns: Vec<String>,
    #[serde(flatten)]
    certificate: Certificate,
}

/// Searches and prints the proofs.
///
/// # Errors
/// A usage error for an unknown system, a wrong parameter or a region that does not fit; a data error for a bad model; the code of a signal
/// that ended the search, after the proofs so far are printed.
pub fn run(args: &Args) -> Result<(), CliError> {
    let stop = interrupt::flag()?;
    let refused = |error: CertificateError| CliError::usage(error);
    let (name, columns, found) = match &args.subject.model {
        Some(path) => {
            let Learned { header, network } = Learned::<f64>::load_free(path)?;
            let time = learned_system(&header).ok().and_then(|system| system.time_like);
            let options =
                args.options(header.columns.len() / 2, header.architecture.time_like.or(time).is_some(), &stop);
            let region = args.region(&header.columns, trained(&header))?;
            let found = Certificate::of_network(&network, &region, &options).map_err(refused)?;
            (header.system, header.columns, found)
        }
        None => {
            let system = system_arg::system(args.subject.system.as_deref().unwrap_or_default())?;
            let configured = SystemInstance::<f64>::new(system, &args.subject.param).map_err(CliError::usage)?;
            require_at_most(MAX_COORDINATES, configured.coordinates)?;
            let n = configured.coordinates;
            let columns = configured.system.columns(n);
            let options = args.options(n, configured.system.time_like.is_some(), &stop);
            let region = args.region(&columns, configured.system.validation(n))?;
            let found = Certificate::of_system(&configured, &region, &options).map_err(refused)?;
            (configured.system.name.to_string(), columns, found)
        }
    };
    let open = found.open;
    let result = CertifiedRegion { system: name, columns, certificate: found };
    args.format.print(&result, |result| result.certificate.findings(&result.columns))?;
    if stop.load(Ordering::Relaxed) {
        return Err(CliError::interrupted(format_args!("interrupted, {:.4} % of the region is open", 100.0 * open)));
    }
    Ok(())
}

/// The states that a model was trained on; an angle covers a full turn.
fn trained(header: &Header) -> Bounds {
    let pair = |b: &[f64; 2]| (b[0], b[1]);
    let turn = |(b, &periodic): (&[f64; 2], &bool)| if periodic { (0.0, TAU) } else { pair(b) };
    Bounds {
        positions: header.position.iter().zip(&header.architecture.periodic).map(turn).collect(),
        velocities: header.velocity.iter().map(pair).collect(),
    }
}

impl Args {
    fn options<'a>(&self, n: usize, time_like: bool, stop: &'a AtomicBool) -> CertificateOptions<'a> {
        let mut options = CertificateOptions::new(self.signature.unwrap_or(Signature::of(n, time_like)));
        (options.condition, options.seconds, options.boxes) = (self.condition, self.seconds, self.boxes);
        (options.threads, options.stop) = (threads(self.threads), Some(stop));
        options
    }

    /// Replaces the bounds of the named columns.
    fn region(&self, columns: &[String], usual: Bounds) -> Result<Bounds, CliError> {
        let n = columns.len() / 2;
        let mut bounds = usual;
        let names: Vec<String> = self.region.iter().map(|(name, _)| name.clone()).collect();
        for (place, (_, range)) in indices_of("--box", "column", &names, columns)?.into_iter().zip(&self.region) {
            let side = if place < n { &mut bounds.positions[place] } else { &mut bounds.velocities[place - n] };
            *side = *range;
        }
        Ok(bounds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_and_signatures_are_read() {
        assert_eq!(side("x_dot=-1.5..2e1"), Ok(("x_dot".to_string(), (-1.5, 20.0))));
        assert_eq!(side(" x = 1 .. 1 "), Ok(("x".to_string(), (1.0, 1.0))));
        for bad in ["", "x", "x=1", "x=1:2", "x=2..1", "x=0..inf", "x=..", "x=nan..1", "x=-1e308..1e308"] {
            assert!(side(bad).is_err(), "{bad}");
        }
        assert_eq!(signature("3,1"), Ok(Signature { positive: 3, negative: 1 }));
        assert!(["3", "3,-1", "a,b", ""].iter().all(|bad| signature(bad).is_err()));
        assert_eq!(condition("1"), Ok(1.0));
        assert!(["0.5", "nan", "inf", ""].iter().all(|bad| condition(bad).is_err()));
    }
}
