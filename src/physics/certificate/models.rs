//! Certificates of networks, and a model that moves only where its mass matrix is certified.

use super::interval::Interval;
use super::search::Found;
use super::spectrum::Source;
use super::{Certificate, CertificateError, CertificateOptions, Signature, Verdict, certificate, checked};
use crate::lagrangian::system::Bounds;
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Slopes, Terms};
use crate::network::{Architecture, NetworkLagrangian};
use crate::scalar::Scalar;
use std::f64::consts::TAU;

impl Certificate {
    /// As [`Certificate::of`](super::Certificate::of), for a network with its weights.
    ///
    /// The structures `mechanical` and `metric` have their signature by construction: `M = S C eta C^T S` with `S` the reciprocal scales, `eta`
    /// the signs and `C` lower triangular, its diagonal `softplus(c_ii) + 10^-3 > 0`, so that `C` is not singular whatever the network's finite
    /// outputs are, and `M` has the signs of `eta` (Sylvester). This holds unless a known Lagrangian is added. If this signature is requested
    /// without a condition number, nothing is evaluated.
    ///
    /// A coordinate that the network takes as an angle, without its sine and cosine, is first reduced to one turn; a region that crosses the
    /// end of a turn is cut there, and witnesses are given in that turn.
    ///
    /// # Errors
    /// Returns the same errors as [`Certificate::of`](super::Certificate::of).
    pub fn of_network<S: Scalar>(
        network: &NetworkLagrangian<S>,
        region: &Bounds,
        options: &CertificateOptions<'_>,
    ) -> Result<Self, CertificateError> {
        let architecture = network.architecture();
        let bounds = checked(architecture.coordinates, region, options)?;
        let by_construction = signature_by_construction(architecture) == Some(options.signature);
        if by_construction && options.condition.is_none() {
            return Ok(proven(options.signature, bounds));
        }
        let wrapped: Vec<bool> = (0..architecture.coordinates).map(|i| wraps(architecture, i)).collect();
        let source = Source::new(architecture, network.weights());
        let found = certificate(&source, turns(&wrapped, bounds), options);
        Ok(Certificate { by_construction, wrapped, ..found })
    }
}

/// The signature that the structure proves.
fn signature_by_construction(architecture: &Architecture) -> Option<Signature> {
    let proven = architecture.form.structure.has_signature() && architecture.form.known.is_none();
    proven.then(|| Signature::of(architecture.coordinates, architecture.time_like.is_some()))
}

/// A region that is certified without evaluating a box.
fn proven(signature: Signature, bounds: Vec<(f64, f64)>) -> Certificate {
    let (n, found) = (bounds.len() / 2, Found::proven());
    Certificate {
        signature,
        limit: None,
        certified: 1.0,
        refuted: 0.0,
        open: 0.0,
        boxes: 0,
        witness: None,
        condition: None,
        by_construction: true,
        seconds: 0.0,
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
    // Just below the end of a turn the quotient may be rounded up, which must not lose the part before the end.
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

/// A model with a [`Certificate`] that is consulted at every state: `dL/dq`, mass matrix and acceleration of a state that is not certified
/// fail with [`MechanicsError::Uncertified`].
///
/// An integrator stops where the certified region ends, as at the bound of a domain, and reports `RolloutError::Uncertified`: at every state
/// that it used, the mass matrix is proven to have its signature. `L`, momenta and the energy are available everywhere.
#[derive(Clone, Debug)]
pub struct Guarded<'a, M> {
    model: M,
    certificate: &'a Certificate,
}

impl<'a, M> Guarded<'a, M> {
    /// A model and a certificate of its mass matrix.
    pub fn new(model: M, certificate: &'a Certificate) -> Self {
        Self { model, certificate }
    }

    /// The model without its guard.
    pub fn model(&self) -> &M {
        &self.model
    }
}

impl<S: Scalar, M: EulerLagrange<S>> EulerLagrange<S> for Guarded<'_, M> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        let outcome = self.model.terms(q, v, request, terms);
        if !request.includes(Request::MASS_MATRIX) && !request.includes(Request::DL_DQ) {
            return outcome;
        }
        let n = self.coordinates().max(1);
        let found = terms.drain_failures(outcome)?;
        for (row, (q, v)) in q.chunks_exact(n).zip(v.chunks_exact(n)).enumerate() {
            if !matches!(self.certificate.verdict(q, v), Verdict::Certified { .. }) {
                terms.failures.push(MechanicsError::Uncertified { row });
                if let Some(acceleration) = terms.acceleration.get_mut(row * n..(row + 1) * n) {
                    acceleration.fill(S::nan());
                }
            }
        }
        terms.prepend_failures(found);
        terms.outcome()
    }

    fn slopes(&self) -> Option<Box<dyn Slopes<S> + '_>> {
        self.model.slopes()
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<S>> {
        Some(&self.model)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::certificate::tests::{formula, limited};
    use crate::certificate::{Bounds, Signature};
    use crate::lagrangian::{Mechanics, SystemInstance};

    #[test]
    fn a_guarded_model_fails_where_nothing_is_certified() {
        // M = diag(1 - q_0^2/4, 1) is certified within |q_0| < 2, and the region ends at 3.
        let system = formula("(1 - x^2/4)*x_dot^2/2 + y_dot^2/2 - x*y");
        let region = Bounds { positions: vec![(-3.0, 3.0), (-1.0, 1.0)], velocities: vec![(-1.0, 1.0); 2] };
        let found = Certificate::of(&system, &[] as &[f64], &region, &limited(Signature::of(2, false), 4000)).unwrap();
        let guarded = Guarded::new(Mechanics::<_, f64>::new(system, vec![]), &found);
        let (q, v) = ([0.5, 0.0, 2.5, 0.0, 0.5, 1.5], [0.1, 0.2, 0.1, 0.2, 0.0, 0.0]);
        let [mut plain, mut terms] = [Terms::default(), Terms::default()];
        guarded.model().terms(&q, &v, Request::ALL, &mut plain).unwrap();
        let refused = guarded.terms(&q, &v, Request::ACCELERATION, &mut terms);
        assert_eq!(refused, Err(MechanicsError::Uncertified { row: 1 }));
        assert_eq!(terms.failures, [1, 2].map(|row| MechanicsError::Uncertified { row }));
        assert!(
            terms.acceleration[..2] == plain.acceleration[..2] && terms.acceleration[2..].iter().all(|a| a.is_nan())
        );
        guarded.terms(&q, &v, Request::ENERGY, &mut terms).unwrap();
        assert_eq!(terms.energy, plain.energy);
        guarded.terms(&q[..2], &v[..2], Request::ALL, &mut terms).unwrap();
        assert_eq!(terms.acceleration, plain.acceleration[..2]);
    }

    #[cfg(feature = "rollout")]
    #[test]
    fn integrators_stop_where_the_certificate_ends() {
        use crate::rollout::{self, Integrator, RolloutError, rollout};
        let pendulum = SystemInstance::<f64>::named("double-pendulum", &[]).unwrap();
        let region = Bounds::uniform(2, (-3.2, 3.2), (-2.0, 2.0));
        let found = Certificate::of_system(&pendulum, &region, &limited(Signature::of(2, false), 1000)).unwrap();
        assert_eq!(found.certified, 1.0);
        let guarded = Guarded::new(pendulum.build().unwrap(), &found);
        for (method, slack) in [(Integrator::Dopri5, 1e-3), (Integrator::Dop853, 1e-3), (Integrator::Gauss4, 0.2)] {
            let options = rollout::RolloutOptions::new(5.0, 0.01).method(method);
            let motion = rollout(&guarded, &[1.5, 1.0], &[0.0, 0.0], &options);
            let Some(RolloutError::Uncertified { t, state }) = motion.stop else { panic!("{:?}", motion.stop) };
            let fastest = state[2..].iter().fold(0.0f64, |m, v| m.max(v.abs()));
            assert!(t > 0.05 && t < 5.0 && fastest <= 2.0 && fastest > 2.0 - slack, "{method:?} {t} {state:?}");
            assert!(motion.trajectory.v.iter().all(|v| v.abs() <= 2.0 + 1e-6));
        }
    }
}
