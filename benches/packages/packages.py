"""Sizes, times and trials of the static command and of the wheel; see packages.sh."""

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: A grid of PROJ's package (Debian: proj-data).
EGM96 = Path("/usr/share/proj/egm96_15.gtx")
VIEWS = ["view_1.tif", "view_2.tif", "view_3.tif"]
#: What the wheel needs besides itself for the tests of its package, the notebooks and the examples.
TESTED_WITH = ["pytest", "mypy", "matplotlib", "rasterio", "rioxarray", "xarray", "geopandas", "pyproj", "pyarrow",
               "shapely", "distributed", "tqdm"]
#: An image is opened by both packages, and a map projection asked of both.
BOTH = """
import {first}, {second}
import rasterio.crs, skysweep, sys
with rasterio.open(sys.argv[1]) as file:
    assert file.read(1).size > 0
assert skysweep.rpc_info(sys.argv[1]).image.width == file.width
assert rasterio.crs.CRS.from_epsg(32631).is_projected
surface = skysweep.read_raster(sys.argv[2])
assert "32631" in surface.crs and surface.reproject(crs="EPSG:4326").values.size > 0
"""


def run(call, cwd=None, env=None):
    """Output and wall time of a command that must succeed."""
    start = time.monotonic()
    done = subprocess.run([str(part) for part in call], cwd=cwd, env=env, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, call))}\nended with {done.returncode}:\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}")
    return done.stdout, time.monotonic() - start


def libraries(file):
    """Names and paths of the shared libraries of a program or module."""
    found, _ = run(["ldd", file])
    paths = re.findall(r"^\s*(?:(\S+) => )?(/\S+) \(0x", found, flags=re.MULTILINE)
    return {Path(name or path).name: Path(path) for name, path in paths}


def into_root(root, file):
    """Copies a file and the libraries that it needs to the same places below another root."""
    for path in [Path(file), *libraries(file).values()]:
        to = root / str(path).lstrip("/")
        if not to.exists():
            to.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path.resolve(), to)


def without_gdal(folder, command):
    """Tries the command where there is nothing but it, the C library and the sample town."""
    root = folder / "root"
    for name in ("tmp", "town/truth"):
        (root / name).mkdir(parents=True)
    into_root(root, command)
    shutil.copy(command, root / "skysweep")
    for name in [*VIEWS, "truth/dsm.tif"]:
        shutil.copy(ROOT / "data-samples" / "town" / name, root / "town" / name)
    files = sum(1 for path in root.rglob("*") if path.is_file())
    inside = ["chroot", root, "/skysweep"]
    tested, _ = run([*inside, "selftest"])
    _, dsm_s = run([*inside, "dsm", *(f"/town/{name}" for name in VIEWS), "-o", "/tmp/out", "--progress", "none"])
    told, _ = run([*inside, "eval", "/tmp/out/dsm/dsm.tif", "/town/truth/dsm.tif", "--align", "xyz", "--json", "--no-report"])
    return {
        "files": files,
        "selftest": [line.split()[0] for line in tested.strip().splitlines()[1:]],
        "dsm_s": dsm_s,
        "mae_m": json.loads(told)["metrics"]["mae"],
    }


def python_without_gdal(folder, wheel):
    """Runs the examples where there is nothing but Python, NumPy and the wheel."""
    root = folder / "python-root"
    (root / "tmp").mkdir(parents=True)
    interpreter = Path(sys.executable).resolve()
    into_root(root, interpreter)
    standard = Path(os.__file__).parent
    shutil.copytree(standard, root / str(standard).lstrip("/"), symlinks=False, ignore=shutil.ignore_patterns(
        "dist-packages", "site-packages", "test", "__pycache__"))
    packages = root / "packages"
    run([sys.executable, "-m", "pip", "install", "--quiet", "--target", packages, wheel])
    for module in [*root.rglob("*.so"), *root.rglob("*.so.*")]:
        if module.is_relative_to(packages) or "lib-dynload" in str(module):
            into_root_libraries(root, module)
    shutil.copytree(ROOT / "examples", root / "source" / "examples")
    shutil.copytree(ROOT / "data-samples", root / "source" / "data-samples")
    gdal = [path.name for path in root.rglob("*") if re.match(r"lib(gdal|proj)\b", path.name) and packages not in path.parents]
    assert not gdal, gdal
    env = {"PYTHONPATH": "/packages", "PYTHONHOME": str(standard.parents[1]), "PATH": "/", "TMPDIR": "/tmp", "PYTHONIOENCODING": "utf-8"}
    names = sorted(path.stem for path in (ROOT / "examples" / "python").glob("*.py"))
    outputs = {"dsm_from_two_images": "/tmp/dsm", "height_map": "/tmp/height.tif", "priors_of_a_tile": "/tmp/priors"}
    for name in names:
        arguments = [outputs[name]] if name in outputs else []
        run([shutil.which("chroot"), root, interpreter, f"/source/examples/python/{name}.py", *arguments], env=env)
    return names


def into_root_libraries(root, module):
    """Copies the libraries of the system that a module of a package needs."""
    for path in libraries(module).values():
        to = root / str(path).lstrip("/")
        if not path.is_relative_to(root) and not to.exists():
            to.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path.resolve(), to)


def beside_others(folder, wheel, clone, command):
    """Tests of the package, the notebooks and the examples with the wheel, and rasterio in both orders."""
    venv = folder / "venv"
    run([sys.executable, "-m", "venv", venv])
    python = venv / "bin" / "python"
    run([python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel, *TESTED_WITH])
    town = ROOT / "data-samples" / "town"
    for first, second in (("rasterio", "skysweep"), ("skysweep", "rasterio")):
        run([python, "-c", BOTH.format(first=first, second=second), town / "view_1.tif", town / "truth" / "dsm.tif"])
    env = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "SKYSWEEP_DATA")}
    env |= {"SKYSWEEP_COMMAND": str(command), "PYTHONDONTWRITEBYTECODE": "1"}
    # Two tests convert heights above EGM96, whose grid the wheel does not bring.
    grids = folder / "proj"
    grids.mkdir()
    shutil.copy(EGM96, grids)
    env["PROJ_USER_WRITABLE_DIRECTORY"] = str(grids)
    said, took_s = run([python, "-m", "pytest", "-q", "-p", "no:cacheprovider", "crates/python/tests"], cwd=clone, env=env)
    versions, _ = run([python, "-c", "import numpy, rasterio; print(numpy.__version__, rasterio.__version__, rasterio.__gdal_version__)"])
    numpy, rasterio, gdal = versions.split()
    start = [run([python, "-c", "import skysweep"])[1] for _ in range(5)]
    return {
        "tests": said.strip().splitlines()[-1],
        "tests_s": took_s,
        "numpy": numpy,
        "rasterio": rasterio,
        "gdal_of_rasterio": gdal,
        "import_s": sorted(start)[2],
    }


def megabytes(path):
    return path.stat().st_size / 1e6


def built(commit, folder):
    """Builds command and wheel in a clean clone, and returns their times; those of an earlier call for the commit are kept."""
    clone, note = folder / "clone", folder / "built.json"
    commit = run(["git", "rev-parse", "--short", commit], cwd=ROOT)[0].strip()
    if note.exists() and (kept := json.loads(note.read_text()))["commit"] == commit:
        return kept
    folder.mkdir(parents=True)
    run(["git", "clone", "--quiet", "--no-hardlinks", ROOT, clone])
    run(["git", "checkout", "--quiet", "--detach", commit], cwd=clone)
    environment = {**os.environ, "CARGO_INCREMENTAL": "0"}
    _, static_s = run(["make", "static"], cwd=clone, env=environment)
    _, wheel_s = run(["make", "wheel"], cwd=clone, env=environment)
    times = {"commit": commit, "static_s": static_s, "wheel_s": wheel_s}
    note.write_text(json.dumps(times))
    return times


def main(commit, folder, results):
    folder = Path(folder).resolve()
    times = built(commit, folder)
    clone = folder / "clone"
    command = clone / "target" / "static" / "release" / "skysweep"
    (wheel,) = (clone / "out" / "wheels").glob("*.whl")
    with tempfile.TemporaryDirectory(prefix="trial-", dir=folder) as trial:
        found = {
            "commit": times["commit"],
            "machine": f"{platform.machine()}, {os.cpu_count()} cores",
            "python": platform.python_version(),
            "static": {"s": times["static_s"], "mb": megabytes(command), "libraries": sorted(libraries(command))},
            "wheel": {"s": times["wheel_s"], "mb": megabytes(wheel), "name": wheel.name},
            "chroot": without_gdal(Path(trial), command),
            "chroot_examples": python_without_gdal(Path(trial), wheel),
            "beside": beside_others(Path(trial), wheel, clone, command),
        }
    Path(results, "packages.json").write_text(json.dumps(found, indent=2) + "\n")
    Path(results, "packages.md").write_text(page(found))


def page(found):
    static, wheel, chroot, beside = found["static"], found["wheel"], found["chroot"], found["beside"]
    return f"""# The command and the wheel that need no GDAL and PROJ

Written by `benches/packages/packages.sh`: a clean clone of {found["commit"]}, {found["machine"]}, Python {found["python"]}. The wheel is
built after the command, whose GDAL and PROJ it takes.

| | size, MB | built in, min |
|---|---|---|
| `make static`: `skysweep` | {static["mb"]:.1f} | {static["s"] / 60:.0f} |
| `make wheel`: `{wheel["name"]}` | {wheel["mb"]:.1f} | {wheel["s"] / 60:.0f} |

The command needs these libraries of the system and no others: {", ".join(static["libraries"])}.

| tried | result |
|---|---|
| the command alone, below a root of {chroot["files"]} files: `selftest` | {chroot["selftest"].count("works")} of {len(chroot["selftest"])} checks work; grids of geoids are absent |
| there, a surface model of {len(VIEWS)} images of the sample town | {chroot["dsm_s"]:.1f} s, MAE {chroot["mae_m"]:.3f} m against the truth |
| the examples of Python below a root with Python, NumPy and the wheel | {len(found["chroot_examples"])} of {len(found["chroot_examples"])} run |
| `import rasterio, skysweep` and `import skysweep, rasterio` (rasterio {beside["rasterio"]} with GDAL {beside["gdal_of_rasterio"]}) | both read |
| all tests of the package with the wheel, notebooks and examples among them | {beside["tests"]} |
| `import skysweep`, median of five | {beside["import_s"]:.2f} s |
"""


if __name__ == "__main__":
    main(*sys.argv[1:])
