#!/usr/bin/env bash
# Runs the tests of the Python package in a virtual environment of its own, target/python/venv.
#
# The library is the one that `cargo test --workspace` has built; nothing is compiled here. Where
# there is no Python, no venv or no package index, one line says so, and nothing fails. Packages that
# only some tests need are optional; those tests are skipped without them.
set -euo pipefail
cd "$(dirname "$0")/../../.."

skip() {
  echo "skipped: the tests of the Python package: $1"
  exit 0
}

target=${CARGO_TARGET_DIR:-target}
library=$target/debug/deps/lib_native.so
[ -e "$library" ] || skip "$library is not there: run 'cargo test --workspace --no-run' first"
python=${PYTHON:-python3}
command -v "$python" > /dev/null || skip "$python is not installed"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 9))' || skip "Python is older than 3.9"

venv=$target/python/venv
stamp=$venv/made
optional="distributed tqdm xarray shapely matplotlib rasterio rioxarray geopandas pyproj pyarrow"
wanted="numpy pytest mypy; $optional"
if [ "$(cat "$stamp" 2> /dev/null)" != "$wanted" ]; then
  rm -rf "$venv"
  "$python" -m venv "$venv" > /dev/null 2>&1 || skip "a virtual environment cannot be made (python3-venv)"
  pip=("$venv/bin/python" -m pip install --quiet --disable-pip-version-check --retries 1 --timeout 30)
  "${pip[@]}" numpy pytest mypy 2> /dev/null || skip "numpy, pytest and mypy cannot be installed"
  # shellcheck disable=SC2086
  "${pip[@]}" $optional 2> /dev/null || echo "skipped: tests with $optional, which cannot be installed"
  echo "$wanted" > "$stamp"
fi

PYTHONPATH=$(crates/python/tests/site.sh)
export PYTHONPATH PYTHONDONTWRITEBYTECODE=1
export SKYSWEEP_COMMAND=${SKYSWEEP_COMMAND:-$(realpath "$target")/debug/skysweep}
exec "$venv/bin/python" -m pytest -q -p no:cacheprovider crates/python/tests "$@"
