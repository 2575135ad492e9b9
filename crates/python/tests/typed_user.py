"""A program that uses the package, for mypy. Lines with `type: ignore` must be errors."""

from __future__ import annotations

import numpy as np

import skysweep
import skysweep.dask as cluster
from skysweep import reports


def jobs() -> None:
    report = skysweep.dsm(["a.tif", "b.tif"], "out", gsd_m=0.5, preset="fast", height_range_m=(0.0, 50.0))
    print(report.surface.observed, report["surface"])
    skysweep.dtm("dsm.tif", "out", threads=2, progress=lambda step: print(step.done, step.total))
    skysweep.evaluate("a.tif", np.zeros((4, 4)), cell_m=1.0, alignment="none", test_vertical="egm96").metrics
    skysweep.evaluate("a.tif", "b.tif", align="none")  # type: ignore[call-arg]
    skysweep.evaluate("a.tif", "b.tif", alignment="perhaps")  # type: ignore[arg-type]
    skysweep.Plan.make(["a.tif", "b.tif"], "run", gsd_m=0.5, chunk=512, progress=True)
    skysweep.Plan.make(["a.tif", "b.tif"], "run", gsd="much")  # type: ignore[call-arg]
    skysweep.dsm([3], "out")  # type: ignore[list-item]
    skysweep.dsm(["a.tif"], "out", gsd="much")  # type: ignore[call-arg]
    skysweep.dsm(["a.tif"], "out", gsd_m="much")  # type: ignore[arg-type]
    skysweep.dsm(["a.tif"], "out", preset="slow")  # type: ignore[arg-type]


def every_job() -> list[float | int | str | None]:
    """All functions, with an attribute of each report whose type is known."""
    views = ["a.tif", "b.tif"]
    place = {"lon_deg": 5.4, "lat_deg": 43.53}
    made = skysweep.dsm(views, "run")
    first: str = made.images[0].path
    kept: list[float | None] = made.surface.kept_by_image
    residual: float | None = made.pointing.residual_after_px
    skysweep.dsm(views, "run").surface.obsreved  # type: ignore[attr-defined]
    made.surface.observed + "cells"  # type: ignore[operator]
    plan: reports.PlanFile = skysweep.plan_run(views, "run", chunk=512)
    chunk: int = skysweep.make_plan(views, "run").plan.chunks[0].core.width
    wanted: int = skysweep.read_plan("run").estimate.merge_mb
    faults: list[reports.ChunkFault] = skysweep.run_chunks("run", chunks="1/2").failed
    void: reports.ChunksReport | None = skysweep.merge_run("run", partial=True).chunks
    batch = skysweep.batch("night.toml", only=["harbour"], dry_run=True)
    state: str = batch.scenes[0].tasks[0].state
    left_out: bool = batch.scenes[0].left_out
    terrain = skysweep.dtm("run", "terrain")
    classes = skysweep.classes("run", "classes")
    index = skysweep.buildings("a.tif", "index.tif")
    change = skysweep.diff("before", "after", "change")
    products = skysweep.products("run")
    ortho = skysweep.ortho(views, "run", "orthos")
    registered = skysweep.register("new.tif", {"splats": "splats.ply"}, "new.json")
    grids = skysweep.evaluate_grids("run", "lidar.laz")
    mae: float = grids.metrics.mae
    rest: float | None = grids.edges.rest.mae
    surfaces = skysweep.evaluate_surfaces("a.ply", "b.ply")
    maps = skysweep.evaluate_maps("a.npy", "b.npy")
    kind: str = skysweep.kind_of_evaluation("a", "b")
    heights = skysweep.heightmap("run", "map.tif", {"source": {"position": place}})
    points = skysweep.unproject("map.tif", "points.ply")
    tiles = skysweep.tiles("run", "tiles", {"source": {"position": place}})
    ground = skysweep.groundview("run", "views", {"model": "sparse/0"})
    both = skysweep.compose("ground.png", "alpha.png", "satellite.png", "both.png")
    priors = skysweep.priors("town.city.json", ["cameras"], "priors")
    splats = skysweep.splats("run", views, "splats.ply")
    rendered = skysweep.render_splats("splats.ply", "views")
    converted = skysweep.convert_splats("splats.ply", "splats.spz")
    labelled = skysweep.label_splats("splats.ply", "town.city.json", "labelled.ply")
    trained = skysweep.train("priors", "trained")
    mesh = skysweep.mesh("priors", {"maps": "priors/raw_depth"}, "town.ply")
    aligned = skysweep.align("sparse/0", "positions.csv", "aligned")
    split = skysweep.split("sparse/0")
    city = skysweep.city_info("town.city.json")
    triangles = skysweep.city_convert("town.city.json", "town.ply")
    rpc = skysweep.rpc_info("a.tif")
    written = skysweep.rpc_convert("a.tif", "a.rpb")
    scene = skysweep.simulate("town", "scene")
    reported: list[skysweep.Report] = [terrain, classes, index, change, products, ortho, registered, surfaces, maps]
    reported += [heights, points, tiles, ground, both, priors, splats, rendered, converted, labelled, trained, mesh]
    reported += [aligned, split, city, triangles, rpc, written, scene, *faults]
    skysweep.allow_remote()
    skysweep.fetch_grids()
    return [first, kept[0], residual, plan.id, chunk, wanted, state, left_out, mae, rest, kind, len(reported), str(void)]


def on_a_cluster() -> int:
    report = cluster.run("run", "tcp://head:8786", progress=True)
    cluster.run("run", retires=2)  # type: ignore[call-arg]
    futures = cluster.submit("run", None)
    again: dict[str, int] = report.dask.tried_again
    return report.dask.computed + report.surface.cells + len(futures.chunks) + len(again)


def objects() -> tuple[float, int]:
    rpc = skysweep.Rpc("a.tif")
    sample, line = rpc.project(np.zeros(3), np.zeros(3), 100.0)
    heights = skysweep.HeightSweep([(np.zeros((8, 8)), rpc)], (0.0, 100.0)).run()
    dsm = skysweep.HeightSweep([(np.zeros((8, 8)), rpc)], (0.0, 100.0)).surface((0.0, 0.0, 9.0, 9.0), 0.5, 32631)
    dsm.heights.sample(5.4, 43.5).min(), dsm.sigma_m[0, 0], dsm.heigths  # type: ignore[attr-defined]
    hits = skysweep.CityModel("a.city.json", lod="2.2").cast([0.0, 0.0, 9.0], [0.0, 0.0, -1.0])
    plan = skysweep.Plan("run")
    surface = skysweep.Raster(np.zeros((4, 4)), (0.0, 1.0, 0.0, 0.0, 0.0, -1.0), 32631, vertical="egm96")
    surface.reproject(4326, method="bilinear").sample(5.4, 43.5, method="nearest")
    surface.sample(5.4, 43.5, method="cubic")  # type: ignore[arg-type]
    skysweep.write_raster("a.tif", surface.with_values(surface.values + 1.0), overwrite=True)
    skysweep.HeightSweep([(surface.values, rpc)], (0.0, 100.0), preset="slow")  # type: ignore[arg-type]
    rpc.project("a", "b")  # type: ignore[call-arg]
    return float(heights[0].height_m[0, 0]) + sample[0] + line[0], len(plan) + int(hits.triangle)


def errors() -> str:
    try:
        jobs()
    except (skysweep.OutputExistsError, skysweep.FileMissingError) as error:
        return f"{error.errno} {error.filename}"
    except (skysweep.InputError, skysweep.CrsError, skysweep.CancelledError):
        raise
    return ""
