#!/usr/bin/env python3
"""Splats that learn from real photographs: Sceaux castle, eleven photographs with a COLMAP model (shared/data/photos).

Every eighth photograph in the order of the names is held out, as LLFF splits: the first and the ninth. Much of the first
is a tree that no other photograph shows, so that the eighth alone is held out in the other runs. `skysweep train` makes splats with the
default recipe, and with the settings that differ from it in one thing. The held-out photographs are written beside
what the splats show of them.

    python3 benches/splats/photographs.py target/release/skysweep [--runs NAME ...] [--data DIR] [--work DIR]

Runs that are not named keep their earlier results. Needs Python alone. Writes benches/results/photographs.json and
photographs.md.
"""
import argparse
import json
import os
import pathlib
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
RESULTS = ROOT / "benches/results"
SCENE = "photos/sceaux_castle"
EIGHTH = ["--hold-out-view", "100_7107.jpg"]
QUARTER = ["--shrink", "4", "--iterations", "1000"]
# Name, what differs, options.
RUNS = [
    ("default", "quarter pictures, 1,000 iterations, every eighth by name from the first on (LLFF)", QUARTER),
    ("eighth", "the same, the eighth photograph held out", QUARTER + EIGHTH),
    ("distortion", "eighth, with the distortion of inverse depths (10)", QUARTER + EIGHTH + ["--weight", "distortion=10"]),
    ("absolute", "eighth, absolute colour differences alone", QUARTER + EIGHTH + ["--weight", "similarity=0", "--weight", "absolute=1"]),
    ("full", "whole pictures, default number of iterations", []),
]


def measure(program, scene, work, name, options):
    out = work / name
    words = [program, "train", scene, *options, "--threads", "2", "-o", out, "--overwrite", "--progress", "none"]
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL)
    report = json.loads((out / "report.json").read_text())
    held = [view for view in report["views"] if view["held_out"]]
    mean = lambda key: sum(view[key] for view in held) / len(held)
    return {
        "name": name, "options": options, "iterations": report["settings"]["iterations"],
        "shrink": report["settings"]["shrink"], "splats": report["splats_after"], "seconds": report["seconds"],
        "load": os.getloadavg()[1], "psnr_db": mean("psnr_db"), "ssim": mean("ssim"), "psnr_before_db": mean("psnr_before_db"),
        "views": [{key: view[key] for key in ("name", "psnr_db", "ssim")} for view in held],
    }


def table(rows):
    out = [
        "# Splats of real photographs\n",
        "Written by `benches/splats/photographs.py`: Sceaux castle, eleven photographs of about 1,000 × 670 pixels with a COLMAP",
        "model (4,941 points). LLFF's rule holds out the first and the ninth. Much of the first is a tree that no other photograph",
        "shows. Exposures differ: what is missing of the eighth is mostly the brightness of its sky. Seconds are those of the iterations",
        "on two threads, beside the load of the machine over the last five minutes (two cores, shared).\n",
        "| run | shrink | iterations | splats | held-out PSNR, dB | SSIM | by photograph, dB | s | load |",
        "|---|--:|--:|--:|--:|--:|---|--:|--:|",
    ]
    for row in rows:
        what = next(what for name, what, _ in RUNS if name == row["name"])
        each = ", ".join(f"{view['name'].removesuffix('.jpg')} {view['psnr_db']:.2f}" for view in row["views"])
        out.append(
            f"| {row['name']}: {what} | {row['shrink']} | {row['iterations']} | {row['splats']} | {row['psnr_db']:.2f} "
            f"| {row['ssim']:.3f} | {each} | {row['seconds']:.0f} | {row['load']:.1f} |")
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--runs", nargs="+", choices=[name for name, _, _ in RUNS], default=[name for name, _, _ in RUNS])
    parser.add_argument("--data", type=pathlib.Path, default=ROOT.parent / "shared/data")
    parser.add_argument("--work", type=pathlib.Path)
    arguments = parser.parse_args()
    file = RESULTS / "photographs.json"
    rows = {row["name"]: row for row in json.loads(file.read_text())["rows"]} if file.is_file() else {}
    with tempfile.TemporaryDirectory() as scratch:
        work = arguments.work or pathlib.Path(scratch)
        for name, _, options in RUNS:
            if name in arguments.runs:
                rows[name] = measure(arguments.program.resolve(), arguments.data / SCENE, work, name, options)
                print(rows[name], flush=True)
    ordered = [rows[name] for name, _, _ in RUNS if name in rows]
    file.write_text(json.dumps({"scene": SCENE, "rows": ordered}, indent=1) + "\n")
    (RESULTS / "photographs.md").write_text(table(ordered))


if __name__ == "__main__":
    main()
