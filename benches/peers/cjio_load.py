"""cjio's loading and triangulating of a CityJSON tile, side by side with `skysweep city info`, which does both and reports.

    PYTHON benches/peers/cjio_load.py SKYSWEEP TILE.city.json [RUNS]

PYTHON has cjio and mapbox_earcut (PyPI), the faster of its two ways to triangulate. Each run alternates the two, every time in a process of its
own. Prints wall and CPU seconds (medians) and the largest peak memory. cjio's time is taken inside its process, after the
imports; that of skysweep is the whole process, with the report as JSON.
"""

import json
import os
import statistics
import subprocess
import sys
import time

CJIO = """
import sys, time, json
from cjio import cityjson
wall, cpu = time.perf_counter(), time.process_time()
with open(sys.argv[1]) as file:
    model = cityjson.reader(file=file, ignore_duplicate_keys=True)
loaded = time.perf_counter() - wall
model.triangulate(True)
print(json.dumps({"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu, "load": loaded}))
"""


def run(command):
    """Output, wall and CPU seconds, and peak memory in MiB of a process."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    output = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{command[0]} failed with {status}")
    return output, time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main(skysweep, tile, runs=5):
    rows = {"cjio": [], "skysweep": []}
    for _ in range(int(runs)):
        output, _, _, peak = run([sys.executable, "-c", CJIO, tile])
        found = json.loads(output.splitlines()[-1])
        rows["cjio"].append((found["wall"], found["cpu"], peak))
        _, wall, cpu, peak = run([skysweep, "city", "info", "--json", tile])
        rows["skysweep"].append((wall, cpu, peak))
    for name, found in rows.items():
        wall, cpu, peak = zip(*found)
        print(f"{name:<9} wall {statistics.median(wall):.3f} s ({min(wall):.3f} to {max(wall):.3f}), "
              f"CPU {statistics.median(cpu):.3f} s, peak {max(peak):.0f} MiB")


if __name__ == "__main__":
    main(*sys.argv[1:])
