//! The program `lnn`.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    lnn::cli::main(std::env::args_os())
}
