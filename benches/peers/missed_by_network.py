"""Says of each person that a network's pipeline misses in recorded logs what the network said of them.

Usage: python benches/peers/missed_by_network.py NETWORK.onnx LOG.mcap...   (from the root of the repository)

Needs mcap, mcap-ros2-support, numpy, opencv-python-headless and onnxruntime, all from PyPI. NETWORK.onnx is
YOLOX-Nano; TAGALONG names the program (target/release/tagalong). Each log needs LOG.people.csv beside it.
The pipeline is `colour-net` with the thresholds of `tagalong model --install`, and without depth.

A person is found if a track's upper body overlaps theirs by half (IoU). Of the others it counts the best
box of the network that overlaps what the image shows of them by 0.4.
"""

import csv
import os
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from pathlib import Path

from whole_programs import images, network, people

SURE, DOUBTFUL = 0.75, 0.2
FOUND, SHOWN = 0.5, 0.4
KINDS = ["found", "sure box, no track there", "doubtful box", "box below 0.2", "no box"]

CONFIG = """
extends = "{tracker}"
without = ["depth"]

[[detectors]]
plugin = "onnx"

[detectors.config]
model = "{network}"
floor = true
sigma_distance = 0.3
discover_score = {sure}
track_score = {doubtful}
"""


def overlap(one, other):
    """Intersection over union of two boxes: left, top, width, height."""
    across = min(one[0] + one[2], other[0] + other[2]) - max(one[0], other[0])
    down = min(one[1] + one[3], other[1] + other[3]) - max(one[1], other[1])
    both = max(across, 0.0) * max(down, 0.0)
    return both / (one[2] * one[3] + other[2] * other[3] - both)


def tracks_of(program, onnx, log, home):
    """Boxes of the pipeline's tracks by frame."""
    tracker = Path("configs/colour-net.toml").resolve()
    config = home / "config.toml"
    config.write_text(CONFIG.format(tracker=tracker, network=onnx, sure=SURE, doubtful=DOUBTFUL))
    command = [program, "run", config, log, "-o", home / "run", "--overwrite"]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode not in (0, 3):
        sys.exit(f"{command}: {done.stderr}")
    tracks = defaultdict(list)
    with open(home / "run" / "tracks.csv") as rows:
        for row in csv.reader(rows):
            tracks[int(row[0])].append([float(cell) for cell in row[2:6]])
    return tracks


def boxes_of(session, log):
    """Boxes of the network with their scores by frame."""
    boxes = {}
    for frame, image in enumerate(images(log), 1):
        found, scores = people(session, image)
        boxes[frame] = [
            ((left, top, right - left, bottom - top), score)
            for (left, top, right, bottom), score in zip(found, scores)
        ]
    return boxes


def kind_of(person, tracks, boxes):
    upper = [float(person[f"ub_{side}"]) for side in "xywh"]
    shown = [float(person[f"vis_{side}"]) for side in "xywh"]
    if any(overlap(upper, track) >= FOUND for track in tracks):
        return "found"
    score = max((score for box, score in boxes if overlap(shown, box) >= SHOWN), default=0.0)
    if score >= SURE:
        return "sure box, no track there"
    if score >= DOUBTFUL:
        return "doubtful box"
    return "box below 0.2" if score > 0.0 else "no box"


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    onnx, logs = Path(sys.argv[1]).resolve(), [Path(log).resolve() for log in sys.argv[2:]]
    program = str(Path(os.environ.get("TAGALONG", "target/release/tagalong")).resolve())
    session = network(onnx)
    print("| log | people in frames | " + " | ".join(KINDS) + " |")
    print("|---" * (2 + len(KINDS)) + "|")
    for log in logs:
        with tempfile.TemporaryDirectory() as folder:
            tracks = tracks_of(program, onnx, log, Path(folder))
        boxes = boxes_of(session, log)
        counts = Counter()
        with open(log.with_suffix(".people.csv")) as rows:
            for person in csv.DictReader(rows):
                if person["ignore"] != "1":
                    frame = int(person["frame"])
                    counts[kind_of(person, tracks.get(frame, []), boxes.get(frame, []))] += 1
        cells = " | ".join(str(counts[kind]) for kind in KINDS)
        print(f"| {log.stem} | {counts.total()} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
