"""The exceptions of the package. Their text is that of the command line."""

from __future__ import annotations

__all__ = [
    "SkysweepError",
    "InputError",
    "FileError",
    "OutputExistsError",
    "CrsError",
    "CancelledError",
]


class SkysweepError(Exception):
    """A job or an object has no result. The other exceptions of the package derive from it."""


class InputError(SkysweepError, ValueError):
    """A setting or an array that cannot be used."""


class FileError(SkysweepError, OSError):
    """A file cannot be read or written."""


class OutputExistsError(FileError, FileExistsError):
    """An output exists and `overwrite` is not set. Nothing was changed."""


class CrsError(SkysweepError, ValueError):
    """A coordinate reference system or a vertical datum cannot be used."""


class CancelledError(SkysweepError):
    """The job was asked to stop. Raise it in a progress function to stop a job."""


for _class in (SkysweepError, InputError, FileError, OutputExistsError, CrsError, CancelledError):
    _class.__module__ = "skysweep"
