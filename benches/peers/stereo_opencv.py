"""Times OpenCV's stereo matchers and ours on one pair, in turns, on one thread.

Usage: python benches/peers/stereo_opencv.py LEFT.png RIGHT.png
Needs `pip install opencv-python-headless`. The pair is brought to 512x384; 64
disparities. Ours does all that it does by default: left-right check, uniqueness,
texture and speckle tests, holes, refinement. So does OpenCV's SGBM here, but for the
refinement and the holes; StereoBM is timed as it comes, without left-right check and
speckle filter, and with both ("tested"). Each time is the median of calls in processor time, and
the median of rounds, in which the programs take turns (`timing.py`).
"""

import os
import subprocess
import sys
import tempfile

import cv2
from timing import statistic, time_once

ROUNDS, RUNS, DISPARITIES, SIZE = 20, 10, 64, (512, 384)


def opencv():
    sgbm = (0, DISPARITIES, 5, 200, 800, 1, 0, 10, 100, 2)
    tested = cv2.StereoBM_create(DISPARITIES, 15)
    tested.setDisp12MaxDiff(1)
    tested.setSpeckleWindowSize(100)
    tested.setSpeckleRange(2)
    return {
        "StereoBM": cv2.StereoBM_create(DISPARITIES, 15),
        "StereoBM, tested": tested,
        "SGBM": cv2.StereoSGBM_create(*sgbm, cv2.STEREO_SGBM_MODE_SGBM),
        "SGBM_3WAY": cv2.StereoSGBM_create(*sgbm, cv2.STEREO_SGBM_MODE_SGBM_3WAY),
    }


def opencv_ms(matcher, left, right):
    return 1e3 * statistic([time_once(lambda: matcher.compute(left, right)) for _ in range(RUNS)])


def ours_ms(program, method, paths):
    command = [program, method, *paths, str(DISPARITIES), str(RUNS), "1"]
    return float(subprocess.run(command, check=True, capture_output=True).stdout.split()[0])


def read(path):
    image = cv2.imread(path, 0)
    if image is None:
        sys.exit(f"{path}: no image that OpenCV can read")
    return image


def built():
    example = ["-q", "--release", "-p", "tagalong-benches", "--example", "time_pair"]
    subprocess.run(["cargo", "build", *example], check=True)
    folder = os.environ.get("CARGO_TARGET_DIR", "target")
    return os.path.join(folder, "release", "examples", "time_pair")


def main(left, right):
    cv2.setNumThreads(1)
    program = built()
    pair = [cv2.resize(read(path), SIZE, interpolation=cv2.INTER_AREA) for path in (left, right)]
    rounds = {}
    with tempfile.TemporaryDirectory() as folder:
        paths = [os.path.join(folder, name) for name in ("left.png", "right.png")]
        for path, image in zip(paths, pair):
            cv2.imwrite(path, image)
        for _ in range(ROUNDS):
            times = {name: opencv_ms(m, *pair) for name, m in opencv().items()}
            times |= {name: ours_ms(program, name, paths) for name in ("block", "semi-global")}
            for name, ms in times.items():
                rounds.setdefault(name, []).append(ms)
    medians = {name: statistic(times) for name, times in rounds.items()}
    for name, ms in medians.items():
        print(f"{name:16} {ms:7.2f} ms")
    print(f"StereoBM / block: {medians['StereoBM'] / medians['block']:.2f}")
    print(f"StereoBM, tested / block: {medians['StereoBM, tested'] / medians['block']:.2f}")
    print(f"SGBM_3WAY / semi-global: {medians['SGBM_3WAY'] / medians['semi-global']:.2f}")


if len(sys.argv) != 3:
    sys.exit(__doc__)
main(*sys.argv[1:])
