#!/usr/bin/env bash
# Checks that files of splats open in PlayCanvas's splat-transform, and that it and `skysweep splats convert` agree.
#   benches/peers/splat_transform.sh BINARY SPLATS.ply [FOLDER]
# SPLATS.ply are any splats, such as those of `skysweep train`; FOLDER (default target/splat_transform) gets the program, from
# npm, and the files. Writes benches/results/splat_transform.json and splat_transform.md. Needs node 20 and Python with NumPy and
# SciPy (PYTHON names it).
# Neither the build nor the tests need it.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
folder=${3:-$here/../../target/splat_transform}
mkdir -p "$folder"
[ -d "$folder/node_modules/@playcanvas/splat-transform" ] \
  || npm install --silent --no-audit --no-fund --prefix "$folder" @playcanvas/splat-transform@2.7.1 >&2
[ -d "$folder/node_modules/gltf-validator" ] || npm install --silent --prefix "$folder" gltf-validator@2.0.0-dev.3.10 >&2
export NODE_PATH="$folder/node_modules"
exec "${PYTHON:-python3}" "$here/splat_transform.py" "$1" "$2" "$folder" "$here/../results"
