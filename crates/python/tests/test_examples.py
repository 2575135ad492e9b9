"""The programs of `examples/python` run on the sample town, and are typed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from conftest import ROOT
from test_stubs import mypy

FOLDER = ROOT / "examples" / "python"
#: What each program prints, its first argument, and the file that it makes.
PROGRAMS = {
    "dsm_from_two_images": ("cells observed", "out", "out/dsm/dsm.tif"),
    "evaluate": ("NMAD 0.", None, None),
    "height_map": ("256 × 256 heights", "out.tif", "out.tif"),
    "priors_of_a_tile": ("objects of the model", "out", "out/height/view_1.tif"),
    "project_points": ("found again within", None, None),
}


def test_there_are_five() -> None:
    assert sorted(path.stem for path in FOLDER.glob("*.py")) == sorted(PROGRAMS)


@pytest.mark.parametrize("name", PROGRAMS)
def test_examples_run(name: str, tmp_path: Path) -> None:
    expected, output, made = PROGRAMS[name]
    arguments = [str(tmp_path / output)] if output else []
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    call = [sys.executable, str(FOLDER / f"{name}.py"), *arguments]
    done = subprocess.run(call, capture_output=True, text=True, check=False, encoding="utf-8", env=environment)
    assert done.returncode == 0, done.stderr
    assert expected in done.stdout, done.stdout
    assert made is None or (tmp_path / made).is_file()


def test_examples_are_typed() -> None:
    pytest.importorskip("mypy")
    found = mypy(FOLDER)
    assert "Success" in found, found
