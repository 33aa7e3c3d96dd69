//! Pictures of learned and exact functions on a grid.

use super::quantity_map::{difference_panel, panel};
use super::{Figure, HeatMap, PlotError, heat_maps};
use crate::analysis::{AffineFit, Grid, affine_fit, factor_fit};

/// Transformation up to which a learned quantity is determined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fit {
    /// Nothing: as it is.
    None,
    /// A factor (`det M`).
    Factor,
    /// A factor and a summand (`L`).
    Affine,
}

/// A quantity of the exact and of the learned model on the same grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridComparison {
    /// Name of the quantity, such as `L` or `det M`.
    pub quantity: String,
    /// What the picture shows, above it.
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
    /// Up to what the two are compared.
    pub fit: Fit,
    /// `true` to count and mark points where the learned value has the wrong sign, before any fit.
    pub signs: bool,
}

/// Exact, learned and difference side by side, the first two with one range of colours, and the fit if one was made.
///
/// The range is that of the exact values; if learned values of the wrong sign are marked, it reaches their change of sign
/// too.
///
/// # Errors
/// [`PlotError`] if a grid has no finite value or the grids differ in size.
pub fn grid_figures(comparison: &GridComparison) -> Result<(Figure, Option<AffineFit>), PlotError> {
    let quantity = &comparison.quantity;
    let empty = || PlotError::Empty(quantity.clone());
    let values = (&comparison.learned.values, &comparison.exact.values);
    let fit = match comparison.fit {
        Fit::None => None,
        Fit::Factor => factor_fit(values.0, values.1),
        Fit::Affine => affine_fit(values.0, values.1),
    };
    let learned = fit.map_or_else(|| comparison.learned.clone(), |fit| comparison.learned.fitted(&fit));
    let difference = learned.minus(&comparison.exact).ok_or_else(empty)?;
    let signs = if comparison.signs { comparison.learned.wrong_signs(&comparison.exact) } else { None };
    let wrong = |sign: &Option<bool>| *sign == Some(true);
    let marks: Vec<(f64, f64)> = signs
        .iter()
        .flatten()
        .enumerate()
        .filter(|(_, sign)| wrong(sign))
        .map(|(k, _)| comparison.exact.point(k))
        .collect();
    // Where the learned value before the fit is 0.
    let zero = if marks.is_empty() { None } else { Some(fit.map_or(0.0, |fit| fit.b)) };
    let finite = comparison.exact.values.iter().copied().chain(zero).filter(|z| z.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)));
    let share = signs.map(|signs| 100.0 * marks.len() as f64 / signs.iter().flatten().count().max(1) as f64);
    let of_wrong_sign = share.filter(|&share| share > 0.0);
    let learned_title = match of_wrong_sign {
        Some(share) => format!("{quantity} learned, {share:.2} % of wrong sign"),
        None => format!("{quantity} learned"),
    };
    let labels = [comparison.x_label.clone(), comparison.y_label.clone()];
    let range = Some((low, high));
    let exact = panel(format!("{quantity} exact"), &labels, &comparison.exact);
    let picture = heat_maps(&[
        HeatMap { range, ..exact },
        HeatMap { range, marks, ..panel(learned_title, &labels, &learned) },
        difference_panel(&labels, &difference),
    ])?;
    let fixed = if comparison.fixed.is_empty() { String::new() } else { format!(" at {}", comparison.fixed) };
    let learned = match fit {
        Some(fit) => {
            format!("learned after the best fit (a = {:.6e}, b = {:.6e}, R\u{b2} = {:.6})", fit.a, fit.b, fit.r2)
        }
        None => "learned with the same colours".to_string(),
    };
    let signs = match (share, of_wrong_sign) {
        (_, Some(share)) => {
            format!(" The learned value, before any fit, has the wrong sign at {share:.2} % of the points (dots).")
        }
        (Some(_), None) => " The learned value, before any fit, has the right sign at every point.".to_string(),
        (None, _) => String::new(),
    };
    let caption = format!("{quantity}{fixed}: exact, {learned}, and the difference.{signs}");
    let (file, heading) = (format!("{}.svg", comparison.file), comparison.heading.clone());
    Ok((Figure { file, heading, picture, caption }, fit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{Axis, determinant_grid, lagrangian_grid};
    use crate::report::test_pictures::save;
    use crate::rollout::models::{OSCILLATOR, PENDULUM};

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
        let (_, fit) = grid_figures(&comparison).unwrap();
        let fit = fit.unwrap();
        assert!((fit.a - 1.0 / 3.0).abs() < 1e-12 && (fit.b - 7.0 / 3.0).abs() < 1e-12 && fit.r2 > 1.0 - 1e-12);
        comparison.learned = grid(&OSCILLATOR);
        let (figure, _) = grid_figures(&comparison).unwrap();
        save(&[figure]);
        let det = determinant_grid::<f64>(&PENDULUM, &[0.0, 0.0], axes, |_, _| {}).unwrap();
        comparison = GridComparison {
            quantity: "det M".into(),
            file: "det_m".into(),
            fixed: "g = 1".into(),
            learned: det.clone(),
            exact: det,
            fit: Fit::None,
            signs: true,
            ..comparison
        };
        let (figure, fit) = grid_figures(&comparison).unwrap();
        assert!(fit.is_none());
        assert!(figure.caption.starts_with("det M at g = 1: exact") && figure.caption.contains("right sign at every"));
        // A quarter of the columns turns its sign, whatever the fit does to the values.
        let columns = comparison.exact.x.len();
        for (k, z) in comparison.learned.values.iter_mut().enumerate() {
            if k % columns < 15 {
                *z = -*z;
            }
        }
        for fit in [Fit::Affine, Fit::Factor, Fit::None] {
            comparison.fit = fit;
            let (figure, _) = grid_figures(&comparison).unwrap();
            assert!(figure.caption.contains("wrong sign at 24.59 %"), "{}", figure.caption);
            save(&[figure]);
        }
    }
}
