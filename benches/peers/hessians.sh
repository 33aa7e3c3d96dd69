#!/usr/bin/env bash
# Installs CasADi and JAX from their package registry into target/peers-hessians and times them on the functions of `cargo bench --bench
# hessians`, then num-dual, built in three ways, HyperJet if HYPERJET is a folder with its repository (v1.5.0), and then those on the same
# machine. Needs Python 3.11 or later.
set -euo pipefail
cd "$(dirname "$0")/../.."

python=target/peers-hessians/bin/python
[ -x "$python" ] || python3 -m venv target/peers-hessians
"$python" -m pip install --quiet casadi==3.8.2 jax==0.10.2 numpy==2.4.6
"$python" benches/peers/hessians.py
# One thread: JAX has no setting of its own for that.
taskset -c 0 "$python" benches/peers/jax_chain.py

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

# HyperJet's headers are in its repository alone: its wheel holds the Python module, and its source distribution no source.
if [ -n "${HYPERJET:-}" ]; then
    for flags in "-O2" "-O3 -march=native"; do
        # shellcheck disable=SC2086
        g++ -std=c++17 $flags -DNDEBUG -I"$HYPERJET/include" benches/peers/hyperjet.cpp -o target/peers-hessians/hyperjet
        echo "HyperJet, $flags"
        target/peers-hessians/hyperjet
    done
else
    echo "HyperJet is left out: HYPERJET names no folder with its repository"
fi

cargo bench --locked --bench hessians -- --warm-up-time 0.3 --measurement-time 1
