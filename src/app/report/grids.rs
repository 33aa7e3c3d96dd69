//! Pictures of functions on a grid: learned and exact ones, one quantity over two coordinates, angles over one turn.

use super::{Figure, HeatMap, figure, file_part, heat_maps};
use crate::analysis::{Grid, Spread, affine_fit};
use crate::names::{number, rounded};
use std::f64::consts::{PI, TAU};

/// How a learned quantity is scaled for comparison with the exact one.
#[derive(Clone, Debug, PartialEq)]
pub enum Fit {
    /// By a known factor, described in words.
    Factor(f64, String),
    /// By the best factor and constant (`L`).
    Affine,
}

/// A quantity of the exact and of the learned model on the same grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridComparison {
    /// Name of the quantity, such as `L` or `det M`.
    pub quantity: String,
    /// Title of the picture.
    pub heading: String,
    /// Beginning of the file name.
    pub file: String,
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// Exact values.
    pub exact: Grid,
    /// Learned values.
    pub learned: Grid,
    /// Components that are fixed on the grid, in words (`v = 0 m/s`); may be empty.
    pub fixed: String,
    /// The fit applied before the comparison.
    pub fit: Fit,
    /// `true` to count and mark points where the learned value has the wrong sign.
    pub signs: bool,
}

/// Draws the exact grid, the learned one and their difference side by side, the first two with the same range of colours; `None` if a grid
/// has no finite value or the grids differ in size.
///
/// The range is that of the exact values; if learned values of the wrong sign are marked, it includes their change of sign.
pub fn grid_figures(comparison: &GridComparison) -> Option<Figure> {
    let GridComparison { quantity, exact, .. } = comparison;
    let (learned, how) = match &comparison.fit {
        Fit::Factor(factor, words) => (comparison.learned.map(|z| factor * z), format!("learned {words}")),
        Fit::Affine => {
            let fit = affine_fit(&comparison.learned.values, &exact.values)?;
            let numbers = [fit.a, fit.b.abs()].map(number);
            let sign = if fit.b < 0.0 { '\u{2212}' } else { '+' };
            let how = format!(
                "learned as {} {quantity} {sign} {}, the best fit (R\u{b2} = {:.6})",
                numbers[0], numbers[1], fit.r2
            );
            (comparison.learned.fitted(&fit), how)
        }
    };
    let difference = learned.minus(exact)?;
    let signs = if comparison.signs { learned.wrong_signs(exact) } else { None };
    let wrong = signs.iter().flatten().enumerate().filter(|(_, sign)| **sign == Some(true));
    let marks: Vec<(f64, f64)> = wrong.map(|(k, _)| exact.point(k)).collect();
    let zero = (!marks.is_empty()).then_some(0.0);
    let finite = exact.values.iter().copied().chain(zero).filter(|z| z.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)));
    let share = signs.map(|signs| 100.0 * marks.len() as f64 / signs.iter().flatten().count().max(1) as f64);
    let of_wrong_sign = share.filter(|&share| share > 0.0);
    let learned_title = match of_wrong_sign {
        Some(share) => format!("{quantity} learned, {share:.2} % of wrong sign"),
        None => format!("{quantity} learned"),
    };
    let labels = [comparison.x_label.clone(), comparison.y_label.clone()];
    let range = Some((low, high));
    let drawn = heat_maps(&[
        HeatMap { range, ..panel(format!("{quantity} exact"), &labels, exact) },
        HeatMap { range, marks, ..panel(learned_title, &labels, &learned) },
        difference_panel(&labels, &difference),
    ]);
    let fixed = if comparison.fixed.is_empty() { String::new() } else { format!(" at {}", comparison.fixed) };
    let signs = match (share, of_wrong_sign) {
        (_, Some(share)) => format!(" The learned value has the wrong sign at {share:.2} % of the points (dots)."),
        (Some(_), None) => " The learned value has the right sign at every point.".to_string(),
        (None, _) => String::new(),
    };
    let caption = format!("{quantity}{fixed}: exact, {how}, and the difference.{signs}");
    figure(&format!("{}.svg", comparison.file), comparison.heading.as_str(), drawn, caption)
}

/// A quantity over two coordinates.
#[derive(Clone, Debug)]
pub struct QuantityMap {
    /// Symbol, such as `R`.
    pub quantity: String,
    /// Heading of the picture, such as `Curvature scalar R of the metric`.
    pub about: String,
    /// Beginning of the file name; characters that file names cannot have are replaced.
    pub file: String,
    /// Labels of the horizontal and of the vertical axis, with units.
    pub labels: [String; 2],
    /// Values of the model.
    pub learned: Grid,
    /// Values of the system, if it is known.
    pub exact: Option<Grid>,
    /// Coordinates that are fixed, in words; may be empty.
    pub fixed: String,
    /// Further sentences of the caption; may be empty.
    pub remark: String,
    /// Points to mark in the learned map.
    pub marks: Vec<(f64, f64)>,
    /// `true` for every value of the learned map that the data do not determine; empty if they determine all.
    pub open: Vec<bool>,
}

/// Creates a panel without marks, whose colours span its own extremes.
pub(super) fn panel(title: impl Into<String>, [x_label, y_label]: &[String; 2], grid: &Grid) -> HeatMap {
    HeatMap {
        title: title.into(),
        x_label: x_label.clone(),
        y_label: y_label.clone(),
        grid: grid.clone(),
        range: None,
        diverging: false,
        marks: Vec::new(),
        open: Vec::new(),
    }
}

/// Creates the panel of a difference.
fn difference_panel(labels: &[String; 2], grid: &Grid) -> HeatMap {
    HeatMap { diverging: true, ..panel("learned \u{2212} exact", labels, grid) }
}

/// Draws the learned map, the exact one unless it is constant, and the difference; `None` if there is nothing finite to show. Colours
/// ignore the lowest and the highest hundredth of the values.
pub fn quantity_figure(map: &QuantityMap) -> Option<Figure> {
    let all = |grid: &Grid| Spread::of(&grid.values);
    let (learned, exact) = (all(&map.learned), map.exact.as_ref().map(all));
    let constant = exact.filter(|exact| exact.high - exact.low <= 1e-9 * exact.median.abs());
    let (mut low, mut high) = (learned.low, learned.high);
    if let Some(exact) = &exact {
        (low, high) = (low.min(exact.low), high.max(exact.high));
    }
    let same = |what: &str, grid: &Grid| HeatMap {
        range: Some((low, high)),
        ..panel(format!("{} {what}", map.quantity), &map.labels, grid)
    };
    let mut panels =
        vec![HeatMap { marks: map.marks.clone(), open: map.open.clone(), ..same("learned", &map.learned) }];
    if let Some(exact) = &map.exact {
        if constant.is_none() {
            panels.insert(0, same("exact", exact));
        }
        let difference = map.learned.minus(exact)?;
        let Spread { low, high, .. } = all(&difference);
        panels.push(HeatMap { range: Some((low, high)), ..difference_panel(&map.labels, &difference) });
    }
    let fixed = if map.fixed.is_empty() { String::new() } else { format!("At {}.", map.fixed) };
    let beside = match (constant, &map.exact) {
        (Some(exact), _) => format!("The exact one is {} everywhere.", rounded(exact.median, 6)),
        (None, Some(_)) => "Exact, learned, and the difference.".to_string(),
        (None, None) => String::new(),
    };
    let sentences = [&beside, &fixed, &map.remark].into_iter().filter(|text| !text.is_empty()).cloned();
    let caption = sentences.collect::<Vec<_>>().join(" ");
    figure(&format!("{}.svg", file_part(&map.file)), map.about.as_str(), heat_maps(&panels), caption)
}

/// The turn of an angle that an axis shows: `pi` on both sides of its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    middle: f64,
}

impl Turn {
    /// The turn about 0 or `pi`, whichever the angles are closer to on average, so that they cross its ends as rarely as possible. `None`
    /// if all of them lie within it and need no folding.
    pub fn of(angles: impl Iterator<Item = f64> + Clone) -> Option<Self> {
        let mean: f64 = angles.clone().filter(|x| x.is_finite()).map(f64::cos).sum();
        let turn = Self { middle: if mean < 0.0 { PI } else { 0.0 } };
        let outside = |x: f64| x.is_finite() && turn.number(x) != 0.0;
        angles.into_iter().any(outside).then_some(turn)
    }

    /// Its lower end.
    pub fn low(self) -> f64 {
        self.middle - PI
    }

    /// Its upper end.
    pub fn high(self) -> f64 {
        self.middle + PI
    }

    /// Number of full turns between an angle and this turn.
    fn number(self, x: f64) -> f64 {
        ((x - self.low()) / TAU).floor()
    }

    /// A path `(angle, other)` with the angle brought into this turn: where it passes an end the path goes up to the end,
    /// leaves a gap and continues from the other end.
    pub fn fold(self, path: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let mut folded: Vec<(f64, f64)> = Vec::with_capacity(path.len());
        let mut before: Option<(f64, f64)> = None;
        for &(x, y) in path {
            let turn = self.number(x);
            if let Some((u, w)) = before
                && (turn - self.number(u)).abs() == 1.0
            {
                let up = x > u;
                let end = if up { self.high() } else { self.low() };
                let passed = end + TAU * self.number(u);
                let height = if x == u { y } else { w + (passed - u) / (x - u) * (y - w) };
                let other = if up { self.low() } else { self.high() };
                folded.extend([(end, height), (f64::NAN, f64::NAN), (other, height)]);
            } else if before.is_some_and(|(u, _)| self.number(u) != turn) {
                // Steps of more than a turn, and values that are not finite, interrupt the line.
                folded.push((f64::NAN, f64::NAN));
            }
            folded.push((x - TAU * turn, y));
            before = Some((x, y));
        }
        folded
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{Axis, determinant_grid, lagrangian_grid};
    use crate::models::{OSCILLATOR, PENDULUM};
    use crate::report::save_pictures;

    #[test]
    fn grids_are_compared_up_to_the_fit() {
        let axes = [
            Axis { component: 0, from: -3.0, to: 3.0, points: 61 },
            Axis { component: 1, from: -2.0, to: 2.0, points: 41 },
        ];
        let grid = |model| lagrangian_grid::<f64>(model, &[0.0, 0.0], axes).unwrap();
        let exact = grid(&PENDULUM);
        let mut comparison = GridComparison {
            quantity: "L".into(),
            heading: "The Lagrangian".into(),
            file: "lagrangian".into(),
            x_label: "theta [rad]".into(),
            y_label: "theta_dot [rad/s]".into(),
            learned: exact.map(|z| 3.0 * z - 7.0),
            exact,
            fixed: String::new(),
            fit: Fit::Affine,
            signs: false,
        };
        let figure = grid_figures(&comparison).unwrap();
        assert!(
            figure.caption.contains("learned as 0.333 L + 2.33, the best fit (R\u{b2} = 1.000000)"),
            "{}",
            figure.caption
        );
        comparison.learned = grid(&OSCILLATOR);
        save_pictures(&[grid_figures(&comparison).unwrap()]);
        let det = determinant_grid::<f64>(&PENDULUM, &[0.0, 0.0], axes, |_, _| {}).unwrap();
        comparison = GridComparison {
            quantity: "det M".into(),
            file: "det_m".into(),
            fixed: "g = 1".into(),
            learned: det.map(|z| -0.5 * z),
            exact: det,
            fit: Fit::Factor(-2.0, "times \u{2212}2".into()),
            signs: true,
            ..comparison
        };
        // The factor is that of the Lagrangian: the sign of all values together is free.
        let figure = grid_figures(&comparison).unwrap();
        assert!(
            figure.caption.starts_with("det M at g = 1: exact, learned times \u{2212}2, and"),
            "{}",
            figure.caption
        );
        assert!(figure.caption.contains("right sign at every"));
        // A quarter of the columns turns its sign.
        let columns = comparison.exact.x.len();
        for (k, z) in comparison.learned.values.iter_mut().enumerate() {
            if k % columns < 15 {
                *z = -*z;
            }
        }
        let figure = grid_figures(&comparison).unwrap();
        assert!(figure.caption.contains("wrong sign at 24.59 %"), "{}", figure.caption);
        save_pictures(&[figure]);
        comparison.learned.x.pop();
        assert!(grid_figures(&comparison).is_none());
    }

    #[test]
    fn a_constant_needs_no_panel() {
        let axis = |count: u32| (0..count).map(f64::from).collect::<Vec<f64>>();
        let grid =
            |f: &dyn Fn(f64) -> f64| Grid { x: axis(5), y: axis(4), values: axis(20).into_iter().map(f).collect() };
        let map = |exact| QuantityMap {
            quantity: "R".into(),
            about: "Curvature scalar R of the metric".into(),
            file: "curvature scalar".into(),
            labels: ["theta [rad]", "phi [rad]"].map(String::from),
            learned: grid(&|k| 2.0 + 0.01 * k),
            exact,
            fixed: "r = 4".into(),
            remark: String::new(),
            marks: Vec::new(),
            open: Vec::new(),
        };
        let panels = |exact| {
            let figure = quantity_figure(&map(exact)).unwrap();
            assert_eq!(figure.file, "curvature_scalar.svg");
            let found = (figure.picture.panels(), figure.caption.clone());
            save_pictures(&[figure]);
            found
        };
        let alone = "At r = 4.".to_string();
        assert_eq!(panels(None), (1, alone));
        let constant = "The exact one is 2.00000 everywhere. At r = 4.".to_string();
        assert_eq!(panels(Some(grid(&|_| 2.0))), (2, constant));
        assert_eq!(panels(Some(grid(&|k| k))).0, 3);
        let nothing = QuantityMap { learned: grid(&|_| f64::NAN), ..map(None) };
        assert!(quantity_figure(&nothing).is_none());
    }

    #[test]
    fn paths_break_at_the_ends_and_nowhere_else() {
        // A pendulum that goes over the top, twice forwards and once back.
        let angle = |k: f64| 4.0 * PI * (0.5 * PI * k / 400.0).sin();
        let path: Vec<(f64, f64)> = (0..=600).map(|k| (angle(f64::from(k)), f64::from(k))).collect();
        let turn = Turn::of(path.iter().map(|p| p.0)).unwrap();
        let folded = turn.fold(&path);
        assert_eq!((turn.low(), turn.high()), (-PI, PI));
        let stretches: Vec<_> = folded.split(|p| p.0.is_nan()).collect();
        assert_eq!(stretches.len(), 4);
        for stretch in &stretches {
            assert!(stretch.len() > 1 && stretch.iter().all(|p| (-PI..=PI).contains(&p.0)), "a stub");
            // No horizontal line across: neighbours are as close as on the path.
            assert!(stretch.windows(2).all(|p| (p[1].0 - p[0].0).abs() < 0.07 && p[1].1 >= p[0].1));
        }
        for pair in stretches.windows(2) {
            let (end, begin) = (pair[0].last().unwrap(), pair[1][0]);
            assert!((end.0.abs() - PI).abs() < 1e-12 && end.0 == -begin.0 && end.1 == begin.1);
        }
    }

    #[test]
    fn turns_lie_about_the_motion() {
        // About the top: from 0 to 2 pi.
        let up = Turn::of([3.0, 4.0, 2.5, 7.0].into_iter()).unwrap();
        assert_eq!((up.low(), up.high()), (0.0, TAU));
        assert_eq!(Turn::of([3.0, 4.0, 2.5].into_iter()), None);
        assert_eq!(Turn::of([0.1, -3.0, f64::NAN].into_iter()), None);
        // Jumps leave gaps, and `NaN` stays `NaN`.
        let jump =
            Turn::of([0.0, 20.0].into_iter()).unwrap().fold(&[(0.0, 1.0), (20.0, 2.0), (f64::NAN, 3.0), (0.5, 4.0)]);
        assert_eq!(jump.iter().filter(|p| p.0.is_finite()).count(), 3);
        assert!(jump.windows(2).all(|pair| pair[0].0.is_nan() || pair[1].0.is_nan()));
    }
}
