//! Converts polar coordinates to points in the plane.

use super::{Series, Trace, with_unit};

/// Indices of a radius and its angles among the coordinates of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Polar {
    radius: usize,
    angle: usize,
    /// The polar angle of spherical coordinates, which are drawn in the equatorial plane.
    axis: Option<usize>,
    /// `true` for an angle that is measured from the downward vertical, as on the interactive page.
    hangs: bool,
    labels: [String; 2],
}

impl Polar {
    /// Recognises coordinates called `r` and `phi`, or `r` and `theta`, where `theta` is measured from the downward vertical; `units` are
    /// those of the coordinates. If all three exist, they are spherical.
    pub fn of(names: &[String], units: &[String]) -> Option<Self> {
        let place = |wanted: &str| names.iter().position(|name| name == wanted);
        let (radius, phi, theta) = (place("r")?, place("phi"), place("theta"));
        let (angle, axis) = phi.map_or_else(|| Some((theta?, None)), |phi| Some((phi, theta)))?;
        let unit = units.get(radius).map_or("", String::as_str);
        let around = if axis.is_some() { "r sin theta" } else { "r" };
        let (hangs, name) = (phi.is_none(), &names[angle]);
        let [cosine, sine] = ["cos", "sin"].map(|of| format!("{around} {of} {name}"));
        let labels = if hangs { [sine, format!("\u{2212}{cosine}")] } else { [cosine, sine] };
        Some(Self { radius, angle, axis, hangs, labels: labels.map(|label| with_unit(&label, unit)) })
    }

    /// Point in the plane for a position.
    pub fn place(&self, q: &[f64]) -> (f64, f64) {
        let r = q[self.radius] * self.axis.map_or(1.0, |axis| q[axis].sin());
        let (sine, cosine) = q[self.angle].sin_cos();
        if self.hangs { (r * sine, -r * cosine) } else { (r * cosine, r * sine) }
    }

    /// Draws named paths of positions `(samples, n)`.
    pub fn trace(&self, n: usize, paths: &[(&str, &[f64])]) -> Trace {
        let [x_label, y_label] = self.labels.clone();
        let path = |(name, positions): &(&str, &[f64])| Series {
            points: positions.chunks_exact(n).map(|q| self.place(q)).collect(),
            ..Series::new(name, &[], &[])
        };
        Trace { x_label, y_label, paths: paths.iter().map(path).collect(), equal: true, turn: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn polar_coordinates_are_places_in_the_plane() {
        let of = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(ToString::to_string).collect();
            let units: Vec<String> =
                names.iter().map(|name| if name == "r" { "m" } else { "rad" }.to_string()).collect();
            Polar::of(&names, &units)
        };
        let near = |(x, y): (f64, f64), (u, w): (f64, f64)| (x - u).abs() < 1e-15 && (y - w).abs() < 1e-15;
        let flat = of(&["phi", "r"]).unwrap();
        assert!(near(flat.place(&[FRAC_PI_2, 2.0]), (0.0, 2.0)));
        let trace = flat.trace(2, &[("exact", &[0.0, 1.0, FRAC_PI_2, 2.0])]);
        assert_eq!((trace.x_label.as_str(), trace.paths[0].points[0]), ("r cos phi [m]", (1.0, 0.0)));
        let solid = of(&["r", "theta", "phi"]).unwrap();
        assert!(
            near(solid.place(&[2.0, FRAC_PI_2, 0.0]), (2.0, 0.0)) && near(solid.place(&[2.0, 0.0, 1.0]), (0.0, 0.0))
        );
        let hanging = of(&["r", "theta"]).unwrap();
        assert!(near(hanging.place(&[3.0, 0.0]), (0.0, -3.0)) && hanging.labels[1] == "\u{2212}r cos theta [m]");
        assert!(of(&["r", "z"]).is_none() && of(&["theta", "phi"]).is_none());
    }
}
