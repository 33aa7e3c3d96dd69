//! Any text as the configuration of a training: refused with a message, or in range and written back as the same
//! configuration.

use lnn::configuration::Config;
use lnn::lagrangian::SystemInstance;
use lnn_cli::parse_config;

/// Reads the bytes.
pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let config = match parse_config::<Config>(text) {
        Ok(config) => config,
        Err((line, problem)) => {
            assert!((1..=text.split('\n').count()).contains(&line), "line {line}: {problem}");
            return assert!(!problem.is_empty());
        }
    };
    let given: Vec<(String, String)> = config.parameters.iter().map(|(s, x)| (s.clone(), x.to_string())).collect();
    let Ok(system) = SystemInstance::<f64>::named(&config.system, &given) else { return };
    if config.validate(system.coordinates).is_err() {
        return;
    }
    let written = toml::to_string(&config).expect("a configuration in range can be written");
    let again: Config = parse_config(&written).expect("and read again");
    assert_eq!(again, config);
    assert_eq!(toml::to_string(&again).expect("and written again"), written);
}
