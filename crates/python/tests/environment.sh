#!/usr/bin/env bash
# Makes the virtual environment of the tests of the Python package, target/python/venv, unless it is there. `make test` calls it
# beside the compilation, because it waits for the network most of the time. Prints why where it cannot, and fails.
set -euo pipefail
cd "$(dirname "$0")/../../.."

fail() {
  echo "$1"
  exit 1
}

python=${PYTHON:-python3}
command -v "$python" > /dev/null || fail "$python is not installed"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 9))' || fail "Python is older than 3.9"

venv=${CARGO_TARGET_DIR:-target}/python/venv
stamp=$venv/made
optional="pytest-xdist distributed tqdm xarray shapely matplotlib rasterio rioxarray geopandas pyproj pyarrow"
wanted="numpy pytest mypy; $optional"
if [ "$(cat "$stamp" 2> /dev/null)" != "$wanted" ]; then
  rm -rf "$venv"
  "$python" -m venv "$venv" > /dev/null 2>&1 || fail "a virtual environment cannot be made (python3-venv)"
  pip=("$venv/bin/python" -m pip install --quiet --disable-pip-version-check --retries 1 --timeout 30)
  "${pip[@]}" numpy pytest mypy 2> /dev/null || fail "numpy, pytest and mypy cannot be installed"
  # shellcheck disable=SC2086
  "${pip[@]}" $optional 2> /dev/null || echo "skipped: tests with $optional, which cannot be installed"
  echo "$wanted" > "$stamp"
fi
