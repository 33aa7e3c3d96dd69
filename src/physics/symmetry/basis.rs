//! Functions of the coordinates: products of one factor per coordinate, of powers, harmonics, cotangents, hyperbolic functions.

use super::thresholds::{HIGHEST_DEGREE, MOST_NUMBERS, MOST_UNKNOWNS, MOST_USUAL_UNKNOWNS};
use crate::names::unknown;
use std::f64::consts::PI;
use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

/// Values that a coordinate takes, which decide the functions of it that are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chart {
    /// Any number: powers `x, x^2, ..`.
    Line,
    /// Numbers that keep away from 0, such as a radius: powers and reciprocal powers `1/x, 1/x^2, ..`.
    HalfLine,
    /// An angle that may go round: harmonics `sin x, cos x, sin 2x, ..`.
    Circle,
    /// An angle between two poles, at 0 and `pi`: harmonics, `cot x` and `1/sin x`.
    Polar,
    /// A number between 0 and `pi` that may be a polar angle or a radius: the functions of both.
    Either,
}

impl Chart {
    /// The chart of a coordinate of this unit over this range: an angle that is not periodic and stays between two poles, any
    /// other angle, a number of one sign, any number. A number of unit 1 between 0 and `pi` may be a polar angle.
    pub fn of(periodic: bool, unit: &str, [low, high]: [f64; 2]) -> Self {
        let between_poles = low > 0.0 && high < PI;
        match (periodic, unit) {
            (true, _) => Self::Circle,
            (_, "rad") if between_poles => Self::Polar,
            (_, "1") if between_poles => Self::Either,
            (_, "rad") => Self::Circle,
            _ if low > 0.0 || high < 0.0 => Self::HalfLine,
            _ => Self::Line,
        }
    }
}

/// Highest degrees of the functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Degrees {
    /// Total degree of the powers of the coordinates that are not angles; a reciprocal power counts as the power does.
    pub polynomial: usize,
    /// Total degree of the harmonics of the angles; `cot x` and `1/sin x` count 1.
    pub trigonometric: usize,
    /// Total degree of `sinh x, cosh x, sinh 2x, ..` of the coordinates that are not angles; `coth x` and `1/sinh x` of those that stay
    /// away from 0 count 1.
    pub hyperbolic: usize,
}

/// Writes the text that `from_str` reads, every family with its degree.
impl Display for Degrees {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { polynomial, trigonometric, hyperbolic } = self;
        write!(f, "polynomial:{polynomial},trigonometric:{trigonometric},hyperbolic:{hyperbolic}")
    }
}

/// Degrees in a text such as `polynomial:2,trigonometric:1`; a missing family has degree 0.
///
/// ```
/// use lnn::symmetry::Degrees;
///
/// let degrees: Degrees = "polynomial:2,trigonometric:1".parse().unwrap();
/// assert_eq!((degrees.polynomial, degrees.trigonometric, degrees.hyperbolic), (2, 1, 0));
/// assert_eq!(degrees.to_string(), "polynomial:2,trigonometric:1,hyperbolic:0");
/// assert!("polynomial:-1".parse::<Degrees>().is_err());
/// ```
impl FromStr for Degrees {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let mut degrees = Self { polynomial: 0, trigonometric: 0, hyperbolic: 0 };
        for part in text.split(',') {
            let (family, degree) = part.split_once(':').ok_or("expected FAMILY:DEGREE, such as polynomial:2")?;
            let family = family.trim();
            let place = match family {
                "polynomial" => &mut degrees.polynomial,
                "trigonometric" => &mut degrees.trigonometric,
                "hyperbolic" => &mut degrees.hyperbolic,
                _ => return Err(unknown("family", family, ["polynomial", "trigonometric", "hyperbolic"])),
            };
            let degree = degree.trim().parse().ok().filter(|degree| *degree <= HIGHEST_DEGREE);
            *place = degree.ok_or_else(|| format!("{family}: expected a degree from 0 to {HIGHEST_DEGREE}"))?;
        }
        Ok(degrees)
    }
}

impl Degrees {
    /// Degree 2 of the powers; as many harmonics as the fields of a sphere in these coordinates need, one more than there are
    /// polar angles, from 2 to 12.
    pub fn usual(charts: &[Chart]) -> Self {
        let polar = charts.iter().filter(|chart| matches!(chart, Chart::Polar | Chart::Either)).count();
        Self { polynomial: 2, trigonometric: (polar + 1).clamp(2, HIGHEST_DEGREE), hyperbolic: 0 }
    }
}

/// A function of one coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Factor {
    One,
    Power(i32),
    Sine(u32),
    Cosine(u32),
    /// `cot^a x / sin^b x`, `b` 0 or 1.
    Pole(u32, u32),
    Sinh(u32),
    Cosh(u32),
    /// `coth^a x / sinh^b x`, `b` 0 or 1.
    Throat(u32, u32),
}

/// Families of functions, each with a separate degree.
const FAMILIES: usize = 3;

impl Degrees {
    fn of_families(self) -> [usize; FAMILIES] {
        [self.polynomial, self.trigonometric, self.hyperbolic]
    }
}

impl Factor {
    /// All of a chart up to these degrees, the constant first, then by degree.
    fn all(chart: Chart, degrees: Degrees) -> Vec<Self> {
        let mut all = vec![Self::One];
        let most = degrees.of_families().into_iter().max().unwrap_or(0) as u32;
        let (number, angle) =
            (!matches!(chart, Chart::Circle | Chart::Polar), !matches!(chart, Chart::Line | Chart::HalfLine));
        let away = matches!(chart, Chart::HalfLine | Chart::Either);
        for k in 1..=most {
            if number {
                all.push(Self::Power(k as i32));
                all.extend(away.then_some(Self::Power(-(k as i32))));
            }
            if angle {
                all.extend([Self::Sine(k), Self::Cosine(k)]);
                let poles = chart != Chart::Circle;
                all.extend([Self::Pole(k, 0), Self::Pole(k - 1, 1)].into_iter().filter(|_| poles));
            }
            if number {
                all.extend([Self::Sinh(k), Self::Cosh(k)]);
                all.extend([Self::Throat(k, 0), Self::Throat(k - 1, 1)].into_iter().filter(|_| away));
            }
        }
        let allowed = |factor: &Self| factor.degree() <= degrees.of_families()[factor.family()];
        all.retain(allowed);
        all
    }

    fn family(self) -> usize {
        match self {
            Self::One | Self::Power(_) => 0,
            Self::Sine(_) | Self::Cosine(_) | Self::Pole(..) => 1,
            Self::Sinh(_) | Self::Cosh(_) | Self::Throat(..) => 2,
        }
    }

    fn degree(self) -> usize {
        match self {
            Self::One => 0,
            Self::Power(k) => k.unsigned_abs() as usize,
            Self::Sine(k) | Self::Cosine(k) | Self::Sinh(k) | Self::Cosh(k) => k as usize,
            Self::Pole(a, b) | Self::Throat(a, b) => (a + b) as usize,
        }
    }

    /// Value and derivative.
    fn at(self, x: f64) -> [f64; 2] {
        match self {
            Self::One => [1.0, 0.0],
            Self::Power(k) => [x.powi(k), f64::from(k) * x.powi(k - 1)],
            Self::Sine(k) => {
                let k = f64::from(k);
                [(k * x).sin(), k * (k * x).cos()]
            }
            Self::Cosine(k) => {
                let k = f64::from(k);
                [(k * x).cos(), -k * (k * x).sin()]
            }
            Self::Sinh(k) => {
                let k = f64::from(k);
                [(k * x).sinh(), k * (k * x).cosh()]
            }
            Self::Cosh(k) => {
                let k = f64::from(k);
                [(k * x).cosh(), k * (k * x).sinh()]
            }
            // Both quotients have the derivative -1/sin^2, or -1/sinh^2, both reciprocals -cot/sin, or -coth/sinh.
            Self::Pole(a, b) => quotient(x.cos(), x.sin(), a, b),
            Self::Throat(a, b) => quotient(x.cosh(), x.sinh(), a, b),
        }
    }

    fn text(self, name: &str) -> String {
        let power = |k: i32| if k == 1 { name.to_string() } else { format!("{name}^{k}") };
        let of = |function: &str, k: u32| {
            if k == 1 { format!("{function}({name})") } else { format!("{function}({k}*{name})") }
        };
        match self {
            Self::One => String::new(),
            Self::Power(k) if k < 0 => format!("1/{}", power(-k)),
            Self::Power(k) => power(k),
            Self::Sine(k) => of("sin", k),
            Self::Cosine(k) => of("cos", k),
            Self::Sinh(k) => of("sinh", k),
            Self::Cosh(k) => of("cosh", k),
            Self::Pole(a, b) => poles("cot", "sin", name, a, b),
            Self::Throat(a, b) => poles("coth", "sinh", name, a, b),
        }
    }
}

/// `(c/s)^a / s^b` and its derivative, where `(c/s)' = -1/s^2` and `(1/s)' = -c/s^2`.
fn quotient(c: f64, s: f64, a: u32, b: u32) -> [f64; 2] {
    let ratio = c / s;
    let value = ratio.powi(a as i32) / s.powi(b as i32);
    let of_ratio = if a == 0 { 0.0 } else { f64::from(a) * ratio.powi(a as i32 - 1) / s.powi(b as i32 + 2) };
    [value, -of_ratio - f64::from(b) * ratio * value]
}

fn poles(ratio: &str, below: &str, name: &str, a: u32, b: u32) -> String {
    let above = if a > 1 { format!("{ratio}({name})^{a}") } else { format!("{ratio}({name})") };
    match (a, b) {
        (_, 0) => above,
        (0, _) => format!("1/{below}({name})"),
        _ => format!("{above}/{below}({name})"),
    }
}

/// Functions of the coordinates, simple ones first; the first is the constant 1.
#[derive(Clone, Debug)]
pub struct Basis {
    names: Vec<String>,
    factors: Vec<Vec<Factor>>,
    /// For every function, the index of its factor in each coordinate.
    products: Vec<Vec<usize>>,
}

/// Values `(functions)` and gradients `(functions, n)` of a basis at a point.
#[derive(Clone, Debug, Default)]
pub(crate) struct Values {
    /// Values.
    pub value: Vec<f64>,
    /// Gradients, by coordinate fastest.
    pub gradient: Vec<f64>,
}

impl Basis {
    /// All products of factors of coordinates `names` with these charts up to these degrees.
    ///
    /// # Panics
    /// Panics if the numbers of names and charts differ.
    pub fn new(names: &[String], charts: &[Chart], degrees: Degrees) -> Self {
        assert_eq!(names.len(), charts.len(), "a chart for every coordinate");
        let factors: Vec<Vec<Factor>> = charts.iter().map(|chart| Factor::all(*chart, degrees)).collect();
        let most = degrees.of_families();
        let mut products: Vec<(Vec<usize>, [usize; FAMILIES])> = vec![(Vec::new(), [0; FAMILIES])];
        for factors in &factors {
            let longer = products.iter().flat_map(|(product, used)| {
                factors.iter().enumerate().filter_map(move |(k, factor)| {
                    let (mut used, family) = (*used, factor.family());
                    used[family] += factor.degree();
                    (used[family] <= most[family]).then(|| ([product.as_slice(), &[k]].concat(), used))
                })
            });
            products = longer.collect();
        }
        products.sort_by_key(|(_, used)| used.iter().sum::<usize>());
        Self { names: names.to_vec(), factors, products: products.into_iter().map(|(product, _)| product).collect() }
    }

    /// Number of functions of [`Basis::new`], counted without making them, at most `usize::MAX`.
    pub(crate) fn count(charts: &[Chart], degrees: Degrees) -> usize {
        Self::number(charts, degrees) as usize
    }

    /// The number of functions, rounded where it is beyond all use.
    fn number(charts: &[Chart], degrees: Degrees) -> f64 {
        let most = degrees.of_families();
        let place = |used: [usize; FAMILIES]| (used[0] * (most[1] + 1) + used[1]) * (most[2] + 1) + used[2];
        let all: Vec<[usize; FAMILIES]> = (0..=most[0])
            .flat_map(|a| (0..=most[1]).flat_map(move |b| (0..=most[2]).map(move |c| [a, b, c])))
            .collect();
        // Products of the factors of the coordinates so far, by their degrees.
        let mut products = vec![0.0; all.len()];
        products[0] = 1.0;
        for chart in charts {
            let mut longer = vec![0.0; all.len()];
            for factor in Factor::all(*chart, degrees) {
                let family = factor.family();
                for used in &all {
                    let mut sum = *used;
                    sum[family] += factor.degree();
                    if sum[family] <= most[family] {
                        longer[place(sum)] += products[place(*used)];
                    }
                }
            }
            products = longer;
        }
        products.iter().sum()
    }

    /// [`Degrees::usual`] of these charts, or lower ones if a search for symmetries would have too many unknown coefficients: first the
    /// powers are lowered, then the harmonics.
    pub(crate) fn usual(names: &[String], charts: &[Chart]) -> (Self, Degrees) {
        let count = |degrees: &Degrees| Self::number(charts, *degrees);
        let mut degrees = Degrees::usual(charts);
        while unknowns(names.len(), count(&degrees) as usize) > MOST_USUAL_UNKNOWNS {
            let lower = [
                Degrees { polynomial: degrees.polynomial.saturating_sub(1), ..degrees },
                Degrees { trigonometric: degrees.trigonometric.saturating_sub(1), ..degrees },
            ];
            let Some(next) = lower.into_iter().find(|lower| count(lower) < count(&degrees)) else { break };
            degrees = next;
        }
        (Self::new(names, charts, degrees), degrees)
    }

    /// Functions up to these degrees, unless they are too many, or the usual ones of the charts, with their degrees.
    ///
    /// # Errors
    /// Returns a description of the expected degrees.
    pub fn within(names: &[String], charts: &[Chart], degrees: Option<Degrees>) -> Result<(Self, Degrees), String> {
        let Some(degrees) = degrees else { return Ok(Self::usual(names, charts)) };
        let unknowns = unknowns(charts.len(), Self::count(charts, degrees));
        if unknowns > MOST_UNKNOWNS {
            let found =
                if unknowns == usize::MAX { "more than can be counted".to_string() } else { unknowns.to_string() };
            let expected = format!("expected degrees with at most {MOST_UNKNOWNS} unknown coefficients, found {found}");
            return Err(expected);
        }
        Ok((Self::new(names, charts, degrees), degrees))
    }

    /// The functions that do not depend on these coordinates, times each of the two first harmonics of the coordinate `angle`,
    /// if one is given.
    #[must_use]
    pub(crate) fn without(&self, coordinates: &[bool], angle: Option<usize>) -> Self {
        let harmonic =
            |k: usize, i: usize| matches!(self.factors[i][k], Factor::Sine(1) | Factor::Cosine(1)) && angle == Some(i);
        let fits = |product: &&Vec<usize>| {
            product.iter().enumerate().all(|(i, &k)| match angle == Some(i) {
                true => harmonic(k, i),
                false => k == 0 || !coordinates[i],
            })
        };
        Self { products: self.products.iter().filter(fits).cloned().collect(), ..self.clone() }
    }

    /// The coordinates that have harmonics alone.
    pub(crate) fn circles(&self) -> impl Iterator<Item = usize> + '_ {
        let harmonic = |factor: &Factor| matches!(factor, Factor::Sine(_) | Factor::Cosine(_));
        let circle = move |i: &usize| self.factors[*i].len() > 1 && self.factors[*i][1..].iter().all(harmonic);
        (0..self.factors.len()).filter(circle)
    }

    /// Names of the coordinates.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// Number of functions.
    pub fn len(&self) -> usize {
        self.products.len()
    }

    /// `true` without functions.
    pub fn is_empty(&self) -> bool {
        self.products.is_empty()
    }

    /// Values and gradients at `q`, `(n)`.
    pub(crate) fn evaluate(&self, q: &[f64], values: &mut Values) {
        let n = self.names.len();
        let at: Vec<Vec<[f64; 2]>> =
            self.factors.iter().zip(q).map(|(factors, &x)| factors.iter().map(|f| f.at(x)).collect()).collect();
        values.value.clear();
        values.gradient.clear();
        for product in &self.products {
            let factor = |i: usize, slope: bool| at[i][product[i]][usize::from(slope)];
            values.value.push((0..n).map(|i| factor(i, false)).product());
            values.gradient.extend((0..n).map(|along| (0..n).map(|i| factor(i, i == along)).product::<f64>()));
        }
    }

    /// Function `k` as a formula; empty for the constant.
    pub(crate) fn text(&self, k: usize) -> String {
        let factors = self.products[k].iter().enumerate().map(|(i, &f)| self.factors[i][f].text(&self.names[i]));
        let (below, above): (Vec<String>, Vec<String>) =
            factors.filter(|text| !text.is_empty()).partition(|text| text.starts_with("1/"));
        let above = above.join("*");
        below.iter().fold(above, |text, divisor| {
            let divisor = divisor.trim_start_matches("1/");
            if text.is_empty() { format!("1/{divisor}") } else { format!("{text}/{divisor}") }
        })
    }
}

/// Number of unknown coefficients of fields and gauge function over a basis of `functions` functions of `n` coordinates.
pub fn unknowns(n: usize, functions: usize) -> usize {
    (n + 1).saturating_mul(functions)
}

/// Largest number of states of a search for `unknowns` coefficients of `n` coordinates.
pub fn most_states(n: usize, unknowns: usize) -> usize {
    MOST_NUMBERS / unknowns.max(n * n).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_are_those_of_the_values() {
        let names = ["x", "r", "theta", "phi"].map(String::from);
        let charts = [Chart::Line, Chart::HalfLine, Chart::Polar, Chart::Circle];
        let basis = Basis::new(&names, &charts, Degrees { polynomial: 3, trigonometric: 3, hyperbolic: 2 });
        let at = |q: [f64; 4]| {
            let mut values = Values::default();
            basis.evaluate(&q, &mut values);
            values
        };
        let (q, h) = ([0.7, 1.9, 1.1, 4.0], 1e-5);
        let here = at(q);
        assert_eq!((here.value[0], here.value.len()), (1.0, basis.len()));
        for i in 0..4 {
            let shifted = |h: f64| at(std::array::from_fn(|k| q[k] + if k == i { h } else { 0.0 })).value;
            for (k, (a, b)) in shifted(h).iter().zip(shifted(-h)).enumerate() {
                let slope = here.gradient[4 * k + i];
                assert!(
                    ((a - b) / (2.0 * h) - slope).abs() < 1e-7 * slope.abs().max(1.0),
                    "{} along {i}",
                    basis.text(k)
                );
            }
        }
        let texts: Vec<String> = (0..basis.len()).map(|k| basis.text(k)).collect();
        for text in ["", "x^2", "cot(theta)*cos(phi)", "x/r", "sin(phi)/sin(theta)", "1/r^2/sin(theta)", "x*coth(r)"] {
            assert!(texts.iter().any(|known| known == text), "{text:?} is none of {texts:?}");
        }
    }

    #[test]
    fn usual_functions_are_not_too_many() {
        let of = |charts: &[Chart]| Basis::usual(&vec!["q".to_string(); charts.len()], charts).1;
        let whole = Degrees { polynomial: 2, trigonometric: 2, hyperbolic: 0 };
        assert_eq!(of(&[Chart::Line, Chart::HalfLine, Chart::Polar, Chart::Circle]), whole);
        assert_eq!(of(&[Chart::Circle; 20]).trigonometric, 1);
        let turning = of(&[Chart::Line, Chart::HalfLine, Chart::Polar, Chart::Polar, Chart::Circle]);
        assert_eq!((turning.polynomial, turning.trigonometric), (0, 3));
        assert_eq!(of(&[Chart::Line; 64]).polynomial, 0);
        // Even their number is beyond all counting.
        let many = [Chart::Either; 64];
        assert_eq!(Basis::count(&many, "polynomial:12,trigonometric:12,hyperbolic:12".parse().unwrap()), usize::MAX);
        assert_eq!((of(&many).polynomial, of(&many).trigonometric), (0, 0));
    }

    #[test]
    fn functions_are_counted_without_being_made() {
        let charts = [Chart::Line, Chart::HalfLine, Chart::Polar, Chart::Circle, Chart::Either];
        for degrees in ["polynomial:2,trigonometric:3", "hyperbolic:2,polynomial:1", "trigonometric:2,hyperbolic:1"] {
            let degrees: Degrees = degrees.parse().unwrap();
            let basis = Basis::new(&vec!["q".to_string(); charts.len()], &charts, degrees);
            assert_eq!(Basis::count(&charts, degrees), basis.len(), "{degrees}");
        }
    }

    #[test]
    fn charts_follow_unit_and_range() {
        assert_eq!(Chart::of(true, "rad", [0.0, 6.3]), Chart::Circle);
        assert_eq!(Chart::of(false, "rad", [0.3, 2.8]), Chart::Polar);
        assert_eq!(Chart::of(false, "1", [0.3, 2.8]), Chart::Either);
        assert_eq!(Chart::of(false, "rad", [-1.0, 1.0]), Chart::Circle);
        assert_eq!(Chart::of(false, "m", [0.5, 2.8]), Chart::HalfLine);
        assert_eq!(Chart::of(false, "m", [-5.0, -2.8]), Chart::HalfLine);
        assert_eq!(Chart::of(false, "m", [-5.0, 2.8]), Chart::Line);
        assert_eq!(
            Degrees::usual(&[Chart::Polar, Chart::Circle]),
            Degrees { polynomial: 2, trigonometric: 2, hyperbolic: 0 }
        );
    }
}
