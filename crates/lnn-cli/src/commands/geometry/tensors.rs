//! Prints the geometry at a point as a line of JSON with all digits.

use crate::terminal::json;
use lnn::geometry::{PointReport, Value};
use lnn::scalar::Scalar;

/// One object with all components of a point.
pub fn object<S: Scalar>(report: &PointReport<S>) -> String {
    let n = report.names.len();
    let parts = report.quantities.iter().filter(|quantity| !quantity.key.is_empty()).map(|quantity| {
        let value = match &quantity.value {
            Value::Missing => "null".to_string(),
            Value::Number(x) => json::number(*x),
            Value::Signature(signature) => format!("[{},{}]", signature.negative, signature.positive),
            Value::Tensor(values, rank) => json::tensor(values, n, *rank),
        };
        format!("\"{}\":{value}", quantity.key)
    });
    let problem = report.problem.iter().map(|text| format!("\"error\":{}", json::string(text)));
    format!("{{{}}}\n", parts.chain(problem).collect::<Vec<_>>().join(","))
}
