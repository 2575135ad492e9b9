#!/usr/bin/env python3
"""How well the mesh of trained splats shows one building: a simulated town, one of its buildings, through the whole chain.

For each seed, `skysweep simulate --flight` makes a town without trees on level ground, and pictures from all around.
Masks of a city model know neither trees nor terrain: walls of an LoD2 reach below sloping ground, and nothing hides them. The building is the one nearest to the middle of the town. `skysweep priors` makes the maps of
its LoD2, without chimneys and dormers; the other buildings only hide it. `skysweep train` makes splats of it alone with
the priors, of it alone without them, and of the whole scene from the points of a reconstruction, which is plain 2DGS.
`skysweep mesh` makes the mesh of each under the masks of the building.

The truth is the exact surface of the building where a camera sees it, details included: one point in each cube of 4 cm,
so that distances from it are up to 2 cm too large. The Chamfer distance is half the sum of the mean distance from the
mesh to the truth and that from the truth to the mesh, over the whole surface of both, not squared, nothing left out.

    python3 benches/splats/building.py target/release/skysweep [--seeds 1 2 3] [--work DIR]

Needs Python alone. Writes benches/results/splat_building.json and splat_building.md.
"""
import argparse
import json
import math
import pathlib
import re
import struct
import subprocess
import tempfile

RESULTS = pathlib.Path(__file__).resolve().parents[1] / "results"
SIZE_M, CAMERAS, TRUTH_SPACING_M = 100, 32, 0.04
# The details of a building stand within its walls; eaves reach out less than this.
AROUND_M = 0.5
ITERATIONS, SHRINK = 600, 2
VOXEL_M = 0.1
# Name, dataset, priors, budget of splats.
SETTINGS = [
    ("building alone, both priors", "only", "both", 20_000),
    ("building alone, no priors", "only", "none", 20_000),
    ("whole scene, no priors", "cameras", "none", 100_000),
]


def run(*words):
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL)


def flat(nested):
    for part in nested:
        if isinstance(part, list):
            yield from flat(part)
        else:
            yield part


def middle_of(cameras):
    """The mean place of the cameras: the middle of the town."""
    lines = [line.split() for line in (cameras / "images.txt").read_text().splitlines()]
    centres = []
    for words in lines:
        if len(words) != 10 or not words[9].endswith(".png"):
            continue
        w, x, y, z, *t = map(float, words[1:8])
        rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
        centres.append([-sum(rows[k][i] * t[k] for k in range(3)) for i in (0, 1)])
    return [sum(c[i] for c in centres) / len(centres) for i in (0, 1)]


def hull(points):
    """The convex hull, counter-clockwise."""
    cross = lambda o, a, b: (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
    halves = []
    for ordered in (sorted(set(points)), sorted(set(points), reverse=True)):
        half = []
        for point in ordered:
            while len(half) > 1 and cross(half[-2], half[-1], point) <= 0:
                half.pop()
            half.append(point)
        halves += half[:-1]
    return halves


def alone(scene, model_file):
    """Writes the city model with one building: the others only hide it. Returns the hull of its footprint."""
    model = json.loads((scene / "truth/buildings.city.json").read_text())
    scale, shift = model["transform"]["scale"], model["transform"]["translate"]
    middle = middle_of(scene / "cameras/sparse/0")
    footprints = {}
    for name, thing in model["CityObjects"].items():
        if thing["type"] == "Building" and thing.get("geometry"):
            ids = set(flat([geometry["boundaries"] for geometry in thing["geometry"]]))
            corners = [[model["vertices"][i][k] * scale[k] + shift[k] for k in (0, 1)] for i in ids]
            footprints[name] = hull([tuple(corner) for corner in corners])
    away = lambda name: math.dist(middle, [sum(c[k] for c in footprints[name]) / len(footprints[name]) for k in (0, 1)])
    chosen = min(footprints, key=away)
    for name, thing in model["CityObjects"].items():
        if name != chosen:
            thing["type"] = "OtherConstruction"
            for key in ("parents", "children"):
                thing.pop(key, None)
    model_file.write_text(json.dumps(model))
    return footprints[chosen]


def cut_out(cloud, footprint, out):
    """Writes the points of a cloud over a footprint, with room for eaves."""
    data = cloud.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    header = data[:end].decode()
    x0, y0, _ = map(float, re.search(r"origin (\S+) (\S+) (\S+)", header).groups())
    edges = []
    for (ax, ay), (bx, by) in zip(footprint, footprint[1:] + footprint[:1]):
        length = math.hypot(bx - ax, by - ay)
        nx, ny = (by - ay) / length, (ax - bx) / length
        edges.append((nx, ny, nx * (ax - x0) + ny * (ay - y0) + AROUND_M))
    size = 27
    kept = bytearray()
    for at in range(end, len(data), size):
        x, y = struct.unpack_from("<2f", data, at)
        if all(nx * x + ny * y <= most for nx, ny, most in edges):
            kept += data[at:at + size]
    header = re.sub(r"element vertex \d+", f"element vertex {len(kept) // size}", header)
    out.write_bytes(header.encode() + kept)


def made(program, work, seed, relief_m):
    """The town, the dataset of its building and the truth of it."""
    work.mkdir(parents=True, exist_ok=True)
    template = subprocess.run([program, "simulate", "town", "--template"], check=True, capture_output=True, text=True).stdout
    for key, value in [("trees_per_ha", 0.0), ("relief_m", relief_m), ("size_m", float(SIZE_M)), ("gsd_m", 1.0), ("views", 2), ("seed", seed)]:
        template, count = re.subn(rf"(?m)^{key} = .*", f"{key} = {value}", template)
        assert count == 1, key
    (work / "in.toml").write_text(template)
    scene = work / "scene"
    run(program, "simulate", work / "in.toml", "--flight", CAMERAS, "--flight-spacing", TRUTH_SPACING_M, "-o", scene,
        "--overwrite", "--progress", "none")
    footprint = alone(scene, work / "building.city.json")
    cut_out(scene / "truth/flight_buildings.ply", footprint, work / "truth.ply")
    run(program, "priors", work / "building.city.json", "--cameras", scene / "cameras", "--all-objects", "--points", 8000,
        "--previews", 0, "-o", work / "only", "--overwrite")
    return scene


def measure(program, work, seed, names, relief_m):
    scene = made(program, work, seed, relief_m)
    rows = []
    for name, dataset, priors, budget in SETTINGS:
        if names and name not in names:
            continue
        out = work / name.replace(" ", "_").replace(",", "")
        folder = scene / "cameras" if dataset == "cameras" else work / dataset
        run(program, "train", folder, "--pictures", scene / "cameras/images", "--priors", priors, "--budget", budget,
            "--iterations", ITERATIONS, "--shrink", SHRINK, "--hold-out", 8, "-o", out, "--overwrite", "--progress", "none")
        rows.append(judged(program, work, seed, name, out))
        print(rows[-1], flush=True)
    return rows


def judged(program, work, seed, name, out):
    trained = json.loads((out / "report.json").read_text())
    run(program, "mesh", work / "only", "--splats", out / "splats.ply", "--masked", "--shrink", SHRINK,
        "--voxel", VOXEL_M, "--reference",
        work / "truth.ply", "-o", out / "mesh.ply", "--overwrite", "--progress", "none")
    result = json.loads((out / "mesh.report.json").read_text())["comparison"]["result"]
    scores = {score["threshold_m"]: score for score in result["scores"]}
    held = [view["psnr_db"] for view in trained["views"] if view["held_out"]]
    return {
        "seed": seed, "name": name, "splats": trained["splats_after"], "seconds": trained["seconds"],
        "held_out_psnr_db": sum(held) / len(held), "chamfer_m": result["chamfer_m"],
        "accuracy_m": result["accuracy"]["mean_m"], "accuracy_median_m": result["accuracy"]["median_m"],
        "completeness_m": result["completeness"]["mean_m"], "completeness_median_m": result["completeness"]["median_m"],
        "precision_0.1": scores[0.1]["precision"], "recall_0.1": scores[0.1]["recall"],
        "hausdorff_m": result["hausdorff_m"],
    }


def table(rows, seeds):
    out = [
        "# The mesh of one building\n",
        f"Written by `benches/splats/building.py`: simulated towns of {SIZE_M} m without trees on level ground, {CAMERAS} pictures of {640 // SHRINK} × {480 // SHRINK} pixels",
        "from all around (0.2 to 0.4 m a pixel), the building nearest to the middle, of which the model is the exact LoD2 without",
        f"chimneys and dormers; {ITERATIONS} iterations, at most 20,000 splats (100,000 of the whole scene), voxels of {VOXEL_M} m. The truth is the exact surface of the building with its details, where a",
        f"camera sees it, one point in each cube of {TRUTH_SPACING_M} m. The Chamfer distance is half the sum of both mean distances, over",
        "the whole surfaces, outliers included. PSNR is that of the held-out views, under the masks or of the whole picture.\n",
        "| seed | splats of | splats | Chamfer, m | mesh to truth, m (median) | truth to mesh, m (median) | right within 0.1 m | complete within 0.1 m | held-out PSNR, dB | s |",
        "|--:|---|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for r in rows:
        out.append(
            f"| {r['seed']} | {r['name']} | {r['splats']} | {r['chamfer_m']:.3f} | {r['accuracy_m']:.3f} ({r['accuracy_median_m']:.3f}) "
            f"| {r['completeness_m']:.3f} ({r['completeness_median_m']:.3f}) | {100 * r['precision_0.1']:.1f} % "
            f"| {100 * r['recall_0.1']:.1f} % | {r['held_out_psnr_db']:.1f} | {r['seconds']:.0f} |")
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--work", type=pathlib.Path)
    parser.add_argument("--relief", type=float, default=0.0, help="relief of the ground, metres (6.5 in the preset)")
    parser.add_argument("--only", nargs="+", help="names of settings; no results are written then")
    args = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in args.seeds:
            rows += measure(args.program.resolve(), (args.work or pathlib.Path(folder)) / str(seed), seed, args.only,
                            args.relief)
    if args.only:
        return
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "splat_building.json").write_text(json.dumps(rows, indent=1) + "\n")
    (RESULTS / "splat_building.md").write_text(table(rows, args.seeds))


if __name__ == "__main__":
    main()
