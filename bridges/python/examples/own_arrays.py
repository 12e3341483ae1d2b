# Tracks a person in depth images that the program has in memory, with the camera that took them.

import math

import numpy as np
import tagalong

# Parts of a person as ellipses: centre below that of the head, half width, half height, m.
PARTS = [(0, 0.08, 0.115), (0.15, 0.065, 0.13), (0.4, 0.24, 0.21), (0.62, 0.19, 0.38), (1.2, 0.17, 0.45)]

# A floor, a wall at 5 m, and a person of 1.7 m before it, at 2.5 m.
column, row = np.meshgrid(np.arange(640) - 319.5, np.arange(480) - 239.5)
depth = np.where(row > 0, np.minimum(1.2 * 525 / np.where(row > 0, row, 1), 5), 5)
for centre, width, height in PARTS:
    across, below = column / 210 / width, (row / 210 + 0.4 - centre) / height
    depth = np.where(np.hypot(across, below) < 1, 2.5, depth)

camera = tagalong.Camera(640, 480, fx=525.0, height_m=1.2)
pipeline = tagalong.Pipeline.from_toml("depth-ekf")
for count in range(20):
    for track in pipeline.step(None, depth.astype(np.float32), camera, None, 0.1 * count).tracks:
        print(f"{track.id} at {math.hypot(*track.position[:2]):.2f} m")
