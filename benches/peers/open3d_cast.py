"""Open3D's ray casting (Embree) on the scene of the yardsticks; `priors.py` runs it beside `cargo bench --bench casting`.

    python benches/peers/open3d_cast.py PEER_REFERENCE THREADS [RAYS.npy]

Prints a line of JSON: wall and CPU seconds of building and casting (rays are made before the clock starts, and nothing is copied
out of Open3D, though its normals are asked for), what came out, and the process's largest memory after the imports and at the
end. With RAYS.npy (camera, column, row, exact depth) also how far its depths are from those.
"""

import json
import resource
import sys
import time

import numpy as np
import open3d as o3d

EPSILON_M = 0.05


class Clock:
    def __init__(self):
        self.wall = self.cpu = 0.0

    def __enter__(self):
        self.start = time.perf_counter(), time.process_time()

    def __exit__(self, *_):
        self.wall += time.perf_counter() - self.start[0]
        self.cpu += time.process_time() - self.start[1]

    def json(self, **more):
        return {"wall_s": self.wall, "cpu_s": self.cpu, **more}


def peak_mib():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main(folder, threads, exact=None):
    imported = peak_mib()
    mesh = o3d.t.io.read_triangle_mesh(f"{folder}/mesh_local.ply")
    build = Clock()
    with build:
        scene = o3d.t.geometry.RaycastingScene(nthreads=threads)
        scene.add_triangles(mesh)
        scene.cast_rays(o3d.core.Tensor([[0, 0, 1e6, 0, 0, 1]], dtype=o3d.core.float32), nthreads=threads)
    with open(f"{folder}/cams.json") as file:
        cams = json.load(file)
    points = np.load(f"{folder}/points_f64.npy")
    told = {
        "version": o3d.__version__,
        "build": build.json(),
        "maps": depth(scene, cams, threads),
        "visibility": visibility(scene, cams, points, threads),
        "imported_mib": imported,
        "peak_mib": peak_mib(),
    }
    if exact:
        told["brute_force"] = errors(scene, cams, np.load(exact), threads)
    print(json.dumps(told))


def image_rays(cams, view, columns, rows):
    x, y = (columns + 0.5 - cams["cx"]) / cams["fx"], (rows + 0.5 - cams["cy"]) / cams["fy"]
    camera = np.stack([x, y, np.ones_like(x)], -1)
    rotation, centre = np.array(view["R"]), np.array(view["C"])
    rays = np.concatenate([np.broadcast_to(centre, camera.shape), camera @ rotation], -1)
    return o3d.core.Tensor(rays.astype(np.float32))


def depth(scene, cams, threads):
    columns, rows = np.meshgrid(np.arange(cams["W"], dtype=float), np.arange(cams["H"], dtype=float))
    clock, hits, total = Clock(), 0, 0.0
    for view in cams["cams"]:
        rays = image_rays(cams, view, columns, rows)
        with clock:
            found = scene.cast_rays(rays, nthreads=threads)
        z = found["t_hit"].numpy()
        hit = np.isfinite(z)
        hits += int(hit.sum())
        total += float(z[hit].astype(np.float64).sum())
    return clock.json(rays=len(cams["cams"]) * columns.size, hits=hits, sum_z_m=total)


def visibility(scene, cams, points, threads):
    clock, whole, rays_cast, seen = Clock(), Clock(), 0, np.zeros(len(points), int)
    for view in cams["cams"]:
        with whole:
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
                found = scene.cast_rays(rays, nthreads=threads)
            seen[numbers[np.abs(found["t_hit"].numpy() - distance) < EPSILON_M]] += 1
            rays_cast += len(numbers)
    counts = {"pairs": int(seen.sum()), "in_one_view": int((seen >= 1).sum()), "in_two_views": int((seen >= 2).sum())}
    return clock.json(rays=rays_cast, whole=whole.json(), **counts)


def errors(scene, cams, exact, threads):
    """How far depths are from the exact ones, and how often only one of the two is a hit."""
    off, other = [], 0
    for index, view in enumerate(cams["cams"]):
        rows = exact[exact[:, 0] == index]
        found = scene.cast_rays(image_rays(cams, view, rows[:, 1], rows[:, 2]), nthreads=threads)["t_hit"].numpy()
        both = np.isfinite(found) & np.isfinite(rows[:, 3])
        other += int((np.isfinite(found) != np.isfinite(rows[:, 3])).sum())
        off.append(np.abs(found[both] - rows[both, 3]))
    off = np.concatenate(off)
    return {"rays": len(exact), "hits": len(off), "hit_by_one_only": other, "mean_m": float(off.mean()), "max_m": float(off.max())}


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), *sys.argv[3:])
