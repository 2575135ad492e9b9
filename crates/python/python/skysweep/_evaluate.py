"""Errors of surfaces against a reference, of files and of grids in memory."""

from __future__ import annotations

import os
import tempfile
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from . import _jobs, _native
from ._call import path_of
from ._errors import InputError, SkysweepError
from ._raster import Raster, Surface, assumed, heights_of, is_in_memory, raster_of
from .reports import GridEvalReport

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._jobs import EvaluateSettings

__all__ = ["evaluate"]

#: Map on which arrays without a CRS are compared, for which any in metres will do.
_ANY_MAP = "EPSG:32631"


def evaluate(
    test: Surface, reference: Surface, *, cell_m: float | None = None, **settings: Unpack[EvaluateSettings]
) -> GridEvalReport:
    """Measures the errors of a surface against a reference.

    Both may be files, of which the kind decides the evaluation (:func:`evaluate_grids`,
    :func:`evaluate_surfaces`, :func:`evaluate_maps`), or grids in memory: a :class:`Raster`; an
    `xarray.DataArray`; an array (rows, columns) of metres, which lies where the other grid lies if
    that has as many rows and columns, or begins at the same corner with cells of `cell_m`.

    Heights above different datums are converted. A grid in memory that does not say what its heights
    are above is taken as the other surface, with a :class:`DatumWarning`; one without a CRS is taken
    to lie on the map of the other.

    Args:
        test: Surface to evaluate.
        reference: Surface that is believed. Errors are measured at its cells.
        cell_m: Side of the cells of arrays without a place, metres.
        **settings: Settings of the evaluation.

    Returns:
        The report of the evaluation; of grids with ``metrics``: ``mae``, ``rmse``, ``nmad``, …,
        metres. Its type is that of grids; :func:`evaluate_surfaces` and :func:`evaluate_maps` have
        the types of the others.

    Raises:
        InputError: A grid is empty or has no place, the grids share no cell, or a value such as −9999
            stands for no data.
        FileError: A file cannot be read.
        CrsError: The CRSs or vertical datums do not fit.

    Example:
        >>> import skysweep
        >>> truth = skysweep.read_raster("data-samples/town/truth/dsm.tif")
        >>> higher = truth.with_values(truth.values + 0.25)
        >>> round(skysweep.evaluate(higher, truth, alignment="none").metrics.mae, 3)
        0.25
    """
    given: dict[str, Any] = dict(settings)
    surfaces = {"test": test, "reference": reference}
    held = {name: raster_of(name, surface) for name, surface in surfaces.items() if is_in_memory(surface)}
    if not held:
        return _evaluated(path_of(test), path_of(reference), given)
    files = {name: path_of(surface) for name, surface in surfaces.items() if name not in held}
    placed = _placed(held, files, cell_m)
    _take_datums(placed, files, given)
    with tempfile.TemporaryDirectory(prefix="skysweep") as folder:
        for name, raster in placed.items():
            path = os.path.join(folder, f"{name}.tif")
            assert raster.geotransform is not None and raster.crs is not None
            heights = heights_of(name, raster)
            _native.write_grid(path, heights, raster.geotransform, (raster.crs, raster.vertical), False)
            files[name] = path
        if "test" in held:
            given.setdefault("target", "nowhere")
        return _evaluated(files["test"], files["reference"], given)


def _evaluated(test: str, reference: str, settings: dict[str, Any]) -> GridEvalReport:
    kind = _jobs.kind_of_evaluation(test, reference)
    if kind == "maps":
        return cast(GridEvalReport, _jobs.evaluate_maps(test, reference, **settings))
    if kind == "surfaces":
        return cast(GridEvalReport, _jobs.evaluate_surfaces(test, reference, **settings))
    return _jobs.evaluate_grids(test, reference, **settings)


def _facts(path: str) -> tuple[str | None, str | None]:
    """CRS and vertical datum that a raster file states. What cannot be read is for the job to say."""
    inside = os.path.join(path, "dsm", "dsm.tif")
    try:
        return _native.file_crs(inside if os.path.isfile(inside) else path)
    except SkysweepError:
        return None, None


def _placed(held: dict[str, Raster], files: dict[str, str], cell_m: float | None) -> dict[str, Raster]:
    """The grids in memory with a place and a CRS."""
    if cell_m is not None and not (np.isfinite(cell_m) and cell_m > 0.0):
        raise InputError(f"cell_m is {cell_m}, expected a positive number of metres")
    known = [raster for raster in held.values() if raster.geotransform is not None]
    placed = {}
    for name, raster in held.items():
        place, crs = raster.geotransform, raster.crs
        if place is None and cell_m is not None:
            place = (500_000.0, cell_m, 0.0, 5_000_000.0, 0.0, -cell_m)
        elif place is None and known and known[0].shape == raster.shape:
            place, crs = known[0].geotransform, known[0].crs
        elif place is None:
            raise InputError(f"{name} has no place: give cell_m, or a Raster or DataArray with coordinates")
        if crs is None:
            others = [other.crs for other in held.values()] + [_facts(path)[0] for path in files.values()]
            crs = next((other for other in others if other is not None), _ANY_MAP)
        placed[name] = Raster._read(raster.values, place, crs, raster.vertical, None, raster.unit)
    return placed


def _take_datums(placed: dict[str, Raster], files: dict[str, str], given: dict[str, Any]) -> None:
    """Gives grids in memory that name no datum that of the other surface, with a warning."""
    named = {name: given.get(f"{name}_vertical") for name in ("test", "reference")}
    stated = {name: raster.vertical for name, raster in placed.items()}
    stated.update({name: _facts(path)[1] for name, path in files.items()})
    known = {name: named[name] or stated[name] for name in stated}
    for name, other in (("test", "reference"), ("reference", "test")):
        datum = known[other]
        if name in placed and known[name] is None and datum is not None:
            assumed(name, datum, f"as the {other}; give a Raster with vertical, or {name}_vertical, to name it")
            placed[name].vertical = datum
