#!/usr/bin/env bash
# Compares skysweep.Rpc with rpcm and rpcfast on arrays of points, and imports skysweep beside packages with a GDAL of their own.
#   benches/peers/python_rpc.sh SITE [FOLDER]
# SITE is a folder in which the package lies (`crates/python/tests/run.sh` makes target/python/site; an unpacked wheel is one,
# too); FOLDER (default target/python/peers) gets the environment. Writes benches/results/python_rpc.json and python_rpc.md.
# SKYSWEEP_PROFILE names the profile that the library was built with (default: that of the tests). Neither the build nor the tests need it.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
site=$(realpath "$1")
folder=${2:-$here/../../target/python/peers}
[ -x "$folder/bin/python" ] || python3 -m venv "$folder"
"$folder/bin/python" -m pip install --quiet \
  numpy rpcm==1.4.10 rpcfast==1.0.4 rasterio==1.4.4 geopandas pyproj open3d-cpu==0.20.0 >&2
PYTHONPATH=$site exec "$folder/bin/python" "$here/python_rpc.py" "$here/../results"
