//! JSON of numbers of any precision with all their digits.

use crate::scalar::Scalar;

/// A number with 9 significant digits (`f32`), 17 (`f64`) or as many as its text has (double-double); `null` if it is not finite, which
/// JSON cannot represent.
pub fn number<S: Scalar>(x: S) -> String {
    match S::NAME {
        _ if !x.is_finite() => "null".to_string(),
        "f32" => format!("{:.8e}", x.to_f64()),
        "f64" => format!("{:.16e}", x.to_f64()),
        _ => x.to_text(),
    }
}

/// A quoted text.
pub fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// A list of values in JSON.
pub fn list(values: impl IntoIterator<Item = String>) -> String {
    format!("[{}]", values.into_iter().collect::<Vec<_>>().join(","))
}

/// An object on one line, from names that need no escapes and values in JSON.
pub fn object(fields: impl IntoIterator<Item = (&'static str, String)>) -> String {
    let fields = fields.into_iter().map(|(name, value)| format!("\"{name}\":{value}"));
    format!("{{{}}}\n", fields.collect::<Vec<_>>().join(","))
}

/// Nested lists of the components `(.., n, n)` of a tensor, the last index innermost; a number for rank 0.
pub fn tensor<S: Scalar>(values: &[S], n: usize, rank: usize) -> String {
    match rank {
        0 => values.first().map_or("null".to_string(), |x| number(*x)),
        1 => list(values.iter().map(|x| number(*x))),
        _ => list(values.chunks(n.pow(rank as u32 - 1).max(1)).map(|part| tensor(part, n, rank - 1))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dd;

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
        let rows = tensor(&[1f32, 2.0, 3.0, 4.0, 5.0, 6.0], 2, 2);
        assert_eq!(serde_json::from_str::<Vec<[f32; 2]>>(&rows).unwrap(), [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]);
        let cube = tensor(&(0..8).map(f64::from).collect::<Vec<_>>(), 2, 3);
        let nested: Vec<Vec<Vec<f64>>> = serde_json::from_str(&cube).unwrap();
        assert_eq!(nested, [[[0.0, 1.0], [2.0, 3.0]], [[4.0, 5.0], [6.0, 7.0]]]);
        assert_eq!(
            object([("a", quoted("b\"\n")), ("c", list(["1".to_string()]))]),
            "{\"a\":\"b\\\"\\n\",\"c\":[1]}\n"
        );
    }
}
