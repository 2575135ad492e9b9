#!/usr/bin/env bash
# Runs the algorithms in QGIS without a window: once through qgis_process, and once as a project that loads the layers.
# Needs QGIS 3.22 or newer (Debian: apt-get install --no-install-recommends qgis). Usage: run_qgis.sh COMMAND
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
command=$(realpath "$1")
# Debian's wrapper of qgis_process adds an option that its program does not know.
process=$(command -v qgis_process.bin || command -v qgis_process || true)
if [[ -z "$process" ]]; then
  echo "error: qgis_process not found: install QGIS (Debian: apt-get install --no-install-recommends qgis)" >&2
  exit 2
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export QT_QPA_PLATFORM=offscreen XDG_RUNTIME_DIR="$work" HOME="$work" QGIS_CUSTOM_CONFIG_PATH="$work/profile"
export QGIS_PLUGINPATH="$root/qgis" SKYSWEEP_COMMAND="$command"
town="$root/data-samples/town"

"$process" plugins enable skysweep > /dev/null
"$process" list 2> /dev/null | grep -A20 '^skysweep'
"$process" help skysweep:dsm 2> /dev/null | grep -q IMAGES
"$process" run skysweep:dsm -- IMAGES="$town/view_1.tif" IMAGES="$town/view_2.tif" IMAGES="$town/view_3.tif" GSD=1 PRESET=fast \
  OUTPUT="$work/run" > /dev/null 2>&1
"$command" dsm "$town"/view_[123].tif --gsd 1 --preset fast -o "$work/plain" --quiet > /dev/null
cmp "$work/run/dsm/dsm.tif" "$work/plain/dsm/dsm.tif"
echo "qgis_process makes the bytes of the command"

# QGIS's own Python, which is the system's.
/usr/bin/python3 "$root/qgis/tests/in_qgis.py" "$work/run" "$work/loaded" 2> /dev/null
