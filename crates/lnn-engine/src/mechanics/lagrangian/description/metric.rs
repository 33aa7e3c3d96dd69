//! The Lagrangian and the mass shell of a metric.

use super::scope::{Scope, compiled};
use super::{Description, DescriptionError};
use crate::lagrangian::expression::{Compiler, Meaning, Value};
use crate::names::unknown;
use crate::ops::{Binary, Unary};
use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;

/// Entries `(i, j)`, `i <= j`.
pub(super) type Metric = BTreeMap<(usize, usize), Value>;

impl Description {
    /// Parses the entries `(i, j)`, `i <= j`, of the metric.
    pub(super) fn metric_entries(
        &self,
        entries: &BTreeMap<String, String>,
        compiler: &mut Compiler,
        scope: &Scope,
    ) -> Result<Metric, DescriptionError> {
        let mut metric = BTreeMap::new();
        for (pair, text) in entries {
            let key = format!("metric.{pair}");
            let index = |name: &str| {
                let names = self.coordinates.iter().map(|c| c.name.as_str());
                let problem = || unknown("coordinate", name, names.clone().collect::<Vec<_>>());
                names.clone().position(|known| known == name).ok_or_else(|| DescriptionError::new(&key, problem()))
            };
            let Some((a, b)) = pair.split_once(',') else {
                let problem = "expected two coordinates with a comma between them, such as \"t,t\"";
                return Err(DescriptionError::new(key, problem));
            };
            let (i, j) = (index(a.trim())?, index(b.trim())?);
            let value = compiled(compiler, scope, (&key, text), true)?;
            if metric.insert((i.min(j), i.max(j)), value).is_some() {
                return Err(DescriptionError::new(key, "this entry is given twice: the metric is symmetric"));
            }
        }
        for (i, coordinate) in self.coordinates.iter().enumerate() {
            if !metric.keys().any(|(a, b)| *a == i || *b == i) {
                let name = &coordinate.name;
                return Err(DescriptionError::new(
                    "metric",
                    format!("expected an entry of {name}, such as \"{name},{name}\""),
                ));
            }
        }
        Ok(metric)
    }
}

/// Computes `g_ij v_i v_j / 2`.
pub(super) fn kinetic(compiler: &mut Compiler, metric: &Metric, n: usize) -> Value {
    let speeds: Vec<Value> = (0..n).map(|i| compiler.meaning(Meaning::Velocity(i))).collect();
    let half = compiler.constant(0.5);
    sum(compiler, metric.iter().map(|(&(i, j), &g)| (g, i, j)), |compiler, (g, i, j)| {
        let square = compiler.binary(Binary::Mul, speeds[i], speeds[j]);
        let term = compiler.binary(Binary::Mul, g, square);
        if i == j { compiler.binary(Binary::Mul, half, term) } else { term }
    })
}

/// Computes `v_t` with `g(v, v) = -1`: the root of `g_tt v_t^2 + 2 b v_t + c + 1 = 0` that points to the future, `-(b + sqrt(b^2 - g_tt (c
/// + 1))) / g_tt`, where `g_tt < 0`.
pub(super) fn on_shell(compiler: &mut Compiler, metric: &Metric, t: usize, n: usize) -> Value {
    let speeds: Vec<Value> = (0..n).map(|i| compiler.meaning(Meaning::Velocity(i))).collect();
    let entries = || metric.iter().map(|(&(i, j), &g)| (g, i, j));
    let own = metric.get(&(t, t)).copied().unwrap_or_else(|| compiler.constant(0.0));
    let mixed = entries().filter(|(_, i, j)| (*i == t) != (*j == t));
    let b =
        sum(compiler, mixed, |compiler, (g, i, j)| compiler.binary(Binary::Mul, g, speeds[if i == t { j } else { i }]));
    let two = compiler.constant(2.0);
    let space = entries().filter(|(_, i, j)| *i != t && *j != t);
    let c = sum(compiler, space, |compiler, (g, i, j)| {
        let square = compiler.binary(Binary::Mul, speeds[i], speeds[j]);
        let term = compiler.binary(Binary::Mul, g, square);
        if i == j { term } else { compiler.binary(Binary::Mul, two, term) }
    });
    let one = compiler.constant(1.0);
    let shell = compiler.binary(Binary::Add, c, one);
    let product = compiler.binary(Binary::Mul, own, shell);
    let square = compiler.binary(Binary::Mul, b, b);
    let inside = compiler.binary(Binary::Sub, square, product);
    let root = compiler.unary(Unary::Sqrt, inside);
    let top = compiler.binary(Binary::Add, b, root);
    let quotient = compiler.binary(Binary::Div, top, own);
    compiler.unary(Unary::Neg, quotient)
}

/// Sums the terms; 0 without terms.
fn sum<T>(
    compiler: &mut Compiler,
    parts: impl Iterator<Item = T>,
    mut term: impl FnMut(&mut Compiler, T) -> Value,
) -> Value {
    let mut total = None;
    for part in parts {
        let value = term(compiler, part);
        total = Some(match total {
            Some(total) => compiler.binary(Binary::Add, total, value),
            None => value,
        });
    }
    total.unwrap_or_else(|| compiler.constant(0.0))
}
