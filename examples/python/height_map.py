"""Makes a bird's-eye height map around a camera, turned to its heading, and reads it.

python examples/python/height_map.py [OUTPUT.tif]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import skysweep

TOWN = Path(__file__).resolve().parents[2] / "data-samples" / "town"


def main(output: str | None = None) -> None:
    path = Path(output or Path(tempfile.gettempdir()) / "skysweep_example_height_map.tif")
    skysweep.heightmap(
        TOWN / "truth" / "dsm.tif",
        path,
        {"source": {"position": {"lon_deg": 5.4, "lat_deg": 43.53}}, "heading_deg": 37.0},
        size_px=256,
        overwrite=True,
    )
    heights = skysweep.read_raster(path).values
    print(f"{heights.shape[1]} × {heights.shape[0]} heights up to {np.nanmax(heights):.1f} m, in {path}")


if __name__ == "__main__":
    main(*sys.argv[1:])
