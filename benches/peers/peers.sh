#!/usr/bin/env bash
# Writes benches/results/peers.json: what S2P and CARS made of the shared scenes, with the source of every number.
#   benches/peers/peers.sh
# It installs NumPy, SciPy, rasterio and pyproj from PyPI into target/peers/judge. Neither the build nor the tests need it.
set -euo pipefail
cd "$(dirname "$0")/../.."
folder=target/peers/judge
[ -x "$folder/bin/python" ] || python3 -m venv "$folder"
"$folder/bin/python" -m pip install --quiet numpy scipy rasterio pyproj >&2
exec "$folder/bin/python" benches/peers/peers.py
