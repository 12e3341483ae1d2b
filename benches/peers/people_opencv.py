"""Compares OpenCV's stock HOG people detector with `hog-upper-body` on the same images.

Usage: python benches/peers/people_opencv.py DATA [FOLDER]
Needs `pip install "opencv-python-headless<5" mcap zstandard numpy`. DATA is the folder of
recorded data, `../shared/data`; the detections are written to FOLDER (or to a temporary
one) as MOTChallenge text.

One protocol for all: the same colour images, single frames, one file of scored boxes for
each detector and log, and `tagalong eval` for the log-average miss rate (LAMR, IoU 0.5).
In a room the truth is the upper body; in the street it is the whole body, compared as a
whole and, with `eval --upper-body`, by its upper body. No box is fitted to a scored log:

* OpenCV's window of 64x128 shows a person of 96 rows from row 16 on, as the crops of INRIA
  do that it was trained on, and in the middle of its columns. The width of a person is 0.41
  of the height (Dollar et al., PAMI 2012).
* An upper body is converted to a whole person of 1.7 m and back, for both detectors, by the
  constants of `Rect::upper_body_of_standing`.

In each room, models are used that have not seen it. Milliseconds are those of one thread.
"""

import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
from mcap.reader import make_reader

ROOT = Path(__file__).resolve().parents[2]
# Person in OpenCV's window of 64x128: rows, and width by height.
TOP, HEIGHT, WIDTH = 16 / 128, 96 / 128, 0.41
# Side of the square of an upper body, its height above the head, and a standing person, m.
SIDE_M, ABOVE_M, STANDING_M = 0.57, 0.025, 1.7
COLOUR = "/camera/color/image_raw/compressed"
STREET = "TUD-Stadtmitte"
# Rooms and their logs; models that have not seen a room have its name.
ROOMS = {
    "um": "um-and-filinha",
    "filinha": "um-and-filinha",
    "lab2-camera1": "lab2",
    "lab2-camera2": "lab2",
    "corredor1-camera1": "corredor1",
}
# Settings of the plugin, and the model that each row of the table uses.
OURS = {
    "linear (P2)": (["machine='linear'"], "hog-upper-body-linear"),
    "trees, upper body": ([], "hog-upper-body"),
    "trees, whole body": (["coverage='whole-body'"], "hog-whole-body"),
    "trees, upper body, depth": ([], "hog-upper-body"),
    "with the depth channel": (["depth_channel=true"], "hog-upper-body"),
}
# Rows that use depth, for what it is worth; the others see colour alone.
WITH_DEPTH = ["trees, upper body, depth", "with the depth channel"]
# The sizes are those that OpenCV looks at. All that has a chance is written: a miss rate is read
# off at many thresholds.
COMMON = ["min_score=-4.0", "max_score=100.0", "scale_step=1.05", "min_side_px=32.0"]


def cargo(*arguments):
    subprocess.run(["cargo", "build", "--release", "--quiet", *arguments], cwd=ROOT, check=True)


def target():
    text = subprocess.run(["cargo", "metadata", "--no-deps", "--format-version", "1"], cwd=ROOT,
                          check=True, capture_output=True, text=True).stdout
    return Path(json.loads(text)["target_directory"]) / "release"


def images(path):
    with open(path, "rb") as log:
        for _, _, message in make_reader(log).iter_messages(topics=[COLOUR]):
            start = message.data.find(b"\xff\xd8\xff")
            if start >= 0:
                yield cv2.imdecode(np.frombuffer(message.data[start:], np.uint8), 1)


def person(window):
    """Box of the person in a window."""
    x, y, width, height = window
    tall = height * HEIGHT
    return x + 0.5 * (width - WIDTH * tall), y + height * TOP, WIDTH * tall, tall


def upper_body(box):
    """Square of the upper body of a standing person."""
    x, y, width, height = box
    px_per_m = height / STANDING_M
    side = SIDE_M * px_per_m
    return x + 0.5 * (width - side), y - ABOVE_M * px_per_m, side, side


def clipped(box, image):
    x, y, width, height = box
    left, top = max(x, 0.0), max(y, 0.0)
    right, bottom = min(x + width, image.shape[1]), min(y + height, image.shape[0])
    return left, top, max(right - left, 0.0), max(bottom - top, 0.0)


def write_opencv(log, out, extent):
    """Writes OpenCV's detections; returns the processor time of a frame, ms."""
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())
    lines, work, count = [], 0.0, 0
    for count, image in enumerate(images(log), 1):
        before = time.process_time()
        windows, scores = hog.detectMultiScale(
            image, hitThreshold=-0.5, winStride=(8, 8), padding=(8, 8), scale=1.05)
        work += time.process_time() - before
        for number, (window, score) in enumerate(zip(windows, np.ravel(scores))):
            box = person([float(value) for value in window])
            box = clipped(upper_body(box) if extent == "upper" else box, image)
            numbers = ",".join(f"{value:.2f}" for value in box)
            lines.append(f"{count},{count * 1000 + number},{numbers},{score:.6f},-1,-1,-1\n")
    out.write_text("".join(lines))
    return 1e3 * work / max(count, 1)


def write_ours(programs, log, out, extent, settings, inputs="colour"):
    """Writes the plugin's detections; returns the processor time of a frame, ms."""
    words = [str(log), str(out), extent, inputs, *COMMON, *settings]
    done = subprocess.run([programs / "examples" / "detect_people", *words], cwd=ROOT, check=True,
                          capture_output=True, text=True)
    return float(re.search(r"([0-9.]+) ms", done.stdout)[1])


def miss_rate(programs, log, tracks, extent):
    truth = log.with_suffix(".people.csv")
    words = ["--truth", truth] if truth.exists() else ["--truth", log.with_suffix(".boxes.csv")]
    if not truth.exists() and extent == "upper":
        words.append("--upper-body")
    words += ["--tracks", tracks, "--log", log, "--format", "json"]
    done = subprocess.run([programs / "tagalong", "eval", *words], check=True,
                          capture_output=True, text=True)
    return json.loads(done.stdout)["LAMR"]


def settings_for(row, log):
    """Settings of a row on one log: in a room, with the model that has not seen it."""
    settings, model = OURS[row]
    left_out = f"benches/models/{model}.without-{ROOMS.get(log.stem)}.toml"
    return [*settings, f"model='{left_out}'"] if (ROOT / left_out).exists() else settings


def main(data, folder=None):
    cv2.setNumThreads(1)
    cargo("--workspace", "--bin", "tagalong", "--example", "detect_people")
    programs, logs = target(), Path(data).resolve() / "logs"
    folder = Path(folder or tempfile.mkdtemp()).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    columns = [(STREET, "whole"), (STREET, "upper"), *((room, "upper") for room in ROOMS)]
    names = [f"{STREET}, {extent}" for extent in ("whole", "upper")] + list(ROOMS)
    print("| detector |", " | ".join(names), "| mean of the rooms | ms a frame |")
    print("| --- |" + " --- |" * (len(names) + 2), flush=True)
    for row in ["OpenCV", *OURS]:
        rates, spent = [], []
        # The street has no depth.
        for stem, extent in columns[2:] if row in WITH_DEPTH else columns:
            log = logs / f"{stem}.mcap"
            out = folder / f"{row.replace(' ', '-')}.{stem}.{extent}.csv"
            if row == "OpenCV":
                spent.append(write_opencv(log, out, extent))
            else:
                inputs = "depth" if row in WITH_DEPTH else "colour"
                settings = settings_for(row, log)
                spent.append(write_ours(programs, log, out, extent, settings, inputs))
            rates.append(miss_rate(programs, log, out, extent))
        cells = [f"{rate:.3f}" for rate in [*rates, np.mean(rates[-len(ROOMS):])]]
        cells = ["-"] * (len(names) - len(rates)) + cells
        print(f"| {row} |", " | ".join(cells), f"| {np.mean(spent):.1f} |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
