"""Writes the figures of the method page: python3 docs/figures/figures.py. It needs nothing but Python.

The cost volume is computed: one row of pixels over a house, costs with noise, and the semi-global recurrence along the row in both
directions with the proportions of the real penalties. The other figures are drawings.
"""

import random
from pathlib import Path

HERE = Path(__file__).parent
INK, GREY, BLUE, RED, GREEN, PALE = "#222222", "#888888", "#1f6fb2", "#c0392b", "#1e8449", "#e8eef4"


class Figure:
    def __init__(self, width, height, title):
        self.size = (width, height)
        self.parts = [f"<title>{title}</title>", f'<rect width="{width}" height="{height}" fill="white"/>']

    def line(self, points, color=INK, width=1.5, dash="", fill="none"):
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(f'<polyline points="{path}" fill="{fill}" stroke="{color}" stroke-width="{width}"{dashed}/>')

    def dot(self, x, y, color=INK, radius=4.0, hollow=False):
        fill = "white" if hollow else color
        self.parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{fill}" stroke="{color}" stroke-width="1.5"/>')

    def box(self, x, y, w, h, fill, stroke=""):
        border = f' stroke="{stroke}"' if stroke else ""
        self.parts.append(f'<rect x="{x:.1f}" y="{y:.1f}" width="{w:.1f}" height="{h:.1f}" fill="{fill}"{border}/>')

    def text(self, x, y, words, color=INK, anchor="start", size=14):
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" fill="{color}" text-anchor="{anchor}" font-size="{size}">{words}</text>')

    def save(self, name):
        w, h = self.size
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {w} {h}" width="{w}" height="{h}" font-family="sans-serif">'
        (HERE / name).write_text("\n".join([head, *self.parts, "</svg>"]) + "\n")


def between(a, b, t):
    return (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]))


def sweep():
    f = Figure(720, 380, "Height hypotheses of one pixel, seen by another view")
    a, b = (150, 40), (590, 40)
    ground = [(30, 320), (300, 320), (300, 230), (420, 230), (420, 320), (690, 320)]
    f.line(ground, INK, 2.5)
    target = (360, 230)
    end = (a[0] + (target[0] - a[0]) * 290 / 190, 330)
    f.line([a, end], BLUE, 2)
    for k, z in enumerate(range(150, 330, 20)):
        p = between(a, end, (z - a[1]) / (end[1] - a[1]))
        right = abs(z - 230) < 1
        f.line([b, p], GREEN if right else GREY, 2 if right else 0.8, "" if right else "4 4")
        f.dot(*p, GREEN if right else BLUE, 5, hollow=not right)
        f.line([(24, z), (34, z)], GREY)
    f.line([(29, 150), (29, 310)], GREY)
    f.text(12, 138, "heights k · step", GREY)
    for (x, y), name in ((a, "reference view"), (b, "source view")):
        f.box(x - 16, y - 14, 32, 20, PALE, INK)
        f.text(x, y - 22 + 4, name, INK, "middle")
    f.text(440, 222, "only at the true height do both views show the roof", GREEN, size=13)
    f.save("sweep.svg")


def volume():
    """Costs of a row of pixels, and what the aggregation makes of them."""
    random.seed(5)
    pixels, heights, best = 44, 22, 112
    truth = [5 + 0.05 * i for i in range(14)] + [15] * 14 + [6.5 - 0.05 * i for i in range(16)]
    cost = []
    for i in range(pixels):
        row = []
        for k in range(heights):
            off = abs(k - truth[i])
            clean = min(1.0, 0.25 * off) if i not in (33, 34, 35) else 0.75
            row.append(best * min(1.0, max(0.0, 0.12 + 0.7 * clean + random.gauss(0, 0.17))))
        cost.append(row)
    step, jump, edge = 32, 124, 32
    total = [[0.0] * heights for _ in range(pixels)]
    for order in (range(pixels), range(pixels - 1, -1, -1)):
        before = None
        for i in order:
            now = []
            for k in range(heights):
                if before is None:
                    now.append(cost[i][k])
                    continue
                low = min(before)
                last = order[0] if i == order[0] else (i - 1 if order.step > 0 else i + 1)
                price = edge if abs(truth[i] - truth[last]) > 4 else jump
                near = [before[k]] + [before[j] + step for j in (k - 1, k + 1) if 0 <= j < heights]
                now.append(cost[i][k] + min(*near, low + price) - low)
            before = now
            total[i] = [t + n for t, n in zip(total[i], now)]
    f = Figure(720, 330, "A row of the cost volume before and after the aggregation")
    for left, data, name in ((20, cost, "costs"), (370, total, "aggregated along the row")):
        top = max(max(row) for row in data)
        size_x, size_y = 330 / pixels, 240 / heights
        f.text(left, 30, name)
        for i, row in enumerate(data):
            for k, value in enumerate(row):
                shade = int(40 + 215 * min(1.0, value / top))
                f.box(left + i * size_x, 280 - (k + 1) * size_y, size_x + 0.3, size_y + 0.3, f"#{shade:02x}{shade:02x}{shade:02x}")
            k = min(range(heights), key=lambda k: row[k])
            f.dot(left + (i + 0.5) * size_x, 280 - (k + 0.5) * size_y, RED, 2.2)
        f.text(left, 305, "pixels of a row →", GREY, size=12)
    f.text(190, 305, "height ↑   dark: small cost   red: the smallest", GREY, size=12)
    f.save("cost_volume.svg")


def consistency():
    f = Figure(720, 330, "A height is kept where another view has the same height")
    a, b = (140, 40), (580, 40)
    f.line([(30, 280), (260, 280), (260, 180), (400, 180), (400, 280), (690, 280)], INK, 2.5)
    good, hidden = (310, 180), (420, 280)
    f.line([a, good], GREEN, 2)
    f.line([b, good], GREEN, 2)
    f.dot(*good, GREEN, 6)
    f.text(268, 172, "agree: kept", GREEN, "end")
    wrong = (470, 225)
    f.line([a, (400, 181), wrong], RED, 1.6, "6 4")
    f.line([b, between(b, wrong, 280 / 185 * 0.86)], BLUE, 1.6)
    f.dot(*wrong, RED, 6, hollow=True)
    seen = between(b, wrong, (280 - 40) / (225 - 40))
    f.dot(*seen, BLUE, 5)
    f.line([wrong, (wrong[0], 280)], RED, 1, "2 3")
    f.text(486, 232, "wrong match behind the wall", RED)
    f.text(seen[0] - 6, 302, "the other view's own height here", BLUE, "middle", 13)
    for (x, y), name in ((a, "view 1"), (b, "view 2")):
        f.box(x - 16, y - 14, 32, 20, PALE, INK)
        f.text(x, y - 18, name, INK, "middle")
    f.save("consistency.svg")


def fusion():
    f = Figure(720, 340, "One height per cell; what becomes of voids")
    f.text(20, 28, "a cell with heights of five views")
    f.line([(60, 50), (60, 290)], GREY)
    f.text(48, 48, "height", GREY, "end", 12)
    for z, x, color in ((110, 100, GREEN), (116, 150, GREEN), (106, 200, GREEN), (238, 120, GREY), (244, 180, GREY)):
        f.line([(x, z - 12), (x, z + 12)], color, 1.2)
        f.dot(x, z, color)
    f.line([(70, 111), (240, 111)], GREEN, 2, "6 4")
    f.text(74, 90, "most support: fused by 1/σ²", GREEN, size=13)
    f.text(74, 272, "less support: left out", GREY, size=13)
    x0 = 300
    f.text(x0, 28, "voids of the surface (dashed: what the default fills)")
    for part in (
        [(x0, 250), (x0 + 50, 248)], [(x0 + 70, 247), (x0 + 130, 244)],
        [(x0 + 130, 244), (x0 + 130, 140), (x0 + 200, 140)],
        [(x0 + 245, 240), (x0 + 300, 238)],
    ):
        f.line(part, INK, 2.5)
    f.line([(x0 + 50, 248), (x0 + 70, 247)], GREEN, 2, "4 3")
    f.line([(x0 + 200, 140), (x0 + 200, 242), (x0 + 245, 240)], GREEN, 2, "4 3")
    f.line([(x0 + 300, 238), (x0 + 405, 238)], RED, 1.5, "2 5")
    f.text(x0 + 60, 272, "narrow", GREEN, "middle", 13)
    f.text(x0 + 222, 272, "hidden by the wall", GREEN, "middle", 13)
    f.text(x0 + 352, 296, "known on one side only: open", RED, "middle", 13)
    f.save("fusion.svg")


for figure in (sweep, volume, consistency, fusion):
    figure()
