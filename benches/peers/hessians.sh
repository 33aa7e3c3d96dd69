#!/usr/bin/env bash
# Installs CasADi from its package registry into target/peers-hessians and times it on the functions of `cargo bench --bench hessians`, then
# num-dual, built in three ways, and then those on the same machine. Needs Python 3.9 or later.
set -euo pipefail
cd "$(dirname "$0")/../.."

python=target/peers-hessians/bin/python
[ -x "$python" ] || python3 -m venv target/peers-hessians
"$python" -m pip install --quiet casadi==3.8.2 numpy
"$python" benches/peers/hessians.py

crate=target/peers-hessians/num-dual
mkdir -p "$crate/src"
cp benches/peers/num_dual.rs "$crate/src/main.rs"
cat > "$crate/Cargo.toml" << 'MANIFEST'
[package]
name = "num-dual-hessians"
version = "0.0.0"
edition = "2024"
[dependencies]
num-dual = "0.15"
nalgebra = "0.35"
[workspace]
MANIFEST
build() { cargo run --quiet --release --manifest-path "$crate/Cargo.toml"; }
echo "num-dual, as cargo builds a release"
build
echo "num-dual, without optimisation across codegen units, as this crate is built"
CARGO_PROFILE_RELEASE_LTO=off build
echo "num-dual, one codegen unit, link-time optimisation, for this processor"
CARGO_PROFILE_RELEASE_LTO=fat CARGO_PROFILE_RELEASE_CODEGEN_UNITS=1 RUSTFLAGS="-C target-cpu=native" build
cargo bench --locked --bench hessians -- --warm-up-time 0.3 --measurement-time 1
