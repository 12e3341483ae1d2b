"""Lists the kinds of ID switches, inherited IDs and missed people of runs, as Markdown tables.

Usage: python3 benches/identities.py LOGS_FOLDER RUNS_FOLDER LOG...
       python3 benches/identities.py TRUTH.people.csv RUN_FOLDER

The first form reads LOGS_FOLDER/LOG.people.csv and RUNS_FOLDER/LOG. The numbers of switches and of
inherited IDs are `IDSW` and `inherited_ids` of `tagalong eval`; here boxes match at an IoU of 0.4 and
more, the best pairs of a frame first.

Kinds, the first that fits:
  recognised wrongly   inherited, and not reported in each frame since
  of the one beside    inherited while the person whose ID it was is near in the image
  of a vague track     inherited otherwise: a track that was predicted took a newcomer
  swapped              switched in the frame in which somebody else takes the earlier ID
  lost while hidden    switched after a frame in which another person hides a quarter or more
  lost at the border   switched after, or in, a frame in which the border cuts the person
  lost at low rate     switched, at images more than 0.4 s apart
  lost                 switched otherwise

Below stand the people who are missed, in people-frames: those whom the border of the image cuts,
those of whom another person or a thing hides a quarter or more, and the others.
"""

import csv
import sys
from pathlib import Path

MIN_IOU = 0.4
LOW_RATE_S = 0.4
HIDDEN = 0.8


class Person:
    """One annotated person in one frame."""

    def __init__(self, row):
        self.number = int(row["id"])
        self.box = tuple(float(row[key]) for key in ("ub_x", "ub_y", "ub_w", "ub_h"))
        self.occluder = row.get("occluder", "0")
        self.visible = float(row.get("visible") or 1.0)
        self.is_ignored = row.get("ignore") == "1"

    def is_hidden(self):
        """Returns true if another person hides a quarter of this one or more."""
        return self.occluder.isdigit() and self.occluder != "0" and self.visible < HIDDEN

    def is_at_border(self):
        """Returns true if the border cuts the person, or the box begins at it."""
        return self.occluder == "border" or self.box[0] <= 0.0


def read_truth(path):
    """Returns the people of each frame."""
    frames = {}
    with open(path) as file:
        for row in csv.DictReader(file):
            frames.setdefault(int(row["frame"]), []).append(Person(row))
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


def read_reported(path):
    """Returns the IDs of each frame, predicted ones too, and the median time between frames, s."""
    frames, stamps = {}, {}
    with open(path) as file:
        for row in csv.DictReader(file):
            frames.setdefault(int(row["frame"]), set()).add(int(row["id"]))
            stamps[int(row["frame"])] = int(row["stamp_ns"]) / 1e9
    order = sorted(stamps)
    steps = sorted((stamps[b] - stamps[a]) / (b - a) for a, b in zip(order, order[1:]))
    return frames, steps[len(steps) // 2] if steps else 0.0


def iou(a, b):
    """Returns the intersection over union of two boxes."""
    width = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    height = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return 0.0
    return width * height / (a[2] * a[3] + b[2] * b[3] - width * height)


def matches(people, tracks):
    """Returns pairs of a person's number and a track's ID, sorted."""
    pairs = sorted(((iou(person.box, seen), person.number, track) for person in people
                    for track, seen in tracks), reverse=True)
    taken, found = set(), []
    for overlap, person, track in pairs:
        if overlap >= MIN_IOU and not {("p", person), ("t", track)} & taken:
            taken |= {("p", person), ("t", track)}
            found.append((person, track))
    return sorted(found)


def are_beside(a, b):
    """Returns true if the middles of two boxes are no more than two widths apart."""
    return abs(a[0] + a[2] / 2 - b[0] - b[2] / 2) <= 2 * min(a[2], b[2])


def kind_of_inherited(truth, reported, frame, person, last_person, last_frame, track):
    """Returns the kind of an inherited ID."""
    between = range(last_frame + 1, frame)
    if any(track not in reported.get(index, ()) for index in between):
        return "recognised wrongly"
    boxes = {one.number: one.box for one in truth[frame]}
    if last_person in boxes and are_beside(boxes[person], boxes[last_person]):
        return "of the one beside"
    return "of a vague track"


def kind_of_switch(truth, step_s, frame, person, last_frame, holders, last_id):
    """Returns the kind of a switch; `holders` are the people of this frame by their IDs."""
    if holders.get(last_id, person) != person:
        return "swapped"
    seen = [one for index in range(last_frame, frame + 1) for one in truth.get(index, ())
            if one.number == person]
    if any(one.is_hidden() for one in seen):
        return "lost while hidden"
    if step_s > LOW_RATE_S:
        return "lost at low rate"
    if any(one.is_at_border() for one in seen):
        return "lost at the border"
    return "lost"


def events(truth_path, run):
    """Returns the switches and the inherited IDs of a run: frame, event, kind."""
    truth = read_truth(truth_path)
    tracks = read_tracks(Path(run) / "tracks.csv")
    reported, step_s = read_reported(Path(run) / "tracks-metres.csv")
    id_of, person_of, switches, inherited = {}, {}, [], []
    for frame in sorted(truth):
        matched = matches(truth[frame], tracks.get(frame, []))
        holders = {track: person for person, track in matched}
        for person, track in matched:
            last_id, last_frame = id_of.get(person, (track, frame))
            if last_id != track:
                kind = kind_of_switch(truth, step_s, frame, person, last_frame, holders, last_id)
                switches.append((frame, f"person {person} is {track}, and was {last_id} in frame "
                                        f"{last_frame}", kind))
            last_person, last_frame = person_of.get(track, (person, frame))
            if last_person != person:
                kind = kind_of_inherited(truth, reported, frame, person, last_person,
                                         last_frame, track)
                inherited.append((frame, f"person {person} has the ID {track} that person "
                                         f"{last_person} had in frame {last_frame}", kind))
            id_of[person], person_of[track] = (track, frame), (person, frame)
    return switches, inherited


def misses(truth_path, run):
    """Returns the number of people-frames, and of those missed: cut by the border, hidden, others."""
    truth = read_truth(truth_path)
    tracks = read_tracks(Path(run) / "tracks.csv")
    people, missed = 0, [0, 0, 0]
    for frame, annotated in truth.items():
        found = {person for person, _ in matches(annotated, tracks.get(frame, []))}
        for person in annotated:
            people += not person.is_ignored
            if person.is_ignored or person.number in found:
                continue
            kind = 0 if person.occluder == "border" else 1 if person.visible < HIDDEN else 2
            missed[kind] += 1
    return people, missed


def main():
    arguments = sys.argv[1:]
    if len(arguments) < 2:
        sys.exit(__doc__)
    if len(arguments) == 2:
        runs = [(Path(arguments[1]).name, arguments[0], arguments[1])]
    else:
        logs, folder = Path(arguments[0]), Path(arguments[1])
        runs = [(log, logs / f"{log}.people.csv", folder / log) for log in arguments[2:]]
    print("| log | frame | event | kind |", "| --- | --- | --- | --- |", sep="\n")
    for log, truth, run in runs:
        switches, inherited = events(truth, run)
        for frame, event, kind in sorted(switches + inherited):
            print(f"| {log} | {frame} | {event} | {kind} |")
    print("\n| log | people-frames | missed | cut by the border | hidden | others |")
    print("|---" * 6 + "|")
    for log, truth, run in runs:
        people, missed = misses(truth, run)
        print(f"| {log} | {people} | {sum(missed)} | {missed[0]} | {missed[1]} | {missed[2]} |")


if __name__ == "__main__":
    main()
