"""Writes undistortion.txt: where OpenCV finds the pixels of a pinhole in a photograph with distortion.

A line has the number of the lens, column and row of the pixel, its place in the photograph, and the
red of `picture` there, interpolated linearly in f64; NaN outside. Needs NumPy and
opencv-python-headless; made with 5.0.0.93: python undistortion.py > undistortion.txt
"""

import cv2
import numpy as np

SIZE = (40, 30)
# Parameters as COLMAP orders them, and as OpenCV does (k1, k2, p1, p2, k3).
LENSES = [
    ("OPENCV", [33, 31, 19.2, 14.6, -0.21, 0.06, 0.004, -0.007], [-0.21, 0.06, 0.004, -0.007, 0]),
    ("FULL_OPENCV", [35, 36, 20.1, 14.1, 0.12, -0.05, -0.003, 0.002, 0.02, 0, 0, 0],
     [0.12, -0.05, -0.003, 0.002, 0.02]),
    ("SIMPLE_RADIAL", [30, 19.5, 14.5, -0.15], [-0.15, 0, 0, 0, 0]),
    ("RADIAL", [32, 18.9, 15.2, 0.1, 0.03], [0.1, 0.03, 0, 0, 0]),
]


def picture(x, y):
    return 0.5 + 0.3 * np.sin(0.31 * x + 0.17 * y) + 0.15 * np.cos(0.23 * x - 0.4 * y)


def main():
    columns, rows = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    red = picture(columns.astype(float), rows.astype(float))
    for model, colmap, opencv in LENSES:
        print("lens", model, *colmap)
    for number, (_, colmap, opencv) in enumerate(LENSES):
        focal, centre = (colmap[:2], colmap[2:4]) if "OPENCV" in LENSES[number][0] else (colmap[:1] * 2, colmap[1:3])
        k = np.array([[focal[0], 0, centre[0]], [0, focal[1], centre[1]], [0, 0, 1.0]])
        across, down = cv2.initUndistortRectifyMap(k, np.array(opencv, float), None, k, SIZE, cv2.CV_32FC1)
        for row in range(0, SIZE[1], 3):
            for column in range(0, SIZE[0], 3):
                x, y = float(across[row, column]), float(down[row, column])
                value = float("nan")
                if 0 <= x <= SIZE[0] - 1 and 0 <= y <= SIZE[1] - 1:
                    i, j = min(int(x), SIZE[0] - 2), min(int(y), SIZE[1] - 2)
                    u, v = x - i, y - j
                    upper, lower = ((1 - u) * red[r, i] + u * red[r, i + 1] for r in (j, j + 1))
                    value = (1 - v) * upper + v * lower
                print(number, column, row, f"{x:.5f} {y:.5f} {value:.6f}")


main()
