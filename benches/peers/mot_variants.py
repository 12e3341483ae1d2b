"""Writes sequences of the MOTChallenge as a worse detector or a slower camera would give them.

Usage: python benches/peers/mot_variants.py ../shared/data/mot FOLDER

Each variant of the MOT15 sequences with the detections of SORT is a folder of sequences in
FOLDER, for `tagalong boxes FOLDER/NAME` and `mot_trackers.py FOLDER --set NAME`:

  plain      as they are.
  unsure     the log-odds of each score less 2: the detector is half as sure, and the boxes are
             the same. A score of 0.5 becomes 0.12, 0.88 becomes 0.5.
  half-rate  every other frame.
  slow       every fifth frame.
  all        all of them, and the fisheye sequences of `aghri`, to choose settings on.
"""

import argparse
import math
from pathlib import Path


def less_sure(score, by):
    """Returns a score whose log-odds are smaller."""
    log_odds = math.log(score / (1 - min(score, 1 - 1e-6))) - by
    return 1 / (1 + math.exp(-log_odds))


def thinned(lines, every):
    """Returns the lines of every so many frames, numbered from 1."""
    for line in lines:
        frame, rest = line.split(",", 1)
        if (int(frame) - 1) % every == 0:
            yield (int(frame) - 1) // every + 1, rest


def write_variant(mot, folder, every, by):
    """Writes all sequences with every so many frames and smaller scores."""
    for truth in sorted((mot / "gt" / "MOT15-train").iterdir()):
        out = folder / truth.name
        for part in ("gt", "det"):
            (out / part).mkdir(parents=True, exist_ok=True)
        info = []
        for line in (truth / "seqinfo.ini").read_text().splitlines():
            key, _, value = line.partition("=")
            if key == "seqLength":
                line = f"{key}={(int(value) + every - 1) // every}"
            elif key == "frameRate":
                line = f"{key}={float(value) / every:g}"
            info.append(line)
        (out / "seqinfo.ini").write_text("\n".join(info) + "\n")
        rows = thinned((truth / "gt" / "gt.txt").read_text().splitlines(), every)
        (out / "gt" / "gt.txt").write_text("".join(f"{frame},{rest}\n" for frame, rest in rows))
        boxes = (mot / "sort-detections" / truth.name / "det.txt").read_text().splitlines()
        with open(out / "det" / "det.txt", "w") as file:
            for frame, rest in thinned(boxes, every):
                fields = rest.split(",")
                fields[5] = f"{less_sure(float(fields[5]), by):.6f}"
                file.write(f"{frame},{','.join(fields)}\n")


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("mot", type=Path)
    parser.add_argument("folder", type=Path)
    args = parser.parse_args()
    variants = {"plain": (1, 0), "unsure": (1, 2), "half-rate": (2, 0), "slow": (5, 0)}
    links = {f"aghri-{path.name}": path for path in (args.mot / "aghri").iterdir()}
    for name, (every, by) in variants.items():
        write_variant(args.mot, args.folder / name, every, by)
        links |= {f"{path.name}-{name}": path for path in (args.folder / name).iterdir()}
    (args.folder / "all").mkdir(exist_ok=True)
    for name, path in links.items():
        link = args.folder / "all" / name
        link.unlink(missing_ok=True)
        link.symlink_to(path.resolve())


if __name__ == "__main__":
    main()
