"""Prints the depth that OpenCV computes from disparities: the tables in the tests of
crates/log/src/images.

    pip install opencv-python-headless numpy
    python tests/clients/disparity_opencv.py
"""

import cv2
import numpy as np

FOCAL_PX, BASELINE_M = 420.0, 0.12
# Depth is FOCAL_PX over disparity / BASELINE_M: rows 3 and 4 of the matrix.
Q = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, FOCAL_PX], [0, 0, 1 / BASELINE_M, 0]])

values = {
    "8UC1": np.array([[0, 1, 7, 42, 200, 255]], np.uint8),
    # Sixteenths of a pixel, as StereoBM and StereoSGBM write them.
    "16SC1": np.array([[-16, 1, 113, 672, 3200, 32767]], np.int16),
    "32FC1": np.array([[0, 0.5, 7.25, 42, 63.5, 500]], np.float32),
}
for encoding, image in values.items():
    pixels = image.astype(np.float32) / (16 if encoding == "16SC1" else 1)
    depth = cv2.reprojectImageTo3D(pixels, Q)[..., 2].reshape(-1)
    valid = pixels.reshape(-1) > 0
    shown = ", ".join(f"{z:.9g}_f32" if ok else "f32::NAN" for z, ok in zip(depth, valid))
    print(f'("{encoding}", &{list(image.tobytes())}, [{shown}]),')
