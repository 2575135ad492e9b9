#!/bin/sh
# Reference hillshade by gdaldem (GDAL 3.6.2): writes heights.asc (the input) and shade.asc beside itself.
# Needs gdal-bin and python3. The surface is a tilted, wavy plane with cells of 0.5 m.
set -eu
cd "$(dirname "$0")"
python3 - > heights.asc <<'PY'
import math
print("ncols 24\nnrows 18\nxllcorner 0\nyllcorner 0\ncellsize 0.5")
for r in range(18):
    print(" ".join(f"{0.2 * c - 0.1 * r + 2 * math.sin(c / 3) * math.cos(r / 4):.4f}" for c in range(24)))
PY
gdaldem hillshade -q -az 315 -alt 45 -z 1.5 heights.asc shade.tif
gdal_translate -q -of AAIGrid shade.tif shade.asc
rm -f shade.tif shade.prj shade.asc.aux.xml
