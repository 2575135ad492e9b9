"""Hillshades side by side, for the pictures of surfaces before and after a change. Needs numpy and rasterio."""

import numpy as np
import rasterio

GAP_CELLS = 8


def hillshade(heights, cell_m):
    """Light from the north-west at 35° above the horizon on each cell, -1 to 1; NaN beside places without a height."""
    down, right = np.gradient(heights, cell_m)
    return (1.0 + right + down) / np.sqrt(3.0 * (1.0 + right**2 + down**2))


def side_by_side(parts, light, path):
    """Writes pictures of one height as a PNG. `light` is what is black and what is white; NaN is black."""
    low, high = light
    gap = np.full((parts[0].shape[0], GAP_CELLS), high)
    image = np.hstack([parts[0], *[part for other in parts[1:] for part in (gap, other)]])
    image = np.nan_to_num(np.clip(255.0 * (image - low) / (high - low), 0, 255)).astype(np.uint8)
    with rasterio.open(path, "w", driver="PNG", height=image.shape[0], width=image.shape[1], count=1, dtype="uint8") as out:
        out.write(image, 1)
