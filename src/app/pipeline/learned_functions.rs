//! Pictures of the functions in a Lagrangian: the potential `V(q) = -L(q, 0)`, the mass matrix `M(q)` at rest, the gyroscopic field
//! `F_ij = dA_j/dq_i - dA_i/dq_j` of the momenta `A = p(q, 0)`, and the friction force over the velocity. All but the last do not
//! depend on the gauge; together they are the whole of a Lagrangian that is quadratic in the velocities.

use crate::analysis::{Axis, Grid, MetricComponent, element_factor, grid_points, metric_grids};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::pipeline::determination::Determined;
use crate::pipeline::thresholds::{
    FUNCTION_POINTS, MOMENTUM_STEP, MOST_MAPS, MOST_MARKS, NEAR_MAP, SHOWN_OFF_DIAGONAL, WHOLE_TURN,
};
use crate::recording::Recording;
use crate::report::{Figure, LinePlot, QuantityMap, Series, figure, file_part, line_plot, quantity_figure};
use std::f64::consts::{PI, TAU};

/// A learned model and the exact one, if that is known.
#[derive(Clone, Copy)]
pub(super) struct Pair<'a> {
    pub learned: &'a dyn EulerLagrange<f64>,
    pub exact: Option<&'a dyn EulerLagrange<f64>>,
    /// Factor that multiplies the learned Lagrangian.
    pub factor: f64,
    /// Factors of the coordinates, if groups of coordinates have different factors.
    pub factors: &'a [f64],
}

/// Region over which pictures are drawn.
pub(super) struct Picturing<'a> {
    /// Names of the coordinates, and labels of axes for coordinates and velocities.
    pub names: Vec<String>,
    pub labels: Vec<String>,
    /// Range of every coordinate.
    pub ranges: Vec<[f64; 2]>,
    /// The two coordinates that span maps.
    pub shown: [usize; 2],
    /// Recorded positions in the plane of the axes.
    pub marks: Vec<(f64, f64)>,
    /// Sentence about the unit of the pictures; may be empty.
    pub unit: String,
    /// The quantities that recorded motion determines.
    pub determined: Option<&'a Determined>,
}

/// The range of a coordinate over recorded motion, an angle folded into the turn about its mean.
pub(super) fn recorded_range(recording: &Recording, i: usize) -> ([f64; 2], impl Fn(f64) -> f64 + use<>) {
    let n = recording.n();
    let values = || recording.tracks.iter().flat_map(move |track| track.q.iter().skip(i).step_by(n).copied());
    let periodic = recording.periodic[i];
    let (sine, cosine) = values().fold((0.0, 0.0), |(s, c), x: f64| (s + x.sin(), c + x.cos()));
    let middle = f64::atan2(sine, cosine);
    let folded = move |x: f64| if periodic { x - TAU * ((x - middle) / TAU).round() } else { x };
    let (low, high) = values().map(folded).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    let range = if periodic && high - low > WHOLE_TURN * TAU { [middle - PI, middle + PI] } else { [low, high] };
    (range, folded)
}

impl Picturing<'_> {
    /// Chooses the plane of recorded motion.
    pub fn of_recording(self, recording: &Recording) -> Self {
        let n = recording.n();
        let (ranges, folds): (Vec<_>, Vec<_>) = (0..n).map(|i| recorded_range(recording, i)).unzip();
        let [x, y] = self.shown;
        if x == y {
            return Self { ranges, ..self };
        }
        let stride = recording.samples().div_ceil(MOST_MARKS).max(1);
        let places = recording.tracks.iter().flat_map(|track| track.q.chunks_exact(n).step_by(stride));
        let marks = places.map(|q| (folds[x](q[x]), folds[y](q[y]))).collect();
        Self { ranges, marks, ..self }
    }

    /// The centre of the ranges.
    pub fn middle(&self) -> Vec<f64> {
        self.ranges.iter().map(|[low, high]| 0.5 * (low + high)).collect()
    }

    /// Axes of a map with `points` points along each.
    pub fn axes(&self, points: usize) -> [Axis; 2] {
        self.shown.map(|component| {
            let [from, to] = self.ranges[component];
            Axis { component, from, to, points }
        })
    }

    /// Lists the other coordinates with their fixed values.
    fn fixed(&self, free: &[usize]) -> String {
        let middle = self.middle();
        let others = (0..self.names.len()).filter(|i| !free.contains(i));
        // Adding 0 turns -0 into 0.
        let one = |i: usize| format!("{} = {}", self.names[i], (1e4 * middle[i]).round() / 1e4 + 0.0);
        others.map(one).collect::<Vec<_>>().join(", ")
    }

    /// Draws a map of a quantity; `file` begins the file name, and `open` explains why the motion does not determine the quantity.
    pub fn map(
        &self,
        [quantity, about, file]: [String; 3],
        learned: Grid,
        exact: Option<Grid>,
        open: Option<String>,
    ) -> Option<Figure> {
        let (labels, fixed) = (self.shown.map(|i| self.labels[i].clone()), self.fixed(&self.shown));
        let dots = if self.marks.is_empty() { "" } else { "Dots: recorded positions." };
        let (open, why) = match open {
            Some(why) => (vec![true; learned.values.len()], format!("Greyed out: {why}")),
            None => self.unseen(&learned),
        };
        let remark = sentences(&[dots, &why, &self.unit]);
        let marks = self.marks.clone();
        quantity_figure(&QuantityMap { quantity, about, file, labels, learned, exact, fixed, remark, marks, open })
    }

    /// Marks points of a map that are far from every recorded position, and describes them; empty without recorded motion.
    fn unseen(&self, grid: &Grid) -> (Vec<bool>, String) {
        if self.marks.is_empty() {
            return (Vec::new(), String::new());
        }
        let [near_x, near_y] = self.shown.map(|i| NEAR_MAP * (self.ranges[i][1] - self.ranges[i][0]));
        let near = |(x, y): (f64, f64), (u, w): &(f64, f64)| ((x - u) / near_x).hypot((y - w) / near_y) <= 1.0;
        let place = |k: usize| !self.marks.iter().any(|mark| near(grid.point(k), mark));
        let open: Vec<bool> = (0..grid.values.len()).map(place).collect();
        let why = if open.contains(&true) { "Greyed out: no recorded position is near." } else { "" };
        (open, why.to_string())
    }

    /// Evaluates `of` on a grid in the plane; it receives points `(points, n)`.
    fn grid(&self, points: usize, of: impl Fn(&[f64]) -> Vec<f64>) -> Grid {
        let ([x, y], q) = grid_points(&self.middle(), self.axes(points));
        Grid { x, y, values: of(&q) }
    }

    /// Draws a quantity over coordinate `i`, with the others at the centre of their ranges.
    fn curve(
        &self,
        i: usize,
        [quantity, about, file]: [&str; 3],
        (pair, of): (Pair<'_>, Value<'_>),
        open: Option<String>,
    ) -> Option<Figure> {
        let [from, to] = self.ranges[i];
        let x = Axis { component: i, from, to, points: FUNCTION_POINTS }.values();
        let middle = self.middle();
        let q: Vec<f64> =
            x.iter().flat_map(|x| middle.iter().enumerate().map(move |(k, m)| if k == i { *x } else { *m })).collect();
        let learned: Vec<f64> = of(pair.learned, &q).iter().map(|y| pair.factor * y).collect();
        let exact = pair.exact.map(|exact| of(exact, &q));
        let (learned, exact) = if quantity == "V" { aligned(learned, exact) } else { (learned, exact) };
        let lines = match &exact {
            Some(exact) => vec![Series::new("exact", &x, exact), Series::new("learned", &x, &learned).over()],
            None => vec![Series::new("", &x, &learned)],
        };
        let fixed = self.fixed(&[i]);
        let fixed = if fixed.is_empty() { fixed } else { format!("At {fixed}.") };
        let why = open.as_ref().map_or(String::new(), |why| format!("Grey: {why}"));
        let plot = LinePlot { open: open.is_some(), ..lines_over(&self.labels[i], quantity, lines) };
        let caption = sentences(&[&fixed, &why, &self.unit]);
        figure(&format!("{}.svg", file_part(file)), about, line_plot(&plot), caption)
    }

    /// Draws the potential; nothing for a model that is constant at rest.
    pub fn potential(&self, pair: Pair<'_>, side: usize) -> Vec<Figure> {
        let n = self.names.len();
        let open = self.determined.and_then(Determined::open_potential);
        let mut figures = Vec::new();
        if n > 1 {
            let learned = self.grid(side, |q| potential(pair.learned, q)).map(|v| pair.factor * v);
            let exact = pair.exact.map(|exact| self.grid(side, |q| potential(exact, q)).values);
            let (values, exact) = aligned(learned.values.clone(), exact);
            if is_flat(&values) && exact.as_deref().is_none_or(is_flat) {
                return figures;
            }
            let exact = exact.map(|values| Grid { values, ..learned.clone() });
            let texts = ["V", "The potential V over the coordinates", "potential"].map(String::from);
            figures.extend(self.map(texts, Grid { values, ..learned }, exact, open.clone()));
        }
        for i in (0..n).filter(|i| n == 1 || !self.shown.contains(i)) {
            let name = &self.names[i];
            let file = if n == 1 { "potential".to_string() } else { format!("potential_{name}") };
            let texts = ["V", &format!("The potential V over {name}"), &file];
            figures.extend(self.curve(i, texts, (pair, &potential), open.clone()));
        }
        figures
    }

    /// Draws the relevant `components` of the mass matrix at rest; `symbol` is `M`, or `g` for a metric. Also returns the number of
    /// components without a picture.
    pub fn mass_matrix(
        &self,
        pair: Pair<'_>,
        components: &[MetricComponent],
        (symbol, file): (&str, &str),
        side: usize,
    ) -> (Vec<Figure>, usize) {
        if let [name] = &self.names[..] {
            let of = |model: &dyn EulerLagrange<f64>, q: &[f64]| at_rest(model, q, Request::MASS_MATRIX).mass_matrix;
            let texts = [symbol, &format!("The mass M over {name}"), file];
            let open = self.determined.and_then(|determined| determined.open_mass([name, name]));
            return (self.curve(0, texts, (pair, &of), open).into_iter().collect(), 0);
        }
        let size = |component: &MetricComponent| component.exact.unwrap_or(0.0).max(component.learned);
        let diagonal = |i: usize| components.iter().find(|c| c.indices == [i; 2]).map_or(0.0, size);
        let matters = |component: &MetricComponent| {
            let [i, j] = component.indices;
            i == j || size(component) > SHOWN_OFF_DIAGONAL * (diagonal(i) * diagonal(j)).sqrt()
        };
        let grids = |model: &dyn EulerLagrange<f64>| metric_grids(model, &self.middle(), self.axes(side)).into_iter();
        let (learned, mut exact) = (grids(pair.learned), pair.exact.map(grids));
        let mut maps = Vec::new();
        for (component, learned) in components.iter().zip(learned) {
            let exact = exact.as_mut().and_then(Iterator::next);
            if matters(component) {
                let [a, b] = component.indices.map(|i| self.names[i].as_str());
                let [row, column] = component.indices.map(|i| pair.factors[i]);
                let open = self.determined.and_then(|determined| determined.open_mass([a, b]));
                let what = if symbol == "g" { "metric" } else { "mass matrix" };
                let quantity = format!("{symbol}[{a},{b}]");
                let about = format!("Component {quantity} of the {what} over the coordinates");
                let texts = [quantity, about, format!("{file}_{a}_{b}")];
                maps.push((texts, learned.map(|m| element_factor(row, column) * m), exact, open));
            }
        }
        let more = maps.len().saturating_sub(MOST_MAPS);
        let drawn = maps
            .into_iter()
            .take(MOST_MAPS)
            .filter_map(|(texts, learned, exact, open)| self.map(texts, learned, exact, open));
        (drawn.collect(), more)
    }

    /// Draws the gyroscopic field, such as that of a magnet or a rotating frame; nothing for a model whose momenta vanish at rest.
    pub fn gyroscopic(&self, pair: Pair<'_>, side: usize) -> Vec<Figure> {
        let n = self.names.len();
        let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| [i, j])).take(MOST_MAPS);
        let drawn = pairs.filter_map(|[i, j]| {
            let grid = |model| self.grid(side, |q| self.field(model, q, [i, j]));
            let (learned, exact) = (grid(pair.learned).map(|f| pair.factor * f), pair.exact.map(grid));
            let [a, b] = [i, j].map(|i| self.names[i].as_str());
            let quantity = format!("F[{a},{b}]");
            let open = self.determined.and_then(Determined::unknown);
            let about = format!("The gyroscopic (magnetic) field {quantity} over the coordinates");
            self.map([quantity, about, format!("gyroscopic_{a}_{b}")], learned, exact, open)
        });
        drawn.collect()
    }

    /// Computes `F_ij` at points `(points, n)` by central differences of the momenta at rest.
    fn field(&self, model: &dyn EulerLagrange<f64>, q: &[f64], [i, j]: [usize; 2]) -> Vec<f64> {
        let n = self.names.len();
        let difference = |along: usize, of: usize| -> Vec<f64> {
            let [low, high] = self.ranges[along];
            let step = MOMENTUM_STEP * (high - low);
            let [before, after] = [-step, step].map(|step| {
                let mut moved = q.to_vec();
                moved.iter_mut().skip(along).step_by(n).for_each(|x| *x += step);
                at_rest(model, &moved, Request::MOMENTUM).momentum
            });
            let column = |p: &[f64]| p.iter().skip(of).step_by(n).copied().collect::<Vec<_>>();
            column(&after).iter().zip(column(&before)).map(|(a, b)| (a - b) / (2.0 * step)).collect()
        };
        difference(i, j).iter().zip(difference(j, i)).map(|(a, b)| a - b).collect()
    }

    /// Draws the friction of every coordinate over its velocity, with the others at rest and the coordinates at the centre; nothing for a
    /// model without friction.
    pub fn friction(&self, pair: Pair<'_>, velocities: &[[f64; 2]]) -> Vec<Figure> {
        let (n, middle) = (self.names.len(), self.middle());
        let of = |model: &dyn EulerLagrange<f64>, i: usize, v: &[f64]| -> Vec<f64> {
            let q = middle.repeat(v.len());
            let v: Vec<f64> = v.iter().flat_map(|v| (0..n).map(move |k| if k == i { *v } else { 0.0 })).collect();
            let mut terms = Terms::default();
            let _ = model.terms(&q, &v, Request::FORCE, &mut terms);
            terms.force.iter().skip(i).step_by(n).copied().collect()
        };
        let drawn = (0..n).filter_map(|i| {
            let [from, to] = velocities[i];
            let x = Axis { component: i, from, to, points: FUNCTION_POINTS }.values();
            let learned: Vec<f64> = of(pair.learned, i, &x).iter().map(|f| pair.factor * f).collect();
            let exact = pair.exact.map(|exact| of(exact, i, &x)).filter(|exact| !exact.is_empty());
            if learned.is_empty() && exact.is_none() {
                return None;
            }
            let learned = if learned.is_empty() { vec![0.0; x.len()] } else { learned };
            let lines = match &exact {
                Some(exact) => vec![Series::new("exact", &x, exact), Series::new("learned", &x, &learned).over()],
                None => vec![Series::new("", &x, &learned)],
            };
            let name = &self.names[i];
            let about = format!("The friction of {name}: force \u{2212}dD/dv over the velocity");
            let open = self.determined.and_then(|determined| determined.open_friction(name));
            let why = open.as_ref().map_or(String::new(), |why| format!("Grey: {why}"));
            let caption = sentences(&["The other velocities are 0, the coordinates in the middle.", &why, &self.unit]);
            let plot = LinePlot { open: open.is_some(), ..lines_over(&self.labels[n + i], "force", lines) };
            figure(&format!("friction_{}.svg", file_part(name)), about, line_plot(&plot), caption)
        });
        drawn.collect()
    }
}

/// Evaluates a quantity of a model at points `(points, n)`.
type Value<'a> = &'a dyn Fn(&dyn EulerLagrange<f64>, &[f64]) -> Vec<f64>;

fn lines_over(x_label: &str, y_label: &str, series: Vec<Series>) -> LinePlot {
    LinePlot { x_label: x_label.to_string(), y_label: y_label.to_string(), series, ..LinePlot::default() }
}

/// Joins sentences, without empty ones.
fn sentences(all: &[&str]) -> String {
    all.iter().filter(|text| !text.is_empty()).copied().collect::<Vec<_>>().join(" ")
}

/// Evaluates terms at rest at points `(points, n)`.
fn at_rest(model: &dyn EulerLagrange<f64>, q: &[f64], request: Request) -> Terms<f64> {
    let mut terms = Terms::default();
    // If a state fails, its numbers are not finite.
    let _ = model.terms(q, &vec![0.0; q.len()], request, &mut terms);
    terms
}

fn potential(model: &dyn EulerLagrange<f64>, q: &[f64]) -> Vec<f64> {
    at_rest(model, q, Request::LAGRANGIAN).lagrangian.iter().map(|l| -l).collect()
}

/// Shifts a learned potential to the mean of the exact one, or to the minimum 0, because its constant has no meaning.
fn aligned(learned: Vec<f64>, exact: Option<Vec<f64>>) -> (Vec<f64>, Option<Vec<f64>>) {
    let finite = |values: &[f64]| values.iter().copied().filter(|x| x.is_finite()).collect::<Vec<_>>();
    let lowest = |values: &[f64]| finite(values).into_iter().fold(f64::INFINITY, f64::min);
    let shifted = |values: &[f64], by: f64| values.iter().map(|x| x - by).collect::<Vec<_>>();
    let Some(exact) = exact else { return (shifted(&learned, lowest(&learned)), None) };
    let exact = shifted(&exact, lowest(&exact));
    let apart: Vec<f64> = finite(&learned.iter().zip(&exact).map(|(a, b)| a - b).collect::<Vec<_>>());
    let mean = apart.iter().sum::<f64>() / apart.len() as f64;
    (shifted(&learned, mean), Some(exact))
}

/// `true` for values that are equal up to rounding.
fn is_flat(values: &[f64]) -> bool {
    values.iter().filter(|x| x.is_finite()).all(|x| x.abs() <= 1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_are_greyed_where_nothing_was_recorded_or_nothing_is_determined() {
        let places: Vec<f64> = (0..=20).map(|k| 0.05 * f64::from(k)).collect();
        let values = places.iter().flat_map(|y| places.iter().map(move |x| x + y)).collect();
        let grid = Grid { x: places.clone(), y: places.clone(), values };
        let picturing = |marks: Vec<(f64, f64)>| Picturing {
            names: ["x", "y"].map(String::from).to_vec(),
            labels: ["x [m]", "y [m]"].map(String::from).to_vec(),
            ranges: vec![[0.0, 1.0]; 2],
            shown: [0, 1],
            marks,
            unit: String::new(),
            determined: None,
        };
        let drawn = |marks: &[(f64, f64)], open: Option<&str>| {
            let texts = ["V", "The potential", "potential"].map(String::from);
            let figure = picturing(marks.to_vec()).map(texts, grid.clone(), None, open.map(String::from)).unwrap();
            (figure.caption, figure.picture)
        };
        let all: Vec<(f64, f64)> = places.iter().flat_map(|x| places.iter().map(|y| (*x, *y))).collect();
        let left: Vec<(f64, f64)> = all.iter().copied().filter(|(x, _)| *x < 0.4).collect();
        let count =
            |marks: &[(f64, f64)]| picturing(marks.to_vec()).unseen(&grid).0.iter().filter(|open| **open).count();
        // Eleven of 21 columns are farther from the left than a tenth of the range.
        assert_eq!([count(&all), count(&left), count(&[])], [0, 11 * 21, 0]);
        assert!(!drawn(&all, None).0.contains("Greyed out"));
        assert!(drawn(&left, None).0.contains("Greyed out: no recorded position is near."));
        let (caption, picture) = drawn(&all, Some("Nothing moved."));
        assert!(caption.contains("Greyed out: Nothing moved.") && picture != drawn(&all, None).1);
    }
}
