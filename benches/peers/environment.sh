#!/usr/bin/env bash
# Makes a Python environment in FOLDER (default target/peers) with the tools that skysweep priors is compared with.
#   benches/peers/environment.sh [FOLDER]
# Prints the path of its python. Neither the build nor the tests need it.
set -euo pipefail
folder=${1:-$(dirname "$0")/../../target/peers}
[ -x "$folder/bin/python" ] || python3 -m venv "$folder"
"$folder/bin/python" -m pip install --quiet \
  numpy open3d-cpu==0.20.0 trimesh==5.2.0 pycolmap==4.2.1 cjio==0.10.1 mapbox_earcut==2.1.0 >&2
echo "$folder/bin/python"
