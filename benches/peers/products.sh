#!/usr/bin/env bash
# Checks the products of a run with programs of others: laspy with lazrs, gltf-validator, py3dtiles, rio-cogeo, SQLite.
#   benches/peers/products.sh RUN [FOLDER]
# RUN is the folder of a run after `skysweep products RUN`; FOLDER (default target/products) gets the programs, from PyPI
# and npm. TILES_SCHEMA may name the folder specification/schema of a checkout of CesiumGS/3d-tiles: the tileset is then
# checked against it. Writes benches/results/products.json and products.md. Neither the build nor the tests need it.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
run=$1
folder=${2:-$here/../../target/products}
[ -x "$folder/venv/bin/python" ] || python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet \
  laspy==2.7.0 lazrs==0.8.2 pyproj py3dtiles==12.1.1 rio-cogeo==7.0.4 jsonschema==4.26.0 numpy >&2
[ -d "$folder/node_modules/gltf-validator" ] || npm install --silent --prefix "$folder" gltf-validator@2.0.0-dev.3.10 >&2
NODE_PATH="$folder/node_modules" exec "$folder/venv/bin/python" "$here/products.py" "$run" "$here/../results"
