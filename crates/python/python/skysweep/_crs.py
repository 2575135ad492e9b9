"""Coordinate reference systems as people have them: codes, text, objects of pyproj and rasterio."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple, Union

from . import _native
from ._errors import CrsError

__all__ = ["CrsLike", "CrsParts", "definition_of", "epsg_of", "parts_of"]

#: An EPSG code, text that PROJ reads (``EPSG:32631+5773``, WKT, PROJJSON, a PROJ string), or an
#: object of pyproj or rasterio.
CrsLike = Union[int, str, Any]


class CrsParts(NamedTuple):
    """What a CRS is made of."""

    #: Name.
    name: str
    #: EPSG code of the map, if it has one.
    epsg: int | None
    #: The map alone, as WKT.
    horizontal: str
    #: Vertical datum: ``ellipsoid``, ``egm96``, ``egm2008``, ``EPSG:CODE``; `None` where it has none.
    vertical: str | None
    #: Metres in a unit of the map; `None` for degrees.
    metres_per_unit: float | None

    @property
    def map(self) -> str:
        """The map alone, by its code where it has one, so that maps can be compared."""
        return self.horizontal if self.epsg is None else f"EPSG:{self.epsg}"


def definition_of(value: CrsLike) -> str:
    """A CRS as text that PROJ reads."""
    if isinstance(value, bool):
        raise CrsError(f"the CRS is {value!r}, expected an EPSG code, text or an object of pyproj or rasterio")
    if isinstance(value, str):
        text = value.strip()
        return f"EPSG:{text}" if text.isdigit() else text
    if hasattr(value, "to_wkt"):
        try:
            # WKT 1, which rasterio writes by default, has no heights above the ellipsoid.
            return str(value.to_wkt(version="WKT2_2019"))
        except Exception:
            return str(value.to_wkt())
    if hasattr(value, "to_epsg"):
        return f"EPSG:{epsg_of(value)}"
    try:
        return f"EPSG:{int(value)}"
    except (TypeError, ValueError):
        raise CrsError(
            f"the CRS is a {type(value).__name__}, expected an EPSG code, text or an object of pyproj or rasterio"
        ) from None


@lru_cache(maxsize=256)
def _parts(definition: str) -> CrsParts:
    return CrsParts(*_native.crs_parts(definition))


def parts_of(value: CrsLike) -> CrsParts:
    """The parts of a CRS.

    Raises:
        CrsError: PROJ does not know it.
    """
    return _parts(definition_of(value))


def epsg_of(value: CrsLike) -> int:
    """The EPSG code of a CRS: a number, `EPSG:32631`, or an object of pyproj or rasterio."""
    code: Any = value
    if hasattr(value, "to_epsg"):
        code = value.to_epsg()
        if code is None:
            raise CrsError(f"the CRS has no EPSG code: {value}")
    elif isinstance(value, str):
        code = value.strip().upper().removeprefix("EPSG:")
        if not code.isdigit():
            raise CrsError(f"expected an EPSG code such as EPSG:32631, found {value!r}")
    return int(code)
