//! The Euler-Lagrange equations in their weak form, which needs no accelerations.
//!
//! For a function `phi` of compact support `int (phi (dD/dv - dL/dq - F) - phi' dL/dv) dt = 0` along every motion. It is linear in the
//! coefficients of the terms.

use super::library::{Kind, Library, Term, Values, blocks};
use super::regular::is_regular;
use super::select::mean;
use super::thresholds::{MASS_WINDOWS, MOST_WINDOW_WEIGHT, MOST_WINDOWS};
use crate::linalg::{self, Workspace};

/// Positions and velocities of a stretch of motion at even steps, with known forces if there are any: `(samples, n)`.
pub(super) struct Stretch {
    pub times: Vec<f64>,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub force: Vec<f64>,
    /// Block of the data that is held out, or resampled, as a whole.
    pub block: usize,
}

/// A state with an acceleration, and both sides of the equations of motion there: `(n)` each.
pub(super) struct State {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub a: Vec<f64>,
    pub equation: Vec<f64>,
}

/// The weak form of all terms over many test functions.
pub(super) struct Windows {
    pub n: usize,
    /// Number of terms.
    pub terms: usize,
    /// `(windows, n, terms)`.
    equations: Vec<f64>,
    /// Integrals of `phi f`, `(windows, functions)`.
    functions: Vec<f64>,
    /// Integrals of `phi F`, `(windows, n)`; empty without forces.
    pub forces: Vec<f64>,
    /// Block of every window.
    pub blocks: Vec<usize>,
    /// Times of their centres in s; none for states.
    pub centres: Vec<f64>,
    /// Number of functions.
    width: usize,
    /// Contributions of the terms to the mass matrix: `(i, j, function)`.
    kinetic: Vec<Option<(usize, usize, usize)>>,
    /// Coordinates that each term couples.
    joined: Vec<Vec<usize>>,
}

impl Windows {
    /// Test functions `(1 - x^2)^4` of `width` seconds along stretches of motion, at least a quarter of their width apart.
    pub fn new(library: &Library, terms: &[usize], stretches: &[Stretch], width: f64) -> Self {
        let n = library.n();
        let seconds: f64 = stretches.iter().map(|s| s.times[s.times.len() - 1] - s.times[0]).sum();
        let apart = (width / 6.0).max(seconds / MOST_WINDOWS);
        let which = library.functions_of(terms);
        let mut place = vec![0; library.functions.len()];
        which.iter().enumerate().for_each(|(at, &f)| place[f] = at);
        let kinetic = terms.iter().map(|&k| library.kinetic(k).map(|(i, j)| (i, j, place[library.terms[k].function])));
        let mut windows = Self {
            n,
            terms: terms.len(),
            equations: Vec::new(),
            functions: Vec::new(),
            forces: Vec::new(),
            blocks: Vec::new(),
            centres: Vec::new(),
            width: which.len(),
            kinetic: kinetic.collect(),
            joined: terms.iter().map(|&k| library.coordinates(k)).collect(),
        };
        for stretch in stretches {
            windows.add(library, (terms, &which), stretch, (width, apart));
        }
        windows
    }

    /// Adds the windows of a stretch.
    fn add(
        &mut self,
        library: &Library,
        (terms, which): (&[usize], &[usize]),
        stretch: &Stretch,
        (width, apart): (f64, f64),
    ) {
        let sampled = SampledTerms::new(library, (terms, which), stretch);
        let times = &stretch.times;
        let half = width / 2.0;
        let mut centre = times[0] + half;
        while centre + half <= times[times.len() - 1] + 1e-9 * width {
            self.add_window(&sampled, stretch, (centre, half));
            self.blocks.push(stretch.block);
            self.centres.push(centre);
            centre += apart;
        }
    }

    /// Integrates the terms, functions and forces over one test function.
    fn add_window(&mut self, sampled: &SampledTerms, stretch: &Stretch, (centre, half): (f64, f64)) {
        let (n, count) = (self.n, self.terms);
        let times = &stretch.times;
        let samples = times.len();
        let from = times.partition_point(|t| *t < centre - half);
        let to = times.partition_point(|t| *t <= centre + half);
        let start = self.equations.len();
        self.equations.resize(start + n * count, 0.0);
        let first = self.functions.len();
        self.functions.resize(first + self.width, 0.0);
        let mut force = vec![0.0; n];
        for s in from..to {
            let step = (times[(s + 1).min(samples - 1)] - times[s.saturating_sub(1)]) / 2.0;
            let x = (times[s] - centre) / half;
            let inside = (1.0 - x * x).max(0.0);
            let phi = inside.powi(4) * step;
            let slope = -8.0 * x * inside.powi(3) / half * step;
            let range = s * n * count..(s + 1) * n * count;
            let both = sampled.momenta[range.clone()].iter().zip(&sampled.forces[range]);
            let row = &mut self.equations[start..];
            row.iter_mut().zip(both).for_each(|(e, (p, r))| *e += phi * r - slope * p);
            let values = &sampled.functions[s * self.width..(s + 1) * self.width];
            self.functions[first..].iter_mut().zip(values).for_each(|(i, f)| *i += phi * f);
            if !stretch.force.is_empty() {
                (0..n).for_each(|i| force[i] += phi * stretch.force[s * n + i]);
            }
        }
        if !stretch.force.is_empty() {
            self.forces.extend(&force);
        }
    }

    /// The equations themselves at single states instead of windows; each state is a block.
    pub fn of_states(library: &Library, terms: &[usize], states: &[State]) -> Self {
        let mut windows = Self::new(library, terms, &[], 1.0);
        let (n, count) = (windows.n, windows.terms);
        let which = library.functions_of(terms);
        let mut values = Values::new();
        let mut single = vec![0.0; n];
        for (block, State { q, v, a, equation }) in states.iter().enumerate() {
            library.evaluate(&which, (q, 0.0), &mut values);
            let start = windows.equations.len();
            windows.equations.resize(start + n * count, 0.0);
            for (at, &k) in terms.iter().enumerate() {
                single.fill(0.0);
                library.add_equation(k, 1.0, &values, (v, a), &mut single);
                (0..n).for_each(|i| windows.equations[start + i * count + at] = single[i]);
            }
            windows.functions.extend(which.iter().map(|&f| values[f].value));
            windows.forces.extend(equation);
            windows.blocks.push(block);
        }
        windows
    }

    /// Number of windows.
    pub fn len(&self) -> usize {
        self.blocks.len()
    }

    /// `true` if there are known forces.
    pub fn driven(&self) -> bool {
        !self.forces.is_empty()
    }

    /// Indices of a set of terms in groups of decoupled coordinates.
    pub fn groups(&self, set: &[usize]) -> Vec<Group> {
        let of = |coordinates: Vec<usize>| {
            let own = |at: &usize| self.joined[set[*at]].first().is_some_and(|i| coordinates.contains(i));
            let places = (0..set.len()).filter(own).collect();
            Group { places, share: coordinates.len() as f64 / self.n as f64 }
        };
        blocks(self.n, set.iter().map(|&k| self.joined[k].as_slice())).into_iter().map(of).collect()
    }

    /// `true` if the mass matrix is not nearly singular in most windows.
    pub fn is_regular(&self, coefficients: &[f64]) -> bool {
        let n = self.n;
        let masses = self.masses(coefficients);
        let stride = self.len().div_ceil(MASS_WINDOWS).max(1);
        let checked: Vec<f64> = masses.chunks_exact(n * n).step_by(stride).flatten().copied().collect();
        is_regular(n, &checked)
    }

    /// The mean mass matrices over all windows under the test function, `(windows, n, n)`.
    fn masses(&self, coefficients: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut masses = vec![0.0; self.len() * n * n];
        for (mass, functions) in masses.chunks_exact_mut(n * n).zip(self.functions.chunks_exact(self.width)) {
            for (kinetic, c) in self.kinetic.iter().zip(coefficients).filter(|(_, c)| **c != 0.0) {
                if let Some((i, j, f)) = *kinetic {
                    mass[i * n + j] += c * functions[f];
                    mass[j * n + i] += c * functions[f];
                }
            }
        }
        masses
    }

    /// `true` if the mass matrix is positive definite in most windows.
    pub fn is_definite(&self, coefficients: &[f64]) -> bool {
        let n = self.n;
        let mut values = vec![0.0; self.len() * n];
        // Windows that fail are NaN.
        let _ = linalg::eigenvalues(n, &self.masses(coefficients), &mut values, &mut Workspace::new());
        let positive = values.chunks_exact(n).filter(|values| values.iter().all(|x| *x > 0.0)).count();
        4 * positive > 3 * self.len()
    }

    /// Errors of the mean accelerations with the given coefficients, `(windows, n)`; `NaN` where the mass matrix is singular.
    pub fn accelerations(&self, coefficients: &[f64]) -> Vec<f64> {
        let (n, count) = (self.n, self.terms);
        let used: Vec<usize> = (0..count).filter(|&k| coefficients[k] != 0.0).collect();
        let mut rest = Vec::with_capacity(self.len() * n);
        for at in 0..self.len() * n {
            let row = &self.equations[at * count..(at + 1) * count];
            let force = if self.driven() { self.forces[at] } else { 0.0 };
            rest.push(used.iter().map(|&k| row[k] * coefficients[k]).sum::<f64>() - force);
        }
        let mut a = vec![0.0; rest.len()];
        // Windows that fail are NaN.
        let _ = linalg::solve(n, &self.masses(coefficients), &rest, &mut a, &mut Workspace::new());
        a
    }

    /// Squared errors of the mean accelerations by window, in units of `sigma`; infinite where the mass matrix is singular.
    pub fn errors(&self, coefficients: &[f64], sigma: &[f64]) -> Vec<f64> {
        let error = |a: &[f64]| a.iter().zip(sigma).map(|(a, s)| (a / s).powi(2)).sum::<f64>();
        let all = self.accelerations(coefficients);
        all.chunks_exact(self.n).map(error).map(|square| if square.is_nan() { f64::INFINITY } else { square }).collect()
    }

    /// Mean squared errors of every coordinate's accelerations.
    pub fn errors_by_coordinate(&self, coefficients: &[f64], sigma: &[f64]) -> Vec<f64> {
        let all = self.accelerations(coefficients);
        let used = vec![true; self.len()];
        let of = |i: usize| {
            let own = all.iter().skip(i).step_by(self.n).map(|a| (a / sigma[i]).powi(2));
            mean(&own.map(|e| if e.is_nan() { f64::INFINITY } else { e }).collect::<Vec<_>>(), &used)
        };
        (0..self.n).map(of).collect()
    }

    /// Indices of the terms that do not couple any of the coordinates `alone` with another one.
    pub fn apart(&self, alone: &[usize]) -> Vec<usize> {
        let kept = |joined: &Vec<usize>| joined.iter().all(|i| !alone.contains(i) || joined.iter().all(|j| i == j));
        (0..self.terms).filter(|&k| kept(&self.joined[k])).collect()
    }

    /// The inverse mass matrices of `coefficients` in units of `sigma`, `(windows, n, n)`; 0 where there is none, and none far larger than
    /// the others.
    fn weights(&self, coefficients: &[f64], sigma: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut weights = vec![0.0; self.len() * n * n];
        let mut sizes = Vec::with_capacity(self.len());
        // Windows that fail are NaN.
        let _ = linalg::inverse(n, &self.masses(coefficients), &mut weights, &mut Workspace::new());
        for weight in weights.chunks_exact_mut(n * n) {
            if weight.iter().any(|w| w.is_nan()) {
                weight.fill(0.0);
            }
            (0..n * n).for_each(|e| weight[e] /= sigma[e / n]);
            sizes.push(weight.iter().map(|w| w * w).sum::<f64>().sqrt());
        }
        // Near a singular mass matrix an error would have unlimited weight.
        let mut sorted: Vec<f64> = sizes.iter().copied().filter(|s| *s > 0.0).collect();
        sorted.sort_by(f64::total_cmp);
        let most = MOST_WINDOW_WEIGHT * sorted.get(sorted.len() / 2).copied().unwrap_or(1.0);
        for (weight, size) in weights.chunks_exact_mut(n * n).zip(sizes) {
            let cut = if size > most { most / size } else { 1.0 };
            weight.iter_mut().for_each(|w| *w *= cut);
        }
        weights
    }

    /// Errors of accelerations over `sigma` that terms with coefficient 1 cause, `(set, windows, n)`, then those of a unit force on each
    /// coordinate, `(n, windows, n)`, with the mass matrix of `coefficients`.
    pub fn columns(&self, coefficients: &[f64], set: &[usize], sigma: &[f64]) -> [Vec<Vec<f64>>; 2] {
        let (n, count) = (self.n, self.terms);
        let weights = self.weights(coefficients, sigma);
        let of = |k: usize, window: usize, i: usize| {
            let weight = &weights[(window * n + i) * n..][..n];
            (0..n).map(|j| weight[j] * self.equations[(window * n + j) * count + k]).sum::<f64>()
        };
        let places = || (0..self.len() * n).map(|at| (at / n, at % n));
        let terms = set.iter().map(|&k| places().map(|(window, i)| of(k, window, i)).collect()).collect();
        let force = |j: usize| places().map(|(window, i)| weights[(window * n + i) * n + j]).collect();
        [terms, (0..n).map(force).collect()]
    }

    /// Normal equations of the errors of accelerations with the mass matrix of `coefficients`: the matrix of the terms `set`, the contribution
    /// of known forces on the right, and how the terms change the size of the mass matrix. Windows for which `used` is false are left out.
    pub fn normal(&self, coefficients: &[f64], set: &[usize], sigma: &[f64], used: &[bool]) -> Normal {
        let (n, count, m) = (self.n, self.terms, set.len());
        let weights = self.weights(coefficients, sigma);
        let mut normal = Normal { matrix: vec![0.0; m * m], right: vec![0.0; m], size: vec![0.0; m] };
        let mut row = vec![0.0; m];
        for window in (0..self.len()).filter(|&w| used[w]) {
            let weight = &weights[window * n * n..(window + 1) * n * n];
            for i in 0..n {
                row.fill(0.0);
                let mut force = 0.0;
                for j in 0..n {
                    let w = weight[i * n + j];
                    let equation = &self.equations[(window * n + j) * count..(window * n + j + 1) * count];
                    row.iter_mut().zip(set).for_each(|(r, &k)| *r += w * equation[k]);
                    if self.driven() {
                        force += w * self.forces[window * n + j];
                    }
                }
                for (a, &x) in row.iter().enumerate() {
                    if x != 0.0 {
                        let line = &mut normal.matrix[a * m..a * m + a + 1];
                        line.iter_mut().zip(&row).for_each(|(sum, y)| *sum += x * y);
                        normal.right[a] += x * force;
                    }
                }
            }
            let functions = &self.functions[window * self.width..(window + 1) * self.width];
            for (size, &k) in normal.size.iter_mut().zip(set) {
                if let Some((i, j, f)) = self.kinetic[k] {
                    *size += functions[f] * (weight[i * n + j] * sigma[i] + weight[j * n + i] * sigma[j]);
                }
            }
        }
        // 1 for the coefficients that gave the mass matrix.
        let count = n as f64 * used.iter().filter(|used| **used).count().max(1) as f64;
        normal.size.iter_mut().for_each(|size| *size /= count);
        for a in 0..m {
            for b in 0..a {
                normal.matrix[b * m + a] = normal.matrix[a * m + b];
            }
        }
        normal
    }

    /// `true` if a term of the mass matrix contains every coordinate's velocity.
    pub fn moves_all(&self, set: &[usize]) -> bool {
        (0..self.n).all(|i| set.iter().any(|&k| self.kinetic[k].is_some_and(|(a, b, _)| a == i || b == i)))
    }

    /// Coefficients of a unit mass of every coordinate, each weighted by `1 / scale^2`.
    pub fn unit_mass(&self, library: &Library, terms: &[usize], scales: &[f64]) -> Vec<f64> {
        let of = |&k: &usize| match library.kinetic(k) {
            Some((i, j)) if i == j && library.functions[library.terms[k].function].is_one() => 0.5 / scales[i].powi(2),
            _ => 0.0,
        };
        terms.iter().map(of).collect()
    }
}

/// All terms at the samples of a stretch.
struct SampledTerms {
    /// Derivatives of the terms by the velocities, `(samples, n, terms)`.
    momenta: Vec<f64>,
    /// Friction minus the derivatives of the terms by the coordinates, of the same shape.
    forces: Vec<f64>,
    /// Values of the functions, `(samples, functions)`.
    functions: Vec<f64>,
}

impl SampledTerms {
    fn new(library: &Library, (terms, which): (&[usize], &[usize]), stretch: &Stretch) -> Self {
        let (n, count, width, samples) = (library.n(), terms.len(), which.len(), stretch.times.len());
        let (mut momenta, mut forces) = (vec![0.0; samples * n * count], vec![0.0; samples * n * count]);
        let mut functions = vec![0.0; samples * width];
        let mut values = Values::new();
        for s in 0..samples {
            let (q, v) = (&stretch.q[s * n..(s + 1) * n], &stretch.v[s * n..(s + 1) * n]);
            library.evaluate(which, (q, stretch.times[s]), &mut values);
            which.iter().enumerate().for_each(|(at, &f)| functions[s * width + at] = values[f].value);
            let range = s * n * count..(s + 1) * n * count;
            let (momenta, forces) = (&mut momenta[range.clone()], &mut forces[range]);
            for (at, &k) in terms.iter().enumerate() {
                let Term { kind, function } = library.terms[k];
                let f = &values[function];
                let mut slope = |factor: f64| (0..n).for_each(|i| forces[i * count + at] -= factor * f.gradient[i]);
                match kind {
                    Kind::Kinetic(i, j) => {
                        momenta[i * count + at] += f.value * v[j];
                        momenta[j * count + at] += f.value * v[i];
                        slope(v[i] * v[j]);
                    }
                    Kind::Gyroscopic(i) => {
                        momenta[i * count + at] += f.value;
                        slope(v[i]);
                    }
                    Kind::Potential => slope(1.0),
                    Kind::Dissipation(i, j) => {
                        forces[i * count + at] += f.value * v[j];
                        forces[j * count + at] += f.value * v[i];
                    }
                }
            }
        }
        Self { momenta, forces, functions }
    }
}

/// Terms that act on separate coordinates.
pub(super) struct Group {
    /// Indices of the terms in the set.
    pub places: Vec<usize>,
    /// Fraction of the coordinates.
    pub share: f64,
}

/// Normal equations of some terms.
pub(super) struct Normal {
    pub matrix: Vec<f64>,
    pub right: Vec<f64>,
    pub size: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::super::extent::{Extent, Friction};
    use super::super::families::Families;
    use super::super::function::Notation;
    use super::*;

    /// Two masses of 1 kg, each on a spring of 1 N/m, with another such spring between them, and a third mass far away; the second spring's
    /// force is known instead of a term if `known`.
    fn windows(known: bool) -> (Library, Vec<usize>, Windows) {
        let names = ["a", "b", "c"].map(String::from);
        let extent = Extent { families: Families::default(), gyroscopic: false, friction: Friction::None, drive: None };
        let library = Library::new(&names, &[false; 3], extent, &[]).unwrap();
        let own = ["a_dot^2", "b_dot^2", "c_dot^2", "a^2", "b^2", "c^2", "a*b"];
        let find = |text: &&str| (0..library.terms.len()).find(|&k| library.written(k, Notation::System) == **text);
        let terms: Vec<usize> = own.iter().map(|text| find(text).unwrap()).collect();
        let times: Vec<f64> = (0..2001).map(|k| 0.01 * f64::from(k)).collect();
        let root = 3_f64.sqrt();
        let both = |x: f64, y: f64| [x + 0.5 * y, x - 0.5 * y];
        let position = |t: &f64| [&both(t.sin(), (root * t).sin())[..], &[(2.0 * t).cos()]].concat();
        let velocity = |t: &f64| [&both(t.cos(), root * (root * t).cos())[..], &[-2.0 * (2.0 * t).sin()]].concat();
        let coupling = |q: Vec<f64>| [q[1], q[0], 0.0];
        let stretch = Stretch {
            q: times.iter().flat_map(position).collect(),
            v: times.iter().flat_map(velocity).collect(),
            force: times.iter().filter(|_| known).flat_map(|t| coupling(position(t))).collect(),
            times,
            block: 0,
        };
        let windows = Windows::new(&library, &terms, &[stretch], 2.0);
        (library, terms, windows)
    }

    /// Coefficients of the terms of [`windows`], with and without the coupling.
    const COUPLED: [f64; 7] = [0.5, 0.5, 0.5, -1.0, -1.0, -2.0, 1.0];
    const UNCOUPLED: [f64; 7] = [0.5, 0.5, 0.5, -1.0, -1.0, -2.0, 0.0];

    #[test]
    fn exact_motion_satisfies_its_own_equations_alone() {
        for (known, truth) in [(false, COUPLED), (true, UNCOUPLED)] {
            let (_, _, windows) = windows(known);
            assert_eq!((windows.driven(), windows.len()), (known, 55));
            for error in windows.errors_by_coordinate(&truth, &[1.0; 3]) {
                assert!(error < 1e-12, "{known}: {error}");
            }
            for k in 3..7 {
                let mut wrong = truth;
                wrong[k] += 0.1;
                let errors = windows.errors_by_coordinate(&wrong, &[1.0; 3]);
                let touched: &[usize] = [&[0][..], &[1], &[2], &[0, 1]][k - 3];
                for (i, error) in errors.into_iter().enumerate() {
                    assert_eq!(error > 1e-4, touched.contains(&i), "{known}, term {k}, coordinate {i}: {error}");
                }
            }
        }
    }

    #[test]
    fn normal_equations_lead_to_the_coefficients() {
        for (known, truth) in [(false, COUPLED), (true, UNCOUPLED)] {
            let (_, _, windows) = windows(known);
            let used = vec![true; windows.len()];
            let normal = windows.normal(&truth, &[0, 1, 2, 3, 4, 5, 6], &[1.0, 2.0, 0.5], &used);
            for (row, right) in normal.matrix.chunks_exact(7).zip(&normal.right) {
                let product: f64 = row.iter().zip(truth).map(|(a, c)| a * c).sum();
                assert!((product - right).abs() < 1e-9 * row.iter().fold(1.0, |m, a| a.abs().max(m)), "{row:?}");
            }
            // The size of the mass matrix is that of the coefficients that gave it.
            let size: f64 = normal.size.iter().zip(truth).map(|(size, c)| size * c).sum();
            assert!((size - 1.0).abs() < 1e-12, "{size}");
        }
    }

    #[test]
    fn masses_are_definite_where_all_are_positive() {
        let (library, terms, windows) = windows(false);
        let unit = windows.unit_mass(&library, &terms, &[1.0, 2.0, 0.5]);
        assert_eq!(unit[..3], [0.5, 0.125, 2.0]);
        assert!(unit[3..].iter().all(|c| *c == 0.0));
        assert!(windows.is_definite(&unit) && windows.is_definite(&COUPLED) && windows.is_regular(&COUPLED));
        assert!(!windows.is_definite(&COUPLED.map(|c| -c)) && windows.is_regular(&COUPLED.map(|c| -c)));
        let massless = [0.5, 0.5, 0.0, -1.0, -1.0, -2.0, 1.0];
        assert!(!windows.is_definite(&massless) && !windows.is_regular(&massless));
        assert!(windows.errors(&massless, &[1.0; 3]).iter().all(|error| error.is_infinite()));
    }
}
