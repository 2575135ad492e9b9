#!/usr/bin/env python3
"""Lays simulated flights over their maps by hand, on the page of `skysweep align --page` in headless Chromium.

    benches/peers/align_page.py [--skysweep PROGRAM] [--work FOLDER] [--chromium PROGRAM] [--seeds N ...] [--figures]
                                [--local-page]

A similarity of the seed (any rotation, scale from 0.02 to 5) is planted into the COLMAP model of a simulated flight: it lies
in a frame of its own, as after a reconstruction. A hand then brings it back in two ways, with nothing but mouse events on
the page, each aimed with a standard deviation of one pixel:

- by drags: a point of the model that the eye knows on the map is dragged there, another one with Shift turns and scales,
  the wheel zooms to both and the drags are repeated; on the view from the side the model is moved up or down;
- by pairs: points are clicked on photographs and then on the map, and "Fit to pairs" is pressed.

What the page saves is compared with what was planted: the root mean square distance of the points, the angle between both
rotations, the scale. Wanted are at most 0.5 m and 0.5 degrees. The eye is simulated: it knows where a point of the model
truly lies, and takes flat places for pairs, as one does. Also checked: no error on the console, no request to anywhere else,
a refused second save, the numbers of the page. Writes benches/results/align_page.txt, with --figures also the picture of the
guide. --local-page takes the page from the sources instead of the program. Without Chromium it prints a line and ends.
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys

from viewer import KINDS, PAGE, ROOT, Checks, environment

AIM_PX = 1.0
WANTED_M, WANTED_DEG = 0.5, 0.5
PAIRS = 6
# Metres in a pixel at which a hand works: small enough to see where a roof ends.
WORKING_M_PX = 0.15


def make_flight(skysweep, folder):
    """Makes a flight around the simulated town, where it is not there yet."""
    flight = folder / "flight"
    if not (flight / "cameras/sparse/0/points3D.txt").exists():
        subprocess.run([skysweep, "simulate", "town", "--flight", "24", "--views", "2", "-o", flight, "--overwrite", "-q"], check=True)
    footprints = flight / "footprints.geojson"
    if not footprints.exists():
        subprocess.run([skysweep, "city", "convert", flight / "truth/buildings.city.json", "-o", footprints, "-q"], check=True)
    return flight


def rotation_of(q):
    import numpy as np
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def quaternion_of(r):
    """Returns the quaternion (w, x, y, z) of a rotation matrix."""
    import numpy as np
    k = np.array([[r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0],
                  [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
                  [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], 0],
                  [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]]])
    _, vectors = np.linalg.eigh(k)
    x, y, z, w = vectors[:, -1]
    return np.array([w, x, y, z])


class Flight:
    """The planted model and where its points truly lie."""

    def __init__(self, flight, folder, seed):
        import numpy as np
        random = np.random.default_rng(seed)
        self.random, self.folder = random, folder
        source = flight / "cameras/sparse/0"
        rows = [line.split() for line in (source / "points3D.txt").read_text().splitlines() if line and line[0] != "#"]
        self.world = np.array([[float(c) for c in row[1:4]] for row in rows])
        # world = scale · rotation · model + shift
        self.rotation = rotation_of(random.normal(size=4))
        self.scale = float(np.exp(random.uniform(np.log(0.02), np.log(5.0))))
        self.shift = self.world.mean(axis=0) + random.uniform(-50, 50, 3)
        self.model = (self.world - self.shift) @ self.rotation / self.scale
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        shutil.copy(source / "cameras.txt", folder)
        points = [" ".join([row[0], *(repr(float(c)) for c in at), *row[4:]]) for row, at in zip(rows, self.model)]
        (folder / "points3D.txt").write_text("\n".join(points) + "\n")
        lines = [line for line in (source / "images.txt").read_text().split("\n") if not line.startswith("#")]
        self.cameras, images = {}, []
        for head, seen in zip(lines[::2], lines[1::2]):
            number, *numbers, lens, name = head.split()
            turn = rotation_of(np.array([float(c) for c in numbers[:4]]))
            place = np.array([float(c) for c in numbers[4:]])
            own, moved = turn @ self.rotation, (turn @ self.shift + place) / self.scale
            self.cameras[name] = (own, moved)
            pose = [repr(float(c)) for c in (*quaternion_of(own), *moved)]
            images += [" ".join([number, *pose, lens, name]), seen]
        (folder / "images.txt").write_text("\n".join(images) + "\n")

    def true_place(self, model):
        """Returns where points of the model truly lie."""
        return self.scale * model @ self.rotation.T + self.shift

    def judge(self, out):
        """Returns the distance (metres), the angle (degrees) and the error of the scale (percent) of what was saved."""
        import numpy as np
        found = json.loads((out / "similarity.json").read_text())
        origin = np.array(json.loads((out / "origin.json").read_text())["origin"])
        rotation = np.array(found["rotation"])
        moved = found["scale"] * self.model @ rotation.T + np.array(found["translation"]) + origin
        distance = np.sqrt(((moved - self.world) ** 2).sum(axis=1).mean())
        cosine = (np.trace(rotation.T @ self.rotation) - 1) / 2
        return distance, np.degrees(np.arccos(np.clip(cosine, -1, 1))), 100 * (found["scale"] / self.scale - 1)


class Desk:
    """The page, the hand on its mouse, and the eye that reads its numbers."""

    def __init__(self, playwright, arguments, url, random):
        self.browser = playwright.chromium.launch(executable_path=arguments.chromium, args=["--no-sandbox"])
        self.page = self.browser.new_page(viewport={"width": 1280, "height": 760})
        self.random, self.errors, self.asked = random, [], []
        self.page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        if arguments.local_page:
            token = "/".join(url.split("/")[:4]) + "/"
            self.page.route(lambda one: one.startswith(token), lambda route: from_sources(route, token))
        self.page.goto(url)
        self.page.wait_for_selector("html[data-ready]", timeout=30000)
        self.settle()
        self.opening = self.page.evaluate("fetch('job/opening.json').then((answer) => answer.json())")

    def settle(self):
        self.page.wait_for_load_state("networkidle")
        self.page.wait_for_timeout(250)

    def corner(self, canvas):
        box = self.page.locator(canvas).bounding_box()
        return box["x"], box["y"], box["width"], box["height"]

    def aimed(self, at):
        return [float(c + AIM_PX * self.random.normal()) for c in at]

    def drag(self, canvas, start, end, shift=False):
        """Drags from one place of a canvas to another, as well as a hand can aim."""
        left, top, *_ = self.corner(canvas)
        start, end = self.aimed(start), self.aimed(end)
        if shift:
            self.page.keyboard.down("Shift")
        self.page.mouse.move(left + start[0], top + start[1])
        self.page.mouse.down()
        self.page.mouse.move(left + end[0], top + end[1], steps=8)
        self.page.mouse.up()
        if shift:
            self.page.keyboard.up("Shift")
        self.page.wait_for_timeout(120)

    def click(self, canvas, at):
        left, top, *_ = self.corner(canvas)
        x, y = self.aimed(at)
        self.page.mouse.click(left + x, top + y)
        self.settle()

    # The eye: where the page draws what.

    def map_frame(self):
        """Returns the middle of the map (metres) and the metres in a pixel."""
        left, top, width, height = self.corner("#over")
        read = []
        for x, y in ((0.25, 0.25), (0.75, 0.75)):
            self.page.mouse.move(left + x * width, top + y * height)
            data = self.page.locator("#readout").evaluate("e => ({...e.dataset})")
            read.append([float(data["x"]), float(data["y"])])
        (x0, y0), (x1, y1) = read
        return (x0 + x1) / 2, (y0 + y1) / 2, (x1 - x0) / (0.5 * width)

    def on_map(self, place):
        """Returns the pixel of the map's canvas of a place in the world."""
        x, y, metres = self.map_frame()
        *_, width, height = self.corner("#over")
        return [width / 2 + (place[0] - x) / metres, height / 2 - (place[1] - y) / metres]

    def look_at(self, place, metres=WORKING_M_PX):
        """Zooms in until a pixel of the map has some metres, and moves the place to the middle."""
        left, top, width, height = self.corner("#over")
        self.page.keyboard.press("0")
        self.page.wait_for_timeout(100)
        for _ in range(40):
            if self.map_frame()[2] <= metres * 1.2:
                break
            x, y = self.on_map(place)
            self.page.mouse.move(left + min(max(x, 5), width - 5), top + min(max(y, 5), height - 5))
            self.page.mouse.wheel(0, -100)
            self.page.wait_for_timeout(60)
        for _ in range(3):
            x, y = self.on_map(place)
            if abs(x - width / 2) < 60 and abs(y - height / 2) < 60:
                break
            shift = [min(max(width / 2 - x, -width / 3), width / 3), min(max(height / 2 - y, -height / 3), height / 3)]
            self.page.mouse.move(left + width / 2, top + height / 2)
            self.page.mouse.down(button="right")
            self.page.mouse.move(left + width / 2 + shift[0], top + height / 2 + shift[1], steps=3)
            self.page.mouse.up(button="right")
        self.settle()

    def drawn(self, model):
        """Returns where a point of the model lies in the world, by the numbers that the page shows."""
        import numpy as np
        value = {name: float(self.page.input_value(f"#{name}")) for name in
                 ("east", "north", "height", "scale", "heading", "tilt-east", "tilt-north")}
        a, b, c = (np.radians(value[name]) for name in ("tilt-east", "tilt-north", "heading"))
        c = -c
        about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
        about_z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
        base = np.array(self.opening["start"]["world_from_model"]["rotation"])
        rotation = about_x @ about_y @ about_z @ base
        offset = np.asarray(model) - np.array(self.opening["pivot"])
        return value["scale"] * rotation @ offset + np.array([value[name] for name in ("east", "north", "height")])


def from_sources(route, token):
    name = route.request.url[len(token):].split("?")[0]
    name = {"": "align/index.html", "align.html": "align/index.html"}.get(name, name)
    file = PAGE / name
    if file.is_file() and file.suffix in KINDS:
        route.fulfill(body=file.read_text(), content_type=KINDS[file.suffix])
    else:
        route.continue_()


class Ground:
    """The map's heights, which an eye judges as flat or not."""

    def __init__(self, path):
        import rasterio
        with rasterio.open(path) as file:
            self.heights, self.transform = file.read(1, masked=True).filled(float("nan")), file.transform

    def is_flat(self, place, reach_m=1.5):
        """Whether the ground or roof around a place is flat, and the place lies on it."""
        import numpy as np
        column, row = ~self.transform * (place[0], place[1])
        reach = max(1, round(reach_m / self.transform.a))
        column, row = int(column), int(row)
        if min(column, row) < reach:
            return False
        part = self.heights[row - reach:row + reach + 1, column - reach:column + reach + 1]
        return part.size > 0 and bool(np.isfinite(part).all()) and np.ptp(part) < 0.4 and abs(part.mean() - place[2]) < 0.4


def landmarks(flight, ground, count):
    """Returns flat points of the model far from one another: what a person takes."""
    import numpy as np
    flat = [i for i in flight.random.permutation(len(flight.world))[:4000] if ground.is_flat(flight.world[i])]
    middle = np.median(flight.world, axis=0)[:2]
    inside = np.quantile(np.linalg.norm(flight.world[:, :2] - middle, axis=1), 0.9)
    flat = [i for i in flat if np.linalg.norm(flight.world[i, :2] - middle) < inside]
    chosen = [min(flat, key=lambda i: np.linalg.norm(flight.world[i, :2] - middle))]
    while len(chosen) < count:
        away = [min(np.linalg.norm(flight.world[i, :2] - flight.world[j, :2]) for j in chosen) for i in flat]
        chosen.append(flat[int(np.argmax(away))])
    return chosen


def move_up(desk, model, wanted_m):
    """Moves the model up or down on the view from the side, first from afar and then near."""
    for zooms in (0, 6, 4):
        left, top, width, height = desk.corner("#side")
        desk.page.mouse.move(left + width / 2, top + height / 2)
        for _ in range(zooms):
            desk.page.mouse.wheel(0, -100)
        desk.page.wait_for_timeout(150)
        # The scale of the view follows from what a drag does: a person sees it on the axis.
        before = desk.drawn(model)[2]
        desk.drag("#side", [width / 2, height / 2], [width / 2, height / 2 - 20])
        metres = (desk.drawn(model)[2] - before) / 20
        missing = (wanted_m - desk.drawn(model)[2]) / metres
        while abs(missing) > 2:
            step = min(max(missing, -0.4 * height), 0.4 * height)
            desk.drag("#side", [width / 2, height / 2], [width / 2, height / 2 - step])
            missing -= step


def by_drags(desk, flight, ground):
    """Moves, turns and scales the model with the mouse alone."""
    near, far = landmarks(flight, ground, 2)
    for metres in (None, 0.4, WORKING_M_PX, WORKING_M_PX / 2):
        for point, shift in ((near, False), (far, True)):
            truth = flight.world[point]
            if metres:
                # Both ends of the drag have to be on the screen.
                drawn = desk.drawn(flight.model[point])
                away = ((drawn - truth)[:2] ** 2).sum() ** 0.5
                desk.look_at((drawn + truth) / 2, max(metres, away / 300))
            desk.drag("#over", desk.on_map(desk.drawn(flight.model[point])), desk.on_map(truth), shift)
    move_up(desk, flight.model[near], flight.world[near][2])
    desk.page.keyboard.press("0")
    desk.settle()


def by_pairs(desk, flight, ground):
    """Picks points on photographs and on the map, and lets the page fit them."""
    import numpy as np
    size = desk.opening["cameras"][0]["size"]
    focal, principal = desk.opening["cameras"][0]["focal"], desk.opening["cameras"][0]["principal"]
    made = 0
    for point in landmarks(flight, ground, 3 * PAIRS):
        if made == PAIRS:
            break
        for name, (turn, place) in flight.cameras.items():
            x, y, z = turn @ flight.model[point] + place
            pixel = [focal[0] * x / z + principal[0], focal[1] * y / z + principal[1]]
            if z > 0 and 20 < pixel[0] < size[0] - 20 and 20 < pixel[1] < size[1] - 20:
                break
        else:
            continue
        desk.page.select_option("#camera", label=name)
        desk.settle()
        *_, width, height = desk.corner("#photo-dots")
        scale = min(width / size[0], height / size[1])
        edge = [(width - scale * size[0]) / 2, (height - scale * size[1]) / 2]
        desk.click("#photo-dots", [(c + 0.5) * scale + e for c, e in zip(pixel, edge)])
        picked = desk.page.locator("#photo-dots").get_attribute("data-picked")
        truth = flight.true_place(np.array(json.loads(picked))) if picked else None
        if truth is None or not ground.is_flat(truth, 1.0):
            desk.page.keyboard.press("Escape")
            continue
        desk.look_at(truth)
        desk.click("#over", desk.on_map(truth))
        made += 1
    desk.page.click("#fit-pairs")
    desk.settle()
    desk.page.keyboard.press("0")
    desk.settle()
    return made


def figure(page, wanted):
    """Takes the picture of the guide."""
    if not wanted:
        return
    import io
    from PIL import Image
    page.evaluate("document.querySelector('aside').scrollTo(0, 0)")
    Image.open(io.BytesIO(page.screenshot())).convert("RGB").save(ROOT / "docs/figures/align_page.webp", quality=80)


def one_seed(playwright, arguments, seed, checks, asked):
    import numpy as np
    flight_folder = make_flight(arguments.skysweep, arguments.work)
    truth = flight_folder / "truth"
    ground = Ground(truth / "dsm.tif")
    for way in ("drags", "pairs"):
        flight = Flight(flight_folder, arguments.work / f"model_{seed}", seed)
        out = arguments.work / f"out_{seed}_{way}"
        shutil.rmtree(out, ignore_errors=True)
        command = [arguments.skysweep, "align", flight.folder, "--page", truth / "ortho.tif", truth / "dsm.tif",
                   flight_folder / "footprints.geojson", "--images", flight_folder / "cameras/images", "-o", out.name, "--for", "600", "-q"]
        server = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, text=True,
                                  cwd=arguments.work)
        try:
            url = server.stdout.readline().strip()
            desk = Desk(playwright, arguments, url, np.random.default_rng([seed, way == "pairs"]))
            is_first = seed == arguments.seeds[0]
            if is_first and way == "drags":
                drawn = desk.page.locator("#count").inner_text()
                checks.check(f"{len(flight.world):,}" in drawn, "the page says how many points of how many are drawn")
            made = (by_drags if way == "drags" else by_pairs)(desk, flight, ground)
            if way == "pairs":
                checks.check(made == PAIRS, f"seed {seed}: {made} pairs are picked on photographs and the map")
                if is_first:
                    desk.page.check("#vectors input")
                    desk.page.select_option("#camera", label=next(iter(flight.cameras)))
                    desk.settle()
                    figure(desk.page, arguments.figures)
            desk.page.click("#save")
            desk.page.wait_for_selector("#saved:not(:empty)", timeout=20000)
            distance, angle, scale = flight.judge(out)
            checks.check(distance <= WANTED_M and angle <= WANTED_DEG,
                         f"seed {seed}, {way}: points {distance:.2f} m off, rotation {angle:.2f}°, scale {scale:+.2f} %")
            checks.check(not desk.errors, f"seed {seed}, {way}: no error on the console" + "".join(desk.errors[:2]))
            asked += [(one, url) for one in desk.asked]
            if is_first and way == "pairs":
                look_further(desk, out, checks)
            desk.browser.close()
        finally:
            server.terminate()
            server.wait()


def look_further(desk, out, checks):
    """What is told in words, what can be taken back, and a narrow window."""
    page = desk.page
    files = sorted(path.name for path in out.iterdir())
    wanted = ["align.html", "align.json", "cameras.bin", "images.bin", "origin.json", "pairs.csv", "points3D.bin", "similarity.json"]
    checks.check(files == wanted, "the folder has the outputs of align and the pairs")
    page.click("#save")
    page.wait_for_selector("#message:not([hidden])", timeout=20000)
    told = page.locator("#message").inner_text()
    checks.check("Nothing was saved" in told and "exist" in told, "a second save without --overwrite is refused in words")
    page.click("#message button")
    page.keyboard.press("m")
    before = page.input_value("#east")
    desk.drag("#over", [300, 320], [360, 340])
    moved = page.input_value("#east")
    page.keyboard.press("z")
    checks.check(before != moved and page.input_value("#east") == before, "Z takes a move back")
    rows = page.locator("#pairs tbody tr").count()
    page.locator("#pairs tbody tr button").first.click()
    checks.check(page.locator("#pairs tbody tr").count() == rows - 1, "a pair can be deleted")
    page.fill("#heading", "10")
    page.keyboard.press("Enter")
    checks.check(abs(float(page.input_value("#heading")) - 10) < 1e-6, "a number that is written in is taken")
    page.set_viewport_size({"width": 900, "height": 600})
    checks.check(page.evaluate("document.documentElement.scrollWidth <= 900 && document.documentElement.scrollHeight <= 600"),
                 "the page fits a window of 900 x 600 pixels")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--skysweep", default=str(ROOT / "target/release/skysweep"))
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target/align_page")
    parser.add_argument("--chromium", default=shutil.which("chromium") or shutil.which("chromium-browser"))
    parser.add_argument("--seeds", type=int, nargs="+", default=[101, 102, 103])
    parser.add_argument("--figures", action="store_true")
    parser.add_argument("--local-page", action="store_true")
    arguments = parser.parse_args()
    if not arguments.chromium:
        print("skipped: there is no Chromium; install it, or name it with --chromium")
        return 0
    arguments.work = arguments.work.resolve()
    arguments.skysweep = str(pathlib.Path(arguments.skysweep).resolve())
    arguments.work.mkdir(parents=True, exist_ok=True)
    try:
        from playwright.sync_api import sync_playwright
        import rasterio  # noqa: F401
    except ImportError:
        python = environment(arguments.work)
        os.execv(python, [python, *sys.argv])
    checks, asked = Checks(), []
    with sync_playwright() as playwright:
        for seed in arguments.seeds:
            one_seed(playwright, arguments, seed, checks, asked)
    own = all(one.startswith(("/".join(url.split("/")[:3]) + "/", "data:", "blob:")) for one, url in asked)
    checks.check(own and len(asked) > 50, f"all {len(asked)} requests went to the program")
    version = subprocess.run([arguments.chromium, "--version"], capture_output=True, text=True).stdout.strip()
    if not arguments.local_page:
        text = "\n".join([f"skysweep align --page over a simulated town in {version}", *checks.lines, ""])
        (ROOT / "benches/results/align_page.txt").write_text(text)
    return 1 if checks.failed else 0


if __name__ == "__main__":
    sys.exit(main())
