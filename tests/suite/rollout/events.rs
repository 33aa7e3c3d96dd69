//! Events along motions, against closed forms.

use lnn::lagrangian::{EulerLagrange, ExpressionLagrangian, Mechanics, SystemInstance};
use lnn::rollout::{Event, Integrator, Occurrence, Rollout, RolloutError, RolloutOptions, rollout};
use lnn::scalar::Scalar;
use std::f64::consts::{PI, TAU};

/// A system by its coordinates and Lagrangian.
fn system<S: Scalar>(coordinates: &[&str], formula: &str) -> Mechanics<ExpressionLagrangian, S> {
    Mechanics::new(ExpressionLagrangian::new(coordinates, &[], formula).unwrap(), [])
}

/// A ball of 1 kg in a field of 9.81 m/s^2.
fn ball<S: Scalar>() -> Mechanics<ExpressionLagrangian, S> {
    system(&["y"], "y_dot^2/2 - 9.81*y")
}

fn ground(e: f64) -> Event<f64> {
    Event::new("ground", |_, q: &[f64], _: &[f64]| q[0]).falling().restitution(e)
}

/// Options with tolerances and steps by which smooth motions over a few seconds are known to 1e-11 by methods of high order.
fn options(method: Integrator, t_end: f64, events: Vec<Event<f64>>) -> RolloutOptions<f64> {
    RolloutOptions::new(t_end, 0.01).method(method).tolerances(1e-13, 1e-13).events(events)
}

/// Times of the events of a name.
fn times(events: &[Occurrence<f64>], name: &str) -> Vec<f64> {
    events.iter().filter(|event| event.name == name).map(|event| event.t).collect()
}

/// Time of the fall from 1 m.
fn fall() -> f64 {
    (2.0f64 / 9.81).sqrt()
}

#[test]
fn a_ball_bounces_at_the_times_and_to_the_heights_of_the_closed_form() {
    let e = 0.8f64;
    for method in Integrator::ALL {
        let apex = Event::new("apex", |_, _: &[f64], v: &[f64]| v[0]).falling();
        let found = rollout(&ball(), &[1.0], &[0.0], &options(method, 4.0, vec![apex, ground(e)]));
        assert_eq!(found.stop, None, "{method:?}");
        let (hits, tops) = (times(&found.events, "ground"), times(&found.events, "apex"));
        let (mut t, mut speed) = (fall(), 9.81 * fall());
        for (k, hit) in hits.iter().take(10).enumerate() {
            assert!((hit - t).abs() < 1e-10, "{method:?} {k}: {hit} {t}");
            let event = found.events.iter().find(|event| event.t == *hit).unwrap();
            let impact = event.impact.as_ref().unwrap();
            let lost = (1.0 - e * e) / 2.0 * speed * speed;
            assert!((impact.lost() - lost).abs() < 1e-10 && (impact.v_before[0] + speed).abs() < 1e-10);
            speed *= e;
            assert!((event.v[0] - speed).abs() < 1e-10 && event.q[0].abs() < 1e-12);
            let top = found.events.iter().find(|event| event.t == tops[k]).unwrap();
            assert!((top.t - t - speed / 9.81).abs() < 1e-10, "{method:?} {k}");
            assert!((top.q[0] - e.powi(2 * (k as i32 + 1))).abs() < 1e-10, "{method:?} {k}: {}", top.q[0]);
            t += 2.0 * speed / 9.81;
        }
        assert!(hits.len() > 10 && found.trajectory.len() == 401);
        assert!(found.trajectory.q.iter().all(|y| *y > -1e-12), "{method:?}");
    }
    let single = Event::new("ground", |_, q: &[f32], _: &[f32]| q[0]).falling().restitution(0.8);
    let found = rollout(&ball::<f32>(), &[1.0], &[0.0], &RolloutOptions::new(2.0, 0.1).events(vec![single]));
    assert!((f64::from(found.events[1].t) - 2.6 * fall()).abs() < 1e-5, "{:?}", found.events);
}

#[test]
fn equal_masses_exchange_their_velocities_and_others_keep_their_momentum() {
    for (m, method) in [(1.0, Integrator::Dopri5), (1.0, Integrator::Gauss4), (3.5, Integrator::Dop853)] {
        let line = system(&["x1", "x2"], &format!("x1_dot^2/2 + {m}*x2_dot^2/2"));
        let touch = Event::new("touch", |_, q: &[f64], _: &[f64]| q[1] - q[0] - 0.5).restitution(1.0);
        let found = rollout(&line, &[0.0, 2.0], &[1.0, -0.3], &options(method, 4.0, vec![touch]));
        let [event] = &found.events[..] else { panic!("{:?}", found.events) };
        assert!((event.t - 1.5 / 1.3).abs() < 1e-12);
        let mean = (1.0 - 0.3 * m) / (1.0 + m);
        let exact = [2.0 * mean - 1.0, 2.0 * mean + 0.3];
        assert!(event.v.iter().zip(exact).all(|(v, exact)| (v - exact).abs() < 1e-10), "{:?} {exact:?}", event.v);
        assert!(m != 1.0 || (exact[0] + 0.3).abs() < 1e-15);
        assert!(event.impact.as_ref().unwrap().lost().abs() < 1e-12);
    }
}

#[test]
fn the_orbit_of_a_planet_has_its_period_by_events() {
    let sun = system(&["x", "y"], "(x_dot^2 + y_dot^2)/2 + 1/sqrt(x^2 + y^2)");
    let axis = 1.0f64 / (2.0 - 1.1 * 1.1);
    let period = TAU * axis.powf(1.5);
    for method in [Integrator::Dop853, Integrator::Gauss6] {
        let radial = |_: f64, q: &[f64], v: &[f64]| q[0] * v[0] + q[1] * v[1];
        let events = vec![Event::new("perihelion", radial).rising(), Event::new("aphelion", radial).falling()];
        let found = rollout(&sun, &[1.0, 0.0], &[0.0, 1.1], &options(method, 3.2 * period, events));
        let (near, far) = (times(&found.events, "perihelion"), times(&found.events, "aphelion"));
        assert_eq!((near.len(), far.len()), (3, 3));
        for (k, (near, far)) in near.iter().zip(&far).enumerate() {
            assert!((near - (k as f64 + 1.0) * period).abs() < 1e-10, "{method:?} {k}: {:e}", near - period);
            assert!((far - (k as f64 + 0.5) * period).abs() < 1e-10, "{method:?} {k}: {:e}", far - 0.5 * period);
        }
    }
}

#[test]
fn a_pendulum_has_the_period_of_the_elliptic_integral() {
    let pendulum = system(&["theta"], "theta_dot^2/2 + 9.81*cos(theta)");
    let (mut a, mut b) = (1.0f64, (0.6f64).cos());
    for _ in 0..6 {
        (a, b) = ((a + b) / 2.0, (a * b).sqrt());
    }
    let period = TAU / 9.81f64.sqrt() / a;
    for method in [Integrator::Dop853, Integrator::Gauss6] {
        let rest = Event::new("rest", |_, _: &[f64], v: &[f64]| v[0]);
        let found = rollout(&pendulum, &[1.2], &[0.0], &options(method, 3.1 * period, vec![rest]));
        assert_eq!(found.events.len(), 6);
        for (k, event) in found.events.iter().enumerate() {
            let exact = 0.5 * period * (k as f64 + 1.0);
            assert!((event.t - exact).abs() < 1e-10, "{method:?} {k}: {:e}", event.t - exact);
        }
    }
}

#[test]
fn an_impact_on_a_slope_keeps_the_momentum_along_it() {
    let (e, n) = (0.6, [1.0, 0.5]);
    let coupled = system(&["x", "y"], "x_dot^2/2 + 0.4*x_dot*y_dot + y_dot^2 - 9.81*y");
    let mass = [[1.0, 0.4], [0.4, 2.0]];
    for method in Integrator::ALL {
        let slope = Event::new("slope", move |_, q: &[f64], _: &[f64]| n[0] * q[0] + n[1] * q[1]).restitution(e);
        let found = rollout(&coupled, &[0.3, 1.0], &[0.2, 0.1], &options(method, 3.0, vec![slope]));
        let event = &found.events[0];
        let impact = event.impact.as_ref().unwrap();
        let momentum = |v: &[f64]| [mass[0][0] * v[0] + mass[0][1] * v[1], mass[1][0] * v[0] + mass[1][1] * v[1]];
        let (before, after) = (momentum(&impact.v_before), momentum(&event.v));
        let along = |p: [f64; 2]| p[0] * n[1] - p[1] * n[0];
        assert!((along(before) - along(after)).abs() < 1e-10, "{method:?}");
        let speed = |v: &[f64]| n[0] * v[0] + n[1] * v[1];
        let u = speed(&impact.v_before);
        assert!((speed(&event.v) + e * u).abs() < 1e-10, "{method:?}");
        // n.M^-1 n.
        let determinant = mass[0][0] * mass[1][1] - mass[0][1] * mass[1][0];
        let inverse =
            (mass[1][1] * n[0] * n[0] - 2.0 * mass[0][1] * n[0] * n[1] + mass[0][0] * n[1] * n[1]) / determinant;
        assert!((impact.lost() - (1.0 - e * e) / 2.0 * u * u / inverse).abs() < 1e-10, "{method:?}");
    }
    // A wall that comes nearer takes the ball along: v becomes 2 u - v.
    let free = system(&["x"], "x_dot^2/2");
    let wall = Event::new("wall", |t, q: &[f64], _: &[f64]| q[0] + 0.5 * t - 3.0).restitution(1.0);
    let found = rollout(&free, &[0.0], &[1.0], &options(Integrator::Dopri5, 3.0, vec![wall]));
    assert!((found.events[0].t - 2.0).abs() < 1e-12 && (found.events[0].v[0] + 2.0).abs() < 1e-10);
}

#[test]
fn a_rod_that_holds_the_ball_holds_it_at_an_impact() {
    let rod: Box<dyn EulerLagrange<f64>> = SystemInstance::named("cartesian-chain-1", &[]).unwrap().build().unwrap();
    let start = ([0.6, -0.8], [0.0, 0.0]);
    for method in [Integrator::Dop853, Integrator::Gauss6] {
        let wall = Event::new("wall", |_, q: &[f64], _: &[f64]| q[0]).falling().restitution(0.9);
        let Rollout { trajectory, events, stop, .. } =
            rollout(&*rod, &start.0, &start.1, &options(method, 3.0, vec![wall]));
        assert!(stop.is_none() && events.len() > 2, "{method:?} {stop:?}");
        for event in &events {
            let before = event.impact.as_ref().unwrap().v_before[0];
            assert!((event.v[0] + 0.9 * before).abs() < 1e-9 && event.v[1].abs() < 1e-9, "{method:?} {event:?}");
        }
        let length = |q: &[f64]| (q[0] * q[0] + q[1] * q[1] - 1.0).abs();
        assert!(trajectory.q.chunks(2).all(|q| length(q) < 1e-9 && q[0] > -1e-9), "{method:?}");
    }
}

#[test]
fn a_motion_ends_at_an_event_and_its_samples_stay_where_they_are() {
    for method in Integrator::ALL {
        let stopped = rollout(&ball(), &[1.0], &[0.0], &options(method, 4.0, vec![ground(0.8).stop_after(3)]));
        let t = &stopped.trajectory.t;
        assert!(stopped.stop.is_none() && stopped.events.len() == 3);
        assert_eq!(t.last(), Some(&stopped.events[2].t));
        assert_eq!(stopped.trajectory.v.last(), stopped.events[2].v.last());
        assert!(
            t[..t.len() - 1].iter().enumerate().all(|(k, t)| *t == 0.01 * k as f64) && t.len() == 177,
            "{}",
            t.len()
        );
        let far = Event::new("far", |t, _: &[f64], _: &[f64]| t - 0.205).stop();
        let stopped = rollout(&ball(), &[1.0], &[0.0], &options(method, 4.0, vec![far]));
        let y = stopped.trajectory.q.last().unwrap();
        assert!((y - 1.0 + 9.81 / 2.0 * 0.205 * 0.205).abs() < 1e-10 && stopped.trajectory.len() == 22);
        // What is only marked changes nothing.
        let spring = system(&["x"], "x_dot^2/2 - x^2/2 - x^4/4");
        let mark = Event::new("mark", |_, q: &[f64], _: &[f64]| q[0] - 0.1);
        let marked = rollout(&spring, &[1.0], &[0.0], &options(method, 5.0, vec![mark]));
        let free = rollout(&spring, &[1.0], &[0.0], &options(method, 5.0, vec![]));
        let near = marked.trajectory.q.iter().zip(&free.trajectory.q).all(|(a, b)| (a - b).abs() < 1e-13);
        let same = if method.is_structure_preserving() { near } else { marked.trajectory == free.trajectory };
        assert!(same && marked.trajectory.t == free.trajectory.t && marked.events.len() == 2, "{method:?}");
    }
}

#[test]
fn two_crossings_in_one_step_and_two_events_at_one_time_are_found() {
    let spring = system(&["x"], "x_dot^2/2 - x^2/2");
    for (method, step) in [(Integrator::Dop853, None), (Integrator::Dopri5, None), (Integrator::Gauss6, Some(0.5))] {
        let top = Event::new("top", |_, q: &[f64], _: &[f64]| q[0] - 0.99);
        let same = |factor: f64| move |_: f64, q: &[f64], _: &[f64]| factor * q[0];
        let events = vec![top, Event::new("a", same(1.0)), Event::new("b", same(2.0))];
        let options = options(method, 20.0, events).dt(0.5).step(step).tolerances(1e-8, 1e-8);
        let found = rollout(&spring, &[0.0], &[1.0], &options);
        let width = 0.99f64.acos();
        let exact: Vec<f64> = (0..3).flat_map(|k| [-width, width].map(|w| PI / 2.0 + TAU * f64::from(k) + w)).collect();
        let near = |found: &[f64], exact: &[f64]| {
            found.len() == exact.len() && found.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-5)
        };
        assert!(near(&times(&found.events, "top"), &exact), "{method:?} {:?}", times(&found.events, "top"));
        let zeros: Vec<f64> = (1..7).map(|k| PI * f64::from(k)).collect();
        assert!(near(&times(&found.events, "a"), &zeros) && near(&times(&found.events, "b"), &zeros), "{method:?}");
        assert!(found.events.windows(2).all(|pair| pair[0].t <= pair[1].t));
    }
    // Backwards the number rises in time where it falls along the way.
    let rising = Event::new("rising", |_, q: &[f64], _: &[f64]| q[0]).rising();
    let found = rollout(&spring, &[0.0], &[1.0], &options(Integrator::Dop853, -7.0, vec![rising]));
    assert!(found.events.len() == 1 && (found.events[0].t + TAU).abs() < 1e-10, "{:?}", found.events);
}

#[test]
fn impacts_that_accumulate_end_the_motion_where_they_do() {
    let says = |found: &Rollout<f64>, part: &str| match &found.stop {
        Some(RolloutError::Event { problem, t, .. }) if problem.contains(part) => *t,
        other => panic!("{other:?}"),
    };
    for method in Integrator::ALL {
        let found = rollout(&ball(), &[1.0], &[0.0], &options(method, 10.0, vec![ground(0.5)]));
        let t = says(&found, "accumulate");
        assert!((t - 3.0 * fall()).abs() < 1e-7 && found.events.len() < 40, "{method:?} {t} {}", 3.0 * fall());
        assert!(found.trajectory.t.last().unwrap() < &t);
        for e in [0.0, 0.7] {
            let resting = rollout(&ball(), &[0.0], &[0.0], &options(method, 1.0, vec![ground(e)]));
            assert!(says(&resting, "accumulate").abs() < 1e-7, "{method:?}");
            let dropped = rollout(&ball(), &[1.0], &[0.0], &options(method, 1.0, vec![ground(0.0)]));
            assert!((says(&dropped, "accumulate") - fall()).abs() < 1e-7 && dropped.events.len() == 1, "{method:?}");
        }
    }
}

#[test]
fn impacts_that_make_no_sense_are_refused() {
    let refused = |event: Event<f64>, t_end: f64, part: &str| {
        let stop = rollout(&ball(), &[1.0], &[0.0], &options(Integrator::Dopri5, t_end, vec![event])).stop;
        let text = stop.unwrap().to_string();
        assert!(text.contains(part), "{text}");
    };
    refused(ground(1.2), 1.0, "from 0 to 1, found 1.2");
    refused(ground(0.5), -1.0, "forwards");
    let moving = Event::new("moving", |_, q: &[f64], v: &[f64]| q[0] + 0.1 * v[0]).restitution(0.5);
    refused(moving, 1.0, "depends on velocities");
    let flat = Event::new("flat", |t, _: &[f64], _: &[f64]| t - 0.3).restitution(0.5);
    refused(flat, 1.0, "no direction");
}
