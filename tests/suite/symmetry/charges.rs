//! Charges along motion.

use super::{PHI, Subject, line};
use lnn::rollout::{Integrator, RolloutOptions, rollout};
use lnn::symmetry::Charge;

#[test]
fn drift_of_a_coarse_integrator_is_its_own() {
    let kepler = Subject::system("kepler", &[line("x"), line("y")]);
    let found = kepler.symmetries(None);
    let options = RolloutOptions::new(10.0, 0.01).tolerances(1e-4, 1e-6);
    let motion = rollout(kepler.model.as_ref(), &[1.0, 0.0], &[0.0, 0.9], &options).complete().unwrap();
    let all = Charge::of(kepler.model.as_ref(), &found.basis, &found.fields, &motion).unwrap();
    assert_eq!((all.len(), all[1].values.len()), (2, motion.len()));
    // Energy 0.9^2/2 - 1 and angular momentum 0.9.
    assert!((all[0].values[0] + 0.595).abs() < 1e-14 && (all[1].values[0].abs() - 0.9).abs() < 1e-14);
    for charge in &all {
        assert!(charge.by_model.abs() < 1e-12 && charge.drift.abs() > 1e-7, "{}", charge.drift);
        assert_eq!(charge.by_integrator, charge.drift - charge.by_model);
    }
}

#[test]
fn drift_of_a_broken_symmetry_is_the_models() {
    // The field of the round potential, along the motion in one that is a little oval.
    let [round, oval] = ["x^2 + y^2", "x^2 + 1.05*y^2"]
        .map(|v| Subject::formula(&[line("x"), line("y")], &format!("(x_dot^2 + y_dot^2 - ({v}))/2")));
    let found = round.symmetries(None);
    let options = RolloutOptions::new(5.0, 0.01).method(Integrator::Dop853).tolerances(1e-12, 1e-14);
    let motion = rollout(oval.model.as_ref(), &[1.0, 0.3], &[0.2, 0.9], &options).complete().unwrap();
    let all = Charge::of(oval.model.as_ref(), &found.basis, &found.fields, &motion).unwrap();
    assert!(
        all[1].by_model.abs() > 1e-3 && all[1].by_integrator.abs() < 1e-8,
        "{} {}",
        all[1].by_model,
        all[1].by_integrator
    );
    assert!(all[0].by_model == 0.0 && all[0].drift.abs() < 1e-10);
}

#[test]
fn motion_of_other_coordinates_is_refused() {
    let kepler = Subject::system("kepler", &[line("x"), line("y")]);
    let motion = lnn::rollout::Trajectory::empty(3);
    assert!(Charge::of(kepler.model.as_ref(), &kepler.basis(None), &[], &motion).is_err());
    let one = Subject::formula(&[PHI], "phi_dot^2/2");
    assert!(Charge::of(kepler.model.as_ref(), &one.basis(None), &[], &lnn::rollout::Trajectory::empty(2)).is_err());
}
