"""The page of the comparison of terrain models. See compare.py."""
import statistics

import programs

NAMES = ["skysweep", "skysweep, heights only", *programs.SETTINGS]
# The programs that the count of wins is asked for; SMRF is a formula rebuilt here and stands beside.
PEERS = ["whitebox-workflows", "CSF", "bulldozer-dtm", "dsm2dtm"]
MEASURES = {
    "all_rmse_m": ("RMSE of the bare ground at all cells, under objects too, metres", 1),
    "ground_rmse_m": ("RMSE at ground cells, metres", 1),
    "ground_mae_m": ("Mean error at ground cells, metres", 1),
    "ground_found": ("Ground cells found, %", 100),
    "objects_kept": ("Building cells (ISPRS: object points) kept as ground, %", 100),
    "total_error": ("Total error of the ISPRS filter test, %", 100),
    "cpu_s": ("CPU seconds, with the start of the program", 1),
}
PROTOCOL = """# Terrain models of six programs

Made by `benches/peers/terrain/compare.py`.

**Input.** Every program gets the same raster of heights. `skysweep` also gets the layers `source` and `confidence` that lie beside a
surface made from images, and `skysweep, heights only` does not. CSF, SMRF and skysweep get voids as voids. For whitebox-workflows,
bulldozer-dtm and dsm2dtm the voids are interpolated linearly before, from the nearest cell at the border. Gaps that `skysweep dsm` filled
are heights to all but `skysweep`.

**Settings**, one for all places:

{settings}

**Scenes** `random:SEED` are places drawn by `../shared/tools/scenes.py` with images of {size} pixels on a side (its own 640 take too long
for one afternoon on two cores). The seeds {first} to {last} were stated before any was made, and none was drawn again. Their surfaces come
from `skysweep dsm --preset balanced`, as that of the seven images of JAX_068 does. The seeds 9801 to 9803, at 640 pixels, had been blind
places of `benches/evidence/places.py`, which judges surfaces and no terrain.

**Judging.** A surface from images is shifted onto the truth by whole cells of half a metre and by the median of its heights; the same shift
serves all programs. *Ground cells* of a scene are cells of the truth that show the ground and that the surface observed; of LiDAR, and of
JAX_068 from images, those of class 2, filled ones too. *All cells* are those between the outermost heights of a row. A ground cell is
found, and a building cell is kept, when the ground of the program lies within half a metre of the surface. The ISPRS filter test follows
`../shared/tools/isprs.py`: rasters of the highest points, a point is ground within half a metre. Where CSF and SMRF find points, their
ground is interpolated linearly between them.
"""


def cell(entry, key, scale):
    if not entry:
        return "–"
    value = entry.get(key)
    return "failed" if "failed" in entry and key != "cpu_s" else "–" if value is None else f"{scale * value:.2f}"


def grid(report, key, scale):
    lines = ["| place | " + " | ".join(NAMES) + " |", "|---" * (len(NAMES) + 1) + "|"]
    for place, results in report["places"].items():
        if any(key in entry for entry in results.values()):
            lines.append(f"| {place} | " + " | ".join(cell(results.get(name), key, scale) for name in NAMES) + " |")
    return lines


def values(report, prefix, name, key):
    return [entry[name][key] for place, entry in report["places"].items() if place.startswith(prefix) and key in entry.get(name, {})]


def wins(report, prefix, key):
    """Places at which skysweep is at least as good as the best of four peers, and the number of places."""
    places = [entry for place, entry in report["places"].items() if place.startswith(prefix)]
    best = [min((entry[name][key] for name in PEERS if key in entry.get(name, {})), default=float("inf")) for entry in places]
    return sum(entry["skysweep"].get(key, float("inf")) <= least for entry, least in zip(places, best)), len(places)


def summary(report):
    lines = ["## In short", "", "| measure | " + " | ".join(NAMES) + " |", "|---" * (len(NAMES) + 1) + "|"]
    rows = [("scenes, RMSE at all cells, median, m", "random", "all_rmse_m", statistics.median, 1),
            ("scenes, RMSE at all cells, worst, m", "random", "all_rmse_m", max, 1),
            ("scenes, RMSE at ground cells, median, m", "random", "ground_rmse_m", statistics.median, 1),
            ("scenes, RMSE at ground cells, worst, m", "random", "ground_rmse_m", max, 1),
            ("scenes, building cells kept, median, %", "random", "objects_kept", statistics.median, 100),
            ("ISPRS, total error, mean, %", "ISPRS", "total_error", statistics.mean, 100),
            ("ISPRS, total error, worst, %", "ISPRS", "total_error", max, 100)]
    for title, prefix, key, of, scale in rows:
        found = [values(report, prefix, name, key) for name in NAMES]
        lines.append(f"| {title} | " + " | ".join(f"{scale * of(each):.2f}" if each else "–" for each in found) + " |")
    counted = [("scenes, RMSE at all cells", "random", "all_rmse_m"),
               ("scenes, RMSE at ground cells", "random", "ground_rmse_m"),
               ("ISPRS, total error", "ISPRS", "total_error")]
    for title, prefix, key in counted:
        won, count = wins(report, prefix, key)
        lines += ["", f"{title}: skysweep is at least as good as the best of {', '.join(PEERS)} at {won} of {count} places."]
    return lines


def drawn(report):
    """What kind of place each seed drew. Forests have 60 trees and more a hectare, halls stand on blocks of 60 m and more."""
    places = report["drawn"].items()
    having = lambda measure: [seed for seed, kind in places if kind[measure] >= 60]
    names = {"forests": having("trees"), "halls": having("block")}
    said = [f"{name} (`random:` {', '.join(seeds)})" if seeds else f"no {name}" for name, seeds in names.items()]
    lines = [f"Among the scenes are {' and '.join(said)}.", ""]
    lines += ["| scene | block, m | built, % | trees per hectare | slope, degrees | texture | views |", "|---" * 7 + "|"]
    for seed, kind in places:
        cells = [kind["block"], round(100 * kind["density"]), kind["trees"], kind["slope"], round(kind["texture"], 2), len(kind["views"])]
        lines.append(f"| random:{seed} | " + " | ".join(f"{value:g}" for value in cells) + " |")
    return lines


def page(report):
    settings = "\n".join(f"- {name}: {what}" for name, what in {"skysweep dtm": "its defaults", **programs.SETTINGS}.items())
    head = PROTOCOL.format(settings=settings, size=report["size_px"], first=min(report["seeds"]), last=max(report["seeds"]))
    lines = [head, *drawn(report), "", *summary(report)]
    for key, (title, scale) in MEASURES.items():
        lines += ["", f"## {title}", "", *grid(report, key, scale)]
    return "\n".join(lines) + "\n"
