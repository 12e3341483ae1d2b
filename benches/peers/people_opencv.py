"""Scores OpenCV's stock HOG people detector on an annotated log of colour images.

Usage: python benches/peers/people_opencv.py LOG
Needs `pip install "opencv-python-headless<5" mcap numpy`. LOG is an MCAP file with JPEG
images; beside it lies `.boxes.csv` (frame from 1, number, x, y, width, height in px).
The detector's windows have a margin around the person, which is cut off before boxes
are compared (IoU 0.5). Prints the log-average miss rate over 0.01 to 1 false boxes an
image, where each truth counts, however much of it is hidden.
"""

import csv
import sys
from collections import defaultdict

import cv2
import numpy as np
from mcap.reader import make_reader

# Left, top, width and height of the person in a 64x128 window, as parts of its sides.
PERSON = (0.18, 0.11, 0.64, 0.78)


def truths(path):
    frames = defaultdict(list)
    with open(path, newline="") as rows:
        for row in csv.reader(rows):
            frames[int(row[0])].append([float(value) for value in row[2:6]])
    return frames


def images(path):
    with open(path, "rb") as log:
        for _, _, message in make_reader(log).iter_messages():
            start = message.data.find(b"\xff\xd8\xff")
            if start >= 0:
                yield cv2.imdecode(np.frombuffer(message.data[start:], np.uint8), 1)


def overlap(a, b):
    width = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    height = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    both = max(width, 0) * max(height, 0)
    return both / (a[2] * a[3] + b[2] * b[3] - both)


def judged(found, people):
    """Score of each box, and whether it is a person that no better box has taken."""
    free = list(people)
    for score, box in sorted(found, key=lambda pair: -pair[0]):
        best = max(free, key=lambda person: overlap(box, person), default=None)
        hit = best is not None and overlap(box, best) >= 0.5
        if hit:
            free.remove(best)
        yield score, hit


def miss_rate(pairs, people, frames):
    hits = np.array([hit for _, hit in sorted(pairs, key=lambda pair: -pair[0])], dtype=bool)
    false = np.cumsum(~hits) / frames
    missed = 1 - np.cumsum(hits) / people
    at = [missed[false <= rate][-1] if (false <= rate).any() else 1.0
          for rate in np.logspace(-2, 0, 9)]
    return np.exp(np.mean(np.log(np.maximum(at, 1e-9))))


def main(log):
    cv2.setNumThreads(1)
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())
    people = truths(log.removesuffix(".mcap") + ".boxes.csv")
    pairs, frames, count = [], 0, 0
    for frames, image in enumerate(images(log), 1):
        boxes, scores = hog.detectMultiScale(
            image, hitThreshold=-0.5, winStride=(8, 8), padding=(8, 8), scale=1.05)
        boxes = [(x + w * PERSON[0], y + h * PERSON[1], w * PERSON[2], h * PERSON[3])
                 for x, y, w, h in boxes]
        found = [(float(score), box) for box, score in zip(boxes, np.ravel(scores))]
        count += len(people[frames])
        pairs.extend(judged(found, people[frames]))
    print(f"{frames} images, {count} people, LAMR {miss_rate(pairs, count, frames):.3f}")


main(*sys.argv[1:])
