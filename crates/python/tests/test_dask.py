"""Plans on a Dask cluster: the same bytes with workers that die, waits, refusals, futures, the command."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path
from typing import Any, Iterator

import pytest

import skysweep
from conftest import SMALL, VIEWS, rasters

pytest.importorskip("distributed")

import skysweep.dask as cluster  # noqa: E402
from skysweep import _tasks  # noqa: E402

fcntl = pytest.importorskip("fcntl")


def planned(folder: Path) -> skysweep.Plan:
    return skysweep.Plan.make(VIEWS, folder, **SMALL, chunk=96)


def in_process(**settings: Any) -> Any:
    from distributed import Client

    given: dict[str, Any] = {"n_workers": 1, "threads_per_worker": 1, **settings}
    return Client(processes=False, dashboard_address=None, **given)


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The rasters of the run without Dask."""
    folder = tmp_path_factory.mktemp("once")
    skysweep.dsm(VIEWS, folder / "run", **SMALL, chunk=96)
    return rasters(folder / "run")


@pytest.fixture
def short_waits(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(_tasks, "_WAITS_S", (0.05, 0.4))
    yield


def test_workers_that_are_killed_change_no_byte(tmp_path: Path, once: dict[str, str]) -> None:
    from distributed import Client

    plan = planned(tmp_path / "run")
    assert len(plan) > 4
    killed: list[int] = []

    def kill(step: skysweep.Step) -> None:
        # A worker dies after the first and after the third chunk, in the middle of another.
        if step.stage == "sweeping chunks" and step.done in (1, 3) and len(killed) <= step.done // 2:
            workers: Any = client.run(os.getpid)
            victim = sorted(workers.values())[0]
            os.kill(victim, signal.SIGKILL)
            killed.append(victim)

    with cluster.local_cluster(plan, workers=2, silence_logs="CRITICAL") as local, Client(local) as client:
        report = cluster.run(plan, client, progress=kill)
    assert len(killed) == 2 and rasters(tmp_path / "run") == once
    assert report.dask.computed + report.dask.done_before == len(plan) and not report.dask.failed
    assert report.dask.chunk_seconds > 0.0 and report.plan == plan.id


def test_a_run_goes_on_where_it_was_and_is_a_command(
    tmp_path: Path, once: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    plan = planned(tmp_path / "run")
    plan.run_chunks([0, 1])
    assert plan.finished() is None
    assert cluster.main(["run", plan.folder, "--quiet"]) == 0
    assert "2 done before" in capsys.readouterr().out
    assert rasters(tmp_path / "run") == once
    assert cluster.main(["run", str(tmp_path)]) == 2
    assert "no plan" in capsys.readouterr().err


def test_a_finished_run_is_success_and_starts_no_cluster(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = planned(tmp_path / "run")
    plan.run_chunks()
    merged = plan.merge()
    monkeypatch.setattr(cluster, "local_cluster", lambda *_, **__: pytest.fail("a cluster was started"))
    report = cluster.run(plan)
    assert report.surface == merged.surface and report.dask.computed == 0 and report.dask.done_before == len(plan)
    assert cluster.main(["run", plan.folder]) == 0 and f"{len(plan)} done before" in capsys.readouterr().out
    # Without one of its products, or of another plan, a run is not finished.
    (tmp_path / "run" / "dsm" / "sigma.tif").unlink()
    assert plan.finished() is None
    again = skysweep.Plan.make(VIEWS, tmp_path / "run", **{**SMALL, "gsd_m": 2.5}, chunk=96, overwrite=True)
    assert again.finished() is None


def test_a_chunk_that_always_fails_is_named_and_the_others_are_done(tmp_path: Path) -> None:
    plan = planned(tmp_path / "run")
    # A file in the place of a chunk's folder.
    (tmp_path / "run" / "chunks").mkdir(exist_ok=True)
    (tmp_path / "run" / "chunks" / "0002").write_text("in the way")
    with in_process() as client:
        with pytest.raises(skysweep.SkysweepError, match="1 of .* chunks could not be computed: chunk 2"):
            cluster.run(plan, client, retries=1)
        rest = plan.run_chunks([chunk for chunk in range(len(plan)) if chunk != 2])
        assert rest.done_before == len(plan) - 1
        with pytest.raises(skysweep.InputError, match="retries is -1"):
            cluster.run(plan, client, retries=-1)


def test_a_chunk_that_no_worker_can_hold_is_refused_at_once(tmp_path: Path) -> None:
    plan = planned(tmp_path / "run")
    largest = max(plan.needed_mb(chunk) for chunk in range(len(plan)))
    assert largest > 100
    with in_process(resources={"MEMORY": 100e6, "CPU": 1}) as client:
        with pytest.raises(skysweep.InputError, match=f"needs {largest} MB, and no worker has more than 100 MB") as told:
            cluster.run(plan, client)
        assert "memory_mb=100" in str(told.value) and "resource MEMORY" in str(told.value)
        with pytest.raises(skysweep.InputError, match="no worker has more"):
            cluster.submit(plan, client)
    with in_process(resources={"MEMORY": 9e9, "CPU": 1}) as client:
        with pytest.raises(skysweep.InputError, match="takes 3 threads, and no worker has more than 1 of"):
            cluster.run(plan, client, threads=3)
    with in_process(memory_limit="90MB") as client:
        with pytest.raises(skysweep.InputError, match="no worker has more than 90 MB .*memory_limit"):
            cluster.run(plan, client)


def test_a_run_that_another_process_locks_is_waited_for(
    tmp_path: Path, once: dict[str, str], short_waits: None
) -> None:
    plan = planned(tmp_path / "run")
    held = os.open(plan.folder, os.O_RDONLY)
    fcntl.flock(held, fcntl.LOCK_EX)
    with pytest.raises(skysweep.InUseError):
        plan.run_chunk(0)
    threading.Timer(1.5, os.close, [held]).start()
    with in_process() as client:
        report = cluster.run(plan, client)
    assert report.dask.waited > 0 and report.dask.computed == len(plan)
    assert rasters(tmp_path / "run") == once


def test_a_merge_that_another_process_locks_is_waited_for(
    tmp_path: Path, once: dict[str, str], short_waits: None
) -> None:
    plan = planned(tmp_path / "run")
    plan.run_chunks()
    # A share of the folder, as a process has that computes chunks, keeps out the merge alone.
    held = os.open(plan.folder, os.O_RDONLY)
    fcntl.flock(held, fcntl.LOCK_SH)
    threading.Timer(1.0, os.close, [held]).start()
    with in_process() as client:
        report = cluster.run(plan, client)
    assert report.dask.waited > 0 and report.dask.done_before == len(plan) and rasters(tmp_path / "run") == once


def test_futures_are_returned_at_once_and_end_in_the_same_bytes(tmp_path: Path, once: dict[str, str]) -> None:
    plan = planned(tmp_path / "run")
    with in_process(n_workers=2) as client:
        start = time.monotonic()
        futures = cluster.submit(plan, client)
        assert time.monotonic() - start < 5.0 and len(futures.chunks) == len(plan)
        assert futures.report.result().surface.cells > 0
        assert [future.result()["computed"] for future in futures.chunks] == [1] * len(plan)
        assert rasters(tmp_path / "run") == once
        # The same again: it is finished.
        assert cluster.submit(plan, client).report.result().plan == plan.id


def test_the_cluster_is_asked_once_and_memory_is_claimed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from distributed import Client

    plan = planned(tmp_path / "run")
    asked: list[int] = []
    claimed: list[dict[str, float]] = []
    ask, submit, spread = Client.scheduler_info, Client.submit, Client.map

    def counted(self: Any, *args: Any, **settings: Any) -> Any:
        asked.append(1)
        return ask(self, *args, **settings)

    def noted(original: Any) -> Any:
        def call(self: Any, *args: Any, **settings: Any) -> Any:
            claimed.append(dict(settings.get("resources") or {}))
            return original(self, *args, **settings)

        return call

    with in_process(resources={"MEMORY": 9e9, "CPU": 2}) as client:
        monkeypatch.setattr(Client, "scheduler_info", counted)
        monkeypatch.setattr(Client, "submit", noted(submit))
        monkeypatch.setattr(Client, "map", noted(spread))
        cluster.run(plan, client)
    assert len(asked) == 1
    largest = 1e6 * max(plan.needed_mb(chunk) for chunk in range(len(plan)))
    assert max(claim["MEMORY"] for claim in claimed) == largest and all(claim["CPU"] >= 1.0 for claim in claimed)
    # The merge claims its memory, and all cores of a worker.
    assert claimed[-1] == {"MEMORY": 1e6 * plan.merge_mb, "CPU": 2.0} and plan.merge_mb > 100


def test_a_plan_that_is_replaced_meanwhile_is_an_error(tmp_path: Path) -> None:
    plan = planned(tmp_path / "run")
    skysweep.Plan.make(VIEWS, tmp_path / "run", **{**SMALL, "gsd_m": 2.5}, chunk=96, overwrite=True)
    with in_process() as client, pytest.raises(skysweep.InputError, match="plan was replaced"):
        cluster.run(plan, client)
