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
said=$(crates/python/tests/environment.sh) || skip "$said"
[ -z "$said" ] || echo "$said"

PYTHONPATH=$(crates/python/tests/site.sh)
export PYTHONPATH PYTHONDONTWRITEBYTECODE=1
export SKYSWEEP_COMMAND=${SKYSWEEP_COMMAND:-$(realpath "$target")/debug/skysweep}
python=$target/python/venv/bin/python
# Most tests wait for a process of their own, so two at a time take little more than half as long.
workers=()
"$python" -c 'import xdist' 2> /dev/null && workers=(-n auto --maxprocesses 4)
exec "$python" -m pytest -q -p no:cacheprovider "${workers[@]}" crates/python/tests "$@"
