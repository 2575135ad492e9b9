"""Runs CARS on scenes of `make bench` and writes benches/results/cars.json, which the bench merges into its table.

Called by run.sh from the project's root with the Python that CARS is installed in. Processor time is user time of the whole
command (all its processes), one run per scene, the sequential orchestrator: no time is lost to its worker processes. Default
configuration, all pairs of views, the grid's resolution 0.5 m. A scene of which CARS makes nothing is told and left out (1.3.0 ends
on the simulated town with "The DSM generated at resolution 4 is empty"). Accuracy is by `skysweep eval` with the bench's own protocol;
CARS writes heights above EGM96.
"""

import itertools
import json
import os
import resource
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import rasterio

SKYSWEEP = Path("target/release/skysweep")
CARS = Path(sys.executable).parent / "cars"
DATA = Path("../shared/data/stereo/jax_068")
RESULTS = Path("benches/results/cars.json")
DEFAULT = ["town", "high-rise", "jax_068:2-3", "jax_068:2-4"]


def simulated(name, folder):
    subprocess.run([SKYSWEEP, "simulate", name, "-o", folder, "-q"], check=True)
    truth = folder / "truth"
    protocol = [truth / "dsm.tif", "--dtm", truth / "dtm.tif", "--classes", truth / "classes.tif", "--skip", "9"]
    return sorted(folder.glob("*.tif")), protocol, {"scene": name, "input": "all views, all pairs", "views": []}


def jacksonville(views):
    images = [DATA / f"images/JAX_068_{view:03}_RGB.tif" for view in views]
    protocol = [DATA / "truth/JAX_068_DSM_georef.tif"]
    return images, protocol, {"scene": "jax_068", "input": "views " + ", ".join(map(str, views)), "views": views}


def run_cars(images, out):
    """Runs CARS; returns its user seconds and the surface model."""
    keys = [f"view_{number}" for number in range(1, len(images) + 1)]
    sensor = lambda path: {"image": str(path.resolve()), "geomodel": {"path": str(path.resolve())}}
    config = {
        "input": {
            "sensors": {key: sensor(path) for key, path in zip(keys, images)},
            "pairing": [list(pair) for pair in itertools.combinations(keys, 2)],
        },
        "orchestrator": {"mode": "sequential"},
        "output": {"directory": str(out), "resolution": 0.5},
    }
    path = out.with_suffix(".json")
    path.write_text(json.dumps(config))
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run([CARS, "--logtype", "plain", path], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    if done.returncode != 0:
        errors = [line for line in done.stdout.splitlines() if "Error" in line or "ERROR" in line]
        raise RuntimeError(errors[-1] if errors else f"exit code {done.returncode}")
    return seconds, out / "dsm" / "dsm.tif"


def evaluate(dsm, protocol):
    datums = ["--test-vertical", "egm96", "--ref-vertical", "ellipsoid"]
    command = [SKYSWEEP, "eval", dsm, *protocol, *datums, "--align", "xyz", "--json", "--no-report"]
    report = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    names = ["mae", "rmse", "nmad", "completeness_1", "valid_ratio"]
    return {name: report["metrics"][name] for name in names}


def megapixels(images):
    total = 0
    for path in images:
        with rasterio.open(path) as image:
            total += image.width * image.height
    return total / 1e6


def main():
    entries = json.loads(RESULTS.read_text())["entries"] if RESULTS.exists() else []
    for name in [argument for argument in sys.argv[1:] if argument] or DEFAULT:
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            scene, _, views = name.partition(":")
            if scene == "jax_068":
                images, protocol, what = jacksonville([int(view) for view in views.split("-")])
            else:
                images, protocol, what = simulated(scene, folder / "scene")
            try:
                seconds, dsm = run_cars(images, folder / "out")
            except RuntimeError as error:
                print(f"{name}: CARS made no surface model: {error}", file=sys.stderr)
                continue
            entry = {"tool": f"CARS {version('cars')}", **what, "cpu_s": round(seconds, 1)}
            entry |= {"cpu_note": "one run, sequential", "megapixels": megapixels(images), **evaluate(dsm, protocol)}
        entries = [e for e in entries if (e["scene"], e["input"]) != (entry["scene"], entry["input"])] + [entry]
        print(json.dumps(entry))
        part = RESULTS.with_suffix(".part")
        part.write_text(json.dumps({"entries": entries}, indent=2) + "\n")
        os.replace(part, RESULTS)


main()
