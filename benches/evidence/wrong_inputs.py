"""Wrong inputs that look right, made from good scenes, and good scenes: is every wrong one refused or warned about, and no good one?

    python benches/evidence/wrong_inputs.py BINARY --wrong SCENE... --good SCENE... [--cases 40] [--out benches/results]

A SCENE is a folder with images `view_1.tif`, `view_2.tif`, ... that hold their RPCs, or a comma-separated list of images. Needs numpy and
rasterio. Writes evidence.json and evidence.md. Every case is drawn from its number alone, so that a second run makes the same files.
"""
import argparse
import copy
import glob
import itertools
import json
import os
import re
import subprocess
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import rasterio
from rasterio.io import MemoryFile

warnings.filterwarnings("ignore", category=rasterio.errors.NotGeoreferencedWarning)
METRES_PER_DEGREE = 111_000.0
# Warnings about other things than images and pointing, which good scenes may have. They do not tell a wrong input.
OTHER_WARNINGS = ("cells have an observed height", "of the heights, filled ones included", "nearly the same line",
                  "of the cells are filled from their surroundings", "of the cells lie between roofs")


def read(path):
    with rasterio.open(path) as source:
        return source.read(1), source.rpcs


def write(path, pixels, rpc):
    height, width = pixels.shape
    with rasterio.open(path, "w", driver="GTiff", width=width, height=height, count=1, dtype=pixels.dtype) as target:
        target.write(np.ascontiguousarray(pixels), 1)
        target.rpcs = rpc


def as_type(values, like):
    limits = np.iinfo(like.dtype) if like.dtype.kind in "ui" else np.finfo(like.dtype)
    return np.clip(np.rint(values), limits.min, limits.max).astype(like.dtype)


def jpeg(pixels):
    low, high = np.percentile(pixels, [0.1, 99.9])
    grey = np.clip((pixels - low) / (high - low) * 255, 0, 255).astype(np.uint8)
    height, width = grey.shape
    with MemoryFile() as memory:
        with memory.open(driver="JPEG", width=width, height=height, count=1, dtype="uint8", quality=80) as target:
            target.write(grey, 1)
        with memory.open() as source:
            return as_type(source.read(1) / 255.0 * (high - low) + low, pixels)


def halved(pixels):
    height, width = pixels.shape[0] // 2, pixels.shape[1] // 2
    return as_type(pixels[:2 * height, :2 * width].reshape(height, 2, width, 2).mean((1, 3)), pixels)


def moved(rpc, metres, rng):
    rpc, azimuth = copy.deepcopy(rpc), rng.uniform(0, 2 * np.pi)
    rpc.lat_off += metres * np.cos(azimuth) / METRES_PER_DEGREE
    rpc.long_off += metres * np.sin(azimuth) / METRES_PER_DEGREE / np.cos(np.radians(rpc.lat_off))
    return rpc


class Views:
    """Pixels and RPCs of a scene; `one` is the image that a change is for, and `other` another one."""

    def __init__(self, files, rng, foreign):
        self.pixels, self.rpcs = map(list, zip(*(read(path) for path in files)))
        self.rng, self.foreign = rng, foreign
        self.one = int(rng.integers(len(files)))
        self.other = (self.one + 1) % len(files)

    def every(self, change):
        self.pixels = [change(pixels) for pixels in self.pixels]

    def change(self, change):
        self.pixels[self.one] = change(self.pixels[self.one])

    def copied(self, change):
        self.pixels[self.one] = change(self.pixels[self.other])

    def cropped(self, least, most):
        x, y = self.rng.integers(least, most, 2)
        return lambda pixels: pixels[y:, x:]

    def noisy(self):
        return lambda p: as_type(p + self.rng.normal(0, 0.03 * p.std() + 3, p.shape), p)

    def move(self, metres):
        self.rpcs[self.one] = moved(self.rpcs[self.one], metres, self.rng)

    def exchange(self):
        self.rpcs = self.rpcs[1:] + self.rpcs[:1]

    def take_foreign(self):
        self.rpcs[self.one] = self.foreign


CHANGES = {
    "all turned by 180°": lambda v: v.every(lambda p: p[::-1, ::-1]),
    "all mirrored": lambda v: v.every(lambda p: p[:, ::-1]),
    "all flipped": lambda v: v.every(lambda p: p[::-1]),
    "all of half the size": lambda v: v.every(halved),
    "one turned by 180°": lambda v: v.change(lambda p: p[::-1, ::-1]),
    "one mirrored": lambda v: v.change(lambda p: p[:, ::-1]),
    "one of half the size": lambda v: v.change(halved),
    "one cropped": lambda v: v.change(v.cropped(20, 120)),
    "copy": lambda v: v.copied(lambda p: p.copy()),
    "copy as JPEG": lambda v: v.copied(jpeg),
    "copy ± 1": lambda v: v.copied(lambda p: as_type(p + v.rng.integers(-1, 2, p.shape).astype(float), p)),
    "copy with a gain": lambda v: v.copied(lambda p: as_type(0.8 * p + 20, p)),
    "copy with noise": lambda v: v.copied(v.noisy()),
    "copy cropped": lambda v: v.copied(v.cropped(8, 60)),
    "RPCs exchanged": lambda v: v.exchange(),
    "RPC of another scene": lambda v: v.take_foreign(),
    "RPC 10 m off": lambda v: v.move(10.0),
    "RPC 30 m off": lambda v: v.move(30.0),
    "RPC 60 m off": lambda v: v.move(60.0),
}


def files_of(scene):
    if "," in scene:
        return scene.split(",")
    names = glob.glob(f"{scene}/view_*.tif")
    return sorted(names, key=lambda name: int(re.findall(r"\d+", Path(name).stem)[-1]))


def about_images(outcome):
    return [text for text in outcome["warnings"] if not any(other in text for other in OTHER_WARNINGS)]


def run(binary, files, preset, folder):
    begun = time.time()
    command = [binary, "dsm", *files, "-o", f"{folder}/out", "--preset", preset]
    done = subprocess.run(command, capture_output=True, text=True)
    report = f"{folder}/out/report/report.json"
    outcome = {"exit": done.returncode, "seconds": round(time.time() - begun, 1), "warnings": []}
    if os.path.exists(report):
        with open(report) as file:
            report = json.load(file)
        outcome["warnings"] = report["warnings"]
        outcome["residual_px"] = report["pointing"]["residual_after_px"]
        outcome["observed"] = report["surface"]["observed"] / report["surface"]["cells"]
    elif done.returncode:
        outcome["error"] = done.stderr.strip().splitlines()[:1]
    return outcome


def wrong_cases(scenes, count):
    """The first `count` of all changes, with views, preset and scene that go around at different paces."""
    views, presets = itertools.cycle([2, 3, 5]), itertools.cycle(["fast", "balanced"])
    names = list(CHANGES)
    for number in range(count):
        if number and number % len(names) == 0:
            # Another pace, or a change would always meet the same number of views.
            next(views)
        scene = scenes[number % len(scenes)]
        foreign = scenes[(number + 1) % len(scenes)]
        yield number, names[number % len(names)], min(next(views), len(files_of(scene))), next(presets), scene, foreign


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("binary")
    arguments.add_argument("--wrong", nargs="+", default=[], metavar="SCENE")
    arguments.add_argument("--good", nargs="+", default=[], metavar="SCENE")
    arguments.add_argument("--cases", type=int, default=40)
    arguments.add_argument("--out", default="benches/results")
    given = arguments.parse_args()
    rows = []
    for number, change, count, preset, scene, foreign in wrong_cases(given.wrong, given.cases if given.wrong else 0):
        with tempfile.TemporaryDirectory() as folder:
            rpc = read(files_of(foreign)[0])[1]
            views = Views(files_of(scene)[:count], np.random.default_rng(number), rpc)
            CHANGES[change](views)
            paths = [f"{folder}/view_{i}.tif" for i in range(1, count + 1)]
            for path, pixels, rpc in zip(paths, views.pixels, views.rpcs):
                write(path, pixels, rpc)
            outcome = run(given.binary, paths, preset, folder)
        told = outcome["exit"] != 0 or bool(about_images(outcome))
        rows.append({"kind": "wrong", "case": change, "views": count, "preset": preset, "scene": Path(scene).name, "as_it_should": told, **outcome})
        print(rows[-1], flush=True)
    for number, scene in enumerate(given.good):
        with tempfile.TemporaryDirectory() as folder:
            outcome = run(given.binary, files_of(scene), ["fast", "balanced"][number % 2], folder)
        rows.append({"kind": "good", "case": "as delivered", "views": len(files_of(scene)), "preset": ["fast", "balanced"][number % 2],
                     "scene": Path(scene.split(",")[0]).parent.name + "/" + Path(scene.split(",")[0]).name if "," in scene else Path(scene).name,
                     "as_it_should": outcome["exit"] == 0 and not about_images(outcome), **outcome})
        print(rows[-1], flush=True)
    os.makedirs(given.out, exist_ok=True)
    with open(f"{given.out}/evidence.json", "w") as file:
        json.dump(rows, file, indent=1, ensure_ascii=False)
    with open(f"{given.out}/evidence.md", "w") as file:
        file.write("# Wrong inputs that look right, and good ones\n\nWritten by `benches/evidence/wrong_inputs.py`.\n\n")
        for kind, text in (("wrong", "refused or warned about"), ("good", "without a warning about images or pointing")):
            of = [row for row in rows if row["kind"] == kind]
            file.write(f"- {sum(row['as_it_should'] for row in of)} of {len(of)} {kind} inputs are {text}.\n")
        file.write("\n| input | scene | views | preset | exit | told | residual, px |\n|---|---|---|---|---|---|---|\n")
        for row in rows:
            told = (about_images(row) or row.get("error") or ["nothing"])[0].replace("|", "/")[:90]
            residual = row.get("residual_px")
            residual = "" if residual is None else f"{residual:.2f}"
            file.write(f"| {row['case']} | {row['scene']} | {row['views']} | {row['preset']} | {row['exit']} | {told} | {residual} |\n")


if __name__ == "__main__":
    main()
