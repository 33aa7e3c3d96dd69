//! `lnn geometry --surface`: ergosurfaces, horizons and changes of signature on a line of coordinates.

use crate::CliError;
use crate::arguments::number::index_of;
use crate::arguments::source::Source;
use crate::terminal::{json, output};
use lnn::findings::text_table;
use lnn::geometry::{Change, Surface};
use lnn::names::pluralize;
use lnn::scalar::Scalar;

/// A block of the metric and the line on which its determinant is followed.
pub struct Line<'a, S> {
    /// Names of the coordinates of the block.
    pub block: &'a [String],
    /// Start and end, `(n)` each.
    pub ends: (&'a [S], &'a [S]),
    /// Velocity at which the mass matrix is taken, `(n)`.
    pub velocity: &'a [S],
    /// Number of intervals on the line.
    pub steps: usize,
}

impl<S: Scalar> Line<'_, S> {
    /// Prints the points where the determinant changes its sign, as one object or as a table.
    ///
    /// # Errors
    /// A usage error for a coordinate that does not exist or is named twice, a data error for a bad model.
    pub fn print(&self, source: &Source<S>, table: bool) -> Result<(), CliError> {
        let names = &source.columns[..source.columns.len() / 2];
        let block = self.block.iter().enumerate().map(|(k, name)| {
            if self.block[..k].contains(name) {
                return Err(CliError::usage(format_args!("--surface: coordinate {name} is given twice")));
            }
            index_of("--surface", "coordinate", name, names)
        });
        let block = block.collect::<Result<Vec<usize>, CliError>>()?;
        let found =
            Surface::find(&*source.model, &block, self.ends, self.velocity, self.steps).map_err(CliError::data)?;
        output::print(&if table { self.table(names, &found) } else { self.object(names, &found) })
    }

    fn object(&self, names: &[String], found: &[Surface<S>]) -> String {
        let block: Vec<String> = self.block.iter().map(|name| json::string(name)).collect();
        let point = |q: &[S]| {
            let parts = names.iter().zip(q).map(|(name, x)| format!("{}:{}", json::string(name), json::number(*x)));
            parts.collect::<Vec<_>>().join(",")
        };
        let surfaces: Vec<String> = found
            .iter()
            .map(|surface| format!("{{\"point\":{{{}}},\"change\":\"{}\"}}", point(&surface.point), change(surface)))
            .collect();
        format!("{{\"block\":[{}],\"surfaces\":[{}]}}\n", block.join(","), surfaces.join(","))
    }

    fn table(&self, names: &[String], found: &[Surface<S>]) -> String {
        let block = self.block.join(",");
        let changes = pluralize(found.len(), "change", "changes");
        let title = format!("determinant of the metric's block {block}: {changes} of sign on the line\n");
        if found.is_empty() {
            return title;
        }
        let header: Vec<&str> = names.iter().map(String::as_str).chain(["determinant"]).collect();
        let row = |surface: &Surface<S>| {
            let point = surface.point.iter().map(|x| json::number(*x));
            point.chain([change(surface).to_string()]).collect::<Vec<String>>()
        };
        title + &text_table(&header, &found.iter().map(row).collect::<Vec<_>>())
    }
}

/// Describes in a word how the determinant changes at a surface.
fn change<S>(surface: &Surface<S>) -> &'static str {
    match surface.change {
        Change::Zero => "zero",
        Change::Pole => "pole",
    }
}
