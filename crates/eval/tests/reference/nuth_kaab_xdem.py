#!/usr/bin/env python3
"""Writes nuth_kaab_xdem.txt: the shifts that xdem's NuthKaab finds between surfaces given by formulas.

Run beside this file: python nuth_kaab_xdem.py > nuth_kaab_xdem.txt   (pip install xdem; made with xdem 0.2.3)

The surfaces are formulas of the map position, which crates/eval/tests/alignment.rs repeats: hills, and the same hills displaced by the
planted shift with a smooth error on top. A line holds the planted shift, the amplitude of that error, and xdem's shift.
"""
import numpy as np
import rasterio
import xdem

CELL, COLUMNS, ROWS = 2.0, 240, 200
X0, Y0 = 500000.0, 4000000.0


def hills(x, y):
    return 300 + 25 * np.sin(x / 61) * np.cos(y / 47) + 9 * np.sin(x / 23 + y / 31) + 0.05 * x


def error(x, y, amplitude):
    return amplitude * np.sin(x / 17 + 1) * np.cos(y / 13)


def dem(values):
    transform = rasterio.transform.from_origin(X0, Y0, CELL, CELL)
    return xdem.DEM.from_array(values.astype("float32"), transform=transform, crs=32633, nodata=-9999)


rows, columns = np.mgrid[:ROWS, :COLUMNS]
x, y = (columns + 0.5) * CELL, -(rows + 0.5) * CELL
print("# Written by nuth_kaab_xdem.py; do not edit. Metres: planted dx dy dz, amplitude of the error, xdem's dx dy dz.")
for dx, dy, dz, amplitude in [(3.3, -2.7, 4.1, 0.0), (3.3, -2.7, 4.1, 0.8), (-1.2, 0.4, -7.0, 0.8)]:
    reference, test = hills(x, y), hills(x + dx, y + dy) - dz + error(x, y, amplitude)
    nk = xdem.coreg.NuthKaab(subsample=1, max_iterations=50, offset_threshold=0.0005)
    nk.fit(dem(reference), dem(test))
    found = nk.to_translations()
    print(dx, dy, dz, amplitude, *(f"{v:.4f}" for v in found))
