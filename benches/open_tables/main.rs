//! Tables that others published, by their protocols, learned here.
//!
//! `cargo bench --bench open_tables` runs all of them; `--table chunks` is of Finzi, Wang and Wilson, `--table hamiltonian` of Greydanus,
//! Dzamba and Yosinski, `--table letters --letters FILE.csv` of Lutter, Ritter and Peters. `--row NAME` takes one system, `--seeds N` so
//! many seeds from 0 (3 if not given), `--steps N` so many steps of the optimiser. Of the first table `--chunks N` takes so many chunks to
//! learn from (800), `--in generalized` or `--in cartesian` one kind of coordinates.

mod chunks;
mod hamiltonian;
mod letters;

/// Steps of the optimiser.
const STEPS: usize = 6000;

/// Rows of every table at their smallest.
pub fn trial() {
    chunks::trial();
    hamiltonian::trial();
    letters::trial();
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let after = |name: &str| arguments.iter().position(|a| a == name).and_then(|at| arguments.get(at + 1));
    let number = |name: &str, usual: usize| after(name).and_then(|text| text.parse().ok()).unwrap_or(usual);
    let (row, seeds, steps) =
        (after("--row").map(String::as_str), number("--seeds", 3) as u64, number("--steps", STEPS));
    let asked = |name: &str| after("--table").is_none_or(|table| table == name);
    if asked("chunks") {
        chunks::all(row, seeds, after("--in").map(String::as_str), number("--chunks", 800), steps);
    }
    if asked("hamiltonian") {
        hamiltonian::all(row, seeds, steps);
    }
    if asked("letters") {
        letters::all(after("--letters").map(String::as_str), seeds);
    }
}
