# Prints the people of a log: `people.mcap` in the current folder.

import math

import tagalong

pipeline = tagalong.Pipeline.from_toml("depth-verified")
for frame in pipeline.frames("people.mcap"):
    for track in pipeline.step_frame(frame).tracks:
        if track.seen:
            print(f"{track.id} at {math.hypot(*track.position[:2]):.2f} m")
