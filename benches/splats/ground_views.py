#!/usr/bin/env python3
"""Splats seen from the street, against ray casting on the exact scene.

For each seed, `skysweep simulate` makes a town with exact RPCs, and `skysweep groundview` places cameras 1.85 m above
the street, with two opposite headings each. The splats of the exact surface model and of one made from the images are rendered
through them, without walls and with them. `skysweep simulate --cameras` tells what the cameras see exactly: depth, and
whether it is ground, a roof, a wall, a tree or sky.

    python3 benches/splats/ground_views.py target/release/skysweep [--seeds 21 22] [--positions 50] [--work DIR]

Needs numpy. Writes benches/results/ground_views.json and ground_views.md, and with --figures the pictures of the guide.
"""
import argparse
import json
import math
import pathlib
import random
import struct
import subprocess
import tempfile
import zlib

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
RESULTS, FIGURES = ROOT / "benches/results", ROOT / "docs/figures"
SIZE_M, GSD_M = 240.0, 0.5
CROPS, PIXELS, FIELD_DEG, CAMERA_M = 2, 192, 90.0, 1.85
# Cameras stand at least so far inside of the area.
INSIDE_M = 40.0
# Pixels that show something beyond the surface model, or nearer to its border, do not count.
BORDER_M = 2.0
SKY, GROUND, ROOF, WALL, TREE, BEYOND = range(6)
SOURCES = {"exact": "exact surface model", "images": "surface model from the images"}
CLEAR_DEG = 1.0
COUNT = 50


def run(*words):
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL)


def read_png(path):
    """Rows of an 8-bit PNG without palette or interlace: height × width × channels."""
    data, at, parts = path.read_bytes(), 8, []
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour, _, _, interlace = struct.unpack(">IIBBBBB", body)
            assert depth == 8 and interlace == 0, path
            channels = {0: 1, 2: 3, 4: 2, 6: 4}[colour]
        elif kind == b"IDAT":
            parts.append(body)
        at += 12 + length
    raw = np.frombuffer(zlib.decompress(b"".join(parts)), np.uint8).reshape(height, 1 + width * channels)
    rows = np.zeros((height + 1, width, channels), np.uint8)
    for row in range(height):
        line, above = raw[row, 1:].reshape(width, channels), rows[row]
        rows[row + 1] = unfiltered(raw[row, 0], line, above)
    return rows[1:]


def unfiltered(kind, line, above):
    if kind == 0:
        return line
    if kind == 1:
        return np.cumsum(line, axis=0, dtype=np.uint8)
    if kind == 2:
        return line + above
    out = np.zeros_like(line)
    for channel in range(line.shape[1]):
        left = corner = 0
        row = []
        for value, up in zip(line[:, channel].tolist(), above[:, channel].tolist()):
            if kind == 3:
                guess = (left + up) // 2
            else:
                p = left + up - corner
                a, b, c = abs(p - left), abs(p - up), abs(p - corner)
                guess = left if a <= b and a <= c else up if b <= c else corner
            left, corner = (value + guess) & 255, up
            row.append(left)
        out[:, channel] = row
    return out


def write_png(path, picture):
    height, width, channels = picture.shape
    raw = np.zeros((height, 1 + width * channels), np.uint8)
    raw[:, 1:] = picture.reshape(height, -1)
    # Differences to the row above compress better.
    raw[1:, 1:] -= picture.reshape(height, -1)[:-1]
    raw[1:, 0] = 2
    chunk = lambda kind, body: struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    head = struct.pack(">IIBBBBB", width, height, 8, {1: 0, 3: 2}[channels], 0, 0, 0)
    body = zlib.compress(raw.tobytes(), 9)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b""))


def positions(record, seed, count):
    """Longitude, latitude and heading of cameras on the middle lines of the streets."""
    draw, streets = random.Random(seed), record["config"]["buildings"]
    spacing, turn = streets["street_spacing_m"], math.radians(streets["turn_deg"])
    half, lat, lon = SIZE_M / 2 - INSIDE_M, record["config"]["lat_deg"], record["config"]["lon_deg"]
    zone = 6 * math.floor(lon / 6) + 3
    convergence, radius = math.radians(lon - zone) * math.sin(math.radians(lat)), 6378137.0
    found = []
    while len(found) < count:
        lines = math.floor(half / spacing)
        across, along = spacing * draw.randint(-lines, lines), draw.uniform(-half, half)
        u, v = (across, along) if draw.random() < 0.5 else (along, across)
        x, y = math.cos(turn) * u - math.sin(turn) * v, math.sin(turn) * u + math.cos(turn) * v
        if max(abs(x), abs(y)) > half:
            continue
        # The map is turned against true north.
        east = math.cos(convergence) * x + math.sin(convergence) * y
        north = math.cos(convergence) * y - math.sin(convergence) * x
        at = [lon + math.degrees(east / (radius * math.cos(math.radians(lat)))), lat + math.degrees(north / radius)]
        found.append((*at, draw.uniform(0.0, 360.0)))
    return found


def scene(program, work, seed, count):
    """Makes town, cameras, what they see exactly, and the surface model from the images."""
    work.mkdir(parents=True, exist_ok=True)
    town, views = work / "town", work / "views"
    (work / "town.toml").write_text(
        f"seed = {seed}\nsize_m = {SIZE_M}\ngsd_m = {GSD_M}\n[acquisition]\npointing_error_px = [0.0, 0.0]\n")
    quiet = ["--overwrite", "--progress", "none", "-q"]
    if not (town / "scene.json").exists():
        run(program, "simulate", work / "town.toml", "-o", town, *quiet)
    if not (views / "report.json").exists():
        record = json.loads((town / "scene.json").read_text())
        rows = [f"{k:02},{lon:.9f},{lat:.9f},{heading:.3f}"
                for k, (lon, lat, heading) in enumerate(positions(record, seed, count))]
        (work / "positions.csv").write_text("\n".join(["id,lon,lat,heading", *rows]) + "\n")
        run(program, "groundview", town / "truth/dtm.tif", "--positions", work / "positions.csv", "--ground-offset",
            CAMERA_M, "--crops", CROPS, "--crop-size", PIXELS, "--fov", FIELD_DEG, "--width", 64, "--points", 0, "-o", views,
            *quiet)
        run(program, "simulate", work / "town.toml", "-o", town, "--cameras", views / "sparse/0", *quiet)
    if not (work / "run/report/report.json").exists():
        run(program, "dsm", *sorted(town.glob("view_?.tif")), "-o", work / "run", *quiet)
    return town, views


class Sums:
    """Samples of all views of one variant."""

    def __init__(self):
        self.depth = {"all": [], "ground": [], "on_walls": [], "roofs": [], "trees": []}
        self.missing, self.counts = {name: 0 for name in self.depth}, {name: 0 for name in self.depth}
        self.sky, self.clear_sky = [], []

    def add(self, part, depth, found, alpha, inside):
        of = {"ground": part == GROUND, "on_walls": part == WALL, "roofs": part == ROOF, "trees": part == TREE}
        of["all"] = of["ground"] | of["on_walls"] | of["roofs"]
        for name, counts in of.items():
            counts = counts & inside
            self.counts[name] += int(counts.sum())
            self.missing[name] += int((counts & ~np.isfinite(found)).sum())
            error = (found - depth)[counts & np.isfinite(found)]
            self.depth[name].append(error.astype(np.float32))
        sky = part == SKY
        self.sky.append(alpha[sky])
        self.clear_sky.append(alpha[sky & ~near(~sky, CLEAR_DEG)])

    def result(self):
        row = {}
        for name, parts in self.depth.items():
            errors = np.abs(np.concatenate(parts))
            row[name] = {
                "pixels": self.counts[name], "missing_share": self.missing[name] / max(self.counts[name], 1),
                "median_m": float(np.median(errors)), "p90_m": float(np.quantile(errors, 0.9)),
                "signed_median_m": float(np.median(np.concatenate(parts)))}
        for name, parts in {"sky": self.sky, "clear_sky": self.clear_sky}.items():
            alpha = np.concatenate(parts)
            row[name] = {"pixels": int(alpha.size), "max": float(alpha.max()), "p99": float(np.quantile(alpha, 0.99)),
                         "p999": float(np.quantile(alpha, 0.999)), "above_0.05": float((alpha > 0.05).mean())}
        return row


def near(mask, degrees):
    """Pixels within an angle of a mask, as a square."""
    reach = math.ceil(degrees / FIELD_DEG * PIXELS)
    for axis in (0, 1):
        grown = mask.copy()
        for step in range(1, reach + 1):
            grown |= np.roll(mask, step, axis) | np.roll(mask, -step, axis)
        mask = grown
    return mask


def cameras(model):
    """Name, rotation (rows: right, down, forward) and centre of each camera of a COLMAP model, on the map."""
    data = (model / "images.bin").read_bytes()
    origin = np.array(json.loads((model / "origin.json").read_text())["origin"])
    count, at, found = struct.unpack_from("<Q", data)[0], 8, []
    for _ in range(count):
        _, w, x, y, z, *shift, _ = struct.unpack_from("<I7dI", data, at)
        at += struct.calcsize("<I7dI")
        end = data.index(b"\0", at)
        name, at = data[at:end].decode(), end + 1
        at += 8 + 24 * struct.unpack_from("<Q", data, at)[0]
        turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                         [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                         [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
        found.append((pathlib.Path(name).stem, turn, origin - turn.T @ np.array(shift)))
    return found


def within(depth, turn, centre, middle):
    """Pixels whose exact place is on the surface model, away from its border."""
    focal = 0.5 * PIXELS / math.tan(math.radians(FIELD_DEG / 2))
    u = (np.arange(PIXELS) - 0.5 * (PIXELS - 1)) / focal
    rays = np.stack([*np.meshgrid(u, u), np.ones((PIXELS, PIXELS))], -1) @ turn
    places = centre[:2] + depth[..., None] * rays[..., :2]
    return np.nan_to_num(np.abs(places - middle), nan=np.inf).max(-1) < SIZE_M / 2 - BORDER_M


def measure(program, work, seed, count):
    town, views = scene(program, work, seed, count)
    record = json.loads((town / "scene.json").read_text())
    rows, quiet = [], ["--overwrite", "--progress", "none", "-q"]
    for source, surface in {"exact": town / "truth/dsm.tif", "images": work / "run/dsm/dsm.tif"}.items():
        for walls in (False, True):
            name = f"{source}_{'after' if walls else 'before'}"
            ply, seen = work / f"{name}.ply", work / f"seen_{name}"
            corrections = ["--corrections", "none"] if source == "exact" else []
            run(program, "splats", surface, *sorted(town.glob("view_?.tif")), "-o", ply, "--report", work / f"{name}.json",
                *corrections, *([] if walls else ["--no-walls"]), *quiet)
            run(program, "splats", "render", ply, "--cameras", views / "sparse/0", "-o", seen, *quiet)
            sums = Sums()
            for view, turn, centre in cameras(views / "sparse/0"):
                depth = np.load(town / f"truth/cameras/depth/{view}.npy")
                part = read_png(town / f"truth/cameras/part/{view}.png")[..., 0]
                found = np.load(seen / f"depth/{view}.npy")
                alpha = read_png(seen / f"alpha/{view}.png")[..., 0] / 255.0
                sums.add(part, depth, found, alpha, within(depth, turn, centre, np.array(record["origin_m"])))
            report = json.loads((work / f"{name}.json").read_text())
            counts = {key: report[key] for key in ("splats", "walls", "walls_seen", "walls_area_m2", "cells")}
            images = [{key: image[key] for key in ("psnr_db", "ssim")} for image in report["views"]]
            rows.append({"seed": seed, "source": source, "walls": walls, **counts, "images": images,
                         "mean_height": report["mean_height"], "median_height": report["median_height"], **sums.result()})
            print(line(rows[-1]), flush=True)
    return rows


def line(row):
    of, percent = row["all"], lambda share: f"{100 * share:.2f}"
    psnr = sum(image["psnr_db"] for image in row["images"]) / len(row["images"])
    ssim = sum(image["ssim"] for image in row["images"]) / len(row["images"])
    return (f"| {row['seed']} | {SOURCES[row['source']]} | {'with' if row['walls'] else 'without'} | {row['splats']} "
            f"({row['walls']}) | {of['median_m']:.3f}, {of['p90_m']:.2f} | {row['on_walls']['median_m']:.3f}, "
            f"{row['on_walls']['p90_m']:.2f} | {percent(of['missing_share'])} | {percent(row['on_walls']['missing_share'])} "
            f"| {row['clear_sky']['p999']:.3f}, {row['clear_sky']['max']:.3f} | {percent(row['sky']['above_0.05'])} "
            f"| {psnr:.2f} dB, {ssim:.3f} |")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[21, 22])
    parser.add_argument("--positions", type=int, default=COUNT)
    parser.add_argument("--work", type=pathlib.Path)
    parser.add_argument("--print", action="store_true", help="write no results")
    parser.add_argument("--figures", nargs="+", metavar="VIEW", help="views of the first seed for the guide")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        work, rows = given.work or pathlib.Path(temporary), []
        for seed in given.seeds:
            rows += measure(given.program.resolve(), work / str(seed), seed, given.positions)
            if not given.print:
                (RESULTS / "ground_views.json").write_text(json.dumps(rows, indent=1) + "\n")
                (RESULTS / "ground_views.md").write_text("\n".join([*HEAD, *map(line, rows)]) + "\n")
        if given.figures:
            figure(work / str(given.seeds[0]), given.figures)


def figure(work, views):
    """Truth, before and after of some views, side by side: of the exact surface model and of the one from images."""
    grey = lambda view: np.repeat(read_png(work / f"town/truth/cameras/picture/{view}.png"), 3, -1)
    for source in SOURCES:
        colour = lambda view, when: read_png(work / f"seen_{source}_{when}/colour/{view}.png")
        rows = [np.concatenate([grey(view), colour(view, "before"), colour(view, "after")], 1) for view in views]
        write_png(FIGURES / f"ground_views_{source}.png", np.concatenate(rows, 0))


HEAD = f"""# Splats seen from the street

Written by `benches/splats/ground_views.py`: simulated towns of {SIZE_M:.0f} m at {GSD_M} m with exact RPCs and three images,
{COUNT} positions {CAMERA_M} m above the middle of the streets with {CROPS} headings each, {FIELD_DEG:.0f}° and {PIXELS} × {PIXELS} pixels. The
constants were chosen on the town of seed 1. Depths are held against rays through the exact scene, without vehicles (the images show some).
Counted are pixels that show the ground, a roof or a wall of a building at most {BORDER_M:.0f} m from the border of the surface model
inside; pixels that show a tree are in the JSON file. A pixel is missing where less than half of it is covered. The sky is
clear where nothing stands within {CLEAR_DEG:.0f}° of a pixel; its opacity is given as the 99.9th percentile and the largest of all
pixels. PSNR and SSIM are means over the satellite images, of pixels that show cells of the surface.

| seed | splats of the | walls | splats (on walls) | depth error: median, 90 %, m | on walls, m | missing, % | walls missing, % | opacity of the clear sky | sky above 0.05, % | images |
|--:|---|---|---|---|---|--:|--:|---|--:|---|""".split("\n")


if __name__ == "__main__":
    main()
