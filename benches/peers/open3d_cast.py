"""Open3D's ray casting (Embree) on the yardsticks' scene, for a side-by-side run with our own.

    python benches/peers/open3d_cast.py PEER_REFERENCE THREADS
    cargo run --release -p skysweep-bvh --example yardsticks -- PEER_REFERENCE THREADS

Prints hits, sums and Mray/s of the casting alone (rays are made before the clock starts, maps are not copied out), wall and CPU.
"""

import json
import sys
import time

import numpy as np
import open3d as o3d

EPSILON_M = 0.05


def main(folder, threads):
    mesh = o3d.t.io.read_triangle_mesh(f"{folder}/mesh_local.ply")
    start = time.perf_counter()
    scene = o3d.t.geometry.RaycastingScene(nthreads=threads)
    scene.add_triangles(mesh)
    scene.cast_rays(o3d.core.Tensor([[0, 0, 1e6, 0, 0, 1]], dtype=o3d.core.float32), nthreads=threads)
    print(f"build {1e3 * (time.perf_counter() - start):.1f} ms")
    cams = json.load(open(f"{folder}/cams.json"))
    points = np.load(f"{folder}/points_f64.npy")
    for chosen in (cams["idx20"], range(len(cams["cams"]))):
        views = [cams["cams"][i] for i in chosen]
        depth(scene, cams, views, threads)
        visibility(scene, cams, views, points, threads)


class Clock:
    def __init__(self):
        self.wall = self.cpu = 0.0

    def __enter__(self):
        self.start = time.perf_counter(), time.process_time()

    def __exit__(self, *_):
        self.wall += time.perf_counter() - self.start[0]
        self.cpu += time.process_time() - self.start[1]


def depth(scene, cams, views, threads):
    u, v = np.meshgrid(np.arange(cams["W"]) + 0.5, np.arange(cams["H"]) + 0.5)
    x, y = (u - cams["cx"]) / cams["fx"], (v - cams["cy"]) / cams["fy"]
    camera = np.stack([x, y, np.ones_like(x)], -1)
    clock, hits, total = Clock(), 0, 0.0
    for view in views:
        rotation, centre = np.array(view["R"]), np.array(view["C"])
        rays = np.concatenate([np.broadcast_to(centre, camera.shape), camera @ rotation], -1).astype(np.float32)
        rays = o3d.core.Tensor(rays)
        with clock:
            found = scene.cast_rays(rays, nthreads=threads)
        z = found["t_hit"].numpy()
        hit = np.isfinite(z)
        hits += hit.sum()
        total += z[hit].astype(np.float64).sum()
    rays = len(views) * camera.shape[0] * camera.shape[1] / 1e6
    print(f"{len(views)} maps: {hits} hits, sum z {total:.2f}, {rays / clock.wall:.1f} Mray/s, {clock.cpu:.2f} s CPU")


def visibility(scene, cams, views, points, threads):
    clock, rays_cast, seen = Clock(), 0, np.zeros(len(points), int)
    for view in views:
        rotation, centre = np.array(view["R"]), np.array(view["C"])
        local = (points - centre) @ rotation.T
        with np.errstate(divide="ignore", invalid="ignore"):
            u = cams["fx"] * local[:, 0] / local[:, 2] + cams["cx"]
            v = cams["fy"] * local[:, 1] / local[:, 2] + cams["cy"]
        inside = (local[:, 2] > 0) & (u >= 0) & (u < cams["W"]) & (v >= 0) & (v < cams["H"])
        numbers = np.flatnonzero(inside)
        to_point = points[numbers] - centre
        distance = np.linalg.norm(to_point, axis=1)
        rays = np.concatenate([np.broadcast_to(centre, to_point.shape), to_point / distance[:, None]], -1)
        rays = o3d.core.Tensor(rays.astype(np.float32))
        with clock:
            found = scene.cast_rays(rays, nthreads=threads)["t_hit"].numpy()
        seen[numbers[np.abs(found - distance) < EPSILON_M]] += 1
        rays_cast += len(numbers)
    print(
        f"{len(views)} cameras: {seen.sum()} pairs, {(seen >= 1).sum()} in one view, {(seen >= 2).sum()} in two, "
        f"{rays_cast} rays, {rays_cast / 1e6 / clock.wall:.1f} Mray/s, {clock.cpu:.2f} s CPU"
    )


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
