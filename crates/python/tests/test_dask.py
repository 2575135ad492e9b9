"""Plans on a Dask cluster: the same bytes with workers that die, errors, the command."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

import skysweep
from conftest import SMALL, VIEWS, rasters

pytest.importorskip("distributed")

import skysweep.dask as cluster  # noqa: E402


def planned(folder: Path) -> skysweep.Plan:
    return skysweep.Plan.make(VIEWS, folder, **SMALL, chunk=96)


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The rasters of the run without Dask."""
    folder = tmp_path_factory.mktemp("once")
    skysweep.dsm(VIEWS, folder / "run", **SMALL, chunk=96)
    return rasters(folder / "run")


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
    assert report.dask.chunk_seconds > 0.0


def test_a_run_goes_on_where_it_was_and_is_a_command(
    tmp_path: Path, once: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    plan = planned(tmp_path / "run")
    plan.run_chunks([0, 1])
    assert cluster.main(["run", plan.folder, "--quiet"]) == 0
    assert "2 done before" in capsys.readouterr().out
    assert rasters(tmp_path / "run") == once
    assert cluster.main(["run", str(tmp_path)]) == 2
    assert "no plan" in capsys.readouterr().err


def test_a_chunk_that_always_fails_is_named_and_the_others_are_done(tmp_path: Path) -> None:
    from distributed import Client

    plan = planned(tmp_path / "run")
    # A file in the place of a chunk's folder.
    (tmp_path / "run" / "chunks").mkdir(exist_ok=True)
    (tmp_path / "run" / "chunks" / "0002").write_text("in the way")
    with Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None) as client:
        with pytest.raises(skysweep.SkysweepError, match="1 of .* chunks could not be computed: chunk 2"):
            cluster.run(plan, client, retries=1)
        rest = plan.run_chunks([chunk for chunk in range(len(plan)) if chunk != 2])
        assert rest.done_before == len(plan) - 1
        with pytest.raises(skysweep.InputError, match="retries is -1"):
            cluster.run(plan, client, retries=-1)

