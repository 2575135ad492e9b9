"""Rasters between files, arrays and xarray."""

from __future__ import annotations

import os
import re
import tempfile
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _native, _jobs
from ._arrays import floats
from ._call import Report, epsg_of, path_of
from ._errors import InputError

__all__ = ["Raster", "evaluate", "read_raster", "write_raster"]

#: Map on which arrays without a CRS are compared, for which any in metres will do.
_ANY_MAP = 32631


class Raster(NamedTuple):
    """Cells with their place on a map."""

    #: Cells (rows, columns), f32; NaN where there is no data.
    values: NDArray[np.float32]
    #: GDAL's geotransform: x of the upper-left corner, step along a column and a row, y of the
    #: corner, and its two steps. `None` for a raster without a place.
    geotransform: tuple[float, ...] | None
    #: Coordinate reference system as WKT; `None` where the file names none.
    crs: str | None

    def to_xarray(self) -> Any:
        """An `xarray.DataArray` with the coordinates ``y`` and ``x`` of the cells' centres.

        With rioxarray installed it also has the CRS and the transform (``.rio``); without, the WKT
        is the attribute ``crs_wkt``.

        Raises:
            InputError: xarray is not installed, or the grid is turned against its axes.
        """
        try:
            import xarray
        except ImportError:
            raise InputError("to_xarray needs the package xarray; install it") from None
        x0, dx, turn_x, y0, turn_y, dy = self.geotransform or (0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        if turn_x or turn_y:
            raise InputError("the grid is turned against its axes, which coordinates cannot say")
        rows, columns = self.values.shape
        coordinates = {"y": y0 + (np.arange(rows) + 0.5) * dy, "x": x0 + (np.arange(columns) + 0.5) * dx}
        attributes = {} if self.crs is None else {"crs_wkt": self.crs}
        array = xarray.DataArray(self.values, dims=("y", "x"), coords=coordinates, attrs=attributes)
        try:
            import rioxarray  # noqa: F401
        except ImportError:
            return array
        return array if self.crs is None else array.rio.write_crs(self.crs)


def read_raster(path: Any, band: int = 1) -> Raster:
    """Reads a band of a raster, counted from 1.

    Raises:
        FileError: The file is no raster or is damaged.
        InputError: The raster has no such band, or more than 2³⁰ cells.
    """
    if band < 1:
        raise InputError(f"the band is {band}, expected 1 or more")
    values, geotransform, crs = _native.read_grid(path_of(path), band)
    return Raster(values, None if geotransform is None else tuple(geotransform), crs)


def write_raster(
    path: Any,
    heights: Any,
    geotransform: Any,
    crs: Any,
    *,
    vertical: str = "ellipsoid",
    overwrite: bool = False,
) -> None:
    """Writes heights as a Cloud-Optimised GeoTIFF.

    Args:
        path: File to write.
        heights: Metres (rows, columns); NaN is no-data.
        geotransform: GDAL's six numbers, or an `affine.Affine`.
        crs: EPSG code, `pyproj.CRS` or `rasterio.CRS` of the map.
        vertical: Datum of the heights: ``ellipsoid``, ``egm96``, ``egm2008`` or ``epsg:CODE``.
        overwrite: Whether an existing file may be replaced.

    Raises:
        InputError: `heights` is not a grid of real numbers.
        CrsError: The CRS or the datum is not known.
        FileError: The file exists or cannot be written.
    """
    numbers = _geotransform(geotransform)
    _native.write_grid(path_of(path), _grid("heights", heights), numbers, (epsg_of(crs), vertical), overwrite)


def _grid(name: str, values: Any) -> NDArray[np.float32]:
    array = floats(name, values)
    if array.ndim != 2 or array.size == 0:
        raise InputError(f"{name} has the shape {array.shape}, expected rows and columns")
    return np.ascontiguousarray(array, dtype=np.float32)


def _geotransform(value: Any) -> tuple[float, ...]:
    if hasattr(value, "to_gdal"):
        value = value.to_gdal()
    numbers = tuple(float(number) for number in value)
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise InputError(f"the geotransform is {numbers}, expected six finite numbers")
    return numbers


def _place(name: str, surface: Any, cell_m: float | None) -> tuple[tuple[float, ...], int]:
    """Geotransform and EPSG code of a surface in memory."""
    transform, crs = getattr(surface, "geotransform", None), getattr(surface, "crs", None)
    if hasattr(surface, "rio"):
        transform, crs = surface.rio.transform(), surface.rio.crs
    elif transform is None and hasattr(surface, "coords") and "x" in surface.coords and "y" in surface.coords:
        x, y = np.asarray(surface["x"], dtype=float), np.asarray(surface["y"], dtype=float)
        if len(x) > 1 and len(y) > 1:
            dx, dy = (x[-1] - x[0]) / (len(x) - 1), (y[-1] - y[0]) / (len(y) - 1)
            transform = (x[0] - dx / 2, dx, 0.0, y[0] - dy / 2, 0.0, dy)
    if transform is None:
        if cell_m is None:
            raise InputError(f"{name} has no place: give cell_m, or a Raster or DataArray with coordinates")
        if not (np.isfinite(cell_m) and cell_m > 0.0):
            raise InputError(f"cell_m is {cell_m}, expected a positive number of metres")
        transform = (500_000.0, cell_m, 0.0, 5_000_000.0, 0.0, -cell_m)
    if isinstance(crs, str):
        # The last authority of WKT is that of the whole.
        codes = re.findall(r'(?:AUTHORITY|ID)\["EPSG",\s*"?(\d+)"?\]', crs)
        crs = int(codes[-1]) if codes else None
    return _geotransform(transform), _ANY_MAP if crs is None else epsg_of(crs)


def _is_in_memory(surface: Any) -> bool:
    return not isinstance(surface, (str, os.PathLike)) and not hasattr(surface, "profile")


def evaluate(test: Any, reference: Any, *, cell_m: float | None = None, **settings: Any) -> Report:
    """Measures the errors of a surface against a reference.

    Both may be files, of which the kind decides the evaluation (:func:`evaluate_grids`,
    :func:`evaluate_surfaces`, :func:`evaluate_maps`), or grids in memory: arrays (rows, columns) of
    metres with the same corner and cells of `cell_m`; a :class:`Raster`; an `xarray.DataArray`.

    Args:
        test: Surface to evaluate.
        reference: Surface that is believed. Errors are measured at its cells.
        cell_m: Side of the cells of arrays without a place, metres.
        **settings: Settings of the evaluation.

    Returns:
        The report of the evaluation; of grids with ``metrics``: ``mae``,
        ``rmse``, ``nmad``, …, metres.

    Raises:
        InputError: A grid is empty or has no place, or the grids share no cell.
        FileError: A file cannot be read.
        CrsError: The CRSs or vertical datums do not fit.
    """
    with tempfile.TemporaryDirectory(prefix="skysweep") as folder:
        surfaces = {"test": test, "reference": reference}
        for name, surface in surfaces.items():
            if _is_in_memory(surface):
                grid = _grid(name, getattr(surface, "values", surface))
                geotransform, epsg = _place(name, surface, cell_m)
                path = os.path.join(folder, f"{name}.tif")
                _native.write_grid(path, grid, geotransform, (epsg, "ellipsoid"), False)
                surfaces[name] = path
        first, second = path_of(surfaces["test"]), path_of(surfaces["reference"])
        kind = _jobs.kind_of_evaluation(first, second)
        if kind == "maps":
            return _jobs.evaluate_maps(first, second, **settings)
        if kind == "surfaces":
            return _jobs.evaluate_surfaces(first, second, **settings)
        if _is_in_memory(test):
            settings.setdefault("target", "nowhere")
        return _jobs.evaluate_grids(first, second, **settings)
