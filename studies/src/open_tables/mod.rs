//! Tables that others published, by their protocols, learned here.
//!
//! `lnn-studies open-tables` runs all of them; `--table chunks` is of Finzi, Wang and Wilson, `--table hamiltonian` of Greydanus,
//! Dzamba and Yosinski, `--table letters --letters FILE.csv` of Lutter, Ritter and Peters.

mod chunks;
mod hamiltonian;
mod letters;

use clap::builder::PossibleValuesParser;
use std::path::PathBuf;

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Table {
    Chunks,
    Hamiltonian,
    Letters,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Coordinates {
    Generalized,
    Cartesian,
}

/// Arguments.
#[derive(clap::Args)]
pub struct Args {
    /// One table; all if not given
    #[arg(long)]
    table: Option<Table>,
    /// One system
    #[arg(long, value_parser = PossibleValuesParser::new(chunks::names().chain(hamiltonian::names())))]
    row: Option<String>,
    /// Seeds from 0 on
    #[arg(long, default_value_t = 3)]
    seeds: u64,
    /// Steps of the optimiser
    #[arg(long, default_value_t = 6000)]
    steps: usize,
    /// Chunks to learn from
    #[arg(long, default_value_t = 800)]
    chunks: usize,
    /// One kind of coordinates of the chunks; both if not given
    #[arg(long)]
    r#in: Option<Coordinates>,
    /// Recorded letters, a file that `benches/peers/letters.py` makes
    #[arg(long)]
    letters: Option<PathBuf>,
}

/// Measures the tables that are asked for.
pub fn run(arguments: Args) {
    let (row, seeds, steps) = (arguments.row.as_deref(), arguments.seeds, arguments.steps);
    let asked = |table: Table| arguments.table.is_none_or(|asked| asked == table);
    if asked(Table::Chunks) {
        chunks::all(row, seeds, arguments.r#in, arguments.chunks, steps);
    }
    if asked(Table::Hamiltonian) {
        hamiltonian::all(row, seeds, steps);
    }
    if asked(Table::Letters) {
        letters::all(arguments.letters.as_deref(), seeds);
    }
}
