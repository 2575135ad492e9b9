"""The height sweep on arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._arrays import floats, refuse_marks
from ._call import Progress, watcher
from ._errors import InputError
from ._raster import Raster
from ._rpc import Rpc

__all__ = ["HeightSweep", "ViewHeights", "ViewSurface"]


class ViewHeights(NamedTuple):
    """Heights of a view. All arrays have the pixels of pyramid level `level`: (rows, columns)."""

    #: Metres above the ellipsoid, f64; NaN where there is none.
    height_m: NDArray[np.float64]
    #: Standard deviations, metres, f32.
    sigma_m: NDArray[np.float32]
    #: Confidences, 0 to 1, f32.
    confidence: NDArray[np.float32]
    #: Number of other views that confirm the height, u8. Heights that no view confirms are often
    #: wrong; a DSM run drops them.
    agreeing: NDArray[np.uint8]
    #: Times that the pixels of the view were halved; 0 is the full resolution.
    level: int
    #: Positions of the views that it was compared with, the best first.
    sources: list[int]


class ViewSurface(NamedTuple):
    """The surface of views on a map. All arrays have the cells of `heights`: (rows, columns)."""

    #: Metres above the ellipsoid, with their place on the map; NaN where there is none.
    heights: Raster
    #: Standard deviations, metres, f32; NaN where there is no height.
    sigma_m: NDArray[np.float32]
    #: Probability that the height is right, 0 to 1, f32; NaN where there is no height.
    probability: NDArray[np.float32]
    #: Number of views that observed the height, u8; 0 where it was filled.
    views: NDArray[np.uint8]
    #: Where the height comes from, or why there is none, u8: the codes of ``dsm/source.tif``.
    source: NDArray[np.uint8]


class HeightSweep:
    """Heights of views in memory, by the sweep of a DSM run: no file is read or written.

    Args:
        views: Pairs of pixels (rows, columns) and their :class:`Rpc`, two or more. Pixels are grey
            values as sensors count them (noise of a few counts); NaN where there is none. Other
            types than f32 are converted.
        height_range: Heights to search, metres above the ellipsoid, the lower first.
        preset: ``fast`` (half the resolution, two sources per view), ``balanced`` or ``accurate``.

    The cameras are taken as they are. Correct their pointing first (:meth:`Rpc.corrected`), or use
    :func:`dsm`, which finds the corrections.

    Raises:
        InputError: A view is no grid of real numbers or too small, holds a value such as −9999 for no
            data, or a setting is out of range.

    Example:
        >>> import skysweep
        >>> paths = ["data-samples/town/view_1.tif", "data-samples/town/view_3.tif"]
        >>> views = [(skysweep.read_raster(path), skysweep.Rpc(path)) for path in paths]
        >>> heights = skysweep.HeightSweep(views, (170.0, 280.0), preset="fast").run()
        >>> len(heights)
        2
    """

    def __init__(
        self,
        views: Sequence[tuple[ArrayLike, Rpc]],
        height_range: tuple[float, float],
        *,
        preset: Literal["fast", "balanced", "accurate"] = "balanced",
    ) -> None:
        self._views: list[tuple[NDArray[np.float32], _native.RpcCore]] = []
        for number, (pixels, rpc) in enumerate(views):
            if not isinstance(rpc, Rpc):
                raise InputError(f"the camera of view {number} is a {type(rpc).__name__}, expected a skysweep.Rpc")
            array = floats(f"view {number}", pixels) if not _is_f32(pixels) else np.asarray(pixels)
            if array.ndim != 2:
                raise InputError(f"view {number} has the shape {array.shape}, expected rows and columns")
            refuse_marks(f"view {number}", array)
            self._views.append((np.asarray(array, dtype=np.float32), rpc._core))
        low, high = (float(height) for height in height_range)
        if not (np.isfinite(low) and np.isfinite(high)):
            raise InputError(f"the height range is {low} to {high}, expected finite heights")
        self._range, self._preset = (low, high), preset

    def run(self, progress: Progress = None) -> list[ViewHeights]:
        """Computes the heights of every view.

        Raises:
            InputError: There are fewer than two views.
            SkysweepError: The views share no ground, or look along the same line.
        """
        with watcher(progress) as watching:
            found = _native.sweep_views(self._views, self._range, self._preset, watching)
        return [
            ViewHeights(height_m, sigma_m, confidence, agreeing, level, sources)
            for level, sources, height_m, sigma_m, confidence, agreeing in found
        ]

    def surface(
        self,
        bounds: tuple[float, float, float, float],
        gsd_m: float,
        crs_epsg: int,
        *,
        fill: Literal["none", "justified", "all"] = "justified",
        progress: Progress = None,
    ) -> ViewSurface:
        """Computes the surface of the views on a map: a DSM without files.

        It is that of a run with these cameras and these heights to search, up to where its hypotheses lie.

        Args:
            bounds: Left, bottom, right and top of the surface on the map. The grid is snapped to whole cells.
            gsd_m: Side of a cell on the ground, metres.
            crs_epsg: EPSG code of the map, such as that of the scene's UTM zone.
            fill: Voids that are closed: ``none``, ``justified`` or ``all``.

        Raises:
            InputError: There are fewer than two views, or the bounds hold no cells.
            CrsError: PROJ does not know the map.
            SkysweepError: The views share no ground, or look along the same line.
        """
        left, bottom, right, top = (float(edge) for edge in bounds)
        with watcher(progress) as watching:
            geotransform, heights, sigma_m, probability, views, source = _native.surface_of_views(
                self._views, self._range, self._preset, (left, bottom, right, top), crs_epsg, gsd_m, fill, watching
            )
        raster = Raster(heights, geotransform, crs_epsg, vertical="ellipsoid")
        return ViewSurface(raster, sigma_m, probability, views, source)


def _is_f32(pixels: Any) -> bool:
    return isinstance(pixels, np.ndarray) and not np.ma.isMaskedArray(pixels) and pixels.dtype == np.float32
