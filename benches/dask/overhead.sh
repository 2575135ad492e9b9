#!/usr/bin/env bash
# What Dask and the plan cost beside the work on the chunks: 1,000 workers in one process, 10,000 chunks that are not swept.
#   benches/dask/overhead.sh [PYTHON]
# PYTHON has numpy and dask.distributed; the default is the one of the tests of the Python package (make test-python), whose
# library is measured, too. Writes benches/results/dask_overhead.json and dask_overhead.md. Neither the build nor the tests need it.
set -euo pipefail
cd "$(dirname "$0")/../.."
target=${CARGO_TARGET_DIR:-target}
PYTHONPATH=$(crates/python/tests/site.sh) exec "${1:-$target/python/venv/bin/python}" benches/dask/overhead.py benches/results
