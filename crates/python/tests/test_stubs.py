"""mypy --strict holds the types of the package, and of a program that uses it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from conftest import ROOT

pytest.importorskip("mypy")


def mypy(*arguments: object) -> str:
    configuration = ROOT / "pyproject.toml"
    cache = ROOT / "target" / "python" / "mypy"
    call = [sys.executable, "-m", "mypy", "--config-file", configuration, "--cache-dir", cache, *arguments]
    done = subprocess.run(list(map(str, call)), capture_output=True, text=True, check=False, cwd=ROOT)
    return done.stdout + done.stderr


def test_the_package_and_its_user_are_typed() -> None:
    found = mypy(ROOT / "crates/python/python/skysweep", Path(__file__).with_name("typed_user.py"))
    assert "Success" in found, found
