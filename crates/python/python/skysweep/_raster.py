"""Rasters in memory: cells with their place, their datum and their unit."""

from __future__ import annotations

import math
import os
import sys
import warnings
from typing import Any, Literal, NamedTuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._arrays import Floats, floats, together
from ._call import local_path, path_of
from ._crs import CrsLike, CrsParts, definition_of, parts_of
from ._errors import CrsError, DatumWarning, InputError

__all__ = ["Bounds", "Raster", "heights_of", "read_raster", "write_raster"]

#: How values between cells are made.
Method = Literal["bilinear", "nearest"]

#: Most cells that a raster is reprojected to: those of 4 GB.
_CELLS_MAX = 1 << 30
#: Cells that are reprojected at a time.
_BLOCK = 1 << 20
#: Points along each edge of a raster by which its bounds on another map are found.
_EDGE_POINTS = 33
#: No-data value of the files that this package writes.
_NO_DATA = -32768.0


class Bounds(NamedTuple):
    """A rectangle on a map, in its units."""

    left: float
    bottom: float
    right: float
    top: float


class Raster:
    """Cells with their place on a map, their vertical datum and their unit.

    NumPy's functions take a raster as the array of its cells, and ``raster.values`` is that array.

    Args:
        values: Cells (rows, columns), stored as f32; NaN where there is no data.
        geotransform: GDAL's six numbers, or an `affine.Affine`; `None` for cells without a place.
        crs: Coordinate reference system, any that PROJ knows: an EPSG code, ``"EPSG:32631+5773"``,
            WKT, or an object of pyproj or rasterio.
        vertical: What heights are above: ``ellipsoid``, ``egm96``, ``egm2008`` or ``EPSG:CODE``. The
            vertical part of `crs` when `None`.
        nodata: Value that stands for no data in `values`, beside NaN. These cells become NaN.
        unit: Unit of the values, such as ``m``.

    Raises:
        InputError: `values` is no grid of real numbers, or `geotransform` not six finite numbers.
        CrsError: The CRS or the datum is not known, or they contradict one another.

    Example:
        >>> import numpy, skysweep
        >>> place = (693_000.0, 2.0, 0.0, 4_822_400.0, 0.0, -2.0)
        >>> surface = skysweep.Raster(numpy.full((3, 4), 215.0), place, "EPSG:32631+5773", unit="m")
        >>> surface.vertical, surface.epsg, surface.resolution
        ('egm96', 32631, (2.0, 2.0))
    """

    #: Cells (rows, columns), f32; NaN where there is no data.
    values: NDArray[np.float32]
    #: GDAL's geotransform: x of the upper-left corner, step along a column and a row, y of the
    #: corner, and its two steps. `None` for a raster without a place.
    geotransform: tuple[float, ...] | None
    #: Coordinate reference system as text that PROJ, pyproj and rasterio read; `None` for none.
    crs: str | None
    #: What heights are above: ``ellipsoid``, ``egm96``, ``egm2008`` or ``EPSG:CODE``; `None` where
    #: neither the file nor its CRS says it.
    vertical: str | None
    #: Value that stands for no data in the file; `None` where it declares none.
    nodata: float | None
    #: Unit of the values, such as ``m`` or ``US survey foot``; `None` where it is not known.
    unit: str | None

    def __init__(
        self,
        values: ArrayLike,
        geotransform: Any = None,
        crs: CrsLike | None = None,
        *,
        vertical: str | None = None,
        nodata: float | None = None,
        unit: str | None = None,
    ) -> None:
        self.values = grid_of("values", values)
        if nodata is not None and np.isfinite(nodata):
            void = self.values == np.float32(nodata)
            if void.any():
                self.values = np.where(void, np.float32(np.nan), self.values)
        self.geotransform = None if geotransform is None else geotransform_of(geotransform)
        self.crs = None if crs is None else definition_of(crs)
        stated = None if self.crs is None else parts_of(self.crs).vertical
        self.vertical = stated if vertical is None else _datum(vertical)
        if None not in (stated, vertical) and stated != self.vertical:
            raise CrsError(f"the heights are above {self.vertical}, and those of the CRS above {stated}")
        self.nodata, self.unit = nodata, unit or _unit_of(self.vertical)

    @classmethod
    def _read(
        cls,
        values: NDArray[np.float32],
        geotransform: tuple[float, ...] | None,
        crs: str | None,
        vertical: str | None,
        nodata: float | None,
        unit: str | None,
    ) -> Raster:
        """The raster of a file, whose CRS may be one that PROJ does not know."""
        new = cls.__new__(cls)
        new.values, new.geotransform, new.crs = values, geotransform, crs
        new.vertical, new.nodata, new.unit = vertical, nodata, unit
        return new

    def __repr__(self) -> str:
        rows, columns = self.values.shape
        words = [f"{rows} x {columns} cells"]
        if self.crs is not None:
            try:
                words.append(parts_of(self.crs).name)
            except CrsError:
                words.append("an unknown CRS")
        if self.vertical is not None:
            words.append(f"heights above {self.vertical}")
        return f"<skysweep.Raster of {', '.join(words)}>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        if copy is False and dtype is not None and np.dtype(dtype) != self.values.dtype:
            raise ValueError(f"the cells are {self.values.dtype}; as {np.dtype(dtype)} they are a copy")
        return np.array(self.values, dtype=dtype) if copy else np.asarray(self.values, dtype=dtype)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = self.values.shape
        return rows, columns

    @property
    def epsg(self) -> int | None:
        """EPSG code of the map, without the heights; `None` where it has none."""
        return None if self.crs is None else parts_of(self.crs).epsg

    @property
    def transform(self) -> Any:
        """The geotransform as rasterio has it: an `affine.Affine`.

        Raises:
            InputError: The raster has no place, or the package affine is not installed.
        """
        try:
            from affine import Affine
        except ImportError:
            raise InputError("transform needs the package affine; geotransform has the same numbers") from None
        return Affine.from_gdal(*self._place())

    @property
    def bounds(self) -> Bounds:
        """Outer edges of the raster, in units of its map.

        Raises:
            InputError: The raster has no place.
        """
        rows, columns = self.shape
        x, y = self._positions(np.array([0, columns, 0, columns]) - 0.5, np.array([0, 0, rows, rows]) - 0.5)
        return Bounds(float(x.min()), float(y.min()), float(x.max()), float(y.max()))

    @property
    def resolution(self) -> tuple[float, float]:
        """Sides of a cell, in units of the map.

        Raises:
            InputError: The raster has no place.
        """
        _, dx, turn_x, _, turn_y, dy = self._place()
        return math.hypot(dx, turn_y), math.hypot(turn_x, dy)

    def with_values(self, values: ArrayLike) -> Raster:
        """Other cells in the same place, such as ``raster.with_values(raster.values + 0.5)``.

        Raises:
            InputError: `values` is no grid of real numbers, or has another shape.
        """
        new = grid_of("values", values)
        if new.shape != self.values.shape:
            raise InputError(f"values have the shape {new.shape}, expected that of the raster, {self.values.shape}")
        return Raster._read(new, self.geotransform, self.crs, self.vertical, self.nodata, self.unit)

    def sample(
        self, x: ArrayLike, y: ArrayLike, *, crs: CrsLike | None = None, method: Method = "bilinear"
    ) -> Any:
        """Values at positions on a map.

        Args:
            x, y: Positions; arrays of any shapes that fit one another, or numbers.
            crs: Map of the positions, such as 4326 for longitude and latitude in degrees; that of
                the raster when `None`.
            method: ``bilinear``, of the valid ones among the four nearest cells, or ``nearest``.

        Returns:
            The values, f64, in the common shape; NaN where the nearest cell is void or outside.

        Raises:
            InputError: An array does not hold real numbers, the shapes do not fit, or the raster has
                no place.
            CrsError: One of the maps is not known.

        Example:
            >>> import skysweep
            >>> surface = skysweep.read_raster("data-samples/town/truth/dsm.tif")
            >>> float(surface.sample(5.4, 43.53, crs=4326)) > 100.0
            True
        """
        (flat_x, flat_y), shape = together({"x": x, "y": y})
        count = math.prod(shape)
        # Written to in place, so these are copies.
        east, north = np.array(np.broadcast_to(flat_x, count)), np.array(np.broadcast_to(flat_y, count))
        if crs is not None:
            _native.transform_points(definition_of(crs), self._map().map, east, north)
        found = self._at(east, north, method)
        return found.reshape(shape)[()]

    def reproject(
        self,
        crs: CrsLike | None = None,
        *,
        vertical: str | None = None,
        resolution: float | tuple[float, float] | None = None,
        bounds: tuple[float, float, float, float] | None = None,
        like: Raster | None = None,
        method: Method = "bilinear",
    ) -> Raster:
        """The raster on another map, above another datum, or on another grid.

        Cells are sampled at the centres of the new ones; coarser cells are no means of finer ones.

        Args:
            crs: Map, and vertical datum if it is compound; those of the raster when `None`.
            vertical: Datum to which heights are converted; that of `crs`, or of the raster.
            resolution: Side of the cells in units of the map, or their width and height; as many
                cells per area as now when `None`.
            bounds: Outer edges on the map: left, bottom, right, top; those of the raster when `None`.
            like: A raster whose map, grid and datum are taken, in place of the above.
            method: As of :meth:`sample`.

        Raises:
            InputError: The raster has no place or no CRS, a setting is out of range, or heights are
                to be converted and the raster does not say what they are above.
            CrsError: The CRS or the datum is not known, or a geoid is not installed.

        Example:
            >>> import skysweep
            >>> surface = skysweep.read_raster("data-samples/town/truth/dsm.tif")
            >>> skysweep.Raster.reproject(surface, 4326).epsg
            4326
        """
        own = self._map()
        if like is not None:
            if (crs, vertical, resolution, bounds) != (None, None, None, None):
                raise InputError("like has a map, a grid and a datum: give it alone, or crs, resolution and bounds")
            crs, vertical = like.crs, like.vertical
            if crs is None or like.geotransform is None:
                raise InputError("like has no place or no CRS")
        wanted = own if crs is None else parts_of(crs)
        datum = _datum(vertical) if vertical is not None else wanted.vertical or self.vertical
        if crs is not None and None not in (vertical, wanted.vertical) and datum != wanted.vertical:
            raise CrsError(f"the heights are wanted above {datum}, and those of the CRS are above {wanted.vertical}")
        raised = self._above(datum)
        definition = self.crs if crs is None else definition_of(crs)
        if like is not None:
            geotransform, shape = like._place(), like.shape
        elif wanted.map == own.map and resolution is None and bounds is None:
            return Raster._read(raised.values, self.geotransform, definition, datum, self.nodata, raised.unit)
        else:
            geotransform, shape = self._grid_on(wanted, resolution, bounds)
        cells = raised._resampled(wanted, geotransform, shape, method)
        return Raster._read(cells, geotransform, definition, datum, self.nodata, raised.unit)

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws the raster with matplotlib, with the units of the map and of the values.

        Args:
            ax: Axes to draw into; new ones when `None`.
            **style: Settings of `matplotlib.axes.Axes.imshow`, such as ``cmap``.

        Returns:
            The axes.

        Raises:
            InputError: matplotlib is not installed, or the grid is turned against its axes.
        """
        try:
            import matplotlib.pyplot as pyplot
        except ImportError:
            raise InputError("plot needs the package matplotlib; install it") from None
        rows, columns = self.shape
        extent = (-0.5, columns - 0.5, rows - 0.5, -0.5)
        names = ("column", "row")
        if self.geotransform is not None:
            x0, dx, turn_x, y0, turn_y, dy = self.geotransform
            if turn_x or turn_y:
                raise InputError("the grid is turned against its axes: reproject it first")
            extent = (x0, x0 + columns * dx, y0 + rows * dy, y0)
            degrees = self.crs is not None and parts_of(self.crs).metres_per_unit is None
            names = ("longitude, degrees", "latitude, degrees") if degrees else ("easting", "northing")
        axes = pyplot.subplots()[1] if ax is None else ax
        image = axes.imshow(self.values, **{"extent": extent, "interpolation": "nearest", **style})
        axes.set_xlabel(names[0])
        axes.set_ylabel(names[1])
        axes.ticklabel_format(useOffset=False, style="plain")
        words = [self.unit or "", "" if self.vertical is None else f"above {self.vertical}"]
        axes.figure.colorbar(image, ax=axes, label=" ".join(word for word in words if word))
        return axes

    def write(self, path: Any, *, overwrite: bool = False) -> None:
        """Writes the raster as a Cloud-Optimised GeoTIFF of heights; see :func:`write_raster`."""
        write_raster(path, self, overwrite=overwrite)

    def to_xarray(self) -> Any:
        """An `xarray.DataArray` with the coordinates ``y`` and ``x`` of the cells' centres.

        With rioxarray installed it also has the CRS, the transform and the no-data value (``.rio``).
        Its attributes ``crs_wkt``, ``vertical_datum`` and ``units`` name CRS, datum and unit.

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
        named = {"crs_wkt": self.crs, "vertical_datum": self.vertical, "units": self.unit}
        attributes = {name: value for name, value in named.items() if value is not None}
        array = xarray.DataArray(self.values, dims=("y", "x"), coords=coordinates, attrs=attributes)
        try:
            import rioxarray  # noqa: F401
        except ImportError:
            return array
        array = array.rio.write_nodata(np.nan)
        return array if self.crs is None else array.rio.write_crs(self.crs)

    @classmethod
    def from_xarray(cls, array: Any) -> Raster:
        """The raster of an `xarray.DataArray` with the coordinates ``y`` and ``x``, such as
        :meth:`to_xarray` and rioxarray make them. One band alone may lie before them.

        Raises:
            InputError: The array has no two coordinates ``y`` and ``x`` with even steps.
            CrsError: Its CRS is not known.
        """
        return _of_xarray("the array", array)

    def _place(self) -> tuple[float, ...]:
        if self.geotransform is None:
            raise InputError("the raster has no place: it has no geotransform")
        return self.geotransform

    def _map(self) -> CrsParts:
        if self.crs is None:
            raise InputError("the raster has no CRS")
        return parts_of(self.crs)

    def _positions(self, columns: Floats, rows: Floats) -> tuple[Floats, Floats]:
        """Map positions of cells; the centre of the first is 0."""
        x0, dx, turn_x, y0, turn_y, dy = self._place()
        columns, rows = columns + 0.5, rows + 0.5
        return x0 + columns * dx + rows * turn_x, y0 + columns * turn_y + rows * dy

    def _at(self, x: Floats, y: Floats, method: Method) -> Floats:
        """Values at positions on the raster's own map."""
        if method not in ("bilinear", "nearest"):
            raise InputError(f"the method is {method!r}, expected bilinear or nearest")
        x0, dx, turn_x, y0, turn_y, dy = self._place()
        area = dx * dy - turn_x * turn_y
        if area == 0.0:
            raise InputError("the cells of the raster have no area")
        east, north = x - x0, y - y0
        columns = np.ascontiguousarray((dy * east - turn_x * north) / area - 0.5)
        rows = np.ascontiguousarray((dx * north - turn_y * east) / area - 0.5)
        _native.sample_cells(self.values, columns, rows, method == "bilinear")
        return columns

    def _above(self, datum: str | None) -> Raster:
        """Heights above another datum, in its unit."""
        if datum is None or datum == self.vertical:
            return self
        if self.vertical is None:
            raise InputError(
                f"the raster does not say what its heights are above, so they cannot be converted to {datum}: "
                "name it, with Raster(…, vertical=…)"
            )
        place, definition = self._place(), self._map().map
        heights = _native.convert_heights(self.heights_m(), place, definition, (self.vertical, datum))
        heights = _in_unit_of(datum, heights)
        return Raster._read(heights, place, self.crs, datum, self.nodata, _unit_of(datum))

    def heights_m(self) -> NDArray[np.float32]:
        """The values as heights in metres: those above a vertical CRS in feet are converted.

        Example:
            >>> import skysweep
            >>> feet = skysweep.Raster([[100.0, 200.0]], vertical="EPSG:8228")
            >>> feet.unit, feet.heights_m().round(2).tolist()
            ('ft', [[30.48, 60.96]])
        """
        per_unit = 1.0 if self.vertical is None else _native.vertical_parts(self.vertical)[1]
        return self.values if per_unit == 1.0 else (self.values * np.float64(per_unit)).astype(np.float32)

    def _grid_on(
        self,
        wanted: CrsParts,
        resolution: float | tuple[float, float] | None,
        bounds: tuple[float, float, float, float] | None,
    ) -> tuple[tuple[float, ...], tuple[int, int]]:
        """Geotransform and shape of the grid on another map."""
        rows, columns = self.shape
        definition = self._map().map
        if resolution is None:
            # The middle cell, whose area is kept.
            x, y = self._positions(columns / 2 - np.array([0.5, -0.5, 0.5]), rows / 2 - np.array([0.5, 0.5, -0.5]))
            _native.transform_points(definition, wanted.map, x, y)
            side = math.sqrt(abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])))
            width = height = side
        else:
            sides = np.broadcast_to(np.asarray(resolution, dtype=np.float64), 2)
            width, height = float(sides[0]), float(sides[1])
        if not (math.isfinite(width) and math.isfinite(height) and width > 0.0 and height > 0.0):
            raise InputError(f"the resolution is {width}, {height}, expected positive numbers")
        if bounds is None:
            along, across = np.linspace(0, columns, _EDGE_POINTS) - 0.5, np.linspace(0, rows, _EDGE_POINTS) - 0.5
            ends = np.full(_EDGE_POINTS, -0.5)
            x, y = self._positions(
                np.concatenate([along, along, ends, ends + columns]), np.concatenate([ends, ends + rows, across, across])
            )
            _native.transform_points(definition, wanted.map, x, y)
            x, y = x[np.isfinite(x)], y[np.isfinite(y)]
            if not x.size:
                raise InputError(f"no part of the raster lies on the map {wanted.name}")
            left, bottom, right, top = x.min(), y.min(), x.max(), y.max()
        else:
            left, bottom, right, top = (float(edge) for edge in bounds)
        if not (math.isfinite(left + bottom + right + top) and left < right and bottom < top):
            raise InputError(f"the bounds are {left}, {bottom}, {right}, {top}, expected left, bottom, right, top")
        # On whole multiples of the cells, so that rasters that are reprojected alike fit; slightly inside, so that
        # edges on the lattice gain no cell by rounding.
        first, last = math.floor(left / width + 1e-6), math.ceil(right / width - 1e-6)
        low, high = math.floor(bottom / height + 1e-6), math.ceil(top / height - 1e-6)
        shape = (max(high - low, 1), max(last - first, 1))
        if shape[0] * shape[1] > _CELLS_MAX:
            raise InputError(f"the raster would have {shape[0]} x {shape[1]} cells, expected at most {_CELLS_MAX}")
        return (first * width, width, 0.0, high * height, 0.0, -height), shape

    def _resampled(
        self, wanted: CrsParts, geotransform: tuple[float, ...], shape: tuple[int, int], method: Method
    ) -> NDArray[np.float32]:
        target = Raster._read(np.empty((1, 1), np.float32), geotransform, None, None, None, None)
        own, is_same = self._map(), wanted.map == self._map().map
        rows, columns = shape
        cells = np.empty(shape, dtype=np.float32)
        step = max(1, _BLOCK // columns)
        for top in range(0, rows, step):
            end = min(top + step, rows)
            down, across = np.mgrid[top:end, 0:columns].astype(np.float64)
            x, y = target._positions(across.ravel(), down.ravel())
            if not is_same:
                _native.transform_points(wanted.map, own.map, x, y)
            cells[top:end] = self._at(x, y, method).reshape(end - top, columns)
        return cells


def read_raster(path: Any, band: int = 1) -> Raster:
    """Reads a band of a raster, counted from 1.

    Args:
        path: File, or an open dataset of rasterio.
        band: Band.

    Raises:
        FileError: The file is no raster or is damaged; `FileMissingError` where there is none.
        InputError: The raster has no such band, or more than 2³⁰ cells.

    Example:
        >>> import skysweep
        >>> surface = skysweep.read_raster("data-samples/town/truth/dsm.tif")
        >>> surface.vertical, surface.unit
        ('ellipsoid', 'm')
    """
    if band < 1:
        raise InputError(f"the band is {band}, expected 1 or more")
    with local_path(path) as local:
        values, geotransform, crs, vertical, nodata, unit = _native.read_grid(local, band)
    place = None if geotransform is None else tuple(geotransform)
    return Raster._read(values, place, crs, vertical, nodata, unit or _unit_of(vertical))


def write_raster(
    path: Any,
    heights: Any,
    geotransform: Any = None,
    crs: CrsLike | None = None,
    *,
    vertical: str | None = None,
    overwrite: bool = False,
) -> None:
    """Writes heights as a Cloud-Optimised GeoTIFF with their place and their vertical datum.

    Args:
        path: File to write.
        heights: A :class:`Raster` or an `xarray.DataArray`, whose values are in the unit of their
            datum, or an array (rows, columns) of metres; NaN is no-data.
        geotransform: GDAL's six numbers, or an `affine.Affine`; that of `heights` when `None`.
        crs: Any CRS that PROJ knows, also with heights: ``"EPSG:32631+5773"``; that of `heights` when
            `None`.
        vertical: Datum of the heights: ``ellipsoid``, ``egm96``, ``egm2008`` or ``epsg:CODE``; that of
            `heights` or of `crs` when `None`. Where nothing names it, the ellipsoid is assumed, with
            a :class:`DatumWarning`.
        overwrite: Whether an existing file may be replaced.

    Raises:
        InputError: `heights` is not a grid of real numbers or has no place, or a value such as −9999
            stands for no data.
        CrsError: The CRS or the datum is not known, or they contradict one another.
        FileError: The file cannot be written; `OutputExistsError` where it exists.

    Example:
        >>> import skysweep
        >>> surface = skysweep.read_raster("data-samples/town/truth/dsm.tif")
        >>> skysweep.write_raster("higher.tif", surface.with_values(surface.values + 1.0))
    """
    raster = raster_of("heights", heights)
    metres = heights_of("heights", raster)
    if (geotransform, crs, vertical) != (None, None, None):
        place = raster.geotransform if geotransform is None else geotransform
        # A datum of the raster's own CRS does not speak for another one.
        datum = vertical if vertical is not None or crs is not None else raster.vertical
        raster = Raster(metres, place, raster.crs if crs is None else crs, vertical=datum)
    if raster.geotransform is None:
        raise InputError("heights have no place: give geotransform, or a Raster or DataArray with coordinates")
    if raster.crs is None:
        raise InputError("heights have no CRS: give crs")
    datum = raster.vertical
    if datum is None:
        assumed("the raster", "ellipsoid", "give vertical to name it")
        datum = "ellipsoid"
    _native.write_grid(path_of(path), metres, raster.geotransform, (raster.crs, datum), overwrite)


def assumed(name: str, datum: str, cure: str) -> None:
    """Warns of a datum that is assumed."""
    depth, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith("skysweep."):
        depth, frame = depth + 1, frame.f_back
    text = f"{name} does not say what its heights are above: taken as {datum}; {cure}"
    warnings.warn(text, DatumWarning, stacklevel=depth)


def heights_of(name: str, raster: Raster) -> NDArray[np.float32]:
    """The values of a raster as heights in metres, none of which stands for no data."""
    heights = np.ascontiguousarray(raster.heights_m())
    if found := _native.undeclared(heights):
        value, cells = found
        raise InputError(
            f"{name} has {cells} cells with exactly the value {value:g}, far from all others, which looks like "
            f"no-data: put NaN there, or give Raster(…, nodata={value:g})"
        )
    return heights


def raster_of(name: str, surface: Any) -> Raster:
    """A surface in memory as a raster; one without a place for a bare array."""
    if isinstance(surface, Raster):
        return surface
    if hasattr(surface, "coords") and hasattr(surface, "dims"):
        return _of_xarray(name, surface)
    return Raster._read(grid_of(name, surface), None, None, None, None, None)


def _of_xarray(name: str, array: Any) -> Raster:
    while array.ndim > 2 and array.shape[0] == 1:
        array = array[0]
    if array.ndim != 2:
        raise InputError(f"{name} has the shape {array.shape}, expected rows and columns, or one band of them")
    transform: tuple[float, ...] | None = None
    crs, nodata = None, None
    if "x" in array.coords and "y" in array.coords:
        x, y = np.asarray(array["x"], dtype=float), np.asarray(array["y"], dtype=float)
        if x.shape != (array.shape[1],) or y.shape != (array.shape[0],):
            raise InputError(f"{name} has coordinates that are not those of its rows (y) and columns (x)")
        if len(x) > 1 and len(y) > 1:
            dx, dy = (x[-1] - x[0]) / (len(x) - 1), (y[-1] - y[0]) / (len(y) - 1)
            uneven = max(np.abs(np.diff(x) / dx - 1.0).max(), np.abs(np.diff(y) / dy - 1.0).max())
            if not uneven < 1e-3:
                raise InputError(f"{name} has coordinates with uneven steps")
            transform = (x[0] - dx / 2, dx, 0.0, y[0] - dy / 2, 0.0, dy)
    if hasattr(array, "rio"):
        crs, nodata = array.rio.crs, array.rio.nodata
        transform = transform or geotransform_of(array.rio.transform())
    crs = crs if crs is not None else array.attrs.get("crs_wkt")
    datum, unit = array.attrs.get("vertical_datum"), array.attrs.get("units")
    return Raster(array.values, transform, crs, vertical=datum, nodata=nodata, unit=unit)


def _unit_of(vertical: str | None) -> str | None:
    """Unit of heights above a datum."""
    if vertical is None:
        return None
    try:
        return {1.0: "m", 0.3048: "ft"}.get(_native.vertical_parts(vertical)[1], "US survey foot")
    except CrsError:
        # A file may name a datum that PROJ does not know; using it is an error, reading it is none.
        return None


def _in_unit_of(vertical: str, metres: NDArray[np.float32]) -> NDArray[np.float32]:
    per_unit = _native.vertical_parts(vertical)[1]
    return metres if per_unit == 1.0 else (metres / np.float64(per_unit)).astype(np.float32)


def _datum(vertical: str) -> str:
    """A vertical datum under the name that files have."""
    return _native.vertical_parts(str(vertical))[0]


def grid_of(name: str, values: Any) -> NDArray[np.float32]:
    """Real numbers in rows and columns, as f32."""
    if isinstance(values, np.ndarray) and values.dtype == np.float32 and not np.ma.isMaskedArray(values):
        array: Any = values
    else:
        array = floats(name, values)
    if array.ndim != 2 or array.size == 0:
        raise InputError(f"{name} has the shape {array.shape}, expected rows and columns")
    return np.ascontiguousarray(array, dtype=np.float32)


def geotransform_of(value: Any) -> tuple[float, ...]:
    """GDAL's six numbers."""
    if hasattr(value, "to_gdal"):
        value = value.to_gdal()
    numbers = tuple(float(number) for number in value)
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise InputError(f"the geotransform is {numbers}, expected six finite numbers")
    return numbers


def is_in_memory(surface: Any) -> bool:
    """Whether a surface is no file."""
    return not isinstance(surface, (str, os.PathLike)) and not hasattr(surface, "profile")


#: A surface: a file, a raster, an `xarray.DataArray` or an array.
Surface = Union[str, "os.PathLike[str]", Raster, Any]
