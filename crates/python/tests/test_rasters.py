"""Rasters in memory: place, datum and unit through files, xarray, rasterio and evaluations."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skysweep
from conftest import TOWN

TRUTH = TOWN / "truth" / "dsm.tif"
#: A map that EPSG does not know.
LOCAL_MAP = "+proj=tmerc +lat_0=43.5 +lon_0=5.4 +k=1 +x_0=1000 +y_0=2000 +datum=WGS84 +units=m +type=crs"


@pytest.fixture(scope="module")
def truth() -> skysweep.Raster:
    """The exact surface of the sample town, above the ellipsoid."""
    return skysweep.read_raster(TRUTH)


@pytest.fixture
def geoid_file(truth: skysweep.Raster, tmp_path: Path) -> Path:
    """The same heights as a file above EGM96."""
    path = tmp_path / "egm96.tif"
    skysweep.write_raster(path, truth.values, truth.geotransform, 32631, vertical="egm96")
    return path


def test_a_raster_carries_its_place_its_datum_and_its_unit(truth: skysweep.Raster, geoid_file: Path) -> None:
    rasterio = pytest.importorskip("rasterio")
    found = skysweep.read_raster(geoid_file)
    assert (truth.vertical, found.vertical, found.epsg, found.unit) == ("ellipsoid", "egm96", 32631, "m")
    with rasterio.open(geoid_file) as dataset:
        assert found.transform == dataset.transform and found.bounds == dataset.bounds
        assert found.resolution == dataset.res and found.shape == dataset.shape and found.nodata == dataset.nodata
        assert np.array_equal(np.asarray(found), dataset.read(1, masked=True).filled(np.nan), equal_nan=True)
        x, y = dataset.xy(40, 50)
        assert found.sample(x, y) == found.values[40, 50] == found.sample(x, y, method="nearest")
    assert "EGM96" in repr(found) and "egm96" in repr(found)
    again = pickle.loads(pickle.dumps(found))
    assert np.array_equal(again.values, found.values, equal_nan=True) and again.vertical == "egm96"


def test_numpy_takes_a_raster_as_its_cells(truth: skysweep.Raster) -> None:
    assert np.nanmean(truth) == np.nanmean(truth.values)  # type: ignore[arg-type]
    assert np.asarray(truth) is truth.values and np.array(truth).dtype == np.float32
    assert np.asarray(truth, dtype=np.float64).dtype == np.float64
    assert np.array_equal(np.subtract(truth, 1.0), truth.values - 1.0, equal_nan=True)


def test_a_surface_above_a_geoid_is_evaluated_converted_and_written_again(
    truth: skysweep.Raster, geoid_file: Path, tmp_path: Path
) -> None:
    found = skysweep.read_raster(geoid_file)
    with warnings.catch_warnings():
        warnings.simplefilter("error", skysweep.DatumWarning)
        assert skysweep.evaluate(found, geoid_file, alignment="none").metrics.mae == 0.0
        assert skysweep.evaluate(found, found, alignment="none").metrics.mae == 0.0
        found.write(tmp_path / "again.tif")
    again = skysweep.read_raster(tmp_path / "again.tif")
    assert again.vertical == "egm96" and again.epsg == 32631
    assert np.array_equal(again.values, found.values, equal_nan=True)
    # The same numbers above two datums are surfaces that lie an undulation apart.
    undulation_m = skysweep.evaluate(found, truth, alignment="none").metrics.mae
    assert 45.0 < undulation_m < 55.0


def test_heights_change_their_datum(truth: skysweep.Raster, tmp_path: Path) -> None:
    sea = truth.reproject(vertical="egm96")
    assert sea.vertical == "egm96" and sea.geotransform == truth.geotransform
    assert 45.0 < float(np.nanmean(truth.values - sea.values)) < 55.0
    back = sea.reproject(vertical="ellipsoid")
    assert np.nanmax(np.abs(back.values - truth.values)) < 1e-3
    assert skysweep.evaluate(sea, truth, alignment="none").metrics.mae < 1e-3
    compound = truth.reproject("EPSG:32631+5773")
    assert compound.vertical == "egm96" and np.array_equal(compound.values, sea.values, equal_nan=True)
    unsaid = skysweep.Raster(truth.values, truth.geotransform, 32631)
    with pytest.raises(skysweep.InputError, match="does not say what its heights are above"):
        unsaid.reproject(vertical="egm96")
    with pytest.raises(skysweep.CrsError, match="not a vertical datum"):
        truth.reproject(vertical="sea level")


def test_heights_above_a_datum_in_feet_keep_their_unit(truth: skysweep.Raster, tmp_path: Path) -> None:
    path = tmp_path / "feet.tif"
    place = (450_000.0, 5.0, 0.0, 2_180_000.0, 0.0, -5.0)
    metres = np.full((6, 8), 30.48)
    skysweep.write_raster(path, metres, place, 2236, vertical="EPSG:8228")
    feet = skysweep.read_raster(path)
    assert feet.unit == "ft" and np.allclose(feet.values, 100.0) and np.allclose(feet.heights_m(), 30.48)
    feet.write(tmp_path / "again.tif")
    assert np.allclose(skysweep.read_raster(tmp_path / "again.tif").values, 100.0)
    assert skysweep.evaluate(feet, path, alignment="none").metrics.mae < 1e-4


def test_an_array_with_a_map_against_its_own_file_is_told_the_datum_that_is_assumed(geoid_file: Path) -> None:
    found = skysweep.read_raster(geoid_file)
    horizontal = skysweep.Raster(found.values, found.geotransform, 32631)
    assert horizontal.vertical is None
    with pytest.warns(skysweep.DatumWarning, match="test does not say .* taken as egm96; as the reference") as told:
        assert skysweep.evaluate(horizontal, geoid_file, alignment="none").metrics.mae == 0.0
    assert told[0].filename == __file__
    with pytest.warns(skysweep.DatumWarning, match="reference does not say"):
        assert skysweep.evaluate(geoid_file, horizontal, alignment="none").metrics.mae == 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        named = skysweep.evaluate(horizontal, geoid_file, alignment="none", test_vertical="egm96")
        assert named.metrics.mae == 0.0
        # An array without a map lies where the other grid lies.
        plain = skysweep.evaluate(found.values, found.values, cell_m=1.0, alignment="none")
        assert plain.metrics.mae == 0.0
    with pytest.warns(skysweep.DatumWarning, match="taken as egm96"):
        assert skysweep.evaluate(found.values, found, alignment="none").metrics.mae == 0.0


def test_a_datum_that_is_assumed_when_writing_is_a_warning(truth: skysweep.Raster, tmp_path: Path) -> None:
    with pytest.warns(skysweep.DatumWarning, match="the raster does not say .* taken as ellipsoid") as told:
        skysweep.write_raster(tmp_path / "a.tif", truth.values, truth.geotransform, 32631)
    assert told[0].filename == __file__
    assert skysweep.read_raster(tmp_path / "a.tif").vertical == "ellipsoid"
    with pytest.raises(skysweep.CrsError, match="above egm2008, and those of the CRS above egm96"):
        skysweep.write_raster(
            tmp_path / "b.tif", truth.values, truth.geotransform, "EPSG:32631+5773", vertical="egm2008"
        )
    with pytest.raises(skysweep.InputError, match="heights have no place"):
        skysweep.write_raster(tmp_path / "b.tif", truth.values, crs=32631)
    with pytest.raises(skysweep.InputError, match="heights have no CRS"):
        skysweep.write_raster(tmp_path / "b.tif", truth.values, truth.geotransform)
    assert not (tmp_path / "b.tif").exists()


@pytest.mark.parametrize("vertical", ["ellipsoid", "egm96", "EPSG:5720"])
@pytest.mark.parametrize("crs", [32631, LOCAL_MAP, 4326])
def test_any_crs_of_proj_goes_to_a_file_and_back(
    truth: skysweep.Raster, tmp_path: Path, crs: Any, vertical: str
) -> None:
    rasterio = pytest.importorskip("rasterio")
    path = tmp_path / "a.tif"
    place = (5.0, 0.001, 0.0, 43.0, 0.0, -0.001) if crs == 4326 else (1000.0, 2.0, 0.0, 2000.0, 0.0, -2.0)
    surface = skysweep.Raster(np.full((5, 6), 12.5), place, crs, vertical=vertical)
    surface.write(path)
    found = skysweep.read_raster(path)
    assert found.vertical == vertical and found.epsg == (crs if isinstance(crs, int) else None)
    assert skysweep.evaluate(found, path, alignment="none").metrics.mae == 0.0
    with rasterio.open(path) as dataset:
        assert dataset.crs is not None and dataset.transform == found.transform
    if vertical != "ellipsoid":
        pyproj = pytest.importorskip("pyproj")
        assert pyproj.CRS(found.crs).is_compound


def test_crss_of_pyproj_and_rasterio_are_taken_with_their_heights(truth: skysweep.Raster) -> None:
    pyproj, rasterio = pytest.importorskip("pyproj"), pytest.importorskip("rasterio")
    cells = np.zeros((2, 2))
    for crs, epsg, vertical in [
        (pyproj.CRS("EPSG:32631+5773"), 32631, "egm96"),
        (pyproj.CRS(32631).to_3d(), 32631, "ellipsoid"),
        (pyproj.CRS(32631), 32631, None),
        (rasterio.CRS.from_user_input("EPSG:32631+5773"), 32631, "egm96"),
        (rasterio.CRS.from_epsg(32631), 32631, None),
        (rasterio.CRS.from_epsg(4979), 4326, "ellipsoid"),
        (pyproj.CRS(LOCAL_MAP), None, None),
        ("EPSG:7415", 28992, "EPSG:5709"),
    ]:
        raster = skysweep.Raster(cells, crs=crs)
        assert (raster.epsg, raster.vertical) == (epsg, vertical), crs
    for wrong in ("Mars", 999_999, object(), True):
        with pytest.raises(skysweep.CrsError):
            skysweep.Raster(cells, crs=wrong)


def test_a_raster_and_xarray_hold_the_same(geoid_file: Path) -> None:
    pytest.importorskip("rioxarray")
    raster = skysweep.read_raster(geoid_file)
    array = raster.to_xarray()
    assert array.rio.crs.to_wkt().startswith("COMPD_CS") and tuple(array.rio.bounds()) == raster.bounds
    assert array.attrs["vertical_datum"] == "egm96" and array.attrs["units"] == "m"
    assert np.isnan(array.rio.nodata)
    back = skysweep.Raster.from_xarray(array)
    assert (back.vertical, back.epsg, back.geotransform) == ("egm96", 32631, raster.geotransform)
    assert skysweep.evaluate(array + 0.5, raster, alignment="none").metrics.mae == pytest.approx(0.5, abs=1e-3)


def test_an_array_that_rioxarray_opens_is_evaluated_against_its_file(geoid_file: Path) -> None:
    rioxarray = pytest.importorskip("rioxarray")
    for masked in (False, True):
        array = rioxarray.open_rasterio(geoid_file, masked=masked)
        assert array.shape[0] == 1
        found = skysweep.evaluate(array, geoid_file, alignment="none")
        assert found.metrics.mae == 0.0
    flat = array.rio.write_crs(32631)
    with pytest.warns(skysweep.DatumWarning, match="taken as egm96"):
        assert skysweep.evaluate(flat, geoid_file, alignment="none").metrics.mae == 0.0
    uneven = array.assign_coords(x=np.linspace(0, 1, array.sizes["x"]) ** 2)
    with pytest.raises(skysweep.InputError, match="uneven steps"):
        skysweep.Raster.from_xarray(uneven)


def test_values_are_sampled_as_rasterio_and_pyproj_place_them(truth: skysweep.Raster) -> None:
    rasterio, pyproj = pytest.importorskip("rasterio"), pytest.importorskip("pyproj")
    left, bottom, right, top = truth.bounds
    random = np.random.default_rng(5)
    x, y = random.uniform(left, right, (3, 7)), random.uniform(bottom, top, (3, 7))
    with rasterio.open(TRUTH) as dataset:
        expected = np.array([cell[0] for cell in dataset.sample(zip(x.ravel(), y.ravel()), masked=True)])
    nearest = truth.sample(x, y, method="nearest")
    assert nearest.shape == (3, 7) and np.array_equal(nearest.ravel(), expected.astype(float), equal_nan=True)
    lon, lat = pyproj.Transformer.from_crs(32631, 4326, always_xy=True).transform(x, y)
    assert np.allclose(truth.sample(lon, lat, crs=4326), truth.sample(x, y), atol=1e-3, equal_nan=True)
    assert np.isnan(truth.sample(left - 10.0, top)) and np.isnan(truth.sample(np.nan, top))
    plane = truth.with_values(np.add.outer(np.arange(truth.shape[0]), np.arange(truth.shape[1])).astype(np.float32))
    dx, dy = truth.resolution
    assert plane.sample(left + 10.25 * dx, top - 20.5 * dy) == pytest.approx(9.75 + 20.0)
    with pytest.raises(skysweep.InputError, match="the method is 'cubic'"):
        truth.sample(x, y, method="cubic")  # type: ignore[arg-type]


def test_reprojection_agrees_with_rasterio(truth: skysweep.Raster) -> None:
    warp = pytest.importorskip("rasterio.warp")
    found = truth.reproject(2154, resolution=1.5)
    assert found.epsg == 2154 and found.resolution == (1.5, 1.5) and found.vertical == "ellipsoid"
    expected = np.full(found.shape, np.nan, dtype=np.float32)
    warp.reproject(
        truth.values,
        expected,
        src_transform=truth.transform,
        src_crs="EPSG:32631",
        src_nodata=np.nan,
        dst_transform=found.transform,
        dst_crs="EPSG:2154",
        dst_nodata=np.nan,
        resampling=warp.Resampling.bilinear,
    )
    both = np.isfinite(found.values) & np.isfinite(expected)
    assert both.mean() > 0.8 and np.median(np.abs(found.values - expected)[both]) < 0.01
    area = truth.reproject(4326)
    assert area.epsg == 4326 and 0.8 < area.values.size / truth.values.size < 1.6
    same = area.reproject(like=truth)
    assert same.geotransform == truth.geotransform and same.shape == truth.shape
    inside = np.isfinite(same.values) & np.isfinite(truth.values)
    assert np.median(np.abs(same.values - truth.values)[inside]) < 0.1
    for settings, text in [
        ({"resolution": 0.0}, "the resolution is"),
        ({"resolution": 1e-6}, "cells, expected at most"),
        ({"bounds": (1.0, 0.0, 0.0, 1.0)}, "the bounds are"),
        ({"like": truth, "resolution": 2.0}, "give it alone"),
    ]:
        with pytest.raises(skysweep.InputError, match=text):
            truth.reproject(**settings)  # type: ignore[arg-type]
    with pytest.raises(skysweep.InputError, match="no CRS"):
        skysweep.Raster(truth.values, truth.geotransform).reproject(4326)


def test_a_raster_is_drawn_with_its_units(truth: skysweep.Raster) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    axes = truth.plot(cmap="terrain")
    left, bottom, right, top = truth.bounds
    assert axes.images[0].get_extent() == pytest.approx([left, right, bottom, top])
    assert axes.get_xlabel() == "easting"
    assert axes.figure.axes[1].get_ylabel() == "m above ellipsoid"
    assert skysweep.Raster(truth.values).plot().get_xlabel() == "column"
    matplotlib.pyplot.close("all")


def test_a_value_that_stands_for_no_data_is_told(truth: skysweep.Raster, tmp_path: Path) -> None:
    marked = np.where(np.arange(truth.values.size).reshape(truth.shape) % 50 == 0, np.float32(-9999), truth.values)
    cells = int((marked == -9999).sum())
    for surface in (marked, truth.with_values(marked)):
        with pytest.raises(skysweep.InputError, match=f"test has {cells} cells with exactly the value -9999"):
            skysweep.evaluate(surface, truth, alignment="none", test_vertical="ellipsoid")
    with pytest.raises(skysweep.InputError, match=r"heights has .* put NaN there, or give Raster\(…, nodata=-9999\)"):
        skysweep.write_raster(tmp_path / "a.tif", marked, truth.geotransform, 32631, vertical="ellipsoid")
    named = skysweep.Raster(marked, truth.geotransform, 32631, vertical="ellipsoid", nodata=-9999.0)
    assert np.isnan(named.values).sum() >= cells
    assert skysweep.evaluate(named, truth, alignment="none").metrics.mae == 0.0


def test_rasters_that_cannot_be_are_exceptions(truth: skysweep.Raster) -> None:
    for values in (np.zeros((0, 4)), np.zeros(4), 3.0, np.zeros((2, 2), dtype=complex)):
        with pytest.raises(skysweep.InputError):
            skysweep.Raster(values)
    with pytest.raises(skysweep.InputError, match="six finite numbers"):
        skysweep.Raster(np.zeros((2, 2)), (1.0, 2.0))
    with pytest.raises(skysweep.InputError, match="has no place"):
        skysweep.Raster(np.zeros((2, 2))).bounds
    with pytest.raises(skysweep.InputError, match="expected that of the raster"):
        truth.with_values(np.zeros((2, 2)))
