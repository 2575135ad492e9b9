"""Change between surfaces made from two or three images each, by a simulator that shares no code with skysweep.

    python benches/evidence/change.py BINARY WORK [--unchanged SEED ...] [--towns SEED ...] [--out benches/results]

Twenty places that did not change (other geometry, sun, season and pointing errors on the second date), and five towns with
eight buildings that come or go. The seeds were chosen before any of them was looked at; the method was made on 8001 to
8006, 8008 and 8051 to 8054. WORK keeps the images and the surfaces. Writes change.json and change.md. Needs numpy, scipy, rasterio
and pyproj.
"""
import argparse
import json
import pathlib
import subprocess

import numpy as np
import rasterio
from scipy import ndimage as ndi

import two_dates

UNCHANGED, TOWNS, CHANGES = list(range(8101, 8121)), list(range(8201, 8206)), 8
# The surfaces lie where the images point, up to this far from the truth.
POINTING_M = 3.0
# A region is right if this share of it changed.
RIGHT_SHARE = 0.5


def band(path):
    with rasterio.open(path) as file:
        return file.read(1), file.transform, file.res[0]


def compared(binary, work, seed, changes):
    folder = work / str(seed)
    if not (folder / "truth_buildings.tif").exists():
        two_dates.make(seed, folder, changes)
    for date in "ab":
        if not (folder / date / "run/report/report.json").exists():
            images = sorted((folder / date).glob("view_*.tif"))
            subprocess.run([binary, "dsm", *images, "-o", folder / date / "run", "--overwrite", "--progress", "none", "-q"],
                           stderr=subprocess.DEVNULL)
    out = folder / "diff"
    done = subprocess.run([binary, "diff", folder / "a/run", folder / "b/run", "-o", out, "--overwrite", "--progress", "none", "--json"],
                          capture_output=True, text=True)
    if done.returncode == 2:
        return folder, None, done.stderr.strip().splitlines()[0] if done.stderr.strip() else "exit 2"
    return folder, json.loads((out / "diff.json").read_text()), None


def summary(region):
    kept = ["number", "area_m2", "filled_m2", "mean_m", "mean_sigma_m", "volume_m3", "p_value", "centre"]
    return {name: region[name] for name in kept}


def unchanged(binary, work, seed):
    _, report, refused = compared(binary, work, seed, 0)
    if report is None:
        return {"seed": seed, "refused": refused, "invented": []}
    return {"seed": seed, "invented": [summary(r) for r in report["regions"]], "tested": report["tested"],
            "sigma_factor": report["sigma_factor"], "observed_cells": report["observed_cells"], "shift": report["shift"]}


def town(binary, work, seed):
    folder, report, refused = compared(binary, work, seed, CHANGES)
    wanted = json.loads((folder / "changes.json").read_text())
    if report is None:
        return {"seed": seed, "refused": refused, "changes": [dict(w, measured_m3=0.0, regions=0) for w in wanted], "invented": []}
    labels, grid, cell = band(folder / "diff/regions.tif")
    truth, exact, _ = band(folder / "truth_change.tif")
    rows, columns = np.mgrid[0:labels.shape[0], 0:labels.shape[1]]
    u, v = (np.floor(a).astype(int) for a in ~exact * (grid * (columns + .5, rows + .5)))
    inside = (u >= 0) & (v >= 0) & (u < truth.shape[1]) & (v < truth.shape[0])
    on_grid = np.zeros(labels.shape, int)
    on_grid[inside] = truth[v[inside], u[inside]]
    right, taken = set(), []
    near = ndi.binary_dilation(on_grid > 0, iterations=int(POINTING_M / cell))
    for change in wanted:
        over = ndi.binary_dilation(on_grid == change["number"], iterations=int(1.0 / cell))
        hits = [r for r in report["regions"] if (over & (labels == r["number"])).sum() * cell**2 > 5 and r["mean_m"] * change["volume_m3"] > 0]
        right |= {r["number"] for r in hits if near[labels == r["number"]].mean() >= RIGHT_SHARE}
        measured = sum(r["volume_m3"] for r in hits)
        taken.append(dict(change, regions=len(hits), measured_m3=measured, error=measured / change["volume_m3"] - 1,
                          filled_m2=sum(r["filled_m2"] for r in hits), sigma_m3=float(np.sqrt(sum(r["volume_sigma_m3"]**2 for r in hits)))))
    return {"seed": seed, "changes": taken, "invented": [summary(r) for r in report["regions"] if r["number"] not in right],
            "sigma_factor": report["sigma_factor"]}


def written(out, quiet, towns):
    errors = np.abs([c["error"] for t in towns for c in t["changes"] if c["regions"]])
    count = sum(len(t["changes"]) for t in towns)
    bad = [q for q in quiet if q["invented"]]
    (out / "change.json").write_text(json.dumps({"unchanged": quiet, "towns": towns}, indent=1) + "\n")
    lines = ["# Change on places of another simulator", "",
             "Written by `benches/evidence/change.py`: surfaces of two or three images each; geometry, sun, season and pointing",
             "errors differ between the dates.", "",
             f"- Unchanged pairs: {len(quiet)}; with an invented region: {len(bad)}; invented regions: {sum(len(q['invented']) for q in bad)}."]
    refused = [str(q["seed"]) for q in [*quiet, *towns] if q.get("refused")]
    if refused:
        lines.append(f"- Refused, because the surfaces have too little in common: {', '.join(refused)}.")
    if towns:
        lines.append(f"- Changes: {count}; found: {errors.size}; regions invented beside them: {sum(len(t['invented']) for t in towns)}.")
    if errors.size:
        lines.append(f"- Error of the volumes of those found: median {100 * np.median(errors):.1f} %, nine of ten within "
                     f"{100 * np.percentile(errors, 90):.1f} %, within 10 %: {int((errors <= .1).sum())}, largest {100 * errors.max():.1f} %.")
    lines += ["", "| unchanged place | regions invented (area m², mean m) |", "|---|---|"]
    lines += [f"| {q['seed']} | {', '.join('{:.0f}, {:+.1f}'.format(r['area_m2'], r['mean_m']) for r in q['invented']) or '–'} |" for q in quiet]
    lines += ["", "| town | found | invented | error of each volume, % (area, m²) |", "|---|---|---|---|"]
    for t in towns:
        each = ", ".join(f"{100 * c['error']:+.1f} ({c['area_m2']:.0f})" if c["regions"] else f"not found ({c['area_m2']:.0f})" for c in t["changes"])
        lines.append(f"| {t['seed']} | {sum(c['regions'] > 0 for c in t['changes'])} of {len(t['changes'])} | {len(t['invented'])} | {each} |")
    (out / "change.md").write_text("\n".join(lines) + "\n")
    return lines


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("binary")
    arguments.add_argument("work", type=pathlib.Path)
    arguments.add_argument("--unchanged", type=int, nargs="*", default=UNCHANGED)
    arguments.add_argument("--towns", type=int, nargs="*", default=TOWNS)
    arguments.add_argument("--out", type=pathlib.Path, default=pathlib.Path("benches/results"))
    given = arguments.parse_args()
    quiet = [unchanged(given.binary, given.work, seed) for seed in given.unchanged]
    print("\n".join(written(given.out, quiet, [town(given.binary, given.work, seed) for seed in given.towns])))


if __name__ == "__main__":
    main()
