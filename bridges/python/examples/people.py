"""Tracks the people of a log, frame by frame, and plots them.

Cells begin with `# %%`: editors run them one by one, as a notebook.

    python examples/people.py [LOG.mcap] [-o PICTURE.png]

Without a log the program simulates one.
"""

# %% The log: yours, or a simulated one with two people.
import argparse
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import tagalong

parser = argparse.ArgumentParser()
parser.add_argument("log", nargs="?", type=Path)
parser.add_argument("-o", "--output", type=Path, default=Path("people.png"))
arguments = parser.parse_args()
log = arguments.log
if log is None:
    scene = Path(tempfile.mkdtemp()) / "scene.toml"
    scene.write_text(
        """
seed = 1
duration_s = 8.0
[room]
size_m = [8.0, 6.0]
[robot]
start = [0.8, 3.0]
path = [[6.0, 3.0]]
speed_mps = 0.2
[[people]]
path = [[4.0, 4.4], [4.0, 1.5]]
speed_mps = 0.45
[[people]]
path = [[5.4, 1.1], [5.4, 4.8]]
speed_mps = 0.55
"""
    )
    log = scene.with_suffix(".mcap")
    assert tagalong.main(["simulate", str(scene), "-o", str(log)]) == 0


def in_view(report):
    """Counts the people whom this frame shows."""
    return sum(track.seen for track in report.tracks)


# %% One frame after the other. On a robot the arrays come from the camera's driver.
pipeline = tagalong.Pipeline.from_toml("depth-verified")
paths, shown, count = {}, None, 0
for frame in pipeline.frames(log):
    report = pipeline.step(
        frame.colour, frame.depth, frame.camera, frame.pose, frame.stamp_ns, index=frame.index
    )
    count += 1
    x, y, heading = frame.pose
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    for track in report.tracks:
        # Where nothing was detected the track is predicted: a gap in the path.
        at = turn @ track.position[:2] + (x, y) if track.seen else (np.nan, np.nan)
        sigma = np.sqrt(np.linalg.eigvalsh(track.covariance[:2, :2]).max())
        paths.setdefault(track.id, []).append((frame.stamp_ns * 1e-9, *at, sigma))
    # The picture shows the frame with most people in view.
    if shown is None or in_view(report) > in_view(shown[1]):
        shown = (frame, report)

# %% The picture: an image with boxes, the plan from above, and how sure each place is.
figure, (image, plan, certainty) = plt.subplots(1, 3, figsize=(15, 4.5), layout="constrained")
colours = {track: f"C{i}" for i, track in enumerate(paths)}
frame, report = shown
picture = frame.depth if frame.colour is None else frame.colour
image.imshow(picture, cmap=None if picture.ndim == 3 else "gray")
for track in report.tracks:
    if track.seen and track.box:
        left, top, width, height = track.box
        colour = colours[track.id]
        image.add_patch(plt.Rectangle((left, top), width, height, fill=False, ec=colour, lw=2))
        image.text(left, top - 3, f"{track.id}: {np.hypot(*track.position[:2]):.1f} m", color=colour)
image.set(title=f"frame {frame.index}", xlabel="column, px", ylabel="row, px")
for track, steps in paths.items():
    stamps, xs, ys, sigmas = np.array(steps).T
    plan.plot(xs, ys, color=colours[track], label=f"track {track}")
    seen = np.flatnonzero(np.isfinite(xs))
    plan.plot(xs[seen[-1:]], ys[seen[-1:]], "o", color=colours[track])
    certainty.plot(stamps - paths[min(paths)][0][0], sigmas, color=colours[track])
plan.plot(0, 0, "k^", label="robot at the start")
plan.set(title="plan, odometry frame", xlabel="x, m", ylabel="y, m", aspect="equal")
# Below the plan, where it hides no path.
plan.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=4)
certainty.set(title="uncertainty of the place", xlabel="time, s", ylabel="standard deviation, m")
figure.savefig(arguments.output, dpi=100)
print(f"{len(paths)} tracks in {count} frames: {arguments.output}")
