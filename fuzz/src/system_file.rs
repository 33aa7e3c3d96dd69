//! Any text as the file of a system: refused with a line and a message, or a system whose description is written back as
//! the same one and whose Lagrangian is the same in a batch and for one state.

use lnn::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use lnn::pipeline::parse_system;
use std::borrow::Cow;

/// Reads the bytes.
pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let system = match parse_system(text) {
        Ok(system) => system,
        Err((line, problem)) => {
            assert!((1..=text.split('\n').count()).contains(&line), "line {line}: {problem}");
            return assert!(!problem.is_empty());
        }
    };
    let description = system.description().expect("it comes from a description");
    let written = toml::to_string(description).expect("a description can be written");
    let again = parse_system(&written).expect("and read again");
    assert_eq!(again.description().expect("as before"), description);
    let n = system.size.default();
    assert_eq!(system.columns(n).len(), 2 * n);
    let configured = SystemInstance::<f64>::new(Cow::Owned(system), &[]).expect("the defaults are in range");
    // Constraints may contradict each other, or leave no motion: that is known where states are.
    let constrained = !again.description().expect("as before").constraints.is_empty();
    let value: Box<dyn EulerLagrange<f64>> = match configured.build() {
        Ok(value) => value,
        Err(error) => return assert!(constrained && !error.to_string().is_empty(), "{error}"),
    };
    let bounds = configured.system.training(n);
    let middle = |bounds: &[(f64, f64)]| bounds.iter().map(|b| 0.5 * b.0 + 0.5 * b.1).collect::<Vec<f64>>();
    let (q, mut v) = (middle(&bounds.positions), middle(&bounds.velocities));
    configured.impose_constraint(&q, &mut v).expect("the state has n coordinates");
    let mut terms = Terms::default();
    // A term that is not finite, or a singular mass matrix, is said.
    if value.terms_at(&[0.5], &q, &v, Request::LAGRANGIAN, &mut terms).is_ok() {
        let one = terms.lagrangian[0];
        value.terms_at(&[0.5], &q, &v, Request::LAGRANGIAN, &mut terms).expect("it was finite before");
        assert_eq!(terms.lagrangian[0].to_bits(), one.to_bits());
    }
}
