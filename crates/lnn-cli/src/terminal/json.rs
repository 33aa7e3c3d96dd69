//! JSON numbers with all digits.

use lnn::scalar::Scalar;

/// A number with 9 significant digits (`f32`), 17 (`f64`) or as many as its text has (double-double); `null` if it is not finite, which
/// JSON cannot represent.
pub fn number<S: Scalar>(x: S) -> String {
    if !x.is_finite() {
        return "null".to_string();
    }
    match S::NAME {
        "f32" => format!("{:.8e}", x.to_f64()),
        "f64" => format!("{:.16e}", x.to_f64()),
        _ => x.to_text(),
    }
}

/// `[x, y, ..]`.
pub fn vector<S: Scalar>(values: &[S]) -> String {
    format!("[{}]", values.iter().map(|x| number(*x)).collect::<Vec<_>>().join(","))
}

/// `[[..], ..]`, rows of a row-major matrix with `columns` columns.
pub fn matrix<S: Scalar>(values: &[S], columns: usize) -> String {
    format!("[{}]", values.chunks(columns.max(1)).map(vector).collect::<Vec<_>>().join(","))
}

/// Nested lists of the components of a tensor with `rank` indices of `n` values each, the last index innermost.
pub fn tensor<S: Scalar>(values: &[S], n: usize, rank: usize) -> String {
    match rank {
        0 | 1 => vector(values),
        _ => {
            let parts = values.chunks((values.len() / n.max(1)).max(1)).map(|part| tensor(part, n, rank - 1));
            format!("[{}]", parts.collect::<Vec<_>>().join(","))
        }
    }
}

/// A quoted string.
pub fn string(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lnn::scalar::Dd;

    #[test]
    fn numbers_read_back() {
        for x in [0.1, -1.0 / 3.0, 5e-324, f64::MAX, 0.0, 1e22] {
            assert_eq!(serde_json::from_str::<f64>(&number(x)).unwrap(), x);
            let narrow = x as f32;
            if narrow.is_finite() {
                assert_eq!(number(narrow).parse::<f32>().unwrap(), narrow);
            }
            let double: f64 = serde_json::from_str(&number(Dd::of_f64(x))).unwrap();
            assert!((double - x).abs() <= 1e-15 * x.abs(), "{x} {double}");
        }
        assert_eq!(number(f64::NAN), "null");
        assert_eq!(number(f32::INFINITY), "null");
        assert_eq!(matrix(&[1f32, 2.0, 3.0, 4.0], 2), "[[1.00000000e0,2.00000000e0],[3.00000000e0,4.00000000e0]]");
        let cube: Vec<f64> = (0..8).map(f64::from).collect();
        let nested: Vec<Vec<Vec<f64>>> = serde_json::from_str(&tensor(&cube, 2, 3)).unwrap();
        assert_eq!(nested, [[[0.0, 1.0], [2.0, 3.0]], [[4.0, 5.0], [6.0, 7.0]]]);
        assert_eq!(string("a\"b\n"), r#""a\"b\n""#);
    }
}
