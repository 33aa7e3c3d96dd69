use super::*;

fn plot(points: &[(f64, f64)], log_y: bool) -> Result<Vec<u8>, PlotError> {
    let series = vec![Series { name: "a".into(), points: points.to_vec(), over: false }];
    line_png(&LinePlot { title: "T".into(), x_label: "t [s]".into(), y_label: "y".into(), log_y, series })
}

fn is_png(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG\r\n\x1a\n") && bytes.len() > 1000
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
            assert!(is_png(&plot(good, log).unwrap()), "{good:?}");
        }
    }
    assert!(plot(&[(0.0, 0.0), (1.0, -1.0)], true).is_err());
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
        assert!(is_png(&heat_maps_png(&both).unwrap()));
    }
    assert!(heat_maps_png(&[map(vec![f64::NAN; 4])]).is_err());
    assert!(heat_maps_png(&[map(vec![1.0; 3])]).is_err());
    assert!(heat_maps_png(&[]).is_err());
}

#[test]
fn traces() {
    let circle: Vec<_> = (0..500).map(|k| ((0.05 * f64::from(k)).cos(), (0.05 * f64::from(k)).sin())).collect();
    let path = |points| Series { name: "p".into(), points, over: false };
    let labels = ["T", "x", "y"].map(String::from);
    let trace = |paths| {
        let [title, x_label, y_label] = labels.clone();
        Trace { title, x_label, y_label, paths, equal: true }
    };
    assert!(is_png(&trace_png(&trace(vec![path(circle), path(vec![])])).unwrap()));
    assert!(is_png(&trace_png(&trace(vec![path(vec![(0.0, 0.0)])])).unwrap()));
    assert!(trace_png(&trace(vec![])).is_err());
    // A path that runs away does not shrink the first one; one that never comes near leaves its panel out.
    let line = |from: f64, to: f64| path(vec![(0.0, from), (1.0, to)]);
    let of = |paths: &[Series]| window(paths, |p| p.1).unwrap();
    assert_eq!(of(&[line(0.0, 2.0), line(1.0, 1e100)]), (0.0, 4.0));
    assert_eq!(of(&[line(0.0, 2.0), line(-1.0, 1.0)]), (-1.0, 2.0));
    assert_eq!(of(&[path(vec![]), line(-1.0, 7.0)]), (-1.0, 7.0));
    assert!(is_png(&trace_png(&trace(vec![line(0.0, 2.0), line(1e9, 1e10)])).unwrap()));
}

#[test]
fn ticks() {
    for (x, text) in
        [(0.0, "0"), (0.1 + 0.2, "0.3"), (-2.5, "\u{2212}2.5"), (1000.0, "1000"), (1e6, "1e6"), (2e-5, "2e-5")]
    {
        assert_eq!(number(x), text);
    }
    for (x, text) in [(1e-6, "1e-6"), (0.1, "0.1"), (1.0, "1"), (1e4, "1e4")] {
        assert_eq!(decade(x), text);
    }
}

#[test]
fn long_series_are_thinned_and_keep_their_ends() {
    let points: Vec<_> = (0..100_000).map(|k| (f64::from(k), 1.0)).collect();
    let runs = runs(&points);
    assert!(runs.len() == 1 && runs[0].len() <= MAX_POINTS + 1);
    assert_eq!(runs[0].last().unwrap().0, 99_999.0);
}
