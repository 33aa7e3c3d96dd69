//! Activation kernels: time per element against the worst error in roundings of the value's own condition.

use super::options::Options;
use super::output::{Section, Table, curve, dots, level, short};
use super::timing::Timing;
use lnn::forward::HyperDual;
use lnn::network::Activation;
use lnn::scalar::{Dd, Real, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;

const TEXT: &str = "\
R of derivative k at x: |found - exact| / (eps (|f^(k)| + |x f^(k+1)|)), the exact value in double-double at the very x; \
errors below two of the smallest subnormal do not count. The worst R is over all derivatives that a kernel computes and \
over points dense near 0, log-spaced to 1000 on both sides, subnormal and random.
Time: nanoseconds per element of a slice of 4096 normal numbers of width 2.
Kernels: value, jet1 to jet3 (value and so many derivatives); nested: the plain formula over forward numbers, value and \
two derivatives.";

/// Elements of the timed slice.
const ELEMENTS: usize = 4096;

/// A kernel: slice in, value and derivatives out.
#[derive(Clone, Copy, PartialEq)]
enum Kernel {
    /// The library's, with this many derivatives.
    Jet(usize),
    /// The plain formula over forward numbers.
    Nested,
}

impl Kernel {
    const ALL: [Self; 5] = [Self::Jet(0), Self::Jet(1), Self::Jet(2), Self::Jet(3), Self::Nested];

    fn name(self) -> &'static str {
        match self {
            Self::Jet(0) => "value",
            Self::Jet(1) => "jet1",
            Self::Jet(2) => "jet2",
            Self::Jet(_) => "jet3",
            Self::Nested => "nested",
        }
    }

    fn derivatives(self) -> usize {
        match self {
            Self::Jet(count) => count,
            Self::Nested => 2,
        }
    }

    fn run<S: Scalar>(self, activation: Activation, x: &[S], [f, d1, d2, d3]: &mut [Vec<S>; 4]) {
        match self {
            Self::Jet(0) => activation.value(x, f),
            Self::Jet(1) => activation.jet1(x, f, d1),
            Self::Jet(2) => activation.jet2(x, f, d1, d2),
            Self::Jet(_) => activation.jet3(x, f, d1, d2, d3),
            Self::Nested => {
                let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
                for (k, &x) in x.iter().enumerate() {
                    let jet = activation.apply(HyperDual::new(x, one, one, zero));
                    (f[k], d1[k], d2[k]) = (jet.value, jet.s, jet.st);
                }
            }
        }
    }
}

/// Measures every activation in `f32` and `f64`.
pub fn section(options: &Options) -> Section {
    let mut raw = Table::new(["activation", "precision", "kernel", "worst_r", "worst_derivative", "worst_x"]);
    raw.header.extend(Timing::HEADER.map(|name| if name == "repeats" { name.into() } else { format!("ns_{name}") }));
    let summary = Table::new(["activation", "precision", "kernel", "worst R", "derivative", "at x", "ns per element"]);
    let mut section = Section::new("activations", "Activation kernels", TEXT, raw, summary);
    measure::<f32>(options, &mut section);
    measure::<f64>(options, &mut section);
    section
}

fn measure<S: Scalar>(options: &Options, section: &mut Section) {
    let points: Vec<S> = points(options.choose(200, 4000, 20_000)).into_iter().map(S::of_f64).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let timed: Vec<S> =
        (0..ELEMENTS).map(|_| S::of_f64(2.0 * rng.sample::<f64, _>(rand_distr::StandardNormal))).collect();
    let stopwatch = options.stopwatch();
    let blank = |count: usize| -> [Vec<S>; 4] { std::array::from_fn(|_| vec![S::nan(); count]) };
    let (mut curves, mut nested) = (Vec::new(), Vec::new());
    for activation in Activation::ALL.into_iter().filter(|&a| a != Activation::Identity) {
        let exact: Vec<[Dd; 5]> = points.iter().map(|x| activation.derivatives(x.cast::<Dd>())).collect();
        let mut line = Vec::new();
        for kernel in Kernel::ALL {
            let mut found = blank(points.len());
            kernel.run(activation, &points, &mut found);
            let (r, derivative, x) = worst(&points, &exact, &found[..=kernel.derivatives()]);
            let mut out = blank(ELEMENTS);
            let time = stopwatch.measure(|| kernel.run(activation, black_box(&timed), black_box(&mut out)));
            let scale = 1e9 / ELEMENTS as f64;
            let name = [activation.name(), S::NAME, kernel.name()].map(String::from);
            let mut row = name.to_vec();
            row.extend([format!("{r:.4e}"), derivative.to_string(), format!("{x:.9e}")]);
            row.extend(time.cells(scale));
            section.raw.rows.push(row);
            let mut row = name.to_vec();
            row.extend([format!("{r:.3}"), derivative.to_string(), short(x), format!("{:.3}", time.median * scale)]);
            section.summary.rows.push(row);
            if !r.is_finite() {
                section.failed(name.join(", "), format!("derivative {derivative} at {x:e} is not finite"));
            }
            if kernel == Kernel::Nested {
                nested.push((r, time.median * scale));
            } else {
                line.push((r, time.median * scale));
            }
        }
        curves.push(curve(activation.name(), &line));
    }
    curves.push(dots("nested", &nested));
    curves.push(level("R = 30", 30.0, &curves));
    let title = format!("Activations in {}: value, then one to three derivatives", S::NAME);
    section.diagram(S::NAME.into(), &title, "worst R", "time per element [ns]", curves);
}

/// Worst R over points and derivatives, which derivative and where; infinite for a number that is not finite.
fn worst<S: Scalar>(points: &[S], exact: &[[Dd; 5]], found: &[Vec<S>]) -> (f64, usize, f64) {
    let eps = S::epsilon().to_f64();
    let smallest = if S::NAME == "f32" { f64::from(f32::from_bits(1)) } else { f64::from_bits(1) };
    let mut worst = (0.0, 0, 0.0);
    for (k, (x, exact)) in points.iter().zip(exact).enumerate() {
        let x = x.to_f64();
        for (order, found) in found.iter().enumerate() {
            let error = (found[k].cast::<Dd>() - exact[order]).to_f64().abs() - 2.0 * smallest;
            let size = eps * (exact[order].to_f64().abs() + (x * exact[order + 1].to_f64()).abs());
            let r = if !found[k].is_finite() {
                f64::INFINITY
            } else if error <= 0.0 {
                0.0
            } else {
                error / size
            };
            if r > worst.0 {
                worst = (r, order, x);
            }
        }
    }
    worst
}

/// Points over all scales, both signs.
fn points(random: usize) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut magnitudes: Vec<f64> = (0..200).map(|k| f64::from(k) * 0.0625).collect();
    magnitudes.extend((-40..=13).map(|k| 1.7 * 2f64.powi(k)).filter(|&x| x < 1000.0));
    magnitudes.extend([1000.0, 1e-30, 1e-37, 1e-38, 1e-40, 1e-45, 1e-300, 1e-310, 5e-324]);
    magnitudes.extend((0..random).map(|_| rng.random_range(0.0..14.0)));
    magnitudes.iter().flat_map(|&m| [m, -m]).collect()
}
