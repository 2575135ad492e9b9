#!/usr/bin/env python3
"""Opens `skysweep view` in headless Chromium, uses it as a person does, and compares what it shows with GDAL.

    benches/peers/viewer.py [--skysweep PROGRAM] [--work FOLDER] [--chromium PROGRAM] [--figures] [--local-page]

Makes a run of the sample town with its terrain and ortho, and checks: no message of an error on the console, no request
to anywhere but the viewer, a profile that is drawn by mouse equals the raster as GDAL reads it, the read-out too, the
swipe and the 3D view draw something, filled cells change the 3D view, keys work, the page fits 800 pixels, a browser
without WebGL gets a message. Writes benches/results/viewer.txt, with --figures also the pictures of the guide.
--local-page takes the page from the sources instead of the program, to try changes without a build. Without Chromium it
prints a line and ends. Playwright, numpy and rasterio come from PyPI into FOLDER/venv (default target/viewer).
"""
import argparse
import csv
import io
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOWN = ROOT / "data-samples/town"
PAGE = ROOT / "crates/viewer/src/page"
PACKAGES = ["numpy", "rasterio", "playwright", "pillow"]
COLOURS_OF_FIGURES = 256
KINDS = {".js": "text/javascript", ".css": "text/css", ".html": "text/html"}


def environment(folder):
    """Returns a python with the packages, made when there is none."""
    python = folder / "venv/bin/python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *PACKAGES], check=True)
    return python


def make_run(skysweep, folder):
    """Makes the run that is shown, where it is not there yet."""
    run = folder / "run"
    if (run / "ortho.tif").exists():
        return run
    images = sorted(str(path) for path in TOWN.glob("view_*.tif"))
    quiet = ["--progress", "none", "-q", "--overwrite"]
    subprocess.run([skysweep, "dsm", *images, "-o", run, *quiet], check=True)
    subprocess.run([skysweep, "dtm", run, "-o", run / "dtm", *quiet], check=True)
    subprocess.run([skysweep, "ortho", *images, "--dsm", run, "-o", run / "ortho.tif", *quiet], check=True)
    return run


class Checks:
    """Counts what holds, and prints and keeps a line for each."""

    def __init__(self):
        self.lines, self.failed = [], 0

    def check(self, holds, text):
        self.failed += not holds
        self.lines.append(f"{'ok    ' if holds else 'FAILED'}  {text}")
        print(self.lines[-1], flush=True)


class Browser:
    """A page of the viewer, with everything that it says and asks for."""

    def __init__(self, playwright, chromium, url, local, width=1120, height=700, options=(), script=None):
        self.browser = playwright.chromium.launch(
            executable_path=chromium, args=["--no-sandbox", "--enable-unsafe-swiftshader", *options])
        self.page = self.browser.new_page(viewport={"width": width, "height": height})
        self.errors, self.asked = [], []
        self.page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        if script:
            self.page.add_init_script(script)
        if local:
            self.page.route(re.compile(r".*/(\w+\.(js|css))?$"), from_sources)
        self.page.goto(url)
        self.page.wait_for_selector("html[data-ready]", timeout=20000)
        self.settle()

    def settle(self):
        """Waits until nothing is asked for any more."""
        self.page.wait_for_load_state("networkidle")
        self.page.wait_for_timeout(700)

    def colours(self, canvas, part=(0, 0, 1, 1)):
        """Returns the number of colours in a part of a canvas."""
        return self.page.evaluate(
            """([id, [l, t, w, h]]) => {
              const from = document.getElementById(id), to = document.createElement('canvas');
              [to.width, to.height] = [from.width, from.height];
              const context = to.getContext('2d');
              context.drawImage(from, 0, 0);
              const data = context.getImageData(l * to.width, t * to.height, w * to.width, h * to.height).data;
              const pixels = new Uint32Array(data.buffer);
              return new Set(pixels).size;
            }""", [canvas, list(part)])

    def at(self, x, y):
        """Moves the mouse to a place of the map and returns the read-out."""
        box = self.page.locator("#map").bounding_box()
        self.page.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"])
        self.settle()
        data = self.page.locator("#readout").evaluate("e => ({...e.dataset})")
        return float(data["x"]), float(data["y"]), json.loads(data["values"])


def from_sources(route):
    file = PAGE / (route.request.url.split("/")[-1].split("?")[0] or "index.html")
    if file.is_file():
        route.fulfill(body=file.read_text(), content_type=KINDS[file.suffix])
    else:
        route.continue_()


def cells_of(path, xs, ys):
    """Returns the values of a raster at positions as GDAL reads them, NaN for no-data."""
    import numpy as np
    import rasterio
    with rasterio.open(path) as file:
        found = np.array([values[0] for values in file.sample(zip(xs, ys), masked=True)], dtype=object)
        return np.array([float("nan") if value is np.ma.masked else float(value) for value in found])


def use_map(browser, run, checks, figures):
    import numpy as np
    page = browser.page
    checks.check(browser.colours("map") > 1000, "the map draws heights in more than 1000 colours")
    figure(page, "viewer_map.png", figures)
    x, y, values = browser.at(0.6, 0.4)
    checks.check(np.isclose(values[0][0], cells_of(run / "dsm/dsm.tif", [x], [y])[0], atol=1e-4),
                 "the read-out under the mouse is the height that GDAL reads there")
    page.keyboard.press("s")
    page.select_option("#second-layer", label="Ortho")
    browser.settle()
    figure(page, "viewer_swipe.png", figures)
    page.keyboard.press("f")
    before = browser.colours("map", (0, 0, 0.48, 1))
    page.locator("#second-layer").select_option(label="Source of the height")
    browser.settle()
    checks.check(page.locator("#handle").is_visible() and browser.colours("map", (0.52, 0, 0.48, 1)) < before / 10,
                 "the swipe shows classes on the right")
    checks.check(browser.colours("map", (0, 0, 0.48, 1)) > 1000, "the swipe leaves the heights on the left")
    page.locator("#handle").focus()
    page.keyboard.press("Home")
    browser.settle()
    checks.check(browser.colours("map") < before / 10, "the handle of the swipe follows the keys")
    page.keyboard.press("s")
    page.keyboard.press("f")
    page.locator("#map").focus()
    for key in ("+", "ArrowRight", "2", "1", "f", "f", "-", "0"):
        page.keyboard.press(key)
    browser.settle()
    checks.check(np.allclose(browser.at(0.6, 0.4)[:2], (x, y), atol=0.02), "0 brings the map back after keys")


def draw_profile(browser, run, checks, figures):
    import numpy as np
    page = browser.page
    page.keyboard.press("p")
    start, end = browser.at(0.45, 0.3), browser.at(0.62, 0.72)
    browser.at(0.45, 0.3)
    page.mouse.down()
    browser.at(0.5, 0.5)
    browser.at(0.62, 0.72)
    page.mouse.up()
    browser.settle()
    with page.expect_download() as download:
        page.click("#csv")
    rows = list(csv.DictReader(io.StringIO(download.value.path().read_text())))
    xs, ys = (np.array([float(row[axis]) for row in rows]) for axis in "xy")
    ends = np.array([[xs[0], ys[0]], [xs[-1], ys[-1]]])
    checks.check(np.allclose(ends, [start[:2], end[:2]], atol=1e-3), "the profile runs from press to release of the mouse")
    for name, path in (("dsm.tif", "dsm/dsm.tif"), ("dtm.tif", "dtm/dtm.tif")):
        shown = np.array([float(row[name] or "nan") for row in rows])
        wanted = cells_of(run / path, xs, ys)
        same = np.isclose(shown, wanted, atol=1e-4, equal_nan=True)
        checks.check(same.all() and np.isfinite(shown).sum() > 100,
                     f"the profile of {name} equals GDAL in {same.sum()} of {len(same)} positions")
    checks.check(page.locator("#plot path").count() == 2, "the chart has a line for each raster of heights")
    box = page.locator("#plot").bounding_box()
    page.mouse.move(box["x"] + box["width"] * 0.6, box["y"] + 80)
    browser.settle()
    figure(page, "viewer_profile.png", figures)
    page.keyboard.press("Escape")
    checks.check(not page.locator("#chart").is_visible(), "Escape leaves the profile")
    page.locator("#map").focus()
    page.keyboard.press("p")
    for key in ("Enter", *["ArrowRight"] * 3, "Enter"):
        page.keyboard.press(key)
    browser.settle()
    checks.check(page.locator("#plot path").count() == 2, "a profile can be drawn with the keys alone")
    page.keyboard.press("Escape")
    page.keyboard.press("0")


def look_from_the_side(browser, checks, figures):
    page = browser.page
    page.click("#surface")
    browser.settle()
    page.wait_for_timeout(1500)
    picture = page.locator("#mesh").screenshot
    hatched = picture()
    checks.check(browser.colours("mesh") > 50, "the 3D view draws the ortho over the surface")
    figure(page, "viewer_3d.png", figures)
    page.uncheck("#mesh-hatch")
    browser.settle()
    plain = picture()
    checks.check(plain != hatched, "filled cells look different in 3D")
    box = page.locator("#mesh").bounding_box()
    page.mouse.move(box["x"] + 400, box["y"] + 300)
    page.mouse.down()
    page.mouse.move(box["x"] + 500, box["y"] + 340, steps=4)
    page.mouse.up()
    turned = picture()
    checks.check(turned != plain, "the mouse turns the surface")
    page.locator("#mesh").focus()
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("+")
    checks.check(picture() != turned, "the keys turn the surface")
    page.select_option("#mesh-layer", label="Heights")
    page.wait_for_timeout(1500)
    checks.check(browser.colours("mesh") > 500, "the 3D view draws coloured heights")
    page.keyboard.press("Escape")
    checks.check(not page.locator("#scene3d").is_visible(), "Escape leaves the 3D view")


def figure(page, name, wanted):
    """Takes a picture for the guide, with few colours so that it is small."""
    if not wanted:
        return
    from PIL import Image
    raw = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    small = raw.quantize(COLOURS_OF_FIGURES, dither=Image.Dither.NONE)
    small.save(ROOT / "docs/figures" / name, optimize=True)


def check_all(arguments, run, url, checks):
    from playwright.sync_api import sync_playwright
    origin = "/".join(url.split("/")[:3]) + "/"
    no_webgl = "const own = HTMLCanvasElement.prototype.getContext; HTMLCanvasElement.prototype.getContext = " \
        "function (kind, ...rest) { return kind.startsWith('webgl') ? null : own.call(this, kind, ...rest); };"
    with sync_playwright() as playwright:
        def opened(**how):
            return Browser(playwright, arguments.chromium, url, arguments.local_page, **how)
        browser = opened()
        use_map(browser, run, checks, arguments.figures)
        draw_profile(browser, run, checks, arguments.figures)
        look_from_the_side(browser, checks, arguments.figures)
        asked, errors = browser.asked, browser.errors
        browser.browser.close()
        narrow = opened(width=800, height=600, script=no_webgl)
        page = narrow.page
        for _ in range(2):
            page.click("#theme")
        checks.check(page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 24, 29)",
                     "the dark theme is dark")
        checks.check(page.evaluate("document.documentElement.scrollWidth <= 800 && document.documentElement.scrollHeight <= 600"),
                     "the page fits a window of 800 x 600 pixels")
        page.click("#surface")
        checks.check("WebGL" in page.locator("#message").inner_text(), "a browser without WebGL gets a message")
        asked, errors = asked + narrow.asked, errors + narrow.errors
        narrow.browser.close()
    checks.check(not errors, f"no error on the console: {errors[:3]}" if errors else "no error on the console")
    own = all(one.startswith((origin, "data:", f"blob:{origin}")) for one in asked)
    checks.check(own and len(asked) > 50, f"all {len(asked)} requests went to the viewer")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--skysweep", default=str(ROOT / "target/release/skysweep"))
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target/viewer")
    parser.add_argument("--chromium", default=shutil.which("chromium") or shutil.which("chromium-browser"))
    parser.add_argument("--figures", action="store_true")
    parser.add_argument("--local-page", action="store_true")
    arguments = parser.parse_args()
    if not arguments.chromium:
        print("skipped: there is no Chromium; install it, or name it with --chromium")
        return 0
    arguments.work.mkdir(parents=True, exist_ok=True)
    python = environment(arguments.work)
    if pathlib.Path(sys.prefix) != (arguments.work / "venv").resolve():
        os.execv(python, [python, *sys.argv])
    run = make_run(arguments.skysweep, arguments.work)
    command = [arguments.skysweep, "view", run, "--for", "600", "-q"]
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    checks = Checks()
    try:
        check_all(arguments, run, viewer.stdout.readline().strip(), checks)
    finally:
        viewer.terminate()
    version = subprocess.run([arguments.chromium, "--version"], capture_output=True, text=True).stdout.strip()
    if not arguments.local_page:
        text = "\n".join([f"skysweep view of the sample town in {version}", *checks.lines, ""])
        (ROOT / "benches/results/viewer.txt").write_text(text)
    return 1 if checks.failed else 0


if __name__ == "__main__":
    sys.exit(main())
