"""Buildings and trees in surfaces from images, by a simulator that shares no code with skysweep.

    python benches/evidence/classes.py BINARY WORK [--before BINARY] [--seeds SEED ...] [--shared ../shared] [--out benches/results]

Ten places as `random:SEED` of the simulator draws them, with their own views, suns, seasons and pointing errors: BINARY makes the surface
and its classes. `--before` is an older build, whose classes of the same surfaces are judged beside. The images point up to two metres
wrong together, so that the truth is compared where the heights of the surface lie on the exact ones (a shift in x and y by the least NMAD).
Cells without a height do not count.

- IoU: buildings found against buildings of the truth, over all cells, and without those within a metre of a height jump of two metres.
- Trees as buildings: share of the cells of trees that are classed as buildings.
- La Réunion: the pair of `s2p_pair` shows steep slopes without any building.

The seeds were stated before any of them was looked at; the method was made on 8451 to 8456. WORK keeps images and surfaces. Writes
classes_outside.json and classes_outside.md. Needs numpy, scipy, rasterio and pyproj.
"""
import argparse
import json
import pathlib
import subprocess

import numpy as np
import rasterio

import two_dates
from places import Reference, read
from two_dates import scenes

SEEDS = list(range(8401, 8411))
TREE, VEGETATION, BUILDING, GROUND, UNKNOWN = -1, 5, 6, 2, 0
BESIDE_JUMP = 1
MEDIAN_IOU, WORST_IOU, TREES = 0.85, 0.7, 0.10


def make(seed, folder):
    """The place, with the shadows of two_dates.py, which take a third of the time of the simulator's own."""
    if not (folder / "scene.json").exists():
        folder.mkdir(parents=True, exist_ok=True)
        scenes.main(f"random:{seed}", str(folder))


def surface(binary, images, out):
    if not (out / "report/report.json").exists():
        subprocess.run([binary, "dsm", *images, "-o", out, "--overwrite", "--progress", "none", "-q"], stderr=subprocess.DEVNULL)
    return (out / "report/report.json").exists()


def classes(binary, run, out):
    """The class raster with its place, or the words of a refusal."""
    done = subprocess.run([binary, "classes", run, "-o", out, "--overwrite", "--progress", "none", "-q"], capture_output=True, text=True)
    if done.returncode == 2:
        return None, (done.stderr.strip().splitlines() or ["no words"])[0]
    with rasterio.open(out / "classes.tif") as file:
        return (file.read(1).astype(float), file.transform, file.crs), done.stderr.strip() or None


def share(part, whole):
    return float(part.sum() / whole.sum()) if whole.any() else None


def iou(found, truth, counts):
    return share(found & truth & counts, (found | truth) & counts)


def scores(found, truth, jumps, heights):
    known = np.isfinite(heights)
    found = np.where(np.isfinite(found), found, UNKNOWN)
    building, tree = truth > 0, (truth == TREE) & known
    return {"iou": iou(found == BUILDING, building, known), "iou_off_walls": iou(found == BUILDING, building, known & (jumps != BESIDE_JUMP)),
            "trees_as_buildings": share(tree & (found == BUILDING), tree),
            "standing_trees_as_buildings": share(tree & (found == BUILDING), tree & ((found == BUILDING) | (found == VEGETATION))),
            "ground_as_buildings": share(known & (truth == 0) & (found == BUILDING), known & (truth == 0)),
            "buildings_as_ground": share(known & building & (found == GROUND), known & building),
            "buildings_as_vegetation": share(known & building & (found == VEGETATION), known & building),
            "building_share": share(building & known, known), "tree_share": share(tree, known),
            "known_share": float(known.mean())}


def judged(binaries, work, seed):
    folder = work / str(seed)
    make(seed, folder)
    row = {"seed": seed, "views": len(json.loads((folder / "scene.json").read_text())["views"])}
    if not surface(binaries["now"], sorted(folder.glob("view_*.tif")), folder / "run"):
        return dict(row, refused_surface=True)
    reference, heights = Reference(folder / "truth_dsm.tif"), read(folder / "run/dsm/dsm.tif")
    shift = reference.find_shift(*heights)
    row["shift_m"] = [round(float(s), 2) for s in shift]
    with rasterio.open(folder / "truth_buildings.tif") as file:
        truth = file.read(1)
    with rasterio.open(folder / "truth_class.tif") as file:
        jumps = file.read(1)
    for name, binary in binaries.items():
        found, words = classes(binary, folder / "run", folder / f"classes_{name}")
        row[name] = {"refused": words} if found is None else dict(scores(reference.nearest(*found, shift), truth, jumps, reference.nearest(*heights, shift)), said=words)
    return row


def reunion(binaries, work, shared):
    images = sorted((shared / "data/stereo/s2p_pair").glob("img_*.tif"))
    folder = work / "s2p_pair"
    row = {"surface": surface(binaries["now"], images, folder / "run")}
    for name, binary in binaries.items() if row["surface"] else []:
        found, words = classes(binary, folder / "run", folder / f"classes_{name}")
        row[name] = {"refused": words} if found is None else {"building_cells": int((found[0] == BUILDING).sum()), "cells": found[0].size, "said": words}
    return row


def written(out, rows, pair, names):
    (out / "classes_outside.json").write_text(json.dumps({"places": rows, "s2p_pair": pair}, indent=1) + "\n")
    text = lambda value: "–" if value is None else f"{value:.3f}"
    percent = lambda value: "–" if value is None else f"{100 * value:.1f}"
    lines = ["# Classes on places of another simulator", "",
             "Written by `benches/evidence/classes.py`: surfaces from the images of each place, laid on the truth by their heights.", ""]
    for name in names:
        good = [r[name] for r in rows if "iou" in r.get(name, {})]
        over = [g["iou"] for g in good if g["iou"] is not None]
        off = [g["iou_off_walls"] for g in good if g["iou_off_walls"] is not None]
        trees = [g["trees_as_buildings"] for g in good if g["trees_as_buildings"] is not None]
        if over:
            lines.append(f"- {name}: IoU of buildings median {np.median(over):.3f}, worst {min(over):.3f}; without cells beside walls median "
                         f"{np.median(off):.3f}, worst {min(off):.3f}; trees as buildings median {100 * np.median(trees):.1f} %, "
                         f"worst {100 * max(trees):.1f} %; refused: {len(rows) - len(good)} of {len(rows)}.")
    for name in names:
        if name in pair:
            r = pair[name]
            lines.append(f"- {name}: La Réunion, without any building: " + (f"{r['building_cells']} of {r['cells']} cells are buildings."
                         if "cells" in r else f"refused ({r['refused']})."))
    lines += ["", "| place | build | views | IoU | IoU off walls | trees as buildings, % | ground as buildings, % | buildings as ground, % | "
              "buildings as vegetation, % | buildings, % of the cells | trees, % |", "|---|---|---|---|---|---|---|---|---|---|---|"]
    for row in rows:
        for name in names:
            r = row.get(name, {})
            if "iou" not in r:
                lines.append(f"| {row['seed']} | {name} | {row['views']} | refused | – | – | – | – | – | – | – |")
                continue
            numbers = [percent(r[k]) for k in ("trees_as_buildings", "ground_as_buildings", "buildings_as_ground", "buildings_as_vegetation",
                                               "building_share", "tree_share")]
            lines.append(f"| {row['seed']} | {name} | {row['views']} | {text(r['iou'])} | {text(r['iou_off_walls'])} | {' | '.join(numbers)} |")
    (out / "classes_outside.md").write_text("\n".join(lines) + "\n")
    return lines


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("binary")
    arguments.add_argument("work", type=pathlib.Path)
    arguments.add_argument("--before", help="an older build, whose classes are judged beside")
    arguments.add_argument("--seeds", type=int, nargs="*", default=SEEDS)
    arguments.add_argument("--shared", type=pathlib.Path, default=pathlib.Path("../shared"))
    arguments.add_argument("--out", type=pathlib.Path, default=pathlib.Path("benches/results"))
    given = arguments.parse_args()
    binaries = {"now": given.binary, **({"before": given.before} if given.before else {})}
    rows = [judged(binaries, given.work, seed) for seed in given.seeds]
    print("\n".join(written(given.out, rows, reunion(binaries, given.work, given.shared), list(binaries))))


if __name__ == "__main__":
    main()
