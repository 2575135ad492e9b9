"""Forked processes: arrays, city models and jobs work in them and never wait for threads of the parent.

A wait without end is what these tests are about, so every child has a time limit.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Callable

import numpy as np
import pytest

import skysweep
from conftest import SMALL, TOWN, VIEWS, rasters

#: Seconds that a child may take; each takes a few.
LIMIT_S = 120.0
#: Enough points that the work is shared out over threads.
POINTS = 100_000
MODEL = TOWN / "truth" / "buildings.city.json"

pytestmark = [
    pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="the system does not fork"),
    pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning"),
]


def in_fork(work: Callable[[], Any]) -> Any:
    """What `work` returns in a forked process, which is ended at the time limit."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=lambda: sender.send(work()))
    child.start()
    try:
        assert receiver.poll(LIMIT_S), f"the child gave no answer within {LIMIT_S} s"
        return receiver.recv()
    finally:
        child.kill()
        child.join()


@pytest.fixture(scope="module")
def rpc() -> skysweep.Rpc:
    return skysweep.Rpc(VIEWS[0])


@pytest.fixture(scope="module")
def pixels() -> tuple[Any, Any]:
    random = np.random.default_rng(11)
    return random.uniform(0, 400, POINTS), random.uniform(0, 300, POINTS)


def rays(model: skysweep.CityModel) -> tuple[Any, list[float]]:
    middles = model.vertices[model.triangles].mean(axis=1)
    return np.tile(middles + [0.0, 0.0, 500.0], (40, 1)), [0.0, 0.0, -1.0]


def test_cameras_in_a_forked_process_give_the_bits_of_the_parent(rpc: skysweep.Rpc, pixels: tuple[Any, Any]) -> None:
    ground = rpc.localize(*pixels, 210.0)
    image = rpc.project(*ground, 210.0)
    found_ground, found_image = in_fork(lambda: (rpc.localize(*pixels, 210.0), rpc.project(*ground, 210.0)))
    assert all(np.array_equal(a, b) for a, b in zip((*ground, *image), (*found_ground, *found_image)))


def test_city_models_are_read_and_hit_in_a_forked_process() -> None:
    model = skysweep.CityModel(MODEL)
    expected = model.cast(*rays(model))
    inherited = in_fork(lambda: model.cast(*rays(model)))
    assert np.array_equal(inherited.triangle, expected.triangle)

    def read_and_cast() -> Any:
        own = skysweep.CityModel(MODEL)
        return own.cast(*rays(own))

    assert np.array_equal(in_fork(read_and_cast).distance, expected.distance)


def test_rasters_sweeps_and_evaluations_work_in_a_forked_process(tmp_path: Path) -> None:
    truth = skysweep.read_raster(TOWN / "truth" / "dsm.tif")
    expected = skysweep.evaluate(truth.values + 0.25, truth.values, cell_m=1.0, alignment="none").metrics.mae
    views = [(skysweep.read_raster(path).values, skysweep.Rpc(path)) for path in VIEWS]
    heights = skysweep.HeightSweep(views, (170.0, 280.0), preset="fast").run()[0].height_m

    def work() -> Any:
        assert truth.geotransform is not None
        skysweep.write_raster(tmp_path / "a.tif", truth.values, truth.geotransform, 32631, vertical="ellipsoid")
        again = skysweep.read_raster(tmp_path / "a.tif").values
        error = skysweep.evaluate(truth.values + 0.25, again, cell_m=1.0, alignment="none").metrics.mae
        return error, skysweep.HeightSweep(views, (170.0, 280.0), preset="fast").run()[0].height_m

    found, swept = in_fork(work)
    assert found == expected and np.array_equal(swept, heights, equal_nan=True)


def test_a_child_of_a_child_has_threads_too(rpc: skysweep.Rpc, pixels: tuple[Any, Any]) -> None:
    expected = rpc.localize(*pixels, 210.0)

    def work() -> Any:
        first = rpc.localize(*pixels, 210.0)
        second = in_fork(lambda: rpc.localize(*pixels, 210.0))
        return first, second

    first, second = in_fork(work)
    assert np.array_equal(first[0], expected[0]) and np.array_equal(second[1], expected[1])


def items(rpc: skysweep.Rpc, model: skysweep.CityModel, queue: Any, answers: Any) -> None:
    """The loop of a worker of a data loader: indices come in, samples go out, until `None` comes."""
    for index in iter(queue.get, None):
        sample, line = rpc.project(np.full(POINTS, 5.4), np.full(POINTS, 43.53), 200.0 + index)
        answers.put((index, float(sample[0]), int((model.cast(*rays(model)).triangle >= 0).sum())))


def test_workers_of_a_data_loader_work(rpc: skysweep.Rpc) -> None:
    """PyTorch's DataLoader forks workers with a dataset made in the parent, which answer by a queue."""
    model = skysweep.CityModel(MODEL)
    context = multiprocessing.get_context("fork")
    queue, answers = context.Queue(), context.Queue()
    workers = [context.Process(target=items, args=(rpc, model, queue, answers)) for _ in range(3)]
    # The parent has used its own threads before it forks, and goes on with them.
    hit = int((model.cast(*rays(model)).triangle >= 0).sum())
    for worker in workers:
        worker.start()
    try:
        for index in [*range(12), None, None, None]:
            queue.put(index)
        found = dict(sample for sample in taken(answers, 12))
    finally:
        for worker in workers:
            worker.join(LIMIT_S)
            worker.kill()
    expected = {index: (rpc.project(5.4, 43.53, 200.0 + index)[0], hit) for index in range(12)}
    assert found == expected


def taken(answers: Any, count: int) -> Iterator[tuple[int, tuple[float, int]]]:
    end = time.monotonic() + LIMIT_S
    for _ in range(count):
        index, sample, hits = answers.get(timeout=max(0.1, end - time.monotonic()))
        yield index, (sample, hits)


def test_a_job_in_a_forked_process_gives_the_bytes_of_the_parent(tmp_path: Path) -> None:
    skysweep.dsm(VIEWS, tmp_path / "parent", **SMALL)
    assert in_fork(lambda: skysweep.dsm(VIEWS, tmp_path / "child", **SMALL).surface.observed) > 1000
    assert rasters(tmp_path / "parent") == rasters(tmp_path / "child")
