#!/usr/bin/env python3
"""Reference values for geodesy, computed without PROJ. Standard library only.

Writes beside itself:
  projections.txt  UTM by the transverse Mercator series of Krueger in the form of Karney (J. Geodesy 85, 2011), to n^6;
                   UPS by the closed polar stereographic formulas (EPSG guidance note 7-2, variant A)
  egm96.txt        undulations interpolated bilinearly in the grid of PROJ's egm96_15.gtx, read here by hand

  python3 generate.py [/usr/share/proj/egm96_15.gtx]
"""
import math
import pathlib
import random
import struct
import sys

A, F = 6378137.0, 1 / 298.257223563
E = math.sqrt(F * (2 - F))
HERE = pathlib.Path(__file__).parent

N = F / (2 - F)
RECTIFYING_RADIUS = A / (1 + N) * (1 + N**2 / 4 + N**4 / 64 + N**6 / 256)
ALPHA = [
    N / 2 - 2 * N**2 / 3 + 5 * N**3 / 16 + 41 * N**4 / 180 - 127 * N**5 / 288 + 7891 * N**6 / 37800,
    13 * N**2 / 48 - 3 * N**3 / 5 + 557 * N**4 / 1440 + 281 * N**5 / 630 - 1983433 * N**6 / 1935360,
    61 * N**3 / 240 - 103 * N**4 / 140 + 15061 * N**5 / 26880 + 167603 * N**6 / 181440,
    49561 * N**4 / 161280 - 179 * N**5 / 168 + 6601661 * N**6 / 7257600,
    34729 * N**5 / 80640 - 3418889 * N**6 / 1995840,
    212378941 * N**6 / 319334400,
]


def utm(zone, lon, lat):
    dlon = math.radians((lon - (6 * zone - 183) + 180) % 360 - 180)
    tau = math.tan(math.radians(lat))
    sigma = math.sinh(E * math.atanh(E * tau / math.hypot(1, tau)))
    conformal = tau * math.hypot(1, sigma) - sigma * math.hypot(1, tau)
    xi0 = math.atan2(conformal, math.cos(dlon))
    eta0 = math.asinh(math.sin(dlon) / math.hypot(conformal, math.cos(dlon)))
    xi = xi0 + sum(a * math.sin(2 * j * xi0) * math.cosh(2 * j * eta0) for j, a in enumerate(ALPHA, 1))
    eta = eta0 + sum(a * math.cos(2 * j * xi0) * math.sinh(2 * j * eta0) for j, a in enumerate(ALPHA, 1))
    k = 0.9996 * RECTIFYING_RADIUS
    return 500000 + k * eta, (0 if lat >= 0 else 10000000) + k * xi


def ups(lon, lat):
    north = lat >= 0
    phi = math.radians(abs(lat))
    t = math.tan(math.pi / 4 - phi / 2) * ((1 + E * math.sin(phi)) / (1 - E * math.sin(phi))) ** (E / 2)
    rho = 2 * A * 0.994 * t / math.sqrt((1 + E) ** (1 + E) * (1 - E) ** (1 - E))
    x, y = rho * math.sin(math.radians(lon)), rho * math.cos(math.radians(lon))
    return 2000000 + x, 2000000 + (-y if north else y)


def projections():
    random.seed(2)
    cases = [(179.9999, -17.0), (-179.9999, -17.0), (-81.66, 30.34), (55.6, -21.1), (5.4, 43.3), (31.13, 29.98)]
    cases += [(random.uniform(-180, 180), random.uniform(-79.9, 83.9)) for _ in range(40)]
    lines = ["# EPSG code, longitude and latitude (degrees), easting and northing (metres)"]
    for lon, lat in cases:
        zone = int((lon + 180) // 6) + 1
        for z in sorted({zone, zone % 60 + 1}):  # the neighbouring zone too: up to 9 degrees from its meridian
            x, y = utm(z, lon, lat)
            lines.append(f"{(32600 if lat >= 0 else 32700) + z} {lon!r} {lat!r} {x:.6f} {y:.6f}")
    for lon, lat in [(random.uniform(-180, 180), s * random.uniform(80, 89.999)) for s in (1, -1) for _ in range(10)]:
        x, y = ups(lon, lat)
        lines.append(f"{5041 if lat >= 0 else 5042} {lon!r} {lat!r} {x:.6f} {y:.6f}")
    (HERE / "projections.txt").write_text("\n".join(lines) + "\n")


def egm96(grid):
    data = pathlib.Path(grid).read_bytes()
    south, west, dlat, dlon, rows, columns = struct.unpack(">ddddii", data[:40])

    def node(row, column):
        return struct.unpack_from(">f", data, 40 + 4 * (row * columns + column % columns))[0]

    random.seed(3)
    cases = [(-81.66, 30.34), (55.6, -21.1), (5.4, 43.3), (31.13, 29.98), (179.95, 10.0), (-179.95, 10.0)]
    cases += [(random.uniform(-180, 180), random.uniform(-89, 89)) for _ in range(30)]
    lines = ["# longitude and latitude (degrees), undulation of EGM96 above the WGS 84 ellipsoid (metres)"]
    for lon, lat in cases:
        u, v = (lon - west) % 360 / dlon, (lat - south) / dlat
        i, j = int(u), int(v)
        fu, fv = u - i, v - j
        low = node(j, i) * (1 - fu) + node(j, i + 1) * fu
        high = node(j + 1, i) * (1 - fu) + node(j + 1, i + 1) * fu
        lines.append(f"{lon!r} {lat!r} {low * (1 - fv) + high * fv:.5f}")
    (HERE / "egm96.txt").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    projections()
    egm96(sys.argv[1] if len(sys.argv) > 1 else "/usr/share/proj/egm96_15.gtx")
