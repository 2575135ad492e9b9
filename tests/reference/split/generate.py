"""Context and target views of the COLMAP models in ../shared/data, chosen by brute force with Python sets.

Reads points3D.bin and images.bin by COLMAP's published layout (struct only, no reader of ours), and follows the text of the
supplement of Cross-View Splatter: the first image of the sequence (lowest name) is the first context, contexts are closest in
overlap to the first, targets are closest in average overlap to the contexts. Run in this folder: python3 generate.py > reference.txt
"""
import struct
from pathlib import Path

COLMAP = Path(__file__).resolve().parents[3] / "../shared/data/city/colmap"
MODELS = ["bartoszek+test_colmap/sparse/0", "bartoszek+test_colmap/dense/0/sparse", "yDing121+video_sfm_mvs/data/sparse/0"]
PRESETS = {"narrow": (0.15, [0.02, 0.05, 0.07, 0.1]), "wide": (0.25, [0.03, 0.07, 0.1, 0.15])}


def images(path):
    data, at = path.read_bytes(), 8
    names = []
    for _ in range(struct.unpack_from("<Q", data)[0]):
        number = struct.unpack_from("<I", data, at)[0]
        at += 64
        end = data.index(b"\0", at)
        names.append((number, data[at:end].decode()))
        at = end + 1
        at += 8 + 24 * struct.unpack_from("<Q", data, at)[0]
    return names


def seen(path, names):
    points = {number: set() for number, _ in names}
    data, at = path.read_bytes(), 8
    for _ in range(struct.unpack_from("<Q", data)[0]):
        point = struct.unpack_from("<Q", data, at)[0]
        length = struct.unpack_from("<Q", data, at + 43)[0]
        for k in range(length):
            points[struct.unpack_from("<I", data, at + 51 + 8 * k)[0]].add(point)
        at += 51 + 8 * length
    return [points[number] for number, _ in names]


def iou(points, a, b):
    return len(points[a] & points[b]) / len(points[a] | points[b])


def chosen_views(points, first, context, targets, count):
    contexts, off, rest = [first], 0.0, [v for v in range(len(points)) if points[v] and v != first]
    for _ in range(count - 1):
        best = min(rest, key=lambda v: (abs(iou(points, v, first) - context), v))
        off += abs(iou(points, best, first) - context)
        contexts.append(best)
        rest.remove(best)
    chosen = []
    for target in targets:
        def average(v):
            return sum(iou(points, v, c) for c in contexts) / len(contexts)
        best = min(rest, key=lambda v: (abs(average(v) - target), v))
        off += abs(average(best) - target)
        chosen.append(best)
        rest.remove(best)
    return off, contexts, chosen


for model in MODELS:
    names = images(COLMAP / model / "images.bin")
    points = seen(COLMAP / model / "points3D.bin", names)
    for preset, (context, targets) in PRESETS.items():
        for count in (2, 3):
            first = min((v for v in range(len(points)) if points[v]), key=lambda v: names[v][1])
            best = chosen_views(points, first, context, targets, count)
            chosen = ",".join(names[v][1] for v in best[1]) + " " + ",".join(names[v][1] for v in best[2])
            print(f"{model} {preset} {count} {best[0]:.9f} {chosen}")
