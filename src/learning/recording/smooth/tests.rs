use super::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Exact position, velocity and acceleration of two coordinates: `sin 3t + 0.4 cos 7t`, and half of it with twice the frequencies.
fn exact(t: f64) -> [[f64; 2]; 3] {
    let wave = |p: f64, s: f64| {
        let (a, b) = (3.0 * p, 7.0 * p);
        [
            s * ((a * t).sin() + 0.4 * (b * t).cos()),
            s * (a * (a * t).cos() - 0.4 * b * (b * t).sin()),
            s * (-a * a * (a * t).sin() - 0.4 * b * b * (b * t).cos()),
        ]
    };
    let (x, y) = (wave(1.0, 1.0), wave(2.0, 0.5));
    std::array::from_fn(|k| [x[k], y[k]])
}

fn track(times: Vec<f64>, sigma: f64, velocity_sigma: Option<f64>, seed: u64) -> RecordedTrajectory {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut noisy = |x: f64, sigma: f64| x + sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng);
    let q = times.iter().flat_map(|t| exact(*t)[0]).map(|x| noisy(x, sigma)).collect();
    let v = times.iter().flat_map(|t| exact(*t)[1]);
    let v = velocity_sigma.map(|sigma| v.map(|x| noisy(x, sigma)).collect()).unwrap_or_default();
    RecordedTrajectory { name: "waves".into(), times, q, v, a: vec![], force: vec![] }
}

fn recording(tracks: Vec<RecordedTrajectory>) -> Recording {
    Recording { coordinates: vec!["x".into(), "y".into()], periodic: vec![false; 2], tracks }
}

fn even(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|k| k as f64 * step).collect()
}

/// Root mean square error of the accelerations of coordinate `i` inside.
fn acceleration_error(smoothed: &Smoothed, i: usize) -> f64 {
    let inside = smoothed.interior();
    let sum: f64 = inside.clone().map(|k| (smoothed.a[2 * k + i] - exact(smoothed.times[k])[2][i]).powi(2)).sum();
    (sum / inside.len() as f64).sqrt()
}

/// Errors of position, velocity and acceleration of coordinate `i` over the stated ones, with or without bias, away from the ends.
fn relative_errors(smoothed: &Smoothed, i: usize, biased: f64) -> [Vec<f64>; 3] {
    let arrays = [
        (&smoothed.q, &smoothed.q_error, &smoothed.q_bias),
        (&smoothed.v, &smoothed.v_error, &smoothed.v_bias),
        (&smoothed.a, &smoothed.a_error, &smoothed.a_bias),
    ];
    std::array::from_fn(|k| {
        let (value, error, bias) = arrays[k];
        let relative = |s: usize| {
            let at = 2 * s + i;
            (value[at] - exact(smoothed.times[s])[k][i]) / error[at].hypot(biased * bias[at])
        };
        smoothed.interior().map(relative).collect()
    })
}

/// Share of the errors within a multiple of the stated ones.
fn within(relative: &[f64], times: f64) -> f64 {
    relative.iter().filter(|x| x.abs() <= times).count() as f64 / relative.len() as f64
}

#[test]
fn errors_are_as_large_as_said() {
    let uneven: Vec<f64> = even(4000, 0.01).iter().map(|t| t + 0.002 * (37.0 * t).sin()).collect();
    for (times, sigma, velocity_sigma) in [
        (even(4000, 0.01), 1e-3, None),
        (even(4000, 0.01), 1e-2, None),
        (uneven, 1e-3, None),
        (even(4000, 0.01), 1e-2, Some(0.05)),
    ] {
        let recording = recording(vec![track(times, sigma, velocity_sigma, 5)]);
        // A short window: noise alone. The chosen one: noise and bias, which is not a normal variable.
        for window in [Some(11), None] {
            let biased = if window.is_some() { 0.0 } else { 1.0 };
            let options = SmoothOptions { window, ..SmoothOptions::default() };
            let smoothing = Smoothing::choose(&recording, &options).unwrap();
            let smoothed = smoothing.apply(&recording.tracks[0]).unwrap();
            for i in 0..2 {
                let chosen = &smoothing.coordinates[i];
                assert!((chosen.noise.sigma / sigma - 1.0).abs() < 0.1, "{:?}", chosen.noise);
                let said = chosen.quality.total(2);
                let actual = acceleration_error(&smoothed, i);
                assert!((actual / said - 1.0).abs() < 0.25, "{sigma} {i}: error {actual}, said {said}");
                for (k, relative) in relative_errors(&smoothed, i, biased).iter().enumerate() {
                    // Errors are correlated over about half a window, which gives the number of independent ones.
                    let independent = 2.0 * relative.len() as f64 / chosen.quality.window as f64;
                    let scatter = |p: f64| 3.0 * (p * (1.0 - p) / independent).sqrt() + 0.01;
                    let (one, two) = (within(relative, 1.0), within(relative, 2.0));
                    println!("{sigma} {i} {k} {:?}: {one:.3} {two:.3}", chosen.quality.window);
                    assert!(two > 0.954 - scatter(0.954), "{sigma} {i} {k}: {two} within two");
                    if window.is_some() {
                        assert!((one - 0.683).abs() < scatter(0.683), "{sigma} {i} {k}: {one} within one");
                        assert!((two - 0.954).abs() < scatter(0.954), "{sigma} {i} {k}: {two} within two");
                    } else {
                        let size = crate::recording::statistics::rms(relative.iter().copied());
                        assert!((0.75..1.3).contains(&size), "{sigma} {i} {k}: errors {size} times as said");
                    }
                }
            }
        }
    }
}

#[test]
fn the_chosen_window_is_nearly_the_best() {
    for (sigma, step) in [(1e-4, 0.01), (1e-2, 0.01), (1e-3, 0.004), (1e-1, 0.008)] {
        let recording = recording(vec![track(even(3000, step), sigma, None, 9)]);
        let chosen = Smoothing::choose(&recording, &SmoothOptions::default()).unwrap();
        let error = |options: &SmoothOptions| {
            let smoothed = Smoothing::choose(&recording, options).unwrap().apply(&recording.tracks[0]).unwrap();
            [0, 1].map(|i| acceleration_error(&smoothed, i))
        };
        let mine = error(&SmoothOptions::default());
        let mut best = [f64::INFINITY; 2];
        for window in (7..160).step_by(6) {
            let found = error(&SmoothOptions { window: Some(window), ..SmoothOptions::default() });
            best = [best[0].min(found[0]), best[1].min(found[1])];
        }
        for i in 0..2 {
            let window = chosen.coordinates[i].quality.window;
            println!("{sigma} {step} {i}: window {window}, {:.4} of best", mine[i] / best[i]);
            assert!(mine[i] < 1.5 * best[i], "{sigma} {step} {i}: window {window}, {} of {}", mine[i], best[i]);
        }
    }
}

#[test]
fn noise_that_neighbours_share_is_no_bias_of_short_windows() {
    let mut motion = track(even(6000, 0.001), 2e-5, None, 3);
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut shared = [0.0; 2];
    for q in motion.q.chunks_exact_mut(2) {
        for (x, shared) in q.iter_mut().zip(&mut shared) {
            let draw: f64 = StandardNormal.sample(&mut rng);
            // Deviation 3e-4, which neighbours share but for a twentieth.
            *shared = 0.95 * *shared + 3e-4 * (1.0 - 0.95_f64.powi(2)).sqrt() * draw;
            *x += *shared;
        }
    }
    let recording = recording(vec![motion]);
    let smoothing = Smoothing::choose(&recording, &SmoothOptions::default()).unwrap();
    let smoothed = smoothing.apply(&recording.tracks[0]).unwrap();
    for (i, chosen) in smoothing.coordinates.iter().enumerate() {
        let (window, size) = (chosen.quality.window, chosen.quality.acceleration);
        assert!(window < 600 && chosen.quality.relative() < 0.1, "{window}");
        assert!(acceleration_error(&smoothed, i) < 0.05 * size, "{}", acceleration_error(&smoothed, i) / size);
    }
}

/// Kepler's ellipse of eccentricity 0.7 around a centre of mass 1, semi-major axis 1: position and acceleration.
fn kepler(t: f64) -> [[f64; 2]; 2] {
    let e: f64 = 0.7;
    let anomaly = (0..50).fold(t, |x, _| x - (x - e * x.sin() - t) / (1.0 - e * x.cos()));
    let (x, y) = (anomaly.cos() - e, (1.0 - e * e).sqrt() * anomaly.sin());
    let cube = x.hypot(y).powi(3);
    [[x, y], [-x / cube, -y / cube]]
}

#[test]
fn accelerations_of_an_eccentric_orbit_are_better_by_windows_that_vary() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let times = even(2000, 0.01);
    for sigma in [1e-4, 1e-3] {
        let mut normal = || sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng);
        let q = times.iter().flat_map(|t| kepler(*t)[0]).map(|x| x + normal()).collect();
        let name = "orbit".to_string();
        let recording =
            recording(vec![RecordedTrajectory { name, times: times.clone(), q, v: vec![], a: vec![], force: vec![] }]);
        let [varying, constant] = [true, false].map(|varying| {
            let smoothing = Smoothing::choose(&recording, &SmoothOptions::default()).unwrap();
            assert!(smoothing.varying);
            let smoothed = Smoothing { varying, ..smoothing }.apply(&recording.tracks[0]).unwrap();
            let mut errors: Vec<f64> = (100..1900)
                .map(|k| {
                    let [x, y] = kepler(times[k])[1];
                    (smoothed.a[2 * k] - x).hypot(smoothed.a[2 * k + 1] - y) / x.hypot(y)
                })
                .collect();
            crate::recording::statistics::median(&mut errors)
        });
        assert!(varying < 0.5 * constant, "{sigma}: {varying} {constant}");
    }
}

#[test]
fn windows_that_vary_do_no_harm_to_motion_of_even_pace() {
    for (sigma, seed) in [(1e-3, 1), (1e-2, 2)] {
        let recording = recording(vec![track(even(4000, 0.01), sigma, None, seed)]);
        let [varying, constant] = [true, false].map(|varying| {
            let smoothing = Smoothing::choose(&recording, &SmoothOptions::default()).unwrap();
            let smoothed = Smoothing { varying, ..smoothing }.apply(&recording.tracks[0]).unwrap();
            [0, 1].map(|i| acceleration_error(&smoothed, i))
        });
        for i in 0..2 {
            println!("{sigma} {i}: {:.3}", varying[i] / constant[i]);
            assert!(varying[i] < 1.2 * constant[i], "{sigma} {i}: {} {}", varying[i], constant[i]);
        }
    }
}

#[test]
fn measured_velocities_help() {
    let times = even(2000, 0.01);
    let with = recording(vec![track(times, 1e-2, Some(0.02), 1)]);
    let joint = Smoothing::choose(&with, &SmoothOptions::default()).unwrap();
    let alone = Smoothing::choose(&with, &SmoothOptions { velocities: false, ..SmoothOptions::default() }).unwrap();
    let error = |smoothing: &Smoothing| acceleration_error(&smoothing.apply(&with.tracks[0]).unwrap(), 0);
    assert!(error(&joint) < 0.6 * error(&alone), "{} {}", error(&joint), error(&alone));
    assert!((joint.coordinates[0].velocity_noise.unwrap().sigma / 0.02 - 1.0).abs() < 0.1);
}

#[test]
fn polynomials_come_back_at_the_ends_too() {
    for times in [even(40, 0.05), even(40, 0.05).iter().map(|t| t + 0.01 * (9.0 * t).sin()).collect()] {
        let quartic = |t: f64| 1.0 - t + 2.0 * t * t - t.powi(3) + 0.3 * t.powi(4);
        let second = |t: f64| 4.0 - 6.0 * t + 3.6 * t * t;
        let q = times.iter().flat_map(|t| [quartic(*t), 7.0]).collect();
        let track = RecordedTrajectory { name: "p".into(), times, q, v: vec![], a: vec![], force: vec![] };
        let recording = recording(vec![track]);
        let options = SmoothOptions { window: Some(11), noise: Some(vec![1.0, 1.0]), ..SmoothOptions::default() };
        let smoothed = Smoothing::choose(&recording, &options).unwrap().apply(&recording.tracks[0]).unwrap();
        assert_eq!((smoothed.margins, smoothed.interior()), ([5, 5], 5..35));
        for (k, t) in smoothed.times.iter().enumerate() {
            // A row of standard error `e` for noise 1 carries rounding of numbers below 2 this far.
            let tolerance = |e: f64| 64.0 * f64::EPSILON * e.max(1.0);
            let error = (smoothed.a[2 * k] - second(*t)).abs();
            assert!(error < tolerance(smoothed.a_error[2 * k]), "{k}: {error:e}");
            assert!((smoothed.q[2 * k] - quartic(*t)).abs() < tolerance(1.0));
            assert_eq!((smoothed.q[2 * k + 1], smoothed.a[2 * k + 1]), (7.0, 0.0));
        }
        assert!(smoothed.a_error[0] > 3.0 * smoothed.a_error[40]);
    }
}

#[test]
fn options_and_shapes_are_checked() {
    let good = recording(vec![track(even(40, 0.1), 1e-3, None, 1)]);
    let refused = |options: SmoothOptions| Smoothing::choose(&good, &options).unwrap_err().to_string();
    assert!(refused(SmoothOptions { degree: 9, ..Default::default() }).contains("degree: expected 2 to 8, found 9"));
    assert!(refused(SmoothOptions { window: Some(8), ..Default::default() }).contains("odd number"));
    assert!(refused(SmoothOptions { window: Some(41), ..Default::default() }).contains("fewer than the 41"));
    assert!(refused(SmoothOptions { noise: Some(vec![1.0]), ..Default::default() }).contains("2 numbers"));
    let smoothing = Smoothing::choose(&good, &SmoothOptions::default()).unwrap();
    let short = track(even(6, 0.1), 1e-3, None, 1);
    assert!(matches!(smoothing.apply(&short), Err(SmoothError::Short { samples: 6, needed: 7, .. })));
    let broken = RecordedTrajectory { q: vec![0.0; 3], ..good.tracks[0].clone() };
    assert!(matches!(smoothing.apply(&broken), Err(SmoothError::Shape { n: 2, .. })));
}
