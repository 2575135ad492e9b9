"""A COLMAP model along a bent street, and GPS positions of its images under a planted similarity (NumPy, and PROJ through rasterio).

Writes model/{cameras,images,points3D}.txt, gps.csv (exact), gps_wrong.csv (30 % of the positions off by tens of metres) and
planted.txt: scale, nine numbers of the rotation row by row, and the translation to UTM 31N with ellipsoidal heights.
Run in this folder: python3 generate.py
"""
from pathlib import Path

import numpy as np
from rasterio.warp import transform

HERE = Path(__file__).resolve().parent
COUNT = 40
rng = np.random.default_rng(6)


def rotation(q):
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


scale, turn, shift = 13.75, rotation(np.array([0.6, -0.2, 0.7, 0.33])), np.array([694321.25, 4822543.5, 213.75])
t = np.linspace(0, 1, COUNT)
centres = np.stack([8 * t, 1.5 * np.sin(4 * t), 0.3 * np.cos(7 * t)], axis=1)
world = scale * centres @ turn.T + shift
lon, lat, height = (np.array(v) for v in transform("EPSG:32631", "EPSG:4326", *world[:, :2].T, zs=world[:, 2]))

(HERE / "model").mkdir(exist_ok=True)
(HERE / "model/cameras.txt").write_text("1 PINHOLE 640 480 500 500 320 240\n")
images, points = [], [[] for _ in range(25)]
places = rng.uniform([0, -3, -1], [8, 3, 1], (25, 3))
for i in range(COUNT):
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    translation = -rotation(q) @ centres[i]
    seen = rng.choice(25, 4, replace=False)
    for k, point in enumerate(seen):
        points[point].append((i + 1, k))
    row = " ".join(f"{v:.17g}" for v in [*q, *translation])
    images.append(f"{i + 1} {row} 1 street/{i:03}.jpg\n" + " ".join(f"{10 * k}.5 {20 * k}.25 {p + 1}" for k, p in enumerate(seen)) + "\n")
(HERE / "model/images.txt").write_text("".join(images))
rows = (f"{p + 1} {' '.join(f'{v:.17g}' for v in places[p])} 10 20 30 0.5 " + " ".join(f"{i} {k}" for i, k in track) for p, track in enumerate(points))
(HERE / "model/points3D.txt").write_text("\n".join(rows) + "\n")

line = "street/{:03}.jpg,{:.14f},{:.14f},{:.9f}\n"
(HERE / "gps.csv").write_text("name,lon,lat,height\n" + "".join(line.format(i, lon[i], lat[i], height[i]) for i in range(COUNT)))
wrong = set(rng.choice(COUNT, COUNT * 3 // 10, replace=False).tolist())
off = rng.normal(size=(COUNT, 3)) * [4e-4, 3e-4, 25]
place = lambda i: (lon[i] + off[i, 0] * (i in wrong), lat[i] + off[i, 1] * (i in wrong), height[i] + off[i, 2] * (i in wrong))
(HERE / "gps_wrong.csv").write_text("name,lon,lat,height\n" + "".join(line.format(i, *place(i)) for i in range(COUNT)))
(HERE / "planted.txt").write_text("\n".join(f"{v:.17g}" for v in [scale, *turn.ravel(), *shift]) + "\n")
