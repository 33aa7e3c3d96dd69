use super::*;

fn plot(points: &[(f64, f64)], log_y: bool) -> Result<Picture, PlotError> {
    let series = vec![Series { name: "a".into(), points: points.to_vec(), over: false }];
    let [title, x_label, y_label] = ["T", "t [s]", "y [m]"].map(String::from);
    line_plot(&LinePlot { title, x_label, y_label, log_y, series, turn: None, level: None })
}

/// `true` if it is drawn and no number in it is none.
fn is_sound(picture: &Picture) -> bool {
    let svg = picture.to_svg();
    svg.starts_with("<svg xmlns") && svg.ends_with("</svg>\n") && !svg.contains("NaN") && !svg.contains("inf")
}

#[test]
fn strange_series_neither_hang_nor_panic() {
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    for log in [false, true] {
        for empty in [&[][..], &[(0.0, nan)], &[(nan, 1.0)], &[(0.0, inf), (1.0, -inf)]] {
            assert_eq!(plot(empty, log), Err(PlotError::Empty("T".into())));
        }
        for good in [
            &[(0.0, 1.0)][..],
            &[(0.0, 5.0), (1.0, 5.0), (2.0, 5.0)],
            &[(0.0, 1.0), (1.0, inf), (2.0, nan), (3.0, 2.0), (4.0, 3.0)],
            &[(0.0, 1e-300), (1.0, 1e140), (2.0, 1e300)],
            &[(0.0, 0.0), (1.0, -1.0), (2.0, 1.0)],
            &[(7.0, 1e-12), (7.0, 2e-12)],
        ] {
            assert!(is_sound(&plot(good, log).unwrap()), "{good:?}");
        }
    }
    assert!(plot(&[(0.0, 0.0), (1.0, -1.0)], true).is_err());
}

#[test]
fn labels_are_drawn_once() {
    let svg = plot(&[(0.0, 1.0), (1.0, 2.0)], false).unwrap().to_svg();
    for label in ["T", "t [s]", "y [m]"] {
        assert_eq!(svg.matches(&format!(">{label}</text>")).count(), 1, "{label}");
    }
}

#[test]
fn strange_grids_neither_hang_nor_panic() {
    let map = |values: Vec<f64>| HeatMap {
        title: "G".into(),
        x_label: "x".into(),
        y_label: "y".into(),
        grid: Grid { x: vec![0.0, 1.0], y: vec![0.0, 1.0], values },
        range: None,
        diverging: false,
        marks: vec![(0.0, 1.0)],
    };
    for values in [vec![1.0; 4], vec![f64::NAN, 1.0, 2.0, f64::INFINITY], vec![0.0; 4]] {
        let both = [map(values.clone()), HeatMap { diverging: true, ..map(values) }];
        let picture = heat_maps(&both).unwrap();
        assert!(is_sound(&picture) && picture.panels() == 2);
    }
    assert!(heat_maps(&[map(vec![f64::NAN; 4])]).is_err());
    assert!(heat_maps(&[map(vec![1.0; 3])]).is_err());
    assert!(heat_maps(&[]).is_err());
}

#[test]
fn traces() {
    let circle: Vec<_> = (0..500).map(|k| ((0.05 * f64::from(k)).cos(), (0.05 * f64::from(k)).sin())).collect();
    let path = |points| Series { name: "p".into(), points, over: false };
    let labels = ["T", "x", "y"].map(String::from);
    let trace = |paths| {
        let [title, x_label, y_label] = labels.clone();
        trace_plot(&Trace { title, x_label, y_label, paths, equal: true, turn: None })
    };
    assert!(is_sound(&trace(vec![path(circle), path(vec![])]).unwrap()));
    assert!(is_sound(&trace(vec![path(vec![(0.0, 0.0)])]).unwrap()));
    assert!(trace(vec![]).is_err());
    // A path that runs away does not shrink the first one; one that never comes near leaves its panel out.
    let line = |from: f64, to: f64| path(vec![(0.0, from), (1.0, to)]);
    let of = |paths: &[Series]| window(paths, |p| p.1).unwrap();
    assert_eq!(of(&[line(0.0, 2.0), line(1.0, 1e100)]), (0.0, 4.0));
    assert_eq!(of(&[line(0.0, 2.0), line(-1.0, 1.0)]), (-1.0, 2.0));
    assert_eq!(of(&[path(vec![]), line(-1.0, 7.0)]), (-1.0, 7.0));
    assert_eq!(trace(vec![line(0.0, 2.0), line(1e9, 1e10)]).unwrap().panels(), 1);
}

#[test]
fn long_series_are_small_and_stay_true() {
    // A slow wave of a hundred thousand points, and one that no eye resolves.
    let wave = |turns: f64| -> Vec<(f64, f64)> {
        (0..100_000).map(|k| (f64::from(k), (turns * f64::from(k) / 1e5 * std::f64::consts::TAU).sin())).collect()
    };
    let size = |points: &[(f64, f64)]| plot(points, false).unwrap().to_svg().len();
    assert!(size(&wave(3.0)) < 10_000, "{}", size(&wave(3.0)));
    assert!(size(&wave(40_000.0)) < 60_000, "{}", size(&wave(40_000.0)));
}
