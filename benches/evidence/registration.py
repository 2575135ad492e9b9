"""Registration of held-out views to surfaces of two views, by a simulator that shares no code with skysweep.

    python benches/evidence/registration.py BINARY WORK [--seeds SEED ...] [--shared ../shared] [--out benches/results]

Ten places, two held-out views each: the surface is made from views 1 and 2, whose RPCs are exact, so that it lies where the truth lies.
Views 3 and 4 have planted shifts up to 15 pixels and a drift of up to 0.5 % of the line; suns and seasons differ as `random:SEED` of the
simulator draws them. The error of a view is the root mean square distance between where its registered RPC and the exact one see the
unhidden cells of the true surface. Then each surface is shown view 3 of the next place, which must be refused. JAX_068: surfaces of four
of the seven dates, with their bundle-adjusted RPCs; every date that a surface does not contain is registered with its raw RPC and compared
with its bundle-adjusted one at the surface's cells.

All seeds were stated before any of their places was looked at. The first round of the method was made on 8001, 8301 to 8310 and 8331 to
8340, so the places from 8351 on are the ones that tell how it does elsewhere. WORK keeps images and surfaces. Writes registration.json and
registration.md. Needs numpy, scipy, rasterio and pyproj.
"""
import argparse
import json
import pathlib
import subprocess

import numpy as np
import rasterio
from rasterio.rpc import RPC
from pyproj import Transformer

import two_dates
from pointing import corrected
from two_dates import scenes

IN_VIEW, SEEDS = range(8301, 8311), [*range(8301, 8311), *range(8351, 8361)]
SIDE, GSD_M, CELL_M, AROUND_M = 440, 0.5, 0.25, 150
SHIFT_PX, DRIFT = 15.0, 0.005
PLACED_PX, JAX_PX = 0.3, 0.7
JAX_DATES, JAX_SURFACES = 7, [(1, 2, 3, 4), (4, 5, 6, 7)]


def views_of(seed):
    """Angles of four views, two pairs that see the place from two sides, with planted shifts and drifts of the last two."""
    draw = np.random.default_rng([seed, 5])
    first, views = draw.uniform(0, 360), []
    for k, turn in enumerate([0, 180, 90, 240]):
        planted = k >= 2
        views.append({"off_nadir": float(draw.uniform(6, 20)), "azimuth": float((first + turn + draw.uniform(-30, 30)) % 360),
                      "shift_px": draw.uniform(-SHIFT_PX, SHIFT_PX, 2).tolist() if planted else [0.0, 0.0],
                      "drift": draw.uniform(-DRIFT, DRIFT, 2).tolist() if planted else [0.0, 0.0]})
    return views


def drifting(camera, shift, drift):
    """A camera whose lines drift: places move by the shift, and by the drift for each line from the middle."""
    wrong = scenes.Cam.__new__(scenes.Cam)
    wrong.__dict__.update(camera.__dict__)
    wrong.soff = (camera.soff[0] + shift[0], camera.soff[1] + shift[1])
    # The drift goes into the RPC by a fit.
    lon, lat = (np.linspace(-1, 1, 15) * s + o for s, o in zip(camera.sc[:2], camera.off[:2]))
    height = np.linspace(-1, 1, 15) * camera.sc[2] + camera.off[2]
    lon, lat, height = (a.ravel() for a in np.meshgrid(lon, lat, height))
    u, v = camera.project(lon, lat, height)
    away = v - (camera.H - 1) / 2
    targets = (u + shift[0] + drift[0] * away, v + shift[1] + drift[1] * away)
    rows = scenes.monomials((lat - camera.off[1]) / camera.sc[1], (lon - camera.off[0]) / camera.sc[0], (height - camera.off[2]) / camera.sc[2])
    for name, target, offset, scale in zip("sl", targets, wrong.soff, camera.ssc):
        r = (target - offset) / scale
        a = np.concatenate([rows, -r[:, None] * rows[:, 1:]], 1)
        w = np.linalg.solve(a.T @ a + 1e-9 * np.eye(39), a.T @ r)
        setattr(wrong, "n" + name, w[:20])
        setattr(wrong, "d" + name, np.concatenate([[1.0], w[20:]]))
    return wrong


def make(seed, folder):
    folder.mkdir(parents=True, exist_ok=True)
    place = scenes.random_scene(seed)
    suns = (place["suns"] * 4)[:4]
    extent = SIDE * GSD_M + AROUND_M
    n = int(extent / CELL_M)
    z, albedo = scenes.build(place, np.random.default_rng(seed), n, CELL_M)
    east, north = scenes.T_utm.transform(scenes.LON0, scenes.LAT0)
    east, north = round(east - extent / 2), round(north + extent / 2)
    low, high = float(z.min()), float(z.max())
    rng = np.random.default_rng([seed, 6])
    views = views_of(seed)
    for k, (view, sun) in enumerate(zip(views, suns), 1):
        camera = scenes.Cam(view["off_nadir"], view["azimuth"], GSD_M, SIDE, SIDE, low - 20, high + 20, roll=rng.uniform(-8, 8))
        u, v = camera.project(scenes.LON0, scenes.LAT0, (low + high) / 2)
        camera.soff = (camera.soff[0] + SIDE / 2 - .5 - u, camera.soff[1] + SIDE / 2 - .5 - v)
        grey = two_dates.season(albedo, place["_bid"], rng) if place.get("seasons") else albedo
        image = scenes.render(camera, z, grey, CELL_M, east, north, sun, rng, place)
        image = (image / image.max()) ** rng.uniform(.85, 1.2) * rng.uniform(.8, 1.2)
        counts = image * 2200
        counts = counts + rng.standard_normal(counts.shape) * (6 + np.sqrt(np.maximum(counts, 0)) * .25) * place.get("noise", 1.)
        given = camera if k <= 2 else drifting(camera, view["shift_px"], view["drift"])
        write(folder / f"view_{k}.tif", counts, given.rpc())
        if k > 2:
            write(folder / f"exact_{k}.tif", counts[:2, :2], camera.rpc())
    margin = int((extent - SIDE * GSD_M * .86) / 2 / CELL_M)
    inner = z[margin:n - margin, margin:n - margin]
    grid = rasterio.transform.from_origin(east + margin * CELL_M, north - margin * CELL_M, CELL_M, CELL_M)
    with rasterio.open(folder / "truth_dsm.tif", "w", driver="GTiff", width=inner.shape[1], height=inner.shape[0], count=1,
                       crs=scenes.EPSG, transform=grid, dtype="float32", compress="deflate") as file:
        file.write(inner, 1)
    (folder / "scene.json").write_text(json.dumps({"seed": seed, "suns": suns, "views": views}, indent=1))


def write(path, counts, rpc):
    with rasterio.open(path, "w", driver="GTiff", width=counts.shape[1], height=counts.shape[0], count=1, dtype="uint16",
                       compress="deflate") as file:
        file.write(np.clip(np.rint(counts), 1, 4095).astype(np.uint16), 1)
        file.rpcs = rpc


def project(rpc, lon, lat, height):
    lon, lat, height = (lon - rpc.long_off) / rpc.long_scale, (lat - rpc.lat_off) / rpc.lat_scale, (height - rpc.height_off) / rpc.height_scale
    rows = scenes.monomials(lat, lon, height)
    ratio = lambda top, below: rows @ np.array(top) / (rows @ np.array(below))
    return (ratio(rpc.samp_num_coeff, rpc.samp_den_coeff) * rpc.samp_scale + rpc.samp_off,
            ratio(rpc.line_num_coeff, rpc.line_den_coeff) * rpc.line_scale + rpc.line_off)


def rpc_of(path):
    with rasterio.open(path) as file:
        return file.rpcs


def surface_points(path, step):
    with rasterio.open(path) as file:
        heights = file.read(1)[::step, ::step]
        rows, columns = np.mgrid[0:file.height:step, 0:file.width:step]
        x, y = file.transform * (columns + .5, rows + .5)
        lon, lat = Transformer.from_crs(file.crs, 4326, always_xy=True).transform(x, y)
        good = np.isfinite(heights) & (heights > -1000)
        return lon[good], lat[good], heights[good].astype(float)


def surface(binary, images, out):
    if not (out / "report/report.json").exists():
        subprocess.run([binary, "dsm", *images, "-o", out, "--overwrite", "--progress", "none", "-q"], stderr=subprocess.DEVNULL)
    return (out / "report/report.json").exists()


def registered(binary, image, run, out):
    """The report of a registration, or the first line of the refusal."""
    done = subprocess.run([binary, "register", image, "--dsm", run, "-o", out, "--overwrite", "--progress", "none"],
                          capture_output=True, text=True)
    if done.returncode == 2 or not out.exists():
        return None, (done.stderr.strip().splitlines() or ["no words"])[0]
    return json.loads(out.read_text()), None


def errors_px(image, report, exact, points, size):
    seen = corrected(report["images"][0]["applied_correction"], np.stack(project(rpc_of(image), *points), -1)).T
    true = project(exact, *points)
    inside = (true[0] > 0) & (true[1] > 0) & (true[0] < size) & (true[1] < size)
    return np.stack([a[inside] - b[inside] for a, b in zip(seen, true)])


def judged(binary, work, seed, following):
    folder = work / str(seed)
    if not (folder / "scene.json").exists():
        make(seed, folder)
    if not (work / str(following) / "scene.json").exists():
        make(following, work / str(following))
    row = {"seed": seed, "views": []}
    if not surface(binary, [folder / f"view_{k}.tif" for k in (1, 2)], folder / "run"):
        return dict(row, refused_surface=True)
    points = surface_points(folder / "truth_dsm.tif", 16)
    for k, planted in zip((3, 4), views_of(seed)[2:]):
        report, refused = registered(binary, folder / f"view_{k}.tif", folder / "run", folder / f"registered_{k}.json")
        view = {"view": k, "shift_px": planted["shift_px"], "drift": planted["drift"], "refused": refused}
        if report:
            error = errors_px(folder / f"view_{k}.tif", report, rpc_of(folder / f"exact_{k}.tif"), points, SIDE)
            view.update(error_px=float(np.sqrt((error**2).sum(0).mean())), largest_px=float(np.hypot(*error).max()),
                        order=report.get("order"), tried=report["tried"], found=report["found"], agree=report["agree"])
        row["views"].append(view)
    report, refused = registered(binary, work / str(following) / "view_3.tif", folder / "run", folder / "registered_foreign.json")
    row["foreign"] = {"of": following, "refused": refused}
    if report:
        row["foreign"].update(found=report["found"], agree=report["agree"])
    return row


def bundle_rpc(path):
    """The bundle-adjusted RPC of a date, which counts coefficients as RPC00B does."""
    rpc = json.loads(path.read_text())["rpc"]
    named = {ours: rpc[theirs] for ours, theirs in [("height", "alt"), ("long", "lon"), ("lat", "lat"), ("line", "row"), ("samp", "col")]
             for ours, theirs in [(ours + "_off", theirs + "_offset"), (ours + "_scale", theirs + "_scale")]}
    polynomials = {f"{ours}_{part}_coeff": rpc[f"{theirs}_{part}"] for ours, theirs in [("line", "row"), ("samp", "col")]
                   for part in ("num", "den")}
    return RPC(err_bias=None, err_rand=None, **{k: float(v) for k, v in named.items()},
               **{k: [float(c) for c in v] for k, v in polynomials.items()})


def jacksonville(binary, work, shared):
    data, folder = shared / "data/stereo/jax_068", work / "jax_068"
    folder.mkdir(parents=True, exist_ok=True)
    name = lambda date: f"JAX_068_{date:03}_RGB"
    exact = {date: bundle_rpc(data / f"rpcs_ba/{name(date)}.json") for date in range(1, JAX_DATES + 1)}
    rows = []
    for dates in JAX_SURFACES:
        run = folder / ("run_" + "".join(map(str, dates)))
        for date in dates:
            if not (folder / f"{name(date)}.tif").exists():
                with rasterio.open(data / f"images/{name(date)}.tif") as image:
                    with rasterio.open(folder / f"{name(date)}.tif", "w", driver="GTiff", width=image.width, height=image.height,
                                       count=image.count, dtype=image.dtypes[0]) as out:
                        out.write(image.read())
                        out.rpcs = exact[date]
        surface(binary, [folder / f"{name(date)}.tif" for date in dates], run)
        points = surface_points(run / "dsm/dsm.tif", 8)
        for date in sorted(set(exact) - set(dates)):
            image = data / f"images/{name(date)}.tif"
            report, refused = registered(binary, image, run, folder / f"{run.name}_{date}.json")
            row = {"surface": list(dates), "date": date, "refused": refused}
            if report:
                error = errors_px(image, report, exact[date], points, 700)
                row.update(error_px=float(np.sqrt((error**2).sum(0).mean())), order=report["order"], tried=report["tried"],
                           found=report["found"], agree=report["agree"])
            rows.append(row)
    return rows


def written(out, places, jax):
    (out / "registration.json").write_text(json.dumps({"places": places, "jax_068": jax}, indent=1) + "\n")
    views = [(p["seed"], v) for p in places for v in p["views"]]
    placed = [seed for seed, v in views if v.get("error_px", np.inf) <= PLACED_PX]
    in_view = [[seed in IN_VIEW for seed in seeds].count(True) for seeds in (placed, [seed for seed, _ in views])]
    errors = [v["error_px"] for _, v in views if "error_px" in v]
    foreign = [p for p in places if "foreign" in p]
    lines = ["# Registration of views that a surface has not seen", "",
             "Written by `benches/evidence/registration.py`: surfaces of two views; shifts up to 15 px and drifts up to 0.5 % are planted.", "",
             f"- Held-out views: {len(views)}; placed within {PLACED_PX} px: {len(placed)}; refused: {len(views) - len(errors)}."]
    lines += [f"- Of these, {in_view[1]} are of places that were in view when the method was made; placed: {in_view[0]}."] if in_view[1] else []
    none = [str(p["seed"]) for p in places if p.get("refused_surface")]
    lines += [f"- Places of which two views give no surface: {', '.join(none)}."] if none else []
    if errors:
        lines.append(f"- Error of those registered: median {np.median(errors):.3f} px, largest {max(errors):.3f} px.")
    lines.append(f"- Views of another place: {len(foreign)}; refused: {sum(p['foreign']['refused'] is not None for p in foreign)}.")
    if jax:
        good = [r["error_px"] for r in jax if "error_px" in r]
        lines.append(f"- JAX_068: {len(jax)} dates that the surface does not contain; within {JAX_PX} px of the bundle-adjusted RPC: "
                     f"{sum(e <= JAX_PX for e in good)}.")
    lines += ["", "| place | view | error, px | order | points found | agree | planted shift, px | drift, % |", "|---|---|---|---|---|---|---|---|"]
    for seed, v in views:
        planted = f"{v['shift_px'][0]:+.1f}, {v['shift_px'][1]:+.1f} | {100 * v['drift'][0]:+.2f}, {100 * v['drift'][1]:+.2f}"
        if "error_px" in v:
            lines.append(f"| {seed} | {v['view']} | {v['error_px']:.3f} | {v['order']} | {v['found']} of {v['tried']} | {v['agree']} | {planted} |")
        else:
            lines.append(f"| {seed} | {v['view']} | refused | – | – | – | {planted} |")
    if jax:
        lines += ["", "| JAX_068, surface of dates | date | error, px | order | points found | agree |", "|---|---|---|---|---|---|"]
    for r in jax:
        own = f"{r['error_px']:.3f} | {r['order']} | {r['found']} of {r['tried']} | {r['agree']}" if "error_px" in r else "refused | – | – | –"
        lines.append(f"| {', '.join(map(str, r['surface']))} | {r['date']} | {own} |")
    (out / "registration.md").write_text("\n".join(lines) + "\n")
    return lines


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("binary")
    arguments.add_argument("work", type=pathlib.Path)
    arguments.add_argument("--seeds", type=int, nargs="*", default=SEEDS)
    arguments.add_argument("--shared", type=pathlib.Path, default=pathlib.Path("../shared"))
    arguments.add_argument("--out", type=pathlib.Path, default=pathlib.Path("benches/results"))
    given = arguments.parse_args()
    places = []
    for place, following in zip(given.seeds, given.seeds[1:] + given.seeds[:1]):
        places.append(judged(given.binary, given.work, place, following))
        # Results are kept after each place.
        written(given.out, places, [])
    print("\n".join(written(given.out, places, jacksonville(given.binary, given.work, given.shared))))


if __name__ == "__main__":
    main()
