"""Times OpenCV's scans with a cascade and with gradients, and ours, in turns, on one
thread.

Usage: python benches/peers/windows_opencv.py PICTURE
Needs `pip install "opencv-python-headless<5"`. The picture is brought to 640x480. The
cascade is ours, in both programs; gradients are 64x64 windows of the same cells and
blocks, in sizes 15 % apart, and the linear machine has weights by chance in OpenCV:
what is found differs, the work does not. Times are of the processor, not of the clock
on the wall, and each is the least of several rounds.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

ROUNDS, RUNS, SIZE = 5, 10, (640, 480)
MODELS = "configs/models/"


def opencv(image):
    cascade = cv2.CascadeClassifier(MODELS + "cascade.xml")
    hog = cv2.HOGDescriptor((64, 64), (16, 16), (8, 8), (8, 8), 9)
    weights = np.random.default_rng(1).normal(0, 0.01, hog.getDescriptorSize() + 1)
    weights[-1] = -9
    hog.setSVMDetector(weights.astype(np.float32))
    return {
        "cascade": lambda: cascade.detectMultiScale(image, 1.1, 3),
        "linear": lambda: hog.detectMultiScale(
            image, winStride=(8, 8), padding=(0, 0), scale=1.15),
    }


def opencv_ms(scan):
    start = time.process_time()
    for _ in range(RUNS):
        scan()
    return 1e3 * (time.process_time() - start) / RUNS


def ours_ms(command):
    """What RUNS more scans cost, so that starting and reading does not count."""

    def seconds(runs):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([*command, str(runs)], check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    return 1e3 * (seconds(RUNS + 1) - seconds(1)) / RUNS


def built(package, example):
    subprocess.run(["cargo", "build", "-q", "--release", "-p", package, "--example", example],
                   check=True)
    folder = os.environ.get("CARGO_TARGET_DIR", "target")
    return os.path.join(folder, "release", "examples", example)


def main(picture):
    cv2.setNumThreads(1)
    cascade = built("tagalong-face-rgbd", "time_cascade")
    windows = built("tagalong-hog-upper-body", "time_windows")
    image = cv2.resize(cv2.imread(picture, 0), SIZE, interpolation=cv2.INTER_AREA)
    best = {}
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "picture.png")
        cv2.imwrite(path, image)
        ours = {
            "cascade": [cascade, MODELS + "cascade.xml", path],
            "linear": [windows, MODELS + "hog-upper-body-linear.toml", path],
            "trees": [windows, MODELS + "hog-upper-body.toml", path],
        }
        for _ in range(ROUNDS):
            times = {"OpenCV " + name: opencv_ms(scan) for name, scan in opencv(image).items()}
            times |= {"our " + name: ours_ms(command) for name, command in ours.items()}
            best = {name: min(ms, best.get(name, ms)) for name, ms in times.items()}
    for name, ms in best.items():
        print(f"{name:16} {ms:7.2f} ms")
    for name, peer in [("cascade", "cascade"), ("linear", "linear"), ("trees", "linear")]:
        print(f"OpenCV {peer} / our {name}: {best['OpenCV ' + peer] / best['our ' + name]:.2f}")


main(*sys.argv[1:])
