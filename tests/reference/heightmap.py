"""Writes heightmap.txt: what height maps of data-samples/town must hold, by rasterio, pyproj and NumPy alone.

Run from the root of the project: python tests/reference/heightmap.py

Sections:
  place      column row lon lat height of 1,000 random pixels of the tile with heading 37: the position comes from metres right of
             and before the camera through PROJ's topocentric frame, the height from the DSM between four cells (SciPy);
             nan where the DSM has none
  warp       column row height of 500 random pixels of the tile with heading 0, by rasterio's warp of the DSM (bilinear)
  roof       column row height of random pixels of the tile with heading 37 of the city model: the highest polygon that holds the
             place, by even-odd rule and the plane through its vertices, nan where none does; places within 5 mm of an edge
             are left out
  point      x y z of the points of a cloud (UTM 31N)
  cell       column row height of the highest point of each pixel of the cloud's tile with heading -23, for those with a point
Heights are metres above the ellipsoid.
"""

import json

import numpy as np
import pyproj
import rasterio
from rasterio.warp import Resampling, reproject
from scipy.ndimage import map_coordinates

TOWN = "data-samples/town/truth"
LON, LAT, SIZE, R, HEADING = 5.4, 43.53, 518, 2.0, 37.0
rng = np.random.default_rng(20261121)

dsm = rasterio.open(f"{TOWN}/dsm.tif")
cells = dsm.read(1).astype(float)
cells[cells == dsm.nodata] = np.nan
utm = pyproj.Transformer.from_crs(4326, dsm.crs, always_xy=True)


def between_cells(x, y):
    column, row = ~dsm.transform * (np.atleast_1d(x), np.atleast_1d(y))
    return map_coordinates(cells, [row - 0.5, column - 0.5], order=1, cval=np.nan, prefilter=False)


ground = float(between_cells(*utm.transform(LON, LAT))[0])
frame = pyproj.Transformer.from_pipeline(
    f"+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84 +lon_0={LON!r} +lat_0={LAT!r} +h_0={ground!r} "
    "+step +inv +proj=cart +ellps=WGS84 +step +proj=unitconvert +xy_in=rad +xy_out=deg"
)


def lonlat(column, row, heading):
    right, ahead = (column - (SIZE - 1) / 2) / R, ((SIZE - 1) / 2 - row) / R
    a = np.radians(heading)
    east, north = right * np.cos(a) + ahead * np.sin(a), -right * np.sin(a) + ahead * np.cos(a)
    lon, lat, _ = frame.transform(east, north, np.zeros_like(east))
    return lon, lat


def random_pixels(count):
    return rng.integers(0, SIZE, count), rng.integers(0, SIZE, count)


out = open("tests/reference/heightmap.txt", "w")
print(f"# by tests/reference/heightmap.py: rasterio {rasterio.__version__}, pyproj {pyproj.__version__} "
      f"(PROJ {pyproj.proj_version_str}), numpy {np.__version__}", file=out)

# A raster, turned.
c, r = random_pixels(1000)
lon, lat = lonlat(c, r, HEADING)
for row in zip(c, r, lon, lat, between_cells(*utm.transform(lon, lat))):
    print("place %d %d %.12f %.12f %.5f" % row, file=out)

# A raster, north up: the tile's map is a transverse Mercator at the camera with the scale of the ground there.
semi, e2 = 6378137.0, 0.0066943799901413165
w = 1 - e2 * np.sin(np.radians(LAT)) ** 2
k = float(1 + ground / np.sqrt(semi / np.sqrt(w) * semi * (1 - e2) / w**1.5))
half = SIZE / R / 2
target = np.full((SIZE, SIZE), np.nan)
reproject(
    cells, target, src_transform=dsm.transform, src_crs=dsm.crs, src_nodata=np.nan, dst_nodata=np.nan,
    dst_transform=rasterio.Affine(1 / R, 0, -half, 0, -1 / R, half),
    dst_crs=f"+proj=tmerc +lat_0={LAT!r} +lon_0={LON!r} +k={k!r} +datum=WGS84",
    resampling=Resampling.bilinear, tolerance=0.0,
)
for c, r in zip(*random_pixels(500)):
    print("warp %d %d %.5f" % (c, r, target[r, c]), file=out)

# A city model: the uppermost polygon over each place.
city = json.load(open(f"{TOWN}/buildings.city.json"))
vertices = np.array(city["vertices"]) * city["transform"]["scale"] + city["transform"]["translate"]
rings = [ring for o in city["CityObjects"].values() for g in o["geometry"] for shell in g["boundaries"]
         for polygon in shell for ring in [vertices[polygon[0]]] if len(polygon) == 1 or exit("a polygon has holes")]


def roof(x, y):
    best = np.nan
    for ring in rings:
        p, q = ring[:, :2] - (x, y), np.roll(ring[:, :2], -1, axis=0) - (x, y)
        if (p.min(0) > 0.01).any() or (p.max(0) < -0.01).any():
            continue
        d = q - p
        t = np.clip(-(p * d).sum(1) / np.maximum((d * d).sum(1), 1e-12), 0, 1)
        if np.hypot(*(p + t[:, None] * d).T).min() < 0.005:
            return None
        crosses = (p[:, 1] > 0) != (q[:, 1] > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside = (crosses & (p[:, 0] + d[:, 0] * -p[:, 1] / d[:, 1] > 0)).sum() % 2
        if not inside:
            continue
        centre = ring.mean(0)
        normal = np.linalg.svd(ring - centre)[2][2]
        z = centre[2] - (normal[0] * (x - centre[0]) + normal[1] * (y - centre[1])) / normal[2]
        best = np.fmax(best, z)
    return best


c, r = random_pixels(1000)
for row in zip(c, r, *utm.transform(*lonlat(c, r, HEADING))):
    height = roof(row[2], row[3])
    if height is not None:
        print("roof %d %d %.4f" % (row[0], row[1], height), file=out)

# A cloud: points on a coarse random surface, the highest of each pixel.
x0, y0 = utm.transform(LON, LAT)
points = np.column_stack([x0 + rng.uniform(-6, 6, 2500), y0 + rng.uniform(-6, 6, 2500), 200 + rng.uniform(0, 30, 2500)]).round(3)
for p in points:
    print("point %.3f %.3f %.3f" % tuple(p), file=out)
to_lonlat = pyproj.Transformer.from_crs(dsm.crs, 4979, always_xy=True)
lon, lat = to_lonlat.transform(points[:, 0], points[:, 1])
middle = (points[:, 2].min() + points[:, 2].max()) / 2
to_frame = pyproj.Transformer.from_pipeline(
    "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
    f"+step +proj=topocentric +ellps=WGS84 +lon_0={LON!r} +lat_0={LAT!r} +h_0={middle!r}"
)
east, north, _ = to_frame.transform(lon, lat, np.full_like(lon, middle))
a = np.radians(-23.0)
right, ahead = east * np.cos(a) - north * np.sin(a), east * np.sin(a) + north * np.cos(a)
size, r_points = 24, 2.0
u, v = right * r_points + size / 2, size / 2 - ahead * r_points
highest = np.full((size, size), -np.inf)
inside = (u >= 0) & (u < size) & (v >= 0) & (v < size)
np.maximum.at(highest, (v[inside].astype(int), u[inside].astype(int)), points[inside, 2])
edge = np.minimum(np.abs(u - u.round()), np.abs(v - v.round())).min()
print(f"# the point nearest to an edge of a pixel is {edge:.6f} px from it", file=out)
for r, c in zip(*np.nonzero(np.isfinite(highest))):
    print("cell %d %d %.3f" % (c, r, highest[r, c]), file=out)
