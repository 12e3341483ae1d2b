"""Times OpenCV's stereo matchers and ours on one pair, in turns, on one machine.

Usage: python benches/peers/stereo_opencv.py LEFT.png RIGHT.png [THREADS]
Needs `pip install opencv-python-headless`. The pair is brought to 512x384; 64
disparities. Each matcher is judged by its fastest run of several rounds, since
other programs only ever make it slower.
"""

import os
import subprocess
import sys
import tempfile
import time

import cv2

ROUNDS, RUNS, DISPARITIES, SIZE = 5, 10, 64, (512, 384)


def opencv():
    sgbm = (0, DISPARITIES, 5, 200, 800, 1, 0, 10, 100, 2)
    return {
        "StereoBM": cv2.StereoBM_create(DISPARITIES, 15),
        "SGBM": cv2.StereoSGBM_create(*sgbm, cv2.STEREO_SGBM_MODE_SGBM),
        "SGBM_3WAY": cv2.StereoSGBM_create(*sgbm, cv2.STEREO_SGBM_MODE_SGBM_3WAY),
    }


def milliseconds(matcher, left, right):
    best = float("inf")
    for _ in range(RUNS):
        start = time.perf_counter()
        matcher.compute(left, right)
        best = min(best, 1e3 * (time.perf_counter() - start))
    return best


def ours(paths, threads):
    command = ["cargo", "run", "-q", "--release", "-p", "tagalong-stereo", "--example",
               "time_pair", *paths, str(DISPARITIES), str(RUNS), str(threads)]
    lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return {name: float(ms) for name, ms in map(str.split, lines.splitlines())}


def main(left, right, threads=1):
    cv2.setNumThreads(int(threads))
    pair = [cv2.resize(cv2.imread(path, 0), SIZE, interpolation=cv2.INTER_AREA)
            for path in (left, right)]
    best = {}
    with tempfile.TemporaryDirectory() as folder:
        paths = [os.path.join(folder, name) for name in ("left.png", "right.png")]
        for path, image in zip(paths, pair):
            cv2.imwrite(path, image)
        for _ in range(ROUNDS):
            times = {name: milliseconds(m, *pair) for name, m in opencv().items()}
            times.update(ours(paths, threads))
            best = {name: min(ms, best.get(name, ms)) for name, ms in times.items()}
    for name, ms in best.items():
        print(f"{name:12} {ms:7.2f} ms")
    print(f"StereoBM / block: {best['StereoBM'] / best['block']:.2f}")
    print(f"SGBM_3WAY / semi-global: {best['SGBM_3WAY'] / best['semi-global']:.2f}")


main(*sys.argv[1:])
