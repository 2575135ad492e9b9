"""Writes benches/results/peers.json from the shared data: what S2P and CARS made of the same images.

Called by peers.sh from the project's root. The shared data lie in ../shared (or where SKYSWEEP_DATA names their data folder).
Two sources:

* `entries` and `cpu_s` are read from the tables of data/README.md, where the people who ran S2P and CARS wrote them down.
* `surfaces` are computed here from the surface models in data/stereo/peers, by the independent judge tools/evaluate.py: how far
  CARS differs from S2P on scenes without a measured truth.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

DATA = Path(os.environ.get("SKYSWEEP_DATA", "../shared/data"))
JUDGE = DATA.parent / "tools/evaluate.py"
RESULTS = Path("benches/results/peers.json")
SURFACES = {
    "s2p_pair": ("cars_pair_dem_0.5m.tif", "s2p_pair_default_0.5m.tif"),
    "s2p_triplet": ("cars_triplet_0.5m.tif", "s2p_triplet_default_0.5m.tif"),
    "phr_gizeh": ("cars_gizeh_0.5m.tif", "s2p_gizeh_0.5m.tif"),
}


def views(name):
    """The numbers of the views that a row of the table names."""
    if "views 001 to 007" in name:
        return list(range(1, 8))
    return [int(number) for number in re.findall(r"\b0\d\d\b", name)]


def seconds(cell):
    """User seconds and what must be known of them; the table gives S2P's pairs one range in the first of their rows."""
    found = re.findall(r"\d+", cell)
    if not found:
        return None, ""
    note = f"{found[0]} to {found[1]} s a pair" if len(found) > 1 else "about" if "~" in cell else ""
    return int(found[0]), note


def entries(text):
    table = text.split("Peers on JAX_068", 1)[1].split("\nCPU elsewhere", 1)[0]
    rows = [line.strip("| ").split("|") for line in table.splitlines() if line.startswith("|")][2:]
    found = []
    pair = (None, "")
    for row in rows:
        name, *cells = [cell.strip() for cell in row] + [""]
        mae, rmse, nmad, covered, right, _ = map(float, cells[:6])
        filled = name.startswith("same, holes filled")
        if filled:
            before = found[-1]
            tool, given, shown = before["tool"], before["input"] + ", holes filled", before["views"]
            cpu, note = None, ""
        else:
            tool, given = re.match(r"(S2P|CARS),? (.*)", name).groups()
            shown = views(given)
            given = f"pair {given}" if len(shown) == 2 else given
            cpu, note = seconds(cells[6])
            if tool == "S2P" and len(shown) == 2:
                pair = (cpu, note) if cpu else pair
                cpu, note = pair
        entry = {"tool": tool, "scene": "jax_068", "input": given, "views": shown, "filled": filled, "cpu_s": cpu}
        if note:
            entry["cpu_note"] = note
        entry |= {"mae": mae, "rmse": rmse, "nmad": nmad}
        entry |= {"valid_ratio": round(covered / 100, 4), "completeness_1": round(right / 100, 4)}
        found.append(entry)
    return found


def cpu_elsewhere(text):
    line = next(line for line in text.splitlines() if line.startswith("CPU elsewhere"))
    pattern = r"`(\w+)` S2P (\d+) s, CARS (\d+) s"
    return {scene: {"S2P": int(s2p), "CARS": int(cars)} for scene, s2p, cars in re.findall(pattern, line)}


def surface(cars, s2p):
    folder = DATA / "stereo/peers"
    command = [sys.executable, JUDGE, folder / cars, folder / s2p, "--align", "xyz", "--json"]
    told = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    kept = ["coverage", "mae", "rmse", "median", "nmad", "c1"]
    return {"test": cars, "reference": s2p} | {name: told["all"][name] for name in kept}


def main():
    text = (DATA / "README.md").read_text()
    result = {
        "made_by": "benches/peers/peers.sh",
        "source": "`entries` and `cpu_s`: the tables of ../shared/data/README.md (S2P and CARS 1.3.0 on two cores; JAX_068 against "
        "the LiDAR surface at 0.5 m, aligned by an xy translation of least NMAD and the median of z, shares over all 262,144 "
        "reference cells). The table gives one range of user CPU for S2P's pairs: the least is used, in S2P's favour. "
        "`surfaces`: ../shared/tools/evaluate.py, CARS against S2P, median of z and an xy translation taken out.",
        "entries": entries(text),
        "cpu_s": cpu_elsewhere(text),
        "surfaces": {scene: surface(*pair) for scene, pair in SURFACES.items()},
    }
    RESULTS.write_text(json.dumps(result, indent=1) + "\n")


main()
