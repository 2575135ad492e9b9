"""Projections by rpcm (PyPI) of a dozen points of each RPC's validity cube, for tests/rpc_reference.rs.

Usage: python rpc_rpcm.py SHARED_DATA > rpc_rpcm.txt      (needs rpcm, rasterio, numpy)

Every file below SHARED_DATA/rpc and SHARED_DATA/stereo from which rpcm gets a model, by its own readers where it has
one for the format. Where it has none (OSSIM .geom, .RPB, rpcm's own attributes as JSON), the entries are picked from
the text here and given to rpcm's model as they stand, so that the arithmetic is still rpcm's.
"""

import json
import os
import re
import sys
import warnings

import rpcm
from rpcm.rpc_model import RPCModel

warnings.filterwarnings("ignore")

POINTS = 12
OFFSETS = ["LINE_OFF", "SAMP_OFF", "LAT_OFF", "LONG_OFF", "HEIGHT_OFF"]
SCALES = ["LINE_SCALE", "SAMP_SCALE", "LAT_SCALE", "LONG_SCALE", "HEIGHT_SCALE"]
COEFFICIENTS = ["LINE_NUM_COEFF", "LINE_DEN_COEFF", "SAMP_NUM_COEFF", "SAMP_DEN_COEFF"]


def text_of(path):
    with open(path, encoding="latin-1") as f:
        return f.read()


def from_geom(path):
    text = text_of(path)
    value = lambda key: re.search(rf"^(?:\S*\.)?{key}:\s*(\S+)", text, re.M).group(1)
    names = {k: value(k.lower()) for k in OFFSETS + SCALES}
    many = {k: " ".join(value(f"{k.lower()}_{i:02d}") for i in range(20)) for k in COEFFICIENTS}
    return RPCModel(names | many)


def from_rpb(path):
    text = text_of(path)
    value = lambda key: re.search(rf"\b{key}\s*=\s*([^;(]+);", text).group(1)
    many = lambda key: " ".join(re.search(rf"\b{key}\s*=\s*\(([^)]*)\)", text).group(1).replace(",", " ").split())
    kinds = {"LINE": "line", "SAMP": "samp", "LAT": "lat", "LONG": "long", "HEIGHT": "height"}
    names = {k: value(kinds[k.split("_")[0]] + k.split("_")[1].title().replace("Off", "Offset")) for k in OFFSETS + SCALES}
    keys = dict(zip(COEFFICIENTS, ["lineNumCoef", "lineDenCoef", "sampNumCoef", "sampDenCoef"]))
    return RPCModel(names | {k: many(v) for k, v in keys.items()})


def from_json(path):
    found = json.loads(text_of(path))
    return RPCModel(found.get("rpc", found), dict_format="rpcm")


READERS = [
    ("rpcm", rpcm.rpc_from_rpc_file),
    ("rpcm", rpcm.rpc_from_geotiff),
    ("text", from_geom),
    ("text", from_rpb),
    ("text", from_json),
]


def model(path):
    for how, reader in READERS:
        try:
            m = reader(path)
            m.projection(m.lon_offset, m.lat_offset, m.alt_offset)
            if all(len(c) == 20 for c in (m.row_num, m.row_den, m.col_num, m.col_den)):
                return how, m
        except Exception:
            continue
    return None


def main(root):
    print(f"# Written by rpc_rpcm.py, rpcm {version()}. PATH | READ BY | LON LAT HEIGHT | SAMPLE LINE")
    files = [os.path.join(d, f) for part in ("rpc", "stereo") for d, _, fs in os.walk(os.path.join(root, part)) for f in fs]
    for path in sorted(files):
        found = model(path)
        if found is None:
            continue
        how, m = found
        for i in range(1, POINTS + 1):
            # The additive recurrence of the plastic number's relatives: even cover without a random generator.
            a, b, c = (2 * (i * s % 1) - 1 for s in (0.8191725133961645, 0.6710436067037893, 0.5497004779019703))
            lon = m.lon_offset + a * m.lon_scale
            lat = m.lat_offset + b * m.lat_scale
            alt = m.alt_offset + c * m.alt_scale
            col, row = m.projection(lon, lat, alt)
            print(f"{os.path.relpath(path, root)} | {how} | {lon!r} {lat!r} {alt!r} | {float(col)!r} {float(row)!r}")


def version():
    from importlib.metadata import version

    return version("rpcm")


if __name__ == "__main__":
    main(sys.argv[1])
