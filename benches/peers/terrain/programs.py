"""The other programs of the comparison, each on a raster of heights. See compare.py.

usage: programs.py NAME CELLS FILLED OUT

CELLS is the surface with its voids, for programs that take points; FILLED the same surface without voids, for programs that take rasters.
"""
import pathlib
import sys

import numpy as np
import rasterio
from scipy import ndimage
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1]))
import dtm  # noqa: E402

NODATA = -32768.0
# Wider than the widest object of the places; its default of 11 cells is narrower than a house.
WHITEBOX_WINDOW_M = 90.5
SETTINGS = {
    "whitebox-workflows": f"a window of {WHITEBOX_WINDOW_M} m, wider than any building here (its default of 11 cells is narrower than a house), default slope of 15°",
    "CSF": "defaults (cloth 1 m, rigidness 3, threshold 0.5 m, 500 rounds, slopes smoothed)",
    "bulldozer-dtm": "defaults (objects up to 16 m, slopes up to 20 %)",
    "dsm2dtm": "defaults (radius 40 m, slope from the surface)",
    "SMRF": "PDAL's formula and defaults, rebuilt in Python (cell 1 m, slope 0.15, window 18 m, threshold 0.5 m, scalar 1.25)",
}


def write(path, heights, profile):
    place = {key: profile[key] for key in ["crs", "transform", "width", "height"]}
    with rasterio.open(path, "w", driver="GTiff", dtype="float32", nodata=NODATA, count=1, **place) as file:
        file.write(np.where(np.isfinite(heights), heights, NODATA).astype("float32"), 1)


def interpolated(heights):
    """Voids filled between the cells around them, and from the nearest one beyond."""
    is_void = ~np.isfinite(heights)
    # Cells inside of what is known would only add triangles that no void lies in.
    known, voids = np.argwhere(~is_void & ndimage.binary_dilation(is_void, np.ones((3, 3)))), np.argwhere(is_void)
    out = heights.copy()
    if len(voids) and len(known) > 3:
        values = heights[tuple(known.T)]
        found = LinearNDInterpolator(known, values)(voids)
        beyond = np.isnan(found)
        if beyond.any():
            found[beyond] = NearestNDInterpolator(known, values)(voids[beyond])
        out[tuple(voids.T)] = found
    return out


def whitebox(_, filled, out):
    import whitebox_workflows
    tools = whitebox_workflows.WbEnvironment()
    cells = int(WHITEBOX_WINDOW_M / dtm.read(filled)[1]["transform"].a) // 2 * 2 + 1
    tools.write_raster(tools.remove_off_terrain_objects(tools.read_raster(str(filled)), filter_size=cells), str(out))


def csf(cells, _, out):
    import CSF
    heights, profile = dtm.read(cells)
    rows, columns = np.nonzero(np.isfinite(heights))
    cell = profile["transform"].a
    cloth = CSF.CSF()
    cloth.setPointCloud(np.column_stack([columns * cell, -rows * cell, heights[rows, columns]]))
    ground, rest = CSF.VecInt(), CSF.VecInt()
    cloth.do_filtering(ground, rest, False)
    kept = np.array(ground, dtype=int)
    left = np.full(heights.shape, np.nan)
    left[rows[kept], columns[kept]] = heights[rows[kept], columns[kept]]
    write(out, interpolated(left), profile)


def bulldozer(_, filled, out):
    dtm.bulldozer(filled, out)


def dsm2dtm(_, filled, out):
    import dsm2dtm as module
    module.generate_dtm_file(str(filled), str(out))


def lowest_around(surface, radius):
    """The lowest height within a disk, row by row of the disk."""
    size, out = surface.shape[0], np.full(surface.shape, np.inf)
    for row in range(-radius, radius + 1):
        half = int(np.sqrt(radius**2 - row**2))
        line = ndimage.minimum_filter1d(surface, 2 * half + 1, axis=1, mode="nearest")
        np.minimum(out, line[np.clip(np.arange(size) + row, 0, size - 1)], out=out)
    return out


def opened(surface, radius):
    return -lowest_around(-lowest_around(surface, radius), radius)


def progressive(surface, cell_m, slope, window_m):
    """Objects of a surface: what openings with growing windows take by more than the slope allows."""
    last, found = surface, np.zeros(surface.shape, bool)
    for radius in range(1, int(np.ceil(window_m / cell_m)) + 1):
        low = opened(last, radius)
        found |= last - low > slope * cell_m * radius
        last = low
    return found


def smrf(cells, _, out, slope=0.15, window_m=18.0, threshold_m=0.5, scalar=1.25):
    """The filter of Pingel et al. (2013) as PDAL's filters.smrf runs it on points, which are the cells here."""
    heights, profile = dtm.read(cells)
    side = max(1, round(1.0 / profile["transform"].a))
    cell_m = side * profile["transform"].a
    wide = [(0, -size % side) for size in heights.shape]
    blocks = np.pad(heights, wide, constant_values=np.nan)
    blocks = blocks.reshape(blocks.shape[0] // side, side, blocks.shape[1] // side, side)
    lowest = np.fmin.reduce(np.fmin.reduce(blocks, axis=3), axis=1)
    surface = interpolated(lowest)
    is_low = progressive(-surface, cell_m, 5.0, cell_m)
    surface = interpolated(np.where(is_low, np.nan, surface))
    is_object = progressive(surface, cell_m, slope, window_m)
    ground = interpolated(np.where(is_low | is_object, np.nan, lowest))
    steepness = np.hypot(*np.gradient(ground, cell_m))
    rows, columns = ((np.arange(size) + 0.5) / side - 0.5 for size in heights.shape)
    at = lambda raster: ndimage.map_coordinates(raster, np.meshgrid(rows, columns, indexing="ij"), order=1, mode="nearest")
    is_ground = np.abs(heights - at(ground)) <= threshold_m + scalar * at(steepness)
    write(out, interpolated(np.where(is_ground, heights, np.nan)), profile)


RUNS = {"whitebox-workflows": whitebox, "CSF": csf, "bulldozer-dtm": bulldozer, "dsm2dtm": dsm2dtm, "SMRF": smrf}

if __name__ == "__main__":
    RUNS[sys.argv[1]](*map(pathlib.Path, sys.argv[2:]))
