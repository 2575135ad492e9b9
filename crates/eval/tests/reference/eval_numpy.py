#!/usr/bin/env python3
"""Writes eval_numpy.txt: seeded pairs of height grids and their metrics, computed with NumPy alone.

Run beside this file: python eval_numpy.py > eval_numpy.txt   (NumPy >= 1.22)

Nothing here is shared with the crate. The rules that both follow:
- cell centres are integers; GDAL geotransform (x0, cell, y0, -cell), upper-left corner at (x0, y0);
- a reference cell gets a test height where the nearest test cell (floor(x + 0.5)) is valid: the bilinear mean over the
  valid ones among the four neighbours, weights scaled to one;
- error = test - reference; percentiles are numpy.percentile's linear ones; std is the population's;
- an outlier is farther than 3 NMAD from the median;
- slope: Horn's 3 x 3 derivative of the reference, none beside a void; bins hold their lower bound;
- a jump is between neighbours that differ by more than max(2 m, 2 cells); the edge zone reaches max(1 m, 2 cells) less half a cell
  from the centres of the cells at a jump;
- what stands is more than 2 m above the terrain; shared volume is the lower of both heights where both stand.
"""
import numpy as np

THRESHOLDS = [0.5, 1.0, 2.5, 7.5]
SLOPES = [0, 5, 10, 20, 30, 45, 60, 90]


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
    kept = error[np.abs(error - out["median"]) <= 3 * out["nmad"]]
    out |= {
        "outliers": error.size - kept.size, "robust_mean": kept.mean(), "robust_mae": np.abs(kept).mean(),
        "robust_rmse": np.sqrt((kept**2).mean()), "robust_std": kept.std(),
    }
    out |= {f"completeness_{t:g}": (a < t).sum() / cells for t in THRESHOLDS}
    out |= {f"pag_{t:g}": (a < t).mean() for t in THRESHOLDS}
    return out


def slope_deg(z, cell):
    p = np.pad(z, 1, constant_values=np.nan)
    rows, columns = z.shape
    at = lambda j, i: p[1 + j : 1 + j + rows, 1 + i : 1 + i + columns]
    x = (at(-1, 1) + 2 * at(0, 1) + at(1, 1) - at(-1, -1) - 2 * at(0, -1) - at(1, -1)) / (8 * cell)
    y = (at(1, -1) + 2 * at(1, 0) + at(1, 1) - at(-1, -1) - 2 * at(-1, 0) - at(-1, 1)) / (8 * cell)
    return np.degrees(np.arctan(np.hypot(x, y))) + 0 * z


def edge_zone(z, cell):
    jump, reach = max(2.0, 2 * cell), max(1.0, 2 * cell) - cell / 2
    at = np.zeros(z.shape, bool)
    with np.errstate(invalid="ignore"):
        right, down = np.abs(np.diff(z, axis=1)) > jump, np.abs(np.diff(z, axis=0)) > jump
    at[:, :-1] |= right
    at[:, 1:] |= right
    at[:-1] |= down
    at[1:] |= down
    rows, columns = np.mgrid[: z.shape[0], : z.shape[1]]
    zone = np.zeros(z.shape, bool)
    for j, i in zip(*np.nonzero(at)):
        zone |= np.hypot(rows - j, columns - i) * cell <= reach + 1e-9
    return zone


def overlap(reference, test):
    return {"reference": reference.sum(), "test": test.sum(), "shared": np.minimum(reference, test).sum()}


def standing(reference, test, terrain, valid, cell):
    above = lambda z: np.where(np.nan_to_num(z - terrain, nan=-1.0) > 2.0, z - terrain, 0.0)[valid] * cell**2
    a, b = above(reference), above(test)
    return overlap((a > 0) * cell**2, (b > 0) * cell**2), overlap(a, b)


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
    terrain = np.full(size[::-1], 29.0)

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
    slopes, zone = slope_deg(reference, reference_gt[1]), edge_zone(reference, reference_gt[1])
    for low, high in zip(SLOPES, SLOPES[1:]):
        sets.append((f"slope_{low}", valid & (slopes >= low) & (slopes < high)))
    sets += [("edge", valid & zone), ("rest", valid & ~zone)]
    for label, cells in sets:
        if (cells & np.isfinite(error)).any():
            values = metrics(error[cells & np.isfinite(error)], int(cells.sum()))
            print(f"metrics {label} " + " ".join(f"{k}={v:.12g}" for k, v in values.items()))
    for label, values in zip(("footprint", "volume"), standing(reference, sampled + dz, terrain, valid, reference_gt[1])):
        print(f"metrics {label} " + " ".join(f"{k}={v:.12g}" for k, v in values.items()))
    print("end")


print("# Written by eval_numpy.py; do not edit. Heights in metres, grids as: columns rows x0 cell y0.")
case("same_grid_none", 1, (24, 18), (24, 18), (0.0, 0.5, 0.0), (0.0, 0.5, 0.0), "none", [])
case("other_grid_z", 2, (22, 20), (34, 30), (0.0, 0.5, 0.0), (1.37, 0.41, -0.83), "z", [])
case("coarse_test_skip", 3, (30, 16), (13, 12), (0.27, 0.5, 0.13), (-1.0, 1.31, 1.0), "z", [9])
case("larger_test_skip_two", 4, (16, 14), (60, 50), (3.01, 0.5, -3.02), (0.0, 0.31, 0.0), "none", [9, 6])
