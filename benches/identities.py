"""Lists ID switches and inherited IDs of a run, with the frames and the people.

Usage: python benches/identities.py TRUTH.people.csv RUN_FOLDER

A switch: a person has another ID than when matched last. An inherited ID: a person has the ID that
another person had last. Boxes match at an IoU of 0.4 and more, the best pairs of a frame first.
"""

import csv
import sys
from pathlib import Path

MIN_IOU = 0.4


def read_truth(path):
    """Returns the people of each frame: number and box."""
    frames = {}
    with open(path) as file:
        for row in csv.DictReader(file):
            box = tuple(float(row[key]) for key in ("ub_x", "ub_y", "ub_w", "ub_h"))
            frames.setdefault(int(row["frame"]), []).append((int(row["id"]), box))
    return frames


def read_tracks(path):
    """Returns the tracks of each frame: ID and box."""
    frames = {}
    with open(path) as file:
        for row in csv.reader(file):
            if row and row[0].isdigit():
                box = tuple(float(value) for value in row[2:6])
                frames.setdefault(int(row[0]), []).append((int(row[1]), box))
    return frames


def iou(a, b):
    """Returns the intersection over union of two boxes."""
    width = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    height = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return 0.0
    return width * height / (a[2] * a[3] + b[2] * b[3] - width * height)


def matches(people, tracks):
    """Returns pairs of a person's number and a track's ID, sorted."""
    pairs = sorted(((iou(box, seen), person, track) for person, box in people
                    for track, seen in tracks), reverse=True)
    taken, found = set(), []
    for overlap, person, track in pairs:
        if overlap >= MIN_IOU and not {("p", person), ("t", track)} & taken:
            taken |= {("p", person), ("t", track)}
            found.append((person, track))
    return sorted(found)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    truth = read_truth(sys.argv[1])
    tracks = read_tracks(Path(sys.argv[2]) / "tracks.csv")
    id_of, person_of, switches, inherited = {}, {}, [], []
    for frame in sorted(truth):
        for person, track in matches(truth[frame], tracks.get(frame, [])):
            last_id, last_frame = id_of.get(person, (track, frame))
            if last_id != track:
                switches.append(f"frame {frame}: person {person} is {track}, and was {last_id} in "
                                f"frame {last_frame}")
            last_person, last_frame = person_of.get(track, (person, frame))
            if last_person != person:
                inherited.append(f"frame {frame}: person {person} has the ID {track} that person "
                                 f"{last_person} had in frame {last_frame}")
            id_of[person], person_of[track] = (track, frame), (person, frame)
    for title, events in (("switches", switches), ("inherited IDs", inherited)):
        print(f"{len(events)} {title}", *events, sep="\n  ")


if __name__ == "__main__":
    main()
