//! Any text as the configuration of a fit: refused with a message, or written back as the same configuration.

use lnn::pipeline::FitConfig;
use lnn_cli::parse_config;

/// Reads the bytes.
pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match parse_config::<FitConfig>(text) {
        Ok(config) => {
            let written = toml::to_string(&config).expect("a configuration that was read can be written");
            let again: FitConfig = parse_config(&written).expect("and read again");
            assert_eq!(toml::to_string(&again).expect("and written again"), written);
        }
        Err((line, problem)) => {
            assert!((1..=text.split('\n').count()).contains(&line), "line {line}: {problem}");
            assert!(!problem.is_empty());
        }
    }
}
