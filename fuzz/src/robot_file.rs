//! Any text as the file of a robot: refused with a line and a message, or a system whose description is written back as the same one; and the
//! same text if it is written with the constants that it has.

use lnn::lagrangian::SystemInstance;
use lnn::pipeline::parse_system;
use lnn::pipeline::{parse_robot, rewrite_robot};
use std::borrow::Cow;

/// Reads the bytes.
pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let system = match parse_robot(text) {
        Ok((system, _)) => system,
        Err((line, problem)) => {
            assert!((1..=text.split('\n').count()).contains(&line), "line {line}: {problem}");
            return assert!(!problem.is_empty());
        }
    };
    let description = system.with_defaults(&[]).expect("it comes from a description");
    let written = toml::to_string(&description).expect("a description can be written");
    let again = parse_system(&written).expect("and read again");
    assert_eq!(again.with_defaults(&[]).as_ref(), Some(&description));
    let configured = SystemInstance::<f64>::new(Cow::Owned(system), &[]).expect("the defaults are in range");
    let symbols: Vec<String> = configured.system.parameters.iter().map(|known| known.symbol.to_string()).collect();
    let same: Vec<(&str, f64)> =
        symbols.iter().map(String::as_str).zip(configured.parameters.iter().copied()).collect();
    // An MJCF file is not written back.
    if let Ok(copy) = rewrite_robot(text, &same) {
        assert_eq!(copy, text);
    }
    // Other masses: refused, or read again.
    let heavier: Vec<(&str, f64)> = same.iter().map(|&(symbol, x)| (symbol, 1.5 * x)).collect();
    if let Ok(other) = rewrite_robot(text, &heavier) {
        parse_robot(&other).expect("what is written can be read");
    }
}
