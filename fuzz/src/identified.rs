//! Any text as the file of a system whose constants were identified: with other values it is written, and read again as the same system
//! with these values. The bytes of the text make the values.

use lnn::pipeline::parse_system;

/// Reads the bytes.
pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(system) = parse_system(text) else { return };
    let value = |k: usize| 0.1 + f64::from(bytes[(7 * k + 3) % bytes.len()]) / 16.0;
    let names: Vec<String> = system.parameters.iter().map(|parameter| parameter.symbol.to_string()).collect();
    let values: Vec<(&str, f64)> = names.iter().enumerate().map(|(k, name)| (name.as_str(), value(k))).collect();
    let description = system.with_defaults(&values).expect("it comes from a description");
    let written = toml::to_string(&description).expect("a description can be written");
    let again = parse_system(&written).expect("and read again");
    for (name, value) in values {
        let parameter = again.parameters.iter().find(|parameter| parameter.symbol == name).expect("it has it still");
        assert_eq!(parameter.default.parse::<f64>().expect("a number"), value, "{name}");
    }
}
