//! What the numbers were measured on and with.

use super::options::Options;
use std::process::Command;

/// CPU, load, threads, flags and versions, one per line.
pub fn description(options: &Options) -> String {
    let threads = std::thread::available_parallelism().map_or(0, usize::from);
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split(' ').take(3).collect::<Vec<_>>().join(" ");
    let profile = if cfg!(debug_assertions) { "with debug assertions" } else { "optimised" };
    let lines = [
        format!("lnn {}, commit {}", env!("CARGO_PKG_VERSION"), said("git", &["rev-parse", "--short", "HEAD"])),
        format!("compiler: {}, {profile}, RUSTFLAGS: {}", said("rustc", &["-V"]), flags()),
        format!("CPU: {}, {threads} threads; vector instructions at run time: {}", cpu(), instructions()),
        "threads used: 1, after the references of the roll-outs and the training of the learned model".to_string(),
        format!("load averages at the start: {}", if load.is_empty() { "unknown" } else { &load }),
        format!(
            "scale: {:?}; at least {} repeats unless a column says fewer",
            options.scale(),
            options.stopwatch().repeats
        ),
    ];
    lines.join("\n")
}

/// First line of a command's output.
fn said(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output();
    let text = output.ok().filter(|o| o.status.success()).and_then(|o| String::from_utf8(o.stdout).ok());
    text.and_then(|text| text.lines().next().map(str::to_string)).unwrap_or_else(|| "unknown".into())
}

/// Flags of the compiler beyond the profile.
fn flags() -> &'static str {
    option_env!("CARGO_ENCODED_RUSTFLAGS").or(option_env!("RUSTFLAGS")).filter(|f| !f.is_empty()).unwrap_or("none")
}

fn cpu() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':').map(|(_, name)| name));
    model.map_or_else(|| std::env::consts::ARCH.to_string(), |name| name.trim().to_string())
}

fn instructions() -> String {
    #[cfg(target_arch = "x86_64")]
    {
        let known = [
            ("avx2", std::is_x86_feature_detected!("avx2")),
            ("fma", std::is_x86_feature_detected!("fma")),
            ("avx512f", std::is_x86_feature_detected!("avx512f")),
        ];
        known.iter().filter(|(_, there)| *there).map(|(name, _)| *name).collect::<Vec<_>>().join(" ")
    }
    #[cfg(not(target_arch = "x86_64"))]
    std::env::consts::ARCH.to_string()
}
