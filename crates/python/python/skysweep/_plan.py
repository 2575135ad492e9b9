"""Planned runs: a plan, its chunks, and the merge."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from . import _jobs
from ._call import PathLike, Progress, path_of
from ._errors import InputError
from .reports import ChunkEstimate, ChunkRunReport, DsmReport, PlanFile

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._jobs import DsmSettings

__all__ = ["Plan"]

#: Report of a run, which is written last.
_REPORT = ("report", "report.json")
#: Rasters of a run.
_RASTERS = ("dsm.tif", "sigma.tif", "views.tif", "confidence.tif", "filled.tif", "source.tif")


class Plan:
    """A surface model in parts: a run folder with its plan.

    ``Plan(folder)`` opens a run folder that :meth:`make` or ``skysweep plan`` has made.

    Raises:
        FileError: The folder has no plan, or the plan cannot be read.

    Example:
        >>> import skysweep
        >>> plan = skysweep.Plan.make(["left.tif", "right.tif"], "run", gsd_m=0.5, chunk=2048)
        >>> for chunk in range(len(plan)):
        ...     computed = plan.run_chunk(chunk).computed
        >>> report = plan.merge()
    """

    #: Folder of the run.
    folder: str
    #: The plan with its estimates, as ``plan.json`` has it.
    content: PlanFile

    def __init__(self, folder: Any) -> None:
        self.folder = os.path.abspath(path_of(folder))
        self.content = _jobs.read_plan(self.folder)

    @classmethod
    def make(
        cls, images: Sequence[PathLike], output: PathLike, *, progress: Progress = None, **settings: Unpack[DsmSettings]
    ) -> Plan:
        """Plans a run into the folder `output`. The settings are those of :func:`dsm`.

        Raises:
            SkysweepError: As :func:`dsm`.
        """
        _jobs.plan_run(images, output, progress=progress, **settings)
        return cls(output)

    def __repr__(self) -> str:
        return f"<skysweep.Plan of {len(self)} chunks in {self.folder}>"

    def __len__(self) -> int:
        """Number of chunks."""
        return len(self.content.plan.chunks)

    @property
    def id(self) -> str:
        """Identity of the plan."""
        return self.content.id

    def needed_mb(self, chunk: int) -> int:
        """Estimated memory of a chunk, megabytes."""
        return self._estimate(chunk).needed_mb

    def cpu_seconds(self, chunk: int) -> float:
        """Estimated processor time of a chunk, seconds; rough."""
        return self._estimate(chunk).cpu_seconds

    @property
    def merge_mb(self) -> int:
        """Estimated memory of the merge, megabytes."""
        return self.content.estimate.merge_mb

    def finished(self) -> DsmReport | None:
        """The report of the run, where all its products are there, made of this plan, and no chunk is
        void for an error; `None` otherwise."""
        try:
            with open(os.path.join(self.folder, *_REPORT), encoding="utf-8") as file:
                report = DsmReport._of(json.load(file))
        except (OSError, ValueError):
            return None
        places = [("dsm", name) for name in _RASTERS]
        if self.content.plan.config.products:
            places.append(("products", "report.json"))
        is_whole = report.plan == self.id and not (report.chunks and report.chunks.failed)
        return report if is_whole and all(os.path.isfile(os.path.join(self.folder, *place)) for place in places) else None

    def _estimate(self, chunk: int) -> ChunkEstimate:
        if not 0 <= chunk < len(self):
            raise InputError(f"the plan has {len(self)} chunks and none with number {chunk}")
        return self.content.estimate.chunks[chunk]

    def run_chunk(
        self, chunk: int, *, threads: int | None = None, resume: bool = False, progress: Progress = None
    ) -> ChunkRunReport:
        """Computes a chunk, unless it has a result or another process computes it.

        Returns:
            How many chunks were ``computed``, ``done_before`` or are computed ``elsewhere``, and
            those that ``failed`` with the reasons.
        """
        self._estimate(chunk)
        return _jobs.run_chunks(self.folder, chunks=str(chunk), threads=threads, resume=resume, progress=progress)

    def run_chunks(
        self,
        chunks: Sequence[int] | str | None = None,
        *,
        threads: int | None = None,
        resume: bool = False,
        progress: Progress = None,
    ) -> ChunkRunReport:
        """Computes several chunks: numbers, a share (``"2/5"``), or all that nobody computes."""
        if chunks is not None and not isinstance(chunks, str):
            chunks = ",".join(str(int(chunk)) for chunk in chunks)
        return _jobs.run_chunks(self.folder, chunks=chunks, threads=threads, resume=resume, progress=progress)

    def merge(
        self,
        *,
        partial: bool = False,
        overwrite: bool = False,
        threads: int | None = None,
        progress: Progress = None,
    ) -> DsmReport:
        """Makes the surface model of the chunks; returns the report of the run.

        Args:
            partial: Whether chunks without a result are left void.
            overwrite: Whether existing products may be replaced.
            threads: Worker threads; all cores when `None`.
            progress: See :class:`Step`.

        Raises:
            SkysweepError: Chunks have no result and `partial` is not set.
        """
        return _jobs.merge_run(
            self.folder, partial=partial, overwrite=overwrite, threads=threads, progress=progress
        )
