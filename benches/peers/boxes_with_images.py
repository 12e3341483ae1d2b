"""Compares trackers on the boxes of one network in recorded logs, with their images.

Usage: python benches/peers/boxes_with_images.py NETWORK.onnx LOG.mcap...   (from the root of the repository)

Needs mcap, mcap-ros2-support, numpy, opencv-python-headless, onnxruntime and trackers, all from PyPI.
NETWORK.onnx is YOLOX-Nano; TAGALONG names the program (target/release/tagalong). Each log needs
LOG.people.csv, or LOG.boxes.csv with whole bodies, beside it. Every tracker gets the same boxes, from a
score of 0.1 on, and none gets depth; those of `trackers` have their default settings, but start tracks from
0.5 on, because YOLOX-Nano is seldom as sure as 0.7. BoT-SORT also gets the images, for the motion of the
camera. Whole bodies become the upper bodies of the truth by a height of 1.7 m, for all alike.

Prints HOTA, IDF1 and ID switches: means over the logs and the sum of the switches, then HOTA by log.
"""

import inspect
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from mot_trackers import PEERS
from whole_programs import SCORE, detections, images, network, people, scores, upper_body_row

OURS = {
    "`recorded`": "",
    "`recorded` without appearance": "[reidentification]\nremember_s = 0.0\nassociation_weight = 0.0\n",
    "the better of overlap and appearance": '[associator.config]\nfusion = "minimum"\n',
    "weight 1": "[reidentification]\nassociation_weight = 1.0\n",
    "weight 2": "[reidentification]\nassociation_weight = 2.0\n",
    "weight 8": "[reidentification]\nassociation_weight = 8.0\n",
}
"""Settings beside those of `configs/recorded.toml`."""

CONFIG = """
extends = "{recorded}"
without = ["depth"]

[[detectors]]
plugin = "recorded-detections"
config = {{ min_score = 0.1, discover_score = 0.5, path = "{boxes}" }}
"""


def write_boxes(session, log, path):
    """Writes the boxes of the network as det.txt of the MOTChallenge; returns them with their images."""
    frames = []
    with open(path, "w") as rows:
        for frame, image in enumerate(images(log), 1):
            boxes, sure = people(session, image)
            frames.append((image, boxes, sure))
            for (left, top, right, bottom), score in zip(boxes, sure):
                rows.write(f"{frame},-1,{left:.2f},{top:.2f},{right - left:.2f},{bottom - top:.2f},{score:.4f}\n")
    return frames


def write_peer(peer, frames, path):
    """Writes the tracks of a tracker of `trackers`."""
    known = inspect.signature(peer.__init__).parameters
    sees = "enable_cmc" in known
    tracker = peer(**{name: SCORE for name in ["track_activation_threshold"] if name in known})
    with open(path, "w") as rows:
        for frame, (image, boxes, sure) in enumerate(frames, 1):
            found = tracker.update(detections(boxes, sure), image if sees else None)
            for box, score, track in zip(found.xyxy, found.confidence, found.tracker_id):
                if track >= 0:  # otherwise it is not confirmed yet
                    rows.write(upper_body_row(frame, track, box, score))


def write_ours(program, home, log, boxes, settings):
    """Runs `recorded` with settings of its own on the boxes; returns its folder."""
    recorded = Path("configs/recorded.toml").resolve()
    config = home / "config.toml"
    config.write_text(CONFIG.format(recorded=recorded, boxes=boxes) + settings)
    command = [program, "run", config, log, "-o", home / "ours", "--overwrite"]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode not in (0, 3):
        sys.exit(f"{command}: {done.stderr}")
    return home / "ours"


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    session, logs = network(sys.argv[1]), [Path(log).resolve() for log in sys.argv[2:]]
    program = str(Path(os.environ.get("TAGALONG", "target/release/tagalong")).resolve())
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        for log in logs:
            boxes = home / f"{log.stem}.det.txt"
            frames = write_boxes(session, log, boxes)
            for name, peer in PEERS.items():
                rows = home / "peer.csv"
                write_peer(peer, frames, rows)
                found.setdefault(name, []).append(scores(program, log, rows))
            for name, settings in OURS.items():
                tracks = write_ours(program, home, log, boxes, settings)
                found.setdefault(name, []).append(scores(program, log, tracks))
    print("| tracker | HOTA | IDF1 | switches | " + " | ".join(log.stem for log in logs) + " |")
    print("|---" * (4 + len(logs)) + "|")
    for name, by_log in found.items():
        hota, idf1, switches = ([float(log[figure]) for log in by_log] for figure in ("HOTA", "IDF1", "IDSW"))
        logs_of = " | ".join(f"{value:.3f}" for value in hota)
        print(f"| {name} | {np.mean(hota):.3f} | {np.mean(idf1):.3f} | {sum(switches):.0f} | {logs_of} |")


if __name__ == "__main__":
    main()
