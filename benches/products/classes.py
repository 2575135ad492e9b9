#!/usr/bin/env python3
"""Classes of simulated scenes: from the exact surface, and from the surface that images give.

    python3 benches/products/classes.py target/release/skysweep SCENE... [--tuned SCENE...] [--exact SCENE...]
        [--lidar DSM CLASSES] [--jax-run RUN]

A SCENE is a folder of `skysweep simulate`, with `--multispectral` for the rows with such images; its run is made in
SCENE/run when there is none. Cells that a façade goes
through (class 64) do not count. `--lidar` adds a measured surface with its class raster. Needs numpy and rasterio. Writes
benches/results/classes.json and classes.md.
"""
import argparse
import json
import pathlib
import subprocess
import tempfile

import numpy as np
import rasterio

RESULTS = pathlib.Path(__file__).resolve().parents[1] / "results"
VEGETATION, BUILDING, EDGE, UNLABELLED = 5, 6, 64, 65


def at_cells(path, grid):
    """The raster at the cell centres of another one; 0 outside."""
    with rasterio.open(path) as file:
        values, inverse = file.read(1), ~file.transform
        if file.transform.is_identity and values.shape == (grid.height, grid.width):
            return values
    rows, columns = np.mgrid[0:grid.height, 0:grid.width]
    x, y = grid.transform * (columns + 0.5, rows + 0.5)
    u, v = inverse * (x, y)
    u, v = np.floor(u).astype(int), np.floor(v).astype(int)
    inside = (u >= 0) & (v >= 0) & (u < values.shape[1]) & (v < values.shape[0])
    out = np.zeros((grid.height, grid.width), values.dtype)
    out[inside] = values[v[inside], u[inside]]
    return out


def iou(found, truth, counts):
    both, any_ = (found & truth & counts).sum(), ((found | truth) & counts).sum()
    return float(both / any_) if any_ else None


SHIFT_MAX = 8


def shift_of(surface, reference):
    """Whole cells (rows, columns) by which a surface must be moved to lie on the reference."""
    best = (np.inf, (0, 0))
    for dy in range(-SHIFT_MAX, SHIFT_MAX + 1):
        for dx in range(-SHIFT_MAX, SHIFT_MAX + 1):
            apart = (np.roll(surface, (dy, dx), (0, 1)) - reference)[SHIFT_MAX:-SHIFT_MAX, SHIFT_MAX:-SHIFT_MAX]
            apart = apart[np.isfinite(apart)]
            best = min(best, (float(np.median(np.abs(apart - np.median(apart)))), (dy, dx)))
    return best[1]


def heights(path, grid):
    """Heights at the cell centres of another raster; NaN for voids and outside."""
    with rasterio.open(path) as file:
        no_data = file.nodata
    values = at_cells(path, grid).astype(float)
    return np.where((values == 0) | (values == no_data), np.nan, values)


def measure(program, name, surface, truth_path, images=(), reference=None):
    """IoU of the classes as they lie and, for a run, moved by the shift of its heights onto `reference`."""
    with tempfile.TemporaryDirectory() as out:
        more = ["--multispectral", *map(str, images)] if images else []
        subprocess.run([program, "classes", surface, *more, "-o", out, "--overwrite", "--progress", "none", "-q"],
                       check=True, stdout=subprocess.DEVNULL)
        with rasterio.open(pathlib.Path(out) / "classes.tif") as file:
            found, truth = file.read(1), at_cells(truth_path, file)
            shift = (0, 0)
            if reference is not None:
                shift = shift_of(heights(pathlib.Path(surface) / "dsm/dsm.tif", file), heights(reference, file))
    row = {"surface": name, "multispectral": len(images), "shift_cells": list(shift)}
    for suffix, moved in (("", found), ("_registered", np.roll(found, shift, (0, 1)))):
        counts = (truth != 0) & (truth != EDGE) & (truth != UNLABELLED) & (moved != 0)
        for what, code in (("building", BUILDING), ("vegetation", VEGETATION)):
            row[what + suffix] = iou(moved == code, truth == code, counts)
    return row


TRIED = [
    "Crowns that the surface lacks, in scenes of the seeds 11 and 31 (town) and 11 (suburb), co-registered. Crowns there are",
    "4 m wide and cover 1 to 2 % of the cells; multispectral pixels are 2 m wide.",
    "",
    "- Height of more than two metres and green: 0.10 to 0.36.",
    "- Green, or green and darker than the surroundings in the panchromatic ortho: 0.16 to 0.25. Shadows of houses on lawns are",
    "  green and dark, too.",
    "- Green in the steepest image where the height is unsure: 0.31 to 0.37; with the panchromatic darkness 0.33 to 0.44.",
    "- Green in the mean of the images, looked at 3 to 4 m above the surface, where the height is unsure: 0.35 to 0.42; opened and",
    "  closed by half a metre 0.39 to 0.46, and then the darkness adds nothing. This is what the command does.",
    "- The least index of the images instead of the mean: 0.2 to 0.3. Leaning crowns miss each other at any one height.",
]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("scenes", type=pathlib.Path, nargs="*")
    parser.add_argument("--exact", type=pathlib.Path, nargs="*", default=[], help="scenes of which only the exact surface counts")
    parser.add_argument("--tuned", type=pathlib.Path, nargs="*", default=[],
                        help="scenes on which the constants of the multispectral images were chosen")
    parser.add_argument("--lidar", type=pathlib.Path, nargs=2, metavar=("DSM", "CLASSES"))
    parser.add_argument("--jax-run", type=pathlib.Path, help="run of images of the place of --lidar")
    given = parser.parse_args()
    program, rows = str(given.program.resolve()), []
    def measured(scene, exact_only, seen):
        truth, exact, images = scene / "truth/classes.tif", scene / "truth/dsm.tif", sorted(scene.glob("ms_?.tif"))
        sets = [()] + ([images] if images else [])
        found = [measure(program, f"{scene.name}, exact surface", str(exact), truth, given) for given in sets]
        if not exact_only:
            if not (scene / "run/report/report.json").exists():
                views = sorted(str(view) for view in scene.glob("view_?.tif"))
                subprocess.run([program, "dsm", *views, "-o", str(scene / "run"), "--overwrite", "--progress", "none", "-q"],
                               check=True, stdout=subprocess.DEVNULL)
            found += [measure(program, f"{scene.name}, surface from images", str(scene / "run"), truth, given, exact)
                      for given in sets]
        rows.extend({**row, "constants_chosen_on_it": seen} for row in found)

    for scene in given.tuned:
        measured(scene, False, True)
    for scene in given.scenes:
        measured(scene, False, False)
    for scene in given.exact:
        measured(scene, True, False)
    if given.lidar:
        rows.append(measure(program, "JAX_068, LiDAR surface", str(given.lidar[0]), given.lidar[1]))
    if given.jax_run:
        rows.append(measure(program, "JAX_068, surface from images", str(given.jax_run), given.lidar[1], (), given.lidar[0]))
    (RESULTS / "classes.json").write_text(json.dumps(rows, indent=1) + "\n")
    text = lambda value: "–" if value is None else f"{value:.3f}"
    lines = ["# Classes", "", "Written by `benches/products/classes.py`: intersection over union of buildings and of standing vegetation",
             "(class 5). *Co-registered*: the classes are moved by whole cells to where the heights of the run lie on the exact",
             "ones, because the pointing of all images together is off by up to a metre.", "",
             "| surface | multispectral images | constants chosen on it | building | vegetation | building, co-registered | "
             "vegetation, co-registered |", "|---|---|---|---|---|---|---|"]
    for row in rows:
        values = [text(row[key]) for key in ("building", "vegetation", "building_registered", "vegetation_registered")]
        seen = "yes" if row.get("constants_chosen_on_it") else "no"
        lines.append(f"| {row['surface']} | {row['multispectral']} | {seen} | {' | '.join(values)} |")
    lines += ["", "## What was tried", "", *TRIED]
    (RESULTS / "classes.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
