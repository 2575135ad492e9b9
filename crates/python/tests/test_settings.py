"""Objects of other packages as settings, and errors as Python's own functions raise them."""

from __future__ import annotations

import errno
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skysweep
from conftest import SMALL, TOWN, VIEWS, rasters

TRUTH = TOWN / "truth" / "dsm.tif"
MODEL = TOWN / "truth" / "buildings.city.json"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the sample town."""
    folder = tmp_path_factory.mktemp("town") / "run"
    skysweep.dsm(VIEWS, folder, **SMALL)
    return folder


@pytest.fixture(scope="module")
def part() -> Any:
    """A polygon over the middle of the town, on its map."""
    geopandas, shapely = pytest.importorskip("geopandas"), pytest.importorskip("shapely")
    left, bottom, right, top = skysweep.read_raster(TRUTH).bounds
    x, y, side = (left + right) / 2, (bottom + top) / 2, (right - left) / 5
    frame = {"name": ["middle"], "geometry": [shapely.box(x - side, y - side, x + side, y + side)]}
    return geopandas.GeoDataFrame(frame, crs=32631)


def test_missing_files_are_the_errors_of_python(tmp_path: Path) -> None:
    missing = tmp_path / "no_such.tif"
    city, raster = tmp_path / "no_such.city.json", tmp_path / "other.tif"
    for call, path in [
        (lambda: skysweep.rpc_info(missing), missing),
        (lambda: skysweep.Rpc(missing), missing),
        (lambda: skysweep.read_raster(missing), missing),
        (lambda: skysweep.dtm(missing, tmp_path / "out"), missing),
        (lambda: skysweep.dsm([VIEWS[0], missing], tmp_path / "out"), missing),
        (lambda: skysweep.CityModel(city), city),
        (lambda: skysweep.evaluate(missing, TRUTH), missing),
        (lambda: skysweep.evaluate(skysweep.read_raster(TRUTH), raster), raster),
    ]:
        with pytest.raises(FileNotFoundError) as found:
            call()
        assert isinstance(found.value, skysweep.FileMissingError) and isinstance(found.value, skysweep.FileError)
        assert found.value.errno == errno.ENOENT and found.value.filename == str(path)
        assert str(path) in str(found.value) and "Errno" not in str(found.value)
        again = pickle.loads(pickle.dumps(found.value))
        assert (type(again), str(again), again.filename) == (type(found.value), str(found.value), str(path))


def test_existing_outputs_are_the_errors_of_python(run: Path, tmp_path: Path) -> None:
    raster = skysweep.read_raster(TRUTH)
    taken = tmp_path / "taken.tif"
    raster.write(taken)
    skysweep.Rpc(VIEWS[0]).write(tmp_path / "a.json")
    for call, path in [
        (lambda: raster.write(taken), taken),
        (lambda: skysweep.rpc_convert(VIEWS[0], tmp_path / "a.json"), tmp_path / "a.json"),
        (lambda: skysweep.Rpc(VIEWS[0]).write(tmp_path / "a.json"), tmp_path / "a.json"),
    ]:
        with pytest.raises(FileExistsError) as found:
            call()
        assert isinstance(found.value, skysweep.OutputExistsError)
        assert found.value.errno == errno.EEXIST and found.value.filename == str(path)
    with pytest.raises(FileExistsError) as again:
        skysweep.dsm(VIEWS, run, **SMALL)
    assert again.value.errno == errno.EEXIST


def test_files_that_are_there_and_cannot_be_read_are_not_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = tmp_path / "broken.tif"
    broken.write_text("no raster")
    with pytest.raises(skysweep.FileError) as found:
        skysweep.read_raster(broken)
    assert not isinstance(found.value, FileNotFoundError) and found.value.filename == str(broken)
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(skysweep.FileError, match="no plan"):
        skysweep.Plan(folder)
    # A name of one letter is in every text.
    monkeypatch.chdir(tmp_path)
    with pytest.raises(skysweep.FileError) as plain:
        skysweep.dtm("broken.tif", "a")
    assert plain.value.filename == "broken.tif" and not isinstance(plain.value, FileNotFoundError)


def test_a_city_model_is_pickled_without_its_file(tmp_path: Path) -> None:
    path = tmp_path / "town.city.json"
    path.write_bytes(MODEL.read_bytes())
    model = skysweep.CityModel(path)
    content = pickle.dumps(model)
    path.unlink()
    again = pickle.loads(content)
    assert (again.ids, again.epsg, again.vertical_epsg) == (model.ids, model.epsg, model.vertical_epsg)
    assert again.class_of == model.class_of and np.array_equal(again.vertices, model.vertices)
    assert np.array_equal(again.triangles, model.triangles) and np.array_equal(again.object_of, model.object_of)
    above = model.vertices[model.triangles].mean(axis=1) + [0.3, 0.2, 500.0]
    first, second = (one.cast(above, [0.0, 0.0, -1.0]) for one in (model, again))
    assert np.array_equal(first.distance, second.distance) and np.array_equal(first.triangle, second.triangle)
    ids, epsg, origin, positions, (triangles, surface_of), surfaces = model.__reduce__()[1]
    with pytest.raises(skysweep.InputError, match="do not fit one another"):
        skysweep._native.CityCore.from_parts(ids, epsg, origin, positions[:2], (triangles, surface_of), surfaces)


def test_the_camera_of_a_run_has_its_correction(run: Path, tmp_path: Path) -> None:
    for image in (VIEWS[0], VIEWS[0].name, str(VIEWS[0])):
        rpc = skysweep.Rpc.from_run(run, image)
        assert rpc.to_dict() == skysweep.Rpc(VIEWS[0]).to_dict()
        assert rpc.correction["translation_px"] != [0.0, 0.0]
    skysweep.rpc_convert(VIEWS[0], tmp_path / "corrected.json", corrections=run / "report" / "report.json")
    folded = skysweep.Rpc(tmp_path / "corrected.json")
    lon, lat = rpc.localize([50, 200, 300], [60, 150, 250], 210.0)
    assert np.allclose(rpc.project(lon, lat, 210.0), folded.project(lon, lat, 210.0), atol=0.01)
    with pytest.raises(skysweep.InputError, match="used no image .*it used view_1.tif, view_3.tif"):
        skysweep.Rpc.from_run(run, "view_9.tif")
    with pytest.raises(skysweep.FileError, match="no report of a DSM run"):
        skysweep.Rpc.from_run(tmp_path, VIEWS[0])


def test_a_geodataframe_is_an_area_on_any_map(tmp_path: Path, part: Any) -> None:
    whole = skysweep.dsm(VIEWS, tmp_path / "whole", **SMALL).surface.observed
    first = skysweep.dsm(VIEWS, tmp_path / "first", **SMALL, area=part)
    assert 0 < first.surface.observed < whole
    skysweep.dsm(VIEWS, tmp_path / "second", **SMALL, area=part.to_crs(2154))
    skysweep.dsm(VIEWS, tmp_path / "third", **SMALL, area=part.geometry)
    surfaces = [skysweep.read_raster(tmp_path / name / "dsm" / "dsm.tif") for name in ("first", "second", "third")]
    assert len({surface.geotransform for surface in surfaces}) == 1
    assert np.array_equal(surfaces[0].values, surfaces[2].values, equal_nan=True)


def test_a_geodataframe_is_bounds_on_any_map(tmp_path: Path, part: Any) -> None:
    for name, frame in (("same", part), ("other", part.to_crs(2154)), ("degrees", part.to_crs(4326))):
        skysweep.dsm(VIEWS, tmp_path / name, **SMALL, bounds=frame)
    given = part.total_bounds.tolist()
    skysweep.dsm(VIEWS, tmp_path / "numbers", **SMALL, bounds=given)
    assert rasters(tmp_path / "numbers")["dsm.tif"] == rasters(tmp_path / "same")["dsm.tif"]
    for name in ("other", "degrees"):
        left, bottom, right, top = skysweep.read_raster(tmp_path / name / "dsm" / "dsm.tif").bounds
        # A rectangle on another map is turned on this one, by a few degrees at most.
        assert left <= given[0] and bottom <= given[1] and right >= given[2] and top >= given[3]
        assert right - left < 1.3 * (given[2] - given[0])
    ortho = tmp_path / "ortho.tif"
    skysweep.ortho(VIEWS[:1], TRUTH, ortho, bounds=part.to_crs(4326), corrections="uncorrected")
    assert skysweep.read_raster(ortho).bounds.left == pytest.approx(given[0], abs=2.0)


def test_geodataframes_are_masks_and_areas_of_change(tmp_path: Path, part: Any) -> None:
    whole = skysweep.dsm(VIEWS, tmp_path / "whole", **SMALL).surface.observed
    masked = skysweep.dsm(VIEWS, tmp_path / "masked", **SMALL, masks=[part.to_crs(4326)])
    assert 0 < masked.surface.observed < whole
    after = skysweep.read_raster(TRUTH)
    after.with_values(after.values + 2.0).write(tmp_path / "after.tif")
    report = skysweep.diff(TRUTH, tmp_path / "after.tif", tmp_path / "change", areas=part, areas_field="name", alignment="none")
    assert [area.name for area in report.areas] == ["middle"]


def test_polygons_without_a_crs_are_refused(tmp_path: Path, part: Any) -> None:
    nameless = part.set_crs(None, allow_override=True)
    for settings in ({"area": nameless}, {"masks": [nameless]}, {"bounds": nameless}, {"area": nameless.geometry}):
        with pytest.raises(skysweep.InputError, match="without a CRS; name it with set_crs"):
            skysweep.dsm(VIEWS, tmp_path / "out", **SMALL, **settings)
    # A bare geometry is in longitude and latitude, which easting and northing cannot be.
    with pytest.raises(skysweep.InputError, match="area reaches from .* give a GeoDataFrame with its CRS"):
        skysweep.dsm(VIEWS, tmp_path / "out", **SMALL, area=part.geometry.iloc[0])
    assert not (tmp_path / "out").exists()


def test_datasets_in_memory_are_images(tmp_path: Path) -> None:
    rasterio = pytest.importorskip("rasterio")
    with rasterio.open(VIEWS[0]) as file, rasterio.MemoryFile() as memory:
        profile = {key: file.profile[key] for key in ("width", "height", "count", "dtype")}
        with memory.open(driver="GTiff", **profile, rpcs=file.rpcs) as made:
            made.write(file.read())
        with memory.open() as dataset:
            values = skysweep.read_raster(dataset).values
            assert np.array_equal(values, skysweep.read_raster(VIEWS[0]).values)
            from_memory, from_file = skysweep.Rpc(dataset), skysweep.Rpc(VIEWS[0])
            assert np.allclose(from_memory.project(5.4, 43.53, 210.0), from_file.project(5.4, 43.53, 210.0), atol=1e-3)
            assert skysweep.rpc_info(dataset)
            assert skysweep.dsm([dataset, VIEWS[1]], tmp_path / "run", **SMALL).surface.observed > 1000


def test_heights_that_stand_for_no_data_are_told() -> None:
    rpc = skysweep.Rpc(VIEWS[0])
    heights = np.array([200.0, -9999.0, 210.0, -9999.0])
    for call in (rpc.project, rpc.localize):
        with pytest.raises(skysweep.InputError, match="height has 2 values of exactly -9999"):
            call(np.zeros(4), np.zeros(4), heights)
    pixels = np.full((64, 64), 300.0)
    pixels[:8] = -32768.0
    with pytest.raises(skysweep.InputError, match="view 1 has 512 values of exactly -32768"):
        skysweep.HeightSweep([(np.zeros((64, 64)), rpc), (pixels, rpc)], (170.0, 280.0))
