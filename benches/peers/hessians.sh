#!/usr/bin/env bash
# Installs CasADi from its package registry into target/peers-hessians and times it on the functions of `cargo bench --bench hessians`, then
# those on the same machine. Needs Python 3.9 or later.
set -euo pipefail
cd "$(dirname "$0")/../.."

python=target/peers-hessians/bin/python
[ -x "$python" ] || python3 -m venv target/peers-hessians
"$python" -m pip install --quiet casadi==3.8.2 numpy
"$python" benches/peers/hessians.py
cargo bench --locked --bench hessians -- --warm-up-time 0.3 --measurement-time 1
