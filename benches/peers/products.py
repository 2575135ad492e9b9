"""Checks the products of a run with programs of others; see products.sh.

    python benches/peers/products.py RUN RESULTS
"""

import json
import math
import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import laspy
import numpy as np
import rasterio
from laspy.copc import CopcReader
from pyproj import CRS, Transformer

VALIDATE_GLB = """
const validator = require('gltf-validator'), fs = require('fs');
(async () => {
  const found = { files: 0, errors: 0, warnings: 0, triangles: 0 };
  for (const name of fs.readFileSync(0, 'utf8').split('\\n').filter(Boolean)) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(name)));
    found.files += 1;
    found.errors += report.issues.numErrors;
    found.warnings += report.issues.numWarnings;
    found.triangles += report.info.totalTriangleCount;
  }
  console.log(JSON.stringify(found));
})();
"""


def raster(path):
    """Returns the first band of a raster, with its mask and transform."""
    with rasterio.open(path) as file:
        return file.read(1), file.read_masks(1) != 0, file.transform


def check_cloud(path, run, says):
    """Compares a LAZ file with the rasters of the run."""
    heights, known, transform = raster(run / "dsm/dsm.tif")
    source = raster(run / "dsm/source.tif")[0]
    wanted = known & (source == 1)
    cloud = laspy.read(path)
    header = cloud.header
    columns, rows = ~transform * (np.asarray(cloud.x), np.asarray(cloud.y))
    cells = (rows.astype(int), columns.astype(int))
    seen = np.zeros_like(wanted)
    seen[cells] = True
    sigma, views = raster(run / "dsm/sigma.tif")[0], raster(run / "dsm/views.tif")[0]
    confidence = raster(run / "dsm/confidence.tif")[0]
    bounds = [header.mins, header.maxs]
    extent = [[np.min(a), np.max(a)] for a in (cloud.x, cloud.y, cloud.z)]
    found = {
        "points": int(header.point_count),
        "points are those of the report": int(header.point_count) == says["points"] == len(cloud.points),
        "every observed cell has one point": bool((seen == wanted).all() and len(cloud.points) == wanted.sum()),
        "heights within 0.6 mm": bool(np.abs(np.asarray(cloud.z) - heights[cells]).max() < 6e-4),
        "bounds of the header": bool(np.allclose(np.array(bounds).T, extent, atol=1e-9)),
        "sigma, confidence, views and source": bool(
            (cloud.sigma_m == sigma[cells]).all()
            and (cloud.confidence == confidence[cells]).all()
            and (cloud.views == views[cells]).all()
            and (cloud.source == source[cells]).all()
        ),
        "types of the extra dimensions": [str(cloud[n].dtype) for n in ("sigma_m", "confidence", "views", "source")]
        == ["float32", "float32", "uint8", "uint8"],
        "has colours": bool(np.ptp(cloud.red) > 1000),
    }
    crs = header.parse_crs()
    wanted_crs = CRS.from_user_input(says["crs"])
    found["horizontal reference system"] = crs.to_2d().to_epsg() == wanted_crs.to_2d().to_epsg()
    found["reference system has heights"] = len(crs.axis_info) == 3 or crs.is_compound
    return found


def check_copc(path):
    """Reads one level of detail and all points."""
    reader = CopcReader.open(str(path))
    levels = []
    while sum(levels) < reader.header.point_count and len(levels) < 30:
        levels.append(len(reader.query(level=len(levels))))
    middle = 0.5 * (reader.header.mins + reader.header.maxs)
    west = reader.query(bounds=laspy.copc.Bounds(mins=reader.header.mins[:2], maxs=middle[:2]))
    inside = (west.x <= middle[0]).all() and (west.y <= middle[1]).all()
    return {
        "points of the levels": levels,
        "levels hold all points": sum(levels) == reader.header.point_count == len(reader.query()),
        "a window holds its points": bool(inside and 0 < len(west) < reader.header.point_count),
    }


def check_glb(names):
    """Runs gltf-validator."""
    text = "\n".join(str(name) for name in names)
    done = subprocess.run(["node", "-e", VALIDATE_GLB], input=text, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def check_tileset(products, says, crs_name):
    """Reads the tileset with py3dtiles, and places its vertices on the map."""
    from py3dtiles.tileset import TileSet

    tileset = TileSet.from_file(products / "tileset.json")
    crs = CRS.from_user_input(crs_name).to_3d()
    to_map = Transformer.from_crs("EPSG:4978", crs, always_xy=True)
    heights, known, transform = raster(products.parent / "dsm/dsm.tif")
    found = {"tiles": 0, "largest distance of a vertex of the finest tiles from the surface, metres": 0.0}
    # The grids of geoids are not in the wheels of pyproj.
    is_ellipsoidal = not CRS.from_user_input(crs_name).is_compound

    def walk(tile, error):
        assert tile.geometric_error <= error
        found["tiles"] += 1
        glb = tile.get_or_fetch_content(products)._gltf
        positions = np.frombuffer(glb.binary_blob(), "<f4", 3 * glb.accessors[0].count).reshape(-1, 3)
        x, y, z = (positions.astype(float) + glb.nodes[0].translation).T
        # y up to z up, then by the transform of the root.
        local = np.stack([x, -z, y, np.ones_like(x)])
        if not tile.children and is_ellipsoidal:
            east, north, up = to_map.transform(*(tileset.root_tile.transform @ local)[:3])
            columns, rows = ~transform * (np.asarray(east), np.asarray(north))
            cells = (np.rint(rows - 0.5).astype(int), np.rint(columns - 0.5).astype(int))
            off = np.hypot(columns - 0.5 - cells[1], rows - 0.5 - cells[0]).max()
            # Skirts hang below the surface, and their tops are vertices, too.
            above = (np.asarray(up) - heights[cells]).max()
            name = "largest distance of a vertex of the finest tiles from the surface, metres"
            found[name] = max(found[name], float(max(above, off * abs(transform.a))))
        for child in tile.children:
            walk(child, tile.geometric_error)

    walk(tileset.root_tile, tileset.geometric_error)
    found["tiles are those of the report"] = found["tiles"] == says["tiles"]
    name = "largest distance of a vertex of the finest tiles from the surface, metres"
    found[name] = round(found[name], 4)
    found["vertices lie on the surface"] = not is_ellipsoidal or found[name] < 0.01
    return found


def check_schema(tileset, folder):
    """Checks the tileset against the schema in a folder."""
    from jsonschema import Draft202012Validator
    from referencing import Registry
    from referencing.jsonschema import DRAFT202012

    files = {path: json.loads(path.read_text()) for path in Path(folder).rglob("*.schema.json")}
    resources = [(path.resolve().as_uri(), DRAFT202012.create_resource(schema)) for path, schema in files.items()]
    registry = Registry().with_resources(resources)
    start = {"$ref": (Path(folder).resolve() / "tileset.schema.json").as_uri()}
    errors = list(Draft202012Validator(start, registry=registry).iter_errors(json.loads(tileset.read_text())))
    return {"schema files": len(files), "satisfies the schema": not errors, "errors": [e.message for e in errors[:5]]}


def check_contours(path, says):
    """Reads the GeoPackage with SQLite."""
    with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as file:
        count, low, high = file.execute("select count(*), min(elevation), max(elevation) from contours").fetchone()
        place = file.execute("select srs_id, z from gpkg_geometry_columns").fetchone()
        levels = [row[0] for row in file.execute("select distinct elevation from contours")]
    steps = [level / says["interval"] for level in levels]
    return {
        "lines": count,
        "lines are those of the report": count == says["lines"],
        "elevations": [low, high],
        "elevations are multiples of the interval": all(math.isclose(s, round(s), abs_tol=1e-6) for s in steps),
        "has a reference system and heights": place[0] > 0 and place[1] == 1,
    }


def check_cogs(names):
    from rio_cogeo.cogeo import cog_validate

    return {str(name.name): cog_validate(str(name))[0] for name in names}


def main():
    run, results = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
    products = run / "products"
    says = json.loads((products / "products.json").read_text())
    found = {
        "LAZ (laspy, lazrs)": check_cloud(products / "cloud.laz", run, says["cloud"]),
        "COPC as LAZ (laspy, lazrs)": check_cloud(products / "cloud.copc.laz", run, says["cloud"]),
        "COPC (laspy)": check_copc(products / "cloud.copc.laz"),
        "GLB (gltf-validator)": check_glb([products / "mesh.glb", *sorted(products.glob("tiles/*/*.glb"))]),
        "3D Tiles (py3dtiles, pyproj)": check_tileset(products, says["mesh"], says["cloud"]["crs"]),
        "contour lines (SQLite)": check_contours(products / "contours.gpkg", says["contours"]),
        "COG (rio-cogeo)": check_cogs([*sorted(products.glob("*.tif")), *sorted(products.glob("dtm/*.tif"))]),
    }
    found["GLB (gltf-validator)"]["no errors"] = found["GLB (gltf-validator)"]["errors"] == 0
    if schema := os.environ.get("TILES_SCHEMA"):
        found["3D Tiles (schema of CesiumGS/3d-tiles)"] = check_schema(products / "tileset.json", schema)
    wrong = [f"{what}: {name}" for what, checks in found.items() for name, value in checks.items() if value is False]
    (results / "products.json").write_text(json.dumps({"checks": found, "wrong": wrong}, indent=2) + "\n")
    lines = ["# Products read by other programs", "", "Made by `benches/peers/products.sh`.", ""]
    for what, checks in found.items():
        lines += [f"## {what}", "", "| check | found |", "|---|---|"]
        words = {True: "yes", False: "**no**"}
        lines += [f"| {n} | {words[v] if isinstance(v, bool) else v} |" for n, v in checks.items() if v != []] + [""]
    (results / "products.md").write_text("\n".join(lines))
    print("\n".join(wrong) or "all checks passed")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
