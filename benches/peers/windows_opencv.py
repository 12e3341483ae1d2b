"""Times OpenCV's scans with a cascade and with gradients, and ours, in turns, on one
thread.

Usage: python benches/peers/windows_opencv.py PICTURE [LOG]
Needs `pip install "opencv-python-headless<5"`. The picture is brought to 640x480. The
cascade is ours, in both programs; gradients are 64x64 windows of the same cells and
blocks, in sizes 15 % apart, and the linear machine has weights by chance in OpenCV:
what is found differs, the work does not. With a log of colour and depth images the
detectors look at its frames, too, where depth allows a person; OpenCV, which cannot
do that, looks at all windows of these frames. Times are of the processor, not of the
clock on the wall, for one picture, and each is the median of several rounds. Prints
rows of the table of `run.sh`.
"""

import glob
import os
import resource
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np
from timing import rows

ROUNDS, RUNS, SIZE = 5, 10, (640, 480)
LOG_ROUNDS, LOG_RUNS = 3, 4
MODELS = "configs/models/"
# The sizes that OpenCV looks at.
FACES = ["face-rgbd", "scale_step=1.1", "min_neighbours=3", "min_side_px=20", "max_side=1"]
BODIES = ["hog-upper-body", "scale_step=1.15", "min_side_px=32"]
DETECTORS = {
    "cascade": FACES,
    "linear": [*BODIES, 'machine="linear"', "min_score=2"],
    "trees": BODIES,
}
JOBS = {"cascade": "cascade", "linear": "HOG, linear", "trees": "HOG, trees"}
PEERS = {"cascade": "cascade", "linear": "linear", "trees": "linear"}


def scans():
    cascade = cv2.CascadeClassifier(MODELS + "cascade.xml")
    hog = cv2.HOGDescriptor((64, 64), (16, 16), (8, 8), (8, 8), 9)
    weights = np.random.default_rng(1).normal(0, 0.01, hog.getDescriptorSize() + 1)
    weights[-1] = -9
    hog.setSVMDetector(weights.astype(np.float32))
    return {
        "cascade": lambda image: cascade.detectMultiScale(image, 1.1, 3),
        "linear": lambda image: hog.detectMultiScale(
            image, winStride=(8, 8), padding=(0, 0), scale=1.15),
    }


def opencv_ms(scan, images, runs):
    start = time.process_time()
    for _ in range(runs):
        for image in images:
            scan(image)
    return 1e3 * (time.process_time() - start) / runs / len(images)


def ours_ms(command, count, runs):
    """What more runs cost, so that starting and reading does not count."""

    def seconds(runs):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([part.replace("RUNS", str(runs)) for part in command], check=True,
                       capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    return 1e3 * (seconds(runs + 1) - seconds(1)) / runs / count


def built(package, example):
    subprocess.run(["cargo", "build", "-q", "--release", "-p", package, "--example", example],
                   check=True)
    folder = os.environ.get("CARGO_TARGET_DIR", "target")
    return os.path.join(folder, "release", "examples", example)


def compare(title, peers, ours, rounds):
    """Both take turns; `peers` and `ours` tell their time by name."""
    times = {}
    for _ in range(rounds):
        theirs = {name: ms() for name, ms in peers.items()}
        for name, ms in ours.items():
            times.setdefault(name, []).append((ms(), theirs[PEERS[name]]))
    for name, (own, peer, ratio) in rows(times).items():
        job = f"{JOBS[name]}, {title}"
        print(f"| {job}, beside OpenCV, all windows | C++ | {own:.2f} ms | {peer:.2f} ms | {ratio:.2f} |")


def all_windows(picture, folder):
    cascade = built("tagalong-face-rgbd", "time_cascade")
    windows = built("tagalong-hog-upper-body", "time_windows")
    image = cv2.resize(cv2.imread(picture, 0), SIZE, interpolation=cv2.INTER_AREA)
    path = os.path.join(folder, "picture.png")
    cv2.imwrite(path, image)
    commands = {
        "cascade": [cascade, MODELS + "cascade.xml", path, "RUNS"],
        "linear": [windows, MODELS + "hog-upper-body-linear.toml", path, "RUNS"],
        "trees": [windows, MODELS + "hog-upper-body.toml", path, "RUNS"],
    }
    peers = {name: lambda scan=scan: opencv_ms(scan, [image], RUNS)
             for name, scan in scans().items()}
    ours = {name: lambda c=command: ours_ms(c, 1, RUNS) for name, command in commands.items()}
    compare("all windows, 640x480", peers, ours, ROUNDS)


def where_depth_allows(log, folder):
    detector = built("tagalong-benches", "time_detector")
    subprocess.run([detector, log, "face-rgbd", "0", folder], check=True, capture_output=True)
    paths = sorted(glob.glob(os.path.join(folder, "[0-9]*.png")))
    images = [cv2.imread(path, 0) for path in paths]
    commands = {name: [detector, log, plugin, "RUNS", *settings]
                for name, (plugin, *settings) in DETECTORS.items()}
    peers = {name: lambda scan=scan: opencv_ms(scan, images, 1)
             for name, scan in scans().items()}
    ours = {name: lambda c=command: ours_ms(c, len(paths), LOG_RUNS)
            for name, command in commands.items()}
    compare(f"where depth allows, {len(paths)} frames", peers, ours, LOG_ROUNDS)


def main(picture, log=None):
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        all_windows(picture, folder)
        if log:
            where_depth_allows(log, folder)


main(*sys.argv[1:])
