//! Reads the Lagrangian of a recorded double pendulum off its angles alone.

use lnn::formula::{FormulaOptions, FoundFormula, Verdict};
use lnn::recording::{Columns, LoadedRecording};

/// Finds the formula and prints it.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let angles = ["theta1", "theta2"].map(String::from).to_vec();
    let columns =
        Columns { periodic: angles.clone(), coords: angles, trajectory: Some("run".into()), ..Columns::default() };
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/data/pendulum.csv");
    let recording = LoadedRecording::read(&[file], &columns)?.recording;
    let options =
        FormulaOptions { friction: true, gyroscopic: false, bootstraps: 20, threads: 2, ..FormulaOptions::default() };
    let found = FoundFormula::of_motion(&recording, &options)?;
    println!("{:?}, residual {:.3} times the noise", found.verdict, found.residual);
    println!("L = {}\nD = {}", found.text(false), found.text(true));
    for term in &found.terms {
        println!(
            "{:45} {:9.5} +- {:.5}, probability {:.2}",
            term.term, term.coefficient, term.standard_error, term.probability
        );
    }
    assert_eq!((found.verdict, found.terms.len()), (Verdict::Found, 8)); // five of L, three of D
    Ok(())
}
