"""A program that uses the package, for mypy. Lines with `type: ignore` must be errors."""

from __future__ import annotations

import numpy as np

import skysweep


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


def objects() -> tuple[float, int]:
    rpc = skysweep.Rpc("a.tif")
    sample, line = rpc.project(np.zeros(3), np.zeros(3), 100.0)
    heights = skysweep.HeightSweep([(np.zeros((8, 8)), rpc)], (0.0, 100.0)).run()
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
