#!/usr/bin/env bash
# Checks that readers of other projects load what `skysweep priors` writes; writes benches/results/priors_readers.txt.
#   benches/peers/priors_readers.sh [SKYSWEEP]
# It makes a dataset of the sample town, which pycolmap, Open3D, trimesh and NumPy read (`check_priors.py`).
set -euo pipefail
cd "$(dirname "$0")/../.."
skysweep=${1:-target/release/skysweep}
python=$(benches/peers/environment.sh)
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
"$skysweep" priors data-samples/town/truth/buildings.city.json --cameras data-samples/town/cameras --points 200000 \
  -o "$made/priors" -q --progress none
"$python" -m pip list --format freeze 2> /dev/null | grep -iE '^(pycolmap|open3d-cpu|trimesh|numpy)==' | tee "$made/said"
"$python" benches/peers/check_priors.py "$made/priors" | grep -v '^\[' | tee -a "$made/said"
cp "$made/said" benches/results/priors_readers.txt
