"""Calling jobs: settings to JSON, progress, reports."""

from __future__ import annotations

import contextlib
import copy
import difflib
import functools
import inspect
import json
import logging
import math
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, ClassVar, Protocol, TypeVar, Union, cast

from . import _native
from ._crs import epsg_of, parts_of
from ._errors import InputError

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["BoundsLike", "CrsCode", "PathLike", "Progress", "Report", "Step", "job", "run"]

_LOG = logging.getLogger("skysweep")


class Dataset(Protocol):
    """An open dataset of rasterio."""

    @property
    def name(self) -> str: ...
    @property
    def profile(self) -> Any: ...


class Polygons(Protocol):
    """A GeoDataFrame or GeoSeries with its CRS, or a geometry in longitude and latitude."""

    @property
    def __geo_interface__(self) -> Any: ...


class _WithCode(Protocol):
    def to_epsg(self) -> int | None: ...


#: Text, an `os.PathLike`, or an open rasterio dataset, of which the file is taken. Polygons where a
#: setting takes areas or masks.
PathLike = Union[str, "os.PathLike[str]", Dataset, Polygons]
#: x_min, y_min, x_max, y_max on the map; or a GeoDataFrame, whose bounds are brought to the map.
BoundsLike = Union[Sequence[float], Polygons]
#: An EPSG code, `EPSG:32631`, or a CRS of pyproj or rasterio that has a code.
CrsCode = Union[int, str, _WithCode]

_Function = TypeVar("_Function", bound=Callable[..., Any])
_Result = TypeVar("_Result")


class Report(dict):  # type: ignore[type-arg]
    """The report of a job: a dictionary whose keys are attributes as well.

    The keys are those of the command line's ``--json``. ``None`` stands for numbers that are not
    known. The class of each report is in :mod:`skysweep.reports`, with its attributes and their
    types.
    """

    #: Classes of the dictionaries under a key, by name: `*` stands before the class of the values of
    #: a dictionary, `|` between classes of which one fits.
    _parts: ClassVar[Mapping[str, str]] = {}
    #: What an attribute is where the report has no such key.
    _absent: ClassVar[Mapping[str, Any]] = {}

    if not TYPE_CHECKING:
        # For mypy the attributes are those that the class declares, and no others.
        def __getattr__(self, name: str) -> Any:
            if name in self:
                return self[name]
            if name in self._absent:
                return copy.copy(self._absent[name])
            known = ", ".join(map(str, self)) or "none"
            raise AttributeError(f"the report has no {name!r}; it has {known}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *map(str, self)]

    @classmethod
    def _of(cls, content: Mapping[str, Any]) -> Self:
        """Makes the report of what JSON holds, with a class for each part."""
        return cls({key: _typed(cls, cls._parts.get(key, ""), value) for key, value in content.items()})


def _typed(owner: type[Report], name: str, value: Any) -> Any:
    if isinstance(value, list):
        return [_typed(owner, name, item) for item in value]
    if not isinstance(value, dict):
        return value
    if name.startswith("*"):
        return Report({key: _typed(owner, name[1:], item) for key, item in value.items()})
    known = [getattr(sys.modules[owner.__module__], one) for one in name.split("|") if one]
    # Of several classes the one that has attributes for most of the keys.
    fitting = max(known, key=lambda one: len(one.__annotations__.keys() & value.keys()), default=Report)
    return fitting._of(value)


@dataclass(frozen=True)
class Step:
    """Where a job is. A progress function is called with it when a stage begins and as it goes on,
    on the thread that called the job. An exception of the function stops the job, which leaves
    nothing half-written, and is raised to the caller."""

    #: Name of the stage.
    stage: str
    #: Steps of the stage that are done.
    done: int
    #: Steps of the stage.
    total: int


#: `None` shows nothing, `True` a bar (tqdm); a function is called with every `Step`.
Progress = Union[None, bool, Callable[[Step], object]]


class _Watcher:
    """Receives what a job reports. Warnings, choices and parts go to the logger ``skysweep``."""

    def __init__(self, show: Callable[[Step], object] | None) -> None:
        self._show = show
        self._step = Step("", 0, 0)

    def begin(self, stage: str, total: int) -> None:
        self._tell(Step(stage, 0, total))

    def steps(self, count: int) -> None:
        self._tell(Step(self._step.stage, self._step.done + count, self._step.total))

    def _tell(self, step: Step) -> None:
        self._step = step
        if self._show is not None:
            self._show(step)

    def choice(self, name: str, value: str, reason: str) -> None:
        _LOG.info("%s: %s (%s)", name, value, reason)

    def warn(self, text: str) -> None:
        _LOG.warning("%s", text)

    def part(self, name: str, state: str | None) -> None:
        _LOG.info("%s: %s", name, "done" if state is None else state)


class _Bar:
    """A bar of tqdm for each stage."""

    def __init__(self) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            raise InputError("progress=True needs the package tqdm; install it or give a function") from None
        self._make: Any = tqdm
        self._bar: Any = None

    def __call__(self, step: Step) -> None:
        if step.done == 0:
            self.close()
            self._bar = self._make(total=step.total, desc=step.stage)
        elif self._bar is not None:
            self._bar.update(step.done - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


@contextlib.contextmanager
def watcher(progress: Progress) -> Iterator[_Watcher]:
    """Makes the watcher for an argument `progress`."""
    if progress is None or progress is False:
        yield _Watcher(None)
    elif progress is True:
        bar = _Bar()
        try:
            yield _Watcher(bar)
        finally:
            bar.close()
    elif callable(progress):
        yield _Watcher(progress)
    else:
        raise TypeError(f"progress is {progress!r}, expected None, True or a function")


#: Where GDAL keeps files in the memory of one process, with its own copy of GDAL.
_IN_MEMORY = "/vsimem/"


@contextlib.contextmanager
def local_path(value: Any) -> Iterator[str]:
    """The path that a value names, while the block lasts: datasets in memory are copied to a file."""
    with contextlib.ExitStack() as stack:
        if _is_dataset(value) and str(value.name).startswith(_IN_MEMORY):
            yield _Files(stack).dataset(value)
        else:
            yield path_of(value)


def _is_dataset(value: Any) -> bool:
    return hasattr(value, "profile") and isinstance(getattr(value, "name", None), str)


def path_of(value: Any) -> str:
    """The path that a value names: text, `os.PathLike`, or an open dataset of rasterio."""
    if isinstance(value, (str, os.PathLike)):
        path = os.fspath(value)
        return os.fsdecode(path)
    if _is_dataset(value):
        return str(value.name)
    raise InputError(f"expected a path or an open dataset, found {type(value).__name__}")


class _Files:
    """Files for objects in memory that a job takes as files; they live as long as the call."""

    def __init__(self, stack: contextlib.ExitStack) -> None:
        self._stack = stack
        self._folder: str | None = None
        self._count = 0

    def path(self, ending: str) -> str:
        if self._folder is None:
            self._folder = self._stack.enter_context(tempfile.TemporaryDirectory(prefix="skysweep"))
        self._count += 1
        return os.path.join(self._folder, f"{self._count}{ending}")

    def dataset(self, value: Any) -> str:
        """Writes a dataset of rasterio that lies in memory, with its RPC and metadata."""
        import rasterio.shutil

        path = self.path(".tif")
        rasterio.shutil.copy(value, path, driver="GTiff")
        return path

    def polygons(self, name: str, value: Any) -> str:
        """Writes a GeoDataFrame, or a geometry in longitude and latitude, as GeoJSON."""
        frame = _in_degrees(name, value)
        shape = _plain_json(frame.__geo_interface__)
        if shape["type"] not in ("FeatureCollection", "Feature"):
            shape = {"type": "Feature", "properties": {}, "geometry": shape}
        if shape["type"] == "Feature":
            shape = {"type": "FeatureCollection", "features": [shape]}
        path = self.path(".geojson")
        with open(path, "w", encoding="utf-8") as file:
            json.dump(shape, file)
        return path


def _is_frame(value: Any) -> bool:
    """Whether a value is a GeoDataFrame or a GeoSeries, which have a CRS or lack it."""
    return hasattr(value, "to_crs") and hasattr(value, "total_bounds")


def _with_crs(name: str, frame: Any) -> Any:
    if frame.crs is None:
        raise InputError(f"{name} is a {type(frame).__name__} without a CRS; name it with set_crs")
    return frame


def _in_degrees(name: str, value: Any) -> Any:
    """Polygons in longitude and latitude. Geometries without a CRS are taken to be so."""
    if _is_frame(value):
        return _with_crs(name, value).to_crs(4326)
    if bounds := getattr(value, "bounds", None):
        west, south, east, north = bounds
        # Longitudes up to 360 are common; easting and northing lie far beyond.
        if not (-360.0 <= west <= east <= 360.0 and -90.0 <= south <= north <= 90.0):
            raise InputError(
                f"{name} reaches from {west:g}, {south:g} to {east:g}, {north:g}, which is no longitude and latitude; "
                "give a GeoDataFrame with its CRS"
            )
    return value


def _plain_json(value: Any) -> Any:
    return json.loads(json.dumps(value, default=str))


def _plain(name: str, value: Any, files: _Files) -> Any:
    """A setting as JSON knows it. `name` is its place, for errors."""
    if value is None or isinstance(value, (bool, int, str)):
        return epsg_of(value) if name.endswith("_epsg") and isinstance(value, str) else value
    if isinstance(value, float):
        if not math.isfinite(value):
            raise InputError(f"{name} is {value}, expected a finite number")
        return value
    if isinstance(value, Mapping):
        return {str(key): _plain(str(key), item, files) for key, item in value.items()}
    if name == "bounds" and hasattr(value, "bounds"):
        # The bounds of a geometry are on the map.
        return [float(edge) for edge in value.bounds]
    if hasattr(value, "to_epsg"):
        return epsg_of(value)
    if isinstance(value, os.PathLike) or hasattr(value, "profile"):
        in_memory = _is_dataset(value) and str(value.name).startswith(_IN_MEMORY)
        return files.dataset(value) if in_memory else path_of(value)
    if hasattr(value, "__geo_interface__"):
        return files.polygons(name, value)
    if hasattr(value, "dtype") and hasattr(value, "tolist"):
        if getattr(value, "size", 1) > 1_000_000:
            raise InputError(f"{name} has {value.size} values; settings are short")
        return _plain(name, value.tolist(), files)
    if isinstance(value, (list, tuple, set, frozenset, range)):
        return [_plain(name, item, files) for item in value]
    raise InputError(f"{name} is a {type(value).__name__}, which a setting cannot be")


def _area(value: Any, files: _Files) -> Any:
    """`area` takes a layer of a file; polygons in memory are written to one."""
    if isinstance(value, Mapping) or value is None:
        return value
    if hasattr(value, "__geo_interface__"):
        return {"file": files.polygons("area", value)}
    return {"file": path_of(value)}


def _bounds(given: dict[str, Any], known: Mapping[str, Any]) -> None:
    """Brings the bounds of a GeoDataFrame to a map that the job knows."""
    frame = _with_crs("bounds", given["bounds"])
    if "bounds_epsg" in known:
        given["bounds_epsg"] = frame.crs.to_epsg() or 4326
        frame = frame.to_crs(given["bounds_epsg"])
    else:
        wkt = _native.file_crs(path_of(given["surface"]))[0]
        if wkt is None:
            raise InputError("the surface has no CRS, so bounds are four numbers on its map")
        frame = frame.to_crs(parts_of(wkt).map)
    given["bounds"] = [float(edge) for edge in frame.total_bounds]


def run(name: str, settings: Mapping[str, Any], result: type[_Result]) -> _Result:
    """Runs the job called `name`, which returns a `result`. Settings that are `None` have their
    defaults."""
    given = {key: value for key, value in settings.items() if value is not None}
    progress = given.pop("progress", None)
    with contextlib.ExitStack() as stack:
        files = _Files(stack)
        if "area" in given:
            given["area"] = _area(given["area"], files)
        if _is_frame(given.get("bounds")):
            _bounds(given, settings)
        plain = {key: _plain(key, value, files) for key, value in given.items()}
        watching = stack.enter_context(watcher(progress))
        text = _native.run_job(name, json.dumps(plain, allow_nan=False), watching)
    found = json.loads(text)
    return cast(_Result, result._of(found) if issubclass(result, Report) else found)


def job(function: _Function) -> _Function:
    """Makes errors of wrong keywords name the keywords that there are."""
    signature = inspect.signature(function)
    known = list(signature.parameters)

    @functools.wraps(function)
    def call(*args: Any, **settings: Any) -> Any:
        for name in settings:
            if name not in known:
                near = difflib.get_close_matches(name, known, 1) or [k for k in known if k.startswith(name)]
                hint = f"did you mean {near[0]!r}? " if near else ""
                raise TypeError(
                    f"{function.__name__}() has no keyword {name!r}; {hint}Known are {', '.join(known)}"
                )
        return function(*args, **settings)

    return cast(_Function, call)
