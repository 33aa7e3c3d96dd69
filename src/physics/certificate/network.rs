//! Certificates of networks.

use super::enclosure::Source;
use super::interval::Interval;
use super::search::Found;
use super::{Certificate, CertificateError, Options, Signature, certificate, checked};
use crate::lagrangian::system::Bounds;
use crate::network::{Architecture, NetworkLagrangian};
use crate::scalar::Scalar;
use std::f64::consts::TAU;
use std::time::Duration;

/// As [`certify`](super::certify), for a network with its weights.
///
/// The structures `mechanical` and `metric` have their signature by construction: `M = S C eta C^T S` with `S` the reciprocal scales, `eta`
/// the signs and `C` lower triangular, its diagonal `softplus(c_ii) + 10^-3 > 0`, so that `C` is not singular whatever the network's
/// finite outputs are, and `M` has the signs of `eta` (Sylvester). This holds unless a known Lagrangian is added. If that is the signature
/// asked for and no condition number is, nothing is evaluated.
///
/// A coordinate that the network takes as an angle without its sine and cosine is reduced to one turn before; a region that reaches over
/// the end of a turn is cut there, and witnesses are given in that turn.
///
/// # Errors
/// As [`certify`](super::certify).
pub fn certify_network<S: Scalar>(
    network: &NetworkLagrangian<S>,
    region: &Bounds,
    options: &Options<'_>,
) -> Result<Certificate, CertificateError> {
    let architecture = network.architecture();
    let bounds = checked(architecture.coordinates, region, options)?;
    let by_construction = signature_by_construction(architecture) == Some(options.signature);
    if by_construction && options.condition.is_none() {
        return Ok(Certificate { by_construction, ..proven(bounds) });
    }
    let wrapped: Vec<bool> = (0..architecture.coordinates).map(|i| wraps(architecture, i)).collect();
    let source = Source::new(architecture, network.weights());
    let found = certificate(&source, turns(&wrapped, bounds), options);
    Ok(Certificate { by_construction, wrapped, ..found })
}

/// The signature that the structure proves.
fn signature_by_construction(architecture: &Architecture) -> Option<Signature> {
    let proven = architecture.form.structure.has_signature() && architecture.form.known.is_none();
    proven.then(|| Signature::of(architecture.coordinates, architecture.time_like.is_some()))
}

/// A region that is certified without a box.
fn proven(bounds: Vec<(f64, f64)>) -> Certificate {
    let (n, found) = (bounds.len() / 2, Found::proven());
    Certificate {
        certified: 1.0,
        refuted: 0.0,
        open: 0.0,
        boxes: 0,
        witness: None,
        condition: None,
        by_construction: true,
        elapsed: Duration::ZERO,
        regions: vec![bounds],
        tree: found.tree,
        wrapped: vec![false; n],
    }
}

/// `true` if coordinate `i` enters the network as an angle of one turn.
fn wraps(architecture: &Architecture, i: usize) -> bool {
    architecture.periodic[i] && !architecture.embeds(i) && !architecture.form.cyclic.contains(&i)
}

/// A region cut into parts whose wrapped coordinates lie in one turn, with their shares.
fn turns(wrapped: &[bool], bounds: Vec<(f64, f64)>) -> Vec<(Vec<(f64, f64)>, f64)> {
    let mut parts = vec![(bounds, 1.0)];
    for axis in (0..wrapped.len()).filter(|&axis| wrapped[axis]) {
        parts = parts.into_iter().flat_map(|(bounds, share)| turn(bounds, share, axis)).collect();
    }
    parts
}

/// One or two parts whose coordinate `axis` lies in the first turn; ends are rounded outward.
fn turn(bounds: Vec<(f64, f64)>, share: f64, axis: usize) -> Vec<(Vec<(f64, f64)>, f64)> {
    let (low, high) = bounds[axis];
    let (end, full) = (TAU.next_up(), Interval::pi() + Interval::pi());
    let part = |range: (f64, f64), share: f64| {
        let mut bounds = bounds.clone();
        bounds[axis] = range;
        (bounds, share)
    };
    if low >= 0.0 && high <= TAU {
        return vec![part((low, high), share)];
    }
    if high - low >= TAU {
        return vec![part((0.0, end), share)];
    }
    let (turns, one) = ((low / TAU).floor(), Interval::point(1.0));
    // Just below the end of a turn the quotient may be rounded up: the part before the end is not to be lost.
    let short = (Interval::point(low) - Interval::point(turns) * full).low < 0.0;
    let shift = (Interval::point(turns) - if short { one } else { Interval::ZERO }) * full;
    let (first, last) = ((Interval::point(low) - shift).low.max(0.0), (Interval::point(high) - shift).high);
    if last <= TAU {
        return vec![part((first, last), share)];
    }
    let rest = (Interval::point(high) - shift - full).high.clamp(0.0, end);
    let beyond = (rest / (high - low)).clamp(0.0, 1.0);
    vec![part((first.min(end), end), share * (1.0 - beyond)), part((0.0, rest), share * beyond)]
}
