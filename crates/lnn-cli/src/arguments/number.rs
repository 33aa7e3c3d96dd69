//! Parses values of the command line: numbers within ranges, and choices by name.

use crate::CliError;
use crate::thresholds::MOST_EDGES;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use lnn::lagrangian::quantity;
use lnn::names::unknown;
use lnn::rollout::RolloutOptions;
use lnn::scalar::Scalar;
use lnn::storage::MOST_THREADS;

/// Precision of a computation.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum Precision {
    /// Single, 9 digits.
    F32,
    /// Double, 17 digits.
    F64,
    /// Double-double, about 32 digits.
    Dd,
}

/// Calls a function that is generic over the scalar in a [`Precision`].
macro_rules! in_precision {
    ($precision:expr, $function:ident($argument:expr)) => {
        match $precision {
            $crate::arguments::number::Precision::F32 => $function::<f32>($argument),
            $crate::arguments::number::Precision::F64 => $function::<f64>($argument),
            $crate::arguments::number::Precision::Dd => $function::<lnn::scalar::Dd>($argument),
        }
    };
}
pub(crate) use in_precision;

/// A parser of one value of a type by its name; the help describes each value.
pub fn choice<T: Copy + Send + Sync>(
    all: &'static [T],
    name: fn(T) -> &'static str,
    about: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let values = all.iter().map(|&value| PossibleValue::new(name(value)).help(about(value)));
    PossibleValuesParser::new(values)
        .try_map(move |text| all.iter().copied().find(|&x| name(x) == text).ok_or("not named"))
}

/// A finite decimal number.
pub fn finite(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err("expected a finite number".to_string()),
    }
}

/// A finite decimal number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|x| *x > 0.0).ok_or_else(|| "expected a finite number above 0".to_string())
}

/// A finite decimal number of at least 0.
pub fn weight(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|x| *x >= 0.0).ok_or_else(|| "expected a finite number of at least 0".to_string())
}

/// A parser of numbers from `least` to `most`.
pub fn number(least: f64, most: f64) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| {
        let refused = || format!("expected a number from {} to {}", digits(least), digits(most));
        finite(text).ok().filter(|x| (least..=most).contains(x)).ok_or_else(refused)
    }
}

/// Formats a bound with all digits.
fn digits(x: f64) -> String {
    if x == 0.0 || (1e-4..1e6).contains(&x.abs()) { x.to_string() } else { format!("{x:e}") }
}

/// A parser of whole numbers from `least` to `most`.
pub fn whole(least: usize, most: usize) -> impl Fn(&str) -> Result<usize, String> + Clone + Send + Sync + 'static {
    move |text| {
        let refused = || format!("expected a whole number from {least} to {most}");
        text.trim().parse().ok().filter(|n| (least..=most).contains(n)).ok_or_else(refused)
    }
}

/// A relative tolerance of an integration in double precision: not finer than rounding, not coarser than 1.
pub fn tolerance(text: &str) -> Result<f64, String> {
    number(RolloutOptions::<f64>::least_tolerance(), 1.0)(text)
}

/// A parser of numbers above 0, at most `most`.
pub fn positive_up_to(most: f64) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| {
        positive(text).ok().filter(|x| *x <= most).ok_or_else(|| format!("expected a number above 0, at most {most}"))
    }
}

/// A time in seconds over which a command may work: up to a day.
pub fn seconds(text: &str) -> Result<f64, String> {
    positive_up_to(86_400.0)(text)
}

/// Samples per second of a recording.
pub fn rate(text: &str) -> Result<f64, String> {
    number(1e-9, 1e12)(text)
}

/// A seed no larger than a configuration can store.
pub fn seed(text: &str) -> Result<u64, String> {
    let refused = || format!("expected a whole number from 0 to {}", i64::MAX);
    text.trim().parse().ok().filter(|seed| i64::try_from(*seed).is_ok()).ok_or_else(refused)
}

/// Two finite decimal numbers, the lower first: `LOW:HIGH`.
pub fn bounds(text: &str) -> Result<(f64, f64), String> {
    range(text, ":").ok_or_else(|| "expected LOW:HIGH, two finite numbers in order".to_string())
}

/// Two finite decimal numbers around a separator, the lower first.
pub fn range(text: &str, separator: &str) -> Option<(f64, f64)> {
    let (low, high) = text.split_once(separator)?;
    let (low, high) = (finite(low).ok()?, finite(high).ok()?);
    (low <= high && (high - low).is_finite()).then_some((low, high))
}

/// A coefficient of a term, other than 0: `TERM=VALUE`.
pub fn coefficient(text: &str) -> Result<(String, f64), String> {
    let wrong = || "expected TERM=VALUE, such as x_dot^2=0.5".to_string();
    let (term, value) = text.rsplit_once('=').ok_or_else(wrong)?;
    let value = finite(value).ok().filter(|value| *value != 0.0).ok_or_else(wrong)?;
    Ok((term.trim().to_string(), value))
}

/// A number of directions all around, a multiple of four.
pub fn directions(text: &str) -> Result<usize, String> {
    let number = weight(text).ok().filter(|x| x % 4.0 == 0.0 && *x <= MOST_EDGES);
    number.map(|x| x as usize).ok_or_else(|| format!("expected a multiple of four from 0 to {MOST_EDGES}"))
}

/// A whole number above 0.
pub fn count(text: &str) -> Result<usize, String> {
    text.trim().parse().ok().filter(|n| *n > 0).ok_or_else(|| "expected a whole number above 0".to_string())
}

/// A finite number for each of `names`, separated by commas, read in the precision of `S`; `option` is the name of the option.
///
/// # Errors
/// A usage error with the expected number and names.
pub fn list<S: Scalar>(option: &str, text: &str, names: &[String]) -> Result<Vec<S>, CliError> {
    let numbers: Option<Vec<S>> = text.split(',').map(|x| S::parse(x.trim()).filter(|x| x.is_finite())).collect();
    let expected = format!("expected {} finite numbers ({})", names.len(), names.join(","));
    let numbers = numbers.ok_or_else(|| CliError::usage(format_args!("{option}: {expected}, found {text:?}")))?;
    match numbers.len() {
        found if found == names.len() => Ok(numbers),
        found => Err(CliError::usage(format_args!("{option}: {expected}, found {found}"))),
    }
}

/// A value for each of `names` from `NAME=VALUE,..` in any order, numbers or formulas of numbers, read in the precision of `S`; `option` is
/// the name of the option.
///
/// # Errors
/// A usage error that names an unknown, repeated or missing name, or a value that is not a finite number.
pub fn named<S: Scalar>(option: &str, text: &str, names: &[String]) -> Result<Vec<S>, CliError> {
    let refused = |problem: String| CliError::usage(format_args!("{option}: {problem}"));
    let mut values: Vec<Option<S>> = vec![None; names.len()];
    for part in outer_parts(text) {
        let Some((name, value)) = part.split_once('=') else {
            return Err(refused(format!("expected NAME=VALUE, found {:?}", part.trim())));
        };
        let (name, value) = (name.trim(), value.trim());
        let place = index_of(option, "coordinate", name, names)?;
        let number = quantity::<S>(value).map_err(|error| refused(format!("{name}: {error}")))?;
        if !number.is_finite() {
            return Err(refused(format!("{name}: expected a finite number, found {value:?}")));
        }
        if values[place].replace(number).is_some() {
            return Err(refused(format!("{name} is given twice")));
        }
    }
    let missing: Vec<&str> =
        names.iter().zip(&values).filter(|(_, value)| value.is_none()).map(|(name, _)| name.as_str()).collect();
    if !missing.is_empty() {
        return Err(refused(format!("expected a value of {}, missing {}", names.join(", "), missing.join(", "))));
    }
    Ok(values.into_iter().flatten().collect())
}

/// Splits a text at commas outside parentheses.
fn outer_parts(text: &str) -> impl Iterator<Item = &str> {
    let mut depth = 0_i32;
    text.split(move |c: char| {
        depth += i32::from(c == '(') - i32::from(c == ')');
        c == ',' && depth <= 0
    })
}

/// Finds the index of a name in a list; `what` describes the list and `option` is the name of the option, both for the message.
///
/// # Errors
/// A usage error with the nearest known name.
pub fn index_of(option: &str, what: &str, name: &str, known: &[String]) -> Result<usize, CliError> {
    known.iter().position(|own| own == name).ok_or_else(|| {
        let problem = unknown(what, name, known.iter().map(String::as_str));
        CliError::usage(format_args!("{option}: {problem}"))
    })
}

/// Finds the indices of different names in a list, as [`index_of`] does.
///
/// # Errors
/// A usage error for an unknown name, or for one that is given twice.
pub fn indices_of(option: &str, what: &str, names: &[String], known: &[String]) -> Result<Vec<usize>, CliError> {
    let index = |(k, name): (usize, &String)| match names[..k].contains(name) {
        true => Err(CliError::usage(format_args!("{option}: {what} {name} is given twice"))),
        false => index_of(option, what, name, known),
    };
    names.iter().enumerate().map(index).collect()
}

/// A number of threads.
pub fn thread_count(text: &str) -> Result<usize, String> {
    whole(1, MOST_THREADS)(text)
}

/// Number of threads: the requested one, or that of all cores.
pub fn threads(asked: Option<usize>) -> usize {
    let all = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    asked.unwrap_or_else(all).min(MOST_THREADS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_counted_by_quarters() {
        assert_eq!((directions("0"), directions(" 64 ")), (Ok(0), Ok(64)));
        assert!(["3", "-4", "4100", "x", ""].iter().all(|bad| directions(bad).is_err()));
    }

    #[test]
    fn ranges_are_kept() {
        assert_eq!(finite("-1.5e3"), Ok(-1500.0));
        for bad in ["nan", "inf", "1e999", "", "x", "1,5"] {
            assert!(finite(bad).is_err() && positive(bad).is_err() && count(bad).is_err(), "{bad}");
        }
        for bad in ["0", "-1", "-0.0"] {
            assert!(positive(bad).is_err() && count(bad).is_err(), "{bad}");
        }
        assert_eq!((weight("0"), weight("2.5")), (Ok(0.0), Ok(2.5)));
        assert!(weight("-1").is_err() && weight("nan").is_err());
        assert!(count("1.0").is_err() && count("99999999999999999999").is_err());
        assert_eq!((positive("1e-3"), count("7")), (Ok(1e-3), Ok(7)));
        assert_eq!((tolerance("2e-15"), seed("9223372036854775807")), (Ok(2e-15), Ok(i64::MAX as u64)));
        assert!(["nan", "0", "-1e-6", "1e-30", "1.1", "1e308"].iter().all(|bad| tolerance(bad).is_err()));
        assert!(tolerance("1e-30").unwrap_err().contains("2e-15"), "the bound is said");
        assert_eq!((whole(2, 5)("5"), number(-1.0, 2.5)("-1"), seconds("86400")), (Ok(5), Ok(-1.0), Ok(86_400.0)));
        assert!(["1", "6", "2.0", "-3", "18446744073709551616"].iter().all(|bad| whole(2, 5)(bad).is_err()));
        assert!(["-1.1", "2.6", "nan", "inf"].iter().all(|bad| number(-1.0, 2.5)(bad).is_err()));
        assert!(["0", "86401", "nan"].iter().all(|bad| seconds(bad).is_err()));
        assert_eq!((thread_count("256"), rate("100")), (Ok(256), Ok(100.0)));
        assert!(["0", "257", "4294967296"].iter().all(|bad| thread_count(bad).is_err()));
        assert!(threads(None) >= 1 && threads(Some(7)) == 7);
        assert!(["-1", "1.5", "", "9223372036854775808"].iter().all(|bad| seed(bad).is_err()));
        assert_eq!((bounds("-0.5:1e3"), bounds(" 2 : 2 ")), (Ok((-0.5, 1000.0)), Ok((2.0, 2.0))));
        for bad in ["", "1", "1:", ":1", "2:1", "0:inf", "nan:nan", "0:1:2", "-1e308:1e308"] {
            assert!(bounds(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn named_values_are_read_in_any_order() {
        let names = ["t", "r", "phi"].map(String::from);
        let read = |text: &str| named::<f64>("--at", text, &names).map_err(|error| error.to_string());
        assert_eq!(read("phi = pi/2, t=-1,r=max(2,3)").unwrap(), [-1.0, 3.0, std::f64::consts::FRAC_PI_2]);
        for (bad, parts) in [
            ("r=1", ["missing", "t, phi"]),
            ("r=1,t=1,phi=1,r=2", ["r", "twice"]),
            ("r=1,t=1,ph=1", ["\"ph\"", "\"phi\""]),
            ("r=1,t=1,phi=1/0", ["phi", "finite"]),
            ("r=1,t=1,phi=inf", ["phi", "finite"]),
            ("r=1,t=1,phi=x", ["phi", "\"x\""]),
            ("r=1,t=1,phi", ["NAME=VALUE", "phi"]),
            ("", ["NAME=VALUE", "\"\""]),
        ] {
            let problem = read(bad).unwrap_err();
            assert!(parts.iter().all(|part| problem.contains(part)), "{bad}: {problem}");
        }
    }
}
