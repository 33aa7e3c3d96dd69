//! Reads a black hole off a model that learned it from free fall: orbits of light, the innermost stable orbit, the horizon, the spin, beside
//! the closed forms.
//!
//! `lnn train kerr-cartesian --out runs/kerr`, then `cargo run --release --example black_holes -- runs/kerr`.

use lnn::lagrangian::{System, SystemInstance};
use lnn::network::{ModelFile, NetworkLagrangian};
use lnn::pipeline::model_file;
use lnn::relativity::{CentralCoordinates, LearnedHole};
use std::borrow::Cow;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("expected the directory of a run, or its model file")?;
    let ModelFile { header, weights } = ModelFile::<f64>::load(&model_file(Path::new(&path))?)?;
    let system = SystemInstance::<f64>::with_values(Cow::Borrowed(System::named(&header.system)?), &header.parameters)?;
    let coordinates = system.system.coordinates(system.coordinates);
    let names: Vec<&str> = coordinates.iter().map(|c| c.name.as_ref()).collect();
    let around = CentralCoordinates::of_names(&names)
        .ok_or("expected the coordinates of a hole: t, x, y, z or t, r, theta, phi")?;
    let (learned, exact) = (NetworkLagrangian::new(header.architecture, weights)?, system.build()?);
    let pair = LearnedHole { exact: &*exact, learned: &learned, system: &system, around, range: (1.35, 110.0) };

    println!("{}", header.system);
    println!("{:70} {:>11} {:>11} {:>9} {:>7}", "", "exact", "learned", "error", "aim");
    let value = |x: Option<f64>| x.map_or("-".to_string(), |x| format!("{x:.6}"));
    for reading in pair.readings()? {
        let error = reading.error.map_or("-".to_string(), |error| format!("{:.4} %", 100.0 * error));
        let (exact, learned, aim) = (value(reading.exact), value(reading.learned), 100.0 * reading.aim);
        println!("{:70} {exact:>11} {learned:>11} {error:>11} {aim:>5.2} %", reading.quantity);
    }
    Ok(())
}
