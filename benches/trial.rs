//! Every benchmark once, at its smallest, in one program: what `cargo test` runs of them.
#![allow(dead_code, unused_imports, reason = "the mains of the benchmarks are not called")]
#![allow(clippy::duplicate_mod, clippy::module_inception, reason = "each benchmark is a program of its own too")]

mod constraints;
mod formula;
mod hessians;
mod identify;
mod linalg;
mod measured;
mod network;
mod soak;
mod systems;
mod tape;
mod watch;

#[path = "cost/main.rs"]
mod cost;
#[path = "open_tables/main.rs"]
mod open_tables;
#[path = "peers/main.rs"]
mod peers;
#[path = "rates/main.rs"]
mod rates;
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
    measured::trial();
    formula::trial();
    identify::trial();
    work_precision::trial();
    constraints::trial();
    open_tables::trial();
    rates::trial();
    watch::trial();
}
