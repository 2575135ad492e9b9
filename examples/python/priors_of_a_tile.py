"""Makes the building priors of a city model for satellite images: height, distance, normal and mask maps.

python examples/python/priors_of_a_tile.py [OUTPUT [MODEL IMAGE…]]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import skysweep

TOWN = Path(__file__).resolve().parents[2] / "data-samples" / "town"


def main(output: str | None = None, model: str | None = None, *images: str) -> None:
    folder = Path(output or Path(tempfile.gettempdir()) / "skysweep_example_priors")
    buildings = model or TOWN / "truth" / "buildings.city.json"
    report = skysweep.priors(buildings, list(images or (TOWN / "view_1.tif",)), folder, overwrite=True)
    print(f"{report.unusable_objects} objects of the model could not be used")
    print(f"the maps, {report.bytes / 1e6:.1f} MB, are in {report.output}")


if __name__ == "__main__":
    main(*sys.argv[1:])
