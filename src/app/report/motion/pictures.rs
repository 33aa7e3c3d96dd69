//! Pictures of a motion: its coordinates over time, or a page.

use super::record::MotionRecord;
use crate::analysis::MotionTube;
use crate::report::{
    LinePlot, Picture, PlotError, Polar, Report, Series, by_unit, figure, line_plot, trace_plot, with_unit,
};

/// Caption of a path that is coloured by time.
const FROM_DARK: &str = "From dark (the start, a dot) to bright (the end).";

/// Texts of the pictures of a motion.
#[derive(Clone, Copy, Debug)]
pub struct MotionTexts<'a> {
    /// Title.
    pub title: &'a str,
    /// Label of the parameter of the motion.
    pub parameter: &'a str,
    /// Name of the energy, or of the quantity that replaces it.
    pub energy: &'a str,
    /// Units of coordinates and velocities.
    pub units: &'a [String],
}

impl MotionRecord {
    /// Draws the coordinates against time, with the limits of a tube around them, and the path in the plane of polar ones, as SVG.
    ///
    /// # Errors
    /// [`PlotError::Empty`] for a motion that has no finite sample.
    pub fn to_svg(&self, texts: &MotionTexts<'_>, tube: Option<&MotionTube>) -> Result<String, PlotError> {
        let path = self.path(texts.units).filter(|path| !path.is_blank());
        let coordinates = self.coordinates(texts, tube)?;
        Ok(Picture::beside([coordinates].into_iter().chain(path)).to_svg(texts.title))
    }

    /// Draws the same with velocities and energy as a page.
    ///
    /// # Errors
    /// Those of [`MotionRecord::to_svg`].
    pub fn to_html(&self, texts: &MotionTexts<'_>, tube: Option<&MotionTube>) -> Result<String, PlotError> {
        let n = self.columns.len() / 2;
        let mut report = Report::new(texts.title);
        if let Some(leaving) = &self.leaving {
            report = report.paragraph(&format!("The motion {}.", leaving.text()));
        }
        let coordinates = self.coordinates(texts, tube)?;
        let velocities = (&self.columns[n..], &texts.units[n..]);
        let velocities = self.picture(velocities, &self.values[n..2 * n], texts.parameter)?;
        let energy = ([texts.energy.to_string()], [String::new()]);
        let energy = self.picture((&energy.0, &energy.1), &self.values[2 * n..], texts.parameter)?;
        let parameter = texts.parameter.split(" [").next().unwrap_or_default();
        let over = |what: &str, picture| figure("", format!("{what} against {parameter}"), Ok(picture), "");
        let path = self.path(texts.units);
        let figures = [
            path.and_then(|picture| figure("", "The path in the plane", Ok(picture), FROM_DARK)),
            over("Coordinates", coordinates),
            over("Velocities", velocities),
            over(&format!("{} of the model", capitalized(texts.energy)), energy),
        ];
        Ok(report.figures(figures.iter().flatten()).to_html())
    }

    /// The coordinates over time.
    fn coordinates(&self, texts: &MotionTexts<'_>, tube: Option<&MotionTube>) -> Result<Picture, PlotError> {
        let n = self.columns.len() / 2;
        let q = &texts.units[..n];
        let (mut names, mut positions, mut units) = (self.columns[..n].to_vec(), self.values[..n].to_vec(), q.to_vec());
        if let Some(tube) = tube {
            names.extend(tube.names());
            positions.extend(self.ends(tube));
            units.extend(q.iter().flat_map(|unit| [unit.clone(), unit.clone()]));
        }
        self.picture((&names, &units), &positions, texts.parameter)
    }

    /// The path in the plane, if the coordinates are polar.
    fn path(&self, units: &[String]) -> Option<Picture> {
        let n = self.columns.len() / 2;
        let positions: Vec<f64> =
            (0..self.times.len()).flat_map(|k| self.values[..n].iter().map(move |values| values[k])).collect();
        let trace = Polar::of(&self.columns[..n], &units[..n])?.trace(n, &[("", &positions)]);
        trace_plot(&trace).ok()
    }

    /// Lower and upper limits of a tube around every coordinate, at the stored times.
    fn ends(&self, tube: &MotionTube) -> Vec<Vec<f64>> {
        let n = self.columns.len() / 2;
        let mut ends = vec![Vec::with_capacity(self.times.len()); 2 * n];
        for (k, t) in self.times.iter().enumerate() {
            let q: Vec<f64> = self.values[..n].iter().map(|values| values[k]).collect();
            ends.iter_mut().zip(tube.ends(*t, &q).flatten()).for_each(|(ends, x)| ends.push(x));
        }
        ends
    }

    /// Draws quantities over time, one panel for each unit; a panel of zeros is left out if there are others.
    fn picture(
        &self,
        (names, units): (&[String], &[String]),
        values: &[Vec<f64>],
        x_label: &str,
    ) -> Result<Picture, PlotError> {
        let panel = |(unit, members): (String, Vec<usize>)| {
            let label = members.iter().map(|&i| names[i].as_str()).collect::<Vec<_>>().join(", ");
            let (x_label, y_label) = (x_label.to_string(), with_unit(&label, &unit));
            let series = members.iter().map(|&i| Series::new(&names[i], &self.times, &values[i])).collect();
            line_plot(&LinePlot { x_label, y_label, series, ..LinePlot::default() })
        };
        let drawn: Vec<Picture> = by_unit(units).into_iter().filter_map(|group| panel(group).ok()).collect();
        if drawn.is_empty() {
            return Err(PlotError::Empty(names.join(", ")));
        }
        let rests = drawn.iter().all(Picture::is_blank);
        Ok(Picture::beside(drawn.into_iter().filter(|picture| rests || !picture.is_blank())))
    }
}

/// Capitalizes a text unless it is a formula.
fn capitalized(text: &str) -> String {
    if text.contains(|c: char| !c.is_alphabetic()) {
        return text.to_string();
    }
    text.chars().take(1).flat_map(char::to_uppercase).chain(text.chars().skip(1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::{Domain, Trajectory};

    #[test]
    fn unlike_units_have_panels_of_their_own() {
        let columns = ["r", "phi", "z", "h", "r_dot", "phi_dot", "z_dot", "h_dot"].map(String::from);
        let units = ["m", "rad", "m", "K", "m/s", "rad/s", "m/s", "K/s"].map(String::from);
        let mut watch = MotionRecord::new(Domain::new(vec![None; 8]), &columns);
        let q = [1.0, 0.5, 2.0, 0.0];
        let later = q.map(|q| 2.0 * q);
        let (t, v) = (vec![0.0, 1.0], [1.0, 0.5, 2.0, 0.0].repeat(2));
        watch.add(&Trajectory { coordinates: 4, t, q: [q, later].concat(), v, energy: Some(vec![0.0; 2]) });
        let texts = MotionTexts { title: "Motion", parameter: "time [s]", energy: "energy", units: &units };
        // The temperature is 0 and is left out; r and phi have a path in the plane.
        let svg = watch.to_svg(&texts, None).unwrap();
        for (label, count) in [(">r, z [m]<", 1), (">phi [rad]<", 1), (">h [K]<", 0), (">r cos phi [m]<", 1)] {
            assert_eq!(svg.matches(label).count(), count, "{label}");
        }
        // So is an energy of 0.
        let page = watch.to_html(&texts, None).unwrap();
        assert!(page.matches("<figure").count() == 3 && page.contains(">r_dot, z_dot [m/s]<"), "{page}");
    }

    #[test]
    fn words_begin_with_a_capital() {
        assert_eq!([capitalized("energy"), capitalized("p.v - L")], ["Energy", "p.v - L"]);
    }
}
