#!/usr/bin/env python3
"""Measures skysweep dtm on laser scans and on scenes of a simulator that shares no code with it.

    benches/peers/terrain_outside.py [--skysweep PROGRAM] [--before PROGRAM TEXT] [--picture PNG] [--work FOLDER] [--seeds 9856 ...]

The ISPRS filter test, LiDAR of Delft, JAX_214 and JAX_068, the images of JAX_068, and surfaces that `skysweep dsm` makes of
the scenes of ../shared/tools/scenes.py, with images of 448 pixels on a side. A scene lies in FOLDER/scenes/rSEED (images,
truth, run/), and is made where it is missing. `--before` is a second program whose figures stand beside, and what it is;
with `--picture` the ground of the first scene by both is drawn. Writes benches/results/terrain_outside.json and
terrain_outside.md. Needs Python with numpy, scipy and rasterio.
"""
import argparse
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

import numpy as np

import dtm

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path += [str(ROOT / "benches/common"), str(ROOT / "benches/peers/terrain")]
import pictures  # noqa: E402
import places  # noqa: E402

SHARED = places.SHARED
TERRAIN = SHARED / "data/terrain"
JAX_068 = SHARED / "data/stereo/jax_068/truth"
# Scenes of which none was looked at before the constants of `terrain::without_noise` were chosen.
BLIND = [9856, 9858, 9859, 9861, 9862, 9863, 9865, 9873, 9875, 9876, 9877, 9878]
# Side of the picture, cells.
PICTURE_CELLS = 300
LIDAR = {
    "Delft": [TERRAIN / "ahn3_delft" / f"ahn3_delft_{name}.tif" for name in ["dsm", "class", "ground"]],
    "JAX_214": [TERRAIN / "jax_tiles/JAX_214_DSM_georef.tif", TERRAIN / "jax_tiles/JAX_214_CLS.tif"],
    "JAX_068": [JAX_068 / "JAX_068_DSM_georef.tif", JAX_068 / "JAX_068_CLS.tif"],
}


def terrain(program, surface, out):
    """Runs the command, which may end with 1 where it found no ground, and returns the ground."""
    command = [program, "dtm", surface, "-o", out, "--overwrite", "--progress", "none", "-q"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return pathlib.Path(out) / "dtm.tif"


def isprs(program):
    """Total error of each sample in percent, and their mean, by the shared judge."""
    judge = [sys.executable, SHARED / "tools/isprs.py", program, TERRAIN / "isprs", "6"]
    said = subprocess.run(judge, capture_output=True, text=True).stdout
    pairs = [pair.split() for pair in said.split(": ")[1].split(", ")]
    samples = {f"ISPRS sample {name}, total error, %": float(value) for name, value in pairs}
    return samples | {"ISPRS mean, total error, %": float(np.mean(list(samples.values())))}


def lidar(program, name, files, out):
    found, top, kinds = dtm.read(terrain(program, files[0], out))[0], dtm.read(files[0])[0], dtm.read(files[1])[0]
    truth = dtm.read(files[2])[0] if len(files) > 2 else top
    on_ground = np.abs(found - truth)[kinds == dtm.GROUND]
    kept = (np.abs(found - top) < dtm.KEPT_M)[kinds == dtm.BUILDING]
    return {f"{name}, LiDAR, mean error on ground, m": float(np.nanmean(on_ground)),
            f"{name}, LiDAR, building cells kept, %": 100.0 * float(kept.mean())}


def jax_images(program, work):
    """The surface of the seven images of JAX_068, compared with LiDAR on ground and on buildings."""
    run = work / "jax_068_images"
    if not (run / "report/report.json").exists():
        views = sorted((JAX_068.parent / "images").glob("*.tif"))
        subprocess.run([program, "dsm", *views, "-o", run, "--progress", "none", "-q"], check=True)
    (top, like), kinds = dtm.read(LIDAR["JAX_068"][0]), dtm.read(LIDAR["JAX_068"][1])[0]
    made = dtm.on_grid(run / "dsm/dsm.tif", like)
    columns, rows, up = dtm.placement(made, top)
    found = dtm.on_grid(terrain(program, run, work / "made/jax_068_images"), like)
    found = np.roll(found, (-rows, -columns), (0, 1)) - up
    off = np.where(dtm.reached(np.roll(made, (-rows, -columns), (0, 1))), np.abs(found - top), np.nan)
    return {"JAX_068, seven images, mean error on ground, m": float(np.nanmean(off[kinds == dtm.GROUND])),
            "JAX_068, seven images, building cells kept, %":
                100.0 * float(np.nanmean(off[kinds == dtm.BUILDING] < dtm.KEPT_M))}


def scene(program, seed, work):
    """The surface of the images of a drawn place."""
    folder = places.made_scene(program, seed, work)
    truth, top = dtm.read(folder / "truth_ground.tif"), dtm.read(folder / "truth_dsm.tif")[0]
    made = dtm.on_grid(folder / "run/dsm/dsm.tif", truth[1])
    shift = dtm.placement(made, top)
    valid = dtm.reached(np.roll(made, (-shift[1], -shift[0]), (0, 1)))
    found = dtm.errors(terrain(program, folder / "run", work / f"made/{seed}"), shift, truth,
                       top - truth[0] > dtm.KEPT_M, valid)
    name = json.loads((folder / "scene.json").read_text())["scene"]
    return {f"{name}, from images, RMSE, m": found["rmse_m"],
            f"{name}, from images, RMSE under objects, m": found["rmse_under_objects_m"]}


def picture(programs, options, path):
    """The middle of the ground of the first drawn place by each program, side by side."""
    folder = options.work / f"scenes/r{options.seeds[0]}"
    parts = []
    for number, program in enumerate(programs):
        ground, profile = dtm.read(terrain(program, folder / "run", options.work / f"made/picture_{number}"))
        middle = tuple(slice((n - PICTURE_CELLS) // 2, (n + PICTURE_CELLS) // 2) for n in ground.shape)
        parts.append(pictures.hillshade(ground[middle], profile["transform"].a))
    pictures.side_by_side(parts, np.nanpercentile(parts[0], [2, 98]), path)


def measured(program, options):
    results = isprs(program)
    for name, files in LIDAR.items():
        with tempfile.TemporaryDirectory() as out:
            results |= lidar(program, name, files, out)
    results |= jax_images(program, options.work)
    drawn = {}
    for seed in options.seeds:
        drawn |= scene(program, seed, options.work)
    for measure in ["RMSE, m", "RMSE under objects, m"]:
        values = [value for name, value in drawn.items() if name.endswith(f", {measure}")]
        results[f"{len(values)} random scenes, from images, median {measure}"] = statistics.median(values)
    return results | drawn


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--skysweep", default=str(ROOT / "target/release/skysweep"))
    parser.add_argument("--before", nargs=2, metavar=("PROGRAM", "TEXT"))
    parser.add_argument("--picture", type=pathlib.Path)
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target/terrain-outside")
    parser.add_argument("--seeds", type=int, nargs="*", default=BLIND)
    options = parser.parse_args()
    place = ROOT / "benches/results"
    report = {"skysweep": measured(options.skysweep, options)}
    if options.before:
        report["before"] = measured(options.before[0], options)
        if options.picture:
            picture([options.before[0], options.skysweep], options, options.picture)
    names = list(report)
    lines = ["# Terrain on other places", "", "Made by `benches/peers/terrain_outside.py`. Lower is better.", ""]
    if options.before:
        lines += [f"`before`: {options.before[1]}.", ""]
    lines += ["| measure | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    for measure in report["skysweep"]:
        lines.append(f"| {measure} | " + " | ".join(f"{report[name][measure]:.2f}" for name in names) + " |")
    (place / "terrain_outside.json").write_text(json.dumps(report, indent=1) + "\n")
    (place / "terrain_outside.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
