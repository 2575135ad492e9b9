#!/usr/bin/env python3
"""Classes of simulated scenes: from the exact surface, and from the surface that images give.

    python3 benches/products/classes.py target/release/skysweep SCENE... [--exact SCENE...] [--lidar DSM CLASSES]

A SCENE is a folder of `skysweep simulate`; its run is made in SCENE/run when there is none. Cells that a façade goes
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
VEGETATION, BUILDING, EDGE = 5, 6, 64


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


def measure(program, name, surface, truth_path):
    with tempfile.TemporaryDirectory() as out:
        subprocess.run([program, "classes", surface, "-o", out, "--overwrite", "--progress", "none", "-q"], check=True,
                       stdout=subprocess.DEVNULL)
        with rasterio.open(pathlib.Path(out) / "classes.tif") as file:
            found, truth = file.read(1), at_cells(truth_path, file)
    counts = (truth != 0) & (truth != EDGE) & (found != 0)
    return {"surface": name, "building": iou(found == BUILDING, truth == BUILDING, counts),
            "vegetation": iou(found == VEGETATION, truth == VEGETATION, counts)}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("scenes", type=pathlib.Path, nargs="*")
    parser.add_argument("--exact", type=pathlib.Path, nargs="*", default=[], help="scenes of which only the exact surface counts")
    parser.add_argument("--lidar", type=pathlib.Path, nargs=2)
    given = parser.parse_args()
    program, rows = str(given.program.resolve()), []
    for scene in given.scenes:
        truth = scene / "truth/classes.tif"
        rows.append(measure(program, f"{scene.name}, exact surface", str(scene / "truth/dsm.tif"), truth))
        if not (scene / "run/report/report.json").exists():
            views = sorted(str(view) for view in scene.glob("view_?.tif"))
            subprocess.run([program, "dsm", *views, "-o", str(scene / "run"), "--overwrite", "--progress", "none", "-q"],
                           check=True, stdout=subprocess.DEVNULL)
        rows.append(measure(program, f"{scene.name}, surface from images", str(scene / "run"), truth))
    for scene in given.exact:
        rows.append(measure(program, f"{scene.name}, exact surface", str(scene / "truth/dsm.tif"), scene / "truth/classes.tif"))
    if given.lidar:
        rows.append(measure(program, "JAX_068, LiDAR surface", str(given.lidar[0]), given.lidar[1]))
    (RESULTS / "classes.json").write_text(json.dumps(rows, indent=1) + "\n")
    text = lambda value: "–" if value is None else f"{value:.3f}"
    lines = ["# Classes", "", "Written by `benches/products/classes.py`: intersection over union.", "",
             "| surface | building | vegetation |", "|---|---|---|"]
    lines += [f"| {row['surface']} | {text(row['building'])} | {text(row['vegetation'])} |" for row in rows]
    (RESULTS / "classes.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
