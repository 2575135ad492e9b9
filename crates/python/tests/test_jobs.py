"""Jobs: results, reports, errors, progress, cancellation."""

from __future__ import annotations

import logging
import os
import resource
import signal
import threading
from pathlib import Path
from typing import Any

import pytest

import skysweep
from conftest import SMALL, SMALL_OPTIONS, TOWN, VIEWS, command, rasters


def test_a_surface_model_has_the_bytes_of_the_command(tmp_path: Path) -> None:
    steps: list[skysweep.Step] = []
    report = skysweep.dsm(VIEWS, tmp_path / "here", **SMALL, progress=steps.append)
    command("dsm", *VIEWS, "-o", tmp_path / "there", *SMALL_OPTIONS, "-q")
    assert rasters(tmp_path / "here") == rasters(tmp_path / "there")
    assert report.surface.observed == report["surface"]["observed"] > 1000
    stages = [step.stage for step in steps if step.done == 0]
    assert "sweeping heights" in stages
    assert all(0 <= step.done <= step.total for step in steps if step.total)


def test_every_job_has_a_function_with_documentation() -> None:
    for name in skysweep._jobs.__all__:
        function = getattr(skysweep, name)
        assert "Raises:" in function.__doc__ and function.__name__ == name


def test_a_chain_of_jobs(tmp_path: Path) -> None:
    surface = TOWN / "truth" / "dsm.tif"
    terrain = skysweep.dtm(surface, tmp_path / "dtm", terrain={})
    assert (tmp_path / "dtm" / "dtm.tif").is_file() and terrain
    errors = skysweep.evaluate(tmp_path / "dtm" / "dtm.tif", TOWN / "truth" / "dtm.tif", target="nowhere")
    assert errors.metrics.mae < 5.0
    summary = skysweep.city_info(TOWN / "truth" / "buildings.city.json")
    assert summary.triangles > 100
    model = skysweep.heightmap(
        surface, tmp_path / "map.tif", {"source": {"position": {"lon_deg": 5.4, "lat_deg": 43.53}}}, size_px=64
    )
    assert model and (tmp_path / "map.tif").is_file()


def test_images_are_registered_and_tiles_and_meshes_are_made(tmp_path: Path) -> None:
    truth = TOWN / "truth"
    model = {"surface": {"dsm": truth / "dsm.tif", "images": VIEWS[:1]}}
    registered = skysweep.register(VIEWS[1], model, tmp_path / "view.json", corrections="uncorrected", reach_px=5.0)
    assert (tmp_path / "view.json").is_file() and registered.median_px < 1.0
    stand = {"source": {"position": {"lon_deg": 5.4, "lat_deg": 43.53}}}
    settings: dict[str, Any] = {"images": VIEWS, "size_px": 64, "corrections": "uncorrected"}
    tiles = skysweep.tiles(truth / "dsm.tif", tmp_path / "tiles", stand, **settings)
    assert list((tmp_path / "tiles").rglob("ortho.tif")) and tiles.made == 1
    priors = tmp_path / "priors"
    skysweep.priors(truth / "buildings.city.json", [TOWN / "cameras"], priors)
    mesh = skysweep.mesh(priors, {"maps": priors / "raw_depth"}, tmp_path / "town.ply", voxel_m=2.0)
    assert mesh.triangles > 100 and (tmp_path / "town.ply").is_file()


def test_products_of_a_run(tmp_path: Path) -> None:
    skysweep.dsm(VIEWS, tmp_path / "run", **SMALL)
    skysweep.products(tmp_path / "run", products=["dtm"])
    assert (tmp_path / "run" / "products" / "dtm" / "dtm.tif").is_file()


def test_a_scene_is_a_preset_or_parameters(tmp_path: Path) -> None:
    scene = {"size_m": 60.0, "gsd_m": 2.0, "views": 2}
    report = skysweep.simulate(scene, tmp_path / "scene")
    assert report.views == 2 and (tmp_path / "scene" / "truth" / "dsm.tif").is_file()
    with pytest.raises(skysweep.InputError, match="atlantis"):
        skysweep.simulate("atlantis", tmp_path / "other")


def test_errors_are_exceptions_with_the_text_of_the_command(tmp_path: Path) -> None:
    with pytest.raises(skysweep.InputError, match="found 1 image"):
        skysweep.dsm(VIEWS[:1], tmp_path / "out")
    with pytest.raises(ValueError, match="the cell size is -1, expected a positive cell size in metres"):
        skysweep.dsm(VIEWS, tmp_path / "out", gsd_m=-1.0)
    with pytest.raises(skysweep.InputError, match="preset: unknown variant `slow`, expected one of `fast`"):
        skysweep.dsm(VIEWS, tmp_path / "out", preset="slow")  # type: ignore[arg-type]
    with pytest.raises(skysweep.InputError, match="gsd_m is nan, expected a finite number"):
        skysweep.dsm(VIEWS, tmp_path / "out", gsd_m=float("nan"))
    with pytest.raises(OSError, match="no_such.tif"):
        skysweep.rpc_info(tmp_path / "no_such.tif")
    with pytest.raises(skysweep.FileError, match="no plan"):
        skysweep.Plan(tmp_path)
    with pytest.raises(skysweep.CrsError):
        skysweep.dsm(VIEWS, tmp_path / "out", crs_epsg="Mars")  # type: ignore[arg-type]
    assert not (tmp_path / "out").exists()


def test_an_unknown_keyword_names_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"no keyword 'gsd'; did you mean 'gsd_m'\? Known are images, output, gsd_m"):
        skysweep.dsm(VIEWS, tmp_path, gsd=1.0)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="missing"):
        skysweep.dsm(VIEWS)  # type: ignore[call-arg]
    with pytest.raises(skysweep.InputError, match="terrain.*unknown field `sloppy`"):
        skysweep.dtm(TOWN / "truth" / "dsm.tif", tmp_path, terrain={"sloppy": 1})  # type: ignore[typeddict-unknown-key]


def test_an_output_that_exists_is_kept(tmp_path: Path) -> None:
    skysweep.rpc_convert(VIEWS[0], tmp_path / "a.json")
    before = (tmp_path / "a.json").read_bytes()
    with pytest.raises(FileExistsError) as refused:
        skysweep.rpc_convert(VIEWS[1], tmp_path / "a.json")
    assert isinstance(refused.value, skysweep.FileError)
    assert (tmp_path / "a.json").read_bytes() == before


class Stop(Exception):
    """An exception of the caller."""


@pytest.mark.parametrize("exception", [Stop, skysweep.CancelledError])
def test_an_exception_of_the_progress_function_stops_the_job(tmp_path: Path, exception: type[Exception]) -> None:
    def stop(step: skysweep.Step) -> None:
        if step.stage == "sweeping heights":
            raise exception("enough")

    with pytest.raises(exception, match="enough"):
        skysweep.dsm(VIEWS, tmp_path / "out", **SMALL, progress=stop)
    assert not list(tmp_path.rglob("*.tif*"))


def test_ctrl_c_stops_a_job_and_leaves_nothing(tmp_path: Path) -> None:
    # Python listens to no signal that it was started to ignore, as in the background of a script.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.4, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            # Full resolution of all views takes many seconds.
            skysweep.dsm(sorted(TOWN.glob("view_*.tif")), tmp_path / "out", preset="accurate")
        timer.join()
    finally:
        signal.signal(signal.SIGINT, before)
    assert not list(tmp_path.rglob("*.tif*"))


def test_other_threads_go_on_while_a_job_runs(tmp_path: Path) -> None:
    results: list[Any] = []
    counted, over = [0], threading.Event()

    def count() -> None:
        while not over.wait(0.001):
            counted[0] += 1

    thread = threading.Thread(target=count)
    thread.start()
    results.append(skysweep.dsm(VIEWS, tmp_path / "out", **SMALL, threads=1))
    over.set()
    thread.join()
    assert results and counted[0] > 20


def test_warnings_and_choices_go_to_logging(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="skysweep"):
        skysweep.dsm(VIEWS, tmp_path / "out", **SMALL)
    assert any("height step" in record.message for record in caplog.records)


def test_a_bar_is_shown_by_tqdm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("tqdm")
    skysweep.dsm(VIEWS, tmp_path / "out", **SMALL, progress=True)
    assert "sweeping heights" in capsys.readouterr().err
    with pytest.raises(TypeError, match="progress is 3"):
        skysweep.rpc_info(VIEWS[0], progress=3)  # type: ignore[arg-type]


def test_a_forked_process_has_threads_of_its_own(tmp_path: Path) -> None:
    skysweep.dsm(VIEWS, tmp_path / "parent", **SMALL)
    child = os.fork()
    if child == 0:
        code = 1
        try:
            skysweep.dsm(VIEWS, tmp_path / "child", **SMALL)
            code = 0
        finally:
            os._exit(code)
    assert os.waitpid(child, 0)[1] == 0
    assert rasters(tmp_path / "parent") == rasters(tmp_path / "child")


def resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system has no /proc")
def test_a_thousand_jobs_leak_nothing(tmp_path: Path) -> None:
    def some(count: int) -> None:
        for _ in range(count):
            skysweep.rpc_info(VIEWS[0])
            with pytest.raises(skysweep.FileError):
                skysweep.rpc_info(tmp_path / "no_such.tif")

    some(100)
    before = resident_mb()
    some(1000)
    assert resident_mb() - before < 20.0


def test_objects_of_other_packages_are_settings(tmp_path: Path) -> None:
    class Crs:
        def to_epsg(self) -> int:
            return 32631

    class Dataset:
        profile: dict[str, Any] = {}
        name = str(VIEWS[0])

    class Nameless:
        def to_epsg(self) -> None:
            return None

    report = skysweep.make_plan([Dataset(), VIEWS[1]], tmp_path / "out", crs_epsg=Crs(), **SMALL)
    assert report.plan.grid.epsg == 32631
    with pytest.raises(skysweep.CrsError, match="no EPSG code"):
        skysweep.make_plan(VIEWS, tmp_path / "out", crs_epsg=Nameless())
    with pytest.raises(skysweep.InputError, match="threads is a object"):
        skysweep.make_plan(VIEWS, tmp_path / "out", threads=object())  # type: ignore[arg-type]


def test_a_geometry_is_an_area(tmp_path: Path) -> None:
    shapely = pytest.importorskip("shapely")
    lon, lat = skysweep.Rpc(VIEWS[0]).localize([60, 300, 300, 60], [60, 60, 300, 300], 210.0)
    polygon = shapely.Polygon(list(zip(lon, lat)))
    inside = skysweep.dsm(VIEWS, tmp_path / "part", **SMALL, area=polygon)
    whole = skysweep.dsm(VIEWS, tmp_path / "whole", **SMALL)
    assert 0 < inside.surface.observed < whole.surface.observed


def test_a_plan_in_parts_has_the_bytes_of_a_run(tmp_path: Path) -> None:
    plan = skysweep.Plan.make(VIEWS, tmp_path / "run", **SMALL, chunk=128)
    assert len(plan) == 4 and plan.needed_mb(0) > 0 and plan.cpu_seconds(0) > 0.0
    with pytest.raises(skysweep.SkysweepError, match="4 of 4 chunks have no result"):
        plan.merge()
    assert plan.run_chunk(2).computed == 1
    assert plan.run_chunk(2).done_before == 1
    assert plan.run_chunks("1/2").chunks == 4
    plan.run_chunks()
    report = plan.merge()
    assert report.surface.observed > 1000
    skysweep.dsm(VIEWS, tmp_path / "once", **SMALL, chunk=128)
    assert rasters(tmp_path / "run") == rasters(tmp_path / "once")
    with pytest.raises(skysweep.InputError, match="none with number 4"):
        plan.run_chunk(4)
