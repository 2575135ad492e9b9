#!/usr/bin/env python3
"""Makes the pictures of "What an error looks like" in the guide.

    python3 docs/figures/errors.py PROGRAM [--work FOLDER]

One simulated town of three views (seed 47, the next prime after the seeds of the other figures, chosen before anything was
seen) is damaged in one way for each picture, and the surface model of the damaged images is compared with the exact one.
Heights are shaded, errors are red where the surface is too high and blue where it is too low, voids are lilac.
Needs numpy, rasterio, matplotlib.
"""
import argparse
import pathlib
import shutil
import subprocess
import sys

import matplotlib
import numpy as np
import rasterio

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.colors import LightSource  # noqa: E402

FIGURES = pathlib.Path(__file__).resolve().parent
SEED, SIZE_M, GSD_M = 47, 260, 0.5
# Wave of the jitter: lines, pixels. A line of a satellite takes a tenth of a millisecond, so that these are some tens of hertz.
JITTER_LINES, JITTER_PX = 160, 1.5
ERROR_M = 3.0
LILAC = (0.78, 0.70, 0.90)


def run(*words):
    return subprocess.run([str(word) for word in words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def change(source, target, work):
    """Copies an image with its RPC and works on its pixels."""
    shutil.copyfile(source, target)
    with rasterio.open(target, "r+") as image:
        pixels = work(image.read(1).astype(float))
        image.write(np.clip(np.rint(pixels), 0, np.iinfo(image.dtypes[0]).max).astype(image.dtypes[0]), 1)


def shifted(pixels, shifts):
    """Moves each line to the right by its shift."""
    columns = np.arange(pixels.shape[1])
    return np.stack([np.interp(columns - shift, columns, line) for line, shift in zip(pixels, shifts)])


def disc(shape, centre, radius):
    rows, columns = np.indices(shape)
    return (rows - centre[0] * shape[0]) ** 2 + (columns - centre[1] * shape[1]) ** 2 < (radius * shape[0]) ** 2


def surface(program, images, folder, *options):
    done = run(program, "dsm", *images, "-o", folder, "--gsd", GSD_M, "--overwrite", "--progress", "none", *options)
    if done.returncode == 2:
        sys.exit(f"{folder.name}: {done.stderr}")
    with rasterio.open(folder / "dsm/dsm.tif") as file:
        return file.read(1, masked=True).filled(np.nan), file.transform


def on_grid(heights, transform, truth, truth_transform):
    """Returns the truth at the cells of a surface."""
    rows, columns = np.indices(heights.shape)
    x, y = transform * (columns + 0.5, rows + 0.5)
    column, row = ~truth_transform * (x, y)
    row, column = np.floor(row).astype(int), np.floor(column).astype(int)
    inside = (row >= 0) & (column >= 0) & (row < truth.shape[0]) & (column < truth.shape[1])
    out = np.full(heights.shape, np.nan)
    out[inside] = truth[row[inside], column[inside]]
    return out


def painted(values, colours):
    colours = colours[..., :3].copy()
    colours[np.isnan(values)] = LILAC
    return colours


def picture(name, heights, error):
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.7), layout="constrained")
    filled = np.where(np.isnan(heights), np.nanmedian(heights), heights)
    shade = LightSource(315, 45).shade(filled, plt.cm.gist_earth, dx=GSD_M, dy=GSD_M, vert_exag=1, blend_mode="soft")
    axes[0].imshow(painted(heights, shade))
    axes[0].set_title("the surface model", fontsize=9)
    axes[1].imshow(painted(error, plt.cm.RdBu_r(np.clip(error / ERROR_M, -1, 1) / 2 + 0.5)))
    axes[1].set_title("its error", fontsize=9)
    bar = figure.colorbar(
        plt.cm.ScalarMappable(plt.Normalize(-ERROR_M, ERROR_M), "RdBu_r"), ax=axes[1], fraction=0.046, pad=0.02
    )
    bar.set_label("m", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    for axis in axes:
        axis.set_xticks([])
        axis.set_yticks([])
    figure.savefig(FIGURES / f"error_{name}.webp", dpi=110, pil_kwargs={"quality": 80})
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("--work", type=pathlib.Path, default=pathlib.Path("out/errors"))
    arguments = parser.parse_args()
    work, program = arguments.work, arguments.program
    work.mkdir(parents=True, exist_ok=True)
    scene = work / "town"
    options = ["--seed", SEED, "--size", SIZE_M, "--gsd", GSD_M, "--views", 3, "--overwrite"]
    done = run(program, "simulate", "town", "-o", scene, *options)
    if done.returncode:
        sys.exit(done.stderr)
    views = [scene / f"view_{number}.tif" for number in (1, 2, 3)]
    with rasterio.open(scene / "truth/dsm.tif") as file:
        truth, truth_transform = file.read(1, masked=True).filled(np.nan), file.transform

    def damaged(name, *works, pair=False):
        """Makes the surface of images of which each has been worked on."""
        folder = work / name
        folder.mkdir(exist_ok=True)
        images = []
        for view, one in zip(views, works):
            images.append(folder / view.name)
            change(view, images[-1], one)
        return surface(program, images[: 2 if pair else 3], folder / "out")

    def same(pixels):
        return pixels

    def show(name, heights, transform):
        expected = on_grid(heights, transform, truth, truth_transform)
        rows, columns = np.nonzero(np.isfinite(expected))
        known = slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)
        heights, error = heights[known], (heights - expected)[known]
        picture(name, heights, error)
        print(f"{name:10} median error {np.nanmedian(error):8.2f} m, void {np.mean(np.isnan(heights)):.0%}")

    show("none", *surface(program, views, work / "none"))

    # Heights above the geoid taken for heights above the ellipsoid.
    show("datum", *surface(program, views, work / "datum", "--vertical", "egm96"))

    # The RPC of one image is off along the line of sight: two views, pointing as it is.
    def moved(pixels):
        return np.roll(pixels, 6, axis=0)

    folder = work / "rpc"
    folder.mkdir(exist_ok=True)
    images = [folder / view.name for view in views[:2]]
    change(views[0], images[0], same)
    change(views[1], images[1], moved)
    show("rpc", *surface(program, images, folder / "out", "--no-pointing"))

    # The platform of one image shakes.
    def shaken(pixels):
        wave = JITTER_PX * np.sin(2 * np.pi * np.arange(pixels.shape[0]) / JITTER_LINES)
        return np.stack([np.interp(np.arange(pixels.shape[0]) - wave, np.arange(pixels.shape[0]), column)
                         for column in shifted(pixels, wave).T]).T

    show("jitter", *damaged("jitter", same, shaken, pair=True))

    # A field without texture: snow, sand, a saturated roof.
    def blank(pixels):
        out = pixels.copy()
        out[disc(pixels.shape, (0.5, 0.5), 0.2)] = np.percentile(pixels, 99.5)
        return out

    show("texture", *damaged("texture", blank, blank, blank))

    # Water: every view sees other waves.
    def waves(seed):
        random = np.random.default_rng(SEED + seed)

        def work_on(pixels):
            out = pixels.copy()
            lake = disc(pixels.shape, (0.5, 0.5), 0.2)
            out[lake] = np.percentile(pixels, 10) * random.normal(1.0, 0.12, lake.sum())
            return out

        return work_on

    show("water", *damaged("water", waves(1), waves(2), waves(3)))

    # Two views: whatever a wall hides from one of them is filled, and roofs reach out.
    show("overreach", *surface(program, views[:2], work / "overreach", "--preset", "fast", "--fill", "all"))


if __name__ == "__main__":
    main()
