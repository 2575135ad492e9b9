"""Judges two skysweep binaries with the evaluators of ../shared/tools, and draws what changed.

usage: judged.py OLD_COMMIT OLD_BINARY NEW_BINARY    (needs numpy, rasterio, scipy, Pillow)

Runs both with default options and with --fill none on the scenes of ../shared/data that have a reference, then writes
benches/results/judged.md (numbers) and docs/figures/before_after.png (hillshades of sim/highrise and the source of each cell).
"""
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import rasterio
from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared"
JAX = SHARED / "data/stereo/jax_068"
SIM = SHARED / "data/sim"
# Colours of dsm/source.tif: observed, filled by each rule, void by each cause.
SOURCES = {
    1: (200, 200, 200),
    2: (70, 130, 220),
    3: (120, 190, 250),
    4: (240, 170, 60),
    10: (220, 60, 60),
    11: (150, 60, 150),
    12: (90, 30, 30),
}


def scenes():
    """Yields name, images, reference and folder of the simulated scene, if it is one."""
    for name in ("town", "suburb", "highrise"):
        folder = SIM / name
        yield f"sim/{name}", sorted(folder.glob("view_*.tif")), folder / "truth_dsm.tif", folder
    for numbers in ("001 003", "001 003 004", "002 005 006", "001 002 003 004 005 006 007"):
        images = [sorted((JAX / "images").glob(f"*{n}*.tif"))[0] for n in numbers.split()]
        label = "7 views" if len(images) == 7 else "-".join(numbers.split())
        yield f"JAX_068 {label}", images, JAX / "truth/JAX_068_DSM_georef.tif", None


def judge(tool, *arguments):
    command = [sys.executable, "-W", "ignore", SHARED / "tools" / tool, *arguments]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def run(binary, images, fill, out):
    command = [binary, "dsm", *images, "-o", out, "--overwrite", "-q", "--threads", "1"]
    subprocess.run([*command, "--fill", "none"] if fill == "none" else command, check=True)
    return out / "dsm/dsm.tif"


def row(binary, images, reference, folder, out):
    observed = judge("evaluate.py", run(binary, images, "none", out), reference, "--json")["all"]
    dsm = run(binary, images, "default", out)
    filled = judge("evaluate.py", dsm, reference, "--json")["all"]
    cells = [observed["coverage"], observed["c1"], observed["mae"], filled["coverage"], filled["c1"], filled["mae"]]
    if folder:
        lost = judge("lost.py", dsm, folder)
        cells += [f"{lost['lost']} of {lost['buildings']}", lost["trees_right"]]
    else:
        cells += ["–", "–"]
    return cells


def shade(path, window):
    with rasterio.open(path) as dataset:
        heights = dataset.read(1, masked=True).filled(np.nan).astype(float)[window]
    down, right = np.gradient(heights)
    grey = np.clip(140 + 25 * (down + right), 20, 255)
    rgb = np.repeat(np.nan_to_num(grey, nan=0)[..., None], 3, axis=2).astype(np.uint8)
    rgb[~np.isfinite(heights)] = (60, 0, 0)
    return rgb


def picture(old, new, truth):
    with rasterio.open(truth) as t, rasterio.open(new / "dsm/dsm.tif") as n:
        row0, col0 = n.index(t.bounds.left, t.bounds.top)
        inside = (slice(row0, row0 + t.height), slice(col0, col0 + t.width))
        size = (t.width, t.height)
    with rasterio.open(new / "dsm/source.tif") as dataset:
        codes = dataset.read(1)[inside]
    source = np.zeros((*codes.shape, 3), np.uint8)
    for code, colour in SOURCES.items():
        source[codes == code] = colour
    whole = (slice(None), slice(None))
    with rasterio.open(old / "dsm/dsm.tif") as o, rasterio.open(truth) as t:
        r, c = o.index(t.bounds.left, t.bounds.top)
        before = (slice(r, r + t.height), slice(c, c + t.width))
    parts = [shade(old / "dsm/dsm.tif", before), shade(new / "dsm/dsm.tif", inside), shade(truth, whole), source]
    strip = np.concatenate([np.asarray(Image.fromarray(p).resize(size)) for p in parts], axis=1)
    small = Image.fromarray(strip).resize((strip.shape[1] * 3 // 4, strip.shape[0] * 3 // 4), Image.LANCZOS)
    return small.quantize(64, dither=Image.Dither.NONE)


def main(commit, old, new):
    header = "| scene | version | observed: coverage % | < 1 m % | MAE m | filled: coverage % | < 1 m % | MAE m | buildings lost | trees right % |"
    lines = [
        f"Made by `benches/peers/judged.py` with the evaluators of `../shared/tools`. Before is commit {commit}, after is {head_commit()}.",
        "Default preset, one thread. Observed surfaces are made with `--fill none`, filled ones with the default fill.",
        "",
        header,
        "|---" * 10 + "|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for name, images, reference, scene in scenes():
            for version, binary in (("before", old), ("after", new)):
                out = pathlib.Path(folder) / f"{name.replace('/', '-')}-{version}"
                cells = row(binary, images, reference, scene, out)
                shown = [f"{c:.2f}" if isinstance(c, float) else str(c) for c in cells]
                lines.append(f"| {name} | {version} | " + " | ".join(shown) + " |")
        outs = [pathlib.Path(folder) / f"sim-highrise-{version}" for version in ("before", "after")]
        picture(*outs, SIM / "highrise/truth_dsm.tif").save(ROOT / "docs/figures/before_after.png", optimize=True)
    (ROOT / "benches/results/judged.md").write_text("\n".join(lines) + "\n")


def head_commit():
    return subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], check=True, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    commit, *binaries = sys.argv[1:4]
    main(commit, *(str(pathlib.Path(binary).resolve()) for binary in binaries))
