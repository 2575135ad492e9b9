#!/usr/bin/env python3
"""Compares terrain models: skysweep dtm and four other programs on the same surface models.

    benches/peers/dtm.py [--skysweep PROGRAM] [--work FOLDER] [--only ours]

Makes simulated scenes with `skysweep simulate`, takes their exact surface and the surface that `skysweep dsm` makes of
their images, and the LiDAR surface of JAX_068 where it is found. Writes benches/results/dtm.json and dtm.md. The other
programs come from PyPI into FOLDER/venv (default target/dtm-peers); neither the build nor the tests need them.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
PACKAGES = ["numpy", "rasterio", "scipy", "whitebox-workflows==2.0.6", "dsm2dtm==0.4.0", "cloth-simulation-filter==1.1.7",
            "bulldozer-dtm==1.3.1"]
SCENES = ["town", "suburb", "dense-city", "high-rise", "hills"]
SIZE_M = 400
OURS = "skysweep"
PEERS = ["whitebox-workflows", "dsm2dtm", "CSF", "bulldozer-dtm"]
# A cell of a building counts as kept when its ground is this close to its surface.
KEPT_M = 0.5
BUILDING, GROUND = 6, 2
# What lies beyond is the sign of a void that a program does not declare.
HEIGHT_MAX_M = 1e5


def environment(folder, packages):
    """Returns a python with packages, made when there is none."""
    python = folder / "venv/bin/python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True)
    if not (folder / "venv/installed").exists():
        for package in packages:  # One by one: what cannot be installed is named in the table.
            subprocess.run([python, "-m", "pip", "install", "--quiet", package])
        (folder / "venv/installed").touch()
    return python


def read(path):
    import numpy as np
    import rasterio
    with rasterio.open(path) as file:
        heights = file.read(1).astype("float64")
        if file.nodata is not None:
            heights[heights == file.nodata] = np.nan
        return heights, file.profile


def whitebox(dsm, out):
    import whitebox_workflows
    wbe = whitebox_workflows.WbEnvironment()
    surface = wbe.read_raster(str(dsm))
    ground = wbe.remove_off_terrain_objects(surface, filter_size=181, slope_threshold=20.0)
    wbe.write_raster(ground, str(out))


def dsm2dtm(dsm, out):
    import dsm2dtm as module
    module.generate_dtm_file(str(dsm), str(out), kernel_radius_meters=60.0)


def csf(dsm, out):
    import CSF
    import numpy as np
    import rasterio
    from scipy.interpolate import griddata
    heights, profile = read(dsm)
    rows, columns = np.nonzero(np.isfinite(heights))
    cell = profile["transform"].a
    cloth = CSF.CSF()
    cloth.params.bSloopSmooth = True
    cloth.params.cloth_resolution = 1.0
    cloth.params.rigidness = 2
    cloth.params.class_threshold = 0.5
    cloth.setPointCloud(np.column_stack([columns * cell, -rows * cell, heights[rows, columns]]))
    ground, rest = CSF.VecInt(), CSF.VecInt()
    cloth.do_filtering(ground, rest, False)
    kept = np.array(ground)
    wanted = np.indices(heights.shape).reshape(2, -1).T
    known = np.column_stack([rows[kept], columns[kept]])
    values = heights[rows[kept], columns[kept]]
    filled = griddata(known, values, wanted, method="linear").reshape(heights.shape)
    near = griddata(known, values, wanted, method="nearest").reshape(heights.shape)
    filled[np.isnan(filled)] = near[np.isnan(filled)]
    profile.update(driver="GTiff", dtype="float32", nodata=-32768.0, count=1)
    with rasterio.open(out, "w", **profile) as file:
        file.write(filled.astype("float32"), 1)


def bulldozer(dsm, out):
    from bulldozer.pipeline.bulldozer_pipeline import dsm_to_dtm
    folder = pathlib.Path(out).with_suffix("")
    dsm_to_dtm(dsm_path=str(dsm), output_dir=str(folder), nb_max_workers=2)
    os.replace(next(folder.rglob("*[dD][tT][mM].tif")), out)


RUNS = {"whitebox-workflows": whitebox, "dsm2dtm": dsm2dtm, "CSF": csf, "bulldozer-dtm": bulldozer}


def scenes(program, work):
    """Makes the simulated scenes and their surface models. Yields (name, surface, truth folder)."""
    for scene in SCENES:
        folder = work / scene
        quiet = ["--progress", "none", "-q"]
        if not (folder / "truth/dtm.tif").exists():
            subprocess.run([program, "simulate", scene, "--size", str(SIZE_M), "-o", folder, "--progress", "none"],
                           check=True, stdout=subprocess.DEVNULL)
        if not (folder / "run/report/report.json").exists():
            views = sorted(folder.glob("view_*.tif"))
            subprocess.run([program, "dsm", *views, "-o", folder / "run", *quiet], check=True)
        yield f"{scene}, true surface", folder / "truth/dsm.tif", folder / "truth"
        yield f"{scene}, made from images", folder / "run/dsm/dsm.tif", folder / "truth"


def on_grid(path, like):
    """Reads a raster onto the grid of another one."""
    import numpy as np
    import rasterio
    from rasterio.warp import Resampling, reproject
    out = np.full((like["height"], like["width"]), np.nan)
    with rasterio.open(path) as file:
        reproject(rasterio.band(file, 1), out, src_nodata=file.nodata, dst_nodata=np.nan, dst_crs=like["crs"],
                  dst_transform=like["transform"], resampling=Resampling.bilinear)
    out[np.abs(out) > HEIGHT_MAX_M] = np.nan
    return out


def placement(surface, truth):
    """The shift of a made surface against the truth: images point a few pixels off. (columns, rows, metres)."""
    import numpy as np
    best = None
    for dy in range(-8, 9):
        for dx in range(-8, 9):
            moved = surface[10 + dy:-10 + dy:2, 10 + dx:-10 + dx:2] - truth[10:-10:2, 10:-10:2]
            middle = np.nanmedian(moved)
            spread = np.nanmedian(np.abs(moved - middle))
            if best is None or spread < best[0]:
                best = (spread, dx, dy, middle)
    return best[1:]


def errors(path, shift, truth, objects, valid):
    """Root mean square error under objects and in all, and the share of cells without a height."""
    import numpy as np
    found = np.roll(on_grid(path, truth[1]), (-shift[1], -shift[0]), (0, 1)) - shift[2]
    difference = np.where(valid, found - truth[0], np.nan)[10:-10, 10:-10]
    under = difference[objects[10:-10, 10:-10]]
    rmse = lambda values: float(np.sqrt(np.nanmean(values ** 2)))
    return {"rmse_under_objects_m": rmse(under), "rmse_m": rmse(difference),
            "median_m": float(np.nanmedian(difference)),
            "share_missing": float(np.isnan(difference).sum() / max(valid[10:-10, 10:-10].sum(), 1))}


def judged_scene(results, surface, truth_folder):
    import numpy as np
    ground, top = read(truth_folder / "dtm.tif"), read(truth_folder / "dsm.tif")[0]
    made = on_grid(surface, ground[1])
    is_true = surface.parent == truth_folder
    shift = (0, 0, 0.0) if is_true else placement(made, top)
    # Where the surface of the images ends, no program has anything to go by.
    valid = np.ones(top.shape, bool) if is_true else reached(np.roll(made, (-shift[1], -shift[0]), (0, 1)))
    objects = top - ground[0] > KEPT_M
    for name, entry in results.items():
        if "file" in entry:
            found = errors(entry["file"], shift, ground, objects, valid)
            # A program that cannot read the file well gives a raster of voids.
            lost = {"failed": f"{100 * found['share_missing']:.0f} % of the cells have no height"}
            entry.update(found if found["share_missing"] < 0.5 else lost)


def reached(made):
    """Cells with heights on both sides in their row: inside of what the images show."""
    import numpy as np
    known = np.isfinite(made)
    left = np.maximum.accumulate(known, axis=1)
    right = np.maximum.accumulate(known[:, ::-1], axis=1)[:, ::-1]
    return left & right


def judged_lidar(results, surface, classes):
    import numpy as np
    top, profile = read(surface)
    kinds = read(classes)[0]
    for entry in results.values():
        if "file" not in entry:
            continue
        difference = np.abs(read(entry["file"])[0] - top)
        entry["ground_mae_m"] = float(np.nanmean(difference[kinds == GROUND]))
        entry["share_missing"] = float(np.isnan(difference[np.isfinite(top)]).mean())
        entry["buildings_kept"] = float(np.nanmean(difference[kinds == BUILDING] < KEPT_M))


def write_plain(surface, out):
    """Writes a surface as a TIFF without compression and tiles, which every program reads."""
    import numpy as np
    import rasterio
    heights, profile = read(surface)
    place = {key: profile[key] for key in ["crs", "transform", "width", "height"]}
    with rasterio.open(out, "w", driver="GTiff", dtype="float32", nodata=-32768.0, count=1, **place) as file:
        file.write(np.where(np.isfinite(heights), heights, -32768.0).astype("float32"), 1)


def run_all(program, surface, folder, only):
    """Runs every program on a surface, in processes of their own."""
    folder.mkdir(parents=True, exist_ok=True)
    plain = folder / "surface.tif"
    write_plain(surface, plain)
    results = {}
    for name in [OURS, *PEERS]:
        if only == "ours" and name != OURS:
            continue
        out = folder / f"{name}.tif"
        start = time.monotonic()
        if name == OURS:
            command = [program, "dtm", surface, "-o", folder / "ours", "--overwrite", "--progress", "none", "-q"]
            out = folder / "ours/dtm.tif"
        else:
            command = [sys.executable, __file__, "--peer", name, plain, out]
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode == 0 and out.exists():
            results[name] = {"file": str(out), "seconds": round(time.monotonic() - start, 2)}
        else:
            results[name] = {"failed": (done.stderr or "no output").strip().splitlines()[-1][:200]}
    return results


def table(report):
    """The results as Markdown."""
    names = [OURS, *PEERS]
    cell = lambda entry, key, scale: f"{scale * entry[key]:.2f}" if key in entry else "failed" if entry else "not run"
    lines = ["# Terrain models", "", "Made by `benches/peers/dtm.py`. Lower is better.", "",
             "Programs: skysweep dtm with its defaults; whitebox-workflows (181 cells, 20 degrees), dsm2dtm (radius 60 m), "
             "CSF (cloth 1 m, rigidness 2), bulldozer-dtm with its defaults.", "",
             "`failed`: the program gave no result, or one without heights in most cells; dtm.json names the reason.", ""]
    if report.get("ours_alone"):
        lines += ["The figures of the other programs are from an earlier run on the same surfaces. The seconds are not comparable: "
                  "skysweep ran alone, at another load of the machine.", ""]
    for title, key in [("RMSE under buildings and trees, metres", "rmse_under_objects_m"),
                       ("RMSE of all cells, metres", "rmse_m")]:
        lines += [f"## {title}", "", "| surface | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
        for scene, results in report["simulated"].items():
            lines.append(f"| {scene} | " + " | ".join(cell(results.get(n, {}), key, 1) for n in names) + " |")
        lines.append("")
    if report.get("lidar"):
        lines += ["## LiDAR surface of JAX_068", "", "| measure | " + " | ".join(names) + " |",
                  "|---" * (len(names) + 1) + "|"]
        for title, key, scale in [("mean error on ground, metres", "ground_mae_m", 1),
                                  ("buildings kept as ground, %", "buildings_kept", 100),
                                  ("seconds, with the start of the program", "seconds", 1)]:
            lines.append(f"| {title} | " + " | ".join(cell(report["lidar"].get(n, {}), key, scale) for n in names) + " |")
        lines.append("")
    return "\n".join(lines)


def without_files(results):
    return {name: {key: value for key, value in entry.items() if key != "file"} for name, entry in results.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--skysweep", default=str(ROOT / "target/release/skysweep"))
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target/dtm-peers")
    parser.add_argument("--only", choices=["ours"], help="run skysweep alone; the figures of the others stay")
    parser.add_argument("--peer", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.peer:
        RUNS[options.peer[0]](*map(pathlib.Path, options.peer[1:]))
        return
    python = environment(options.work, PACKAGES)
    if pathlib.Path(sys.executable).resolve() != python.resolve() or sys.prefix == sys.base_prefix:
        os.execv(python, [str(python), __file__, *sys.argv[1:]])
    place = ROOT / "benches/results"
    before = json.loads((place / "dtm.json").read_text()) if options.only else {"simulated": {}, "lidar": {}}
    report = {"simulated": {}, "ours_alone": bool(options.only)}
    for name, surface, truth in scenes(options.skysweep, options.work):
        results = run_all(options.skysweep, surface, options.work / "made" / name.replace(", ", "_"), options.only)
        judged_scene(results, surface, truth)
        report["simulated"][name] = before["simulated"].get(name, {}) | without_files(results)
        print(name, json.dumps(report["simulated"][name]), flush=True)
    data = pathlib.Path(os.environ.get("SKYSWEEP_DATA", ROOT.parent / "shared/data")) / "stereo/jax_068/truth"
    if (data / "JAX_068_DSM_georef.tif").exists():
        surface = data / "JAX_068_DSM_georef.tif"
        results = run_all(options.skysweep, surface, options.work / "made/jax_068", options.only)
        judged_lidar(results, surface, data / "JAX_068_CLS.tif")
        report["lidar"] = before.get("lidar", {}) | without_files(results)
        print("jax_068", json.dumps(report["lidar"]), flush=True)
    (place / "dtm.json").write_text(json.dumps(report, indent=1) + "\n")
    (place / "dtm.md").write_text(table(report))


if __name__ == "__main__":
    main()
