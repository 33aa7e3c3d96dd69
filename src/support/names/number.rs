//! Numbers as a person reads them.

/// A number with three significant digits: `0.0196`, `12.3`, `4.30e-5`. See [`rounded`].
pub fn number(x: f64) -> String {
    rounded(x, 3)
}

/// A number with so many significant digits, decimal from `0.0001` to a million and with an exponent beyond; digits before
/// the point are all shown. No finite number is `-`.
pub fn rounded(x: f64, digits: usize) -> String {
    let after = digits.max(1) - 1;
    if !x.is_finite() {
        return "-".to_string();
    }
    if x == 0.0 {
        return "0".to_string();
    }
    let scientific = format!("{x:.after$e}");
    // The exponent of the rounded number: 9.999 becomes 10.0, which has one decimal fewer.
    let exponent: i32 = scientific.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0);
    if (-4..6).contains(&exponent) {
        let decimals = usize::try_from(after as i32 - exponent).unwrap_or(0);
        format!("{x:.decimals$}")
    } else {
        scientific
    }
}

/// A fraction in per cent, three significant digits, without the sign of per cent.
pub fn percentage(fraction: f64) -> String {
    number(100.0 * fraction)
}

/// A fraction in per cent, three significant digits: `1.23 %`.
pub fn percent(fraction: f64) -> String {
    if fraction.is_finite() { format!("{} %", percentage(fraction)) } else { "-".to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_an_exponent_only_where_needed() {
        let texts = [0.0196, 1.0, -12.345, 0.000_456_7, 123.4, 13_643.2, 999.6].map(number);
        assert_eq!(texts, ["0.0196", "1.00", "-12.3", "0.000457", "123", "13643", "1000"]);
        let texts = [0.0, -0.0, 4.3e-5, -1.2345e-7, 999_999.0, 1_234_567.0, 1e300].map(number);
        assert_eq!(texts, ["0", "0", "4.30e-5", "-1.23e-7", "1.00e6", "1.23e6", "1.00e300"]);
        // Rounding may add a digit in front of the point.
        assert_eq!([9.999, 0.999_9, 0.000_099_99].map(number), ["10.0", "1.00", "0.000100"]);
        assert_eq!([f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(number), ["-"; 3]);
    }

    #[test]
    fn other_counts_of_digits() {
        let texts = [0.0, 1.0, -0.012_345_6, 98_765.4, 1e-9].map(|x| rounded(x, 4));
        assert_eq!(texts, ["0", "1.000", "-0.01235", "98765", "1.000e-9"]);
        assert_eq!([rounded(2.5, 1), rounded(0.36, 1), rounded(7.0, 0)], ["2", "0.4", "7"]);
    }

    #[test]
    fn fractions_are_per_cent() {
        assert_eq!([0.0123, 0.0, 1.0, f64::NAN].map(percent), ["1.23 %", "0 %", "100 %", "-"]);
        assert_eq!(percentage(4.3e-7), "4.30e-5");
    }
}
