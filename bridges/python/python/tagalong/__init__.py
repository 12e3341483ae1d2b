"""Detects and tracks people from a mobile robot.

A pipeline works on numpy arrays::

    import tagalong

    camera = tagalong.Camera(640, 480, fx=525.0, height_m=1.2)
    pipeline = tagalong.Pipeline.from_toml("depth-verified")
    report = pipeline.step(colour, depth, camera, (x, y, heading), stamp_ns)
    for track in report.tracks:
        print(track.id, track.position)

or on a log (``for frame in pipeline.frames("robot.mcap")``); ``run``, ``eval`` and ``main`` are the
commands of the program. Lengths are metres, angles radians, the robot's frame is x forward, y left,
z up.
"""

import json as _json
import os as _os
import signal as _signal
import sys as _sys

import numpy as _np

from . import _tagalong
from ._tagalong import (
    Camera,
    Command,
    ConfigError,
    Frame,
    Frames,
    Pipeline,
    Report,
    TagalongError,
    Track,
    __version__,
)

__all__ = [
    "Camera",
    "Command",
    "ConfigError",
    "Frame",
    "Frames",
    "Pipeline",
    "Report",
    "TagalongError",
    "Track",
    "__version__",
    "eval",
    "main",
    "read_tracks",
    "run",
]

# Columns that are no float; stamps would lose their nanoseconds as one.
_TYPES = {"stamp_ns": "i8", "frame": "i8", "id": "i8", "seen": "?"}
# Columns of the MOTChallenge, which have no names in the file.
_BOXES = ["frame", "id", "x", "y", "width", "height", "score"]


def main(arguments=None):
    """Run the program `tagalong` and return its exit code: 2 for wrong usage.

    arguments: those of the command line, without the program's name [default: sys.argv].
    """
    if arguments is not None:
        return _tagalong.main(list(arguments))
    # The program listens to Ctrl-C itself; Python would only notice it at the end.
    _signal.signal(_signal.SIGINT, _signal.SIG_DFL)
    return _tagalong.main(_sys.argv[1:])


def run(
    config,
    log,
    out,
    *,
    overlay=False,
    with_images=False,
    smoothed=False,
    overwrite=False,
    strict=False,
    seed=None,
    camera=None,
):
    """Run a pipeline over a log, as `tagalong run`, and return its report.json as a dict.

    config: a TOML file or the name of a built-in one; None selects one for the sensors in the log.
    out: the folder of results, which must not exist without `overwrite`. `overlay` adds a picture
    per frame, `with_images` the images to tracks.mcap (for Rerun and Foxglove), `smoothed` the file
    tracks-smoothed.csv. With `strict` a log with lost data raises TagalongError.
    `camera` names one of several cameras. Ctrl-C stops the run and leaves valid files.
    """
    _tagalong.run(
        config,
        log,
        out,
        overlay=overlay,
        with_images=with_images,
        smoothed=smoothed,
        overwrite=overwrite,
        strict=strict,
        seed=seed,
        camera=camera,
    )
    with open(_os.path.join(out, "report.json"), encoding="utf-8") as file:
        return _json.load(file)


def eval(
    truth,
    tracks,
    *,
    similarity="iou",
    log=None,
    rate=None,
    upper_body=False,
    repairs=False,
    drop_doubled_ids=False,
):
    """Compare tracks with truth, as `tagalong eval`, and return the figures as a dict.

    truth: MOTChallenge text, people.csv, KITTI labels, or a log with truth. tracks: the folder of a
    run, tracks-metres.csv, MOTChallenge text or KITTI labels. similarity: "iou" of boxes, or
    "metres" on the floor. log: the log of the truth, for its stamps [default: that of the run, at its
    path or beside the truth]. repairs: also return, as "repairs", HOTA, MOTA and IDF1 if one kind of
    error were repaired. drop_doubled_ids: keep the first person with an ID in each frame of the
    truth; otherwise a second one is an error.
    """
    return _json.loads(
        _tagalong.scores(
            truth,
            tracks,
            similarity=similarity,
            log=log,
            rate=rate,
            upper_body=upper_body,
            repairs=repairs,
            drop_doubled_ids=drop_doubled_ids,
        )
    )


def read_tracks(path, *, smoothed=False):
    """Read tracks as a dict of arrays, one per column and all of the same length.

    path: the folder of a run (tracks-metres.csv, and the boxes of tracks.csv as box_x, box_y,
    box_width, box_height, score; NaN where a track has no box), tracks-metres.csv, or MOTChallenge
    text. Rows with `seen` False are predicted: nothing was detected there. smoothed: only the
    boxes of tracks-smoothed.csv in the folder of a run, with corrected IDs.
    `pandas.DataFrame(read_tracks(path))` is a table of it.
    """
    path = _os.fspath(path)
    if not _os.path.isdir(path):
        if smoothed:
            raise ValueError(f"{path} is no folder of a run; smoothed tracks are in one")
        return _columns(path)
    if smoothed:
        path = _os.path.join(path, "tracks-smoothed.csv")
        if not _os.path.exists(path):
            raise TagalongError(f"{path}: no such file; it is of run(..., smoothed=True)")
        return _columns(path)
    tracks = _columns(_os.path.join(path, "tracks-metres.csv"))
    boxes = _columns(_os.path.join(path, "tracks.csv"))
    keys = zip(boxes["frame"].tolist(), boxes["id"].tolist())
    row_of = {key: row for row, key in enumerate(keys)}
    keys = zip(tracks["frame"].tolist(), tracks["id"].tolist())
    rows = _np.array([row_of.get(key, -1) for key in keys], dtype=int)
    for name in _BOXES[2:]:
        known = _np.append(boxes[name], _np.nan)
        tracks[name if name == "score" else f"box_{name}"] = known[rows]
    return tracks


def _columns(path):
    with open(path, encoding="utf-8") as file:
        first = file.readline().strip()
        file.seek(0)
        is_named = first.startswith("stamp_ns")
        names = first.split(",") if is_named else _BOXES
        kinds = [(name, _TYPES.get(name, "f8")) for name in names]
        lines = [line for line in file if line.strip()][1 if is_named else 0 :]
    if not lines:
        return {name: _np.empty(0, kind) for name, kind in kinds}
    try:
        table = _np.loadtxt(lines, kinds, delimiter=",", usecols=range(len(names)), ndmin=1)
    except (ValueError, IndexError) as error:
        raise TagalongError(f"{path}: {error}; tracks have the columns {', '.join(names)}") from None
    return {name: _np.ascontiguousarray(table[name]) for name in names}
