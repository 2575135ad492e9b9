#!/usr/bin/env python3
"""Writes surface_scipy.txt: seeded clouds, meshes and maps with their metrics, computed with NumPy, SciPy, trimesh and Open3D.

Run beside this file: python surface_scipy.py > surface_scipy.txt   (NumPy, SciPy, trimesh, Open3D 0.20)

Nothing here is shared with the crate. Nearest points are those of SciPy's k-d tree; distances to triangles those of
trimesh (f64), checked against Open3D's ray casting scene (f32) on the way; everything else is brute force. The rules that both
follow: accuracy is test to reference; percentiles are numpy.percentile's linear ones; normals are the eigenvector of the least
eigenvalue of the points within D / 2 (three or more), turned upwards; angles are unsigned; M3C2 has cylinders of diameter d
that reach a stated length on both sides, standard deviations of the n - 1 kind, and LoD = 1.96 (sqrt(s1^2/n1 + s2^2/n2) + reg);
voxels have their corners at multiples of the edge.
"""
import numpy as np
import open3d as o3d
import trimesh
from scipy.spatial import cKDTree

THRESHOLDS = [0.05, 0.1, 0.3]
CONFIG = {"normal_scale": 1.5, "cylinder": 1.25, "reach": 1.0, "registration": 0.02, "voxel": 0.5}
rng = np.random.default_rng(20261121)


def roof(n, noise, shift):
    """Points on two slopes, to the millimetre."""
    xy = rng.uniform([-4, -3], [4, 3], (n, 2))
    z = 5 - 0.6 * np.abs(xy[:, 1]) + rng.normal(0, noise, n)
    return np.round(np.column_stack([xy, z]) + shift, 3)


def stats(prefix, d):
    out = {"n": len(d), "mean_m": d.mean(), "median_m": np.median(d), "rmse_m": np.sqrt((d**2).mean())}
    out |= {"le90_m": np.percentile(d, 90), "le95_m": np.percentile(d, 95), "max_m": d.max()}
    return {f"{prefix}.{k}": v for k, v in out.items()}


def normal(points, at):
    near = points[np.linalg.norm(points - at, axis=1) <= CONFIG["normal_scale"] / 2]
    if len(near) < 3:
        return None
    values, vectors = np.linalg.eigh(np.cov(near.T, bias=True))
    assert values[1] > 1e-6, "a line"
    n = vectors[:, 0]
    return n if n[2] > 0 else -n


def m3c2(test, reference):
    rows = []
    for core in reference:
        axis = normal(reference, core)
        if axis is None:
            continue
        sides = []
        for cloud in (reference, test):
            to = cloud - core
            along = to @ axis
            inside = (np.abs(along) <= CONFIG["reach"]) & (
                np.linalg.norm(to - np.outer(along, axis), axis=1) <= CONFIG["cylinder"] / 2)
            sides.append(along[inside])
        a, b = sides
        if len(a) == 0 or len(b) == 0:
            continue
        lod = np.nan
        if len(a) > 1 and len(b) > 1:
            lod = 1.96 * (np.sqrt(a.var(ddof=1) / len(a) + b.var(ddof=1) / len(b)) + CONFIG["registration"])
        rows.append((b.mean() - a.mean(), lod))
    d, lod = np.array(rows).T
    known = ~np.isnan(lod)
    out = {"core_points": len(reference), "n": len(d), "mean_m": d.mean(), "median_m": np.median(d)}
    out |= {"mean_abs_m": np.abs(d).mean(), "rmse_m": np.sqrt((d**2).mean()), "std_m": d.std(), "with_lod": known.sum()}
    out |= {"median_lod_m": np.median(lod[known]), "significant": (np.abs(d[known]) > lod[known]).mean()}
    return {f"m3c2.{k}": v for k, v in out.items()}


def voc(test, reference):
    a, b = [{tuple(v) for v in np.floor(c / CONFIG["voxel"]).astype(int)} for c in (test, reference)]
    return {"voc.test": len(a), "voc.reference": len(b), "voc.shared": len(a & b), "voc.voc": len(a & b) / len(a | b),
            "voc.completeness": len(a & b) / len(b), "voc.correctness": len(a & b) / len(a)}


def clouds(test, reference):
    forth, nearest = cKDTree(reference).query(test)
    back, _ = cKDTree(test).query(reference)
    out = stats("accuracy", forth) | stats("completeness", back)
    for t in THRESHOLDS:
        p, r = (forth < t).mean(), (back < t).mean()
        out |= {f"precision_{t}": p, f"recall_{t}": r, f"f_{t}": 2 * p * r / (p + r) if p + r else 0.0}
    out |= {"chamfer_m": (forth.mean() + back.mean()) / 2, "hausdorff_m": max(forth.max(), back.max())}
    angles = []
    for point, i in zip(test, nearest):
        a, b = normal(test, point), normal(reference, reference[i])
        if a is not None and b is not None:
            angles.append(np.degrees(np.arccos(min(1.0, abs(a @ b)))))
    out |= {"angle.n": len(angles), "angle.mean_deg": np.mean(angles), "angle.median_deg": np.median(angles)}
    out |= {"angle.p90_deg": np.percentile(angles, 90)}
    return out | m3c2(test, reference) | voc(test, reference)


def to_mesh(points, positions, triangles):
    """Distances of points to triangles, all against all in f64."""
    corners = positions[triangles]
    best = np.full(len(points), np.inf)
    for corner in corners:
        on = trimesh.triangles.closest_point(np.repeat(corner[None], len(points), 0), points)
        best = np.minimum(best, np.linalg.norm(on - points, axis=1))
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(positions.astype(np.float32), triangles.astype(np.uint32))
    assert np.abs(scene.compute_distance(points.astype(np.float32)).numpy() - best).max() < 1e-5
    return best


def rows(label, array):
    print(f"{label} {len(array)}")
    for row in array:
        print(" ".join(repr(v.item()) for v in row))


def values(found):
    print("values " + " ".join(f"{k}={float(v)!r}" for k, v in found.items()))


def depth_case(test, reference):
    fine = np.isfinite(test) & (test > 0), np.isfinite(reference) & (reference > 0)
    both = fine[0] & fine[1]
    t, r = test[both], reference[both]
    e, ratio = t - r, np.maximum(t / r, r / t)
    out = {"valid.both": both.sum(), "valid.iou": both.sum() / (fine[0] | fine[1]).sum(), "bias": e.mean()}
    out |= {"mae": np.abs(e).mean(), "rmse": np.sqrt((e**2).mean()), "median_abs": np.median(np.abs(e))}
    out |= {"max_abs": np.abs(e).max(), "abs_rel": (np.abs(e) / r).mean()}
    return out | {f"delta_{i}": (ratio < 1.25**i).mean() for i in (1, 2, 3)}


def normal_case(test, reference):
    fine = np.linalg.norm(test, axis=1) > 0, np.linalg.norm(reference, axis=1) > 0
    both = fine[0] & fine[1]
    t, r = [m[both] / np.linalg.norm(m[both], axis=1)[:, None] for m in (test, reference)]
    a = np.degrees(np.arccos(np.clip((t * r).sum(1), -1, 1)))
    out = {"valid.both": both.sum(), "mean_deg": a.mean(), "median_deg": np.median(a), "max_deg": a.max()}
    return out | {"rmse_deg": np.sqrt((a**2).mean()), "within_30": (a < 30).mean(), "within_11.25": (a < 11.25).mean()}


print("# Written by surface_scipy.py; see there for the rules.")
print("thresholds " + " ".join(map(str, THRESHOLDS)))
print("config " + " ".join(f"{k}={v}" for k, v in CONFIG.items()))

for name, a, b in [("near", roof(300, 0.02, [0, 0, 0.06]), roof(260, 0.03, [0, 0, 0])),
                   ("far", roof(200, 0.1, [0.2, 0.1, -0.3]), np.vstack([roof(150, 0.05, 0), roof(30, 0.2, [9, 0, 2])]))]:
    print(f"case clouds {name}")
    rows("test", a)
    rows("reference", b)
    values(clouds(a, b))

positions = np.array([[-4, -3, 3.2], [4, -3, 3.2], [4, 0, 5], [-4, 0, 5], [4, 3, 3.2], [-4, 3, 3.2], [-4, -3, 0],
                      [4, -3, 0], [4, 3, 0], [-4, 3, 0]], dtype=float)
triangles = np.array([[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5], [6, 7, 1], [6, 1, 0], [8, 9, 5], [8, 5, 4], [7, 8, 4],
                      [7, 4, 1], [1, 4, 2], [9, 6, 0], [9, 0, 5], [5, 0, 3]])
points = np.round(np.vstack([roof(120, 0.2, 0), rng.uniform([-7, -6, -2], [7, 6, 8], (120, 3))]), 3)
print("case mesh house")
rows("points", points)
rows("positions", positions)
rows("triangles", triangles)
d = to_mesh(points, positions, triangles)
values(stats("distance", d) | {f"share_{t}": (d < t).mean() for t in THRESHOLDS})

test, reference = np.round(rng.uniform(5, 60, (2, 40)), 3)
test[:20] = np.round(reference[:20] + rng.normal(0, 1, 20), 3)
test[[3, 30]], reference[[7, 30]], reference[12] = np.inf, 0, np.inf
print("case depths maps")
rows("pairs", np.column_stack([test, reference]))
values(depth_case(test, reference))

test = np.round(rng.normal(0, 1, (40, 3)), 3)
reference = np.round(test + rng.normal(0, 0.3, (40, 3)), 3)
test[5], reference[[5, 9]] = 0, 0
print("case normals maps")
rows("pairs", np.column_stack([test, reference]))
values(normal_case(test, reference))
