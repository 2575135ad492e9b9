"""Files of splats: those of skysweep through splat-transform, and the other way round. See splat_transform.sh."""

import json
import math
import pathlib
import subprocess
import sys

import numpy as np

binary, source, folder, results = [pathlib.Path(argument).resolve() for argument in sys.argv[1:5]]
program = folder / "node_modules/.bin/splat-transform"
package = json.loads((folder / "node_modules/@playcanvas/splat-transform/package.json").read_text())


def ours(start, end, *options):
    subprocess.run([binary, "splats", "convert", "-q", "--overwrite", *options, start, end], check=True)


def theirs(start, end, *options):
    done = subprocess.run([program, "-w", "-g", "cpu", *options, start, end], capture_output=True, text=True)
    lines = [line.strip() for line in (done.stderr + done.stdout).splitlines()]
    told = [line for line in lines if "rror" in line or "nsupported" in line] or lines[-1:]
    return None if done.returncode == 0 else told[0].replace(f"{folder}/", "")


def read(path):
    """The properties of a PLY of floats, by name."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + 11
    lines = data[:end].decode().splitlines()
    names = [line.split()[-1] for line in lines if line.startswith("property float ")]
    count = int(next(line.split()[-1] for line in lines if line.startswith("element vertex")))
    rows = np.frombuffer(data[end:], "<f4", count * len(names)).reshape(count, len(names))
    return dict(zip(names, rows.T.astype(float)))


def turned_back(table):
    """splat-transform turns splats by 180 degrees about z for glTF, to its upward y."""
    w, x, y, z = [table[f"rot_{i}"] for i in range(4)]
    return table | {"x": -table["x"], "y": -table["y"], "rot_0": -z, "rot_1": -y, "rot_2": x, "rot_3": w}


def differences(a, b):
    """Root mean squares: metres, degrees of the axes, logarithms of the first two scales, colours, opacities, harmonics.

    splat-transform may bring splats into another order: each is compared with the nearest one.
    """
    places = [np.stack([table[c] for c in "xyz"], 1) for table in (a, b)]
    order = np.arange(len(places[0]))
    if len(places[0]) != len(places[1]):
        return None
    if np.median(np.linalg.norm(places[0] - places[1], axis=1)) > 0.1:
        from scipy.spatial import cKDTree
        order = cKDTree(places[1]).query(places[0])[1]
    b = {name: values[order] for name, values in b.items()}
    rms = lambda values: float(np.sqrt(np.mean(np.square(values))))
    apart = lambda names: rms(np.concatenate([a[name] - b[name] for name in names]))
    turned = [np.stack([table[f"rot_{i}"] for i in range(4)], 1) for table in (a, b)]
    turned = [q / np.linalg.norm(q, axis=1, keepdims=True) for q in turned]
    cosines = np.clip(np.abs((turned[0] * turned[1]).sum(1)), 0, 1)
    opacity = [1 / (1 + np.exp(-table["opacity"])) for table in (a, b)]
    higher = sorted(name for name in a if name.startswith("f_rest") and name in b)
    return {
        "position": apart("xyz"),
        "degrees": rms(np.degrees(2 * np.arccos(cosines))),
        "log_scale": apart(["scale_0", "scale_1"]),
        "colour": 0.28209479 * apart(["f_dc_0", "f_dc_1", "f_dc_2"]),
        "opacity": rms(opacity[0] - opacity[1]),
        "harmonics": apart(higher) if higher else None,
    }


base = folder / "base.ply"
ours(source, base, "--form", "3d")
truth, rows = read(base), []


def row(what, path, error, back):
    table = read(back) if error is None else None
    if table and what.startswith("splat-transform writes theirs.glb"):
        table = turned_back(table)
    found = differences(truth, table) if table else None
    rows.append({"what": what, "bytes": path.stat().st_size if path.is_file() else None, "error": error, "difference": found})


for name, options in [("2dgs.ply", ["--form", "2d"]), ("degree3.ply", ["--form", "3d", "--sh-degree", "3"]), ("ours.spz", []), ("ours.sog", [])]:
    made, back = folder / name, folder / f"{name}.read.ply"
    ours(source, made, *options)
    row(f"skysweep writes {name}, splat-transform reads it", made, theirs(made, back), back)
for name, options in [("theirs.spz", []), ("theirs3.spz", ["--spz-version", "3"]), ("theirs.sog", []), ("theirs.glb", [])]:
    made, back = folder / name, folder / f"{name}.read.ply"
    error = theirs(base, made, *options)
    if error is None:
        ours(made, back, "--form", "3d")
    row(f"splat-transform writes {name}, skysweep reads it", made, error, back)
glb, back = folder / "ours.glb", folder / "ours.glb.ply"
ours(source, glb)
ours(glb, back, "--form", "3d")
row("skysweep writes and reads ours.glb", glb, None, back)
check = "const v=require('gltf-validator');v.validateBytes(new Uint8Array(require('fs').readFileSync(process.argv[1])))" \
    ".then(r=>console.log(JSON.stringify(r.issues)))"
issues = json.loads(subprocess.run(["node", "-e", check, glb], check=True, capture_output=True, text=True).stdout)
messages = sorted({message["code"] for message in issues["messages"]})

out = {"program": f"splat-transform {package['version']}", "splats": len(truth["x"]), "rows": rows,
       "gltf_validator": {"errors": issues["numErrors"], "warnings": issues["numWarnings"], "codes": messages}}
(results / "splat_transform.json").write_text(json.dumps(out, indent=1) + "\n")


def text(value):
    return "" if value is None else f"{value:.2g}" if value and math.isfinite(value) else "0"


lines = [
    "# Files of splats in another program", "",
    f"Written by `benches/peers/splat_transform.sh`: {out['splats']:,} splats against {out['program']}. Root mean square differences",
    "from the splats as 32-bit floats. glTF is only written by that program, not read.", "",
    "| file | MB | position, m | axes, ° | ln scale | colour | opacity | harmonics |", "|---|--:|--:|--:|--:|--:|--:|--:|",
]
for entry in rows:
    if entry["error"]:
        lines.append(f"| {entry['what']} | refused: {entry['error']} | | | | | | |")
        continue
    values = " | ".join(text(value) for value in entry["difference"].values()) if entry["difference"] else "other number of splats" + " |" * 5
    lines.append(f"| {entry['what']} | {entry['bytes'] / 1e6:.2f} | {values} |")
g = out["gltf_validator"]
lines += ["", "SPZ has no colours below -0.44 and above 1.44 in either program, which is what its colours differ by.",
          "The two codes of the validator are about the extension, which that version does not know.", "", f"Khronos' glTF validator on `ours.glb`: {g['errors']} errors, {g['warnings']} warnings ({', '.join(messages) or 'no messages'})."]
(results / "splat_transform.md").write_text("\n".join(lines) + "\n")
sys.stdout.write("\n".join(lines) + "\n")
