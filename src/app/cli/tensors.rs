//! Tensors of points as JSON or text.

use crate::cli::json;
use crate::geometry::Geometry;
use crate::linalg::{Inertia, inertia};
use crate::scalar::{Real, Scalar};

/// A result, in the order in which results are printed.
pub struct Field<S> {
    name: &'static str,
    value: Value<S>,
}

/// Kinds of results.
pub enum Value<S> {
    /// Quantities that the point does not have.
    Missing,
    Number(S),
    Signature(Inertia),
    Tensor(Tensor<S>),
}

/// Components of a tensor, the last index running fastest.
pub struct Tensor<S> {
    values: Vec<S>,
    rank: usize,
    /// Indices of the components that the others follow from.
    independent: fn(&[usize]) -> bool,
    /// Largest of the numbers that its components are sums of: what rounding is measured by.
    size: f64,
}

impl<S: Scalar> Tensor<S> {
    /// A tensor whose components are measured by the largest of them.
    fn plain(values: &[S], rank: usize, independent: fn(&[usize]) -> bool) -> Value<S> {
        Self::of(values, values, rank, independent)
    }
    /// A tensor of sums of the components of another one.
    fn of(parts: &[S], values: &[S], rank: usize, independent: fn(&[usize]) -> bool) -> Value<S> {
        let size = parts.iter().map(|x| x.abs().to_f64()).fold(0.0, f64::max);
        Value::Tensor(Self { values: values.to_vec(), rank, independent, size })
    }
}

/// All results for a point with a metric, `(n, n)`, whether or not its geometry was found.
pub fn fields<S: Scalar>(metric: &[S], found: Option<&Geometry<S>>) -> Vec<Field<S>> {
    let n = metric.len().isqrt();
    let field = |name, value: Option<Value<S>>| Field { name, value: value.unwrap_or(Value::Missing) };
    let finite = metric.iter().all(|x| x.is_finite());
    let own = || inertia(n, metric, &mut vec![S::nan(); n * n]).ok();
    let signature = found.map(|f| f.metric.signature).or_else(own);
    let singular = signature.filter(|signature| signature.zero > 0).map(|_| <S as Real>::zero());
    let of = |what: &dyn Fn(&Geometry<S>) -> Value<S>| found.map(what);
    vec![
        field("metric", finite.then(|| Tensor::plain(metric, 2, symmetric))),
        field("inverse_metric", of(&|f| Tensor::plain(&f.metric.inverse, 2, symmetric))),
        field("determinant", found.map(|f| f.metric.determinant).or(singular).map(Value::Number)),
        field("signature", signature.map(Value::Signature)),
        field("christoffel", of(&|f| Tensor::plain(&f.connection.symbols, 3, symmetric))),
        field("riemann", of(&|f| Tensor::plain(&f.curvature.riemann, 4, antisymmetric))),
        field("ricci", of(&|f| Tensor::of(&f.curvature.riemann, &f.curvature.ricci, 2, symmetric))),
        field("ricci_scalar", of(&|f| Value::Number(f.curvature.scalar))),
        field("einstein", of(&|f| Tensor::of(&f.curvature.riemann, &f.curvature.einstein, 2, symmetric))),
        field("weyl", of(&|f| Tensor::of(&f.curvature.lowered, &f.curvature.weyl, 4, two_pairs))),
        field("kretschmann", of(&|f| Value::Number(f.curvature.kretschmann))),
    ]
}

/// Symmetric in the last two indices.
fn symmetric(at: &[usize]) -> bool {
    at.iter().rev().nth(1) <= at.last()
}

/// Antisymmetric in the last two indices.
fn antisymmetric(at: &[usize]) -> bool {
    at.iter().rev().nth(1) < at.last()
}

/// Antisymmetric in the first and in the last two indices, symmetric in the pairs.
fn two_pairs(at: &[usize]) -> bool {
    at[0] < at[1] && at[2] < at[3] && at[..2] <= at[2..]
}

/// A point as a line of JSON.
pub fn object<S: Scalar>(n: usize, fields: &[Field<S>], problem: Option<&str>) -> String {
    let mut parts: Vec<String> = fields
        .iter()
        .map(|field| {
            let value = match &field.value {
                Value::Missing => "null".to_string(),
                Value::Number(x) => json::number(*x),
                Value::Signature(signature) => format!("[{},{}]", signature.negative, signature.positive),
                Value::Tensor(tensor) => json::tensor(&tensor.values, n, tensor.rank),
            };
            format!("\"{}\":{value}", field.name)
        })
        .collect();
    parts.extend(problem.map(|text| format!("\"error\":{}", json::string(text))));
    format!("{{{}}}\n", parts.join(","))
}

/// A point as a block of text: components below rounding are left out.
pub fn block<S: Scalar>(names: &[String], row: usize, fields: &[Field<S>], problem: Option<&str>) -> String {
    let n = names.len();
    let mut text = format!("row {row}\n");
    let mut line = |name: &str, at: &str, value: &str| text += &format!("  {name:<15} {at:<25} {value}\n");
    for Field { name, value } in fields {
        match value {
            Value::Missing => {}
            Value::Number(x) => line(name, "", &json::number(*x)),
            Value::Signature(signature) => {
                line(name, "", &format!("{} negative, {} positive", signature.negative, signature.positive));
            }
            Value::Tensor(Tensor { values, rank, independent, size }) => {
                let least = size * 64.0 * S::epsilon().to_f64();
                let mut shown = values.iter().enumerate().filter(|(_, x)| x.abs().to_f64() > least).peekable();
                if shown.peek().is_none() {
                    line(name, "", "0");
                }
                for (place, x) in shown {
                    let at: Vec<usize> = (0..*rank as u32).rev().map(|k| place / n.pow(k) % n).collect();
                    if independent(&at) {
                        let at: Vec<&str> = at.iter().map(|&i| names[i].as_str()).collect();
                        line(name, &at.join(","), &json::number(*x));
                    }
                }
            }
        }
    }
    if let Some(problem) = problem {
        line("error", problem, "");
    }
    text.lines().map(|line| format!("{}\n", line.trim_end())).collect()
}
