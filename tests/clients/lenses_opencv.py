"""Prints how OpenCV bends rays: the table in the tests of crates/geometry/src/distortion.rs.

    pip install opencv-python-headless numpy
    python tests/clients/lenses_opencv.py
"""

import cv2
import numpy as np

RAYS = np.array([[0.3, -0.2], [-0.9, 0.5], [1.2, 1.0], [0.0, 1.6]])
LENSES = {
    "PlumbBob": [
        [0.1, -0.02, 0.002, -0.003, 0.005],
        [-0.28, 0.065, 0.0004, -0.0003, -0.0062],
    ],
    "Rational": [
        [0.3, 0.05, 0.002, -0.003, 0.005, 0.6, 0.1, 0.004] + 6 * [0.0],
        [0.3, 0.05, 0.002, -0.003, 0.005, 0.6, 0.1, 0.004, 0.01, -0.002, 0.02, 0.001, 0.0, 0.0],
        [0.3, 0.05, 0.002, -0.003, 0.005, 0.6, 0.1, 0.004, 0.01, -0.002, 0.02, 0.001, 0.05, -0.03],
    ],
    "Equidistant": [[0.02, -0.004, 0.003, -0.001]],
}


def bent(family, coefficients):
    points = np.column_stack([RAYS, np.ones(len(RAYS))]).reshape(-1, 1, 3)
    zero, eye, d = np.zeros(3), np.eye(3), np.array(coefficients)
    if family == "Equidistant":
        return cv2.fisheye.projectPoints(points, zero, zero, eye, d)[0].reshape(-1, 2)
    # OpenCV takes 4, 5, 8, 12 or 14 coefficients.
    return cv2.projectPoints(points, zero, zero, eye, d)[0].reshape(-1, 2)


for family, lenses in LENSES.items():
    for coefficients in lenses:
        found = [[float(repr(float(v))) for v in row] for row in bent(family, coefficients)]
        print(f"(Distortion::{family}({coefficients}), {found}),")
