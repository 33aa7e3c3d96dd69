//! Examples: each asserts its own result; those that need arguments are given them.

#[allow(dead_code, reason = "its functions are called")]
#[path = "../../../examples/arms.rs"]
mod arms;
#[path = "../../../examples/formula.rs"]
mod formula;
#[allow(dead_code, reason = "its functions are called")]
#[path = "../../../examples/gps.rs"]
mod gps;
#[path = "../../../examples/implicit_solver.rs"]
mod implicit_solver;
#[path = "../../../examples/kalman.rs"]
mod kalman;
#[allow(dead_code, reason = "its functions are called")]
#[path = "../../../examples/load_model.rs"]
mod load_model;
#[allow(dead_code, reason = "its functions are called")]
#[path = "../../../examples/make_data.rs"]
mod make_data;
#[allow(dead_code, reason = "its functions are called")]
#[path = "../../../examples/mercury.rs"]
mod mercury;
#[path = "../../../examples/nalgebra_matrices.rs"]
mod nalgebra_matrices;
#[path = "../../../examples/other_solver.rs"]
mod other_solver;
#[path = "../../../examples/own_lagrangian.rs"]
mod own_lagrangian;
#[path = "../../../examples/own_optimizer.rs"]
mod own_optimizer;
#[path = "../../../examples/own_solver.rs"]
mod own_solver;
#[path = "../../../examples/swing_up.rs"]
mod swing_up;
#[path = "../../../examples/system_identification.rs"]
mod system_identification;

#[allow(dead_code, reason = "its functions are tested")]
#[path = "../../../examples/pendulum_video.rs"]
mod pendulum_video;

use pendulum_video::{Down, convert, fit, pull, read};
use std::f64::consts::TAU;

#[test]
fn an_integrator_of_ode_solvers_moves_a_cart_and_a_pendulum() {
    own_solver::main().unwrap();
}

#[test]
fn an_implicit_integrator_moves_carts_on_a_stiff_damper() {
    implicit_solver::main().unwrap();
}

#[test]
fn an_integrator_of_another_crate_moves_a_learned_pendulum() {
    other_solver::main().unwrap();
}

#[test]
fn a_filter_follows_an_angle_that_is_not_measured() {
    kalman::main().unwrap();
}

#[test]
fn a_controller_swings_a_learned_pendulum_up() {
    swing_up::main().unwrap();
}

#[test]
fn a_lagrangian_of_ones_own_is_learned_and_solved() {
    own_lagrangian::main().unwrap();
}

#[test]
fn a_solver_of_ones_own_trains_a_network() {
    own_optimizer::main().unwrap();
}

#[test]
fn argmin_identifies_a_system() {
    system_identification::main().unwrap();
}

#[test]
fn a_recorded_arm_is_read_as_a_formula() {
    formula::main().unwrap();
}

#[test]
fn orbits_that_are_read_from_text_weigh_the_earth() {
    let text = "#cP2010\n*  2010  6 30 23 45  0.00000000\nPG01  18392.619117   7490.690408 -17846.346485 999999.999999\n\
        *  2010  7  1  0  0  0.00000000\nPG01  18392.619118   7490.690408 -17846.346485\nPG02      0.000000      0.000000      0.000000\n";
    let tracks = gps::read(text).unwrap();
    assert_eq!((tracks.len(), &tracks[0].times[..]), (1, &[85_500.0, 86_400.0][..]));
    let place = [18_392_619.117, 7_490_690.408, -17_846_346.485];
    assert!(tracks[0].q.iter().zip(place).all(|(q, exact)| (q - exact).abs() < 1e-6), "{:?}", tracks[0].q);
    // Sun and Moon pull a satellite by some millionths of its acceleration of 0.56 m/s^2.
    let pull = tracks[0].force[..3].iter().map(|f| f * f).sum::<f64>().sqrt();
    assert!((1e-7..1e-5).contains(&pull), "{pull}");
    let wrong = text.replace("7490.690408 -17846.346485\n", "7490.690408 -17846.34x485\n");
    assert!(gps::read(&wrong).unwrap_err().to_string().contains("row 5"));
    gps::made().unwrap();
}

#[test]
fn a_planets_orbit_tells_the_first_order_of_general_relativity() {
    let [precession, error, einstein] = mercury::show(&mercury::made().unwrap()).unwrap();
    assert!((precession - einstein).abs() < 0.1 && error < 0.1, "{precession} +- {error}, {einstein}");
    assert!((einstein - 43.0).abs() < 1.0, "{einstein}");
    let names: Vec<String> = ["mercury", "venus", "earthmoon", "mars", "jupiter", "saturn", "uranus", "neptune"]
        .iter()
        .flat_map(|planet| ["x", "y", "z"].map(|axis| format!("{planet}_{axis}")))
        .collect();
    let place = |k: usize| ((k + 1) as f64 * 5e7).to_string();
    let row = |day: &str| format!("{day},{}\n", (0..24).map(place).collect::<Vec<_>>().join(","));
    let text = format!("jd,{}\n{}{}", names.join(","), row("2451545"), row("2451545.5"));
    let track = mercury::read(&text).unwrap();
    assert_eq!((&track.times[..], track.q.len(), track.force.len()), (&[0.0, 0.5][..], 6, 6));
    assert!((track.q[1] - 1e8 / 149_597_870.7).abs() < 1e-9, "{:?}", track.q);
    assert!(mercury::read(&text.replace("2451545.5", "soon")).unwrap_err().to_string().contains("row 3"));
    assert!(mercury::read(&text.replace("mars_y", "mars")).unwrap_err().to_string().contains("mars_y"));
}

#[test]
fn a_network_and_the_textbook_predict_arms() {
    arms::made().unwrap();
}

#[test]
fn a_stored_model_is_loaded() {
    load_model::show(load_model::SHIPPED).unwrap();
}

#[test]
fn nalgebra_takes_the_matrices() {
    nalgebra_matrices::main().unwrap();
}

#[test]
fn the_shipped_recording_is_the_made_one() {
    make_data::compare(&make_data::made().unwrap()).unwrap();
}

/// Frames of a film at 400 Hz: arms, place of the pivot, angles over time; markers are found to the pixel.
fn film(
    count: usize,
    arms: [f64; 2],
    pivot: impl Fn(f64) -> [f64; 2],
    angles: impl Fn(f64) -> [f64; 2],
) -> Vec<[f64; 6]> {
    let frame = |k: usize| {
        let t = k as f64 / 400.0;
        let (p, [first, second]) = (pivot(t), angles(t));
        let elbow = [p[0] + arms[0] * first.sin(), p[1] + arms[0] * first.cos()];
        let end = [elbow[0] + arms[1] * second.sin(), elbow[1] + arms[1] * second.cos()];
        [p, elbow, end].as_flattened().iter().map(|x| x.round()).collect::<Vec<_>>().try_into().unwrap()
    };
    (0..count).map(frame).collect()
}

/// Swings, and turns over several times.
fn motion(t: f64) -> [f64; 2] {
    [2.0 * (3.1 * t).sin() + 0.4, 2.2 * t + (5.3 * t).sin()]
}

#[test]
fn a_film_gives_arms_and_angles() {
    let arms = [602.0, 461.0];
    // A pivot that sways by eight pixels once a second.
    let frames = film(4000, arms, |t| [1200.0 + 8.0 * (TAU * t).sin(), 1220.0], motion);
    let film = fit(&frames, Down::Bottom).unwrap();
    assert!(film.window > 1 && film.window < 40, "averaged over {} frames", film.window);
    // Rounding to a pixel has a variance of 1/12 in each direction: 1/12 to 1/6 along an arm, by the noise of its ends.
    for ((length, scatter), arm) in film.arms.iter().zip(arms) {
        assert!((length - arm).abs() < 0.05 && (0.26..0.45).contains(scatter), "{length} +- {scatter} for {arm}");
    }
    // At most half a pixel off in each direction at either end, and what the sway makes of the averaged pivot.
    for (k, found) in film.angles.iter().enumerate() {
        for ((found, true_angle), arm) in found.iter().zip(motion(k as f64 / 400.0)).zip(arms) {
            assert!((found - true_angle).abs() < (2.0_f64.sqrt() + 0.5) / arm, "frame {k}: {found} for {true_angle}");
        }
    }
    assert!(film.angles[3999][1] > 3.0 * TAU, "turns must add up");
}

#[test]
fn the_noise_of_a_pivot_at_rest_is_averaged_away() {
    // Noise of two pixels rms without memory, from the fractional parts of multiples of the golden ratio.
    let noise = |t: f64, shift: f64| (((400.0 * t).round() * 0.618_033_988_75 + shift).fract() - 0.5) * 48.0_f64.sqrt();
    let mut frames = film(2000, [300.0, 200.0], |_| [500.0, 500.0], motion);
    for (k, frame) in frames.iter_mut().enumerate() {
        let t = k as f64 / 400.0;
        (frame[0], frame[1]) = (frame[0] + noise(t, 0.1), frame[1] + noise(t, 0.7));
    }
    let film = fit(&frames, Down::Bottom).unwrap();
    let (length, scatter) = film.arms[0];
    assert!(film.window > 8 && (length - 300.0).abs() < 0.1 && scatter < 0.4, "{length} +- {scatter}, {}", film.window);
}

#[test]
fn films_that_are_none_are_refused_by_row_and_column() {
    let refusal = |text: &str| read(text).unwrap_err();
    assert_eq!(refusal("1,2,3,4,5,6\n1,2,x,4,5,6"), "row 2, column 3: expected a finite number, found \"x\"");
    assert_eq!(refusal("1,2,3,4,5,nan"), "row 1, column 6: expected a finite number, found \"nan\"");
    assert_eq!(refusal("1,2,3,4,5,6\n\n1,2,3,4,5"), "row 3: expected 6 numbers, found 5");
    assert_eq!(refusal("1,2,3,4,5,6,7"), "row 1: expected 6 numbers, found 7");
    assert!(fit(&[], Down::Bottom).is_none());
    let arguments = |list: &[&str]| list.iter().map(|a| a.to_string()).collect::<Vec<_>>();
    for bad in [
        &["a"][..],
        &["a", "b", "--rate", "400", "--down", "z"],
        &["a", "b", "--rate", "0"],
        &["a", "b", "--rate", "x"],
        &["a", "b", "--rat", "400"],
    ] {
        assert!(convert(&arguments(bad)).is_err(), "{bad:?}");
    }
}

/// Angles of a double pendulum of two equal arms and `g/l = 50` per s^2 at 400 Hz, from rest at 2 and 2.5 rad.
fn pendulum() -> Vec<[f64; 2]> {
    let slope = |[q1, q2, v1, v2]: [f64; 4]| {
        let (sine, cosine) = (q1 - q2).sin_cos();
        let (r1, r2) = (-0.5 * sine * v2 * v2 - 50.0 * q1.sin(), 0.5 * sine * v1 * v1 - 25.0 * q2.sin());
        let determinant = 0.5 - (0.5 * cosine).powi(2);
        [v1, v2, (0.5 * r1 - 0.5 * cosine * r2) / determinant, (r2 - 0.5 * cosine * r1) / determinant]
    };
    let add = |x: [f64; 4], h: f64, k: [f64; 4]| [0, 1, 2, 3].map(|i| x[i] + h * k[i]);
    let (mut x, mut angles, h) = ([2.0, 2.5, 0.0, 0.0], Vec::new(), 1.0 / 1600.0);
    for step in 0..8000 {
        if step % 4 == 0 {
            angles.push([x[0], x[1]]);
        }
        let k1 = slope(x);
        let (k2, k3) = (slope(add(x, h / 2.0, k1)), slope(add(x, h / 2.0, slope(add(x, h / 2.0, k1)))));
        let k4 = slope(add(x, h, k3));
        x = [0, 1, 2, 3].map(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    angles
}

#[test]
fn the_motion_says_where_down_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let angles = pendulum();
    for (name, axis) in [("x", [1.0, 0.0]), ("-x", [-1.0, 0.0]), ("y", [0.0, 1.0]), ("-y", [0.0, -1.0])] {
        // A quarter turn counterclockwise for the eye, y pointing down the picture.
        let turned =
            |angle: f64, l: f64| [0, 1].map(|i| l * (angle.cos() * axis[i] + angle.sin() * [axis[1], -axis[0]][i]));
        let line = |[first, second]: &[f64; 2]| {
            let (elbow, end) = (turned(*first, 600.0), turned(*second, 400.0));
            format!("0,0,{},{},{},{}\n", elbow[0], elbow[1], elbow[0] + end[0], elbow[1] + end[1])
        };
        std::fs::write(path("film.csv"), angles.iter().map(line).collect::<String>()).unwrap();
        for down in ["x", "-x", "y", "-y"] {
            let _ = std::fs::remove_file(path("angles.csv"));
            let given =
                [path("film.csv"), path("angles.csv"), "--rate".into(), "400".into(), "--down".into(), down.into()];
            let said = convert(&given).map_err(|e| e.to_string());
            if down == name {
                assert!(said.as_ref().is_ok_and(|said| said.ends_with(&format!("down is {name}"))), "{said:?}");
                let csv = std::fs::read_to_string(path("angles.csv")).unwrap();
                let first: Vec<f64> = csv.lines().nth(1).unwrap().split(',').map(|x| x.parse().unwrap()).collect();
                assert_eq!(first, [0.0, 2.0, 2.5]);
            } else {
                assert!(said.as_ref().is_err_and(|said| said.ends_with(&format!("give --down {name}"))), "{said:?}");
            }
        }
    }
    let [x, y] = pull(&angles, Down::Right, 400.0).unwrap();
    assert!((x - 50.0).abs() < 1.0 && y.abs() < 0.5, "{x} {y}");
}

#[test]
fn a_film_becomes_a_csv_of_angles() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let lines: Vec<String> = film(40, [600.0, 400.0], |_| [0.0, 0.0], motion)
        .iter()
        .map(|frame| frame.map(|x| x.to_string()).join(","))
        .collect();
    std::fs::write(path("film.csv"), lines.join("\n")).unwrap();
    let report = convert(&[path("film.csv"), path("angles.csv"), "--rate".into(), "400".into()]).unwrap();
    assert!(report.starts_with("40 frames, ") && report.contains("arms 600.0"), "{report}");
    // Neither the film nor what is there already is overwritten.
    for taken in ["film.csv", "angles.csv"] {
        let error = convert(&[path("film.csv"), path(taken), "--rate".into(), "400".into()]).unwrap_err().to_string();
        assert!(error.contains(taken), "{error}");
    }
    assert_eq!(std::fs::read_to_string(path("film.csv")).unwrap(), lines.join("\n"));
    let csv = std::fs::read_to_string(path("angles.csv")).unwrap();
    let mut rows = csv.lines();
    assert_eq!(rows.next(), Some("t,theta1,theta2"));
    let last: Vec<f64> = rows.last().unwrap().split(',').map(|x| x.parse().unwrap()).collect();
    let [first, second] = motion(39.0 / 400.0);
    assert!(last[0] == 0.0975 && (last[1] - first).abs() < 0.005 && (last[2] - second).abs() < 0.005, "{last:?}");
}

/// Films of a real double pendulum, where they lie beside the project.
#[test]
fn the_arms_of_a_real_pendulum_are_rigid() {
    let folder =
        std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("../shared/data/ibm-double-pendulum");
    for name in ["0.csv", "1.csv", "2.csv"] {
        let Ok(text) = std::fs::read_to_string(folder.join(name)) else {
            eprintln!("skipped: {} is not there", folder.join(name).display());
            continue;
        };
        let frames = read(&text).unwrap();
        let film = fit(&frames, Down::Bottom).unwrap();
        let [(l1, s1), (l2, s2)] = film.arms;
        println!("{name}: {} frames, window {}, {l1:.2} +- {s1:.2}, {l2:.2} +- {s2:.2}", frames.len(), film.window);
        assert!(s1 / l1 < 0.004 && s2 / l2 < 0.004 && (l1 / l2 - 1.307).abs() < 0.003);
        let steps = film.angles.windows(2).flat_map(|w| [(w[1][0] - w[0][0]).abs(), (w[1][1] - w[0][1]).abs()]);
        assert!(steps.fold(0.0, f64::max) < 0.5, "an angle jumps");
        // Gravity pulls along the x axis of these pictures, and the angles say so from wherever they are counted.
        let [x, y] = pull(&film.angles, Down::Bottom, 400.0).unwrap();
        assert!((x - 69.3).abs() < 0.5 && (y - 0.1).abs() < 0.5, "{name}: {x} {y}");
    }
}
