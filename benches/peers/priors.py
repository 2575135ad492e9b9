"""Compares rays, visibility and loading of `skysweep priors` with Open3D and cjio; writes benches/results/priors.{json,md}.

    PYTHON benches/peers/priors.py [RUNS]

PYTHON is what `environment.sh` prints. Run it from the project's root; it needs `../shared/data/city`. The tools alternate, and every
run is a process of its own. Numbers are medians. Run it without other load on the machine; CPU seconds suffer less from load.
"""

import json
import os
import pathlib
import platform
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
CITY = ROOT.parent / "shared/data/city"
REFERENCE = CITY / "peer_reference"
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
# What `tests/priors_yardsticks.rs` proves.
FALSE_ROOF = """The camera off by more than five (45, by ten): a corner of one roof (NL.IMBAG.Pand.0503100000033695-0, \
LoD 2.2, surface 410) lies 0.26 mm across another edge of its ring, and the ear clipping of the reference covers a sliver \
beside that roof. The ten places hit are outside of the ring (its winding number is 0 there), so that a right map has \
369,394 hits where the reference has 369,404; `tests/priors_yardsticks.rs` holds both."""
YARDSTICKS = {"20": [494_586, 316_280, 130_065], "100": [2_039_718, 572_457, 472_904]}


def told(command):
    """The JSON on the last line that a command prints."""
    done = subprocess.run([str(c) for c in command], cwd=ROOT, stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def bench(*arguments):
    return told(["cargo", "bench", "-q", "--bench", "casting", "--", CITY, *arguments])


def median(runs, *path):
    def at(run):
        for key in path:
            run = run[key]
        return run

    return statistics.median(at(run) for run in runs)


def main(runs=5):
    with tempfile.TemporaryDirectory() as folder:
        rays = pathlib.Path(folder) / "rays.npy"
        found = {"check": bench("check", rays), "runs": {}}
        for threads in ("1", "2"):
            ours, theirs = [], []
            for number in range(int(runs)):
                exact = [rays] if threads == "1" and number == 0 else []
                theirs.append(told([sys.executable, "benches/peers/open3d_cast.py", REFERENCE, threads, *exact]))
                ours.append(bench("time", threads))
            found["runs"][threads] = {"skysweep": ours, "open3d": theirs}
        found["cjio"] = [told([sys.executable, "-c", CJIO, CITY / "3dbag_5910.city.json"]) for _ in range(int(runs))]
    found["machine"] = machine()
    found["load_average"] = os.getloadavg()[0]
    results = ROOT / "benches/results"
    (results / "priors.json").write_text(json.dumps(found, indent=1) + "\n")
    (results / "priors.md").write_text(markdown(found))
    print(markdown(found))


def machine():
    with open("/proc/cpuinfo") as file:
        name = next((line.split(":")[1].strip() for line in file if line.startswith("model name")), "unknown CPU")
    return f"{name}, {platform.system()} {platform.machine()}"


def markdown(found):
    check, runs = found["check"], found["runs"]
    first = runs["1"]["open3d"][0]
    lines = [
        "# Building priors side by side with Open3D and cjio",
        "",
        "Made by `$(benches/peers/environment.sh) benches/peers/priors.py`. 3DBAG tile 5910 (77,739 triangles, "
        "`peer_reference/mesh_local.ply`), 100 cameras of 1024 × 768 pixels, 1,000,000 points; Open3D "
        f"{first['version']} (Embree) and skysweep in turn, medians of {len(runs['1']['open3d'])} runs; {found['machine']}, two "
        f"cores under a load of {found['load_average']:.1f}, so that CPU seconds say more than wall. Open3D's clock runs while it casts; ours also while normals, classes and objects are written to their maps.",
        "",
        "| | threads | Open3D Mray/s | wall s | CPU s | skysweep Mray/s | wall s | CPU s | faster (wall) | (CPU) |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for what, name, path in [
        ("maps", "100 depth and normal maps", ()),
        ("visibility", "visibility of 1e6 points in 100 cameras, rays", ()),
        ("visibility", "the same with projection and counting (Open3D: NumPy)", ("whole",)),
    ]:
        for threads in runs:
            cells = []
            for tool in ("open3d", "skysweep"):
                of = runs[threads][tool]
                wall, cpu = median(of, what, *path, "wall_s"), median(of, what, *path, "cpu_s")
                cells.append((median(of, what, "rays") / wall / 1e6, wall, cpu))
            (a, b) = cells
            text = " | ".join(f"{rate:.1f} | {wall:.2f} | {cpu:.2f}" for rate, wall, cpu in cells)
            lines.append(f"| {name} | {threads} | {text} | {a[1] / b[1]:.1f} × | {a[2] / b[2]:.1f} × |")
    one = runs["1"]
    build = [1e3 * median(one[tool], "build", "wall_s") for tool in ("open3d", "skysweep")]
    load = [median(one["skysweep"], "load_and_triangulate", of) for of in ("wall_s", "cpu_s")]
    cjio = [median(found["cjio"], of) for of in ("wall", "cpu")]
    peaks = {tool: median(runs["2"][tool], "peak_mib") for tool in ("open3d", "skysweep")}
    imported = median(runs["2"]["open3d"], "imported_mib")
    lines += [
        "",
        f"Tree built in {build[1]:.0f} ms (Open3D {build[0]:.0f} ms). CityJSON loaded and triangulated in {load[0]:.3f} s on one thread "
        f"({load[1]:.3f} s CPU), by cjio (mapbox_earcut) in {cjio[0]:.2f} s ({cjio[1]:.2f} s CPU): {cjio[1] / load[1]:.0f} × the CPU. Peak memory {peaks['skysweep']:.0f} MiB, Open3D "
        f"{peaks['open3d']:.0f} MiB ({imported:.0f} MiB of it are there after the imports).",
        "",
        "## Error against every triangle in f64",
        "",
        "| | rays | hit by both | hit by one only | mean, m | largest, m |",
        "|---|---|---|---|---|---|",
    ]
    for name, error in [("Open3D", first["brute_force"]), ("skysweep", check["brute_force"])]:
        cells = f"{error['rays']:,} | {error['hits']:,} | {error['hit_by_one_only']} | {error['mean_m']:.2e} | {error['max_m']:.2e}"
        lines.append(f"| {name} | {cells} |")
    lines += [
        "",
        "## Against the stored results",
        "",
        "| | stored | our triangles | theirs |",
        "|---|---|---|---|",
    ]
    tile, theirs = check["tile"], check["reference_triangles"]
    for count, expected in YARDSTICKS.items():
        for number, name in enumerate(["pairs", "in one view", "in two views"]):
            cells = [expected[number]] + [of[f"visible_{count}"][number] for of in (tile, theirs)]
            shares = [f"{cell:,} ({100 * (cell / cells[0] - 1):+.4f} %)" for cell in cells[1:]]
            lines.append(f"| {name}, {count} cameras | {cells[0]:,} | {' | '.join(shares)} |")

    def row(name, stored, cell):
        lines.append(f"| {name} | {stored} | {cell(tile)} | {cell(theirs)} |")

    row("hit pixels, 100 maps", "28,419,707", lambda of: f"{of['hits']:,}")
    row("Σz, m", "2,445,414,559.84", lambda of: f"{of['sum_z_m']:,.2f}")
    row("pixels of uav_002, street_000 off by > 1 mm", "0, 0", lambda of: ", ".join(map(str, of["pixels_off_in_stored_maps"])))
    row("cameras whose hits are off by > 5", "0", lambda of: sum(off > 5 for off in of["hits_off_per_camera"]))
    row("hits of a camera off by at most", "0", lambda of: f"{max(of['hits_off_per_camera']):.0f}")
    row("Σz of a camera off by at most", "0", lambda of: f"{of['sum_z_off_at_most']:.1e}")
    row("Σ abs(nz) of a camera off by at most", "0", lambda of: f"{of['sum_nz_off_at_most']:.1e}")
    lines += ["", FALSE_ROOF]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main(*sys.argv[1:])
