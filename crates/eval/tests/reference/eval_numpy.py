#!/usr/bin/env python3
"""Writes eval_numpy.txt: seeded pairs of height grids and their metrics, computed with NumPy alone.

Run beside this file: python eval_numpy.py > eval_numpy.txt   (NumPy >= 1.22)

Nothing here is shared with the crate. The rules that both follow:
- cell centres are integers; GDAL geotransform (x0, cell, y0, -cell), upper-left corner at (x0, y0);
- a reference cell gets a test height where the nearest test cell (floor(x + 0.5)) is valid: the bilinear mean over the
  valid ones among the four neighbours, weights scaled to one;
- error = test - reference; percentiles are numpy.percentile's linear ones; std is the population's.
"""
import numpy as np

THRESHOLDS = [0.5, 1.0, 2.5, 7.5]


def bilinear(grid, x, y):
    h, w = grid.shape
    padded = np.full((h + 4, w + 4), np.nan)
    padded[2:-2, 2:-2] = grid
    xi, yi = np.floor(x).astype(int), np.floor(y).astype(int)
    u, v = x - xi, y - yi

    def at(i, j):
        return padded[np.clip(j + 2, 0, h + 3), np.clip(i + 2, 0, w + 3)]

    total, weights = np.zeros_like(x), np.zeros_like(x)
    for i, wi in ((0, 1 - u), (1, u)):
        for j, wj in ((0, 1 - v), (1, v)):
            corner = at(xi + i, yi + j)
            ok = np.isfinite(corner)
            total += np.where(ok, corner, 0.0) * wi * wj
            weights += np.where(ok, wi * wj, 0.0)
    nearest = at(np.floor(x + 0.5).astype(int), np.floor(y + 0.5).astype(int))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(np.isfinite(nearest), total / weights, np.nan)


def metrics(error, cells):
    out = {"reference_cells": cells, "n": error.size, "valid_ratio": error.size / cells}
    a = np.abs(error)
    out |= {
        "mean": error.mean(), "median": np.median(error), "mae": a.mean(), "rmse": np.sqrt((error**2).mean()),
        "std": error.std(), "nmad": 1.4826 * np.median(np.abs(error - np.median(error))),
        "le68": np.percentile(a, 68), "le90": np.percentile(a, 90), "le95": np.percentile(a, 95),
        "min": error.min(), "max": error.max(),
    }
    out |= {f"completeness_{t:g}": (a < t).sum() / cells for t in THRESHOLDS}
    out |= {f"pag_{t:g}": (a < t).mean() for t in THRESHOLDS}
    return out


def text(grid):
    return "\n".join(" ".join("nan" if np.isnan(v) else f"{v:.3f}" for v in row) for row in grid)


def case(name, seed, size, test_size, reference_gt, test_gt, align, skip):
    rng = np.random.default_rng(seed)

    def surface(shape, gt):
        rows, columns = np.mgrid[: shape[1], : shape[0]]
        x, y = gt[0] + (columns + 0.5) * gt[1], gt[2] - (rows + 0.5) * gt[1]
        return 30 + 3 * np.sin(x / 4) + 2 * np.cos(y / 3) + np.where((x > 8) & (y < -4), 6.0, 0.0)

    def with_voids(grid, share):
        return np.where(rng.random(grid.shape) < share, np.nan, grid)

    reference = with_voids(surface(size, reference_gt), 0.05)
    test = surface(test_size, test_gt) + rng.normal(0.4, 0.3, test_size[::-1])
    test = with_voids(test + np.where(rng.random(test.shape) < 0.05, rng.normal(0, 10, test.shape), 0), 0.15)
    # The grids are stored with three decimals and read back as single precision: so are they used here.
    reference = np.array([[np.float32(f"{v:.3f}") for v in row] for row in reference]).astype(float)
    test = np.array([[np.float32(f"{v:.3f}") for v in row] for row in test]).astype(float)
    classes = rng.choice([2, 6, 9], size[::-1])

    rows, columns = np.mgrid[: size[1], : size[0]]
    x, y = reference_gt[0] + (columns + 0.5) * reference_gt[1], reference_gt[2] - (rows + 0.5) * reference_gt[1]
    sampled = bilinear(test, (x - test_gt[0]) / test_gt[1] - 0.5, (test_gt[2] - y) / test_gt[1] - 0.5)
    valid = np.isfinite(reference) & ~np.isin(classes, skip)
    error = sampled - reference
    dz = -np.median(error[valid & np.isfinite(error)]) if align == "z" else 0.0
    error = error + dz
    print(f"case {name}\nalign {align}\nskip {' '.join(map(str, skip))}\ndz {dz:.12g}")
    for label, grid, gt in (("reference", reference, reference_gt), ("test", test, test_gt)):
        print(f"{label} {grid.shape[1]} {grid.shape[0]} {gt[0]} {gt[1]} {gt[2]}\n{text(grid)}")
    print(f"classes\n" + "\n".join(" ".join(map(str, row)) for row in classes))
    sets = [("all", valid)] + [(str(c), valid & (classes == c)) for c in (2, 6, 9) if c not in skip]
    for label, cells in sets:
        values = metrics(error[cells & np.isfinite(error)], int(cells.sum()))
        print(f"metrics {label} " + " ".join(f"{k}={v:.12g}" for k, v in values.items()))
    print("end")


print("# Written by eval_numpy.py; do not edit. Heights in metres, grids as: columns rows x0 cell y0.")
case("same_grid_none", 1, (24, 18), (24, 18), (0.0, 0.5, 0.0), (0.0, 0.5, 0.0), "none", [])
case("other_grid_z", 2, (22, 20), (34, 30), (0.0, 0.5, 0.0), (1.37, 0.41, -0.83), "z", [])
case("coarse_test_skip", 3, (30, 16), (13, 12), (0.27, 0.5, 0.13), (-1.0, 1.31, 1.0), "z", [9])
case("larger_test_skip_two", 4, (16, 14), (60, 50), (3.01, 0.5, -3.02), (0.0, 0.31, 0.0), "none", [9, 6])
