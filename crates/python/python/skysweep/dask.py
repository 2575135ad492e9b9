"""Planned runs on a Dask cluster: one task per chunk, and the merge as the last task.

The run folder is on storage that all workers see under one path. A chunk is done when its folder is
complete, whoever computed it: a run that was stopped goes on where it was, and workers of Dask and
``skysweep run`` may work in one folder at the same time.

The command ``skysweep-dask run RUN --scheduler ADDRESS`` does the same without Python code.
"""

from __future__ import annotations

import argparse
import logging
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Union

from ._call import Progress, Report, Step
from ._errors import InputError, SkysweepError
from ._plan import Plan

__all__ = ["local_cluster", "main", "run"]

_LOG = logging.getLogger("skysweep")

#: Share of the machine's memory that the workers of a local cluster may take together.
_MEMORY_SHARE = 0.8
#: Time between two looks at a chunk that another process computes, seconds.
_WAIT_S = 1.0
#: Name of the tasks on the dashboard.
_PREFIX = "skysweep"


class _ChunkFailed(SkysweepError):
    """A chunk that could not be computed."""


def _chunk(folder: str, plan_id: str, chunk: int, threads: int | None) -> dict[str, Any]:
    """Computes a chunk on a worker; returns how long it took."""
    start, before = time.monotonic(), time.process_time()
    plan = Plan(folder)
    if plan.id != plan_id:
        raise InputError(f"the plan in {folder} was replaced during the run; run again")
    while True:
        report = plan.run_chunk(chunk, threads=threads)
        if report.failed:
            # An earlier failure is tried again.
            report = plan.run_chunk(chunk, threads=threads, resume=True)
        if report.failed:
            raise _ChunkFailed(report.failed[0].reason)
        if not report.elsewhere:
            break
        # The process that has the chunk may be gone: its claim then ends by itself.
        time.sleep(_WAIT_S)
    seconds, cpu_seconds = time.monotonic() - start, time.process_time() - before
    return {"computed": report.computed, "seconds": seconds, "cpu_seconds": cpu_seconds}


def _merge(folder: str, plan_id: str, partial: bool, overwrite: bool, threads: int | None) -> Report:
    plan = Plan(folder)
    if plan.id != plan_id:
        raise InputError(f"the plan in {folder} was replaced during the run; run again")
    return plan.merge(partial=partial, overwrite=overwrite, threads=threads)


def local_cluster(plan: Union[Plan, str, os.PathLike[str]], workers: int | None = None, **settings: Any) -> Any:
    """A `distributed.LocalCluster` whose workers can hold the chunks of a plan.

    Args:
        plan: The plan, or its run folder.
        workers: Number of processes with one thread each; as many as cores, and as the memory holds
            chunks, when `None`.
        **settings: Further settings of `LocalCluster`.
    """
    import dask.config
    import psutil
    from distributed import LocalCluster

    plan = plan if isinstance(plan, Plan) else Plan(plan)
    memory_mb = _MEMORY_SHARE * psutil.virtual_memory().total / 1e6
    largest_mb = max((plan.needed_mb(chunk) for chunk in range(len(plan))), default=0)
    if workers is None:
        workers = max(1, min(os.cpu_count() or 1, int(memory_mb / max(largest_mb, 1))))
    # A chunk that no worker's share holds is still computed, one at a time.
    share = max(memory_mb / workers, float(largest_mb)) * 1e6
    given = {"processes": True, "threads_per_worker": 1, "memory_limit": 0, "dashboard_address": None}
    resources = {"MEMORY": share, "CPU": 1}
    # Dask makes workers return freed memory at once. Every raster of a chunk would then be made of new pages,
    # which costs a quarter of the processor time.
    with dask.config.set({"distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None}):
        return LocalCluster(n_workers=workers, resources=resources, **{**given, **settings})


def _resources(client: Any, plan: Plan, chunk: int, threads: int | None) -> dict[str, float]:
    """What a task takes of the workers' resources: those that all workers declare."""
    wanted = {"MEMORY": plan.needed_mb(chunk) * 1e6, "CPU": float(threads or 1)}
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    known = [set(worker.get("resources") or {}) for worker in workers]
    declared = set.intersection(*known) if known else set()
    return {name: amount for name, amount in wanted.items() if name in declared and amount > 0.0}


@contextmanager
def _client(client: Any, plan: Plan) -> Iterator[Any]:
    from distributed import Client

    if client is None:
        with local_cluster(plan) as cluster, Client(cluster) as own:
            yield own
    elif isinstance(client, str):
        with Client(client) as own:
            yield own
    else:
        yield client


def run(
    plan: Union[Plan, str, os.PathLike[str]],
    client: Any = None,
    retries: int = 3,
    *,
    threads: int | None = 1,
    partial: bool = False,
    overwrite: bool = False,
    progress: Progress = None,
) -> Report:
    """Computes the chunks of a plan on a cluster, and merges them.

    Args:
        plan: The plan, or its run folder.
        client: A `distributed.Client`, the address of a scheduler, or `None` for a cluster on this
            machine (:func:`local_cluster`). Workers that declare the resources ``MEMORY`` (bytes)
            and ``CPU`` get as many chunks at a time as these hold.
        retries: Times that a chunk is tried again, whose task failed or whose worker was lost.
        threads: Threads of each chunk; all cores of the worker when `None`.
        partial: Whether chunks that cannot be computed are left void. Otherwise they are an error.
        overwrite: Whether existing products may be replaced.
        progress: A function that is called with a :class:`skysweep.Step`, or `True` for a bar.

    Returns:
        The report of the run, with ``dask``: the chunks computed and found done, those tried again,
        those that failed, and seconds.

    Raises:
        ModuleNotFoundError: `dask.distributed` is not installed.
        SkysweepError: Chunks failed and `partial` is not set; the others are done.
    """
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    from ._call import watcher

    plan = plan if isinstance(plan, Plan) else Plan(plan)
    if retries < 0:
        raise InputError(f"the number of retries is {retries}, expected 0 or more")
    start = time.monotonic()
    with _client(client, plan) as connected, watcher(progress) as watching:
        watching.begin("sweeping chunks", len(plan))

        def submitted(chunk: int, attempt: int) -> Any:
            return connected.submit(
                _chunk,
                plan.folder,
                plan.id,
                chunk,
                threads,
                key=f"{_PREFIX}-chunk-{chunk:04d}-{attempt}-{plan.id[:12]}-{time.time_ns()}",
                resources=_resources(connected, plan, chunk, threads),
                pure=False,
            )

        done: dict[int, Mapping[str, Any]] = {}
        failed: dict[int, str] = {}
        again: dict[int, int] = {}
        number = {(future := submitted(chunk, 0)): chunk for chunk in range(len(plan))}
        waiting = as_completed(list(number))
        for future in waiting:
            chunk = number.pop(future)
            error = future.exception() if future.status in ("error", "cancelled", "lost") else None
            if future.status == "finished":
                done[chunk] = future.result()
                watching.steps(1)
            elif isinstance(error, InputError):
                raise error
            elif again.get(chunk, 0) < retries:
                again[chunk] = again.get(chunk, 0) + 1
                reason = "its worker was lost" if isinstance(error, KilledWorker) else error
                _LOG.warning("chunk %d is tried again (%d of %d): %s", chunk, again[chunk], retries, reason)
                retried = submitted(chunk, again[chunk])
                number[retried] = chunk
                waiting.add(retried)
            else:
                failed[chunk] = str(error)
                watching.steps(1)
            future.release()
        if failed and not partial:
            reasons = "; ".join(f"chunk {chunk}: {reason}" for chunk, reason in sorted(failed.items()))
            raise SkysweepError(f"{len(failed)} of {len(plan)} chunks could not be computed: {reasons}")
        watching.begin("merging", 1)
        merged = connected.submit(
            _merge,
            plan.folder,
            plan.id,
            partial,
            overwrite,
            threads,
            key=f"{_PREFIX}-merge-{plan.id[:12]}-{time.time_ns()}",
            retries=retries,
            pure=False,
        )
        report = Report(merged.result())
        watching.steps(1)
    report["dask"] = Report(
        computed=sum(int(result["computed"]) for result in done.values()),
        done_before=sum(1 for result in done.values() if not result["computed"]),
        tried_again=Report({str(chunk): count for chunk, count in sorted(again.items())}),
        failed=Report({str(chunk): reason for chunk, reason in sorted(failed.items())}),
        seconds=time.monotonic() - start,
        chunk_seconds=sum(float(result["seconds"]) for result in done.values()),
        chunk_cpu_seconds=sum(float(result["cpu_seconds"]) for result in done.values()),
    )
    return report


def _print_step(step: Step) -> None:
    sys.stderr.write(f"{step.stage}: {step.done} of {step.total}\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """The command ``skysweep-dask``. Exit codes are those of ``skysweep``."""
    parser = argparse.ArgumentParser(prog="skysweep-dask", description="Planned surface models on a Dask cluster.")
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("run", help="compute the chunks of a planned run, and merge them")
    command.add_argument("run", metavar="RUN", help="folder that `skysweep plan` has made")
    command.add_argument("--scheduler", metavar="ADDRESS", help="scheduler [default: a cluster on this machine]")
    command.add_argument("--retries", type=int, default=3, metavar="N", help="times that a chunk is tried again [3]")
    command.add_argument("--threads", type=int, default=1, metavar="N", help="threads of each chunk [1]")
    command.add_argument("--partial", action="store_true", help="leave chunks void that cannot be computed")
    command.add_argument("--overwrite", action="store_true", help="replace existing products")
    command.add_argument("--quiet", action="store_true", help="print no progress")
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s: %(message)s")
    try:
        report = run(
            given.run,
            given.scheduler,
            given.retries,
            threads=given.threads,
            partial=given.partial,
            overwrite=given.overwrite,
            progress=None if given.quiet else _print_step,
        )
    except ModuleNotFoundError as error:
        sys.stderr.write(f"error: {error}\n  hint: pip install 'skysweep[dask]'\n")
        return 2
    except (SkysweepError, OSError) as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    dask: Any = report["dask"]
    sys.stdout.write(
        f"chunks     {dask.computed} computed, {dask.done_before} done before, {len(dask.failed)} failed\n"
        f"tried      {sum(dask.tried_again.values())} times again\n"
        f"time       {dask.seconds:.1f} s\n"
    )
    return 1 if dask.failed else 0


if __name__ == "__main__":
    sys.exit(main())
