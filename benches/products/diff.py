#!/usr/bin/env python3
"""Change between two dates of simulated towns, through the whole chain.

For each seed, `skysweep simulate` makes one town on two dates: three buildings stand only on the second, two only on the
first; light, vehicles, pointing errors and noise differ. `skysweep dsm` makes a surface of each, `skysweep diff` compares
them. What it finds is held against the exact surfaces.

    python3 benches/products/diff.py target/release/skysweep [--seeds 1 2 3 21 22 23] [--work DIR]

Needs numpy, rasterio and scipy. Writes benches/results/diff.json and diff.md.
"""
import argparse
import json
import pathlib
import random
import subprocess
import tempfile

import numpy as np
import rasterio
from scipy import ndimage

RESULTS = pathlib.Path(__file__).resolve().parents[1] / "results"
ADDED, REMOVED = 3, 2
# A region is right if this share of its area changed.
RIGHT_SHARE = 0.5
CHANGED_M = 1.0
# Error of a volume that counts as right, and the smallest ground plan of a large building.
RIGHT_VOLUME = 0.05
LARGE_M2 = 300


def band(path):
    with rasterio.open(path) as file:
        data = file.read(1).astype(float)
        return np.where(data == (file.nodata if file.nodata is not None else np.inf), np.nan, data)


def simulate(program, folder, seed, gsd, absent, campaign):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "in.toml").write_text(
        f"seed = {seed}\nsize_m = 320.0\ngsd_m = {gsd}\nabsent_buildings = {absent}\n"
        f"[acquisition]\ncampaign = {campaign}\n")
    run(program, "simulate", folder / "in.toml", "-o", folder, "--overwrite", "--progress", "none", "-q")


def run(*words):
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL)


def chosen(program, work, seed):
    """Numbers of buildings of ordinary size that stand clear of the border."""
    simulate(program, work / "all", seed, 2.0, [], 0)
    numbers = band(work / "all/truth/buildings.tif")
    inner = np.zeros(numbers.shape, bool)
    inner[20:-20, 20:-20] = True
    good = [int(n) for n in np.unique(numbers[numbers > 0])
            if (numbers == n).sum() * 4 >= 60 and inner[numbers == n].all()]
    return random.Random(seed).sample(good, ADDED + REMOVED)


def measure(program, work, seed):
    picked = chosen(program, work, seed)
    added, removed = picked[:ADDED], picked[ADDED:]
    for name, absent, campaign in [("a", added, 0), ("b", removed, 1)]:
        if not (work / name / "run/report/report.json").exists():
            simulate(program, work / name, seed, 0.5, absent, campaign)
            run(program, "dsm", *sorted((work / name).glob("view_?.tif")), "-o", work / name / "run", "--overwrite",
                "--progress", "none", "-q")
    run(program, "diff", work / "a/run", work / "b/run", "-o", work / "diff", "--overwrite", "--progress", "none", "-q")
    report = json.loads((work / "diff/diff.json").read_text())
    with rasterio.open(work / "diff/regions.tif") as found, rasterio.open(work / "a/truth/dsm.tif") as exact:
        labels = found.read(1)
        grid, cell = found.transform, found.res[0]
        truth = band(work / "b/truth/dsm.tif") - band(work / "a/truth/dsm.tif")
        # The cell of the truth under each cell of the run.
        rows, columns = np.mgrid[0:labels.shape[0], 0:labels.shape[1]]
        inverse = ~exact.transform
        x, y = grid * (columns + 0.5, rows + 0.5)
        u, v = inverse * (x, y)
        u, v = np.floor(u).astype(int), np.floor(v).astype(int)
        inside = (u >= 0) & (v >= 0) & (u < truth.shape[1]) & (v < truth.shape[0])
        on_grid = np.full(labels.shape, np.nan)
        on_grid[inside] = truth[v[inside], u[inside]]
    changed = np.abs(np.nan_to_num(on_grid)) > CHANGED_M
    regions, wanted = report["regions"], []
    objects, count = ndimage.label(np.abs(np.nan_to_num(truth)) > CHANGED_M, structure=np.ones((3, 3)))
    for number in range(1, count + 1):
        cells = objects == number
        if cells.sum() * exact.res[0] ** 2 < 10:
            continue
        volume = float(truth[cells].sum() * exact.res[0] ** 2)
        over = np.zeros(labels.shape, bool)
        over[inside] = cells[v[inside], u[inside]]
        hits = [r for r in regions if (over & (labels == r["number"])).any() and r["volume_m3"] * volume > 0]
        measured = sum(r["volume_m3"] for r in hits)
        wanted.append({"area_m2": float(cells.sum() * exact.res[0] ** 2), "volume_m3": volume, "regions": len(hits),
                       "measured_m3": measured, "error": measured / volume - 1,
                       "sigma_m3": float(np.sqrt(sum(r["volume_sigma_m3"] ** 2 for r in hits)))})
    invented = [r["number"] for r in regions if changed[labels == r["number"]].mean() < RIGHT_SHARE]
    return {"seed": seed, "cell_m": cell, "added": added, "removed": removed, "changes": wanted,
            "found": sum(w["regions"] > 0 for w in wanted), "invented": len(invented), "regions": len(regions),
            "invented_regions": [r for r in regions if r["number"] in invented],
            "gain_truth_m3": float(np.nansum(np.clip(truth, 0, None)) * exact.res[0] ** 2),
            "loss_truth_m3": float(-np.nansum(np.clip(truth, None, 0)) * exact.res[0] ** 2),
            "gain_m3": report["total"]["gain_m3"], "loss_m3": report["total"]["loss_m3"],
            "sigma_factor": report["sigma_factor"], "shift": report["shift"]}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 21, 22, 23])
    parser.add_argument("--work", type=pathlib.Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        work = given.work or pathlib.Path(temporary)
        rows = [measure(given.program.resolve(), work / str(seed), seed) for seed in given.seeds]
    (RESULTS / "diff.json").write_text(json.dumps(rows, indent=1) + "\n")
    errors = np.abs([w["error"] for row in rows for w in row["changes"]])
    large = np.array([w["area_m2"] >= LARGE_M2 for row in rows for w in row["changes"]])
    total = sum(row["gain_m3"] + row["loss_m3"] for row in rows)
    total_truth = sum(row["gain_truth_m3"] + row["loss_truth_m3"] for row in rows)
    within = lambda of: f"{int((of <= RIGHT_VOLUME).sum())} of {of.size}"
    lines = ["# Change between two dates of simulated towns", "",
             "Written by `benches/products/diff.py`. Each town gains three buildings and loses two between two acquisitions. The",
             "volumes of all regions are held against the exact surfaces. The overreach of walls was fitted to other towns.",
             "Vehicles are no part of the exact surfaces: a row of parked cars that came or went counts as invented.", "",
             f"- Volumes within {100 * RIGHT_VOLUME:.0f} %: {within(errors)}; of buildings of at least {LARGE_M2} m²: "
             f"{within(errors[large])}; of smaller ones: {within(errors[~large])}.",
             f"- Median error of a volume: {100 * np.median(errors):.1f} %; largest: {100 * errors.max():.1f} %.",
             f"- Error of the sum of all volumes: {100 * (total / total_truth - 1):+.1f} %.", "",
             "| seed | changes | found | invented | gain, m³ (truth) | loss, m³ (truth) | error of each volume, % (area, m²) |",
             "|---|---|---|---|---|---|---|"]
    for row in rows:
        each = ", ".join(f"{100 * w['error']:+.1f} ({w['area_m2']:.0f})" for w in row["changes"])
        lines.append(f"| {row['seed']} | {len(row['changes'])} | {row['found']} | {row['invented']} "
                     f"| {row['gain_m3']:.0f} ({row['gain_truth_m3']:.0f}) | {row['loss_m3']:.0f} ({row['loss_truth_m3']:.0f}) "
                     f"| {each} |")
        print(lines[-1])
    (RESULTS / "diff.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
