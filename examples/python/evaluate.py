"""Measures a surface in memory against a reference, after bringing one to the place of the other.

python examples/python/evaluate.py [TEST REFERENCE]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import skysweep

TOWN = Path(__file__).resolve().parents[2] / "data-samples" / "town"


def main(test: str | None = None, reference: str | None = None) -> None:
    truth = skysweep.read_raster(reference or TOWN / "truth" / "dsm.tif")
    # Without a surface of your own: the reference, a cell further east and with noise of 20 cm.
    noise = np.random.default_rng(7).normal(0.0, 0.2, truth.shape)
    surface = skysweep.read_raster(test) if test else truth.with_values(np.roll(truth.values, 1, axis=1) + noise)
    report = skysweep.evaluate(surface, truth, alignment="xyz")
    shift, metrics = report.shift, report.metrics
    print(f"moved by {shift.dx_m:.2f} m east, {shift.dy_m:.2f} m north, {shift.dz_m:.2f} m up")
    print(f"NMAD {metrics.nmad:.2f} m, RMSE {metrics.rmse:.2f} m over {metrics.n} cells")
    for note in report.notes:
        print(note)


if __name__ == "__main__":
    main(*sys.argv[1:])
