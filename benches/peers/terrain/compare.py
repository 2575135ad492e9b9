#!/usr/bin/env python3
"""Compares terrain models: skysweep dtm and five other programs on scenes, on the ISPRS filter test and on LiDAR.

    benches/peers/terrain/compare.py [--skysweep PROGRAM] [--work FOLDER] [--seeds 9801 ...] [--draft]

The first run installs the other programs from PyPI into FOLDER/venv (default target/terrain-peers); neither the build nor the
tests need them. Scenes of ../shared/tools/scenes.py, surfaces of images and the results of the other programs are made where
FOLDER lacks them. Writes benches/results/terrain_peers.json and terrain_peers.md; `--draft` prints only.
"""
import argparse
import json
import os
import pathlib
import resource
import subprocess
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1]))
import dtm  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[3]
OURS, HEIGHTS_ONLY = "skysweep", "skysweep, heights only"
# Stated before any of them was made.
SEEDS = list(range(9801, 9811))


def timed(command):
    """Runs a command. Returns the CPU seconds of it and its children, and what it said if it failed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    said = (done.stderr.strip().splitlines() or ["no output"])[-1][:200]
    return {"cpu_s": round(seconds, 2)} | ({"failed": said} if done.returncode else {})


def ours(program, place):
    """The ground by skysweep, with and without the layers of the surface."""
    surfaces = {OURS: place.ours} | ({HEIGHTS_ONLY: place.cells} if place.ours.is_dir() else {})
    for name, surface in surfaces.items():
        out = place.folder / name.replace(", ", "_").replace(" ", "_")
        yield name, timed([program, "dtm", surface, "-o", out, "--overwrite", "--progress", "none", "-q"]), out / "dtm.tif"


def theirs(names, place):
    """The ground by the other programs, kept from an earlier run on the same surface."""
    for name in names:
        out, kept = place.folder / f"{name}.tif", place.folder / f"{name}.json"
        if not kept.exists():
            script = pathlib.Path(__file__).with_name("programs.py")
            kept.write_text(json.dumps(timed([sys.executable, script, name, place.cells, place.filled, out])))
        yield name, json.loads(kept.read_text()), out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--skysweep", default=str(ROOT / "target/release/skysweep"))
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target/terrain-peers")
    parser.add_argument("--seeds", type=int, nargs="*", default=SEEDS)
    parser.add_argument("--draft", action="store_true", help="write no results")
    options = parser.parse_args()
    python = dtm.environment(options.work, [*dtm.PACKAGES, "pyproj"])
    if pathlib.Path(sys.prefix).resolve() != (options.work / "venv").resolve():
        os.execv(python, [str(python), __file__, *sys.argv[1:]])
    measure(options)


def measure(options):
    import places  # The environment has what these need.
    import programs
    import table
    results = ROOT / "benches/results"
    drawn = {str(seed): places.simulator().random_scene(seed) for seed in options.seeds}
    report = {"seeds": options.seeds, "size_px": places.SIZE_PX, "drawn": drawn, "places": {}}
    for place in places.places(options.skysweep, options.seeds, options.work):
        runs = [*ours(options.skysweep, place), *theirs(programs.SETTINGS, place)]
        judged = {name: run | ({} if "failed" in run else place.judged(out)) for name, run, out in runs}
        report["places"][place.name] = judged
        print(place.name, json.dumps(judged), flush=True)
    if not options.draft:
        (results / "terrain_peers.json").write_text(json.dumps(report, indent=1, ensure_ascii=False) + "\n")
        (results / "terrain_peers.md").write_text(table.page(report))


if __name__ == "__main__":
    main()
