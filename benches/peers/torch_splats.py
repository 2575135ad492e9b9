"""The rasteriser of trained splats beside PyTorch on the CPU; see torch_splats.sh.

The scene has the distribution of crates/train/benches/raster.rs, and the sums are those of its reference (crates/train/tests):
colour, coverage, normal, depth and distortion of flat Gaussians, of which the loss is a weighted sum. PyTorch computes
tiles of equal length together, with padding, and its own gradients.
"""

import json
import math
import platform
import sys
import time
from pathlib import Path

import numpy as np
import torch

SIZE, SPLATS, SIGMA_PX, FOCAL, TILE, BATCH = 1024, 100_000, (2.2, 4.4), 1000.0, 16, 32
GREATEST_ALPHA, LEAST_TRANSMITTANCE, LEAST_DEPTH_RATIO = 0.99, 1e-4, 0.05
RUNS = 3


def scene():
    """Parameters of random splats before a camera that looks along z."""
    random = np.random.default_rng(7)
    depth = random.uniform(50, 100, SPLATS)
    xy = random.uniform(-0.515, 0.515, (SPLATS, 2)) * depth[:, None]
    turn = random.uniform([-0.6, -0.6, -1], [0.6, 0.6, 1], (SPLATS, 3))
    columns = [
        np.column_stack([xy, depth]),
        np.column_stack([np.ones(SPLATS), turn]),
        np.log(random.uniform(*SIGMA_PX, (SPLATS, 2)) * depth[:, None] / FOCAL),
        random.uniform(-3, 0.5, (SPLATS, 1)),
        random.uniform(0, 1, (SPLATS, 3)),
    ]
    return [torch.tensor(column, dtype=torch.float32, requires_grad=True) for column in columns]


def features(position, rotation, log_scale, logit, colour):
    """What each splat brings to its pixels: 17 numbers."""
    w, x, y, z = torch.nn.functional.normalize(rotation, dim=1).unbind(1)
    first = torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], 1)
    second = torch.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], 1)
    normal = torch.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], 1)
    normal = torch.where((normal * position).sum(1, keepdim=True) > 0, -normal, normal)
    axes = [axis / scale[:, None] for axis, scale in zip((first, second), log_scale.exp().unbind(1))]
    return torch.cat([position, *axes, normal, torch.sigmoid(logit), colour], 1)


def tiles_of(found):
    """The splats of each tile from front to back, and where the tiles are."""
    x, y, z = found[:, 0], found[:, 1], found[:, 2]
    pixel = torch.stack([x, y], 1) / z[:, None] * FOCAL + (SIZE - 1) / 2
    cutoff = 2 * torch.log(255 * found[:, 12])
    scale = 1 / found[:, 3:9].reshape(-1, 2, 3).norm(dim=2).amin(1)
    reach = torch.clamp(cutoff, min=0).sqrt() * torch.clamp(scale / z * FOCAL, min=math.sqrt(0.5)) * 1.2
    low, high = ((pixel + sign * reach[:, None]) / TILE for sign in (-1, 1))
    count = SIZE // TILE
    low, high = low.floor().clamp(0, count).int().numpy(), (high.floor() + 1).clamp(0, count).int().numpy()
    order = np.argsort(z.numpy(), kind="stable")
    lists = [[] for _ in range(count * count)]
    for splat in order:
        for row in range(low[splat, 1], high[splat, 1]):
            for column in range(low[splat, 0], high[splat, 0]):
                lists[row * count + column].append(splat)
    return lists


def draw(found, splats, tiles, weights):
    """The loss of some tiles, and the number of pairs that were drawn."""
    length = max(1, max(len(splats[tile]) for tile in tiles))
    index = torch.zeros(len(tiles), length, dtype=torch.long)
    real = torch.zeros(len(tiles), length, 1, dtype=torch.bool)
    for slot, tile in enumerate(tiles):
        index[slot, : len(splats[tile])] = torch.as_tensor(splats[tile])
        real[slot, : len(splats[tile])] = True
    count = SIZE // TILE
    corner = torch.tensor([[tile % count * TILE, tile // count * TILE] for tile in tiles])
    inside = torch.stack(torch.meshgrid(torch.arange(TILE), torch.arange(TILE), indexing="xy"), -1).reshape(1, -1, 2)
    pixel = (corner[:, None] + inside).float()
    ray = torch.cat([(pixel - (SIZE - 1) / 2) / FOCAL, torch.ones(len(tiles), TILE * TILE, 1)], 2).transpose(1, 2)
    own = found[index]
    position, first, second, normal = own[..., 0:3], own[..., 3:6], own[..., 6:9], own[..., 9:12]
    opacity, colour = own[..., 12:13], own[..., 13:16]
    depth = (normal * position).sum(2, keepdim=True) / (normal @ ray)
    u = depth * (first @ ray) - (first * position).sum(2, keepdim=True)
    v = depth * (second @ ray) - (second * position).sum(2, keepdim=True)
    in_plane = u * u + v * v
    centre = position[..., :2] / position[..., 2:] * FOCAL + (SIZE - 1) / 2
    in_image = 2 * ((pixel[:, None] - centre[:, :, None]) ** 2).sum(3)
    on_plane = (in_plane <= in_image) & (position[..., 2:] / depth >= LEAST_DEPTH_RATIO)
    rho = torch.where(on_plane, in_plane, in_image)
    drawn = (rho <= 2 * torch.log(255 * opacity)) & real
    alpha = torch.where(drawn, (opacity * torch.exp(-rho / 2)).clamp(max=GREATEST_ALPHA), 0.0)
    before = torch.cumprod(torch.cat([torch.ones_like(alpha[:, :1]), 1 - alpha[:, :-1]], 1), 1)
    takes = before >= LEAST_TRANSMITTANCE
    weight = torch.where(takes, alpha * before, 0.0)
    metres = torch.where(on_plane, depth, position[..., 2:])
    moments = [(weight * metres**power).sum(1, keepdim=True) for power in range(3)]
    images = torch.cat(
        [
            colour.transpose(1, 2) @ weight,
            moments[0],
            normal.transpose(1, 2) @ weight,
            moments[1],
            moments[0] * moments[2] - moments[1] ** 2,
        ],
        1,
    )
    at = (pixel[..., 1] * SIZE + pixel[..., 0]).long()
    return (images * weights[at][:, None]).sum(), int((drawn & takes).sum())


def once():
    parameters = scene()
    start = time.process_time()
    made = features(*parameters)
    found = made.detach().requires_grad_()
    with torch.no_grad():
        splats = tiles_of(found)
    arranged = time.process_time()
    weights = torch.arange(SIZE * SIZE) % 7 - 3.0
    by_length = sorted(range(len(splats)), key=lambda tile: len(splats[tile]))
    pairs = 0
    for first in range(0, len(by_length), BATCH):
        loss, count = draw(found, splats, by_length[first : first + BATCH], weights)
        loss.backward()
        pairs += count
    made.backward(found.grad)
    # The lists of the tiles are made in plain Python, which is no part of the comparison.
    return pairs, time.process_time() - arranged, all(bool(p.grad.isfinite().all()) for p in parameters)


def main(criterion, results):
    torch.set_num_threads(1)
    runs = [once() for _ in range(RUNS)]
    assert all(finite for _, _, finite in runs)
    pairs, seconds = runs[0][0], min(seconds for _, seconds, _ in runs)
    rows = {"PyTorch, one thread": {"ms": 1e3 * seconds, "mpairs_s": pairs / seconds / 1e6}}
    for name, registers in (("longest", "longest registers"), ("at most 256 bits", "256 bits (AVX2)")):
        folder = Path(criterion, f"forward and backward, {name}", "new")
        if not folder.is_dir():
            folder = Path(criterion, f"forward and backward_ {name}", "new")
        ns = json.loads((folder / "estimates.json").read_text())["median"]["point_estimate"]
        drawn = json.loads((folder / "benchmark.json").read_text())["throughput"]["Elements"]
        rows[f"skysweep, {registers}"] = {"ms": ns / 1e6, "mpairs_s": drawn / ns * 1e3}
        rows["PyTorch, one thread"].setdefault("pairs_to_ours", pairs / drawn)
    report = {"machine": platform.machine(), "torch": torch.__version__, "pairs": pairs, "splats": SPLATS, "rows": rows}
    Path(results, "splat_rasteriser.json").write_text(json.dumps(report, indent=2) + "\n")
    lines = [
        "# The rasteriser of splats that learn, beside PyTorch",
        "",
        f"Written by `benches/peers/torch_splats.sh`. Forward and backward pass over {SIZE} × {SIZE} pixels with {SPLATS:,} splats of the",
        f"distribution of `crates/train/benches/raster.rs`, {pairs / 1e6:.1f} million pairs of a splat and a pixel that it is drawn at,",
        f"one thread each, one after the other. PyTorch {torch.__version__} (CPU; least of {RUNS} runs, without the lists of the tiles);",
        "skysweep: median of Criterion, the lists included.",
        "",
        "| | ms | million pairs per second |",
        "|---|--:|--:|",
        *(f"| {name} | {row['ms']:.0f} | {row['mpairs_s']:.2f} |" for name, row in rows.items()),
        "",
    ]
    Path(results, "splat_rasteriser.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main(*sys.argv[1:])
