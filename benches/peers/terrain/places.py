"""The places of the comparison: scenes made anew, the ISPRS filter test, and LiDAR. See compare.py."""
import importlib.util
import os
import pathlib
import subprocess
import sys

import numpy as np
import programs
import rasterio
from rasterio.transform import from_origin
from rasterio.warp import Resampling, reproject
from scipy import ndimage

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1]))
import dtm  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[3]
SHARED = pathlib.Path(os.environ.get("SKYSWEEP_DATA", ROOT.parent / "shared/data")).parent
# Pixels on a side of the images of a scene. The simulator's own 640 take four times as long.
SIZE_PX = 448
# A cell counts as ground, for a program, when the program's ground lies this close to its height.
KEPT_M = 0.5
# Cells at the border of a truth that are not judged.
MARGIN = 10
OBSERVED, GROUND, BUILDING = 1, 2, 6


def shadow(z, cell_m, elevation, azimuth):
    """The simulator's cells in the sun, by its own formula on slices of the raster, which is ten times faster."""
    size, lit, rise_per_m = z.shape[0], np.ones(z.shape, bool), np.tan(np.radians(elevation))
    across, along = (f(np.radians(azimuth)) / cell_m for f in (np.sin, np.cos))
    reach, steps, step, top = 0, [], 1, z.max() - z.min()
    while step * cell_m * rise_per_m <= top:
        steps.append(step * cell_m)
        step += 1 if step * cell_m < 40 else 2
    reach = int(np.ceil(max(steps, default=0) * max(abs(across), abs(along)))) + 2
    wide, limit = np.pad(z, reach, mode="edge"), z + np.float32(0.05)
    for distance in steps:
        row, column = reach - along * distance, reach + across * distance
        y, x = int(np.floor(row)), int(np.floor(column))
        v, u = np.float32(row - y), np.float32(column - x)
        rows = wide[y:y + size + 1, x:x + size + 1]
        rows = rows[:-1] + v * (rows[1:] - rows[:-1])
        higher = rows[:, :-1] + u * (rows[:, 1:] - rows[:, :-1])
        lit &= higher <= limit + np.float32(distance * rise_per_m)
    return lit


def simulator():
    spec = importlib.util.spec_from_file_location("scenes", SHARED / "tools/scenes.py")
    scenes = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(scenes)
    drawn = scenes.random_scene
    scenes.random_scene = lambda seed: {**drawn(seed), "size": SIZE_PX}
    scenes.shadow = shadow
    return scenes


def made_scene(program, seed, work):
    """The folder of a scene with its images, its truth, and the surface of its images in run/."""
    folder = work / f"scenes/r{seed}"
    if not (folder / "scene.json").exists():
        simulator().main(f"random:{seed}", str(folder))
    if not (folder / "run/report/report.json").exists():
        make_surface(program, sorted(folder.glob("view_*.tif")), folder / "run")
    return folder


def make_surface(program, views, run):
    command = [program, "dsm", *views, "-o", run, "--preset", "balanced", "--overwrite", "--progress", "none", "-q"]
    subprocess.run(command, check=True)


def plain(heights, profile, folder):
    """Writes a surface as every program reads it: with its voids, and with them interpolated. Returns the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    programs.write(folder / "cells.tif", heights, profile)
    programs.write(folder / "filled.tif", programs.interpolated(heights), profile)
    return folder / "cells.tif", folder / "filled.tif"


class Place:
    """A surface, as `skysweep dtm` and the others take it, and the cells at which their ground is judged."""

    def __init__(self, name, ours, heights, profile, folder):
        self.name, self.ours, self.folder = name, ours, folder
        self.cells, self.filled = plain(heights, profile, folder)

    def judged(self, path):
        """The errors of the ground that a program wrote."""
        raise NotImplementedError


def scores(error, at_surface, is_ground, is_object, everywhere=None):
    """Errors at ground cells, and the shares of ground and of objects within KEPT_M of the surface."""
    on_ground, known = error[is_ground], np.isfinite(error)
    out = {"missing": round(float(1 - known[is_ground].mean()), 4)}
    if out["missing"] > 0.5:
        return out | {"failed": "most of the ground has no height"}
    out["ground_rmse_m"] = float(np.sqrt(np.nanmean(on_ground**2)))
    out["ground_mae_m"] = float(np.nanmean(np.abs(on_ground)))
    if everywhere is not None:
        out["all_rmse_m"] = float(np.sqrt(np.nanmean(error[everywhere] ** 2)))
    out["ground_found"] = float((np.abs(at_surface[is_ground]) <= KEPT_M).mean())
    out["objects_kept"] = float((np.abs(at_surface[is_object]) <= KEPT_M).mean()) if is_object.any() else None
    return {key: value if value is None else round(value, 4) for key, value in out.items()}


class FromImages(Place):
    """A surface made of images, placed on a truth by a shift of whole cells and the median."""

    def __init__(self, name, run, top, like, folder):
        heights, profile = dtm.read(run / "dsm/dsm.tif")
        super().__init__(name, run, heights, profile, folder)
        self.top, self.like = top, like
        surface = dtm.on_grid(run / "dsm/dsm.tif", like)
        self.shift = dtm.placement(surface, top)
        self.surface = self.placed(surface) - self.shift[2]
        with rasterio.open(run / "dsm/source.tif") as file:
            source = np.zeros((like["height"], like["width"]), "uint8")
            reproject(rasterio.band(file, 1), source, dst_crs=like["crs"], dst_transform=like["transform"], resampling=Resampling.nearest)
        self.is_observed = (self.placed(source) == OBSERVED) & self.inner(source)
        self.is_reached = dtm.reached(self.surface) & self.inner(source)

    def placed(self, raster):
        return np.roll(raster, (-self.shift[1], -self.shift[0]), (0, 1))

    def inner(self, raster):
        out = np.zeros(raster.shape, bool)
        out[MARGIN:-MARGIN, MARGIN:-MARGIN] = True
        return out

    def on_truth(self, path):
        return self.placed(dtm.on_grid(path, self.like)) - self.shift[2]


class Scene(FromImages):
    """A scene of the simulator: its ground is known under buildings and trees, too."""

    def __init__(self, program, seed, work):
        scene = made_scene(program, seed, work)
        top, like = dtm.read(scene / "truth_dsm.tif")
        super().__init__(f"random:{seed}", scene / "run", top, like, work / f"made/r{seed}")
        self.ground = dtm.read(scene / "truth_ground.tif")[0]
        with rasterio.open(scene / "truth_buildings.tif") as file:
            self.kinds = file.read(1)

    def judged(self, path):
        found = self.on_truth(path)
        return scores(found - self.ground, found - self.surface, self.is_observed & (self.kinds == 0),
                      self.is_observed & (self.kinds > 0), self.is_reached)


class Images(FromImages):
    """Photographs of a place of which LiDAR tells the heights and the classes."""

    def __init__(self, program, name, views, lidar, work):
        run = work / f"scenes/{name}/run"
        if not (run / "report/report.json").exists():
            make_surface(program, views, run)
        top, like = dtm.read(lidar[0])
        super().__init__(f"{name}, {len(views)} images", run, top, like, work / f"made/{name}_images")
        self.kinds = dtm.read(lidar[1])[0]

    def judged(self, path):
        found = self.on_truth(path)
        is_ground = self.inner(found) & np.isfinite(self.top) & self.is_reached & (self.kinds == GROUND)
        is_building = self.inner(found) & self.is_observed & (self.kinds == BUILDING)
        return scores(found - self.top, found - self.surface, is_ground, is_building)


class Lidar(Place):
    """A raster of LiDAR with classes, and the ground where there is one."""

    def __init__(self, name, files, work):
        heights, profile = dtm.read(files[0])
        super().__init__(f"{name}, LiDAR", None, heights, profile, work / f"made/{name}")
        self.top, self.kinds = heights, dtm.read(files[1])[0]
        self.ground = dtm.read(files[2])[0] if len(files) > 2 else heights
        self.ours = files[0]

    def judged(self, path):
        found = dtm.read(path)[0]
        known = np.isfinite(self.ground) & np.isfinite(self.top)
        return scores(found - self.ground, found - self.top, known & (self.kinds == GROUND), known & (self.kinds == BUILDING))


class Points(Place):
    """A sample of the ISPRS filter test, by the protocol of ../shared/tools/isprs.py."""

    def __init__(self, path, work):
        number = path.name[4:6]
        self.x, self.y, self.z, labels = np.loadtxt(path).T
        self.is_ground, self.cell_m = labels == 0, 1.0 if number[0] in "1234" else 2.0
        self.west, self.north = np.floor(self.x.min()), np.ceil(self.y.max())
        width = int(np.ceil((self.x.max() - self.west) / self.cell_m)) + 1
        height = int(np.ceil((self.north - self.y.min()) / self.cell_m)) + 1
        heights = np.full((height, width), -np.inf)
        at = (((self.north - self.y) / self.cell_m).astype(int), ((self.x - self.west) / self.cell_m).astype(int))
        np.maximum.at(heights, at, self.z)
        heights[np.isinf(heights)] = np.nan
        profile = {"crs": "EPSG:32632", "width": width, "height": height,
                   "transform": from_origin(self.west, self.north, self.cell_m, self.cell_m)}
        super().__init__(f"ISPRS sample {number}", None, heights, profile, work / f"made/isprs{number}")
        self.ours = self.cells

    def judged(self, path):
        ground = dtm.read(path)[0]
        places = [(self.north - self.y) / self.cell_m - 0.5, (self.x - self.west) / self.cell_m - 0.5]
        void = 1e4
        found = ndimage.map_coordinates(np.where(np.isfinite(ground), ground, void), places, order=1, mode="nearest")
        error = np.where(np.abs(found) < 0.5 * void, found - self.z, np.nan)
        out = scores(error, np.where(np.isfinite(error), error, void), self.is_ground, ~self.is_ground)
        if "failed" not in out:
            is_taken = np.abs(found - self.z) <= KEPT_M
            out["total_error"] = round(float((is_taken != self.is_ground).mean()), 4)
        return out


def places(program, seeds, work):
    """All places, those that need nothing made first."""
    terrain, jax = SHARED / "data/terrain", SHARED / "data/stereo/jax_068"
    for path in sorted((terrain / "isprs").glob("samp*.txt*")):
        yield Points(path, work)
    jax_files = [jax / f"truth/JAX_068_{name}.tif" for name in ("DSM_georef", "CLS")]
    yield Lidar("AHN3 Delft", [terrain / f"ahn3_delft/ahn3_delft_{name}.tif" for name in ("dsm", "class", "ground")], work)
    yield Lidar("JAX_214", [terrain / f"jax_tiles/JAX_214_{name}.tif" for name in ("DSM_georef", "CLS")], work)
    yield Lidar("JAX_068", jax_files, work)
    yield Images(program, "JAX_068", sorted((jax / "images").glob("*.tif")), jax_files, work)
    for seed in seeds:
        yield Scene(program, seed, work)
