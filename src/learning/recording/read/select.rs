//! Finds the columns of a file that a description names.

use super::Problem;
use super::error::Faults;
use crate::names::unknown;
use crate::recording::Columns;
use crate::recording::heading::{Heading, headings, is_same, plain};
use crate::recording::units::factor;

/// One used column.
#[derive(Clone, Debug, PartialEq)]
pub struct Used {
    /// Its name, or its number.
    pub name: String,
    /// Its position, from 0.
    pub position: usize,
    /// Factor to SI.
    pub factor: f64,
    /// Unit in its header, if that is the one in use.
    pub unit: Option<String>,
}

/// The used columns of a file, or of one of the trajectories side by side in it.
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
    /// Number of the trajectory after the names of its columns, if several are side by side.
    pub number: Option<String>,
}

/// The columns of a file, from which the used ones are selected.
struct File<'a> {
    columns: &'a Columns,
    /// `None` in a file without names.
    headings: Option<Vec<Heading>>,
    width: usize,
    /// Row of the header.
    row: u64,
}

impl Selection {
    /// Finds the columns among `names`, or by number if a file has no names; `row` is that of the header. One selection for every
    /// trajectory side by side.
    ///
    /// # Errors
    /// [`Problem::Several`] for columns that are missing and units that are not known; [`Problem::Names`] if `columns` has no coordinates.
    pub fn all(columns: &Columns, names: Option<&[String]>, width: usize, row: u64) -> Result<Vec<Self>, Problem> {
        let file = File { columns, headings: names.map(headings), width, row };
        if columns.coords.is_empty() {
            let numbers = || (1..=width).map(|k| k.to_string()).collect();
            let names = |headings: Vec<Heading>| headings.into_iter().map(|heading| heading.name).collect();
            return Err(Problem::Names(file.headings.map_or_else(numbers, names)));
        }
        if columns.wide {
            let numbers = file.numbers()?;
            return numbers.into_iter().map(|number| file.select(Some(number))).collect();
        }
        Ok(vec![file.select(None)?])
    }

    /// The used columns, with the trajectory's column last.
    pub fn used(&self) -> impl Iterator<Item = &Used> {
        self.values.iter().chain(&self.trajectory)
    }

    /// Name of the column of time.
    pub fn time(&self) -> Option<&str> {
        self.values.first().filter(|_| self.timed).map(|used| used.name.as_str())
    }

    /// The description of the columns with the names used in this file.
    pub fn called(&self, columns: &Columns) -> Columns {
        let mut called = columns.clone();
        if columns.wide {
            return called;
        }
        let mut names = self.values.iter().map(|used| &used.name).skip(usize::from(self.timed));
        let Columns { coords, velocity, acceleration, force, error, input, .. } = &mut called;
        let lists = [coords, velocity, acceleration, force, error, input];
        for (name, found) in lists.into_iter().flatten().zip(&mut names) {
            name.clone_from(found);
        }
        called.time = columns.time.as_ref().and(self.time().map(str::to_string));
        called.trajectory = self.trajectory.as_ref().map(|used| used.name.clone());
        let angles = called.coords.iter().zip(columns.periodic()).filter(|(_, periodic)| *periodic);
        called.periodic = angles.map(|(name, _)| name.clone()).collect();
        let renamed: Vec<_> =
            columns.used().zip(called.used()).map(|((_, old), (_, new))| (old, new.clone())).collect();
        for (column, _) in &mut called.units {
            if let Some((_, new)) = renamed.iter().find(|(old, _)| is_same(old, column)) {
                column.clone_from(new);
            }
        }
        called
    }
}

impl File<'_> {
    /// Selects the used columns; for trajectories side by side, those whose names end in this number.
    fn select(&self, number: Option<String>) -> Result<Selection, Problem> {
        let columns = self.columns;
        let mut faults = Faults::default();
        let numbered = |name: &str| format!("{name}{}", number.as_deref().unwrap_or_default());
        let time = match (&columns.time, columns.rate) {
            (Some(name), _) => {
                let own = number.is_some() && self.position("time", &numbered(name)).is_ok();
                faults.good(self.find("time", name, &if own { numbered(name) } else { name.clone() }))
            }
            (None, Some(_)) => None,
            (None, None) => {
                let found = self.usual_time(number.as_deref());
                faults.good(found.and_then(|name| self.find("time", name, name)))
            }
        };
        let timed = columns.rate.is_none();
        let mut values: Vec<Used> = time.into_iter().collect();
        let first = values.len();
        for (what, list) in [
            ("coordinate", &columns.coords),
            ("velocity", &columns.velocity),
            ("acceleration", &columns.acceleration),
            ("force", &columns.force),
            ("error", &columns.error),
            ("input", &columns.input),
        ] {
            for (k, name) in list.iter().enumerate() {
                let Some(mut used) = faults.good(self.find(what, name, &numbered(name))) else { continue };
                // An error has the unit of its coordinate unless it has one of its own; the sign of a factor flips positions, not their
                // errors.
                if what == "error" && used.unit.is_none() && !self.has_unit(name, &used) {
                    used.factor = values.get(first + k).map_or(1.0, |coordinate| coordinate.factor.abs());
                }
                values.push(used);
            }
        }
        let trajectory =
            columns.trajectory.as_deref().and_then(|name| faults.good(self.find("trajectory", name, name)));
        faults.end()?;
        let selection = Selection { width: self.width, values, timed, trajectory, number };
        self.check(&selection)?;
        Ok(selection)
    }

    /// Rejects a column that is used twice, and a unit of the time that is not one of time.
    fn check(&self, selection: &Selection) -> Result<(), Problem> {
        let all: Vec<&Used> = selection.used().collect();
        for (k, used) in all.iter().enumerate() {
            if let Some(other) = all[..k].iter().find(|other| other.position == used.position) {
                let problem = format!("column {} is column {} again", used.name, other.name);
                return Err(Problem::Missing { row: self.row, what: "column", problem });
            }
        }
        let asked = |column: &str| self.columns.used().any(|(_, name)| is_same(name, column));
        let time = selection.time().unwrap_or_default();
        match self.columns.units.iter().find(|(column, _)| !asked(column) && !is_same(time, column)) {
            Some((column, _)) => {
                let problem = format!("the column {column} with a unit is not used, the time is the column {time}");
                Err(Problem::Missing { row: self.row, what: "column", problem })
            }
            None => Ok(()),
        }
    }

    /// The column `name`, which the description calls `asked`.
    fn find(&self, what: &'static str, asked: &str, name: &str) -> Result<Used, Problem> {
        let position = self.position(what, name)?;
        let heading = self.headings.as_ref().and_then(|headings| headings.get(position));
        // A column that is given by its number keeps the number as its name.
        let named = heading.filter(|heading| is_same(&heading.text, name) || is_same(&heading.name, name));
        let name = named.map_or(name, |heading| &heading.name).to_string();
        let mut used = Used { name, position, factor: 1.0, unit: None };
        if what == "trajectory" {
            return Ok(used);
        }
        if let Some(unit) = self.unit(asked, &used) {
            used.factor = factor(unit).unwrap_or(1.0);
        } else if let Some(unit) = heading.and_then(|heading| heading.unit.clone()) {
            let unknown = |problem| Problem::Unit { row: self.row, column: used.name.clone(), problem };
            used.factor = factor(&unit).map_err(unknown)?;
            used.unit = Some(unit);
        }
        Ok(used)
    }

    /// The unit of a column according to the description.
    fn unit(&self, asked: &str, used: &Used) -> Option<&str> {
        let units = || self.columns.units.iter();
        let exact = units().find(|(column, _)| column == asked);
        let found = exact.or_else(|| units().find(|(column, _)| is_same(column, asked) || *column == used.name));
        found.map(|(_, unit)| unit.as_str())
    }

    fn has_unit(&self, asked: &str, used: &Used) -> bool {
        self.unit(asked, used).is_some()
    }

    /// Index of a column, given its name or its number.
    fn position(&self, what: &'static str, name: &str) -> Result<usize, Problem> {
        let (row, width) = (self.row, self.width);
        let named = self.headings.as_deref().unwrap_or(&[]);
        let missing = |problem| Err(Problem::Missing { row, what, problem });
        let mut places = (0..named.len()).filter(|&k| named[k].name == name || named[k].text == name);
        match (places.next(), places.next(), name.parse::<usize>()) {
            (Some(_), Some(_), _) => Err(Problem::Duplicate { row, name: name.to_string() }),
            (Some(place), None, _) => Ok(place),
            (None, _, Ok(number)) if (1..=width).contains(&number) => Ok(number - 1),
            (None, _, Ok(_)) => missing(format!("column {name}, expected a number from 1 to {width}")),
            (None, _, Err(_)) => {
                match named.iter().position(|heading| plain(name).is_some_and(|it| it == heading.name)) {
                    Some(place) => Ok(place),
                    None if self.headings.is_some() => {
                        missing(unknown("column", name, named.iter().map(|heading| heading.name.as_str())))
                    }
                    None => missing(format!(
                        "column {name:?} in a file without names, expected a number from 1 to {width} or the names of all \
                     columns"
                    )),
                }
            }
        }
    }

    /// The column called `t` or `time`, preferably the one with the trajectory's number.
    fn usual_time(&self, number: Option<&str>) -> Result<&str, Problem> {
        let headings = || self.headings.iter().flatten();
        let taken = |name: &str| self.columns.used().any(|(_, other)| is_same(other, name));
        let called = |end: &str| {
            let is_usual = |name: &str| {
                let name = name.strip_suffix(end).unwrap_or_default();
                ["t", "time"].iter().any(|usual| name.eq_ignore_ascii_case(usual))
            };
            headings().map(|heading| heading.name.as_str()).find(|name| is_usual(name) && !taken(name))
        };
        number
            .and_then(called)
            .or_else(|| called(""))
            .ok_or_else(|| Problem::NoTime { names: headings().map(|heading| heading.name.clone()).collect() })
    }

    /// Numbers of the trajectories side by side, in the order of their first columns.
    fn numbers(&self) -> Result<Vec<String>, Problem> {
        let what = "coordinate";
        let named = self.headings.as_deref().unwrap_or(&[]);
        let number = |heading: &Heading, name: &str| {
            let number = heading.name.strip_prefix(name)?;
            (!number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())).then(|| number.to_string())
        };
        let mut numbers: Vec<String> = Vec::new();
        for heading in named {
            for found in self.columns.coords.iter().filter_map(|name| number(heading, name)) {
                if !numbers.contains(&found) {
                    numbers.push(found);
                }
            }
        }
        if numbers.is_empty() {
            let first = self.columns.coords.first().map_or("", String::as_str);
            let problem = format!("expected columns of trajectories side by side, {first}1, {first}2, .., found none");
            return Err(Problem::Missing { row: self.row, what, problem });
        }
        Ok(numbers)
    }
}
