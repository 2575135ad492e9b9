#!/usr/bin/env bash
# Installs CARS (CNES, from PyPI) into target/peers/cars and runs it on scenes of `make bench`, which then shows its results beside
# skysweep's. Not needed by build or tests; takes minutes per scene.
#
# usage: benches/peers/cars/run.sh [SCENE…]     default: town high-rise jax_068:2-3 jax_068:2-4
#   a preset of `skysweep simulate`, or jax_068:VIEW-VIEW… from ../shared/data/stereo
set -euo pipefail
cd "$(dirname "$0")/../../.."

VERSION=1.3.0
VENV=target/peers/cars
if [ ! -x "$VENV/bin/cars" ]; then
  python3 -m venv "$VENV"
  "$VENV/bin/pip" install --quiet "cars==$VERSION"
fi
cargo build --quiet --release --bin skysweep
exec "$VENV/bin/python" benches/peers/cars/run.py "${@:-}"
