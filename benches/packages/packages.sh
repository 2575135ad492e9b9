#!/usr/bin/env bash
# Builds the command and the wheel that need no GDAL and PROJ in a clean clone, and tries them as a new user would.
#   benches/packages/packages.sh FOLDER [COMMIT]
# FOLDER must not exist; it keeps the clone, so that a second call for the same commit tries again what was built.
# Needs what `make static` and `make wheel` need, PyPI, and the right to call chroot. The third-party sources that Cargo has
# fetched are used again; nothing else is. Takes about an hour on 2 cores. Writes benches/results/packages.json and packages.md.
# Neither the build nor the tests need it.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
exec python3 "$here/packages.py" "${2:-HEAD}" "$1" "$here/../results"
