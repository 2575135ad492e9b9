"""Checks that readers of other projects load a dataset of `skysweep priors`.

    python benches/peers/check_priors.py DATASET

DATASET may hold `sparse/0` (COLMAP, bin and txt), `*.ply` and maps as `.npy`. pycolmap reads the model, Open3D and
trimesh read the points, NumPy the maps. A package that cannot be imported is named on a line that begins with `skip`; a
check that fails exits with 1. Beyond loading: every observation lies on the projection of its point within a pixel, text and
binary are the same model, points have unit normals and colours, maps have the size of their camera.
"""

import importlib
import pathlib
import sys

failures = []


def package(name):
    try:
        return importlib.import_module(name)
    except ImportError as error:
        print(f"skip {name}: {error}")
        return None


def check(fine, text):
    print(("ok   " if fine else "FAIL ") + text)
    if not fine:
        failures.append(text)


def colmap(folder, np):
    pycolmap = package("pycolmap")
    if pycolmap is None:
        return
    models = {}
    for kind in ("bin", "txt"):
        if (folder / f"cameras.{kind}").exists():
            model = pycolmap.Reconstruction()
            {"bin": model.read_binary, "txt": model.read_text}[kind](str(folder))
            models[kind] = model
            seen, worst = reprojection(model, np)
            text = f"pycolmap {kind}: {model.num_cameras()} cameras, {model.num_images()} images, "
            check(worst < 1.0, text + f"{model.num_points3D()} points, {seen} observations, off by up to {worst:.4f} px")
    if len(models) == 2:
        a, b = models["bin"], models["txt"]
        same = set(a.points3D) == set(b.points3D) and set(a.images) == set(b.images)
        same = same and all(np.array_equal(a.points3D[i].xyz, b.points3D[i].xyz) for i in list(a.points3D)[:10000])
        check(same, "text and binary hold the same points and images")


def reprojection(model, np):
    """The number of observations and the largest distance of one from the projection of its point, pixels."""
    worst, seen = 0.0, 0
    for image in model.images.values():
        points = [p for p in image.points2D if p.has_point3D()]
        seen += len(points)
        if not points:
            continue
        pose = image.cam_from_world
        pose = pose() if callable(pose) else pose
        xyz = np.array([model.points3D[p.point3D_id].xyz for p in points]) @ pose.rotation.matrix().T + pose.translation
        found = model.cameras[image.camera_id].img_from_cam(xyz)
        worst = max(worst, np.linalg.norm(np.asarray(found) - np.array([p.xy for p in points]), axis=1).max())
    return seen, worst


def plys(paths, np):
    open3d, trimesh = package("open3d"), package("trimesh")
    for path in paths:
        # Splats have other properties than points and are no point clouds for Open3D.
        if open3d is not None and "splat" not in path.name:
            cloud = open3d.io.read_point_cloud(str(path))
            count = len(cloud.points)
            check(count > 0 and cloud.has_colors(), f"Open3D {path.name}: {count} points with colours")
            if cloud.has_normals():
                length = np.linalg.norm(np.asarray(cloud.normals), axis=1)
                check(bool(np.all((abs(length - 1) < 1e-5) | (length == 0))), f"Open3D {path.name}: unit normals")
        if trimesh is not None:
            found = trimesh.load(str(path))
            vertices = np.asarray(found.vertices)
            check(len(vertices) > 0 and bool(np.isfinite(vertices).all()), f"trimesh {path.name}: {len(vertices)} vertices")


def maps(paths, np):
    for path in paths:
        array = np.load(path, allow_pickle=False)
        fine = array.ndim in (2, 3) and array.dtype.kind in "fbu" and array.flags["C_CONTIGUOUS"]
        fine = fine and not (array.dtype.kind == "f" and np.isnan(array).any())
        check(fine, f"NumPy {path.parent.name}/{path.name}: {array.dtype} {array.shape}")


def main(folder):
    folder = pathlib.Path(folder)
    np = package("numpy")
    if np is None:
        return
    sparse = folder / "sparse" / "0"
    if sparse.is_dir():
        colmap(sparse, np)
    plys(sorted(folder.rglob("*.ply")), np)
    maps(sorted(folder.rglob("*.npy")), np)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
    sys.exit(1 if failures else 0)
