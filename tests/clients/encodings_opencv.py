"""Prints how OpenCV decodes bytes, for the tests of crates/log/src/images.

    pip install opencv-python-headless numpy
    python tests/clients/encodings_opencv.py > crates/log/tests/data/encodings-opencv.txt
"""

import cv2
import numpy as np

# Bytes in no order, the same as in the tests: 7 + 37 i, modulo 256.
def noise(rows, columns):
    return ((7 + 37 * np.arange(rows * columns)) % 256).astype(np.uint8).reshape(rows, columns)


# OpenCV names a pattern by its second row and column.
BAYER = {
    "bayer_rggb8": cv2.COLOR_BayerBG2RGB,
    "bayer_bggr8": cv2.COLOR_BayerRG2RGB,
    "bayer_gbrg8": cv2.COLOR_BayerGR2RGB,
    "bayer_grbg8": cv2.COLOR_BayerGB2RGB,
}
PACKED = {"yuv422": cv2.COLOR_YUV2RGB_UYVY, "yuv422_yuy2": cv2.COLOR_YUV2RGB_YUY2}
PLANES = {"nv12": cv2.COLOR_YUV2RGB_NV12, "nv21": cv2.COLOR_YUV2RGB_NV21}

tables = [(name, cv2.cvtColor(noise(5, 6), code)) for name, code in BAYER.items()]
tables += [
    (name, cv2.cvtColor(noise(2, 8).reshape(2, 4, 2), code)) for name, code in PACKED.items()
]
tables += [(name, cv2.cvtColor(noise(6, 4), code)) for name, code in PLANES.items()]
# OpenCV has no NV24. A pixel of it is one of YUY2 that stands twice in its pair.
y, uv = noise(6, 4)[:2], noise(6, 4)[2:].reshape(2, 4, 2)
pairs = np.stack([y, uv[..., 0], y, uv[..., 1]], axis=-1).reshape(2, 8, 2)
tables.append(("nv24", cv2.cvtColor(pairs, cv2.COLOR_YUV2RGB_YUY2)[:, ::2]))
for name, image in tables:
    print(name, image.shape[1], image.shape[0], *image.reshape(-1))
