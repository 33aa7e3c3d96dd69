//! Tests that must own their process: they count its allocations or threads, or kill it.

mod allocation;
mod counting;
mod kills;
mod memory;
mod streams;
mod threads;
mod training_allocation;

use std::process::Command;

/// Whether this is a process of the named test alone; otherwise starts one and fails if the test fails there.
fn alone(name: &str) -> bool {
    const INSIDE: &str = "LNN_TEST_ALONE";
    if std::env::var_os(INSIDE).is_some() {
        return true;
    }
    let mut command = Command::new(std::env::current_exe().unwrap());
    let output = command.args(["--exact", name, "--test-threads=1", "--nocapture"]).env(INSIDE, "1").output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    print!("{said}");
    assert!(output.status.success() && said.contains("1 passed"), "{said}{}", String::from_utf8_lossy(&output.stderr));
    false
}
