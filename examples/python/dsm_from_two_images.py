"""Makes a surface model from two satellite images with RPCs, and says why it was made so.

python examples/python/dsm_from_two_images.py [OUTPUT [IMAGE IMAGE…]]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import skysweep

TOWN = Path(__file__).resolve().parents[2] / "data-samples" / "town"


def main(output: str | None = None, *images: str) -> None:
    folder = Path(output or Path(tempfile.gettempdir()) / "skysweep_example_dsm")
    views = images or (TOWN / "view_1.tif", TOWN / "view_3.tif")
    report = skysweep.dsm(list(views), folder, preset="fast", overwrite=True)
    for choice in report.choices:
        print(f"{choice.name}: {choice.value} ({choice.reason})")
    surface = report.surface
    print(f"{surface.observed} of {surface.cells} cells observed, in {folder / 'dsm' / 'dsm.tif'}")


if __name__ == "__main__":
    main(*sys.argv[1:])
