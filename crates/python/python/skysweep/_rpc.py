"""RPC cameras."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from . import _native
from ._arrays import empty, refuse_marks, shaped, together
from ._call import local_path, path_of
from ._errors import InputError

__all__ = ["FittedRpc", "Rpc"]

#: Names of the coefficients in RPC00B, and those of the fields.
_RPC00B = {
    "LINE_OFF": "line_off",
    "SAMP_OFF": "samp_off",
    "LAT_OFF": "lat_off",
    "LONG_OFF": "long_off",
    "HEIGHT_OFF": "height_off",
    "LINE_SCALE": "line_scale",
    "SAMP_SCALE": "samp_scale",
    "LAT_SCALE": "lat_scale",
    "LONG_SCALE": "long_scale",
    "HEIGHT_SCALE": "height_scale",
    "LINE_NUM_COEFF": "line_num",
    "LINE_DEN_COEFF": "line_den",
    "SAMP_NUM_COEFF": "samp_num",
    "SAMP_DEN_COEFF": "samp_den",
    "ERR_BIAS": "err_bias_m",
    "ERR_RAND": "err_rand_m",
}


def _field(name: str, value: Any) -> Any:
    try:
        if isinstance(value, str):
            numbers = [float(part) for part in value.split()]
            return numbers if name.endswith(("num", "den")) else numbers[0]
        if name.endswith(("num", "den")):
            return [float(number) for number in value]
        return None if value is None else float(value)
    except (TypeError, ValueError, IndexError):
        raise InputError(f"{name} is {value!r}, expected numbers") from None


class Rpc:
    """The RPC00B camera of a satellite image, with a correction of its pointing.

    Image positions are (sample, line), that is (column, row), in pixels; the centre of the
    upper-left pixel is (0, 0). Ground positions are longitude and latitude in degrees, and heights
    in metres above the WGS 84 ellipsoid.

    Args:
        source: A file that holds an RPC, or an image with one in or beside it; an open rasterio
            dataset; a dictionary with the names of RPC00B (``LINE_OFF``, …, as GDAL has them) or
            of :meth:`to_dict`; or an object with ``to_gdal``, such as ``rasterio.rpc.RPC``.
        correction: What moves the positions that the RPC gives, as :attr:`correction` has it.

    Raises:
        FileError: The file cannot be read or holds no RPC; `FileMissingError` where there is none.
        InputError: The numbers do not form a camera.

    Example:
        >>> import skysweep
        >>> rpc = skysweep.Rpc("data-samples/town/view_1.tif")
        >>> sample, line = rpc.project(5.4, 43.53, 210.0)
        >>> lon, lat = rpc.localize(sample, line, 210.0)
        >>> round(float(lon), 6), round(float(lat), 6)
        (5.4, 43.53)
    """

    #: Format in which a file held the RPC; `None` for other sources.
    format: str | None
    #: File that held the RPC; `None` for other sources.
    path: str | None
    #: What a reader had to guess or to leave out.
    warnings: list[str]

    def __init__(self, source: Any, *, correction: Mapping[str, Any] | None = None) -> None:
        self.format, self.path, self.warnings = None, None, []
        if hasattr(source, "to_gdal"):
            source = source.to_gdal()
        if isinstance(source, Mapping):
            fields = {_RPC00B.get(str(key).upper(), str(key)): value for key, value in source.items()}
            known = set(_RPC00B.values())
            numbers = {name: _field(name, fields[name]) for name in known if name in fields}
            if missing := sorted(known - set(numbers) - {"err_bias_m", "err_rand_m"}):
                raise InputError(f"the RPC lacks {', '.join(missing)}")
            text = json.dumps({"err_bias_m": None, "err_rand_m": None, **numbers})
            self._core = _native.RpcCore.from_json(_finite(text), _correction(correction))
        else:
            with local_path(source) as local:
                self._core, self.format, found, self.warnings = _native.RpcCore.read(local)
            self.path = os.fspath(found)
            if correction is not None:
                self._core = _native.RpcCore.from_json(self._core.to_json()[0], _correction(correction))

    @classmethod
    def _of(cls, core: _native.RpcCore) -> Rpc:
        new = cls.__new__(cls)
        new._core, new.format, new.path, new.warnings = core, None, None, []
        return new

    @classmethod
    def from_run(cls, run: Any, image: Any) -> Rpc:
        """The camera of an image with the pointing correction that a run of :func:`dsm` found.

        Args:
            run: Folder of the run.
            image: An image of the run: its file, or its name alone where that is unique.

        Raises:
            FileError: The folder holds no report of a run, or the image has no usable RPC.
            InputError: The run did not use the image.

        Example:
            >>> import skysweep
            >>> rpc = skysweep.Rpc.from_run("run", "left.tif")
            >>> shift_px = rpc.correction["translation_px"]
        """
        new = cls._of(_native.RpcCore.from_run(path_of(run), path_of(image)))
        return new

    def __repr__(self) -> str:
        fields = self.to_dict()
        return (
            f"<skysweep.Rpc at {fields['long_off']:.5f}° {fields['lat_off']:.5f}°, "
            f"{fields['height_off']:.0f} ± {fields['height_scale']:.0f} m>"
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Rpc) and self._core.to_json() == other._core.to_json()

    def __hash__(self) -> int:
        return hash(self._core.to_json())

    def __reduce__(self) -> Any:
        return _again, (*self._core.to_json(), self.format, self.path, self.warnings)

    def to_dict(self) -> dict[str, Any]:
        """The numbers by the names of the fields, without the correction."""
        fields: dict[str, Any] = json.loads(self._core.to_json()[0])
        return fields

    def to_gdal(self) -> dict[str, str]:
        """The numbers by the names of RPC00B as GDAL's metadata domain ``RPC`` has them."""
        fields = self.to_dict()

        def text(value: Any) -> str:
            return " ".join(map(repr, value)) if isinstance(value, list) else repr(value)

        return {name: text(fields[key]) for name, key in _RPC00B.items() if fields[key] is not None}

    @property
    def correction(self) -> dict[str, Any]:
        """What moves the positions of the RPC: ``translation_px`` (sample, line), ``linear`` (2 × 2,
        minus the identity), and its ``centre`` in the image."""
        correction: dict[str, Any] = json.loads(self._core.to_json()[1])
        return correction

    def corrected(
        self,
        translation_px: Sequence[float] = (0.0, 0.0),
        linear: Sequence[Sequence[float]] = ((0.0, 0.0), (0.0, 0.0)),
        centre: Sequence[float] = (0.0, 0.0),
    ) -> Rpc:
        """The camera with this correction in place of its own.

        Args:
            translation_px: Shift at `centre`: samples, lines.
            linear: Linear part minus the identity, pixels per pixel.
            centre: Image position about which the linear part acts: sample, line.
        """
        sample, line = (float(value) for value in centre)
        correction = {
            "translation_px": [float(value) for value in translation_px],
            "linear": [[float(value) for value in row] for row in linear],
            "centre": {"sample": sample, "line": line},
        }
        return Rpc._of(_native.RpcCore.from_json(self._core.to_json()[0], _correction(correction)))

    def project(self, lon: ArrayLike, lat: ArrayLike, height: ArrayLike) -> tuple[Any, Any]:
        """Image positions of ground points.

        Args:
            lon, lat: Degrees; arrays of any shapes that fit one another, or numbers.
            height: Metres above the ellipsoid. One number for all points is the fastest.

        Returns:
            Sample and line, pixels, f64, in the common shape. NaN where the camera has no image of
            the point: a coordinate is not finite, or the point is far outside of its domain.

        Raises:
            InputError: An array does not hold real numbers, the shapes do not fit, or heights such as
                −9999 stand for no data.
        """
        (flat_lon, flat_lat, flat_height), shape = together({"lon": lon, "lat": lat, "height": height})
        refuse_marks("height", flat_height)
        sample, line = empty(shape), empty(shape)
        self._core.project([flat_lon, flat_lat, flat_height], [sample, line])
        return shaped(sample, shape), shaped(line, shape)

    def localize(self, sample: ArrayLike, line: ArrayLike, height: ArrayLike) -> tuple[Any, Any]:
        """Ground points of a given height that are seen at image positions.

        Args:
            sample, line: Pixels; arrays of any shapes that fit one another, or numbers.
            height: Metres above the ellipsoid.

        Returns:
            Longitude and latitude, degrees, f64, in the common shape; NaN where there is none.

        Raises:
            InputError: An array does not hold real numbers, the shapes do not fit, or heights such as
                −9999 stand for no data.
        """
        (flat_sample, flat_line, flat_height), shape = together({"sample": sample, "line": line, "height": height})
        refuse_marks("height", flat_height)
        lon, lat = empty(shape), empty(shape)
        self._core.localize([flat_sample, flat_line, flat_height], [lon, lat])
        return shaped(lon, shape), shaped(lat, shape)

    def gsd(self, lon: float, lat: float, height: float) -> tuple[float, float]:
        """Side of a pixel on the ground along sample and line, metres."""
        (sample, line), _ = self._core.view(float(lon), float(lat), float(height))
        return sample, line

    def view_direction(self, lon: float, lat: float, height: float) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Unit vector from a ground point to the satellite: east, north, up."""
        return np.array(self._core.view(float(lon), float(lat), float(height))[1])

    def incidence_deg(self, lon: float, lat: float, height: float) -> float:
        """Angle between the line of sight and the vertical at a ground point, degrees."""
        east, north, up = self.view_direction(lon, lat, height)
        return math.degrees(math.atan2(math.hypot(east, north), up))

    def cropped(self, sample: float, line: float) -> Rpc:
        """The camera of a crop whose upper-left pixel is (sample, line)."""
        return Rpc._of(self._core.cropped(float(sample), float(line)))

    def rescaled(self, factor: float) -> Rpc:
        """The camera of the image resampled by `factor`: 0.5 halves it."""
        return Rpc._of(self._core.rescaled(float(factor)))

    def folded(self) -> tuple[Rpc, float]:
        """One RPC that includes the correction, for formats without corrections, and its largest
        distance from the corrected camera, pixels."""
        core, residual_px = self._core.folded()
        return Rpc._of(core), residual_px

    def to_text(self, format: str = "text") -> str:
        """The RPC (without its correction) as an RPC file: ``text``, ``rpb`` or ``json``."""
        return self._core.text(format)

    def write(self, path: Any, format: str | None = None, *, overwrite: bool = False) -> None:
        """Writes the RPC (without its correction) as a file.

        Args:
            path: File to write.
            format: ``text``, ``rpb`` or ``json``; taken from the ending when `None`.
            overwrite: Whether an existing file may be replaced.

        Raises:
            FileError: The file exists or cannot be written.
        """
        path = path_of(path)
        endings = {".txt": "text", ".rpb": "rpb", ".json": "json"}
        if format is None:
            format = endings.get(os.path.splitext(path)[1].lower())
            if format is None:
                raise InputError(f"the ending of {path} names no format: give text, rpb or json")
        self._core.write(path, format, overwrite)

    @staticmethod
    def fit(
        lon: ArrayLike, lat: ArrayLike, height: ArrayLike, sample: ArrayLike, line: ArrayLike
    ) -> FittedRpc:
        """Fits an RPC to ground points and their image positions.

        Args:
            lon, lat, height: Ground points: degrees, metres above the ellipsoid.
            sample, line: Their image positions, pixels. All arrays have shapes that fit.

        Raises:
            InputError: Too few points, numbers that are not finite, or points that determine no
                camera.
        """
        values = {"lon": lon, "lat": lat, "height": height, "sample": sample, "line": line}
        flat, shape = together(values)
        whole = [np.ascontiguousarray(np.broadcast_to(array, (int(np.prod(shape)),))) for array in flat]
        core, rms_px, max_px = _native.RpcCore.fit(whole[:3], whole[3:])
        return FittedRpc(Rpc._of(core), rms_px, max_px)


class FittedRpc(NamedTuple):
    """A fitted camera with its residuals."""

    #: The camera.
    rpc: Rpc
    #: Root mean square distance in the image, pixels.
    rms_px: float
    #: Largest distance in the image, pixels.
    max_px: float


def _finite(text: str) -> str:
    if "NaN" in text or "Infinity" in text:
        raise InputError("the RPC or its correction has a number that is not finite")
    return text


def _correction(correction: Mapping[str, Any] | None) -> str | None:
    return None if correction is None else _finite(json.dumps(correction))


def _again(rpc: str, correction: str, format: str | None, path: str | None, warnings: list[str]) -> Rpc:
    new = Rpc._of(_native.RpcCore.from_json(rpc, correction))
    new.format, new.path, new.warnings = format, path, warnings
    return new
