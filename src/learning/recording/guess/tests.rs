use super::*;
use std::fs;

/// The guess for a text.
fn of(text: &str, given: &Columns) -> Result<Guess, DataError> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("motion.csv");
    fs::write(&file, text).unwrap();
    Guess::of(&[&file], given)
}

fn list(names: &[&str]) -> Vec<String> {
    names.iter().map(ToString::to_string).collect()
}

/// Rows of a table by time.
fn rows(header: &str, count: usize, row: impl Fn(f64) -> Vec<f64>) -> String {
    let line = |k: usize| row(0.01 * k as f64).iter().map(|x| format!("{x:.9}")).collect::<Vec<_>>().join(",") + "\n";
    format!("{header}\n") + &(0..count).map(line).collect::<String>()
}

#[test]
fn the_columns_of_a_pendulum_are_told_apart() {
    let text = rows("frame,t,theta1,theta2,theta1_dot,omega2,tau1,tau2,temperature", 300, |t| {
        let (a, b) = ((3.0 * t).sin(), (2.0 * t).cos());
        vec![
            (100.0 * t).round(),
            t,
            a,
            b,
            3.0 * (3.0 * t).cos(),
            -2.0 * (2.0 * t).sin(),
            t.sin(),
            t * t,
            20.0 + t.sin(),
        ]
    });
    let Guess { columns, table } = of(&text, &Columns::default()).unwrap();
    assert_eq!((columns.coords, columns.periodic), (list(&["theta1", "theta2"]), list(&["theta1", "theta2"])));
    assert_eq!((columns.velocity, columns.force), (list(&["theta1_dot", "omega2"]), list(&["tau1", "tau2"])));
    assert_eq!((columns.time.as_deref(), columns.trajectory), (Some("t"), None));
    let left: Vec<&str> =
        table.iter().filter(|guess| guess.meaning == "left out").map(|guess| guess.column.as_str()).collect();
    assert_eq!(left, ["frame", "temperature"]);
    assert_eq!(table.len(), 9);
}

#[test]
fn trajectories_restart_the_time() {
    let text = |label: &str| {
        let run = |k: usize| {
            let row =
                |at: usize| format!("{label}{k},{:.2},{:.6}\n", 0.01 * at as f64, (0.05 * at as f64 + k as f64).sin());
            (0..40).map(row).collect::<String>()
        };
        "which,seconds,x\n".to_string() + &(0..3).map(run).collect::<String>()
    };
    for label in ["", "swing "] {
        let columns = of(&text(label), &Columns::default()).unwrap().columns;
        assert_eq!(
            (columns.trajectory.as_deref(), columns.time.as_deref()),
            (Some("which"), Some("seconds")),
            "{label}"
        );
        assert_eq!(columns.coords, ["x"]);
    }
}

#[test]
fn degrees_and_milliseconds_are_seen() {
    let wrapped = rows("t_ms,heading,x", 400, |t| vec![1000.0 * t, (200.0 * t + 90.0) % 360.0, t.cos()]);
    let columns = of(&wrapped, &Columns::default()).unwrap().columns;
    assert_eq!((columns.coords, columns.periodic), (list(&["heading", "x"]), list(&["heading"])));
    let units = [("heading", "deg"), ("t_ms", "ms")].map(|(column, unit)| (column.to_string(), unit.to_string()));
    assert_eq!(columns.units, units);
    // In rad, by its name and by its jumps.
    let turns = rows("t,phi,s", 400, |t| vec![t, (4.0 * t) % std::f64::consts::TAU, t.sin()]);
    let columns = of(&turns, &Columns::default()).unwrap().columns;
    assert_eq!((columns.periodic, columns.units), (list(&["phi"]), vec![]));
    // An option is kept.
    let given = Columns { units: vec![("phi".into(), "turn".into())], rate: Some(50.0), ..Columns::default() };
    let columns = of(&turns.replace("t,", "extra,"), &given).unwrap().columns;
    assert_eq!((columns.rate, columns.time, columns.units), (Some(50.0), None, given.units));
}

#[test]
fn a_circle_has_two_coordinates() {
    // The position y is minus the derivative of x, and x the derivative of y.
    for header in ["t,x,y", "t,c1,b1"] {
        let text = rows(header, 700, |t| vec![t, t.cos(), t.sin()]);
        assert_eq!(of(&text, &Columns::default()).unwrap().columns.coords.len(), 2, "{header}");
    }
    // Without names, a column is a derivative only if no other reading explains it.
    let text = rows("0,1,0", 700, |t| vec![t + 0.01, (3.0 * t).cos(), -3.0 * (3.0 * t).sin()]);
    let columns = of(&text, &Columns::default()).unwrap().columns;
    assert_eq!((columns.coords, columns.velocity), (list(&["c2"]), list(&["c3"])));
}

#[test]
fn files_without_motion_are_refused() {
    let constant = rows("t,x", 50, |t| vec![t, 1.0]);
    let problem = of(&constant, &Columns::default()).unwrap_err().to_string();
    assert!(problem.contains("t, x"), "{problem}");
    assert!(of("", &Columns::default()).is_err());
    assert!(Guess::of::<&str>(&[], &Columns::default()).is_err());
}

#[test]
fn columns_without_names_get_some_and_fixed_points_are_left_out() {
    let text = rows("", 400, |t| {
        let angle = 2.0 * (3.0 * t).sin();
        vec![t, 1200.0 + 3.0 * (9.0 * t).sin(), 1200.0 + 500.0 * angle.sin(), 900.0 - 500.0 * angle.cos()]
    });
    let Guess { columns, table } = of(&text, &Columns::default()).unwrap();
    assert_eq!(columns.names, Some(list(&["c1", "c2", "c3", "c4"])));
    assert_eq!((columns.time.as_deref(), columns.coords), (Some("c1"), list(&["c3", "c4"])));
    assert_eq!(table[1].meaning, "left out");
    // A name that says position is trusted, and so are measured velocities.
    let named = of(&format!("t,x,c,d{text}"), &Columns::default()).unwrap();
    assert_eq!(named.columns.coords, list(&["x", "c", "d"]));
}

#[test]
fn a_joint_under_a_torque_turns() {
    let row = |t: f64| vec![t, (2.0 * t).sin(), (3.0 * t).cos(), t.sin(), 2.0 * t.cos()];
    let periodic = |header: &str| of(&rows(header, 300, row), &Columns::default()).unwrap().columns.periodic;
    assert_eq!(periodic("t,q1,q2,tau1,tau2"), list(&["q1", "q2"]));
    assert_eq!(periodic("t,q1,q2,force1,force2"), list(&[]));
    assert_eq!(periodic("t,slide,position,f,torque"), list(&["position"]));
}
