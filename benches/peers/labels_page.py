#!/usr/bin/env python3
"""Clicks on buildings made of splats, on the page of `skysweep view` in headless Chromium.

    benches/peers/labels_page.py [--skysweep PROGRAM] [--work FOLDER] [--chromium PROGRAM] [--clicks N]

The splats of the sample town's true surface take class and object of its city model (`skysweep splats label`), whose
buildings get attributes of several types before. The page shows them from its first place, four steps nearer. Clicks go
to the places of a lattice on the screen. What lies there follows from the table and the labels that the server sends, and
from the place that the page reads out: the nearest labelled splat must be of the object that the page shows. Checked: no
error on the console, no request to anywhere but the viewer, object, class and attributes of each click against the city
model, that the splats of the object change their colour and change back after a click beside everything. Writes
benches/results/labels_page.txt. Without Chromium it prints a line and ends.
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys

from viewer import ROOT, TOWN, Checks, environment

# Share of the clicks on an object whose nearest labelled splat must be of the same one: at an edge, several are as near.
WANTED_SHARE = 0.9


def make_splats(skysweep, folder):
    """Makes the labelled splats that are shown."""
    folder.mkdir(parents=True, exist_ok=True)
    bare, labelled = folder / "town.ply", folder / "labelled.ply"
    quiet = ["--overwrite", "-q"]
    images = sorted(TOWN.glob("view_*.tif"))
    subprocess.run([skysweep, "splats", TOWN / "truth/dsm.tif", *images, "-o", bare, *quiet], check=True)
    city = folder / "buildings.city.json"
    model = json.loads((TOWN / "truth/buildings.city.json").read_text())
    for number, one in enumerate(model["CityObjects"].values()):
        one["attributes"] = {"storeys": number % 7 + 1, "use": f"<b>shop</b> & flat {number}", "listed": number % 2 == 0}
    city.write_text(json.dumps(model))
    told = subprocess.run([skysweep, "splats", "label", bare, "--city", city, "-o", labelled, "--overwrite", "--json"],
                          check=True, capture_output=True, text=True)
    return labelled, json.loads(told.stdout)


def labels_of(page, url):
    """Returns places, objects and classes of the splats as the server sends them, and the table."""
    import numpy as np
    get = lambda path: page.request.get(url + path).body()
    words = np.frombuffer(get("splats/0.bin"), dtype="<f4").reshape(-1, 8)[:, :3].astype(float)
    numbers = get("labels/0.bin")
    objects = np.frombuffer(numbers[:4 * len(words)], dtype="<u4")
    classes = np.frombuffer(numbers[4 * len(words):], dtype="u1")
    return words, objects, classes, json.loads(get("objects/0.json")), json.loads(get("space.json"))


def picture(page):
    """Returns the pixels of the canvas."""
    import io
    import numpy as np
    from PIL import Image
    page.wait_for_timeout(400)
    return np.asarray(Image.open(io.BytesIO(page.locator("#space").screenshot())).convert("RGB")).astype(int)


def shown(page):
    """Returns the lines of the object that the page shows; nothing where there is none."""
    if page.locator("#object").is_hidden():
        return {}
    names, texts = (page.locator(f"#attributes {kind}").all_inner_texts() for kind in ("dt", "dd"))
    # Those of a part come before those of its building, which may have the same names.
    return dict(reversed(list(zip(names, texts))))


def click(page, x, y):
    """Clicks a place of the canvas, and returns the place in the scene that is read out."""
    box = page.locator("#space").bounding_box()
    page.evaluate("delete document.getElementById('readout').dataset.place; document.getElementById('readout').textContent = ''")
    page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])
    page.wait_for_selector("#readout:not(:empty)", timeout=30000)
    page.wait_for_timeout(100)
    found = page.locator("#readout").get_attribute("data-place")
    return json.loads(found) if found else None


def use(page, url, folder, clicks, checks):
    import numpy as np
    places, objects, classes, table, scene = labels_of(page, url)
    city = json.loads((folder / "buildings.city.json").read_text())["CityObjects"]
    known = {one["number"]: one for one in table["objects"]}
    wanted = [one for one in table["objects"] if one["attributes"] == city[one["id"]].get("attributes", {})]
    checks.check(len(wanted) == len(known) > 0, f"{len(known)} objects have the attributes of the city model")
    # Nearer, so that buildings fill a good part of the picture.
    for _ in range(4):
        page.keyboard.press("+")
    page.wait_for_timeout(3000)
    page.wait_for_selector("html[data-drawn=all]", timeout=60000)
    before = picture(page)
    on_objects, right, attributes, first = 0, 0, 0, None
    lattice = [(0.1 + 0.8 * ((i * 0.6180339887) % 1), 0.1 + 0.8 * (i + 0.5) / clicks) for i in range(clicks)]
    for x, y in lattice:
        place = click(page, x, y)
        lines = shown(page)
        if not lines or place is None:
            continue
        on_objects += 1
        local = np.array(place) - np.array(scene["origin"])
        labelled = objects != table["missing_object"]
        nearest = np.argmin(np.where(labelled, ((places - local) ** 2).sum(axis=1), np.inf))
        one = known[int(objects[nearest])]
        right += lines["object"] == one["id"]
        mine = next(other for other in known.values() if other["id"] == lines["object"])
        attributes += (lines["kind"] == mine["kind"] and lines["class"] in table["classes"].values()
                       and int(lines["splats"].replace(",", "")) == int((objects == mine["number"]).sum())
                       and all(lines[name] == (value if isinstance(value, str) else json.dumps(value, separators=(",", ":")))
                               for name, value in mine["attributes"].items()))
        first = first or (x, y)
    checks.check(on_objects >= clicks // 10, f"{on_objects} of {clicks} clicks meet an object")
    checks.check(right >= WANTED_SHARE * on_objects, f"{right} of {on_objects} show the object of the nearest labelled splat")
    checks.check(attributes == on_objects, f"{attributes} of {on_objects} show its kind, class, splats and attributes")
    if first is None:
        return
    # The readout marks the place with a ring, so that it is clicked away before pictures are compared.
    click(page, 0.003, 0.003)
    checks.check(not shown(page), "a click beside everything shows no object")
    empty = picture(page)
    click(page, *first)
    changed = (abs(picture(page) - empty).sum(axis=2) > 30).mean()
    checks.check(0.0005 < changed < 0.3, f"the splats of the object are marked: {100 * changed:.1f} % of the pixels change")
    click(page, 0.003, 0.003)
    checks.check((abs(picture(page) - empty).sum(axis=2) > 30).mean() < 1e-4, "and unmarked by a click beside everything")
    checks.check((abs(before - empty).sum(axis=2) > 30).mean() < 1e-4, "the picture is that of the beginning again")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--skysweep", type=pathlib.Path, default=ROOT / "target/release/skysweep")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target/viewer")
    parser.add_argument("--chromium", default=os.environ.get("CHROMIUM") or shutil.which("chromium"))
    parser.add_argument("--clicks", type=int, default=60)
    arguments = parser.parse_args()
    arguments.skysweep = arguments.skysweep.resolve()
    if not arguments.chromium:
        print("skipped: Chromium is not installed (--chromium or the variable CHROMIUM may name one)")
        return 0
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        python = environment(arguments.work)
        return subprocess.run([python, *sys.argv]).returncode
    labelled, report = make_splats(arguments.skysweep, arguments.work / "labels")
    checks = Checks()
    checks.check(report["objects"] > 0, f"{report['labelled']} of {report['splats']} splats lie on {report['objects']} of "
                                        f"{report['objects_of_model']} objects")
    command = [arguments.skysweep, "view", labelled, "--for", "900", "-q"]
    server = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, text=True)
    try:
        url = server.stdout.readline().strip()
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=arguments.chromium,
                                                 args=["--no-sandbox", "--enable-unsafe-swiftshader"])
            page = browser.new_page(viewport={"width": 1120, "height": 700})
            errors, asked = [], []
            page.on("console", lambda m: errors.append(m.text) if m.type == "error" else None)
            page.on("pageerror", lambda error: errors.append(str(error)))
            page.on("request", lambda request: asked.append(request.url))
            page.goto(url)
            page.wait_for_selector("html[data-ready]", timeout=60000)
            page.wait_for_selector("html[data-drawn=all]", timeout=60000)
            use(page, url, arguments.work / "labels", arguments.clicks, checks)
            checks.check(not errors, "no error on the console" + "".join(errors[:2]))
            checks.check(all(one.startswith(url) or one.startswith(("data:", "blob:")) for one in asked), "nothing else is asked for")
            browser.close()
    finally:
        server.terminate()
        server.wait()
    (ROOT / "benches/results/labels_page.txt").write_text("\n".join(checks.lines) + "\n")
    return 1 if checks.failed else 0


if __name__ == "__main__":
    sys.exit(main())
