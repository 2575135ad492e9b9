"""Reports have the attributes that their classes declare, and no others: what Rust writes and what mypy knows agree."""

from __future__ import annotations

import keyword
import pickle
from pathlib import Path
from typing import Any, Iterator

import pytest

import skysweep
from conftest import SMALL, TOWN, VIEWS
from skysweep import Report, reports


def parts(report: Any, place: str) -> Iterator[tuple[str, Report]]:
    """The report with all its parts, each with its place."""
    if isinstance(report, Report):
        yield place, report
    if isinstance(report, dict):
        for key, value in report.items():
            yield from parts(value, f"{place}.{key}")
    elif isinstance(report, list):
        for value in report[:3]:
            yield from parts(value, f"{place}[]")


def wrong(report: Report) -> list[str]:
    """Keys that the classes do not declare, and attributes that are neither there nor known to be left out."""
    found = []
    for place, part in parts(report, type(report).__name__):
        kind = type(part)
        if kind is Report:
            continue
        known = {name for name in kind.__annotations__ if not name.startswith("_")}
        open_ended = kind in (reports.EvalMetrics, reports.PartMetrics)
        # Words of the language and methods of dictionaries are read as keys.
        by_key = {key for key in part if hasattr(dict, key) or not key.isidentifier() or keyword.iskeyword(key)}
        if not open_ended:
            found += [f"{place}.{key} is not declared by {kind.__name__}" for key in part.keys() - known - by_key]
        found += [f"{place} has no {name}" for name in known if name not in part and name not in kind._absent]
    return found


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reports") / "run"
    skysweep.plan_run(VIEWS, folder, **SMALL, chunk=128)
    return folder


def test_reports_are_what_their_classes_declare(run: Path, tmp_path: Path) -> None:
    truth, model = TOWN / "truth", TOWN / "truth" / "buildings.city.json"
    place = {"source": {"position": {"lon_deg": 5.4, "lat_deg": 43.53}}}
    made: list[Report] = [
        skysweep.read_plan(run),
        skysweep.run_chunks(run),
        skysweep.merge_run(run),
        skysweep.dtm(run, tmp_path / "dtm"),
        skysweep.classes(run, tmp_path / "classes"),
        skysweep.buildings(VIEWS[0], tmp_path / "index.tif"),
        skysweep.diff(truth / "dsm.tif", run, tmp_path / "change"),
        skysweep.ortho(VIEWS[:1], run, tmp_path / "orthos"),
        skysweep.evaluate_grids(run, truth / "dsm.tif"),
        skysweep.evaluate_surfaces(model, model),
        skysweep.heightmap(run, tmp_path / "map.tif", place, size_px=64),
        skysweep.unproject(tmp_path / "map.tif", tmp_path / "points.ply"),
        skysweep.priors(model, VIEWS[:1], tmp_path / "maps"),
        skysweep.priors(model, [TOWN / "cameras"], tmp_path / "priors"),
        skysweep.splats(run, VIEWS, tmp_path / "splats.ply"),
        skysweep.convert_splats(tmp_path / "splats.ply", tmp_path / "packed.spz"),
        skysweep.label_splats(tmp_path / "splats.ply", model, tmp_path / "labelled.ply"),
        skysweep.city_info(model),
        skysweep.city_convert(model, tmp_path / "town.ply"),
        skysweep.rpc_info(VIEWS[0]),
        skysweep.rpc_convert(VIEWS[0], tmp_path / "view.rpb"),
        skysweep.simulate({"size_m": 60.0, "views": 2}, tmp_path / "scene"),
    ]
    assert [text for report in made for text in wrong(report)] == []
    assert {type(report).__name__ for report in made} >= {"DsmReport", "PlanFile", "GridEvalReport", "RpcInfoReport"}


def test_what_a_report_leaves_out_is_none_and_a_wrong_name_is_told(run: Path) -> None:
    plan = skysweep.read_plan(run)
    pointing = plan.plan.report.pointing
    assert isinstance(pointing, reports.PointingReport) and "control" not in pointing and pointing.control is None
    with pytest.raises(AttributeError, match="has no 'tiez'; it has "):
        getattr(pointing, "tiez")
    assert "tracks" in dir(pointing)
    again = pickle.loads(pickle.dumps(plan))
    assert again == plan and type(again) is reports.PlanFile


def test_the_dry_run_of_a_batch_makes_nothing(tmp_path: Path) -> None:
    file = tmp_path / "night.toml"
    scene = '[[scene]]\nname = "{}"\nimages = ["{}", "{}"]\n'
    scenes = "".join(scene.format(name, *VIEWS) for name in ("harbour", "hill"))
    file.write_text(f'output = "out"\n[defaults]\ntasks = ["dsm"]\n[defaults.dsm]\ngsd_m = 2.0\npreset = "fast"\n{scenes}')
    report = skysweep.batch(file, dry_run=True, only=["hill"])
    assert [(s.name, s.left_out, s.tasks[0].state) for s in report.scenes] == [
        ("harbour", True, "not_begun"),
        ("hill", False, "to_do"),
    ]
    assert not (tmp_path / "out").exists() and wrong(report) == []
    with pytest.raises(skysweep.InputError, match="no scene 'hil'|no scene \"hil\""):
        skysweep.batch(file, only=["hil"])
    done = skysweep.batch(file, only=["hill"])
    assert done.complete == 1 and (tmp_path / "out" / "hill").exists() and not (tmp_path / "out" / "harbour").exists()
