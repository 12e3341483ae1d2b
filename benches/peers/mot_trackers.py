"""Scores trackers that get the very same boxes: five of `trackers`, and Tagalong.

Usage: python benches/peers/mot_trackers.py ../shared/data/mot [--ours FOLDER]... [--set NAME]

Needs `pip install trackers trackeval`. SORT, ByteTrack, OC-SORT, BoT-SORT and C-BIoU of
roboflow's `trackers` run with their default settings. TrackEval scores all of them by the rules
of the set, IoU 0.5 for MOTA and IDF1. Means are over sequences; "all" counts all boxes together.

  MOT15  eleven sequences with the detections that SORT was published with.
  MOT17  four sequences with the boxes of a tracker's output, its numbers removed; they have no
         scores, so that a second stage for doubtful boxes has nothing to do.
  NAME   any other folder of sequences in the first argument, each with seqinfo.ini, gt/gt.txt and
         det/det.txt, as `mot_variants.py` writes them; scored by the rules of MOT15.

`--ours FOLDER` is what `tagalong boxes -o FOLDER` wrote: a folder for each config, with
SEQUENCE.txt for each sequence.

There are no images beside these boxes, so that BoT-SORT runs without its compensation of the
camera's motion, and without appearance, as everything here does.
"""

import argparse
import contextlib
import io
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy

# TrackEval was written for numpy 1, which had these names for Python's types.
numpy.float, numpy.int = float, int

import supervision  # noqa: E402
import trackeval  # noqa: E402
import trackers  # noqa: E402

PEERS = {
    "SORT": trackers.SORTTracker,
    "ByteTrack": trackers.ByteTrackTracker,
    "OC-SORT": trackers.OCSORTTracker,
    "BoT-SORT": trackers.BoTSORTTracker,
    "C-BIoU": trackers.CBIoUTracker,
}


def truth_of(mot, benchmark):
    """Returns the folder with the truth of a set."""
    if benchmark in ("MOT15", "MOT17"):
        return mot / "gt" / f"{benchmark}-train"
    return mot / benchmark


def rules_of(benchmark):
    """Returns the benchmark by whose rules a set is scored."""
    return "MOT17" if benchmark == "MOT17" else "MOT15"


def boxes_of(mot, benchmark, sequence):
    """Returns the file with the boxes of a sequence."""
    if benchmark == "MOT15":
        return mot / "sort-detections" / sequence / "det.txt"
    if benchmark == "MOT17":
        return mot / "tracker-output" / "MOT17-train" / f"{sequence}.txt"
    return mot / benchmark / sequence / "det" / "det.txt"


def read_boxes(path):
    """Returns corners and scores by frame."""
    frames = {}
    for line in path.read_text().splitlines():
        frame, _, x, y, width, height, score = (float(v) for v in line.split(",")[:7])
        frames.setdefault(int(frame), []).append((x, y, x + width, y + height, score))
    return {frame: numpy.array(rows) for frame, rows in frames.items()}


def length_of(truth):
    """Returns the number of frames that seqinfo.ini names."""
    lines = (truth / "seqinfo.ini").read_text().splitlines()
    return int(next(line.split("=")[1] for line in lines if line.startswith("seqLength")))


def track(peer, boxes, length):
    """Returns the tracks as lines of the MOTChallenge, and the seconds that it took."""
    tracker, lines, spent = peer(), [], 0.0
    for frame in range(1, length + 1):
        rows = boxes.get(frame, numpy.empty((0, 5)))
        found = supervision.Detections(xyxy=rows[:, :4], confidence=rows[:, 4],
                                       class_id=numpy.zeros(len(rows), dtype=int))
        start = time.perf_counter()
        tracked = tracker.update(found)
        spent += time.perf_counter() - start
        for (left, top, right, bottom), number in zip(tracked.xyxy, tracked.tracker_id):
            # -1 is a box that belongs to no track yet.
            if number >= 0:
                lines.append(f"{frame},{number + 1},{left:.3f},{top:.3f},{right - left:.3f},"
                             f"{bottom - top:.3f},1,-1,-1,-1")
    return lines, spent


def write_peers(mot, benchmark, names, folder):
    """Runs the peers and writes their tracks; returns frames a second by peer."""
    rates = {}
    for name, peer in PEERS.items():
        frames = seconds = 0
        (folder / name / "data").mkdir(parents=True)
        for sequence in names:
            length = length_of(truth_of(mot, benchmark) / sequence)
            boxes = read_boxes(boxes_of(mot, benchmark, sequence))
            lines, spent = track(peer, boxes, length)
            (folder / name / "data" / f"{sequence}.txt").write_text("\n".join(lines) + "\n")
            frames, seconds = frames + length, seconds + spent
        rates[name] = frames / seconds
    return rates


def link_ours(ours, names, folder):
    """Links the tracks of Tagalong's configs; a config that lacks a sequence is left out."""
    for config in (path for root in ours for path in sorted(Path(root).iterdir())):
        files = [config / f"{sequence}.txt" for sequence in names]
        if all(file.exists() for file in files):
            data = folder / f"tagalong {config.name}" / "data"
            data.mkdir(parents=True)
            for file in files:
                (data / file.name).symlink_to(file.resolve())


def score(mot, benchmark, names, folder):
    """Returns TrackEval's results by tracker and sequence."""
    truth = folder / "gt"
    (truth / "seqmaps").mkdir(parents=True)
    rules = rules_of(benchmark)
    (truth / f"{rules}-train").symlink_to(truth_of(mot, benchmark).resolve())
    (truth / "seqmaps" / f"{rules}-train.txt").write_text("name\n" + "\n".join(names) + "\n")
    dataset = trackeval.datasets.MotChallenge2DBox({
        **trackeval.datasets.MotChallenge2DBox.get_default_dataset_config(),
        "BENCHMARK": rules, "PRINT_CONFIG": False,
        "GT_FOLDER": str(truth), "TRACKERS_FOLDER": str(folder / "trackers"),
    })
    evaluator = trackeval.Evaluator({
        **trackeval.Evaluator.get_default_eval_config(),
        "USE_PARALLEL": False, "PRINT_RESULTS": False, "PRINT_CONFIG": False,
        "OUTPUT_SUMMARY": False, "OUTPUT_DETAILED": False, "PLOT_CURVES": False,
        "TIME_PROGRESS": False, "BREAK_ON_ERROR": True,
    })
    metrics = [trackeval.metrics.HOTA(), trackeval.metrics.CLEAR({"PRINT_CONFIG": False}),
               trackeval.metrics.Identity({"PRINT_CONFIG": False})]
    with contextlib.redirect_stdout(io.StringIO()):
        results, _ = evaluator.evaluate([dataset], metrics)
    return results["MotChallenge2DBox"]


def figures(result):
    """Returns HOTA, IDF1, MOTA in per cent, and the switches."""
    result = result["pedestrian"]
    return [100 * float(numpy.mean(result["HOTA"]["HOTA"])),
            100 * float(result["Identity"]["IDF1"]),
            100 * float(result["CLEAR"]["MOTA"]), int(result["CLEAR"]["IDSW"])]


def table(benchmark, names, results):
    """Prints the means, and HOTA and IDF1 of each sequence."""
    print(f"\n**{benchmark}, {len(names)} sequences**\n")
    print("| tracker | HOTA, mean | IDF1, mean | MOTA, mean | switches "
          "| HOTA, all | IDF1, all | MOTA, all |")
    print("| --- " * 8 + "|")
    order = [*PEERS, *sorted(set(results) - set(PEERS))]
    for tracker in order:
        rows = [figures(results[tracker][name]) for name in names]
        mean = numpy.mean(rows, axis=0)
        hota, idf1, mota, switches = figures(results[tracker]["COMBINED_SEQ"])
        print(f"| {tracker} | {mean[0]:.2f} | {mean[1]:.2f} | {mean[2]:.2f} | {switches} "
              f"| {hota:.2f} | {idf1:.2f} | {mota:.2f} |")
    # A title of its own, because pages repeat one table and not the other.
    print(f"\n**{benchmark}, HOTA / IDF1 of each sequence**\n")
    print("| sequence | " + " | ".join(order) + " |")
    print("| --- " * (len(order) + 1) + "|")
    for name in names:
        cells = [figures(results[tracker][name]) for tracker in order]
        print(f"| {name} | " + " | ".join(f"{c[0]:.1f} / {c[1]:.1f}" for c in cells) + " |")


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("mot", type=Path)
    parser.add_argument("--ours", action="append", default=[])
    parser.add_argument("--set", default="MOT15")
    args = parser.parse_args()
    names = sorted(os.listdir(truth_of(args.mot, args.set)))
    with tempfile.TemporaryDirectory() as root:
        trackers_folder = Path(root) / "trackers" / f"{rules_of(args.set)}-train"
        rates = write_peers(args.mot, args.set, names, trackers_folder)
        link_ours(args.ours, names, trackers_folder)
        table(args.set, names, score(args.mot, args.set, names, Path(root)))
        # Times differ from run to run, so they are no part of the tables.
        for peer, rate in rates.items():
            print(f"{peer}: {rate:.0f} frames/s", file=sys.stderr)


if __name__ == "__main__":
    main()
