#!/usr/bin/env python3
"""Checks the STAC item and collection of runs with pystac, against the schemas in this repository, without network.

    benches/peers/stac.py RUN… [--venv FOLDER]

pystac comes from PyPI into FOLDER (default target/stac-venv); neither the build nor the tests need it. Exits with 1 when
a file is not valid, a link leads nowhere, or an asset does not have the shape, place and type that the item says.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
PACKAGES = ["pystac[validation]==1.15.2", "rasterio"]


def in_environment(folder):
    """Starts this script again with a python that has the packages."""
    python = folder / "bin/python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *PACKAGES], check=True)
    if pathlib.Path(sys.prefix).resolve() != folder.resolve():
        os.execv(python, [python, *sys.argv])


def offline_io():
    """Returns a reader of pystac that finds the schemas of the extensions in this repository."""
    import pystac

    schemas = {}
    for path in (ROOT / "benches/peers/schemas").glob("*.json"):
        text = path.read_text()
        schemas[json.loads(text)["$id"].rstrip("#")] = text

    class Offline(pystac.StacIO.default().__class__):
        def read_text(self, source, *args, **kwargs):
            return schemas.get(str(source)) or super().read_text(source, *args, **kwargs)

    pystac.StacIO.set_default(Offline)


def check(run):
    """Returns what is wrong with a run."""
    import pystac
    import rasterio

    wrong = []
    item = pystac.Item.from_file(str(run / "stac/item.json"))
    collection = pystac.Collection.from_file(str(run / "stac/collection.json"))
    for thing in (item, collection):
        try:
            thing.validate()
        except pystac.errors.STACValidationError as error:
            wrong.append(f"{thing}: {error}")
    if [found.id for found in collection.get_items()] != [item.id] or item.get_collection().id != collection.id:
        wrong.append("item and collection do not lead to each other")
    for name, asset in item.assets.items():
        path = pathlib.Path(asset.get_absolute_href())
        if not path.is_file():
            wrong.append(f"{name}: {path} is missing")
        elif path.suffix == ".tif":
            with rasterio.open(path) as raster:
                band = asset.extra_fields["bands"][0]
                said = (item.properties["proj:shape"], item.properties["proj:transform"], band["data_type"], band["nodata"])
                found = (list(raster.shape), list(raster.transform)[:6], raster.dtypes[0], raster.nodata)
                if said != found or band["name"] != raster.descriptions[0]:
                    wrong.append(f"{name}: the item says {said}, the file {found}")
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=pathlib.Path, metavar="RUN")
    parser.add_argument("--venv", type=pathlib.Path, default=ROOT / "target/stac-venv")
    arguments = parser.parse_args()
    in_environment(arguments.venv)
    offline_io()
    failed = False
    for run in arguments.runs:
        wrong = check(run.resolve())
        print(f"{run}: {'valid' if not wrong else 'not valid'}", *wrong, sep="\n  ")
        failed |= bool(wrong)
    sys.exit(failed)


if __name__ == "__main__":
    main()
