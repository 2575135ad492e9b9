#!/usr/bin/env bash
# Compares the rasteriser of trained splats with PyTorch on the CPU: forward and backward pass of the same sums, one thread each.
#   benches/peers/torch_splats.sh [FOLDER]
# FOLDER (default target/python/torch) gets the environment: some gigabytes, because PyPI has PyTorch with CUDA only.
# Writes benches/results/splat_rasteriser.json and splat_rasteriser.md. Neither the build nor the tests need it.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
folder=${1:-$here/../../target/python/torch}
[ -x "$folder/bin/python" ] || python3 -m venv "$folder"
"$folder/bin/python" -m pip install --quiet numpy torch==2.9.1 >&2
cd "$here/../.."
cargo bench --quiet -p skysweep-train --bench raster >&2
exec "$folder/bin/python" "$here/torch_splats.py" "${CARGO_TARGET_DIR:-target}/criterion/raster" "$here/../results"
