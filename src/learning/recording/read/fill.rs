//! Reads arrays row by row, from one or several files or archive entries.

use super::Problem;
use super::builder::Builder;
use super::element::Element;
use super::error::Faults;
use super::thresholds::ROWS_AT_ONCE;
use std::io::Read;

/// A stream of elements that is read row by row.
pub struct Source<'a> {
    /// Where they come from.
    pub input: Box<dyn Read + 'a>,
    /// Their type.
    pub element: Element,
    /// Number of elements in a row.
    pub width: usize,
    /// Used elements of a row: index in the row, and index among the used columns.
    pub wanted: Vec<(usize, usize)>,
    /// `true` if no bytes may follow the elements.
    pub whole: bool,
    /// Name for messages, followed by a space, if there are several sources.
    pub name: String,
}

/// Adds `rows` rows to the trajectories: the used columns in the order of the selection, the trajectory's column last.
///
/// Needs memory for the trajectories and a thousand rows.
pub fn fill<'b>(mut builder: Builder<'b>, rows: usize, sources: &mut [Source<'_>]) -> Result<Builder<'b>, Problem> {
    let count = builder.selection().values.len();
    let all = count + usize::from(builder.selection().trajectory.is_some());
    builder.expect(rows);
    let mut buffers = vec![Vec::new(); sources.len()];
    let mut values = vec![0.0; all];
    let (mut done, mut faults) = (0, Faults::default());
    while done < rows {
        let now = ROWS_AT_ONCE.min(rows - done);
        for (source, buffer) in sources.iter_mut().zip(&mut buffers) {
            buffer.resize(now * source.width * source.element.size(), 0);
            source.input.read_exact(buffer).map_err(|error| source.broken(error))?;
        }
        for k in 0..now {
            let row = (done + k) as u64 + 1;
            for (source, buffer) in sources.iter().zip(&buffers) {
                let size = source.element.size();
                for &(column, place) in &source.wanted {
                    values[place] = source.element.decode(&buffer[(k * source.width + column) * size..][..size]);
                }
            }
            for (used, found) in builder.selection().used().zip(&values).filter(|(_, x)| x.is_infinite()) {
                faults.add(Problem::Field { row, column: used.name.clone(), found: found.to_string() });
            }
            // After a mistake, the remaining rows are only checked for further mistakes.
            if !faults.is_empty() {
                continue;
            }
            let label = values.get(count).map(ToString::to_string).or_else(|| builder.selection().number.clone());
            builder.push(row, &values[..count], label.as_deref())?;
        }
        done += now;
    }
    faults.end()?;
    for source in sources {
        source.end()?;
    }
    Ok(builder)
}

impl Source<'_> {
    fn broken(&self, error: std::io::Error) -> Problem {
        match error.kind() {
            std::io::ErrorKind::UnexpectedEof => {
                Problem::Array(format!("{}the numbers of the array are cut off", self.name))
            }
            std::io::ErrorKind::InvalidData | std::io::ErrorKind::InvalidInput => {
                Problem::Array(format!("{}the archive is damaged: {error}", self.name))
            }
            _ => Problem::Io(error),
        }
    }

    /// Reads beyond the last number, where an archive compares its checksum.
    fn end(&mut self) -> Result<(), Problem> {
        let more = self.input.read(&mut [0]).map_err(|error| self.broken(error))?;
        if more > 0 && self.whole {
            let problem = format!("{}there are more bytes after the numbers than its header states", self.name);
            return Err(Problem::Array(problem));
        }
        Ok(())
    }
}
