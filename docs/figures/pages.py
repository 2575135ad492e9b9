#!/usr/bin/env python3
"""Makes the pictures of the pages and of the viewer in the guide, and checks that the pages print well.

    python3 docs/figures/pages.py PROGRAM [--work FOLDER] [--chromium PROGRAM]

One simulated town (seed 41, chosen for nothing but being the next after the seeds of the benches) is photographed on two
dates: three buildings stand only on the second, two only on the first. STAC items give the images dates, satellites and
sun; one image has none. The pages of a run, of a change and of a batch become pictures and PDFs. A page that is wider than
its paper, a PDF with an empty page, or an error on the console fails. Needs playwright, pillow, numpy, rasterio, pypdfium2.
"""
import argparse
import io
import json
import pathlib
import random
import shutil
import subprocess
import sys

import numpy as np
import pypdfium2
import rasterio
from PIL import Image
from playwright.sync_api import sync_playwright

FIGURES = pathlib.Path(__file__).resolve().parent
SEED = 41
ADDED, REMOVED = 3, 2
# Width of A4 without its margins at 96 dots per inch.
PAPER_PX = 695
# Most bytes of a picture in the guide, its colours as PNG, its quality as WebP.
BYTES_MAX, COLOURS, QUALITY = 200_000, 128, 82
BATCH = """output = "night"
[defaults]
tasks = ["dsm", "eval", "dtm"]
dsm = { gsd_m = 1.0, preset = "fast" }
products = { products = ["contours"] }
[[scene]]
name = "town 2019"
images = ["before/view_*.tif"]
eval.reference = "before/truth/dsm.tif"
tasks = ["dsm", "eval", "dtm", "products"]
[[scene]]
name = "town 2024"
images = ["after/view_*.tif"]
eval.reference = "after/truth/dsm.tif"
tasks = ["dsm", "eval", "dtm", "diff"]
diff.before = "night/town 2019"
[[scene]]
name = "harbour"
images = ["harbour/*.tif"]
tasks = ["dsm"]
"""


def run(*words, code=0):
    done = subprocess.run([str(word) for word in words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    if done.returncode != code:
        sys.exit(f"{' '.join(map(str, words))} ended with {done.returncode}, expected {code}")


def simulate(program, folder, absent, campaign, gsd=0.7):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "in.toml").write_text(
        f"seed = {SEED}\nsize_m = 280.0\ngsd_m = {gsd}\nabsent_buildings = {absent}\n[acquisition]\ncampaign = {campaign}\n")
    run(program, "simulate", folder / "in.toml", "-o", folder, "--overwrite", "--progress", "none", "-q")


def two_dates(program, work):
    """Simulates the town, and writes items with the metadata that simulated images lack."""
    simulate(program, work / "all", [], 0, 2.0)
    with rasterio.open(work / "all/truth/buildings.tif") as file:
        numbers = file.read(1)
    inner = np.zeros(numbers.shape, bool)
    inner[20:-20, 20:-20] = True
    good = [int(n) for n in np.unique(numbers[numbers > 0]) if (numbers == n).sum() * 4 >= 60 and inner[numbers == n].all()]
    chosen = random.Random(SEED).sample(good, ADDED + REMOVED)
    for name, absent, campaign, year in [("before", chosen[:ADDED], 1, 2019), ("after", chosen[ADDED:], 2, 2024)]:
        simulate(program, work / name, absent, campaign)
        for i, view in enumerate(sorted((work / name).glob("view_*.tif"))):
            properties = {"datetime": f"{year}-05-{12 + i}T10:{15 + 3 * i}:2{i}Z", "platform": f"SIM-{1 + i % 2}",
                          "view:sun_azimuth": 141.0 + i, "view:sun_elevation": 55.0}
            assets = {"image": {"href": view.name, "type": "image/tiff; application=geotiff", "roles": ["data"]}}
            item = {"type": "Feature", "stac_version": "1.1.0", "assets": assets, "properties": properties}
            view.with_suffix(".json").write_text(json.dumps(item))


def make(program, work):
    two_dates(program, work)
    quiet = ["--overwrite", "--progress", "none", "-q"]
    views = {name: [work / name / f"view_{i}.json" for i in (1, 2, 3)] for name in ("before", "after")}
    # One image is given without its item.
    views["after"][0] = work / "after/view_1.tif"
    run(program, "dsm", *views["before"], "-o", work / "runs/before", "--products", "dtm,classes,contours", *quiet)
    run(program, "dsm", *views["after"], "-o", work / "runs/after", *quiet)
    run(program, "diff", work / "runs/before", work / "runs/after", "-o", work / "change", *quiet)
    (work / "night.toml").write_text(BATCH)
    run(program, "batch", work / "night.toml", "-q", code=1)


def small(page, name):
    """Saves what a page shows: as PNG with few colours, or as WebP where fine shades need it."""
    path = FIGURES / name
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    if path.suffix == ".webp":
        picture.save(path, quality=QUALITY, method=6)
    else:
        picture.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
    if path.stat().st_size <= BYTES_MAX:
        return
    sys.exit(f"{path} has {path.stat().st_size} bytes, at most {BYTES_MAX} are wanted")


def opened(browser, address, width, height):
    page = browser.new_page(viewport={"width": width, "height": height})
    page.on("console", lambda message: message.type == "error" and sys.exit(f"{address}: {message.text}"))
    page.on("pageerror", lambda error: sys.exit(f"{address}: {error}"))
    page.goto(address)
    return page


def prints_well(page, file):
    """Fails unless the page fits its paper and every sheet of its PDF has something on it."""
    page.emulate_media(media="print")
    page.set_viewport_size({"width": PAPER_PX, "height": 1000})
    wide = page.evaluate("document.documentElement.scrollWidth")
    hidden = page.evaluate("[...document.querySelectorAll('.stack figure')].filter(one => !one.offsetHeight).length")
    page.pdf(path=file, prefer_css_page_size=True)
    document = pypdfium2.PdfDocument(file)
    empty = [i + 1 for i in range(len(document)) if document[i].render(scale=0.3).to_numpy().min() > 250]
    print(f"{file.name}: {len(document)} sheets, {wide} px of {PAPER_PX} wide, maps that are missing: {hidden}")
    if wide > PAPER_PX or hidden or empty:
        sys.exit(f"{file} does not print well; empty sheets are {empty}")


def pages(browser, work):
    shown = [("report", "png", "runs/before/report/report.html", 880), ("diff", "webp", "change/diff.html", 1560),
             ("batch", "png", "night/batch_report.html", 760),
             ("products", "", "runs/before/products/products.html", None)]
    for name, ending, file, height in shown:
        page = opened(browser, (work / file).as_uri(), 1180, height or 900)
        if height:
            small(page, f"{name}.{ending}")
        prints_well(page, work / f"{name}.pdf")
        page.close()
    page = opened(browser, (work / "runs/before/report/report.html").as_uri(), 1180, 620)
    page.locator("h2", has_text="Images").first.evaluate("heading => heading.scrollIntoView()")
    small(page, "report_images.png")
    page.close()


def viewer(browser, program, *inputs):
    """Opens the viewer; returns its process and its page."""
    words = [program, "view", "--for", "120", "--progress", "none", *inputs]
    process = subprocess.Popen([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    page = opened(browser, process.stdout.readline().strip(), 1120, 640)
    page.wait_for_selector("html[data-ready=true]")
    return process, page


def vectors(browser, program, work):
    process, page = viewer(browser, program, work / "runs/before", work / "change/changes.geojson")
    page.locator("#layers label", has_text="Hillshade").first.click()
    page.locator("#vectors label", has_text="Contour").click()
    page.wait_for_timeout(2500)
    box = page.locator("#map").bounding_box()
    for i in range(10, 90, 2):
        for j in range(10, 90, 2):
            page.mouse.click(box["x"] + box["width"] * i / 100, box["y"] + box["height"] * j / 100)
            if page.locator("#feature h2", has_text="Changes").is_visible():
                page.wait_for_timeout(500)
                small(page, "viewer_vectors.webp")
                process.terminate()
                return page.close()
    sys.exit("no region of change can be clicked")


def pair(browser, program, work):
    process, page = viewer(browser, program, work / "runs/before", work / "runs/after")
    box = page.locator("#map").bounding_box()
    page.mouse.move(box["x"] + box["width"] * 0.55, box["y"] + box["height"] * 0.43)
    page.wait_for_timeout(2500)
    small(page, "viewer_pair.webp")
    process.terminate()
    page.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--work", type=pathlib.Path, default=pathlib.Path("target/pages"))
    parser.add_argument("--chromium", default=shutil.which("chromium"))
    parser.add_argument("--keep", action="store_true", help="take the runs that an earlier call made")
    arguments = parser.parse_args()
    work = arguments.work.resolve()
    if not arguments.keep:
        make(arguments.program, work)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=arguments.chromium, args=["--no-sandbox"])
        pages(browser, work)
        vectors(browser, arguments.program, work)
        pair(browser, arguments.program, work)
        browser.close()


if __name__ == "__main__":
    main()
