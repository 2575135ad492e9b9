"""City models with ray casting."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._arrays import floats
from ._call import path_of
from ._errors import InputError

__all__ = ["CityModel", "Hits"]


class Hits(NamedTuple):
    """What rays hit first. All arrays have the common shape of the rays."""

    #: Distance in lengths of the direction; infinite where nothing is hit.
    distance: NDArray[np.float64]
    #: Index of the triangle; −1 where nothing is hit.
    triangle: NDArray[np.int64]
    #: Index of the object in :attr:`CityModel.ids`; −1 where nothing is hit.
    object: NDArray[np.int64]


class CityModel:
    """The triangles of a city model: CityJSON, CityJSONSeq, CityGML, OBJ or PLY.

    Args:
        path: File of the model.
        lod: Level of detail, such as ``"2.2"``; the highest of each object up to 2.x when `None`.
        all_objects: Whether every object with surfaces is used, and not only buildings.

    Raises:
        FileError: The file cannot be read.
        InputError: The model is not consistent, or the level is none.

    A model can be pickled, with its triangles; the file is not needed again.

    Example:
        >>> import skysweep
        >>> model = skysweep.CityModel("data-samples/town/truth/buildings.city.json")
        >>> middle = model.vertices[model.triangles[0]].mean(axis=0)
        >>> hits = model.cast(middle + [0.0, 0.0, 500.0], [0.0, 0.0, -1.0])
        >>> bool(hits.distance <= 500.0)
        True
    """

    #: Identifiers of the objects.
    ids: list[str]
    #: EPSG code of the map, if the file names it.
    epsg: int | None
    #: EPSG code of the heights, if the file names it.
    vertical_epsg: int | None
    #: Corners of the triangles (n, 3) on the map, metres, f64.
    vertices: NDArray[np.float64]
    #: Corners of each triangle (m, 3), as indices of vertices, u32.
    triangles: NDArray[np.uint32]
    #: Index of the object of each triangle (m).
    object_of: NDArray[np.uint32]
    #: Name of the surface class of each triangle: ``RoofSurface``, ``WallSurface``, …
    class_of: list[str]

    def __init__(self, path: Any, *, lod: str | None = None, all_objects: bool = False) -> None:
        self._take(_native.CityCore.read(path_of(path), None if lod is None else str(lod), bool(all_objects)))

    def _take(self, core: _native.CityCore) -> None:
        self._core = core
        self.ids = self._core.ids()
        self.epsg, self.vertical_epsg = self._core.epsg()
        self.vertices, self.triangles, self.object_of, self.class_of = self._core.triangles()

    def __reduce__(self) -> Any:
        origin, positions, indices, surfaces = self._core.parts()
        return _again, (self.ids, (self.epsg, self.vertical_epsg), origin, positions, indices, surfaces)

    def __repr__(self) -> str:
        return f"<skysweep.CityModel of {len(self.ids)} objects, {len(self.triangles)} triangles>"

    def cast(self, origins: ArrayLike, directions: ArrayLike) -> Hits:
        """Casts rays.

        Args:
            origins: Starts (…, 3) on the map, metres.
            directions: Directions (…, 3) of any length; the shapes fit one another.

        Returns:
            What each ray hits first. Rays with a number that is not finite, or without a direction,
            hit nothing.

        Raises:
            InputError: An array is not one of real numbers in threes, or the shapes do not fit.
        """
        arrays = {"origins": floats("origins", origins), "directions": floats("directions", directions)}
        for name, array in arrays.items():
            if array.ndim == 0 or array.shape[-1] != 3:
                raise InputError(f"{name} has the shape {array.shape}, expected three numbers last")
        try:
            shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
        except ValueError:
            found = " and ".join(str(array.shape) for array in arrays.values())
            raise InputError(f"origins and directions have shapes that do not fit: {found}") from None
        rays = [np.ascontiguousarray(np.broadcast_to(a, shape)).reshape(-1, 3) for a in arrays.values()]
        distance, triangle = self._core.cast(*rays)
        objects = np.full(triangle.shape, -1, dtype=np.int64)
        hit = triangle >= 0
        objects[hit] = self.object_of[triangle[hit]]
        whole = shape[:-1]
        return Hits(distance.reshape(whole), triangle.reshape(whole), objects.reshape(whole))


def _again(*parts: Any) -> CityModel:
    model = CityModel.__new__(CityModel)
    model._take(_native.CityCore.from_parts(*parts))
    return model
