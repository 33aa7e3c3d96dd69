//! Files of recorded motion and the meaning of their columns, as arguments.

use crate::CliError;
use crate::arguments::number;
use crate::arguments::spool::read_spooled;
use crate::directories::files::ends_in;
use crate::terminal::interrupt;
use crate::terminal::output;
use lnn::cancellation::Cancellation;
use lnn::lagrangian::SystemInstance;
use lnn::names::pluralize;
use lnn::pipeline::{FirstLook, PipelineError};
use lnn::recording::{ColumnGuess, Columns, DataError, Guess, LoadedRecording, Problem};
use std::path::{Path, PathBuf};

/// Recorded motion.
#[derive(Clone, Debug, clap::Args)]
pub struct RecordingArgs {
    /// Files of recorded motion: CSV (also packed by gzip), XLSX, NPY or NPZ; - is standard input. Each holds a trajectory, or several
    /// distinguished by a column or side by side.
    #[arg(required = true, value_name = "DATA")]
    pub data: Vec<PathBuf>,
    /// Columns of the coordinates, by name or by number from 1 [default: guessed from names and numbers, with the meaning of the other
    /// columns].
    #[arg(long, value_name = "q1,q2", value_delimiter = ',')]
    pub coords: Vec<String>,
    /// Columns of measured velocities, one per coordinate.
    #[arg(long, value_name = "v1,v2", value_delimiter = ',')]
    pub velocity: Vec<String>,
    /// Columns of measured accelerations, one per coordinate.
    #[arg(long, value_name = "a1,a2", value_delimiter = ',')]
    pub acceleration: Vec<String>,
    /// Columns of known external generalized forces, one per coordinate; =FORMULA is a formula of the time t and of other columns, such as
    /// '=0.3*cos(1.2*t)'.
    #[arg(long, value_name = "f1,f2", value_delimiter = ',')]
    pub force: Vec<String>,
    /// Column of the time [default: the one called t or time, unless there is a rate].
    #[arg(long, value_name = "COLUMN", conflicts_with = "rate")]
    pub time: Option<String>,
    /// Samples per second, if no column holds the time.
    #[arg(long, value_name = "HZ", value_parser = number::rate)]
    pub rate: Option<f64>,
    /// Column whose value distinguishes the trajectories of a file.
    #[arg(long, value_name = "COLUMN")]
    pub trajectory: Option<String>,
    /// Trajectories are side by side: those of s,theta in the columns s1,theta1,s2,theta2.
    #[arg(long, conflicts_with = "trajectory")]
    pub wide: bool,
    /// Coordinates that are angles, in rad or with a unit; they are unwrapped.
    #[arg(long, value_name = "q1,q2", value_delimiter = ',')]
    pub periodic: Vec<String>,
    /// Units of columns that are not SI, or factors to SI, such as theta=deg,t=ms,x=0.01 [default: those in brackets in the header].
    #[arg(long, value_name = "COLUMN=UNIT", value_delimiter = ',', value_parser = unit)]
    pub units: Vec<(String, String)>,
    /// Names of all columns of files without a header.
    #[arg(long, value_name = "a,b,c", value_delimiter = ',')]
    pub columns: Vec<String>,
}

/// Returns `--` if the message begins with the name of an option, otherwise an empty text.
fn option(problem: &str) -> &'static str {
    let options =
        ["coords:", "velocity:", "acceleration:", "force:", "error:", "periodic:", "units:", "rate:", "columns:"];
    if options.iter().any(|name| problem.starts_with(name)) { "--" } else { "" }
}

/// Parses `column=unit`.
pub fn unit(text: &str) -> Result<(String, String), String> {
    lnn::pipeline::unit(text).ok_or_else(|| "expected COLUMN=UNIT".to_string())
}

/// Describes the argument DATA of a command that accepts something else instead; the options of columns apply only to data.
pub fn data_or(value_name: &'static str, help: &'static str) -> impl Fn(clap::Arg) -> clap::Arg {
    move |argument| if argument.get_id() == "data" { argument.value_name(value_name).help(help) } else { argument }
}

impl RecordingArgs {
    /// The files.
    pub fn inputs(&self) -> Vec<&Path> {
        self.data.iter().map(PathBuf::as_path).collect()
    }

    /// The model, a file or the directory of a run, if a single one is given instead of data.
    pub fn model(&self) -> Option<&Path> {
        match self.data.as_slice() {
            [path] if path.is_dir() || ends_in(path, &["safetensors"]) => Some(path),
            _ => None,
        }
    }

    /// Meaning of the columns.
    pub fn meaning(&self) -> Columns {
        let Self { coords, velocity, acceleration, force, time, rate, trajectory, wide, periodic, .. } = self.clone();
        let names = (!self.columns.is_empty()).then(|| self.columns.clone());
        let columns = Columns { coords, velocity, acceleration, force, periodic, ..Columns::default() };
        Columns { time, rate, trajectory, wide, units: self.units.clone(), names, ..columns }
    }

    /// Reads the files. Without coordinates, the roles of the columns are guessed first, and a note states the guess.
    ///
    /// # Errors
    /// Those of [`read`].
    pub fn read(&self) -> Result<(LoadedRecording, Columns), CliError> {
        let (reading, Guess { columns, table }) = self.load(false)?;
        note(&columns, &table);
        Ok((reading, columns))
    }

    /// Reads the files as a recording of a system, which names the columns that are not given; `error` are the columns of standard
    /// deviations.
    ///
    /// # Errors
    /// Those of [`read`], and a usage error for columns that do not match the system.
    pub fn read_of(&self, system: &SystemInstance<f64>, error: &[String]) -> Result<LoadedRecording, CliError> {
        let columns = Columns { error: error.to_vec(), ..self.meaning() };
        let completed = columns.clone().of_system(system).map_err(|wrong| refused(&wrong.into(), &columns))?;
        Ok(read(&self.data, &completed)?.measured_by(system))
    }

    /// Reads the files, and returns the roles of the columns; with `beside`, also the numbers in other columns.
    ///
    /// # Errors
    /// Those of [`read`].
    pub fn load(&self, beside: bool) -> Result<(LoadedRecording, Guess), CliError> {
        let mut guessed = Guess { columns: self.meaning(), table: Vec::new() };
        let read = read_spooled(&self.data, |files| {
            if self.coords.is_empty() {
                guessed = Guess::of(files, &guessed.columns)?;
            }
            if !beside {
                guessed.columns.input.clear();
            }
            guessed.read(files)
        });
        match read {
            Ok(reading) => Ok((reading, guessed)),
            Err(error) => Err(refused(&error, &guessed.columns)),
        }
    }

    /// Formats the options that state these column meanings for the same files, each after a blank.
    pub fn command(&self, columns: &Columns) -> String {
        let quoted = |text: &str| match text.chars().all(|c| c.is_ascii_alphanumeric() || "_-./,=+:".contains(c)) {
            true if !text.is_empty() => text.to_string(),
            _ => format!("'{}'", text.replace('\'', "'\\''")),
        };
        let mut line: String =
            self.data.iter().map(|file| format!(" {}", quoted(&file.display().to_string()))).collect();
        let units: Vec<String> = columns.units.iter().map(|(column, unit)| format!("{column}={unit}")).collect();
        let one = |name: &Option<String>| name.iter().cloned().collect::<Vec<_>>();
        for (option, values) in [
            ("coords", &columns.coords),
            ("velocity", &columns.velocity),
            ("acceleration", &columns.acceleration),
            ("force", &columns.force),
            // Default names are omitted.
            ("time", &one(&columns.time.clone().filter(|name| name != "t" && name != "time"))),
            ("rate", &one(&columns.rate.map(|rate| rate.to_string()))),
            ("trajectory", &one(&columns.trajectory)),
            ("periodic", &columns.periodic),
            ("units", &units),
            ("columns", &columns.names.clone().unwrap_or_default()),
        ] {
            if !values.is_empty() {
                line += &format!(" --{option} {}", quoted(&values.join(",")));
            }
        }
        if columns.wide {
            line += " --wide";
        }
        line
    }

    /// These arguments with the columns of a guess.
    ///
    /// # Errors
    /// Those of [`read`].
    pub fn complete(&self) -> Result<Self, CliError> {
        let columns = self.meaning();
        let Guess { columns, table } = Guess::of(&self.data, &columns).map_err(|error| refused(&error, &columns))?;
        note(&columns, &table);
        let Columns { coords, velocity, acceleration, force, time, rate, trajectory, periodic, units, .. } = columns;
        let args = self.clone();
        Ok(Self { coords, velocity, acceleration, force, time, rate, trajectory, periodic, units, ..args })
    }
}

/// Prints the guessed roles of the columns, if there was a guess.
fn note(columns: &Columns, table: &[ColumnGuess]) {
    if !table.is_empty() {
        let (coords, angles) = (columns.coords.join(", "), columns.periodic.join(", "));
        let angles = if angles.is_empty() { angles } else { format!(", angles {angles}") };
        output::note(&format!("the columns are guessed: coordinates {coords}{angles}; lnn check lists the others"));
    }
}

/// Reads files with columns of this meaning.
///
/// # Errors
/// A usage error for columns that contradict each other, a data error for the first file that does not match.
pub fn read(files: &[PathBuf], columns: &Columns) -> Result<LoadedRecording, CliError> {
    let reading =
        read_spooled(files, |files| LoadedRecording::read(files, columns)).map_err(|error| refused(&error, columns))?;
    note_incomplete(&reading);
    Ok(reading)
}

/// Reports how many rows are left out because a reading is missing.
fn note_incomplete(reading: &LoadedRecording) {
    if reading.incomplete > 0 {
        let rows = pluralize(reading.incomplete, "row with an empty field is", "rows with an empty field are");
        output::note(&format!("{rows} left out"));
    }
}

/// Converts a mistake in files or in column meanings to an error.
fn refused(error: &DataError, columns: &Columns) -> CliError {
    match error {
        DataError::File { problem, .. } => CliError::data(format_args!("{error}{}", help(columns, problem))),
        DataError::Columns(wrong) => {
            let wrong: Vec<_> = wrong.0.iter().map(|problem| format!("{}{problem}", option(problem))).collect();
            CliError::usage(wrong.join("; "))
        }
        _ => CliError::usage(error),
    }
}

/// The option that helps, preceded by a colon.
fn help(columns: &Columns, problem: &Problem) -> &'static str {
    match problem {
        Problem::NoTime { .. } => ": --time COLUMN or --rate HZ",
        Problem::Names(_) => ": --coords names them",
        Problem::Missing { what: "time", .. } => ": --time COLUMN names it",
        Problem::Missing { what: "trajectory", .. } => ": --trajectory COLUMN names it",
        Problem::Missing { what: "coordinate", .. } => ": --coords names it",
        Problem::Missing { what: "velocity", .. } => ": --velocity names it",
        Problem::Missing { what: "acceleration", .. } => ": --acceleration names it",
        Problem::Missing { what: "force", .. } => ": --force names it",
        Problem::Missing { what: "error", .. } => ": --error names it",
        Problem::Width { .. } | Problem::Header { .. } => ": see --columns",
        Problem::Unit { .. } => ": --units COLUMN=UNIT",
        Problem::Several { first, .. } => first.first().map_or("", |problem| help(columns, problem)),
        Problem::Order { .. } if columns.trajectory.is_none() => ": --trajectory COLUMN",
        _ => "",
    }
}

/// Takes a first look at recorded motion.
///
/// # Errors
/// A data error for motion that cannot be smoothed, an interruption.
pub fn first_look(reading: &LoadedRecording, guessed: Vec<ColumnGuess>) -> Result<FirstLook, CliError> {
    let stop = Cancellation::by(&interrupt::flag()?);
    FirstLook::new(reading, guessed, &stop).map_err(|error| match error {
        PipelineError::Interrupted => CliError::nothing_written(),
        error => error.into(),
    })
}
