"""What runs on the workers of a Dask cluster: a chunk, the merge, and waits for other processes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from . import _jobs
from ._call import Report
from ._errors import InputError, InUseError, OutputExistsError, SkysweepError
from ._plan import Plan
from .reports import DsmReport

__all__ = ["chunk_task", "hello", "merge_task", "patient_chunk", "patient_merge", "wait_s"]

#: First and longest wait for what another process holds, seconds. Its claim on a chunk ends a minute
#: after it is gone.
_WAITS_S = (1.0, 60.0)


class _ChunkFailed(SkysweepError):
    """A chunk that could not be computed."""


def wait_s(waits: int, chunk: int) -> float:
    """The wait before another look, which grows, and differs between chunks."""
    first, most = _WAITS_S
    return min(first * 2.0 ** min(waits, 16), most) * (1.0 + (chunk % 8) / 8.0)


def _sweep(folder: str, plan: str, chunk: int, threads: int | None) -> Report:
    """Computes a chunk. This is all that a task does which depends on the images."""
    report = _jobs.run_chunks(folder, chunks=str(chunk), threads=threads, plan=plan)
    if report.failed:
        # An earlier failure is tried again.
        report = _jobs.run_chunks(folder, chunks=str(chunk), threads=threads, plan=plan, resume=True)
    if report.failed:
        raise _ChunkFailed(report.failed[0].reason)
    return report


def chunk_task(chunk: int, folder: str, plan: str, threads: int | None) -> dict[str, Any]:
    """Computes a chunk on a worker, unless another process holds it or the run; returns how long it
    took."""
    start, before = time.monotonic(), time.process_time()
    try:
        report = _sweep(folder, plan, chunk, threads)
        held, computed = bool(report["elsewhere"]), int(report["computed"])
    except InUseError:
        held, computed = True, 0
    seconds, cpu_seconds = time.monotonic() - start, time.process_time() - before
    return {"held": held, "computed": computed, "seconds": seconds, "cpu_seconds": cpu_seconds}


def merge_task(folder: str, plan: str, partial: bool, overwrite: bool, threads: int | None) -> DsmReport | None:
    """Merges the chunks on a worker; `None` where another process has the run for itself."""
    try:
        return _jobs.merge_run(folder, partial=partial, overwrite=overwrite, threads=threads, plan=plan)
    except InUseError:
        return None
    except OutputExistsError:
        # Another process may have merged the chunks meanwhile.
        finished = Plan(folder).finished()
        if finished is None:
            raise
        return finished


def patient_chunk(chunk: int, tries: int, partial: bool, **settings: Any) -> dict[str, Any]:
    """As :func:`chunk_task`, but waits and tries again on the worker."""
    waits = 0
    while True:
        try:
            result = chunk_task(chunk, **settings)
        except InputError:
            raise
        except SkysweepError as error:
            tries -= 1
            if tries < 0:
                if partial:
                    return {"held": False, "computed": 0, "failed": str(error)}
                raise
            continue
        if not result["held"]:
            return result
        time.sleep(wait_s(waits, chunk))
        waits += 1


def patient_merge(chunks: Sequence[Any], **settings: Any) -> DsmReport:
    """As :func:`merge_task`, but waits on the worker. The results of the chunks are only waited for."""
    del chunks
    waits = 0
    while True:
        report = merge_task(**settings)
        if report is not None:
            return report
        time.sleep(wait_s(waits, 0))
        waits += 1


def hello() -> None:
    """A task of nothing, for which a cluster that grows with its work starts a worker."""
