//! Every benchmark once, at its smallest, in one program: what `cargo test` runs of them.
#![allow(dead_code, unused_imports, reason = "the mains of the benchmarks are not called")]
#![allow(clippy::duplicate_mod, clippy::module_inception, reason = "each benchmark is a program of its own too")]

mod hessians;
mod linalg;
mod network;
mod soak;
mod systems;
mod tape;

#[path = "cost/main.rs"]
mod cost;
#[path = "peers/main.rs"]
mod peers;
#[path = "work_precision.rs"]
mod work_precision;

fn main() {
    // Without `--bench` criterion runs every function once.
    linalg::linalg_benches();
    systems::systems_benches();
    tape::benches();
    hessians::hessian_benches();
    network::benches();
    cost::run(true);
    peers::smoke().expect("every request is answered");
    soak::soak(0.0);
    work_precision::trial();
}
