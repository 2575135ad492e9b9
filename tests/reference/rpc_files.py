"""Writes rpc_files.txt: what every file of the shared RPC collection holds, by tools that are not ours.

    /tmp/venv/bin/python tests/reference/rpc_files.py ../shared/data/rpc > tests/reference/rpc_files.txt

Offsets come from rasterio (GDAL's RPC metadata), else rpcm, else a plain search for the keys in the text. Lines:
    PATH | FORMAT | LONG_OFF LAT_OFF LINE_OFF SAMP_OFF | tool
    PATH | refused | reason
"""
import json
import os
import re
import sys
import warnings

import rasterio
import rpcm

warnings.filterwarnings("ignore")

# Why a file without an RPC is in the collection.
REFUSED = {
    r"\.IMD$": "DigitalGlobe image metadata, the RPC is in the RPB beside it",
    r"md_eros\.pass$": "EROS pass metadata, the RPC is in the .rpc beside it",
    r"md_ge_metadata\.txt$": "GeoEye product metadata, the RPC is in _rpc.txt",
    r"md_kompsat\.txt$": "KOMPSAT product metadata, the RPC is in the .rpc beside it",
    r"md_ov\.pvl$": "OrbView's own names and rounded values, the RPC is in _rpc.txt",
    r"DIM_.*\.XML$|STRIP_foo_DIM\.XML$|VOL_PHR\.XML$": "DIMAP document that names an RPC file and holds none",
    r"RPC_foo\.XML$|RPC_PNEO3|IMG_foo|IMG_PNEO3": "stripped test document: names of the entries in place of their values",
    r"unstable_rpc_with_dem_(blank_output|elevation)\.tif$": "georeferenced image without RPC",
    r"SPOT5_.*\.geom$": "SPOT 5's physical model, not an RPC",
    r"PHRDIMAP_": "Pleiades system product with local models, no global RFM in DIMAP form",
    r"fake_rpc\.txt$": "the word FAKE",
}

# How the formats are told apart by name; only the ones that GDAL's metadata cannot name.
FORMATS = [
    (r"\.geom$", "ossim-geom"), (r"\.RPB$", "rpb"), (r"RPC-md_alos\.txt$|IMG-md_alos\.tif$", "alos"),
    (r"\.vrt$|rpc_unsupported\.xml$", "vrt"), (r"envirpc\.hdr$", "envi-header"), (r"\.json$", "json"),
    (r"RPC_.*\.XML$|IMG_md_\w+_R1C1\.jp2$|rpc_(PLEIADES|SPOT6)\.xml$", "dimap"), (r"\.(xml|XML)$", "digital-globe-xml"),
    (r"\.(txt|TXT|rpc)$", "text"),
    (r"/(md_\w+\.tif|envirpc\.img)$", "gdal-metadata"), (r"\.tif$", "tiff-tag"),
]


def from_rasterio(path):
    with rasterio.open(path) as src:
        d = src.tags(ns="RPC")
    return [float(d[k].split()[0]) for k in ("LONG_OFF", "LAT_OFF", "LINE_OFF", "SAMP_OFF")], "rasterio"


def from_rpcm(path):
    r = rpcm.rpc_from_rpc_file(path)
    return [r.lon_offset, r.lat_offset, r.row_offset, r.col_offset], "rpcm"


def from_text(path):
    text = open(path, errors="replace").read()
    if path.endswith("md_alos.tif"):
        text = open(path.replace("IMG-md_alos.tif", "RPC-md_alos.txt")).read()
    if text.startswith("0040000"):
        return [float(text[19:28]), float(text[11:19]), float(text[0:6]), float(text[6:11])], "columns"
    if text.startswith("ENVI"):
        v = [float(x) for x in text.split("rpc info = {")[1].split("}")[0].split(",")]
        return [v[3], v[2], v[0], v[1]], "columns"
    keys = ("long_?off", "lat_?off", "line_?off", "samp_?off")
    found = [re.search(rf"^\s*{k}(?:set)?\s*[:=]\s*([-+\d.eE]+)", text, re.M | re.I) for k in keys]
    return [float(m.group(1)) for m in found], "text search"


def offsets(path):
    for tool in (from_rasterio, from_rpcm, from_text):
        try:
            return tool(path)
        except Exception:
            continue
    raise SystemExit(f"no tool reads {path}: is it to be refused?")


def main(root):
    version = f"rasterio {rasterio.__version__}, GDAL {rasterio.__gdal_version__}, rpcm 1.4.10"
    print(f"# Written by rpc_files.py ({version}). PATH | FORMAT | LONG_OFF LAT_OFF LINE_OFF SAMP_OFF | tool")
    paths = sorted(os.path.join(d, f) for d, _, fs in os.walk(root) for f in fs)
    for path in paths:
        name = os.path.relpath(path, root)
        if name in ("PROVENANCE.md", "peer_readers.txt"):
            continue
        reason = next((why for pattern, why in REFUSED.items() if re.search(pattern, name)), None)
        if reason:
            print(f"{name} | refused | {reason}")
            continue
        form = next(f for pattern, f in FORMATS if re.search(pattern, name))
        values, tool = offsets(path)
        print(f"{name} | {form} | {' '.join(repr(v) for v in values)} | {tool}")


main(sys.argv[1])
