"""Arrays as the library takes them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import InputError

Floats = NDArray[np.float64]


def floats(name: str, values: ArrayLike) -> Floats:
    """Numbers as an array of f64, without a copy where they are one. Void entries of masked arrays
    become NaN."""
    array: Any = np.ma.asanyarray(values)
    if array.dtype == bool or not (np.issubdtype(array.dtype, np.integer) or np.issubdtype(array.dtype, np.floating)):
        raise InputError(f"{name} has the type {array.dtype}, expected real numbers")
    if np.ma.isMaskedArray(values):
        masked: Floats = np.ma.filled(array.astype(np.float64), np.nan)
        return masked
    return np.asarray(array.data, dtype=np.float64)


#: Values by which files without NaN mark cells without data, when these are not declared.
_MARKS = (-9999.0, -32768.0, -32767.0, float(np.finfo(np.float32).min))


def refuse_marks(name: str, values: NDArray[Any]) -> None:
    """Refuses arrays in which a value such as −9999 stands for no data.

    Raises:
        InputError: Some of several values are one of these.
    """
    if values.size < 2 or not np.fmin.reduce(values, axis=None) < -9000.0:
        return
    for mark in _MARKS:
        count = int(np.count_nonzero(values == mark))
        if count:
            raise InputError(f"{name} has {count} values of exactly {mark:g}, which stands for no data: put NaN there")


def together(values: dict[str, ArrayLike]) -> tuple[list[Floats], tuple[int, ...]]:
    """Arrays of any shapes that fit one another, flat and contiguous, with their common shape.

    Arrays of one number stay so: nothing is repeated in memory for them.
    """
    arrays = {name: floats(name, value) for name, value in values.items()}
    try:
        shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise InputError(f"the arrays have shapes that do not fit one another: {shapes}") from None
    count = int(np.prod(shape, dtype=np.int64))

    def flat(array: Floats) -> Floats:
        if array.size == 1 and count > 0:
            return array.reshape(1)
        return np.ascontiguousarray(np.broadcast_to(array, shape)).reshape(-1)

    return [flat(array) for array in arrays.values()], shape


def empty(shape: tuple[int, ...]) -> Floats:
    """A flat array for as many numbers as a shape has."""
    return np.empty(math.prod(shape), dtype=np.float64)


def shaped(values: Floats, shape: tuple[int, ...]) -> Any:
    """An array of a shape; a number for the shape of none."""
    return values.reshape(shape)[()]
