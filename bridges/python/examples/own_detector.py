# Tracks the people of a detector of your own; this one finds what is bright in pictures that are drawn here.

import numpy as np
import tagalong


def detect(colour):
    """Returns boxes of whole people: x, y, width, height (pixels), and a probability."""
    rows, columns = np.nonzero(colour[:, :, 0] > 128)
    if len(rows) == 0:
        return []
    left, top = columns.min(), rows.min()
    return [(left, top, columns.max() + 1 - left, rows.max() + 1 - top, 0.9)]


camera = tagalong.Camera(640, 480, fx=525.0, height_m=1.2)
pipeline = tagalong.Pipeline.from_toml("recorded")
for count in range(30):
    # A person of 1.7 m who walks to the right, 4 m before the camera.
    colour = np.zeros((480, 640, 3), np.uint8)
    colour[174:397, 200 + 5 * count : 260 + 5 * count] = 255
    report = pipeline.step(colour, None, camera, None, 0.1 * count, detections=detect(colour))
    for track in report.tracks:
        if track.seen:
            print(f"{track.id} at {np.hypot(*track.position[:2]):.1f} m, box {track.box}")
