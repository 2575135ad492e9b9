"""Objects on arrays: cameras, sweeps, city models, rasters; and arrays that cannot be used."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skysweep
from conftest import TOWN, VIEWS, command

MODEL = TOWN / "truth" / "buildings.city.json"


@pytest.fixture(scope="module")
def rpc() -> skysweep.Rpc:
    return skysweep.Rpc(VIEWS[0])


def ground(rpc: skysweep.Rpc, count: int) -> tuple[Any, Any, Any]:
    """Random points over the image."""
    random = np.random.default_rng(7)
    sample, line = random.uniform(0, 400, (2, count))
    height = random.uniform(180, 260, count)
    lon, lat = rpc.localize(sample, line, height)
    return lon, lat, height


def test_arrays_agree_with_the_command_to_the_bit(rpc: skysweep.Rpc, tmp_path: Path) -> None:
    lon, lat, height = ground(rpc, 200)
    text = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in zip(lon.tolist(), lat.tolist(), height.tolist()))
    points = tmp_path / "points.txt"
    points.write_text(text)
    lines = command("rpc", "project", VIEWS[0], "--points", points, "--json").splitlines()
    expected = [json.loads(line) for line in lines]
    sample, line = rpc.project(lon, lat, height)
    found = [image_of(answer) for answer in expected]
    assert found == list(zip(sample.tolist(), line.tolist()))


def image_of(answer: Any) -> tuple[float, float]:
    """The image position in an answer of the command."""
    image = answer.get("image", answer)
    return image["sample"], image["line"]


def test_a_number_for_all_points_gives_the_same_bits(rpc: skysweep.Rpc) -> None:
    lon, lat, _ = ground(rpc, 100_000)
    one = rpc.project(lon, lat, 210.0)
    many = rpc.project(lon, lat, np.full(lon.shape, 210.0))
    single = rpc.project(lon[17], lat[17], 210.0)
    assert all(np.array_equal(a, b) for a, b in zip(one, many))
    assert single == (one[0][17], one[1][17]) and isinstance(single[0], float)


def test_projection_and_localisation_are_inverse(rpc: skysweep.Rpc) -> None:
    sample, line = np.meshgrid(np.linspace(0, 400, 5), np.linspace(0, 300, 4))
    lon, lat = rpc.localize(sample, line, 215.0)
    again = rpc.project(lon, lat, 215.0)
    assert lon.shape == (4, 5)
    assert np.allclose(again[0], sample, atol=1e-6) and np.allclose(again[1], line, atol=1e-6)


def test_arrays_of_any_layout_and_type(rpc: skysweep.Rpc) -> None:
    lon, lat, height = ground(rpc, 60)
    expected = rpc.project(lon, lat, height)
    grid = [np.asfortranarray(a.reshape(6, 10)) for a in (lon, lat, height)]
    assert np.array_equal(rpc.project(*grid)[0].ravel(), expected[0])
    doubled = [np.repeat(a, 2)[::2] for a in (lon, lat, height)]
    assert not doubled[0].flags.c_contiguous
    assert np.array_equal(rpc.project(*doubled)[1], expected[1])
    backward = rpc.project(lon[::-1], lat[::-1], height[::-1])
    assert np.array_equal(backward[0][::-1], expected[0])
    swapped = rpc.project(lon.astype(">f8"), lat.astype(">f8"), height.astype(">f8"))
    assert np.array_equal(swapped[0], expected[0])
    lists = rpc.project(lon.tolist(), lat.tolist(), height.tolist())
    assert np.array_equal(lists[0], expected[0])
    integers = rpc.project(lon, lat, np.full(60, 210, dtype=np.uint8))
    assert np.isfinite(integers[0]).all()
    masked = rpc.project(np.ma.array(lon, mask=[True] + [False] * 59), lat, height)
    assert np.isnan(masked[0][0]) and np.array_equal(masked[0][1:], expected[0][1:])
    lon.flags.writeable = False
    assert np.array_equal(rpc.project(lon, lat, height)[0], expected[0])


def test_arrays_that_cannot_be_used_are_exceptions(rpc: skysweep.Rpc) -> None:
    lon, lat, height = ground(rpc, 6)
    for bad in (lon.astype(complex), lon.astype(str), lon > 0, np.array([None] * 6), np.array(["2020"], "M8[Y]")):
        with pytest.raises(skysweep.InputError, match="lon has the type"):
            rpc.project(bad, lat, height)
    with pytest.raises(skysweep.InputError, match=r"do not fit one another: lon \(6,\), lat \(5,\)"):
        rpc.project(lon, lat[:5], height)
    with pytest.raises((skysweep.InputError, ValueError)):
        rpc.project([[1.0], [1.0, 2.0]], lat, height)  # type: ignore[list-item]
    for value in (np.nan, np.inf, -np.inf, 1e300):
        sample, line = rpc.project([lon[0], value], lat[0], 210.0)
        assert np.isfinite(sample[0]) and np.isnan(sample[1]) and np.isnan(line[1])
        assert np.isnan(rpc.localize(value, 0.0, 210.0)[0])
    for shape in [(0,), (3, 0), (0, 0, 2)]:
        sample, line = rpc.project(np.zeros(shape), np.zeros(shape), 210.0)
        assert sample.shape == shape and line.shape == shape
    assert rpc.project(np.zeros(0), 1.0, np.zeros((4, 1)))[0].shape == (4, 0)
    # An array of a terabyte in name only: the copy is refused by the system, not by a crash.
    huge = np.lib.stride_tricks.as_strided(np.zeros(1), (1 << 47,), (0,))
    with pytest.raises((MemoryError, ValueError)):
        rpc.project(huge, huge, huge)


def test_cameras_from_other_sources(rpc: skysweep.Rpc, tmp_path: Path) -> None:
    lon, lat, height = ground(rpc, 50)
    expected = rpc.project(lon, lat, height)
    for again in (skysweep.Rpc(rpc.to_gdal()), skysweep.Rpc(rpc.to_dict()), pickle.loads(pickle.dumps(rpc))):
        assert again == rpc and np.array_equal(again.project(lon, lat, height)[0], expected[0])
    rpc.write(tmp_path / "a.rpb")
    assert np.allclose(skysweep.Rpc(tmp_path / "a.rpb").project(lon, lat, height)[0], expected[0], atol=1e-6)
    with pytest.raises(skysweep.FileError):
        rpc.write(tmp_path / "a.rpb")
    with pytest.raises(skysweep.InputError, match="names no format"):
        rpc.write(tmp_path / "a.xyz")
    for wrong, text in [
        ({"LINE_OFF": 1}, "lacks"),
        ({**rpc.to_dict(), "line_off": float("nan")}, "not finite"),
        ({**rpc.to_dict(), "line_off": "much"}, "expected numbers"),
        ({**rpc.to_dict(), "line_num": [1.0] * 19}, "length"),
        ({**rpc.to_dict(), "lat_scale": 0.0}, "LAT_SCALE"),
    ]:
        with pytest.raises(skysweep.InputError, match=text):
            skysweep.Rpc(wrong)
    with pytest.raises(skysweep.InputError, match="expected a path"):
        skysweep.Rpc(3)


def test_corrections_move_the_image(rpc: skysweep.Rpc) -> None:
    lon, lat, height = ground(rpc, 50)
    sample, line = rpc.project(lon, lat, height)
    moved = rpc.corrected((1.5, -0.5))
    assert np.allclose(moved.project(lon, lat, height), (sample + 1.5, line - 0.5), atol=1e-9)
    assert moved.correction["translation_px"] == [1.5, -0.5]
    folded, residual_px = moved.folded()
    assert residual_px < 1e-9 and np.allclose(folded.project(lon, lat, height)[0], sample + 1.5, atol=1e-6)
    assert np.allclose(rpc.cropped(100, 50).project(lon, lat, height), (sample - 100, line - 50), atol=1e-6)
    assert rpc.rescaled(0.5).gsd(lon[0], lat[0], 210.0)[0] > 1.9 * rpc.gsd(lon[0], lat[0], 210.0)[0]
    assert 0.0 < rpc.incidence_deg(lon[0], lat[0], 210.0) < 45.0


def test_a_camera_is_fitted_to_points(rpc: skysweep.Rpc) -> None:
    lon, lat, height = ground(rpc, 400)
    fit = skysweep.Rpc.fit(lon, lat, height, *rpc.project(lon, lat, height))
    assert fit.max_px < 0.01 and np.allclose(
        fit.rpc.project(lon, lat, height), rpc.project(lon, lat, height), atol=0.01
    )
    with pytest.raises(skysweep.InputError, match="correspondences found"):
        skysweep.Rpc.fit(lon[:5], lat[:5], height[:5], lon[:5], lat[:5])


def test_heights_of_views_in_memory(rpc: skysweep.Rpc) -> None:
    views = [(skysweep.read_raster(path).values, skysweep.Rpc(path)) for path in VIEWS]
    steps: list[skysweep.Step] = []
    found = skysweep.HeightSweep(views, (170.0, 280.0), preset="fast").run(steps.append)
    assert len(found) == 2 and found[0].sources == [1] and steps
    first = found[0]
    assert first.height_m.shape == first.sigma_m.shape == first.confidence.shape == first.agreeing.shape
    sure = first.agreeing > 0
    assert sure.mean() > 0.5 and 180.0 < np.median(first.height_m[sure]) < 230.0
    wide = [(np.asarray(pixels, dtype=np.uint16), camera) for pixels, camera in views]
    again = skysweep.HeightSweep(wide, (170.0, 280.0), preset="fast").run()
    assert np.array_equal(again[0].height_m, first.height_m, equal_nan=True)


def test_the_surface_of_views_in_memory_is_that_of_a_run(tmp_path: Path) -> None:
    search = (170.0, 280.0)
    skysweep.dsm(VIEWS, tmp_path, height_range_m=search, preset="fast", gsd_m=1.0)
    run, source, seen = (skysweep.read_raster(tmp_path / "dsm" / name) for name in ["dsm.tif", "source.tif", "views.tif"])
    # No data is 0 in both.
    source, seen = (np.nan_to_num(raster.values) for raster in [source, seen])
    views = [(skysweep.read_raster(path).values, skysweep.Rpc.from_run(tmp_path, path)) for path in VIEWS]
    sweep = skysweep.HeightSweep(views, search, preset="fast")
    found = sweep.surface(run.bounds, 1.0, run.epsg)
    assert found.heights.geotransform == run.geotransform and found.heights.epsg == run.epsg
    assert found.heights.vertical == run.vertical
    # A run takes the middle of its tie points for its geometry, so its hypotheses lie a little elsewhere.
    assert np.mean(found.source == source) > 0.97
    observed = (found.source == 1) & (source == 1)
    assert np.mean(found.views[observed] == seen[observed]) > 0.97
    assert np.quantile(np.abs(found.heights.values - run.values)[observed], 0.9) < 0.1
    known = np.isfinite(found.heights.values)
    assert np.array_equal(known, np.isfinite(found.sigma_m)) and np.array_equal(known, np.isfinite(found.probability))
    assert (found.sigma_m[known] > 0.0).all()
    assert ((0.0 <= found.probability[known]) & (found.probability[known] <= 1.0)).all()
    with pytest.raises(skysweep.InputError, match="grid of -9 × -9 cells"):
        sweep.surface((9.0, 9.0, 0.0, 0.0), 1.0, 32631)
    with pytest.raises(skysweep.CrsError):
        sweep.surface(run.bounds, 1.0, 999)
    with pytest.raises(skysweep.InputError, match='the fill is "some"'):
        sweep.surface(run.bounds, 1.0, run.epsg, fill="some")  # type: ignore[arg-type]


def test_views_that_cannot_be_swept_are_exceptions(rpc: skysweep.Rpc) -> None:
    pixels = np.zeros((64, 64), dtype=np.float32)
    sweep = skysweep.HeightSweep
    for views, text in [
        ([(pixels, rpc)], "found 1 image"),
        ([(pixels[0], rpc)], "expected rows and columns"),
        ([(pixels.astype(complex), rpc)], "has the type"),
        ([(pixels, "camera")], "expected a skysweep.Rpc"),
        ([(np.zeros((0, 5)), rpc)] * 2, "expected 2 or more"),
    ]:
        with pytest.raises(skysweep.InputError, match=text):
            sweep(views, (0.0, 100.0)).run()  # type: ignore[arg-type]
    with pytest.raises(skysweep.SkysweepError, match="parallax"):
        sweep([(pixels, rpc), (pixels, rpc)], (170.0, 280.0)).run()
    with pytest.raises(skysweep.InputError, match='the preset is "slow"'):
        sweep([(pixels, rpc)] * 2, (170.0, 280.0), preset="slow").run()
    with pytest.raises(skysweep.InputError, match="height range"):
        sweep([(pixels, rpc)] * 2, (280.0, 170.0)).run()
    with pytest.raises(skysweep.InputError, match="finite heights"):
        sweep([(pixels, rpc)] * 2, (float("nan"), 170.0))
    other = skysweep.Rpc(VIEWS[1])
    blank = sweep([(np.full((64, 64), np.nan), rpc), (pixels, other)], (170.0, 280.0), preset="fast").run()
    assert np.isnan(blank[0].height_m).all()


def test_rays_at_a_city_model() -> None:
    model = skysweep.CityModel(MODEL)
    assert model.epsg == 32631 and len(model.class_of) == len(model.triangles) == len(model.object_of)
    middles = model.vertices[model.triangles].mean(axis=1)
    above = middles + [0.0, 0.0, 500.0]
    hits = model.cast(above, [0.0, 0.0, -1.0])
    assert (hits.triangle >= 0).mean() > 0.5 and (hits.object >= 0).sum() == (hits.triangle >= 0).sum()
    roofs = np.array(model.class_of) == "RoofSurface"
    seen = hits.triangle[roofs] == np.flatnonzero(roofs)
    assert seen.mean() > 0.5 and np.allclose(hits.distance[roofs][seen], 500.0, atol=1e-6)
    up = model.cast(above.reshape(-1, 1, 3), [0.0, 0.0, 1.0])
    assert up.triangle.shape == (len(above), 1) and np.isinf(up.distance).all() and (up.object == -1).all()
    assert model.cast([np.nan, 0.0, 0.0], [0.0, 0.0, 1.0]).triangle == -1
    assert model.cast(np.zeros((0, 3)), [0.0, 0.0, 1.0]).triangle.shape == (0,)
    for bad in (3.0, [1.0, 2.0], np.zeros((4, 2)), np.zeros((2, 3), dtype=complex)):
        with pytest.raises(skysweep.InputError):
            model.cast(bad, [0.0, 0.0, 1.0])
    with pytest.raises(skysweep.FileError):
        skysweep.CityModel(TOWN / "no_such.json")


def test_grids_in_memory_are_evaluated(tmp_path: Path) -> None:
    truth = skysweep.read_raster(TOWN / "truth" / "dsm.tif")
    shifted = truth.with_values(truth.values + 0.25)
    found = skysweep.evaluate(shifted, truth, alignment="none")
    assert abs(found.metrics.mae - 0.25) < 1e-3
    arrays = skysweep.evaluate(shifted.values, truth.values, cell_m=1.0, alignment="none")
    assert abs(arrays.metrics.mae - 0.25) < 1e-3
    mixed = skysweep.evaluate(TOWN / "truth" / "dsm.tif", truth, alignment="none", target="nowhere")
    assert mixed.metrics.mae == 0.0
    beside = skysweep.evaluate(shifted.values, truth, alignment="none", test_vertical="ellipsoid")
    assert abs(beside.metrics.mae - 0.25) < 1e-3
    with pytest.raises(skysweep.InputError, match="test has no place: give cell_m"):
        skysweep.evaluate(shifted.values, truth.values)
    for bad in (np.zeros((0, 4)), np.zeros(4), np.float64(3.0), np.zeros((2, 2), dtype=complex)):
        with pytest.raises(skysweep.InputError):
            skysweep.evaluate(bad, truth, cell_m=1.0)
    with pytest.raises(skysweep.SkysweepError):
        skysweep.evaluate(np.full((8, 8), np.nan), np.full((8, 8), np.nan), cell_m=1.0)


def test_rasters_go_to_files_and_back(tmp_path: Path) -> None:
    heights = np.arange(12, dtype=np.float64).reshape(3, 4)
    heights[1, 2] = np.nan
    place = (500_000.0, 2.0, 0.0, 4_800_000.0, 0.0, -2.0)
    skysweep.write_raster(tmp_path / "a.tif", heights, place, "EPSG:32631", vertical="ellipsoid")
    found = skysweep.read_raster(tmp_path / "a.tif")
    assert np.array_equal(found.values, heights.astype(np.float32), equal_nan=True)
    assert found.geotransform == place and found.crs is not None and "32631" in found.crs
    with pytest.raises(skysweep.FileError):
        skysweep.write_raster(tmp_path / "a.tif", heights, place, 32631, vertical="ellipsoid")
    with pytest.raises(skysweep.CrsError):
        skysweep.write_raster(tmp_path / "b.tif", heights, place, 999_999)
    with pytest.raises(skysweep.InputError, match="six finite numbers"):
        skysweep.write_raster(tmp_path / "b.tif", heights, (1.0, 2.0), 32631)
    with pytest.raises(skysweep.InputError, match="the band is"):
        skysweep.read_raster(tmp_path / "a.tif", 9)


def test_a_raster_becomes_an_array_of_xarray() -> None:
    pytest.importorskip("xarray")
    raster = skysweep.read_raster(TOWN / "truth" / "dsm.tif")
    array = raster.to_xarray()
    assert array.shape == raster.values.shape and array.dims == ("y", "x")
    assert float(array.y[0]) > float(array.y[-1])
    found = skysweep.evaluate(array + 1.0, raster, alignment="none")
    assert abs(found.metrics.mae - 1.0) < 1e-3
