"""Throughput of skysweep.Rpc beside rpcm and rpcfast, and imports beside other packages; see python_rpc.sh."""

import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

THREADS = [1, os.cpu_count() or 1]
#: Points of a call, and calls of which the fastest counts.
POINTS, CALLS = 2_000_000, 25
TOWN = Path(__file__).resolve().parents[2] / "data-samples" / "town"
IMAGE = TOWN / "view_1.tif"
#: Packages with libraries of their own, such as GDAL, PROJ and OpenMP.
NEIGHBOURS = ["rasterio", "geopandas", "pyproj", "open3d"]
NEIGHBOUR_TEST = """
import {first}, {second}
import skysweep, sys
plan = skysweep.make_plan(sys.argv[1:3], "never", crs_epsg=32631, vertical="egm96", gsd_m=2.0, preset="fast",
                          height_range_m=[170.0, 280.0])
surface = skysweep.read_raster(sys.argv[3])
assert plan.plan.grid.epsg == 32631 and "32631" in surface.crs
neighbour = "{neighbour}"
if neighbour == "rasterio":
    import rasterio.crs
    with rasterio.open(sys.argv[3]) as file:
        assert file.read(1).shape == surface.values.shape
    assert rasterio.crs.CRS.from_epsg(32631).is_projected
elif neighbour in ("geopandas", "pyproj"):
    import pyproj
    assert pyproj.CRS(32631).to_epsg() == 32631
"""


def rates(threads, folder):
    """Millions of points a second by operation and package, with so many threads."""
    os.environ["NUMBA_NUM_THREADS"] = os.environ["RAYON_NUM_THREADS"] = str(threads)
    import numpy as np
    import rpcfast
    import rpcm
    import skysweep

    ours = skysweep.Rpc(IMAGE)
    text = ours.to_text("text")
    path = Path(folder) / "camera_RPC.TXT"
    path.write_text(text)
    peer, fast = rpcm.rpc_from_rpc_file(str(path)), rpcfast.read_rpc(str(path))
    random = np.random.default_rng(1)
    sample, line = random.uniform(0, 400, (2, POINTS))
    heights = random.uniform(180, 260, POINTS)
    lon, lat = ours.localize(sample, line, heights)
    few = slice(0, POINTS // 20)

    def rate(work, count):
        times = []
        for _ in range(CALLS):
            start = time.perf_counter()
            work()
            times.append(time.perf_counter() - start)
        return count / min(times) / 1e6

    own, other = ours.project(lon, lat, heights), rpcfast.project(fast, lon, lat, heights)
    difference = max(np.abs(a - b).max() for a, b in zip(own, other))
    found = {
        "project": {
            "skysweep": rate(lambda: ours.project(lon, lat, heights), POINTS),
            "rpcfast": rate(lambda: rpcfast.project(fast, lon, lat, heights), POINTS),
            "rpcm": rate(lambda: peer.projection(lon[few], lat[few], heights[few]), POINTS // 20),
        },
        "project at one height": {
            "skysweep": rate(lambda: ours.project(lon, lat, 210.0), POINTS),
            "rpcfast": rate(lambda: rpcfast.project(fast, lon, lat, 210.0), POINTS),
            "rpcm": rate(lambda: peer.projection(lon[few], lat[few], 210.0), POINTS // 20),
        },
        "localize": {
            "skysweep": rate(lambda: ours.localize(sample, line, heights), POINTS),
            "rpcfast": rate(lambda: rpcfast.localize(fast, sample, line, heights), POINTS),
            "rpcm": rate(lambda: peer.localization(sample[few], line[few], heights[few]), POINTS // 20),
        },
    }
    return {"threads": threads, "largest difference to rpcfast, px": float(difference), "Mpt/s": found}


def imports(first, second, neighbour):
    """Whether the two packages work in one process, imported in this order."""
    code = NEIGHBOUR_TEST.format(first=first, second=second, neighbour=neighbour)
    arguments = [TOWN / "view_1.tif", TOWN / "view_3.tif", TOWN / "truth" / "dsm.tif"]
    done = subprocess.run([sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True, check=False)
    return "works" if done.returncode == 0 else f"fails: {(done.stderr.strip().splitlines() or ['no text'])[-1]}"


def child(threads, folder):
    call = [sys.executable, __file__, "--rates", str(threads), folder]
    done = subprocess.run(call, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def main(results):
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        measured = [child(threads, folder) for threads in THREADS]
    beside = {
        name: {"first": imports(name, "skysweep", name), "last": imports("skysweep", name, name)} for name in NEIGHBOURS
    }
    content = {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "profile": os.environ.get("SKYSWEEP_PROFILE", "dev (opt-level 2)"),
        "points": POINTS,
        "measured": measured,
        "imports": beside,
    }
    (results / "python_rpc.json").write_text(json.dumps(content, indent=2) + "\n")
    lines = [
        "# RPC cameras on arrays, and imports beside other packages",
        "",
        f"Written by `benches/peers/python_rpc.sh`. {content['machine']}, build profile {content['profile']}; millions of points a",
        f"second, the fastest of {CALLS} calls with {POINTS:,} points (rpcm: a twentieth of them).",
        "",
        "| threads | operation | skysweep | rpcfast 1.0.4 | rpcm 1.4.10 | to rpcfast | to rpcm |",
        "|---|---|---|---|---|---|---|",
    ]
    for entry in measured:
        for operation, by in entry["Mpt/s"].items():
            own, fast, slow = by["skysweep"], by["rpcfast"], by["rpcm"]
            lines.append(
                f"| {entry['threads']} | {operation} | {own:.1f} | {fast:.1f} | {slow:.2f} | {own / fast:.1f} × | {own / slow:.0f} × |"
            )
    lines += ["", "Localisation of rpcfast iterates to 1e-8 px, that of rpcm to its own tolerance.", ""]
    lines += ["| package | imported before skysweep | after it |", "|---|---|---|"]
    lines += [f"| {name} | {found['first']} | {found['last']} |" for name, found in beside.items()]
    (results / "python_rpc.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    if sys.argv[1] == "--rates":
        print(json.dumps(rates(int(sys.argv[2]), sys.argv[3])))
    else:
        main(Path(sys.argv[1]))
