# Steers a robot after the person in front of it; the frames come from a log, `people.mcap`.

import tagalong

pipeline = tagalong.Pipeline.from_toml("follow-depth")
for frame in pipeline.frames("people.mcap"):
    report = pipeline.step_frame(frame)
    command = pipeline.command_at(frame.stamp_ns)
    if report.target is not None:
        print(f"track {report.target}: {command.linear_mps:.2f} m/s, {command.angular_rps:.2f} rad/s ({command.reason})")
