"""Counts the processor instructions that pipelines take for a frame, and compares them with a budget.

Usage: python3 benches/instructions.py [--check | --write] [--profile PROFILE] [TAGALONG]   (from the root of the repository)

TAGALONG is the program (target/release/tagalong), PROFILE how it was built: release (the default) or dev. A
scene is simulated twice, once longer, and both logs are tracked on one thread under Valgrind;
the difference of the counts over that of the frames holds reading, decoding, tracking and writing, and no
start. It repeats to a hundredth, whatever else the machine does. Valgrind's processor has AVX2 and no
AVX-512. --check fails if a pipeline takes a tenth more than its budget in benches/instructions.toml, and
--write renews the budgets of the profile. Without Valgrind, or on another processor, it says that it skips.
"""

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor

BUDGETS = "benches/instructions.toml"
TOLERANCE = 0.1

LASER = ("following", "laser.rays=360", "camera.width=64", "camera.height=48")
DEPTH = ("follow-passing", "camera.width=640", "camera.height=480")
PIPELINES = {
    "laser-legs": LASER,
    "follow-depth": DEPTH,
    "follow-low": (*DEPTH, "camera.height_m=0.4"),
    "depth-verified": DEPTH,
}
LENGTHS_S = {LASER: (4, 8)}
"""Of the two logs of a scene, if not 1 and 2 s: legs are confirmed once they have walked."""

# Registers of NEON are half as wide as those of AVX2, so that it takes at most twice as many instructions.
NEON = 2
# Instructions a second of one core: clock by instructions per clock, which are assumed and not measured.
BOARDS = (
    ("Raspberry Pi 3", 1.2e9 * 0.7),  # Cortex-A53
    ("Raspberry Pi 4", 1.5e9 * 1.2),  # Cortex-A72
    ("Raspberry Pi 5", 2.4e9 * 2.0),  # Cortex-A76
)


def missing():
    """Returns why nothing can be counted here, or None."""
    if shutil.which("valgrind") is None:
        return "valgrind is not installed"
    if platform.machine() != "x86_64":
        return "the budgets are those of x86-64"
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        flags = set(file.read().split())
    return None if {"avx2", "fma"} <= flags else "the processor has no AVX2"


def said(command):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: {done.stdout}{done.stderr}")
    return done.stderr


def counted(program, config, scene, length_s, folder):
    """Returns instructions and frames of a run over a scene of this length."""
    stem = os.path.join(folder, f"{config}-{length_s}")
    name, *settings = scene
    sets = [word for setting in (f"duration_s={length_s}", *settings) for word in ("--set", setting)]
    said([program, "simulate", f"configs/scenes/{name}.toml", *sets, "-o", f"{stem}.mcap"])
    # Its own name for this tool in old versions; newer ones simulate no cache unless they are asked to.
    valgrind = ["valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]
    run = [program, "run", f"configs/{config}.toml", f"{stem}.mcap", "-o", stem, "--threads", "1"]
    refs = re.search(r"I\s+refs:\s+([\d,]+)", said([*valgrind, *run]))
    if refs is None:
        sys.exit("valgrind printed no count")
    with open(os.path.join(stem, "timings.json"), encoding="utf-8") as file:
        frames = json.load(file)["whole frame"]["frames"]
    return int(refs[1].replace(",", "")), frames


def per_frame(program, config, folder):
    """Returns the instructions that a further frame takes, in millions."""
    scene = PIPELINES[config]
    (short, before), (long, after) = (
        counted(program, config, scene, length_s, folder) for length_s in LENGTHS_S.get(scene, (1, 2))
    )
    return (long - short) / (after - before) / 1e6


def rates(millions):
    """Returns the frames a second of each board on one core: an estimate."""
    return [per_s / (1e6 * millions * NEON) for _, per_s in BOARDS]


def rounded(rate):
    return f"{rate:.1f}" if rate < 10 else f"{rate:.0f}"


def all_budgets():
    with open(BUDGETS, "rb") as file:
        return tomllib.load(file)


def write(budgets):
    with open(BUDGETS, "w", encoding="utf-8") as file:
        file.write("# Millions of instructions a frame, by the profile of the program.\n")
        file.write("# Written by `python3 benches/instructions.py --write`.\n")
        for profile, figures in sorted(budgets.items()):
            file.write(f"\n[{profile}]\n")
            file.writelines(f"{config} = {millions:.2f}\n" for config, millions in figures.items())


def main(job, profile, program):
    reason = missing()
    if reason is not None:
        print(f"skipped: {reason}", file=sys.stderr)
        return
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        figures = pool.map(lambda config: per_frame(program, config, folder), PIPELINES)
        figures = dict(zip(PIPELINES, figures, strict=True))
    if job == "--write":
        write(all_budgets() | {profile: figures})
    budgets = all_budgets()[profile]
    first, *others = (name for name, _ in BOARDS)
    boards = [f"frames/s on {first}", *(name.split()[-1] for name in others)]
    print(f"| pipeline | instructions a frame [M] | budget [M] | {' | '.join(boards)} |")
    print(f"|---|---|---|{'---|' * len(BOARDS)}")
    for config, millions in figures.items():
        told = " | ".join(map(rounded, rates(millions)))
        print(f"| {config} | {millions:.2f} | {budgets[config]:.2f} | {told} |")
    over = [config for config in figures if figures[config] > (1 + TOLERANCE) * budgets[config]]
    if job == "--check" and over:
        sys.exit(f"more than a tenth above the budget: {', '.join(over)}")


arguments = sys.argv[1:]
wanted = arguments.pop(0) if arguments[:1] in (["--check"], ["--write"]) else "print"
built = "release"
if arguments[:1] == ["--profile"] and len(arguments) > 1:
    _, built, *arguments = arguments
if len(arguments) > 1 or any(argument.startswith("-") for argument in arguments):
    sys.exit(__doc__)
main(wanted, built, *(arguments or ["target/release/tagalong"]))
