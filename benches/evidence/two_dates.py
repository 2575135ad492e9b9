"""Small places seen on two dates, by the simulator of ../shared/tools/scenes.py, which shares no code with skysweep.

    python benches/evidence/two_dates.py SEED FOLDER [--changes N]

The place is `random:SEED` of that simulator (`unchanged`), or one of its ordinary towns with buildings that come and go
(`--changes N`, half of them new, half of them lost). Each date has two or three images with their own geometry, sun, season
and pointing errors. Writes FOLDER/a and FOLDER/b with view_K.tif and scene.json, and truth_dsm.tif, truth_ground.tif,
truth_buildings.tif and, for changes, truth_change.tif (the number of the building that came or went) with changes.json.
Needs numpy, scipy, rasterio and pyproj.
"""
import argparse
import json
import pathlib
import sys

import numpy as np
import rasterio
from rasterio.transform import from_origin
from scipy import ndimage as ndi

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "shared/tools"))
import scenes  # noqa: E402

# Side of an image in pixels, its pixel, the cell of the simulator, and the ground around the images that shadows
# and oblique views need, metres.
SIDE, GSD_M, CELL_M, AROUND_M = 440, 0.5, 0.25, 150
# Share of the side whose truth is written.
CORE = 0.86
# Smallest building that may come or go: a detached house.
LEAST_M2 = 60


def place_of(seed, changes):
    """Parameters of the place; towns with changes have no towers, because these hide half of their neighbours."""
    place = scenes.random_scene(seed)
    place["size"] = SIDE
    if changes:
        draw = np.random.default_rng([seed, 1])
        place.update(block=float(draw.choice([20, 28, 36])), density=float(draw.uniform(.5, .8)), trees=float(draw.choice([8, 20])),
                     bh=(float(draw.uniform(3, 5)), float(draw.uniform(9, 22))), slope=0., relief=float(draw.uniform(1, 6)),
                     texture=float(draw.uniform(.6, 1.2)), noise=float(draw.uniform(.6, 1.5)))
    return place


def dates_of(seed):
    """Views, suns and pointing errors of both dates: two or three images each, that see the place from two sides."""
    draw = np.random.default_rng([seed, 2])
    dates = []
    for _ in range(2):
        count, first = int(draw.integers(2, 4)), draw.uniform(0, 360)
        views = [(float(draw.uniform(6, 20)), float((first + k * 360 / count + draw.uniform(-30, 30)) % 360)) for k in range(count)]
        sun = (float(draw.uniform(30, 62)), float(draw.uniform(130, 200)))
        dates.append({"views": views, "sun": sun, "point": draw.uniform(-3, 3, (count, 2)).tolist()})
    return dates


def shadow(z, cell, elevation, azimuth, _kept={}):
    """Cells in the sun, as the simulator's own function with heights of the nearest cell instead of between four, and kept for the
    images of a date: it takes two thirds of the time otherwise."""
    key = (z.ctypes.data, z.shape, elevation, azimuth)
    if key not in _kept:
        lit, top, k = np.ones_like(z, bool), z.max() - z.min(), 1
        while k * cell * np.tan(np.radians(elevation)) <= top and k < min(z.shape):
            rise = k * cell * np.tan(np.radians(elevation))
            # The cells of a step towards the sun.
            steps = [round(-np.cos(np.radians(azimuth)) * k), round(np.sin(np.radians(azimuth)) * k)]
            rows, columns = (slice(max(-d, 0), z.shape[0] - max(d, 0)) for d in steps)
            from_rows, from_columns = (slice(max(d, 0), z.shape[0] - max(-d, 0)) for d in steps)
            lit[rows, columns] &= z[from_rows, from_columns] <= z[rows, columns] + rise + .05
            k += 1 if k * cell < 40 else 2
        _kept.clear()
        _kept[key] = lit
    return _kept[key]


scenes.shadow = shadow


def without(z, albedo, ground, bare, numbers, absent):
    gone = np.isin(numbers, absent)
    return np.where(gone, ground, z).astype(np.float32), np.where(gone, bare, albedo).astype(np.float32)


def chosen(numbers, inner, count, seed):
    """Buildings that stand within the core, clear of others by two metres."""
    good = []
    for number, box in enumerate(ndi.find_objects(np.maximum(numbers, 0)), 1):
        if box is None:
            continue
        grown = tuple(slice(max(s.start - 8, 0), s.stop + 8) for s in box)
        own, near = numbers[grown] == number, numbers[grown]
        around = ndi.binary_dilation(own, iterations=8) & ~own
        if own.sum() * CELL_M**2 >= LEAST_M2 and inner[grown][own].all() and not (near[around] > 0).any():
            good.append(number)
    return np.random.default_rng([seed, 3]).permutation(good)[:count].tolist()


def make(seed, folder, changes):
    folder = pathlib.Path(folder)
    place = place_of(seed, changes)
    extent = SIDE * GSD_M + AROUND_M
    n = int(extent / CELL_M)
    z, albedo = scenes.build(place, np.random.default_rng(seed), n, CELL_M)
    numbers, ground = place["_bid"], place["_terr"].astype(np.float32)
    # The same terrain with nothing on it: the draws of the ground come before those of buildings.
    empty = dict(place, density=-1.0, trees=0)
    _, bare = scenes.build(empty, np.random.default_rng(seed), n, CELL_M)
    margin = int((extent - SIDE * GSD_M * CORE) / 2 / CELL_M) // 2 * 2
    core = (slice(margin, n - margin),) * 2
    inner = np.zeros(z.shape, bool)
    inner[margin + 20:n - margin - 20, margin + 20:n - margin - 20] = True
    picked = chosen(numbers, inner, changes, seed)
    added, removed = picked[::2], picked[1::2]
    east, north = scenes.T_utm.transform(scenes.LON0, scenes.LAT0)
    east, north = round(east - extent / 2), round(north + extent / 2)
    low, high = float(z.min()), float(z.max())
    kept = {}
    for name, absent, date in zip("ab", [added, removed], dates_of(seed)):
        out = folder / name
        out.mkdir(parents=True, exist_ok=True)
        rng = np.random.default_rng([seed, 4, ord(name)])
        surface, grey = without(z, albedo, ground, bare, numbers, absent)
        kept[name] = surface
        if place.get("seasons") or name == "b":
            grey = season(grey, numbers, rng)
        views = []
        for k, (view, point) in enumerate(zip(date["views"], date["point"]), 1):
            camera = scenes.Cam(*view, GSD_M, SIDE, SIDE, low - 20, high + 20, roll=rng.uniform(-8, 8))
            u, v = camera.project(scenes.LON0, scenes.LAT0, (low + high) / 2)
            camera.soff = (camera.soff[0] + SIDE / 2 - .5 - u, camera.soff[1] + SIDE / 2 - .5 - v)
            image = scenes.render(camera, surface, grey, CELL_M, east, north, date["sun"], rng, place)
            image = (image / image.max()) ** rng.uniform(.85, 1.2) * rng.uniform(.8, 1.2)
            counts = image * 2200
            counts = counts + rng.standard_normal(counts.shape) * (6 + np.sqrt(np.maximum(counts, 0)) * .25) * place.get("noise", 1.)
            with rasterio.open(out / f"view_{k}.tif", "w", driver="GTiff", width=SIDE, height=SIDE, count=1, dtype="uint16",
                               compress="deflate") as file:
                file.write(np.clip(np.rint(counts), 1, 4095).astype(np.uint16), 1)
                file.rpcs = camera.rpc(*point)
            views.append({"file": f"view_{k}.tif", "off_nadir": view[0], "azimuth": view[1], "sun": date["sun"],
                          "pointing_error_px": point})
        (out / "scene.json").write_text(json.dumps({"seed": seed, "z_range": [low, high], "views": views}, indent=1))
    halves = lambda grid: grid[core][: (n - 2 * margin) // 2 * 2, : (n - 2 * margin) // 2 * 2]
    side = halves(z).shape[0] // 2
    blocks = lambda grid: halves(grid).reshape(side, 2, side, 2)
    grid = from_origin(east + margin * CELL_M, north - margin * CELL_M, 2 * CELL_M, 2 * CELL_M)

    def put(name, data, kind):
        with rasterio.open(folder / name, "w", driver="GTiff", width=side, height=side, count=1, crs=scenes.EPSG, transform=grid,
                           dtype=kind, compress="deflate") as file:
            file.write(data.astype(kind), 1)
    put("truth_dsm.tif", blocks(kept["a"]).max((1, 3)), "float32")
    put("truth_ground.tif", blocks(ground).mean((1, 3)), "float32")
    standing = np.where(np.isin(numbers, added), 0, numbers)
    put("truth_buildings.tif", halves(standing)[::2, ::2], "int16")
    if changes:
        put("truth_change.tif", halves(np.where(np.isin(numbers, picked), numbers, 0))[::2, ::2], "int16")
        rows = []
        for number in picked:
            cells = numbers == number
            volume = float((kept["b"][cells] - kept["a"][cells]).sum() * CELL_M**2)
            rows.append({"number": int(number), "area_m2": float(cells.sum() * CELL_M**2), "volume_m3": volume})
        (folder / "changes.json").write_text(json.dumps(rows, indent=1))


def season(albedo, numbers, rng):
    """Other greys of ground, trees and roofs, and another fine texture on the ground, as `seasons` of the simulator."""
    changed = albedo.copy()
    changed[numbers == -1] *= rng.uniform(.6, 1.8)
    open_ground = numbers == 0
    fine = scenes.noise(rng, albedo.shape[0], [32, 8, 2], [1, 1, 1])
    changed[open_ground] = changed[open_ground] * rng.uniform(.8, 1.25) + .02 * fine[open_ground]
    gain = rng.uniform(.85, 1.2, numbers.max() + 2)
    return np.clip(np.where(numbers > 0, changed * gain[np.maximum(numbers, 0)], changed), .03, .95).astype(np.float32)


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("seed", type=int)
    arguments.add_argument("folder")
    arguments.add_argument("--changes", type=int, default=0)
    given = arguments.parse_args()
    make(given.seed, given.folder, given.changes)
