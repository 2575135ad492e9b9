"""What is left of planted pointing errors after the correction by tie points.

    python benches/evidence/pointing.py BINARY SCENE... [--out benches/results]

A SCENE is a folder of `../shared/tools/scenes.py random:SEED SCENE`: images with RPCs that hold the errors that its scene.json names.
`plan` finds the corrections. At 75 ground points over the scene and its heights, the place of each image by its corrected RPC is
compared with the true one. A shift of the ground that all images share is taken out by least squares: images alone cannot tell it.
Writes pointing.json and pointing.md with the largest error of an image, root mean square over the points. Needs numpy.
"""
import argparse
import json
import os
import subprocess
import tempfile

import numpy as np

METRES_PER_DEGREE = 111_320.0
# Half the side of the ground that every image of these scenes shows, metres.
HALF_M = 0.43 * 320
WANTED_PX = 0.2


def terms(lat, lon, height):
    one = np.ones_like(lat)
    return np.stack([one, lon, lat, height, lon * lat, lon * height, lat * height, lon**2, lat**2, height**2, lat * lon * height, lon**3,
                     lon * lat**2, lon * height**2, lon**2 * lat, lat**3, lat * height**2, lon**2 * height, lat**2 * height, height**3], -1)


def project(rpc, lon, lat, height):
    m = terms((lat - rpc["lat_off"]) / rpc["lat_scale"], (lon - rpc["long_off"]) / rpc["long_scale"],
              (height - rpc["height_off"]) / rpc["height_scale"])
    of = lambda axis, whole: (m @ rpc[f"{axis}_num"]) / (m @ rpc[f"{axis}_den"]) * rpc[f"{whole}_scale"] + rpc[f"{whole}_off"]
    return np.stack([of("samp", "samp"), of("line", "line")], -1)


def corrected(correction, places):
    centre = np.array([correction["centre"]["sample"], correction["centre"]["line"]])
    return places + np.array(correction["translation_px"]) + (places - centre) @ np.array(correction["linear"]).T


def measure(binary, scene):
    with open(f"{scene}/scene.json") as file:
        truth = json.load(file)
    with tempfile.TemporaryDirectory() as out:
        images = [f"{scene}/{view['file']}" for view in truth["views"]]
        subprocess.run([binary, "plan", *images, "-o", out, "--overwrite"], check=True, capture_output=True)
        with open(f"{out}/plan.json") as file:
            plan = json.load(file)["plan"]
    cameras = {os.path.basename(image["path"]): image["camera"] for image in plan["images"]}
    x, y, heights = (a.ravel() for a in np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5), np.linspace(*truth["z_range"], 3)))
    errors, steps = [], []
    for view in truth["views"]:
        camera = cameras[view["file"]]
        rpc = {name: np.array(value) for name, value in camera["rpc"].items() if value is not None}
        degree_lat = 1.0 / METRES_PER_DEGREE
        degree_lon = degree_lat / np.cos(np.radians(rpc["lat_off"]))
        lon, lat = rpc["long_off"] + x * HALF_M * degree_lon, rpc["lat_off"] + y * HALF_M * degree_lat
        given = project(rpc, lon, lat, heights)
        true = given - np.array(view["pointing_error_px"])
        errors.append(corrected(camera["correction"], given) - true)
        moved = [project(rpc, lon + degree_lon, lat, heights), project(rpc, lon, lat + degree_lat, heights), project(rpc, lon, lat, heights + 1)]
        steps.append(np.stack([place - given for place in moved], -1))
    errors, steps = np.array(errors), np.array(steps)
    shared = np.linalg.lstsq(steps.reshape(-1, 3), errors.ravel(), rcond=None)[0]
    left = np.sqrt(((errors - steps @ shared) ** 2).sum(-1).mean(1))
    pointing = plan["report"]["pointing"]
    planted = max(float(np.hypot(*view["pointing_error_px"])) for view in truth["views"])
    return {"scene": os.path.basename(scene.rstrip("/")), "images": len(images), "planted_px": planted, "left_px": float(left.max()),
            "residual_px": pointing["residual_after_px"], "tracks": pointing["inliers"], "warnings": plan["warnings"]}


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("binary")
    arguments.add_argument("scenes", nargs="+", metavar="SCENE")
    arguments.add_argument("--out", default="benches/results")
    given = arguments.parse_args()
    rows = [measure(given.binary, scene) for scene in given.scenes]
    with open(f"{given.out}/pointing.json", "w") as file:
        json.dump(rows, file, indent=1, ensure_ascii=False)
    with open(f"{given.out}/pointing.md", "w") as file:
        within = sum(row["left_px"] <= WANTED_PX for row in rows)
        file.write("# What is left of planted pointing errors\n\nWritten by `benches/evidence/pointing.py`. The largest error of an image after a\n"
                   f"shift of the ground that all share is at most {WANTED_PX} px in {within} of {len(rows)} scenes.\n\n"
                   "| scene | images | planted, px | left, px | residual of the ties, px | tracks | warnings |\n|---|---|---|---|---|---|---|\n")
        for row in rows:
            file.write(f"| {row['scene']} | {row['images']} | {row['planted_px']:.2f} | {row['left_px']:.3f} | {row['residual_px']:.2f} | "
                       f"{row['tracks']} | {len(row['warnings'])} |\n")


if __name__ == "__main__":
    main()
