"""Writes reference.txt: what three cameras see of the points of shared/data/photos/garden3 as flat splats.

Computed in f64 from the formulas of the papers alone, one splat after another: the ray of a pixel meets the plane of
a splat through the homography of Huang et al. ("2D Gaussian Splatting", SIGGRAPH 2024); the Gaussian is blurred in
its plane by a variance of a tenth of a squared pixel (Younes and Boukhayma, "Anti-Aliased 2D Gaussian Splatting",
2025); colours are real spherical harmonics up to degree 3 whose coefficients beyond the constant are all 1; splats
are blended from front to back as Kerbl et al. (2023) do.

A point is a splat whose shape follows from its number, see `splats`. A line has the view, the first column and row
of a block, its means of red, green, blue, coverage and the sum of weighted depths, then column, row, red, green and
blue of a pixel in it at which no splat is about to begin or end. Needs NumPy; made with 2.4.6:

    python generate.py ../../../../shared/data/photos/garden3/test_garden.npz > reference.txt
"""

import sys

import numpy as np

BLOCK = (54, 42)
PIXEL_VARIANCE = 0.1
NEAR = 0.1
# Sine between plane and line of sight, opacity, ratio of depths, opacity and transmittance at which drawing ends.
EDGE_ON, LEAST_ALPHA, LEAST_RATIO, GREATEST_ALPHA, LEAST_LEFT = 0.02, 1 / 255, 0.05, 0.99, 1e-4
# Squared standard deviations from the end of a splat within which a pixel is not judged on its own.
UNSURE = 1e-3


def splats(count):
    """Quaternions (w, x, y, z), scales and opacities, each rounded to f32 as trainers store them."""
    i = np.arange(count)
    rotation = np.stack([np.ones(count), np.sin(0.7 * i), np.sin(1.1 * i), np.sin(1.7 * i)], axis=1)
    scale = np.stack([0.008 * (1 + i % 3), 0.008 * (1 + i % 2)], axis=1)
    rotation, log_scale = rotation.astype(np.float32), np.log(scale).astype(np.float32)
    rotation = rotation.astype(np.float64)
    rotation /= np.linalg.norm(rotation, axis=1, keepdims=True)
    return rotation, np.exp(log_scale.astype(np.float64)), 1 / (1 + np.exp(2.0 - i % 5))


def harmonics(d):
    """The real spherical harmonics of degree 1 to 3 with the signs of 3DGS, added up."""
    x, y, z = d.T
    pi, root = np.pi, np.sqrt
    one = root(3 / (4 * pi)) * (-y + z - x)
    two = root(15 / pi) / 2 * (x * y - y * z - x * z + (x * x - y * y) / 2) + root(5 / pi) / 4 * (3 * z * z - 1)
    three = -root(35 / (2 * pi)) / 4 * (y * (3 * x * x - y * y) + x * (x * x - 3 * y * y))
    three += root(105 / pi) / 2 * (x * y * z + z * (x * x - y * y) / 2)
    three += -root(21 / (2 * pi)) / 4 * (x + y) * (5 * z * z - 1) + root(7 / pi) / 4 * z * (5 * z * z - 3)
    return one + two + three


def axes(q):
    """The first two columns of the rotation, and the third."""
    w, x, y, z = q.T
    first = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
    second = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1)
    return first, second, np.cross(first, second)


def draw(points, colours, view, intrinsics, size):
    rotation, scale, opacity = splats(len(points))
    tu, tv, normal = axes(rotation)
    seen = points @ view[:3, :3].T + view[:3, 3]
    centre = -view[:3, :3].T @ view[:3, 3]
    sight = points - centre
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    colour = np.maximum(colours + harmonics(sight)[:, None], 0.0)
    # The centre of the upper left pixel is (0, 0).
    k = intrinsics.copy()
    k[:2, 2] -= 0.5
    columns = [scale[:, :1] * (tu @ view[:3, :3].T), scale[:, 1:] * (tv @ view[:3, :3].T), seen]
    # From (u, v, 1) to the homogeneous pixel.
    m = k @ np.stack(columns, axis=2)
    good = (seen[:, 2] > NEAR) & (np.abs(np.sum(normal * sight, axis=1)) > EDGE_ON)
    place = m[:, :2, 2] / m[:, 2:, 2]
    jacobian = (m[:, :2, :2] - place[:, :, None] * m[:, 2:, :2]) / m[:, 2:, 2:]
    good &= np.abs(np.linalg.det(jacobian)) > 0
    number = np.flatnonzero(good)
    inverse = np.linalg.inv(jacobian[number])
    blurred = np.eye(2) + PIXEL_VARIANCE * inverse @ inverse.transpose(0, 2, 1)
    peak = opacity[number] / np.sqrt(np.linalg.det(blurred))
    keep = peak > LEAST_ALPHA
    number, blurred, peak = number[keep], blurred[keep], peak[keep]
    cutoff = 2 * np.log(peak / LEAST_ALPHA)
    wide = np.zeros((len(number), 3, 3))
    wide[:, :2, :2], wide[:, 2, 2] = np.linalg.cholesky(blurred), 1
    h = m[number] @ wide
    # The splat's outline is a circle in its plane; the tangents of its image are the roots of a dual conic.
    circle = np.stack([cutoff, cutoff, -np.ones_like(cutoff)], axis=1)
    dual = h * circle[:, None, :] @ h.transpose(0, 2, 1)
    bounds = np.zeros((len(number), 2, 2))
    bounded = dual[:, 2, 2] < -1e-3 * h[:, 2, 2] ** 2
    for axis in range(2):
        a, b, c = dual[:, 2, 2], dual[:, axis, 2], dual[:, axis, axis]
        root = np.sqrt(np.maximum(b * b - a * c, 0))
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.sort(np.stack([(b - root) / a, (b + root) / a], axis=1), axis=1)
        ends[~bounded] = [0, size[axis] - 1]
        bounds[:, axis] = ends
    first = np.clip(np.ceil(bounds[:, :, 0] - 1e-6), 0, size).astype(int)
    last = np.clip(np.floor(bounds[:, :, 1] + 1e-6), -1, np.array(size) - 1).astype(int) + 1
    back = np.linalg.inv(h)
    shape = (size[1], size[0])
    left, unsure = np.ones(shape), np.zeros(shape, bool)
    image = np.zeros((*shape, 5))
    for j in np.argsort(h[:, 2, 2].astype(np.float32), kind="stable"):
        (x0, y0), (x1, y1) = first[j], last[j]
        if x0 >= x1 or y0 >= y1:
            continue
        here = (slice(y0, y1), slice(x0, x1))
        if left[here].max() < LEAST_LEFT:
            continue
        x, y = np.arange(x0, x1)[None, :], np.arange(y0, y1)[:, None]
        u, v, w = (row[0] * x + row[1] * y + row[2] for row in back[j])
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v = u / w, v / w
        rho = u * u + v * v
        depth = h[j, 2, 0] * u + h[j, 2, 1] * v + h[j, 2, 2]
        ratio = h[j, 2, 2] / depth
        takes = left[here] >= LEAST_LEFT
        drawn = takes & (rho <= cutoff[j]) & (ratio >= LEAST_RATIO)
        unsure[here] |= takes & (np.abs(rho - cutoff[j]) < UNSURE) & (ratio > 0.5 * LEAST_RATIO)
        unsure[here] |= (rho <= cutoff[j]) & (np.abs(left[here] / LEAST_LEFT - 1) < 1e-2)
        alpha = np.where(drawn, np.minimum(peak[j] * np.exp(-rho / 2), GREATEST_ALPHA), 0.0)
        weight = left[here] * alpha
        left[here] -= weight
        image[here][..., :3] += weight[..., None] * colour[number[j]]
        image[here][..., 3] += weight
        image[here][..., 4] += np.where(drawn, weight * depth, 0.0)
    return image, unsure


def main():
    data = np.load(sys.argv[1])
    size = (int(data["width"]), int(data["height"]))
    colours = (data["colors"].astype(np.float32) / np.float32(255)).astype(np.float64)
    for number, (view, intrinsics) in enumerate(zip(data["viewmats"], data["Ks"])):
        points = data["means3d"].astype(np.float64)
        image, unsure = draw(points, colours, view.astype(np.float64), intrinsics.astype(np.float64), size)
        for top in range(0, size[1], BLOCK[1]):
            for first in range(0, size[0], BLOCK[0]):
                block = image[top:top + BLOCK[1], first:first + BLOCK[0]]
                sure = np.argwhere(~unsure[top:top + BLOCK[1], first:first + BLOCK[0]])
                row, column = sure[len(sure) // 2]
                means = [f"{value:.6f}" for value in block.mean(axis=(0, 1))]
                pixel = [f"{value:.5f}" for value in block[row, column, :3]]
                print(number, first, top, *means, first + column, top + row, *pixel)


if __name__ == "__main__":
    main()
