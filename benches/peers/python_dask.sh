#!/usr/bin/env bash
# Compares a planned run on a Dask cluster of two workers with `skysweep dsm`: bytes, processor time, workers that are killed.
#   benches/peers/python_dask.sh SITE COMMAND IMAGE…
# SITE is a folder in which the package lies (target/python/site, or an unpacked wheel), COMMAND the command skysweep of the
# same build. The scene of 8192² pixels is made by
#   cargo bench --bench scale -- 8192 --folder /tmp/scale
# as /tmp/scale/view_*_8192.vrt. Writes benches/results/python_dask.json and python_dask.md. Neither the build nor the tests need it.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
site=$(realpath "$1")
command=$(realpath "$2")
shift 2
folder=$here/../../target/python/dask
[ -x "$folder/bin/python" ] || python3 -m venv "$folder"
"$folder/bin/python" -m pip install --quiet numpy distributed==2026.8.0 >&2 || "$folder/bin/python" -m pip install --quiet numpy distributed >&2
PYTHONPATH=$site exec "$folder/bin/python" "$here/python_dask.py" "$here/../results" "$command" "$@"
