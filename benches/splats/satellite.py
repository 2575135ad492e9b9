#!/usr/bin/env python3
"""Splats of satellite images before and after training, judged by an image that was not trained on.

Simulated towns: three images with exact RPCs make a surface model (`skysweep dsm`), splats (`skysweep splats`), and train
these (`skysweep train --splats`). A fourth image of the same scene is judged, and the heights of the splats are held
against the exact surface. With --jax also JAX_068: images of four dates make a surface model with cells of a metre and
are so registered with each other; splats are made of three of them and trained on these; the fourth date is judged.

    python3 benches/splats/satellite.py target/release/skysweep [--seeds 1] [--jax DIR] [--work DIR]

Needs Python alone. Writes benches/results/splat_satellite.json and splat_satellite.md.
"""
import argparse
import json
import pathlib
import re
import subprocess
import tempfile

RESULTS = pathlib.Path(__file__).resolve().parents[1] / "results"
SIZE_M = 80
ITERATIONS = 400
JAX_ITERATIONS = 200


def run(*words):
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def simulated(program, work, seed):
    work.mkdir(parents=True, exist_ok=True)
    template = subprocess.run([program, "simulate", "town", "--template"], check=True, capture_output=True, text=True)
    text = template.stdout
    for key, value in [("pointing_error_px", "[0.0, 0.0]"), ("size_m", float(SIZE_M)), ("views", 4), ("seed", seed)]:
        text, count = re.subn(rf"(?m)^{key} = .*", f"{key} = {value}", text)
        assert count == 1, key
    (work / "in.toml").write_text(text)
    run(program, "simulate", work / "in.toml", "-o", work / "scene", "--overwrite", "--progress", "none")
    images = [work / "scene" / f"view_{k}.tif" for k in (1, 2, 3, 4)]
    run(program, "dsm", *images[:3], "-o", work / "run", "--overwrite")
    return images[:3], images[3], work / "run/dsm/dsm.tif", work / "scene/truth/dsm.tif", []


def jax(program, work, data):
    images = sorted((data / "images").glob("*.tif"))[:4]
    if not (work / "run/dsm/dsm.tif").is_file():
        run(program, "dsm", *images, "--gsd", "1", "-o", work / "run", "--overwrite")
    truth = data / "truth/JAX_068_DSM_georef.tif"
    return images[:3], images[3], work / "run/dsm/dsm.tif", truth, ["--corrections", work / "run/report/report.json"]


def mae(program, test, truth, folder):
    """Mean absolute error of heights over the cells that both cover, metres, the alignment removed."""
    run(program, "eval", test, truth, "--align", "xyz", "-o", folder, "--overwrite")
    return json.loads((folder / "report.json").read_text())["metrics"]["mae"]


def measure(program, work, name, inputs, iterations):
    images, judged, dsm, truth, corrections = inputs
    splats = work / "splats.ply"
    run(program, "splats", dsm, *images, "--form", "2d", "-o", splats, "--overwrite")
    row = {"scene": name, "iterations": iterations, "mae_surface_m": mae(program, dsm, truth, work / "eval_surface")}
    # One iteration shows the splats as they are before.
    for label, count in [("before", 1), ("after", iterations)]:
        out = work / f"trained_{label}"
        run(program, "train", *images, "--splats", splats, "--dsm", dsm, "--judge", judged, *corrections,
            "--iterations", count, "-o", out, "--overwrite")
        row[f"mae_{label}_m"] = mae(program, out / "dsm.tif", truth, work / f"eval_{label}")
    trained = json.loads((work / "trained_after/report.json").read_text())
    row.update(splats_before=trained["splats_before"], splats=trained["splats_after"], seconds=trained["seconds"],
               transient_share=trained["transient_share"], camera_error_px=trained["camera_error_px"])
    for held_out, key in [(True, "judged"), (False, "trained")]:
        views = [view for view in trained["views"] if view["held_out"] == held_out]
        for value in ("psnr_before_db", "psnr_db", "ssim_before", "ssim"):
            row[f"{key}_{value}"] = sum(view[value] for view in views) / len(views)
    # The files of the splats as the other renderer shows them.
    for label, file in [("before", splats), ("after", work / "trained_after/splats.ply")]:
        seen = work / f"seen_{label}"
        run(program, "splats", "render", file, judged, *corrections, "-o", seen, "--overwrite")
        view = json.loads((seen / "report.json").read_text())["views"][0]
        row[f"render_psnr_{label}_db"], row[f"render_ssim_{label}"] = view["psnr_db"], view["ssim"]
    print(row, flush=True)
    return row


def table(rows):
    out = [
        "# Splats of satellite images before and after training\n",
        f"Written by `benches/splats/satellite.py`: simulated towns of {SIZE_M} m at 0.5 m with exact RPCs, three images to train",
        "on, a fourth one of the same date to judge, after a gain and an offset. Errors of heights are mean absolute errors",
        "against the exact surface (JAX_068: the LiDAR surface), after alignment: of the surface model that the splats are",
        "made of, of the splats before and of the splats after the training. `render` is `skysweep splats render`, another",
        "rasteriser. On JAX_068 the judged date helped to make the surface model, which registers it; its colours are new.",
        "Seconds are those of the iterations on two cores that other work shared, here with several compilers.\n",
        "| scene | splats (before) | judged PSNR, dB (before) | SSIM (before) | trained PSNR, dB (before) | render PSNR, dB (before) "
        "| heights: model, before, after, m | iterations | s |",
        "|---|---|---|---|---|---|---|--:|--:|",
    ]
    for r in rows:
        out.append(
            f"| {r['scene']} | {r['splats']} ({r['splats_before']}) | {r['judged_psnr_db']:.2f} ({r['judged_psnr_before_db']:.2f}) "
            f"| {r['judged_ssim']:.3f} ({r['judged_ssim_before']:.3f}) | {r['trained_psnr_db']:.2f} "
            f"({r['trained_psnr_before_db']:.2f}) | {r['render_psnr_after_db']:.2f} ({r['render_psnr_before_db']:.2f}) "
            f"| {r['mae_surface_m']:.3f}, {r['mae_before_m']:.3f}, {r['mae_after_m']:.3f} | {r['iterations']} "
            f"| {r['seconds']:.0f} |")
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--jax", type=pathlib.Path, help="folder of JAX_068 with images and truth")
    parser.add_argument("--work", type=pathlib.Path)
    args = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        work = args.work or pathlib.Path(folder)
        for seed in args.seeds:
            place = work / str(seed)
            rows.append(measure(args.program, place, f"town, seed {seed}", simulated(args.program, place, seed), ITERATIONS))
        if args.jax:
            place = work / "jax"
            place.mkdir(parents=True, exist_ok=True)
            rows.append(measure(args.program, place, "JAX_068", jax(args.program, place, args.jax), JAX_ITERATIONS))
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "splat_satellite.json").write_text(json.dumps(rows, indent=1) + "\n")
    (RESULTS / "splat_satellite.md").write_text(table(rows))


if __name__ == "__main__":
    main()
