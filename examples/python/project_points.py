"""Projects ground points into an image and back, on arrays, and shows how far a metre of height moves them.

python examples/python/project_points.py [IMAGE]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import skysweep

TOWN = Path(__file__).resolve().parents[2] / "data-samples" / "town"


def main(image: str | None = None) -> None:
    rpc = skysweep.Rpc(image or TOWN / "view_1.tif")
    centre = skysweep.rpc_info(image or TOWN / "view_1.tif").centre
    if centre is None:
        raise SystemExit("the camera sees no ground at the centre of its domain")
    ground = centre.ground
    lon = ground.lon_deg + np.linspace(-1e-4, 1e-4, 5)
    lat = np.full(5, ground.lat_deg)
    sample, line = rpc.project(lon, lat, ground.height_m)
    back_lon, back_lat = rpc.localize(sample, line, ground.height_m)
    away = max(np.abs(back_lon - lon).max(), np.abs(back_lat - lat).max())
    print(f"seen at samples {np.round(sample, 1)}, and found again within {away:.1e}°")
    higher = rpc.project(lon, lat, ground.height_m + 1.0)
    moved = np.hypot(higher[0] - sample, higher[1] - line)
    print(f"a metre of height moves them by {moved.mean():.2f} pixels")


if __name__ == "__main__":
    main(*sys.argv[1:])
