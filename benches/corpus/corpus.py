"""The frozen corpus: every command on the sample scenes and the shared data, with a hash of each file that it writes.

    python benches/corpus/corpus.py BINARY OUT.json [--against BEFORE.json] [--only TEXT]

A change of the structure must not change a result: run it before and after, and give the first result as --against. Files whose
hashes differ are listed, and the exit code is 1. Times, memory and versions are taken out of JSON first; pages, logs and journals are
not hashed, because they hold times in their text. Commands on data that are absent are left out with a line. Needs Python alone.
"""
import argparse
import hashlib
import json
import os
import re
import shlex
import sqlite3
import subprocess
import sys
import tempfile

REPOSITORY = os.path.abspath(f"{os.path.dirname(__file__)}/../..")
SHARED = os.path.abspath(f"{REPOSITORY}/../shared")
# $t: the sample town, $h: the hills, $d: dates of high-rises, $s: the shared data, $r: the tests' references.
PLACES = {"$t": f"{REPOSITORY}/data-samples/town", "$h": f"{REPOSITORY}/data-samples/hills",
          "$d": f"{REPOSITORY}/data-samples/high-rise-dates", "$s": f"{SHARED}/data", "$r": f"{REPOSITORY}/tests/reference"}
# Name and commands of each case, which share a folder.
CASES = {
    "dsm": ["dsm $t/view_1.tif $t/view_2.tif $t/view_3.tif -o out"],
    "dsm fast, chunks": ["dsm $t/view_1.tif $t/view_3.tif -o out --preset fast --chunk 200"],
    "dsm accurate": ["dsm $h/view_1.tif $h/view_2.tif -o out --preset accurate --gsd 2"],
    "dsm of dates, all filled": ["dsm $d/view_1.tif $d/view_2.tif $d/view_3.tif -o out --fill all"],
    "dsm with a reference": ["dsm $t/view_1.tif $t/view_2.tif -o out --preset fast --gsd 1 --reference-dem $t/truth/dsm.tif"],
    "dsm with a city model": ["dsm $t/view_1.tif $t/view_3.tif -o out --preset fast --prior $t/truth/buildings.city.json"],
    "plan, run, merge": ["plan $t/view_1.tif $t/view_3.tif -o out --preset fast --chunk 200", "run out", "merge out"],
    "products": ["dsm $t/view_1.tif $t/view_3.tif -o out --preset fast", "products out"],
    "dsm of JAX_068": ["dsm $s/stereo/jax_068/images/JAX_068_001_RGB.tif $s/stereo/jax_068/images/JAX_068_003_RGB.tif -o out"],
    "dsm of La Reunion": ["dsm $s/stereo/s2p_pair/img_01.tif $s/stereo/s2p_pair/img_02.tif -o out"],
    "eval": ["eval $t/truth/dtm.tif $t/truth/dsm.tif -o out --error-map error.tif --align xyz"],
    "eval of surfaces": ["eval $t/truth/buildings.city.json $t/truth/buildings.city.json -o out"],
    "simulate": ["simulate $t/scene.toml -o out --flight 2"],
    "ortho": ["ortho $t/view_1.tif --dsm $t/truth/dsm.tif -o ortho.tif"],
    "dtm": ["dtm $t/truth/dsm.tif -o out"],
    "classes": ["classes $t/truth/dsm.tif -o out"],
    "diff": ["diff $t/truth/dsm.tif $t/truth/dtm.tif -o out --sigma-m 0.1"],
    "buildings": ["buildings $t/view_1.tif -o buildings.tif"],
    "height maps": ["heightmap $t/truth/dsm.tif --center 5.4 43.53 --size 100 -o map.tif", "heightmap unproject map.tif -o points.ply",
                    "heightmap unproject map.tif -o points.las"],
    "tiles": ["tiles $t/truth/dsm.tif --center 5.4 43.53 --images $t/view_1.tif --size 60 -o out"],
    "ground views": ["groundview $t/truth/dsm.tif --center 5.4 43.53 --width 128 --crops 2 --crop-size 32 -o out"],
    "priors": ["priors $t/truth/buildings.city.json --cameras $t/cameras --points 2000 --geotiff -o out"],
    "priors of images": ["priors $t/truth/buildings.city.json --cameras $t/view_1.tif $t/view_3.tif -o out"],
    "splats": ["splats $t/truth/dsm.tif $t/view_1.tif -o splats.ply --render seen", "splats render splats.ply $t/view_2.tif -o again",
               "train $t/view_1.tif $t/view_3.tif --splats splats.ply --iterations 4 -o trained"],
    "mesh": ["priors $t/truth/buildings.city.json --cameras $t/cameras --points 2000 --geotiff -o d",
             "mesh d --depths d/raw_depth --voxel 4 -o mesh.ply"],
    "city models": [f"city convert $t/truth/buildings.city.json -o town.{kind}" for kind in ("obj", "ply", "glb", "geojson")],
    "align, split": ["align $r/align/model --gps $r/align/gps.csv -o out", "split $r/align/model -o split.json"],
    "register": ["register $t/view_3.tif --dsm $t/truth/dsm.tif --images $t/view_1.tif -o register.json"],
    "rpc": ["rpc convert $t/view_1.tif -o view.json", "rpc convert $t/view_1.tif -o view.rpb"],
}
TIMED = re.compile(r"(temporal|seconds|_ms|memory|version|started|finished|created|updated|datetime|stages|times|elapsed|pid|host|sha256|bytes)")
LEFT_OUT = (".html", ".log", ".jsonl", ".lock")


def without_times(value):
    if isinstance(value, dict):
        return {key: without_times(inner) for key, inner in value.items() if not TIMED.search(key)}
    return [without_times(inner) for inner in value] if isinstance(value, list) else value


def content(path, folder):
    with open(path, "rb") as file:
        data = file.read()
    # Names of the working folder and of this copy of the repository, whatever way leads there.
    for name in {folder, os.path.realpath(folder), REPOSITORY, os.path.relpath(REPOSITORY, os.path.realpath(os.path.dirname(path)))}:
        data = data.replace(name.encode(), b"#") if not path.endswith((".tif", ".png", ".npy")) else data
    if path.endswith((".json", "/status")):
        try:
            return json.dumps(without_times(json.loads(data)), sort_keys=True).encode()
        except ValueError:
            return data
    if path.endswith(".gpkg"):
        with sqlite3.connect(path) as base:
            return "\n".join(line for line in base.iterdump() if "gpkg_contents" not in line).encode()
    if path.endswith((".las", ".laz")):
        # The day on which the file was made.
        return data[:90] + data[94:]
    return data


def run(binary, commands):
    """The hash of each file below a working folder, and the exit codes."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for command in commands:
            words = shlex.split(command)
            words = [next((path + word[len(name):] for name, path in PLACES.items() if word.startswith(name)), word) for word in words]
            if missing := [word for word in words if word.startswith(SHARED) and not os.path.exists(word)]:
                print(f"left out: {missing[0]} is absent", flush=True)
                return None
            ended = subprocess.run([binary, *words, "-q"], cwd=folder, capture_output=True, text=True)
            found[f"{command} -> exit code"] = ended.returncode
            if ended.returncode not in (0, 1):
                print(f"{command}: {ended.stderr.strip()[-300:]}", flush=True)
        for root, _, names in os.walk(folder):
            for name in names:
                path = os.path.join(root, name)
                if not name.endswith(LEFT_OUT) and name != "used_config.toml":
                    found[os.path.relpath(path, folder)] = hashlib.sha256(content(path, folder)).hexdigest()
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("out")
    parser.add_argument("--against")
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    corpus = {}
    for name, commands in CASES.items():
        if given.only in name and (found := run(os.path.abspath(given.binary), commands)) is not None:
            corpus[name] = found
            print(f"{name}: {len(found)} files and exit codes", flush=True)
    with open(given.out, "w") as file:
        json.dump(corpus, file, indent=1, sort_keys=True)
        file.write("\n")
    if given.against:
        with open(given.against) as file:
            before = json.load(file)
        of = lambda all: {(case, name): value for case, files in all.items() for name, value in files.items() if case in corpus}
        now, then = of(corpus), of(before)
        changed = sorted(key for key in now.keys() | then.keys() if now.get(key) != then.get(key))
        for case, name in changed:
            print(f"differs: {case}: {name}")
        print(f"{len(changed)} of {len(now)} differ")
        sys.exit(1 if changed else 0)


if __name__ == "__main__":
    main()
