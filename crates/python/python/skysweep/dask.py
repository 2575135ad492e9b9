"""Planned runs on a Dask cluster: one task per chunk, and the merge as the last task.

The run folder is on storage that all workers see under one path. A chunk is done when its folder is
complete, whoever computed it: a run that was stopped goes on where it was, a run that is finished
is returned as it is, and workers of Dask and ``skysweep run`` may work in one folder at the same
time.

The plan itself stays in the run folder, where each worker process reads it once. What is sent with a
task is the name of the folder, the identity of the plan and the number of the chunk. The plan is not
scattered: what a cluster holds in the memory of workers is lost with them.

:func:`run` waits for the surface model, :func:`submit` returns futures. The command
``skysweep-dask run RUN --scheduler ADDRESS`` does the same without Python code.
"""

from __future__ import annotations

import argparse
import heapq
import logging
import math
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Union

from ._call import Progress, Report, Step
from ._errors import InputError, SkysweepError
from ._plan import Plan
from ._tasks import chunk_task, hello, merge_task, patient_chunk, patient_merge, wait_s
from .reports import DsmReport

__all__ = ["DaskReport", "DaskRunReport", "Submitted", "local_cluster", "main", "run", "submit"]

_LOG = logging.getLogger("skysweep")

#: Share of the machine's memory that the workers of a local cluster may take together.
_MEMORY_SHARE = 0.8
#: Time between two looks for tasks that have ended, seconds.
_LOOK_S = 0.02
#: The memory that chunks claim is rounded up to this share of the largest, so that the chunks of a
#: plan go to the scheduler in a few groups and not one by one.
_CLAIM_SHARE = 1.0 / 32.0
#: Name of the tasks on the dashboard.
_PREFIX = "skysweep"


class DaskReport(Report):
    """What became of the chunks of a run on a cluster."""

    computed: int
    """Number of chunks that this run computed."""

    done_before: int
    """Number of chunks that had a result, or got one from another process."""

    tried_again: dict[str, int]
    """Times that a chunk was tried again, by its number."""

    waited: int
    """Times that a chunk or the merge was put off because another process held it."""

    failed: dict[str, str]
    """Why chunks could not be computed, by their number."""

    seconds: float
    """Wall time, seconds."""

    chunk_seconds: float
    """Wall time of all chunks together, seconds."""

    chunk_cpu_seconds: float
    """Processor time of all chunks together, seconds."""


class DaskRunReport(DsmReport):
    """The report of a run, with what became of its chunks on the cluster."""

    dask: DaskReport
    """What became of the chunks."""


@dataclass(frozen=True)
class Submitted:
    """The futures of a run that was sent to a cluster."""

    #: A future for each chunk, in the order of the plan.
    chunks: list[Any]
    #: The future of the report, a :class:`skysweep.reports.DsmReport`.
    report: Any


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
    largest_mb = max([plan.merge_mb, *(plan.needed_mb(chunk) for chunk in range(len(plan)))])
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


@dataclass
class _Workers:
    """What the workers of a cluster have, asked once for a run."""

    count: int
    #: Largest memory of a worker, megabytes; `None` where one does not say.
    most_mb: float | None
    #: Where the memory is from, in words.
    source: str
    #: Resources that all workers declare, with the largest amount of each.
    declared: dict[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, client: Any) -> _Workers:
        known = client.scheduler_info(n_workers=-1)["workers"]
        if not known:
            client.submit(hello, pure=False).result()
            known = client.scheduler_info(n_workers=-1)["workers"]
        workers = list(known.values())
        all_of = [worker.get("resources") or {} for worker in workers]
        names = set.intersection(*map(set, all_of)) if all_of else set()
        declared = {name: max(float(one[name]) for one in all_of) for name in names}
        if "MEMORY" in declared:
            return cls(len(workers), declared["MEMORY"] / 1e6, "their resource MEMORY", declared)
        limits = [float(worker.get("memory_limit") or math.inf) for worker in workers]
        most_mb = max(limits, default=math.inf) / 1e6
        return cls(len(workers), most_mb if math.isfinite(most_mb) else None, "their memory_limit", declared)

    def claims(self, needed_mb: float, threads: int | None) -> dict[str, float]:
        """What a task takes of the resources that all workers declare."""
        cores = float(threads or self.declared.get("CPU", 1.0))
        wanted = {"MEMORY": needed_mb * 1e6, "CPU": cores}
        return {name: amount for name, amount in wanted.items() if name in self.declared and amount > 0.0}

    def refuse(self, plan: Plan, threads: int | None) -> None:
        """Refuses a plan of which no worker can hold a part, rather than wait for ever.

        Raises:
            InputError: A chunk or the merge takes more memory, or more threads, than any worker has.
        """
        needs = {f"chunk {chunk}": plan.needed_mb(chunk) for chunk in range(len(plan))}
        needs["the merge"] = plan.merge_mb
        what = max(needs, key=lambda name: needs[name])
        if self.most_mb is not None and needs[what] > self.most_mb:
            advice = (
                f"start workers with more, or plan the run again with memory_mb={int(self.most_mb)} or less"
                if what != "the merge"
                else "start a worker with more"
            )
            raise InputError(
                f"{what} needs {needs[what]} MB, and no worker has more than {int(self.most_mb)} MB "
                f"({self.count} workers, by {self.source}); {advice}"
            )
        cores = self.declared.get("CPU")
        if threads is not None and cores is not None and threads > cores:
            raise InputError(
                f"a chunk takes {threads} threads, and no worker has more than {cores:g} of the resource CPU "
                f"({self.count} workers); take fewer threads, or start workers with more"
            )

    def groups(self, plan: Plan, threads: int | None) -> list[tuple[dict[str, float], list[int]]]:
        """The chunks of a plan by what they claim."""
        largest = max((plan.needed_mb(chunk) for chunk in range(len(plan))), default=0)
        step = max(_CLAIM_SHARE * largest, 1.0)
        by_claim: dict[float, list[int]] = {}
        for chunk in range(len(plan)):
            claimed = min(math.ceil(plan.needed_mb(chunk) / step) * step, float(largest))
            by_claim.setdefault(claimed, []).append(chunk)
        return [(self.claims(claimed, threads), chunks) for claimed, chunks in by_claim.items()]


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


def _opened(plan: Union[Plan, str, os.PathLike[str]], retries: int) -> Plan:
    if retries < 0:
        raise InputError(f"the number of retries is {retries}, expected 0 or more")
    return plan if isinstance(plan, Plan) else Plan(plan)


def submit(
    plan: Union[Plan, str, os.PathLike[str]],
    client: Any,
    retries: int = 3,
    *,
    threads: int | None = 1,
    partial: bool = False,
    overwrite: bool = False,
) -> Submitted:
    """Sends the chunks of a plan and their merge to a cluster, and returns at once.

    A chunk that another process computes is waited for on the worker. A run that is finished gives
    its report, unless `overwrite` is set.

    Args:
        plan: The plan, or its run folder.
        client: A `distributed.Client`.
        retries: Times that a chunk is tried again whose computation failed. Dask itself moves the
            chunks of a lost worker.
        threads: Threads of each chunk; all cores of the worker when `None`.
        partial: Whether chunks that cannot be computed are left void. Otherwise their future, and
            that of the report, has the error.
        overwrite: Whether existing products may be replaced.

    Returns:
        The futures of the chunks and of the report.

    Raises:
        InputError: No worker can hold a chunk.
    """
    plan = _opened(plan, retries)
    workers = _Workers.of(client)
    workers.refuse(plan, threads)
    stamp = f"{plan.id[:12]}-{time.time_ns()}"
    settings = {"folder": plan.folder, "plan": plan.id, "threads": threads}
    chunks: dict[int, Any] = {}
    for claims, numbers in workers.groups(plan, threads):
        keys = [f"{_PREFIX}-chunk-{chunk:04d}-{stamp}" for chunk in numbers]
        futures = client.map(
            patient_chunk, numbers, key=keys, resources=claims, pure=False, tries=retries, partial=partial, **settings
        )
        chunks.update(zip(numbers, futures))
    ordered = [chunks[chunk] for chunk in sorted(chunks)]
    report = client.submit(
        patient_merge,
        ordered,
        partial=partial,
        overwrite=overwrite,
        key=f"{_PREFIX}-merge-{stamp}",
        resources=workers.claims(plan.merge_mb, threads),
        pure=False,
        **settings,
    )
    return Submitted(ordered, report)


class _Course:
    """A run on its way: chunks with a task, chunks that wait, and what became of the others."""

    def __init__(self, client: Any, plan: Plan, workers: _Workers, retries: int, threads: int | None) -> None:
        from distributed import as_completed

        self.client, self.plan, self.workers = client, plan, workers
        self.retries, self.threads = retries, threads
        self.done: dict[int, Mapping[str, Any]] = {}
        self.failed: dict[int, str] = {}
        self.again: dict[int, int] = {}
        self.waits: dict[int, int] = {}
        self.later: list[tuple[float, int]] = []
        self.number: dict[Any, int] = {}
        # Results are fetched as they come, many at a time, and not one by one from as many workers.
        self.running = as_completed([], with_results=True, raise_errors=False)

    def send(self, chunks: Sequence[int], claims: Mapping[str, float]) -> None:
        stamp = f"{self.plan.id[:12]}-{time.time_ns()}"
        futures = self.client.map(
            chunk_task,
            chunks,
            key=[f"{_PREFIX}-chunk-{chunk:04d}-{stamp}" for chunk in chunks],
            resources=dict(claims),
            pure=False,
            folder=self.plan.folder,
            plan=self.plan.id,
            threads=self.threads,
        )
        self.number.update(zip(futures, chunks))
        self.running.update(futures)

    def send_again(self, chunk: int) -> None:
        self.send([chunk], self.workers.claims(self.plan.needed_mb(chunk), self.threads))

    def go(self, watching: Any) -> None:
        """Computes all chunks."""
        from distributed.scheduler import KilledWorker

        watching.begin("sweeping chunks", len(self.plan))
        for claims, chunks in self.workers.groups(self.plan, self.threads):
            self.send(chunks, claims)
        while self.number or self.later:
            while self.later and self.later[0][0] <= time.monotonic():
                self.send_again(heapq.heappop(self.later)[1])
            if not (self.number and self.running.has_ready()):
                time.sleep(_LOOK_S)
                continue
            future, result = next(self.running)
            chunk = self.number.pop(future)
            error = future.exception() if future.status in ("error", "cancelled", "lost") else None
            if future.status == "finished":
                self.ended(chunk, result, watching)
            elif isinstance(error, InputError):
                raise error
            elif self.again.get(chunk, 0) < self.retries:
                self.again[chunk] = self.again.get(chunk, 0) + 1
                reason = "its worker was lost" if isinstance(error, KilledWorker) else error
                _LOG.warning("chunk %d is tried again (%d of %d): %s", chunk, self.again[chunk], self.retries, reason)
                self.send_again(chunk)
            else:
                self.failed[chunk] = str(error)
                watching.steps(1)
            future.release()

    def ended(self, chunk: int, result: Mapping[str, Any], watching: Any) -> None:
        if result["held"]:
            waits = self.waits.get(chunk, 0)
            if not self.waits:
                _LOG.warning("another process holds the run or some of its chunks; they are asked for again")
            self.waits[chunk] = waits + 1
            heapq.heappush(self.later, (time.monotonic() + wait_s(waits, chunk), chunk))
            return
        self.done[chunk] = result
        watching.steps(1)

    def merged(self, partial: bool, overwrite: bool) -> DsmReport:
        """Merges the chunks, with all the cores that a worker declares."""
        threads = self.threads
        if threads is not None:
            threads = max(threads, int(self.workers.declared.get("CPU", 1.0)))
        waits = 0
        while True:
            future = self.client.submit(
                merge_task,
                self.plan.folder,
                self.plan.id,
                partial,
                overwrite,
                threads,
                key=f"{_PREFIX}-merge-{self.plan.id[:12]}-{time.time_ns()}",
                resources=self.workers.claims(self.plan.merge_mb, threads),
                retries=self.retries,
                pure=False,
            )
            report: DsmReport | None = future.result()
            if report is not None:
                return report
            _LOG.warning("another process has the run for itself; the merge is tried again")
            # The merge is counted beside the chunks, under a number that none of them has.
            self.waits[-1] = self.waits.get(-1, 0) + 1
            time.sleep(wait_s(waits, 0))
            waits += 1


def run(
    plan: Union[Plan, str, os.PathLike[str]],
    client: Any = None,
    retries: int = 3,
    *,
    threads: int | None = 1,
    partial: bool = False,
    overwrite: bool = False,
    progress: Progress = None,
) -> DaskRunReport:
    """Computes the chunks of a plan on a cluster, and merges them.

    A run that is finished is returned as it is, unless `overwrite` is set. A chunk or a run that
    another process holds is asked for again, after waits that grow up to two minutes; meanwhile its
    worker computes other chunks.

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
        InputError: No worker can hold a chunk, or the plan was replaced meanwhile.
        SkysweepError: Chunks failed and `partial` is not set; the others are done.
    """
    from ._call import watcher

    plan = _opened(plan, retries)
    start = time.monotonic()
    finished = None if overwrite else plan.finished()
    if finished is not None:
        return _with_course(finished, None, len(plan), start)
    with _client(client, plan) as connected, watcher(progress) as watching:
        workers = _Workers.of(connected)
        workers.refuse(plan, threads)
        course = _Course(connected, plan, workers, retries, threads)
        course.go(watching)
        failed = course.failed
        if failed and not partial:
            reasons = "; ".join(f"chunk {chunk}: {reason}" for chunk, reason in sorted(failed.items()))
            raise SkysweepError(f"{len(failed)} of {len(plan)} chunks could not be computed: {reasons}")
        watching.begin("merging", 1)
        report = course.merged(partial, overwrite)
        watching.steps(1)
    return _with_course(report, course, len(plan), start)


def _with_course(report: DsmReport, course: _Course | None, chunks: int, start: float) -> DaskRunReport:
    """The report of a run with what became of its chunks."""
    done = list(course.done.values()) if course else []
    again = sorted(course.again.items()) if course else []
    failed = sorted(course.failed.items()) if course else []
    whole = DaskRunReport(report)
    whole["dask"] = DaskReport(
        computed=sum(int(result["computed"]) for result in done),
        done_before=sum(1 for result in done if not result["computed"]) if course else chunks,
        tried_again={str(chunk): count for chunk, count in again},
        waited=sum(course.waits.values()) if course else 0,
        failed={str(chunk): reason for chunk, reason in failed},
        seconds=time.monotonic() - start,
        chunk_seconds=sum(float(result["seconds"]) for result in done),
        chunk_cpu_seconds=sum(float(result["cpu_seconds"]) for result in done),
    )
    return whole


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
    dask = report.dask
    sys.stdout.write(
        f"chunks     {dask.computed} computed, {dask.done_before} done before, {len(dask.failed)} failed\n"
        f"tried      {sum(dask.tried_again.values())} times again\n"
        f"time       {dask.seconds:.1f} s\n"
    )
    return 1 if dask.failed else 0


if __name__ == "__main__":
    sys.exit(main())
