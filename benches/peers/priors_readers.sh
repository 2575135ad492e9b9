#!/usr/bin/env bash
# Whether other people's readers load what `skysweep priors` writes; benches/results/priors_readers.txt has what they said.
#   benches/peers/priors_readers.sh [SKYSWEEP]
# The sample town becomes a dataset for its flight, and pycolmap, Open3D, trimesh and NumPy read it (`check_priors.py`).
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
