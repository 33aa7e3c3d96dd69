//! The program `lnn`.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    lnn_cli::main(std::env::args_os())
}
