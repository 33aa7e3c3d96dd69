#!/usr/bin/env bash
# Installs the peers from their package registry into target/peers, builds the benchmark and compares; arguments go to
# compare.py (--quick). Needs Python 3.11 or later and some gigabytes of disk.
set -euo pipefail
cd "$(dirname "$0")/../.."

python=target/peers/bin/python
[ -x "$python" ] || python3 -m venv target/peers
"$python" -m pip install --quiet --requirement benches/peers/requirements.txt
program=$(cargo bench --locked --bench peers --no-run 2>&1 | sed -n 's/.*Executable.*(\(.*\))$/\1/p')
"$python" benches/peers/compare.py "$program" --out target/peers "$@"
