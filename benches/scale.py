"""Prints how the time of a frame grows with people, image size and length of the log.

Usage: python3 benches/scale.py [--memory] [TAGALONG] [CONFIG...]   (from the root of the repository)

TAGALONG is the program (target/release/tagalong); the configs are pipelines for colour and
depth (configs/depth-ekf.toml and configs/joint-particle.toml). Each row is a simulated crowd
that is recorded once and tracked on one thread. `frame` is all that the pipeline does with a
frame, `read` the wait for the next one. With --memory it prints how memory grows with the length of
the log instead: the largest memory of a run, and what each further frame adds to it.
"""

import json
import os
import subprocess
import sys
import tempfile

SCENE = """seed = 6
crowd = {people}
duration_s = {length}
[room]
size_m = [{side}, {side}]
[camera]
width = {width}
height = {height}
[robot]
start = [0.8, {middle}]
"""

BASE = {"people": 5, "length": 10, "width": 640, "height": 480}
ROWS = (
    [{"people": people} for people in (1, 5, 10, 20, 50)]
    + [{"width": width, "height": height} for width, height in ((320, 240), (1280, 720), (1920, 1080))]
    + [{"length": length} for length in (20, 100)]
)


LENGTHS_S = (20, 100, 400, 1200)
"""Of logs with small images, for --memory."""


def quietly(command):
    """What the command used."""
    with tempfile.TemporaryFile() as said:
        started = subprocess.Popen(command, stdout=said, stderr=said)
        # Of this child alone: the sum over all children has the largest memory of any of them.
        _, status, used = os.wait4(started.pid, 0)
        started.returncode = os.waitstatus_to_exitcode(status)
        if started.returncode != 0:
            said.seek(0)
            sys.exit(f"{' '.join(command)}: {said.read().decode(errors='replace')}")
    return used


def tracked(program, config, log, folder):
    out = os.path.join(folder, "out")
    used = quietly([program, "run", config, log, "-o", out, "--overwrite", "--threads", "1"])
    with open(os.path.join(out, "timings.json"), encoding="utf-8") as file:
        times = json.load(file)
    return times["whole frame"], times["read"], used


def recorded(program, settings, folder):
    path = os.path.join(folder, "scene.toml")
    log = os.path.join(folder, "scene.mcap")
    # Room for all of them: 4 m² each.
    side = max(8.0, 2.0 * (settings["people"] ** 0.5) + 4.0)
    with open(path, "w", encoding="utf-8") as file:
        file.write(SCENE.format(**settings, side=side, middle=side / 2))
    if os.path.exists(log):
        os.remove(log)
    quietly([program, "simulate", path, "-o", log])
    return log


def memory(program="target/release/tagalong", *configs):
    configs = configs or ("configs/depth-ekf.toml",)
    print("| pipeline | log [s] | frames | memory [MiB] | more for each further frame [KiB] |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        before = {}
        for length in LENGTHS_S:
            settings = BASE | {"people": 2, "length": length, "width": 64, "height": 48}
            log = recorded(program, settings, folder)
            for config in configs:
                frame, _, used = tracked(program, config, log, folder)
                name = os.path.basename(config).removesuffix(".toml")
                frames, kib = frame["frames"], used.ru_maxrss
                more = "-"
                if config in before:
                    frames_before, kib_before = before[config]
                    more = f"{(kib - kib_before) / (frames - frames_before):.2f}"
                before[config] = (frames, kib)
                print(f"| {name} | {length} | {frames} | {kib / 1024:.1f} | {more} |", flush=True)


def main(program="target/release/tagalong", *configs):
    configs = configs or ("configs/depth-ekf.toml", "configs/joint-particle.toml")
    print("| pipeline | frames | frame p50 [ms] | p99 | worst | read p50 | processor [ms/frame] |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for row in ROWS:
            settings = BASE | row
            log = recorded(program, settings, folder)
            for config in configs:
                frame, read, used = tracked(program, config, log, folder)
                busy_s = used.ru_utime + used.ru_stime
                name = os.path.basename(config).removesuffix(".toml")
                size = f"{settings['width']}x{settings['height']}"
                people = f"{settings['people']} {'person' if settings['people'] == 1 else 'people'}"
                row_name = f"{name}, {people}, {size}"
                if settings["length"] != BASE["length"]:
                    row_name += f", {settings['length']} s"
                cells = (row_name, frame["frames"])
                times = (frame["p50_ms"], frame["p99_ms"], frame["max_ms"], read["p50_ms"])
                times = [f"{ms:.2f}" for ms in (*times, 1e3 * busy_s / frame["frames"])]
                print("| " + " | ".join([*map(str, cells), *times]) + " |", flush=True)


arguments = sys.argv[1:]
job = main
if arguments[:1] == ["--memory"]:
    job = memory
    arguments = arguments[1:]
if any(argument.startswith("-") for argument in arguments):
    sys.exit(__doc__)
job(*arguments)
