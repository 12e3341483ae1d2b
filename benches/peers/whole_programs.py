"""Compares whole programs on recorded logs: the usual Python script for people, and Tagalong.

Usage: python benches/peers/whole_programs.py NETWORK.onnx LOG.mcap...   (from the root of the repository)

Needs mcap, mcap-ros2-support, numpy, opencv-python-headless, onnxruntime and trackers, all from PyPI.
NETWORK.onnx is YOLOX-Nano; TAGALONG names the program (target/release/tagalong). Each log needs
LOG.people.csv beside it. Every program runs on one core (taskset), reads the log from its file and writes
MOTChallenge rows. The script's whole bodies become the upper bodies of the truth as Tagalong's own do: a
person is 1.7 m high.

Columns: frames of the log by the time of the whole program, start included; largest memory; time from the
start of the program to the first row of a person; HOTA, IDF1, false reports per frame and recall.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SIDE = 416
SCORE = 0.5
OVERLAP = 0.6
UPPER = 0.57 / 1.7
"""Side of the upper-body square by the height of the box, for a person of 1.7 m."""


def people(session, image):
    """Boxes (left, top, right, bottom) and scores of the people in an image."""
    import cv2
    import numpy as np

    ratio = min(SIDE / image.shape[0], SIDE / image.shape[1])
    small = cv2.resize(image, (int(image.shape[1] * ratio), int(image.shape[0] * ratio)))
    padded = np.full((SIDE, SIDE, 3), 114, np.uint8)
    padded[: small.shape[0], : small.shape[1]] = small
    blob = padded.transpose(2, 0, 1)[None].astype(np.float32)
    out = session.run(None, {session.get_inputs()[0].name: blob})[0][0]
    cells, strides = [], []
    for stride in (8, 16, 32):
        columns, rows = np.meshgrid(np.arange(SIDE // stride), np.arange(SIDE // stride))
        cells.append(np.stack((columns, rows), 2).reshape(-1, 2))
        strides.append(np.full((len(cells[-1]), 1), stride))
    cells, strides = np.concatenate(cells), np.concatenate(strides)
    centre = (out[:, :2] + cells) * strides
    size = np.exp(out[:, 2:4]) * strides
    scores = out[:, 4] * out[:, 5]
    corner = centre - size / 2
    boxes = np.concatenate((corner, size), 1) / ratio
    likely = scores > 0.1
    boxes, scores = boxes[likely], scores[likely]
    kept = cv2.dnn.NMSBoxes(boxes.tolist(), scores.tolist(), 0.1, OVERLAP)
    kept = np.array(kept, int).reshape(-1)
    boxes, scores = boxes[kept], scores[kept]
    return np.concatenate((boxes[:, :2], boxes[:, :2] + boxes[:, 2:]), 1), scores


def network(path):
    """A network on one thread of onnxruntime."""
    import cv2
    import onnxruntime

    cv2.setNumThreads(1)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])


def images(log):
    """The colour images of a log, one after the other."""
    import cv2
    import numpy as np
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with open(log, "rb") as file:
        for schema, _, _, message in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            if schema.name != "sensor_msgs/msg/CompressedImage" or "depth" in message.format.lower():
                continue
            yield cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)


def upper_body_row(frame, track, box, score):
    """A line of tracks.csv: the upper body in the box of a whole person."""
    height = box[3] - box[1]
    side = UPPER * height
    left = 0.5 * (box[0] + box[2]) - 0.5 * side
    top = box[1] - 0.025 / 1.7 * height
    return f"{frame},{track},{left:.2f},{top:.2f},{side:.2f},{side:.2f},{score:.4f},-1,-1,-1\n"


def detections(boxes, scores):
    """Boxes with their scores, as `trackers` takes them."""
    import numpy as np
    import supervision

    return supervision.Detections(
        xyxy=boxes.astype(np.float32).reshape(-1, 4),
        confidence=scores.astype(np.float32),
        class_id=np.zeros(len(scores), int),
    )


def script(path, log, out):
    """The usual script: reads the log, finds people, tracks them by ByteTrack."""
    import trackers

    session = network(path)
    # Its defaults but for the threshold: YOLOX-Nano is seldom as sure as 0.7.
    tracker = trackers.ByteTrackTracker(track_activation_threshold=SCORE)
    with open(out, "w", buffering=1) as rows:
        for frame, image in enumerate(images(log), 1):
            boxes, scores = people(session, image)
            found = tracker.update(detections(boxes, scores))
            for box, score, track in zip(found.xyxy, found.confidence, found.tracker_id):
                if track >= 0:  # otherwise it is not confirmed yet
                    rows.write(upper_body_row(frame, track, box, score))


def timed(command, rows):
    """Seconds and MiB of a program, and seconds to the first row of its file."""
    started = time.monotonic()
    child = subprocess.Popen(["taskset", "-c", "0", *command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    first = None
    peak = 0
    status = Path(f"/proc/{child.pid}/status")
    while child.poll() is None:
        if first is None and rows.exists() and rows.stat().st_size:
            first = time.monotonic() - started
        try:
            text = status.read_text()
            peak = max(peak, int(text.split("VmHWM:")[1].split()[0]))
        except (OSError, IndexError):
            pass
        time.sleep(0.005)
    took = time.monotonic() - started
    if child.returncode not in (0, 3):
        sys.exit(f"{command}: {child.stderr.read().decode()}")
    return took, peak / 1024, first


def scores(program, log, tracks):
    """Figures of tracks of upper bodies."""
    people_csv = log.with_suffix(".people.csv")
    truth = [people_csv] if people_csv.exists() else [log.with_suffix(".boxes.csv"), "--upper-body"]
    command = [program, "eval", "--tracks", tracks, "--truth", *truth]
    out = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=True).stdout
    words = (line.split() for line in out.splitlines())
    return {line[0]: line[1] for line in words if len(line) == 2}


def main():
    if len(sys.argv) == 5 and sys.argv[1] == "--script":
        return script(*sys.argv[2:])
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    onnx, logs = Path(sys.argv[1]).resolve(), [Path(log).resolve() for log in sys.argv[2:]]
    program = str(Path(os.environ.get("TAGALONG", "target/release/tagalong")).resolve())
    figures = ["HOTA", "IDF1", "fp_per_frame", "recall"]
    print("| log | program | frames/s | MiB | first row s | " + " | ".join(figures) + " |")
    print("|---" * (5 + len(figures)) + "|")
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        os.environ["TAGALONG_HOME"] = str(home / "data")
        subprocess.run([program, "model", "--install", onnx, "--name", "network"], check=True, stdout=subprocess.DEVNULL)
        for log in logs:
            rows = home / f"{log.stem}.csv"
            programs = {
                "Python: OpenCV, YOLOX-Nano (onnxruntime), ByteTrack": (
                    [sys.executable, __file__, "--script", onnx, log, rows],
                    rows,
                )
            }
            for config in ("network", "network-depth", "depth-verified"):
                out = home / f"{log.stem}-{config}"
                run = [program, "run", config, log, "-o", out, "--threads", "1"]
                programs[f"`{config}`"] = (run, out / "tracks.csv")
            for name, (command, tracks) in programs.items():
                took, peak, first = timed([str(part) for part in command], tracks)
                found = scores(program, log, tracks)
                frames = int(found["frames"])
                told = "-" if first is None else f"{first:.1f}"
                row = " | ".join(f"{float(found[figure]):.3f}" for figure in figures)
                print(f"| {log.stem} | {name} | {frames / took:.1f} | {peak:.0f} | {told} | {row} |", flush=True)


if __name__ == "__main__":
    main()
