"""The notebooks of the documentation run from their first cell to their last."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from conftest import ROOT

FOLDER = ROOT / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def test_there_are_three() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["accuracy", "nights_batch", "one_scene"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run_and_come_with_pictures(
    path: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    monkeypatch.chdir(FOLDER)
    monkeypatch.setenv("TMPDIR", os.fspath(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    cells = json.loads(path.read_text())["cells"]
    names: dict[str, Any] = {"__name__": "notebook"}
    pictures = 0
    for number, cell in enumerate(cell for cell in cells if cell["cell_type"] == "code"):
        exec(compile("".join(cell["source"]), f"{path.name}, cell {number + 1}", "exec"), names)
        pictures += any("image/png" in output.get("data", {}) for output in cell["outputs"])
        assert cell["execution_count"] == number + 1, "run `make notebooks`, which stores what the cells show"
    assert pictures > 0
    matplotlib.pyplot.close("all")
