"""Compares the boxes of OpenCV's own cascades with ours, cascade by cascade.

Usage: python benches/peers/cascades_opencv.py PICTURE...
Needs `pip install "opencv-python-headless<5"`, which contains the cascades. A box has a partner
if all its edges differ by at most 8 pixels or a twentieth of its width, as in OpenCV's own test.
"""

import glob
import os
import subprocess
import sys
import tempfile

import cv2

OFF_PX, OFF = 8, 0.05


def program():
    subprocess.run(["cargo", "build", "-q", "-p", "tagalong-face-rgbd", "--example", "time_cascade"],
                   check=True)
    return os.path.join(os.environ.get("CARGO_TARGET_DIR", "target"), "debug/examples/time_cascade")


def ours(scan, cascade, picture):
    done = subprocess.run([scan, cascade, picture, "1"], capture_output=True, text=True)
    if done.returncode != 0:
        return None
    return [[float(word) for word in line.split()] for line in done.stdout.splitlines()[1:]]


def edges(box):
    x, y, width, height = box
    return [x, y, x + width, y + height]


def has_partner(box, others):
    most = max(OFF_PX, OFF * box[2])
    near = lambda other: all(abs(a - b) <= most for a, b in zip(edges(box), edges(other)))
    return any(near(other) for other in others)


def main():
    scan = program()
    print(f"{'cascade':44} boxes of OpenCV, of ours, with a partner in the other")
    for path in sorted(glob.glob(cv2.data.haarcascades + "*.xml")):
        counts = [0, 0, 0, 0]
        for name in sys.argv[1:]:
            grey = cv2.imread(name, cv2.IMREAD_GRAYSCALE)
            with tempfile.NamedTemporaryFile(suffix=".png") as picture:
                cv2.imwrite(picture.name, grey)
                found = ours(scan, path, picture.name)
            if found is None:
                counts = None
                break
            wanted = cv2.CascadeClassifier(path).detectMultiScale(grey, 1.1, 3)
            paired = [sum(has_partner(a, list(b)) for a in some)
                      for some, b in ((wanted, found), (found, wanted))]
            counts = [sum(pair) for pair in zip(counts, [len(wanted), len(found), *paired])]
        label = os.path.basename(path)
        print(f"{label:44} " + ("refused" if counts is None else "{:5} {:5} {:5} {:5}".format(*counts)))


if __name__ == "__main__":
    main()
