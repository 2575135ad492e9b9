"""The exceptions and warnings of the package. Their text is that of the command line."""

from __future__ import annotations

__all__ = [
    "SkysweepError",
    "InputError",
    "FileError",
    "FileMissingError",
    "OutputExistsError",
    "InUseError",
    "CrsError",
    "CancelledError",
    "DatumWarning",
]


class SkysweepError(Exception):
    """A job or an object has no result. The other exceptions of the package derive from it."""


class InputError(SkysweepError, ValueError):
    """A setting or an array that cannot be used."""


class FileError(SkysweepError, OSError):
    """A file cannot be read or written.

    ``filename`` is the file as it was given, where the error is about one, and ``errno`` the number
    of the system's error, where the system refused.
    """

    def __str__(self) -> str:
        if self.strerror is not None:
            return str(self.strerror)
        # The text of Python's own errors with a file but without a number names neither.
        return str(self.args[0]) if self.args else super().__str__()


class FileMissingError(FileError, FileNotFoundError):
    """A file or a folder does not exist."""


class OutputExistsError(FileError, FileExistsError):
    """An output exists and `overwrite` is not set. Nothing was changed."""


class InUseError(FileError):
    """Another process has the output folder for itself, or works in it. Try again later."""


class CrsError(SkysweepError, ValueError):
    """A coordinate reference system or a vertical datum cannot be used."""


class CancelledError(SkysweepError):
    """The job was asked to stop. Raise it in a progress function to stop a job."""


class DatumWarning(UserWarning):
    """Heights do not say what they are above, and a datum was assumed. Between the ellipsoid and a
    geoid lie up to 100 metres."""


for _class in (
    SkysweepError,
    InputError,
    FileError,
    FileMissingError,
    OutputExistsError,
    InUseError,
    CrsError,
    CancelledError,
    DatumWarning,
):
    _class.__module__ = "skysweep"
