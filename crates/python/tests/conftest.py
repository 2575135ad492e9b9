"""What the tests share: the sample town and small runs of it."""

from __future__ import annotations

import hashlib
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
TOWN = ROOT / "data-samples" / "town"
VIEWS = [TOWN / "view_1.tif", TOWN / "view_3.tif"]
#: A scene of a second.
SMALL: dict[str, Any] = {"gsd_m": 2.0, "preset": "fast", "height_range_m": [170.0, 280.0]}
#: The same on the command line.
SMALL_OPTIONS = ["--gsd", "2", "--preset", "fast", "--height-range", "170", "280"]
#: Side of the chunks that make four of it.
CHUNK = 128


def command(*arguments: object) -> str:
    """Runs the command `skysweep`, or skips the test where it is not built."""
    path = os.environ.get("SKYSWEEP_COMMAND", str(ROOT / "target/debug/skysweep"))
    if not Path(path).exists():
        pytest.skip(f"{path} is not built")
    done = subprocess.run([path, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def rasters(folder: Path) -> dict[str, str]:
    """Hashes of the rasters of a run."""
    found = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in (folder / "dsm").glob("*.tif")}
    assert "dsm.tif" in found
    return found
