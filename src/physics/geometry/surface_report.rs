//! The surfaces on a line by the names of the coordinates: a table for people, every digit for files.

use super::{Change, GeometryError, Surface};
use crate::digits::{list, number, object, quoted};
use crate::findings::Findings;
use crate::lagrangian::EulerLagrange;
use crate::names::pluralize;
use crate::scalar::Scalar;

/// Points of a line where the determinant of a block of the metric changes its sign.
pub struct SurfaceReport<'a, S> {
    names: &'a [String],
    block: Vec<usize>,
    surfaces: Vec<Surface<S>>,
}

impl<'a, S: Scalar> SurfaceReport<'a, S> {
    /// The surfaces of [`Surface::find`], with the names of all coordinates.
    ///
    /// # Errors
    /// Those of [`Surface::find`].
    pub fn of(
        (model, names): (&dyn EulerLagrange<S>, &'a [String]),
        block: Vec<usize>,
        ends: (&[S], &[S]),
        velocity: &[S],
        steps: usize,
    ) -> Result<Self, GeometryError> {
        let surfaces = Surface::find(model, &block, ends, velocity, steps)?;
        Ok(Self { names, block, surfaces })
    }

    fn block(&self) -> impl Iterator<Item = &str> {
        self.block.iter().map(|&i| self.names[i].as_str())
    }

    /// One object on a line of JSON: the block, and the point and the kind of every change, with all digits.
    pub fn json(&self) -> String {
        let surface = |surface: &Surface<S>| {
            let point = self.names.iter().zip(&surface.point);
            let point: Vec<String> = point.map(|(name, x)| format!("{}:{}", quoted(name), number(*x))).collect();
            format!("{{\"point\":{{{}}},\"change\":\"{}\"}}", point.join(","), surface.change.name())
        };
        let surfaces = list(self.surfaces.iter().map(surface));
        object([("block", list(self.block().map(quoted))), ("surfaces", surfaces)])
    }

    /// A sentence, and a table of the points.
    pub fn findings(&self) -> Findings {
        let block = self.block().collect::<Vec<_>>().join(",");
        let changes = pluralize(self.surfaces.len(), "change", "changes");
        let mut findings = Findings::default();
        findings.line(format!("determinant of the metric's block {block}: {changes} of sign on the line"));
        if !self.surfaces.is_empty() {
            let header: Vec<&str> = self.names.iter().map(String::as_str).chain(["determinant"]).collect();
            let row = |surface: &Surface<S>| {
                let point = surface.point.iter().map(|x| number(*x));
                point.chain([surface.change.name().to_string()]).collect::<Vec<_>>()
            };
            findings.table(&header, self.surfaces.iter().map(row));
        }
        findings
    }
}

impl Change {
    /// One word.
    fn name(self) -> &'static str {
        match self {
            Self::Zero => "zero",
            Self::Pole => "pole",
        }
    }
}
