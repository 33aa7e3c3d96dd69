//! Which column of a file is which.

use super::Problem;
use crate::names::unknown;
use crate::recording::Columns;

/// One used column.
#[derive(Clone, Debug, PartialEq)]
pub struct Used {
    /// Its name, or its number.
    pub name: String,
    /// Its position, from 0.
    pub position: usize,
    /// Factor to SI.
    pub factor: f64,
}

/// The used columns of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// Columns of the file.
    pub width: usize,
    /// Time if it is a column, coordinates, velocities, accelerations, forces, errors.
    pub values: Vec<Used>,
    /// `true` if the first of them is the time.
    pub timed: bool,
    /// The column that distinguishes trajectories.
    pub trajectory: Option<Used>,
}

impl Selection {
    /// Finds the columns among `names`, or by number if a file has no names; `row` is that of the header.
    pub fn new(columns: &Columns, names: Option<&[String]>, width: usize, row: u64) -> Result<Self, Problem> {
        if columns.coords.is_empty() {
            let numbers = || (1..=width).map(|k| k.to_string()).collect();
            return Err(Problem::Names(names.map_or_else(numbers, <[String]>::to_vec)));
        }
        let find = |what: &'static str, name: &str| -> Result<Used, Problem> {
            let named = names.unwrap_or(&[]);
            let mut places = named.iter().enumerate().filter(|(_, known)| *known == name).map(|(k, _)| k);
            let position = match (places.next(), places.next()) {
                (Some(_), Some(_)) => return Err(Problem::Duplicate { row, name: name.to_string() }),
                (Some(place), None) => place,
                (None, _) => match name.parse::<usize>() {
                    Ok(number) if (1..=width).contains(&number) => number - 1,
                    Ok(_) => {
                        let problem = format!("column {name}, expected a number from 1 to {width}");
                        return Err(Problem::Missing { row, what, problem });
                    }
                    Err(_) if names.is_some() => {
                        let problem = unknown("column", name, named.iter().map(String::as_str));
                        return Err(Problem::Missing { row, what, problem });
                    }
                    Err(_) => {
                        let problem = format!(
                            "column {name:?} in a file without names, expected a number from 1 to {width} or the \
                             names of all columns"
                        );
                        return Err(Problem::Missing { row, what, problem });
                    }
                },
            };
            let own = columns.units.iter().any(|(column, _)| column == name);
            // An error is in the unit of its coordinate unless it has one of its own.
            let coordinate = columns.error.iter().position(|error| error == name && !own);
            let unit = coordinate.and_then(|k| columns.coords.get(k)).map_or(name, String::as_str);
            // The sign of a factor turns positions around, not their errors.
            let factor = columns.factor(unit) * if coordinate.is_some() { columns.factor(unit).signum() } else { 1.0 };
            Ok(Used { name: name.to_string(), position, factor })
        };
        let time = match (&columns.time, columns.rate) {
            (Some(name), _) => Some(find("time", name)?),
            (None, Some(_)) => None,
            (None, None) => {
                let usual = |name: &&String| ["t", "time"].iter().any(|usual| name.eq_ignore_ascii_case(usual));
                let taken = |name: &&String| columns.used().any(|(_, other)| other == *name);
                let name = names.unwrap_or(&[]).iter().find(|name| usual(name) && !taken(name));
                let nothing = || Problem::NoTime { names: names.unwrap_or(&[]).to_vec() };
                Some(find("time", name.ok_or_else(nothing)?)?)
            }
        };
        let timed = time.is_some();
        let mut values: Vec<Used> = time.into_iter().collect();
        for (what, list) in [
            ("coordinate", &columns.coords),
            ("velocity", &columns.velocity),
            ("acceleration", &columns.acceleration),
            ("force", &columns.force),
            ("error", &columns.error),
        ] {
            for name in list {
                values.push(find(what, name)?);
            }
        }
        let trajectory = columns.trajectory.as_deref().map(|name| find("trajectory", name)).transpose()?;
        let all: Vec<&Used> = values.iter().chain(&trajectory).collect();
        for (k, used) in all.iter().enumerate() {
            if let Some(other) = all[..k].iter().find(|other| other.position == used.position) {
                let problem = format!("column {} is column {} again", used.name, other.name);
                return Err(Problem::Missing { row, what: "column", problem });
            }
        }
        Ok(Self { width, values, timed, trajectory })
    }

    /// The used columns, that of the trajectory last.
    pub fn used(&self) -> impl Iterator<Item = &Used> {
        self.values.iter().chain(&self.trajectory)
    }

    /// Name of the column of time.
    pub fn time(&self) -> Option<&str> {
        self.values.first().filter(|_| self.timed).map(|used| used.name.as_str())
    }
}
